//! A class for each pixel, by a random forest over channels of colour, gradient and orientation.
//!
//! Breiman: "Random forests", 2001; features after Shotton, Johnson, Cipolla: "Semantic texton forests for image
//! categorization and segmentation", CVPR 2008, over the channels of Dollár et al. 2014 in the place of raw colours: a
//! node compares one channel of one cell, at one of four scales and at one of thirteen places around, or where the
//! cell's ray goes. What the trees say of cells of 4 x 4 pixels is interpolated between them.

mod grow;
mod planes;
#[cfg(test)]
mod tests;
mod weights;

pub use grow::{ForestParams, Samples, grow};
pub use weights::{Class, Tree, Weights};

use crate::acf::{Ground, SizeError};
use crate::channels::{Channels, Luv, Resampler};
use crate::image::Rgb;
use crate::stack::Stack;
use planes::{Planes, Walk};

/// Pixels along a cell.
pub const CELL_PX: usize = 4;
/// Numbers that describe a cell.
pub const FEATURES: usize = planes::FEATURES;
/// Classes at most.
pub const CLASSES: usize = 8;
/// Trees at most.
pub const TREES: usize = 16;
/// An image is resized where its pixels are as much larger or smaller than those of the images that were learnt from.
const OTHER_SCALE: f64 = 0.03;
/// How far it is resized at most: half as large to twice.
const SCALES: [f64; 2] = [0.5, 2.0];

/// Labels the pixels of images of one size; it keeps its memory.
#[derive(Clone, Debug)]
pub struct Segmenter {
    weights: Weights,
    size: [usize; 2],
    /// Width and height at the scale of the weights' camera.
    scaled: [usize; 2],
    luv: Luv,
    colours: Stack,
    resampler: Resampler,
    resized: Stack,
    channels: Channels,
    cells: Stack,
    planes: Planes,
    trees: Vec<Walk>,
    /// What the trees say of each cell: class after class, row by row.
    votes: Vec<u16>,
    upsampler: Upsampler,
}

impl Segmenter {
    /// For images of this width and height, by a camera whose optical axis meets the middle column.
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

    /// The weights.
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Width and height in cells.
    pub fn cells(&self) -> [usize; 2] {
        self.planes.cells()
    }

    /// Labels each pixel with the id of its class, row by row; an image smaller than a cell has the last class alone.
    ///
    /// # Errors
    /// Where the image, or what is to be written, is of another size.
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

    /// Takes in an image.
    ///
    /// # Errors
    /// Where it is of another size.
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

    /// The [`FEATURES`] numbers of a cell (column, row) of the image that was taken in, added to `into`.
    pub fn describe(&self, cell: [usize; 2], into: &mut Vec<u8>) {
        self.planes.describe(cell, into);
    }
}

/// From votes of cells to labels of pixels.
#[derive(Clone, Debug, Default)]
struct Upsampler {
    /// Of each column of pixels the left of the two nearest cells, and the right one's share in 1/256.
    columns: Vec<(u32, u32)>,
    /// Votes of one class between two rows of cells, one more at the end.
    row: Vec<u32>,
    /// Of each pixel of a row the most votes so far, and whose they are in the lowest three bits.
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
                // Of equals the first class.
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

/// The first of the two of `n` cells around the middle of pixel `k` of `of`, and the second's share in 1/256.
fn between(k: usize, of: usize, n: usize) -> (u32, u32) {
    let at = ((k as f64 + 0.5) * (n as f64 / of as f64) - 0.5).clamp(0.0, (n - 1) as f64);
    (at as u32, ((at - at.floor()) * 256.0) as u32)
}
