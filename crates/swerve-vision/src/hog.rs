//! Histograms of oriented gradients, and a linear detector over them at multiple scales.
//!
//! Dalal, Triggs: "Histograms of oriented gradients for human detection", CVPR 2005, as implemented in OpenCV 4: the
//! square root of each colour, the gradient of the steepest colour, nine unsigned orientations, blocks of 2 x 2 cells
//! of 8 x 8 pixels under a Gaussian, a block stride of 8 pixels, normalised, clipped at 0.2 and normalised again. A
//! pixel's weight in a block is the product of a column weight and a row weight, so each pixel is added to four sums
//! (its column's position in two blocks, and the cell on either side), and each row of eight pixels to sixteen.

mod gradient;
mod resize;

use swerve_geom::simd::widest;

use crate::acf::Detection;
use crate::image::Rgb;
use gradient::{BINS, Gradients, PADDING_PX};
use resize::Resizer;

/// Side of a cell and stride of blocks and windows, pixels.
const CELL_PX: usize = 8;
/// Values per block: two by two cells.
const BLOCK: usize = 4 * BINS;
/// Clipping limit of normalised values.
const CUT: f32 = 0.2;
/// Ratio of neighbouring scales, and largest number of scales.
const SCALE: f64 = 1.05;
const SCALES: usize = 64;

/// Weights over the blocks of a window, column by column, each with its cells column by column.
#[derive(Clone, PartialEq, Debug)]
pub struct LinearHog {
    /// Width and height of the window in cells, at least 2.
    pub cells: [usize; 2],
    /// Weight of each value of each block.
    pub weights: Vec<f32>,
    /// Added to the weighted sum.
    pub offset: f32,
}

impl LinearHog {
    /// Number of features of a window.
    pub fn features(cells: [usize; 2]) -> usize {
        (cells[0] - 1) * (cells[1] - 1) * BLOCK
    }

    /// OpenCV's default people detector: people 96 pixels tall in a window of 64 x 128.
    pub fn people() -> Self {
        let bytes = include_bytes!("../detectors/people_hog.f32");
        let numbers = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let mut weights: Vec<f32> = numbers.collect();
        let offset = weights.pop().unwrap_or(0.0);
        Self { cells: [8, 16], weights, offset }
    }
}

/// Detects objects in images by sliding windows; reuses its buffers.
#[derive(Clone, Debug)]
pub struct HogDetector {
    model: LinearHog,
    gradients: Gradients,
    blocks: Blocks,
    resizer: Resizer,
    small: Vec<u8>,
}

impl HogDetector {
    /// Detector with these weights.
    ///
    /// # Panics
    /// If the number of weights does not match the window size.
    pub fn new(model: LinearHog) -> Self {
        assert_eq!(
            model.weights.len(),
            LinearHog::features(model.cells),
            "weights of {:?} cells",
            model.cells
        );
        let mut placed = model.weights.clone();
        for (k, weight) in model.weights.iter().enumerate() {
            placed[k / BLOCK * BLOCK + place(k % BLOCK)] = *weight;
        }
        let model = LinearHog { weights: placed, ..model };
        let (gradients, blocks) = (Gradients::default(), Blocks::default());
        Self { model, gradients, blocks, resizer: Resizer::default(), small: Vec::new() }
    }

    /// Collects every window at every scale whose score is at least `least`, starting at full resolution, row by row.
    /// Boxes are the windows, rounded to whole pixels.
    pub fn detect(&mut self, image: Rgb<'_>, least: f32, found: &mut Vec<Detection>) {
        found.clear();
        let window = self.model.cells.map(|cells| cells * CELL_PX);
        let mut scale = 1.0;
        for _ in 0..SCALES {
            let size =
                [image.width(), image.height()].map(|px| (px as f64 / scale).round_ties_even() as usize);
            if size[0] < window[0] || size[1] < window[1] {
                break;
            }
            if scale == 1.0 {
                self.gradients.compute(image.bytes(), size);
            } else {
                self.resizer.resize(image, size, &mut self.small);
                self.gradients.compute(&self.small, size);
            }
            self.blocks.compute(&self.gradients);
            widest(
                #[inline(always)]
                || self.scan(scale, least, found),
            );
            scale *= SCALE;
        }
    }

