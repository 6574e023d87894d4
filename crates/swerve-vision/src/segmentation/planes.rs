//! What a forest asks of a cell: bytes of channels at four scales, and of where its ray goes.

use super::weights::Tree;
use super::{CLASSES, TREES};
use crate::acf::{Ground, feature_step};
use crate::channels::{CHANNELS, halve};
use crate::stack::Stack;

/// Scales, each half of the one before.
const LEVELS: usize = 4;
/// Places around a cell, in cells of the scale.
const PLACES: [[isize; 2]; 13] = [
    [0, 0],
    [-1, 0],
    [1, 0],
    [0, -1],
    [0, 1],
    [-2, -2],
    [2, -2],
    [-2, 2],
    [2, 2],
    [-4, 0],
    [4, 0],
    [0, -4],
    [0, 4],
];
/// Cells that each scale is continued by on each side: the farthest place, and one where a scale has a cell less.
const PAD: usize = 5;
/// Where a ray goes: up or down, left or right, and where it meets the ground.
const RAY: usize = 3;
pub(super) const FEATURES: usize = LEVELS * PLACES.len() * CHANNELS + RAY;

/// A byte of slope is so much, either way from 128.
const SLOPE_STEP: f64 = 1.0 / 170.0;
/// The same of metres to the side.
const SIDE_STEP_M: f64 = 1.0 / 8.0;

/// Bytes of one image's cells.
#[derive(Clone, Debug)]
pub(super) struct Planes {
    cells: [usize; 2],
    levels: [Level; LEVELS],
    /// All levels, padded, a cell's channels one after another; then the rays.
    bytes: Vec<u8>,
    rays: usize,
    stacks: [Stack; LEVELS],
}

/// Where a scale lies.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    /// Times that it was halved.
    halvings: u32,
    size: [usize; 2],
    /// Its first byte.
    start: usize,
}

impl Level {
    fn stride(&self) -> usize {
        (self.size[0] + 2 * PAD) * CHANNELS
    }

    /// The first byte of the cell that holds a cell of the finest scale.
    fn base(&self, [x, y]: [usize; 2]) -> usize {
        self.start + ((y >> self.halvings) + PAD) * self.stride() + ((x >> self.halvings) + PAD) * CHANNELS
    }
}

/// A tree for one size of images.
#[derive(Clone, Debug)]
pub(super) struct Walk {
    nodes: Vec<Node>,
    leaves: Vec<[u8; CLASSES]>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// From the cell's own byte to the one that is compared; of a leaf, which it is.
    offset: i32,
    /// Where it goes on below the threshold; above, one further.
    lower: u16,
    /// [`LEVELS`] for the ray, one more for a leaf.
    level: u8,
    threshold: u8,
}

const LEAF: u8 = LEVELS as u8 + 1;

impl Planes {
    /// For images of so many cells across and down; what a ray is comes from the image's own size and camera.
    pub(super) fn new(cells: [usize; 2], size: [usize; 2], ground: Ground) -> Self {
        let mut levels = [Level { size: cells, ..Level::default() }; LEVELS];
        let mut end = 0;
        for k in 0..LEVELS {
            if k > 0 {
                levels[k] = levels[k - 1];
                // What cannot be halved stays as it is.
                if levels[k].size.iter().all(|side| *side > 1) {
                    levels[k].size = levels[k].size.map(|side| side / 2);
                    levels[k].halvings += 1;
                }
            }
            levels[k].start = end;
            end += levels[k].stride() * (levels[k].size[1] + 2 * PAD);
        }
        let mut bytes = vec![0; end];
        for y in 0..cells[1] {
            bytes.extend((0..cells[0]).flat_map(|x| ray([x, y], cells, size, ground)));
        }
        Self { cells, levels, bytes, rays: end, stacks: Default::default() }
    }

    pub(super) fn cells(&self) -> [usize; 2] {
        self.cells
    }

    /// Takes in the channels of an image.
    pub(super) fn fill(&mut self, cells: &Stack) {
        for k in 0..LEVELS {
            let level = self.levels[k];
            let (finer, own) = self.stacks.split_at_mut(k);
            resize(finer.last().unwrap_or(cells), level.size, &mut own[0]);
            let end = level.start + level.stride() * (level.size[1] + 2 * PAD);
            pack(&own[0], &mut self.bytes[level.start..end]);
        }
    }

    /// The first bytes of a cell at each scale, and of its ray.
    fn bases(&self, cell: [usize; 2]) -> [usize; LEVELS + 1] {
        let ray = self.rays + (cell[1] * self.cells[0] + cell[0]) * RAY;
        core::array::from_fn(|k| self.levels.get(k).map_or(ray, |level| level.base(cell)))
    }

    /// Which scale a feature is of, and how far its byte is from the cell's own.
    fn place(&self, feature: usize) -> (u8, i32) {
        let (level, rest) = (feature / (PLACES.len() * CHANNELS), feature % (PLACES.len() * CHANNELS));
        let Some(own) = self.levels.get(level) else { return (LEVELS as u8, rest as i32) };
        let ([dx, dy], channel) = (PLACES[rest / CHANNELS], rest % CHANNELS);
        (level as u8, (dy * own.stride() as isize + dx * CHANNELS as isize + channel as isize) as i32)
    }

