//! Tracks in the image: SORT and ByteTrack.
//!
//! Both follow rectangles from frame to frame with a Kalman filter of constant velocity whose noises couple no two
//! coordinates, so that each coordinate is a filter of its own. Frames are taken to be evenly spaced; one without
//! boxes is to be told too.

mod axis;
mod byte_track;
mod sort;
#[cfg(test)]
mod tests;

pub use byte_track::{ByteTrack, Params as ByteTrackParams};
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