    /// Feature vector of an image of the window's size, as [`crate::svm`] trains on it; `None` for another size.
    pub fn describe(&mut self, window: Rgb<'_>) -> Option<Vec<f32>> {
        let size = self.model.cells.map(|cells| cells * CELL_PX);
        if [window.width(), window.height()] != size {
            return None;
        }
        self.gradients.compute(window.bytes(), size);
        self.blocks.compute(&self.gradients);
        let [columns, rows] = self.model.cells.map(|cells| cells - 1);
        // The image is padded by one cell.
        let block = |k: usize| &self.blocks.column(1 + k / rows)[(1 + k % rows) * BLOCK..][..BLOCK];
        let ordered = |k: usize| (0..BLOCK).map(move |n| block(k)[place(n)]);
        Some((0..columns * rows).flat_map(ordered).collect())
    }

    #[inline(always)]
    fn scan(&self, scale: f64, least: f32, found: &mut Vec<Detection>) {
        let [columns, rows] = self.model.cells.map(|cells| cells - 1);
        let px = |cells: usize| ((cells * CELL_PX) as f64 * scale).round_ties_even();
        let side = self.model.cells.map(px);
        let corner = |cell: usize| ((cell * CELL_PX) as f64 - PADDING_PX as f64) * scale;
        for y in 0..(self.blocks.rows + 1).saturating_sub(rows) {
            for x in 0..(self.blocks.columns + 1).saturating_sub(columns) {
                // Blocks of one column are contiguous.
                let strips = self.model.weights.chunks_exact(rows * BLOCK).enumerate();
                let strip = |k: usize| &self.blocks.column(x + k)[y * BLOCK..][..rows * BLOCK];
                let mut sums = [0.0; LANES];
                for (k, weights) in strips {
                    dot(weights, strip(k), &mut sums);
                }
                let sum = self.model.offset + sums.iter().sum::<f32>();
                if sum >= least {
                    let at = [corner(x), corner(y)].map(f64::round_ties_even);
                    found.push(Detection {
                        class: 0,
                        bbox: [at[0], at[1], side[0], side[1]],
                        score: sum.into(),
                    });
                }
            }
        }
    }
}

/// Number of partial sums, to break dependency chains.
const LANES: usize = 24;

/// Accumulates the products of two slices into partial sums.
#[inline(always)]
fn dot(a: &[f32], b: &[f32], sums: &mut [f32; LANES]) {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut own = *sums;
    for (a, b) in a.iter().zip(b) {
        for k in 0..LANES {
            own[k] += a[k] * b[k];
        }
    }
    // Written back once: indexing `sums` in the loop would keep it in memory instead of registers.
    *sums = own;
    for ((sum, a), b) in sums.iter_mut().zip(a_rest).zip(b_rest) {
        *sum += a * b;
    }
}

/// Position of a weight's value in the block layout of this module: upper cells, then lower; by bin; left, then right.
/// Blocks of the weights are stored cell by cell: top left, bottom left, top right, bottom right.
fn place(number: usize) -> usize {
    let (cell, bin) = (number / BINS, number % BINS);
    (cell % 2) * 2 * BINS + 2 * bin + cell / 2
}

/// Blocks of one image, column by column.
#[derive(Clone, Debug, Default)]
struct Blocks {
    columns: usize,
    rows: usize,
    numbers: Vec<f32>,
    /// Contributions of each square of 8 x 8 pixels to the cells of its blocks.
    squares: Vec<Square>,
    weights: Weights,
}

/// Sums for the upper and lower cells of the block that has the square in its upper half, then of the block that has it
/// in its lower half; each by bin, in [`Lanes`].
type Square = [[f32; 4 * BINS]; 4];

/// Values for the square in the left half of a block (left and right cell), then in the right half.
type Lanes = [f32; 4];

/// Weights of each of a square's eight columns or rows in the lanes.
#[derive(Clone, Debug)]
struct Weights([Lanes; CELL_PX]);

