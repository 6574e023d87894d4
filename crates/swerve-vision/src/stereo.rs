//! Disparities of a rectified image pair: semi-global matching (Hirschmüller, PAMI 2008) of census codes.
//!
//! ```text
//! two images ─> codes ─> costs of each pixel and disparity ─> sums along 4 or 8 paths ─> disparity
//!                                                          ─> uniqueness, left-right check, speckle filter
//! ```
//!
//! Sums are integers, so the result is bit-identical everywhere. Costs are computed twice, in the upward and in the
//! downward pass, which is cheaper than storing them: only one sum per pixel and disparity is stored.

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

/// Number of paths along which the costs of a pixel are summed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum PathCount {
    /// Along rows and columns.
    #[default]
    Four,
    /// Along the diagonals too: 50 % more work.
    Eight,
}

/// Penalties for 24-bit costs: three paths then sum to at most a byte. Larger ones, as tuned on KITTI for 31 bits (86
/// and 96; Hernandez-Juarez and others, ICCS 2016), were no better on the pairs of `tests/reference/vision`.
const PENALTIES: Penalties = Penalties { small: 7, large: 54 };

/// Search range and filters of the matcher.
#[derive(Clone, Debug)]
pub struct StereoSettings {
    /// Number of disparities from 0 up: a multiple of 16, at most 256. Objects nearer than the largest are not matched.
    pub disparities: usize,
    /// Number of paths.
    pub paths: PathCount,
    /// Margin by which the sum of any other disparity must be larger, percent, below 100. Higher values keep fewer but
    /// more reliable pixels.
    pub uniqueness_percent: u8,
    /// Largest difference from the disparity of the right image, pixels.
    pub left_right_px: usize,
    /// Smallest patch that is kept, pixels.
    pub speckle_pixels: usize,
    /// Largest difference of neighbours within a patch, pixels of disparity.
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

/// Reason that no disparities can be computed.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum StereoError {
    /// Number of disparities out of range or not a multiple of 16.
    #[error("{0} disparities, expected a multiple of 16 from 16 to 256")]
    Disparities(usize),
    /// Uniqueness margin out of range.
    #[error("{0} percent of uniqueness, expected less than 100")]
    Uniqueness(u8),
    /// Images of different sizes.
    #[error("a left image of {left:?} pixels and a right one of {right:?}, expected the same size")]
    Sizes {
        /// Columns and rows.
        left: (usize, usize),
        /// Columns and rows.
        right: (usize, usize),
    },
    /// Images smaller than the census window.
    #[error("images of {0} x {1} pixels, expected at least 7 x 7: that much around a pixel is compared")]
    TooSmall(usize, usize),
}

/// Stereo matcher with its buffers.
#[derive(Clone, Debug)]
pub struct Stereo {
    settings: StereoSettings,
    left: Census,
    right: Census,
    paths: Paths,
    /// Sums of the upward paths, a byte per pixel and disparity.
    upwards: Vec<u8>,
    downwards: Vec<u8>,
    sums: Vec<i16>,
    matches: Matches,
    speckles: Speckles,
}

impl Stereo {
    /// Matcher with these settings.
    ///
    /// # Errors
    /// If a setting is out of range.
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

    /// Computes the disparity of each pixel of the left image: the number of pixels by which its match in the right
    /// image is further left; NaN if unknown.
    ///
    /// # Errors
    /// If the images differ in size or are smaller than the 7 x 7 census window.
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
