//! Semantic segmentation by a random forest over channels of colour, gradient and orientation.
//!
//! Breiman: "Random forests", 2001; features after Shotton, Johnson, Cipolla: "Semantic texton forests for image
//! categorization and segmentation", CVPR 2008, over the channels of Dollár et al. 2014 instead of raw colours: a node
//! compares one channel of a cell with a threshold, at one of four scales and thirteen positions around the cell, or
//! the direction of the cell's ray. The votes of cells of 4 x 4 pixels are interpolated between cells.

mod features;
mod grow;
mod planes;
#[cfg(test)]
mod tests;
mod weights;

pub use features::FEATURES;
pub use grow::{ForestParams, Samples, grow};
pub use weights::{CLASSES, Class, TREES, Tree, Weights};

use crate::acf::{Ground, SizeError};
use crate::channels::{Channels, Luv, Resampler};
use crate::image::Rgb;
use crate::stack::Stack;
use planes::{Planes, Walk};

/// Side of a cell, pixels.
pub const CELL_PX: usize = 4;
/// Relative difference of focal length from the training images above which an image is resized.
const OTHER_SCALE: f64 = 0.03;
/// Limits of resizing: from half to twice the size.
const SCALES: [f64; 2] = [0.5, 2.0];

/// Labels the pixels of images of one size; reuses its buffers.
#[derive(Clone, Debug)]
pub struct Segmenter {
    weights: Weights,
    size: [usize; 2],
    /// Width and height at the scale of the training camera.
    scaled: [usize; 2],
    luv: Luv,
    colours: Stack,
    resampler: Resampler,
    resized: Stack,
    channels: Channels,
    cells: Stack,
    planes: Planes,
    trees: Vec<Walk>,
    /// Votes of the trees for each cell: class by class, row by row.
    votes: Vec<u16>,
    upsampler: Upsampler,
}

impl Segmenter {
    /// Segmenter for images of this width and height, from a camera with a centred optical axis.
    pub fn new(weights: Weights, size: [usize; 2], ground: Ground) -> Self {
        let scale = (weights.focal_px / ground.focal_px).clamp(SCALES[0], SCALES[1]);
        let is_same = (scale - 1.0).abs() <= OTHER_SCALE;
        let scaled =
            if is_same { size } else { size.map(|px| ((px as f64 * scale).round() as usize).max(1)) };
        let planes = Planes::new(scaled.map(|px| px / CELL_PX), size, ground);
        let trees = weights.trees.iter().map(|tree| planes.walk(tree, weights.classes.len())).collect();
        Self {
            weights,
            size,
            scaled,
            luv: Luv::default(),
            colours: Stack::default(),
            resampler: Resampler::default(),
            resized: Stack::default(),
            channels: Channels::default(),
            cells: Stack::default(),
            planes,
            trees,
            votes: Vec::new(),
            upsampler: Upsampler::default(),
        }
    }

    /// Weights of the forest.
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Width and height in cells.
    pub fn cells(&self) -> [usize; 2] {
        self.planes.cells()
    }

    /// Labels each pixel with its class id, row by row; an image smaller than a cell gets the last class everywhere.
    ///
    /// # Errors
    /// If the image or the output is of another size.
    pub fn segment(&mut self, image: Rgb<'_>, into: &mut [u8]) -> Result<(), SizeError> {
        self.fill(image)?;
        if into.len() != self.size[0] * self.size[1] {
            return Err(SizeError { found: [into.len(), 1], expected: self.size });
        }
        let [columns, lines] = self.cells();
        if columns * lines == 0 {
            into.fill(self.weights.classes.last().map_or(0, |class| class.id));
            return Ok(());
        }
        self.planes.vote(&self.trees, &mut self.votes);
        self.upsampler.label(&self.votes, [columns, lines], self.size, into);
        for label in into {
            *label = self.weights.classes[usize::from(*label)].id;
        }
        Ok(())
    }

    /// Computes the features of an image.
    ///
    /// # Errors
    /// If the image is of another size.
    pub fn fill(&mut self, image: Rgb<'_>) -> Result<(), SizeError> {
        let found = [image.width(), image.height()];
        if found != self.size {
            return Err(SizeError { found, expected: self.size });
        }
        self.luv.compute(image, 0..image.height(), &mut self.colours);
        let colours = if self.scaled == self.size {
            &self.colours
        } else {
            self.resampler.set(self.size, self.scaled);
            self.resized.shape(3, self.scaled[0], self.scaled[1]);
            for plane in 0..3 {
                self.resampler.plane(self.colours.plane(plane), 1.0, self.resized.plane_mut(plane));
            }
            &self.resized
        };
        self.channels.compute(colours, 0..self.scaled[1], CELL_PX, &mut self.cells);
        self.planes.fill(&self.cells);
        Ok(())
    }

    /// Appends the [`FEATURES`] values of a cell (column, row) of the current image to `into`.
    pub fn describe(&self, cell: [usize; 2], into: &mut Vec<u8>) {
        self.planes.describe(cell, into);
    }
}

/// Interpolates votes of cells to labels of pixels.
#[derive(Clone, Debug, Default)]
struct Upsampler {
    /// Left one of the two nearest cells for each pixel column, and the weight of the right one in 1/256.
    columns: Vec<(u32, u32)>,
    /// Votes of one class interpolated between two rows of cells, plus one extra value.
    row: Vec<u32>,
    /// Most votes so far for each pixel of a row; the lowest three bits encode the class.
    best: Vec<u32>,
}

impl Upsampler {
    fn label(
        &mut self,
        votes: &[u16],
        [columns, lines]: [usize; 2],
        [width, height]: [usize; 2],
        into: &mut [u8],
    ) {
        self.columns.clear();
        self.columns.extend((0..width).map(|x| between(x, width, columns)));
        self.row.resize(columns + 1, 0);
        for (y, out) in into.chunks_exact_mut(width).enumerate() {
            let (above, share) = between(y, height, lines);
            let below = (above as usize + 1).min(lines - 1);
            self.best.clear();
            self.best.resize(width, 0);
            for (class, votes) in votes.chunks_exact(columns * lines).enumerate() {
                let [above, below] = [above as usize, below].map(|line| &votes[line * columns..][..columns]);
                for ((mixed, a), b) in self.row.iter_mut().zip(above).zip(below) {
                    *mixed = u32::from(*a) * (256 - share) + u32::from(*b) * share;
                }
                self.row[columns] = self.row[columns - 1];
                // Ties go to the first class.
                let mark = (CLASSES - 1 - class) as u32;
                for (best, &(left, share)) in self.best.iter_mut().zip(&self.columns) {
                    let pair = &self.row[left as usize..][..2];
                    *best = (*best).max((pair[0] * (256 - share) + pair[1] * share) << 3 | mark);
                }
            }
            out.iter_mut()
                .zip(&self.best)
                .for_each(|(out, best)| *out = (CLASSES - 1) as u8 - (best & 7) as u8);
        }
    }
}

/// First of the two cells (of `n`) around the centre of pixel `k` (of `of`), and the weight of the second in 1/256.
fn between(k: usize, of: usize, n: usize) -> (u32, u32) {
    let at = ((k as f64 + 0.5) * (n as f64 / of as f64) - 0.5).clamp(0.0, (n - 1) as f64);
    (at as u32, ((at - at.floor()) * 256.0) as u32)
}
