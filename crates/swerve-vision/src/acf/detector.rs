//! Weights put to use on images of one size.

use core::ops::Range;

use thiserror::Error;

use super::decorrelate::decorrelate;
use super::ground::Ground;
use super::{Detection, Model, Rung, Trees, Weights, feature_step, suppress};
use crate::channels::{CHANNELS, select};
use crate::image::Rgb;
use crate::pyramid::{Pyramid, PyramidParams};
use crate::simd::widest;
use crate::stack::Stack;

/// An image of another size than a scanner is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
#[error("an image of {} x {} pixels, expected {} x {}", found[0], found[1], expected[0], expected[1])]
pub struct SizeError {
    /// Width and height.
    pub found: [usize; 2],
    /// Those of the scanner.
    pub expected: [usize; 2],
}

/// A window that was not given up.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Candidate {
    /// Which of the weights' models.
    pub model: usize,
    /// Which level of the pyramid.
    pub level: usize,
    /// Its first column and line of cells, padding counted.
    pub at: [usize; 2],
    /// The sum of its trees.
    pub score: f32,
}

/// Finds objects in images of one size; it keeps its memory.
#[derive(Clone, Debug)]
pub struct Scanner {
    weights: Weights,
    rung: Rung,
    ground: Option<Ground>,
    size: [usize; 2],
    pyramid: Pyramid,
    filtered: Vec<f32>,
    /// The cells of each level, filtered, where there are filters.
    decorrelated: Vec<Stack>,
    nodes: Vec<Node>,
    candidates: Vec<Candidate>,
}

/// A node of a tree on one level.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Of its feature, from the window's first cell.
    offset: u32,
    threshold: f32,
}

impl Scanner {
    /// For images of this width and height in pixels, on one of the weights' rungs. Where the rung asks for ground and
    /// none is known, objects are looked for everywhere.
    pub fn new(weights: Weights, rung: Rung, size: [usize; 2], ground: Option<Ground>) -> Self {
        let ground = ground.filter(|_| rung.tolerance_rad.is_some());
        let fewest = |side: usize| {
            let windows = weights.models.iter().map(|model| model.object_px[side].ceil() as usize);
            windows.min().unwrap_or(1).max(weights.shrink)
        };
        let params = PyramidParams {
            shrink: weights.shrink,
            per_octave: rung.per_octave,
            first_octave: rung.first_octave,
            pad: pad(&weights),
            decay: weights.decay,
            least_px: [fewest(0), fewest(1)],
        };
        let rows = |scale: f64| {
            let of = |model: &Model| rows_px(model, &weights, &rung, ground, scale);
            weights
                .models
                .iter()
                .map(of)
                .reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
                .unwrap_or(0.0..0.0)
        };
        let pyramid = Pyramid::new(params, size, rows);
        let decorrelated = vec![Stack::default(); pyramid.levels().len()];
        Self {
            weights,
            rung,
            ground,
            size,
            pyramid,
            filtered: Vec::new(),
            decorrelated,
            nodes: Vec::new(),
            candidates: Vec::new(),
        }
    }

    /// What it looks with.
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Other models and calibrations, for the same windows: what training changes.
    pub fn set_trees(&mut self, trees: Vec<Trees>) {
        for (model, trees) in self.weights.models.iter_mut().zip(trees) {
            model.trees = trees;
        }
    }

    /// What is found in an image, the likeliest first.
    ///
    /// # Errors
    /// Where the image is of another size.
    pub fn detect(&mut self, image: Rgb<'_>, found: &mut Vec<Detection>) -> Result<(), SizeError> {
        self.detect_all(image, found)?;
        suppress(found, self.weights.overlap.0, self.weights.overlap.1);
        Ok(())
    }

    /// All boxes of an image that are not given up, also those that share most of their area, in no order.
    ///
    /// # Errors
    /// Where the image is of another size.
    pub fn detect_all(&mut self, image: Rgb<'_>, found: &mut Vec<Detection>) -> Result<(), SizeError> {
        self.fill(image)?;
        let mut candidates = core::mem::take(&mut self.candidates);
        self.candidates(&mut candidates);
        found.clear();
        found.extend(candidates.iter().map(|candidate| self.detection(candidate)));
        self.candidates = candidates;
        Ok(())
    }