impl Default for Weights {
    fn default() -> Self {
        // The Gaussian has a standard deviation of a quarter of the block; its centre is on a pixel.
        let gaussian = |k: usize| swerve_geom::math::exp(-(k as f64 - 8.0) * (k as f64 - 8.0) / 32.0);
        let lane = |k: usize, lane: usize| {
            let (within, cell) = (k + CELL_PX * (lane / 2), (lane % 2) as f64);
            let place = (within as f64 + 0.5) / CELL_PX as f64 - 0.5;
            (gaussian(within) * (1.0 - (place - cell).abs()).max(0.0)) as f32
        };
        Self(core::array::from_fn(|k| core::array::from_fn(|l| lane(k, l))))
    }
}

impl Blocks {
    fn compute(&mut self, gradients: &Gradients) {
        widest(
            #[inline(always)]
            || self.fill(gradients),
        );
    }

    #[inline(always)]
    fn fill(&mut self, gradients: &Gradients) {
        let across = gradients.width / CELL_PX;
        let down = gradients.height / CELL_PX;
        (self.columns, self.rows) = (across.saturating_sub(1), down.saturating_sub(1));
        self.squares.resize(across * down, [[0.0; 4 * BINS]; 4]);
        for (k, square) in self.squares.iter_mut().enumerate() {
            gather(gradients, [k % across * CELL_PX, k / across * CELL_PX], &self.weights, square);
        }
        self.numbers.resize(self.columns * self.rows * BLOCK, 0.0);
        for (k, block) in self.numbers.chunks_exact_mut(BLOCK).enumerate() {
            let (x, y) = (k / self.rows, k % self.rows);
            for (below, bins) in block.chunks_exact_mut(2 * BINS).enumerate() {
                let part = |i: usize, j: usize| &self.squares[(y + j) * across + x + i][2 * j + below];
                let [a, b, c, d] = [part(0, 0), part(1, 0), part(0, 1), part(1, 1)];
                for (bin, numbers) in bins.as_chunks_mut::<2>().0.iter_mut().enumerate() {
                    let (left, right) = (4 * bin, 4 * bin + 2);
                    for k in 0..2 {
                        numbers[k] = a[left + k] + b[right + k] + c[left + k] + d[right + k];
                    }
                }
            }
            normalise(block);
        }
    }

    fn column(&self, x: usize) -> &[f32] {
        &self.numbers[x * self.rows * BLOCK..][..self.rows * BLOCK]
    }
}

/// Sums one square of pixels.
#[inline(always)]
fn gather(gradients: &Gradients, [left, top]: [usize; 2], weights: &Weights, square: &mut Square) {
    let mut own = [[0.0; 4 * BINS]; 4];
    for (row, down) in weights.0.iter().enumerate() {
        let mut sums = [[0.0; 4]; BINS];
        let at = (top + row) * gradients.width + left;
        let [shares, others] = gradients.shares.each_ref().map(|shares| &shares[at..at + CELL_PX]);
        let pixels = gradients.bins[at..at + CELL_PX].iter().zip(shares.iter().zip(others)).zip(&weights.0);
        for ((bin, (share, other)), across) in pixels {
            let first = usize::from(*bin).min(BINS - 1);
            let second = if first == BINS - 1 { 0 } else { first + 1 };
            for (bin, share) in [(first, share), (second, other)] {
                let [a, b, c, d] = across.map(|weight| share * weight);
                let old = sums[bin];
                sums[bin] = [old[0] + a, old[1] + b, old[2] + c, old[3] + d];
            }
        }
        let sums = sums.as_flattened();
        for (own, weight) in own.iter_mut().zip(down) {
            for k in 0..4 * BINS {
                own[k] += sums[k] * weight;
            }
        }
    }
    *square = own;
}

/// Normalises to unit length, clips and normalises again.
#[inline(always)]
fn normalise(block: &mut [f32]) {
    let square = |block: &[f32]| {
        let mut sums = [0.0; 12];
        for chunk in block.as_chunks::<12>().0 {
            sums.iter_mut().zip(chunk).for_each(|(sum, n)| *sum += n * n);
        }
        sums.iter().sum::<f32>()
    };
    let scale = 1.0 / (square(block).sqrt() + BLOCK as f32 * 0.1);
    block.iter_mut().for_each(|n| *n = (*n * scale).min(CUT));
    let scale = 1.0 / (square(block).sqrt() + 1e-3);
    block.iter_mut().for_each(|n| *n *= scale);
}

#[cfg(test)]
mod tests;