    pub(super) fn describe(&self, cell: [usize; 2], into: &mut Vec<u8>) {
        let bases = self.bases(cell);
        into.extend((0..FEATURES).map(|feature| {
            let (level, offset) = self.place(feature);
            self.bytes[bases[usize::from(level)].wrapping_add_signed(offset as isize)]
        }));
    }

    /// A tree with its features' places.
    pub(super) fn walk(&self, tree: &Tree, classes: usize) -> Walk {
        let leaf = |own: &[u8]| core::array::from_fn(|class| own.get(class).copied().unwrap_or(0));
        let leaves = tree.leaves.chunks_exact(classes).map(leaf).collect();
        let (mut splits, mut ends) = (0, 0);
        let mut thresholds = tree.thresholds.iter();
        let node = |feature: &u16| match (feature.checked_sub(1), &mut ends) {
            (None, ends) => {
                *ends += 1;
                Node { offset: *ends - 1, lower: 0, level: LEAF, threshold: 0 }
            }
            (Some(feature), _) => {
                splits += 1;
                let (level, offset) = self.place(usize::from(feature));
                let threshold = thresholds.next().copied().unwrap_or(0);
                Node { offset, lower: 2 * splits - 1, level, threshold }
            }
        };
        Walk { nodes: tree.features.iter().map(node).collect(), leaves }
    }

    /// What trees say of all cells, class after class.
    pub(super) fn vote(&self, trees: &[Walk], votes: &mut Vec<u16>) {
        const { assert!(TREES * 255 <= u16::MAX as usize, "sums of votes fit") };
        let [columns, lines] = self.cells;
        votes.clear();
        votes.resize(CLASSES * columns * lines, 0);
        for cell in 0..columns * lines {
            let bases = self.bases([cell % columns, cell / columns]);
            let mut sums = [0_u16; CLASSES];
            for tree in trees {
                let own = tree.leaf(&self.bytes, &bases);
                sums.iter_mut().zip(own).for_each(|(sum, vote)| *sum += u16::from(*vote));
            }
            sums.iter().enumerate().for_each(|(class, sum)| votes[class * columns * lines + cell] = *sum);
        }
    }
}

impl Walk {
    #[inline(always)]
    fn leaf(&self, bytes: &[u8], bases: &[usize; LEVELS + 1]) -> &[u8; CLASSES] {
        let mut node = &self.nodes[0];
        while let Some(base) = bases.get(usize::from(node.level)) {
            let byte = bytes[base.wrapping_add_signed(node.offset as isize)];
            node = &self.nodes[usize::from(node.lower) + usize::from(byte >= node.threshold)];
        }
        &self.leaves[node.offset as usize]
    }
}

/// The same planes, halved where they are to have another size; an odd last row or column is left out.
fn resize(from: &Stack, [width, height]: [usize; 2], into: &mut Stack) {
    into.shape(CHANNELS, width, height);
    if from.width() == width && from.height() == height {
        return into.numbers_mut().copy_from_slice(from.numbers());
    }
    (0..CHANNELS).for_each(|plane| halve(from.plane(plane), from.width(), into.plane_mut(plane)));
}

/// Bytes of all channels, cell by cell, the outermost repeated on all sides.
fn pack(stack: &Stack, into: &mut [u8]) {
    let (width, height) = (stack.width(), stack.height());
    if width * height == 0 {
        return;
    }
    let units: [f32; CHANNELS] = core::array::from_fn(|channel| 1.0 / feature_step(channel));
    let stride = (width + 2 * PAD) * CHANNELS;
    for y in 0..height {
        let row = &mut into[(y + PAD) * stride..][..stride];
        for (channel, units) in units.iter().enumerate() {
            let own = row[PAD * CHANNELS + channel..].iter_mut().step_by(CHANNELS);
            own.zip(stack.row(channel, y)).for_each(|(byte, value)| *byte = (value * units) as u8);
        }
        for k in 0..PAD {
            row.copy_within(PAD * CHANNELS..(PAD + 1) * CHANNELS, k * CHANNELS);
            let last = (width + PAD - 1) * CHANNELS;
            row.copy_within(last..last + CHANNELS, last + (k + 1) * CHANNELS);
        }
    }
    for k in 0..PAD {
        into.copy_within(PAD * stride..(PAD + 1) * stride, k * stride);
        let last = (height + PAD - 1) * stride;
        into.copy_within(last..last + stride, last + (k + 1) * stride);
    }
}

/// Slope down and to the right, and metres to the right where it meets the ground: 128 is none, 0 for no ground.
fn ray([x, y]: [usize; 2], cells: [usize; 2], size: [usize; 2], ground: Ground) -> [u8; RAY] {
    let middle = |k: usize, axis: usize| (k as f64 + 0.5) * size[axis] as f64 / cells[axis] as f64;
    let right = (middle(x, 0) - 0.5 * size[0] as f64) / ground.focal_px;
    let down = (middle(y, 1) - ground.horizon_px) / ground.focal_px;
    let byte = |value: f64, step: f64| (128.0 + value / step).clamp(1.0, 255.0) as u8;
    let side = if down > 0.0 { byte(right / down * ground.height_m, SIDE_STEP_M) } else { 0 };
    [byte(down, SLOPE_STEP), byte(right, SLOPE_STEP), side]
}
