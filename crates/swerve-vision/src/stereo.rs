//! Disparities of a rectified pair of images: semi-global matching (Hirschmüller, PAMI 2008) of census codes.
//!
//! ```text
//! two images ─> codes ─> costs of each pixel and disparity ─> sums along 4 or 8 paths ─> disparity
//!                                                          ─> unique, the same from the right, no speckle
//! ```
//!
//! Sums are of integers, so the result has the same bits everywhere. Costs are computed twice, on the way up and on
//! the way down, which is cheaper than to keep them: what is kept is one sum for each pixel and disparity.

mod census;
mod paths;
mod select;
mod speckles;
#[cfg(test)]
mod tests;

use swerve_geom::simd::widest;
use thiserror::Error;

use self::census::Census;
use self::paths::{Paths, Penalties};
use self::select::{Demands, Matches};
use self::speckles::Speckles;
use crate::Plane;

/// How many paths the costs of a pixel are summed along.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum PathCount {
    /// Along rows and columns.
    #[default]
    Four,
    /// Along the diagonals too: half as much work again.
    Eight,
}

/// For costs of 24 bits: three paths then sum to a byte. Larger ones, as tuned on KITTI for 31 bits (86 and 96;
/// Hernandez-Juarez and others, ICCS 2016), were no better on the pairs of `tests/reference/vision`.
const PENALTIES: Penalties = Penalties { small: 7, large: 54 };

/// What is searched, and what is asked of the result.
#[derive(Clone, Debug)]
pub struct StereoSettings {
    /// Disparities from 0 on: a multiple of 16, at most 256. What is nearer than the largest is not found.
    pub disparities: usize,
    /// Paths.
    pub paths: PathCount,
    /// By which share any other disparity is to be worse, percent, below 100. More of it: fewer and better pixels.
    pub uniqueness_percent: u8,
    /// What the disparity as the right image has it may differ by, pixels.
    pub left_right_px: usize,
    /// The smallest patch that stays, pixels.
    pub speckle_pixels: usize,
    /// What neighbours in a patch differ by at most, pixels of disparity.
    pub speckle_range_px: f32,
}

impl Default for StereoSettings {
    fn default() -> Self {
        Self {
            disparities: 64,
            paths: PathCount::default(),
            uniqueness_percent: 10,
            left_right_px: 1,
            speckle_pixels: 100,
            speckle_range_px: 1.0,
        }
    }
}

/// Why there are no disparities.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum StereoError {
    /// Too many disparities, or not in sixteens.
    #[error("{0} disparities, expected a multiple of 16 from 16 to 256")]
    Disparities(usize),
    /// A share that no disparity has.
    #[error("{0} percent of uniqueness, expected less than 100")]
    Uniqueness(u8),
    /// The images are no pair.
    #[error("a left image of {left:?} pixels and a right one of {right:?}, expected the same size")]
    Sizes {
        /// Columns and rows.
        left: (usize, usize),
        /// Columns and rows.
        right: (usize, usize),
    },
    /// Smaller than what is compared of it.
    #[error("images of {0} x {1} pixels, expected at least 7 x 7: that much around a pixel is compared")]
    TooSmall(usize, usize),
}

/// A matcher, with the memory that it needs for an image.
#[derive(Clone, Debug)]
pub struct Stereo {
    settings: StereoSettings,
    left: Census,
    right: Census,
    paths: Paths,
    /// Sums of the paths upwards, a byte for each pixel and disparity.
    upwards: Vec<u8>,
    downwards: Vec<u8>,
    sums: Vec<i16>,
    matches: Matches,
    speckles: Speckles,
}

impl Stereo {
    /// A matcher with these settings.
    ///
    /// # Errors
    /// Where a setting is out of its range.
    pub fn new(settings: StereoSettings) -> Result<Self, StereoError> {
        let count = settings.disparities;
        if !(16..=256).contains(&count) || !count.is_multiple_of(16) {
            return Err(StereoError::Disparities(count));
        }
        if settings.uniqueness_percent >= 100 {
            return Err(StereoError::Uniqueness(settings.uniqueness_percent));
        }
        Ok(Self {
            settings,
            left: Census::default(),
            right: Census::default(),
            paths: Paths::default(),
            upwards: Vec::new(),
            downwards: Vec::new(),
            sums: Vec::new(),
            matches: Matches::default(),
            speckles: Speckles::default(),
        })
    }

    /// Writes the disparity of each pixel of the left image, pixels: how much further left the right image has what
    /// it shows; NaN where that is not known.
    ///
    /// # Errors
    /// Where the images differ in size or are smaller than the window of the census, 7 x 7 pixels.
    pub fn disparities(
        &mut self,
        left: &Plane<u8>,
        right: &Plane<u8>,
        into: &mut Plane<f32>,
    ) -> Result<(), StereoError> {
        check(left, right)?;
        self.left.left(left);
        self.right.right(right, self.settings.disparities);
        into.reset(left.width(), left.height());
        widest(
            #[inline(always)]
            || self.sum_upwards(left.width(), left.height()),
        );
        widest(
            #[inline(always)]
            || self.sum_downwards(into),
        );
        self.speckles.remove(into, self.settings.speckle_pixels, self.settings.speckle_range_px);
        Ok(())
    }

    fn begin_paths(&mut self, width: usize) {
        let diagonal = self.settings.paths == PathCount::Eight;
        self.paths.begin(width, self.settings.disparities, diagonal);
    }

    #[inline(always)]
    fn sum_upwards(&mut self, width: usize, height: usize) {
        let row = width * self.settings.disparities;
        self.begin_paths(width);
        self.upwards.resize(row * height, 0);
        for (y, sums) in self.upwards.chunks_exact_mut(row).enumerate().rev() {
            self.paths.enter_row([&self.left, &self.right], y, PENALTIES, sums);
        }
    }

    #[inline(always)]
    fn sum_downwards(&mut self, into: &mut Plane<f32>) {
        let width = into.width();
        let row = width * self.settings.disparities;
        let demands = Demands {
            uniqueness_percent: i32::from(self.settings.uniqueness_percent),
            left_right_px: self.settings.left_right_px,
        };
        self.begin_paths(width);
        self.downwards.resize(row, 0);
        self.sums.resize(row, 0);
        for (y, upwards) in self.upwards.chunks_exact(row).enumerate() {
            self.paths.enter_row([&self.left, &self.right], y, PENALTIES, &mut self.downwards);
            self.paths.along_row(PENALTIES, [upwards, &self.downwards], &mut self.sums);
            select::row(&self.sums, &mut self.matches, demands, into.row_mut(y));
        }
    }
}

fn check(left: &Plane<u8>, right: &Plane<u8>) -> Result<(), StereoError> {
    let size = |image: &Plane<u8>| (image.width(), image.height());
    if size(left) != size(right) {
        return Err(StereoError::Sizes { left: size(left), right: size(right) });
    }
    if left.width() < census::WIDTH || left.height() < census::HEIGHT {
        return Err(StereoError::TooSmall(left.width(), left.height()));
    }
    Ok(())
}