    /// Takes in an image.
    ///
    /// # Errors
    /// Where the image is of another size.
    pub fn fill(&mut self, image: Rgb<'_>) -> Result<(), SizeError> {
        let found = [image.width(), image.height()];
        if found != self.size {
            return Err(SizeError { found, expected: self.size });
        }
        self.pyramid.fill(image);
        if !self.weights.filters.is_empty() {
            for (level, into) in self.pyramid.levels().iter().zip(&mut self.decorrelated) {
                decorrelate(&level.cells, &self.weights.filters, &mut self.filtered, into);
            }
        }
        Ok(())
    }

    /// All windows of the image taken in that are not given up.
    pub fn candidates(&mut self, found: &mut Vec<Candidate>) {
        found.clear();
        let mut nodes = core::mem::take(&mut self.nodes);
        for model in 0..self.weights.models.len() {
            let trees = &self.weights.models[model].trees;
            if trees.is_empty() {
                continue;
            }
            for level in 0..self.pyramid.levels().len() {
                let cells = self.cells(level);
                placed(&self.weights.models[model], cells, self.rung.trees, &mut nodes);
                let at = |at, score| Candidate { model, level, at, score };
                let report = &mut |place, score| found.push(at(place, score));
                widest(
                    #[inline(always)]
                    || match trees.depth {
                        2 => self.scan::<2>(model, level, &nodes, report),
                        3 => self.scan::<3>(model, level, &nodes, report),
                        4 => self.scan::<4>(model, level, &nodes, report),
                        _ => self.scan::<0>(model, level, &nodes, report),
                    },
                );
            }
        }
        self.nodes = nodes;
    }

    /// The windows of one model on one level; trees of any depth where `D` is 0.
    #[inline(always)]
    fn scan<const D: usize>(
        &self,
        model: usize,
        level: usize,
        nodes: &[Node],
        report: &mut impl FnMut([usize; 2], f32),
    ) {
        let cells = self.cells(level);
        let trees = &self.weights.models[model].trees;
        let depth = if D == 0 { trees.depth } else { D };
        let [columns, lines] = self.places(model, level);
        let (inner, reject) = ((1 << depth) - 1, self.rung.reject);
        let all = || nodes.chunks_exact(inner).zip(trees.leaves.chunks_exact(inner + 1));
        for line in lines.step_by(self.rung.stride) {
            let mut rest = columns.clone();
            if (1..=DEEPEST).contains(&D) && self.rung.stride == 1 {
                while rest.len() >= LANES {
                    let windows = &cells.numbers()[line * cells.width() + rest.start..];
                    let mut report = |lane, score| report([rest.start + lane, line], score);
                    side_by_side::<D>(windows, all(), reject, &mut report);
                    rest.start += LANES;
                }
            }
            for column in rest.step_by(self.rung.stride) {
                let window = &cells.numbers()[line * cells.width() + column..];
                let score = climb(window, all(), depth, (0.0, reject));
                if score > reject {
                    report([column, line], score);
                }
            }
        }
    }

    /// Where windows of a model can begin on a level: columns and lines of cells.
    pub fn places(&self, model: usize, level: usize) -> [Range<usize>; 2] {
        let model = &self.weights.models[model];
        let cells = self.cells(level);
        let fitting = |all: usize, window: usize| 0..(all + 1).saturating_sub(window);
        let columns = fitting(cells.width(), model.cells[0]);
        let lines = fitting(cells.height(), model.cells[1]);
        let (Some(ground), Some(tolerance_rad)) = (self.ground, self.rung.tolerance_rad) else {
            return [columns, lines];
        };
        let level = &self.pyramid.levels()[level];
        let box_px = model.object_px[1] / level.scale[1];
        let foot = ground.foot_rows(box_px, model.heights_m, tolerance_rad);
        let line = |foot_px: f64| {
            let top_px = (foot_px - box_px - level.top_px) * level.scale[1] - self.inset_px(model)[1];
            (top_px / self.cell_px()).max(0.0)
        };
        let asked = line(foot.start) as usize..line(foot.end).ceil() as usize + 1;
        [columns, asked.start.min(lines.end)..asked.end.min(lines.end)]
    }

    /// Left, top, width and height of a window's object in the image.
    pub fn bbox(&self, candidate: &Candidate) -> [f64; 4] {
        let (model, level) = (&self.weights.models[candidate.model], &self.pyramid.levels()[candidate.level]);
        let inset = self.inset_px(model);
        let start = |k: usize| (candidate.at[k] as f64 * self.cell_px() + inset[k]) / level.scale[k];
        let side = |k: usize| model.object_px[k] / level.scale[k];
        [start(0), start(1) + level.top_px, side(0), side(1)]
    }

