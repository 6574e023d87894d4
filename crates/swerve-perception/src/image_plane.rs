//! Tracking in the image: SORT, ByteTrack and DeepSORT.
//!
//! All track rectangles from frame to frame with a constant-velocity Kalman filter whose noises are uncorrelated, so
//! that each coordinate is a separate filter. Frames are assumed to be evenly spaced; frames without boxes must be
//! passed too. If a frame has more than [`BOXES_MAX`] boxes, only those with the highest scores are used, which bounds
//! the run time.

mod appearance;
mod byte_track;
mod deep_sort;
mod motion;
mod sort;
#[cfg(test)]
mod tests;

use crate::bound::surest;

pub use crate::bound::BOXES_MAX;
pub use appearance::{Appearance, Look};
pub use byte_track::{ByteTrack, Params as ByteTrackParams};
pub use deep_sort::{DeepSort, Params as DeepSortParams};
pub use sort::{Params as SortParams, Sort};

/// Rectangle reported by a detector.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ImageDetection {
    /// Left, top, right, bottom, pixels; ignored if not finite or without area.
    pub box_px: [f64; 4],
    /// Confidence, 0 to 1.
    pub score: f64,
}

/// Rectangle with an identity.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ImageTrack {
    /// Identity, from 1 in the order of creation.
    pub id: u64,
    /// Left, top, right, bottom, pixels; estimate of the filter.
    pub box_px: [f64; 4],
    /// Score of its latest detection.
    pub score: f64,
}

/// Tracker of rectangles.
pub trait ImageTracker {
    /// Updates the tracks with the next frame and returns those reported in it.
    fn update(&mut self, found: &[ImageDetection]) -> Vec<ImageTrack>;
}

/// Usable detections with the highest scores, each with its index, in their order.
fn surest_usable(found: &[ImageDetection]) -> Vec<(usize, &ImageDetection)> {
    let mut usable: Vec<_> = found.iter().enumerate().filter(|(_, found)| is_usable(found)).collect();
    surest(&mut usable, |(_, found)| found.score);
    usable
}

fn is_usable(found: &ImageDetection) -> bool {
    let [left, top, right, bottom] = found.box_px;
    found.box_px.iter().all(|x| x.is_finite()) && right > left && bottom > top && !found.score.is_nan()
}

/// Centre and size of a rectangle.
fn centred([left, top, right, bottom]: [f64; 4]) -> [f64; 4] {
    let (width, height) = (right - left, bottom - top);
    [left + 0.5 * width, top + 0.5 * height, width, height]
}

/// Edges of a rectangle from its centre and size.
fn edges([x, y, width, height]: [f64; 4]) -> [f64; 4] {
    [x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height]
}
