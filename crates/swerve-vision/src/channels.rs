//! Channels of an image: ten planes of colour, gradient and orientation, summed over small squares of pixels (*cells*).
//!
//! Dollár, Appel, Belongie, Perona: "Fast feature pyramids for object detection", PAMI 2014, section 6.1, with the
//! constants of the authors' toolbox: three planes of LUV, the gradient's magnitude over its mean in the neighbourhood,
//! and that magnitude split between the two nearest of six orientations. Loops over rows are branch-free, so that the
//! compiler vectorises them; no sum depends on the vector width.

mod filter;
mod luv;

use core::ops::Range;

use swerve_geom::simd::widest;

use crate::stack::Stack;

pub use filter::{Resampler, halve, smooth};
pub use luv::Luv;

/// Number of planes: L, u, v, magnitude, six orientations.
pub const CHANNELS: usize = 10;
/// Number of orientation bins over half a turn.
pub const ORIENTATIONS: usize = 6;
/// Radius of the triangle filter over which magnitudes are normalised, pixels.
const NEIGHBOURHOOD_PX: usize = 5;
/// Added to the neighbourhood's mean magnitude, so that noise on a uniform surface is not an edge.
const MAGNITUDE_FLOOR: f32 = 0.005;

/// Computes channels from colours; reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Channels {
    smooth: Stack,
    magnitude: Stack,
    mean: Stack,
    /// Orientation; 0 to 6 is half a turn.
    orientation: Stack,
    sums: Vec<f32>,
    row: Vec<f32>,
}

impl Channels {
    /// Computes the channels of some rows of a LUV image, as if the image ended with them: means over `shrink` x
    /// `shrink` pixels. Incomplete cells at the right and bottom are dropped.
    pub fn compute(&mut self, luv: &Stack, rows: Range<usize>, shrink: usize, into: &mut Stack) {
        let (width, height) = (luv.width(), rows.len());
        let (columns, lines) = (width / shrink, height / shrink);
        into.shape(CHANNELS, columns, lines);
        if columns == 0 || lines == 0 {
            return;
        }
        self.smooth.shape(3, width, height);
        for plane in 0..3 {
            let from = &luv.plane(plane)[rows.start * width..rows.end * width];
            smooth::<1>(from, width, self.smooth.plane_mut(plane), &mut self.row);
        }
        self.magnitude.shape(1, width, height);
        self.orientation.shape(1, width, height);
        widest(
            #[inline(always)]
            || (0..height).for_each(|row| self.gradient(row)),
        );
        self.mean.shape(1, width, height);
        smooth::<NEIGHBOURHOOD_PX>(self.magnitude.plane(0), width, self.mean.plane_mut(0), &mut self.row);
        widest(
            #[inline(always)]
            || (0..lines).for_each(|line| self.sum(line, shrink, into)),
        );
    }

    /// Computes the gradient of the steepest colour of one row; one-sided at the borders.
    #[inline(always)]
    fn gradient(&mut self, row: usize) {
        let (width, height) = (self.smooth.width(), self.smooth.height());
        let (above, below) = (row.saturating_sub(1), (row + 1).min(height - 1));
        let down = if below - above == 2 { 0.5 } else { 1.0 };
        let (magnitude, orientation) = (self.magnitude.row_mut(0, row), self.orientation.row_mut(0, row));
        let at: [&[f32]; 3] = core::array::from_fn(|plane| self.smooth.row(plane, row));
        let up: [&[f32]; 3] = core::array::from_fn(|plane| self.smooth.row(plane, above));
        let dn: [&[f32]; 3] = core::array::from_fn(|plane| self.smooth.row(plane, below));
        let vertical = |x: usize| core::array::from_fn(|plane| (dn[plane][x] - up[plane][x]) * down);
        for x in 1..width.saturating_sub(1) {
            let horizontal = core::array::from_fn(|plane| (at[plane][x + 1] - at[plane][x - 1]) * 0.5);
            (magnitude[x], orientation[x]) = steepest(horizontal, vertical(x));
        }
        for x in [0, width - 1] {
            let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
            let horizontal = core::array::from_fn(|plane| at[plane][right] - at[plane][left]);
            (magnitude[x], orientation[x]) = steepest(horizontal, vertical(x));
        }
    }