    /// The windows of a model whose object is nearest to a box: one on each of the two levels nearest in height, if any is
    /// within a fifth of it.
    pub fn around(&self, model: usize, bbox: [f64; 4]) -> Vec<Candidate> {
        let (window, inset) = (&self.weights.models[model], self.inset_px(&self.weights.models[model]));
        let apart = |level: usize| {
            let ratio = bbox[3] * self.pyramid.levels()[level].scale[1] / window.object_px[1];
            ratio.max(1.0 / ratio)
        };
        let mut levels: Vec<usize> = (0..self.levels()).filter(|level| apart(*level) < 1.2).collect();
        levels.sort_by(|a, b| apart(*a).total_cmp(&apart(*b)));
        let middle = [bbox[0] + 0.5 * bbox[2], bbox[1] + 0.5 * bbox[3]];
        let nearest = |level: &usize| {
            let (at, top_px) = (&self.pyramid.levels()[*level], self.pyramid.levels()[*level].top_px);
            let cell = |k: usize, from_px: f64| {
                let start_px = (middle[k] - from_px) * at.scale[k] - 0.5 * window.object_px[k] - inset[k];
                (start_px / self.cell_px()).round()
            };
            let (cells, place) = (self.cells(*level), [cell(0, 0.0), cell(1, top_px)]);
            let fits = |k: usize, all: usize| place[k] >= 0.0 && place[k] as usize + window.cells[k] <= all;
            let at = [place[0] as usize, place[1] as usize];
            let fits = fits(0, cells.width()) && fits(1, cells.height());
            fits.then_some(Candidate { model, level: *level, at, score: 0.0 })
        };
        levels.iter().take(2).filter_map(nearest).collect()
    }

    /// The features of a window in units of [`feature_step`], a byte each.
    pub fn features(&self, candidate: &Candidate, into: &mut Vec<u8>) {
        let ([columns, lines], cells) =
            (self.weights.models[candidate.model].cells, self.cells(candidate.level));
        for plane in 0..self.weights.planes() {
            let units = 1.0 / feature_step(plane % CHANNELS);
            for line in 0..lines {
                let row = &cells.row(plane, candidate.at[1] + line)[candidate.at[0]..][..columns];
                into.extend(row.iter().map(|value| (value * units).clamp(0.0, 255.0) as u8));
            }
        }
    }

    /// How many levels there are.
    pub fn levels(&self) -> usize {
        self.pyramid.levels().len()
    }

    fn detection(&self, candidate: &Candidate) -> Detection {
        let class = self.weights.models[candidate.model].class;
        let score = f64::from(candidate.score);
        let calibration = self.rung.calibrations.get(class);
        let score = calibration.map_or(score, |calibration| calibration.probability(score));
        Detection { class, bbox: self.bbox(candidate), score }
    }

    fn cells(&self, level: usize) -> &Stack {
        if self.weights.filters.is_empty() {
            &self.pyramid.levels()[level].cells
        } else {
            &self.decorrelated[level]
        }
    }

    /// Pixels of a level's picture along a cell.
    fn cell_px(&self) -> f64 {
        cell_px(&self.weights)
    }

    /// From the first cell's corner to the object's, in pixels of the level's picture.
    fn inset_px(&self, model: &Model) -> [f64; 2] {
        let pad = pad(&self.weights);
        let of = |k: usize| {
            let around = model.cells[k] as f64 * self.cell_px() - model.object_px[k];
            0.5 * around - (pad[k] * self.weights.shrink) as f64
        };
        [of(0), of(1)]
    }
}

/// Windows of neighbouring columns that are scored at once.
const LANES: usize = 8;
/// Deeper trees are climbed one by one: all nodes of a tree are looked at where several windows are.
const DEEPEST: usize = 3;
/// Where no more windows than this are left of those, they are followed one by one.
const FEW: usize = 2;

