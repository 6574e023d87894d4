//! Tracks in the image: SORT, ByteTrack and DeepSORT.
//!
//! All follow rectangles from frame to frame with a Kalman filter of constant velocity whose noises couple no two
//! coordinates, so that each coordinate is a filter of its own. Frames are taken to be evenly spaced; one without
//! boxes is to be told too. Of more than [`BOXES_MAX`] boxes in a frame the surest ones count, so that a step ends.

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

/// One rectangle of a detector.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ImageDetection {
    /// Left, top, right, bottom, pixels; what is not finite or has no area is passed over.
    pub box_px: [f64; 4],
    /// Confidence, 0 to 1.
    pub score: f64,
}

/// One rectangle with an identity.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ImageTrack {
    /// From 1, in the order in which tracks are founded.
    pub id: u64,
    /// Left, top, right, bottom, pixels: the filter's, not the detector's.
    pub box_px: [f64; 4],
    /// That of the detection it was last seen by.
    pub score: f64,
}

/// A tracker of rectangles.
pub trait ImageTracker {
    /// Takes in the next frame and gives the tracks that are reported of it.
    fn update(&mut self, found: &[ImageDetection]) -> Vec<ImageTrack>;
}

/// Those that can be followed, each with its place, in their order.
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

/// The edges of a rectangle of this centre and size.
fn edges([x, y, width, height]: [f64; 4]) -> [f64; 4] {
    [x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height]
}
