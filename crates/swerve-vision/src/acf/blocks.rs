//! Histograms of oriented gradients, normalised by the blocks around each cell.
//!
//! Dalal, Triggs: "Histograms of oriented gradients for human detection", CVPR 2005, in the form of Felzenszwalb,
//! Girshick, McAllester, Ramanan: "Object detection with discriminatively trained part-based models", PAMI 2010,
//! section 6.2, for gradients whose sign does not count: of each of the four blocks of two by two cells that a cell is
//! in, its histogram is divided by the block's length and cut at 0.2. What the four make of an orientation is summed up,
//! and so is what the orientations make of each.

use swerve_geom::simd::widest;

use crate::channels::{CHANNELS, ORIENTATIONS};
use crate::stack::Stack;

/// Planes: one an orientation, one a block.
pub(super) const PLANES: usize = ORIENTATIONS + 4;
/// One unit of a feature where it is kept as a byte: no feature is above 0.4.
pub(super) const STEP: f32 = 1.0 / 512.0;

/// What a normalised number is cut at.
const CUT: f32 = 0.2;
/// Added to a block's square, so that noise on an even ground is nothing.
const FLOOR: f32 = 1e-3;
/// What the sum of a block's orientations is worth, as there: one over the root of 18.
const TEXTURE: f32 = 0.2357;

/// Makes blocks of channels; it keeps its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Blocks {
    /// Of each cell the square of its histogram's length.
    energies: Vec<f32>,
    /// Of each corner between cells one over the length of the block around it.
    scales: Vec<f32>,
}

impl Blocks {
    /// Fills the planes for cells with the planes of [`crate::channels`]; beyond an edge is what is at it.
    pub(super) fn fill(&mut self, cells: &Stack, into: &mut Stack) {
        let (width, height) = (cells.width(), cells.height());
        into.shape(PLANES, width, height);
        if width == 0 || height == 0 {
            return;
        }
        widest(
            #[inline(always)]
            || {
                self.measure(cells);
                (0..height).for_each(|line| self.line(cells, line, into));
            },
        );
    }

    /// Lengths of cells, then of blocks.
    #[inline(always)]
    fn measure(&mut self, cells: &Stack) {
        let (width, height) = (cells.width(), cells.height());
        self.energies.clear();
        self.energies.resize(width * height, 0.0);
        for bin in 0..ORIENTATIONS {
            let plane = cells.plane(CHANNELS - ORIENTATIONS + bin);
            self.energies.iter_mut().zip(plane).for_each(|(energy, value)| *energy += value * value);
        }
        self.scales.clear();
        for y in 0..=height {
            let [above, below] =
                [y.saturating_sub(1), y.min(height - 1)].map(|line| &self.energies[line * width..][..width]);
            let of = |x: usize| above[x] + below[x];
            self.scales.extend((0..=width).map(|x| {
                let square = of(x.saturating_sub(1)) + of(x.min(width - 1));
                1.0 / (square + FLOOR).sqrt()
            }));
        }
    }

    /// One line of cells.
    #[inline(always)]
    fn line(&self, cells: &Stack, line: usize, into: &mut Stack) {
        let width = cells.width();
        let corners = |k: usize| &self.scales[(line + k / 2) * (width + 1) + k % 2..][..width];
        for block in 0..4 {
            into.row_mut(ORIENTATIONS + block, line).fill(0.0);
        }
        for bin in 0..ORIENTATIONS {
            let values = cells.row(CHANNELS - ORIENTATIONS + bin, line);
            into.row_mut(bin, line).fill(0.0);
            for block in 0..4 {
                let scales = corners(block);
                let cut = |(value, scale): (&f32, &f32)| (value * scale).min(CUT);
                let sums = into.row_mut(bin, line).iter_mut();
                sums.zip(values.iter().zip(scales).map(cut)).for_each(|(sum, part)| *sum += 0.5 * part);
                let sums = into.row_mut(ORIENTATIONS + block, line).iter_mut();
                sums.zip(values.iter().zip(scales).map(cut)).for_each(|(sum, part)| *sum += TEXTURE * part);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of one orientation, as strong everywhere.
    fn even(strength: f32) -> Stack {
        let mut cells = Stack::default();
        cells.shape(CHANNELS, 5, 4);
        cells.numbers_mut().fill(0.0);
        cells.plane_mut(CHANNELS - ORIENTATIONS + 2).fill(strength);
        cells
    }

    #[test]
    fn a_histogram_is_the_same_for_any_contrast() {
        let (mut blocks, mut weak, mut strong) = (Blocks::default(), Stack::default(), Stack::default());
        blocks.fill(&even(0.3), &mut weak);
        blocks.fill(&even(3.0), &mut strong);
        assert_eq!(weak.planes(), PLANES);
        // Each of the four blocks is twice as long as each of its cells: cut.
        for (plane, expected) in [(0, 0.0), (2, 0.5 * 4.0 * CUT), (ORIENTATIONS + 3, TEXTURE * CUT)] {
            let near = |value: &f32| (value - expected).abs() < 1e-6;
            assert!(weak.plane(plane).iter().chain(strong.plane(plane)).all(near), "{plane}");
        }
    }

    #[test]
    fn an_even_ground_has_none() {
        let mut into = Stack::default();
        Blocks::default().fill(&even(0.0), &mut into);
        assert!(into.numbers().iter().all(|value| *value == 0.0));
    }
}