/// The score of a window from one of its trees on, given up once it is at `reject` or below.
#[inline(always)]
fn climb<'a>(
    window: &[f32],
    trees: impl Iterator<Item = (&'a [Node], &'a [f32])>,
    depth: usize,
    (mut score, reject): (f32, f32),
) -> f32 {
    for (nodes, leaves) in trees {
        let mut k = 0;
        for _ in 0..depth {
            let node = nodes[k];
            k = 2 * k + if window[node.offset as usize] < node.threshold { 1 } else { 2 };
        }
        score += leaves[k - nodes.len()];
        if score <= reject {
            break;
        }
    }
    score
}

/// Scores windows of neighbouring columns, tree by tree, and reports those that are not given up: the same sums, term by
/// term, as each has by itself.
#[inline(always)]
fn side_by_side<'a, const D: usize>(
    windows: &[f32],
    mut trees: impl Iterator<Item = (&'a [Node], &'a [f32])> + Clone,
    reject: f32,
    report: &mut impl FnMut(usize, f32),
) {
    let (mut scores, mut alive) = ([0.0; LANES], [true; LANES]);
    while alive.iter().filter(|alive| **alive).count() > FEW {
        let Some((nodes, leaves)) = trees.next() else { break };
        let values = leaves_of::<D>(nodes, leaves, windows);
        for lane in 0..LANES {
            scores[lane] += values[lane];
            alive[lane] &= scores[lane] > reject;
        }
    }
    for lane in (0..LANES).filter(|lane| alive[*lane]) {
        let score = climb(&windows[lane..], trees.clone(), D, (scores[lane], reject));
        if score > reject {
            report(lane, score);
        }
    }
}

/// The leaf of one tree that each of the windows comes to: from the leaves down to the root, each node keeps one of two.
#[inline(always)]
fn leaves_of<const D: usize>(nodes: &[Node], leaves: &[f32], windows: &[f32]) -> [f32; LANES] {
    let mut values = [[0.0; LANES]; 1 << DEEPEST];
    values.iter_mut().zip(leaves).for_each(|(value, leaf)| *value = [*leaf; LANES]);
    for level in (0..D).rev() {
        for k in 0..1 << level {
            let node = nodes[(1 << level) - 1 + k];
            let row = &windows[node.offset as usize..][..LANES];
            values[k] = core::array::from_fn(|lane| {
                select(row[lane] < node.threshold, values[2 * k][lane], values[2 * k + 1][lane])
            });
        }
    }
    values[0]
}

/// Pixels along a cell that features are taken from.
fn cell_px(weights: &Weights) -> f64 {
    let halved = if weights.filters.is_empty() { 1 } else { 2 };
    (weights.shrink * halved) as f64
}

/// Cells added around a level, so that an object at the edge has a whole window.
fn pad(weights: &Weights) -> [usize; 2] {
    let around = |model: &Model, k: usize| {
        let px = model.cells[k] as f64 * cell_px(weights) - model.object_px[k];
        (0.5 * px / weights.shrink as f64).ceil().max(0.0) as usize
    };
    [0, 1].map(|k| weights.models.iter().map(|model| around(model, k)).max().unwrap_or(0))
}

/// Rows of the image that a model's windows on a level of that scale can cover.
fn rows_px(model: &Model, weights: &Weights, rung: &Rung, ground: Option<Ground>, scale: f64) -> Range<f64> {
    let (Some(ground), Some(tolerance_rad)) = (ground, rung.tolerance_rad) else {
        return f64::NEG_INFINITY..f64::INFINITY;
    };
    let box_px = model.object_px[1] / scale;
    let foot = ground.foot_rows(box_px, model.heights_m, tolerance_rad);
    // Two cells more than the windows: what smoothing reaches.
    let around_px = (0.5 * (model.cells[1] as f64 * cell_px(weights) - model.object_px[1])
        + 2.0 * cell_px(weights))
        / scale;
    foot.start - box_px - around_px..foot.end + around_px
}

/// Where the trees' features are on a level.
fn placed(model: &Model, cells: &Stack, trees: usize, into: &mut Vec<Node>) {
    let [columns, lines] = model.cells;
    let plane = cells.width() * cells.height();
    let inner = (1 << model.trees.depth) - 1;
    let nodes = model.trees.features.iter().zip(&model.trees.thresholds).take(trees.saturating_mul(inner));
    into.clear();
    into.extend(nodes.map(|(feature, &threshold)| {
        let feature = usize::from(*feature);
        let (line, column) = (feature / columns % lines, feature % columns);
        let offset = feature / (columns * lines) * plane + line * cells.width() + column;
        Node { offset: offset as u32, threshold }
    }));
}
