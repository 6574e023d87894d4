//! Histograms of oriented gradients, normalised by the blocks around each cell.
//!
//! Dalal, Triggs: "Histograms of oriented gradients for human detection", CVPR 2005, in the form of Felzenszwalb,
//! Girshick, McAllester, Ramanan: "Object detection with discriminatively trained part-based models", PAMI 2010,
//! section 6.2, for unsigned gradients: a cell's histogram is divided by the norm of each of the four 2 x 2 blocks that
//! contain the cell and clipped at 0.2. The results are summed over the four blocks for each orientation, and over the
//! orientations for each block.

use swerve_geom::simd::widest;

use crate::channels::{CHANNELS, ORIENTATIONS};
use crate::stack::Stack;

/// Number of planes: one per orientation and one per block.
pub(super) const PLANES: usize = ORIENTATIONS + 4;
/// Quantisation step of a feature stored as a byte; features are at most 0.4.
pub(super) const STEP: f32 = 1.0 / 512.0;

/// Clipping limit of a normalised value.
const CUT: f32 = 0.2;
/// Added to a block's squared norm, so that noise on a uniform surface gives features near zero.
const FLOOR: f32 = 1e-3;
/// Weight of a block's sum over orientations, as in the paper: one over the root of 18.
const TEXTURE: f32 = 0.2357;

/// Computes block features from channels; reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Blocks {
    /// Squared norm of each cell's histogram.
    energies: Vec<f32>,
    /// Inverse norm of the block around each corner between cells.
    scales: Vec<f32>,
}

impl Blocks {
    /// Fills the planes from the cells of [`crate::channels`]; edge cells are repeated beyond the border.
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

    /// Computes the norms of cells, then of blocks.
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

    /// Computes one line of cells.
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

    /// Cells with a single orientation of uniform strength.
    fn even(strength: f32) -> Stack {
        let mut cells = Stack::default();
        cells.shape(CHANNELS, 5, 4);
        cells.numbers_mut().fill(0.0);
        cells.plane_mut(CHANNELS - ORIENTATIONS + 2).fill(strength);
        cells
    }

    #[test]
    fn block_features_are_invariant_to_contrast() {
        let (mut blocks, mut weak, mut strong) = (Blocks::default(), Stack::default(), Stack::default());
        blocks.fill(&even(0.3), &mut weak);
        blocks.fill(&even(3.0), &mut strong);
        assert_eq!(weak.planes(), PLANES);
        // Each block's norm is twice that of each of its cells, so the value is clipped.
        for (plane, expected) in [(0, 0.0), (2, 0.5 * 4.0 * CUT), (ORIENTATIONS + 3, TEXTURE * CUT)] {
            let near = |value: &f32| (value - expected).abs() < 1e-6;
            assert!(weak.plane(plane).iter().chain(strong.plane(plane)).all(near), "{plane}");
        }
    }

    #[test]
    fn uniform_cells_have_zero_block_features() {
        let mut into = Stack::default();
        Blocks::default().fill(&even(0.0), &mut into);
        assert!(into.numbers().iter().all(|value| *value == 0.0));
    }
}
