//! Features of a cell for the forest: channel bytes at four scales, and the direction of the cell's ray.

use super::features::{FEATURES, LEVELS, PAD, PLACES, RAY};
use super::weights::{CLASSES, TREES, Tree};
use crate::acf::{Ground, feature_step};
use crate::channels::{CHANNELS, halve};
use crate::stack::Stack;

/// Slope per unit of a byte; 128 is zero.
const SLOPE_STEP: f64 = 1.0 / 170.0;
/// Metres to the side per unit of a byte; 128 is zero.
const SIDE_STEP_M: f64 = 1.0 / 8.0;

/// Feature bytes of one image's cells.
#[derive(Clone, Debug)]
pub(super) struct Planes {
    cells: [usize; 2],
    levels: [Level; LEVELS],
    /// All levels, padded, with the channels of a cell contiguous; then the rays.
    bytes: Vec<u8>,
    rays: usize,
    stacks: [Stack; LEVELS],
}

/// Layout of one scale.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    /// Number of times it was halved.
    halvings: u32,
    size: [usize; 2],
    /// Index of its first byte.
    start: usize,
}

impl Level {
    fn stride(&self) -> usize {
        (self.size[0] + 2 * PAD) * CHANNELS
    }

    /// First byte of the cell that contains a cell of the finest scale.
    fn base(&self, [x, y]: [usize; 2]) -> usize {
        self.start + ((y >> self.halvings) + PAD) * self.stride() + ((x >> self.halvings) + PAD) * CHANNELS
    }
}

/// Tree with feature offsets for one image size.
#[derive(Clone, Debug)]
pub(super) struct Walk {
    nodes: Vec<Node>,
    leaves: Vec<[u8; CLASSES]>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// Offset from the cell's first byte to the compared byte; the leaf index for a leaf.
    offset: i32,
    /// Index of the node to visit if the byte is below the threshold; otherwise the next one.
    lower: u16,
    /// Scale; [`LEVELS`] for the ray, one more for a leaf.
    level: u8,
    threshold: u8,
}

const LEAF: u8 = LEVELS as u8 + 1;

impl Planes {
    /// Planes for this number of cells across and down; rays are computed from the image size and the camera.
    pub(super) fn new(cells: [usize; 2], size: [usize; 2], ground: Ground) -> Self {
        let mut levels = [Level { size: cells, ..Level::default() }; LEVELS];
        let mut end = 0;
        for k in 0..LEVELS {
            if k > 0 {
                levels[k] = levels[k - 1];
                // A scale that cannot be halved is repeated.
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

    /// Fills the feature bytes from the channels of an image.
    pub(super) fn fill(&mut self, cells: &Stack) {
        for k in 0..LEVELS {
            let level = self.levels[k];
            let (finer, own) = self.stacks.split_at_mut(k);
            resize(finer.last().unwrap_or(cells), level.size, &mut own[0]);
            let end = level.start + level.stride() * (level.size[1] + 2 * PAD);
            pack(&own[0], &mut self.bytes[level.start..end]);
        }
    }

    /// First bytes of a cell at each scale, and of its ray.
    fn bases(&self, cell: [usize; 2]) -> [usize; LEVELS + 1] {
        let ray = self.rays + (cell[1] * self.cells[0] + cell[0]) * RAY;
        core::array::from_fn(|k| self.levels.get(k).map_or(ray, |level| level.base(cell)))
    }

    /// Scale of a feature, and the offset of its byte from the cell's first byte.
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

    /// Resolves a tree's features to byte offsets.
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

    /// Sums the trees' votes for all cells, class by class.
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

/// Copies the planes, or halves them if the size differs; an odd last row or column is dropped.
fn resize(from: &Stack, [width, height]: [usize; 2], into: &mut Stack) {
    into.shape(CHANNELS, width, height);
    if from.width() == width && from.height() == height {
        return into.numbers_mut().copy_from_slice(from.numbers());
    }
    (0..CHANNELS).for_each(|plane| halve(from.plane(plane), from.width(), into.plane_mut(plane)));
}

/// Quantises all channels to bytes, cell by cell, with the edges repeated on all sides.
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

/// Slopes down and to the right, and metres to the right where the ray meets the ground; 128 is zero, and 0 means that
/// it does not meet the ground.
fn ray([x, y]: [usize; 2], cells: [usize; 2], size: [usize; 2], ground: Ground) -> [u8; RAY] {
    let middle = |k: usize, axis: usize| (k as f64 + 0.5) * size[axis] as f64 / cells[axis] as f64;
    let right = (middle(x, 0) - 0.5 * size[0] as f64) / ground.focal_px;
    let down = (middle(y, 1) - ground.horizon_px) / ground.focal_px;
    let byte = |value: f64, step: f64| (128.0 + value / step).clamp(1.0, 255.0) as u8;
    let side = if down > 0.0 { byte(right / down * ground.height_m, SIDE_STEP_M) } else { 0 };
    [byte(down, SLOPE_STEP), byte(right, SLOPE_STEP), side]
}