    /// Sums one line of cells: first over pixel rows, then along them.
    #[inline(always)]
    fn sum(&mut self, line: usize, shrink: usize, into: &mut Stack) {
        let width = self.smooth.width();
        self.sums.clear();
        self.sums.resize(CHANNELS * width, 0.0);
        let (colours, gradients) = self.sums.split_at_mut(3 * width);
        for row in line * shrink..(line + 1) * shrink {
            for (plane, sums) in colours.chunks_exact_mut(width).enumerate() {
                sums.iter_mut().zip(self.smooth.row(plane, row)).for_each(|(sum, value)| *sum += value);
            }
            let (magnitude, mean) = (self.magnitude.row_mut(0, row), self.mean.row(0, row));
            for (m, mean) in magnitude.iter_mut().zip(mean) {
                *m /= mean + MAGNITUDE_FLOOR;
            }
            let (total, bins) = gradients.split_at_mut(width);
            total.iter_mut().zip(&*magnitude).for_each(|(sum, m)| *sum += m);
            for (bin, sums) in bins.chunks_exact_mut(width).enumerate() {
                share(bin as f32, magnitude, self.orientation.row(0, row), sums);
            }
        }
        let scale = 1.0 / (shrink * shrink) as f32;
        for (plane, sums) in self.sums.chunks_exact(width).enumerate() {
            let cells = into.row_mut(plane, line).iter_mut();
            if shrink == 2 {
                cells.zip(sums.as_chunks::<2>().0).for_each(|(cell, [a, b])| *cell = (a + b) * scale);
            } else {
                let sums = sums.chunks_exact(shrink).map(|sums| sums.iter().sum::<f32>());
                cells.zip(sums).for_each(|(cell, sum)| *cell = sum * scale);
            }
        }
    }
}

/// Adds each magnitude's share of an orientation bin: all at the bin itself, none at the next one.
#[inline(always)]
fn share(bin: f32, magnitudes: &[f32], orientations: &[f32], sums: &mut [f32]) {
    for ((sum, m), o) in sums.iter_mut().zip(magnitudes).zip(orientations) {
        let apart = (o - bin).abs();
        let apart = apart.min(ORIENTATIONS as f32 - apart);
        *sum += m * (1.0 - apart).max(0.0);
    }
}

/// Magnitude and orientation (0 to 6, half a turn) of the longest of three gradients; the first one wins ties.
#[inline(always)]
fn steepest(horizontal: [f32; 3], vertical: [f32; 3]) -> (f32, f32) {
    let (mut most, mut gx, mut gy) = (-1.0, 0.0, 0.0);
    for (x, y) in horizontal.into_iter().zip(vertical) {
        let square = x * x + y * y;
        let more = square > most;
        (most, gx, gy) = (select(more, square, most), select(more, x, gx), select(more, y, gy));
    }
    (most.sqrt(), orientation(gx, gy))
}

/// Selects one of two values without a branch; with an `if`, the compiler may emit one conditional store per value.
#[inline(always)]
pub(crate) fn select(first: bool, a: f32, b: f32) -> f32 {
    let mask = u32::from(first).wrapping_neg();
    f32::from_bits(a.to_bits() & mask | b.to_bits() & !mask)
}

/// Unsigned orientation of a vector: 0 to 6 for half a turn; error below 1e-5.
#[inline(always)]
pub(crate) fn orientation(gx: f32, gy: f32) -> f32 {
    /// Coefficients of the odd powers of the arc tangent on [0, 1] (Hastings, "Approximations for digital computers",
    /// 1955, sheet 11).
    const POWERS: [f32; 6] =
        [0.999_977_26, -0.332_623_47, 0.193_543_46, -0.116_432_87, 0.052_653_32, -0.011_721_2];
    const BINS_PER_RADIAN: f32 = ORIENTATIONS as f32 * core::f32::consts::FRAC_1_PI;
    let (ax, ay) = (gx.abs(), gy.abs());
    let slope = ax.min(ay) / ax.max(ay).max(f32::MIN_POSITIVE);
    let square = slope * slope;
    let angle =
        slope * POWERS.into_iter().rev().fold(0.0, |sum, power| sum * square + power) * BINS_PER_RADIAN;
    let angle = if ay > ax { 3.0 - angle } else { angle };
    let angle = if gx * gy < 0.0 { 6.0 - angle } else { angle };
    if angle >= 6.0 { angle - 6.0 } else { angle }
}

#[cfg(test)]
mod tests;
