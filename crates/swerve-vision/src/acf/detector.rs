//! Detector that applies weights to images of one size.

use core::ops::Range;

use swerve_geom::simd::widest;
use thiserror::Error;

use super::blocks::Blocks;
use super::cascade::{Node, placed, scan};
use super::decorrelate::decorrelate;
use super::ground::Ground;
use super::weights::Features;
use super::windows::{Run, Windows, everywhere, within};
use super::{Detection, Model, Rung, Scorer, Weights, suppress};
use crate::image::Rgb;
use crate::pyramid::{Pyramid, PyramidParams};
use crate::stack::Stack;

/// Image size that differs from the scanner's.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
#[error("an image of {} x {} pixels, expected {} x {}", found[0], found[1], expected[0], expected[1])]
pub struct SizeError {
    /// Width and height of the image.
    pub found: [usize; 2],
    /// Width and height that the scanner was built for.
    pub expected: [usize; 2],
}

/// Window that the cascade did not reject.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Candidate {
    /// Index of the model in the weights.
    pub model: usize,
    /// Index of the pyramid level.
    pub level: usize,
    /// First column and line of its cells, padding included.
    pub at: [usize; 2],
    /// Sum of the trees or the template.
    pub score: f32,
}

/// Detects objects in images of one size; reuses its buffers.
#[derive(Clone, Debug)]
pub struct Scanner {
    weights: Weights,
    rung: Rung,
    ground: Option<Ground>,
    size: [usize; 2],
    pyramid: Pyramid,
    filtered: Vec<f32>,
    blocks: Blocks,
    /// Features computed from each level's cells, unless the cells are the features.
    derived: Vec<Stack>,
    search: Search,
    candidates: Vec<Candidate>,
}

/// Search areas and scratch buffers.
#[derive(Clone, Debug, Default)]
struct Search {
    everywhere: bool,
    near: Vec<[f64; 4]>,
    areas: Vec<[Range<usize>; 2]>,
    runs: Vec<Run>,
    nodes: Vec<Node>,
}

/// Search around a box: largest factor by which an object's size may differ from the box's, and largest offset of its
/// centre as a fraction of the box size.
const NEAR_SIZE: f64 = 1.4;
const NEAR_SHARE: f64 = 0.35;

impl Scanner {
    /// Scanner for images of this width and height in pixels, at one of the weights' rungs. If the rung requires a
    /// ground plane and `ground` is `None`, the whole image is searched.
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
        let derived = vec![Stack::default(); pyramid.levels().len()];
        Self {
            weights,
            rung,
            ground,
            size,
            pyramid,
            filtered: Vec::new(),
            blocks: Blocks::default(),
            derived,
            search: Search { everywhere: true, ..Search::default() },
            candidates: Vec::new(),
        }
    }

    /// Weights of the detector.
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Detects objects in an image, sorted by falling score.
    ///
    /// # Errors
    /// If the image size differs from the scanner's.
    pub fn detect(&mut self, image: Rgb<'_>, found: &mut Vec<Detection>) -> Result<(), SizeError> {
        self.detect_all(image, found)?;
        suppress(found, self.weights.overlap.0, self.weights.overlap.1);
        Ok(())
    }

    /// Detects all boxes that are not rejected, unsorted and without suppression of overlapping boxes.
    ///
    /// # Errors
    /// If the image size differs from the scanner's.
    pub fn detect_all(&mut self, image: Rgb<'_>, found: &mut Vec<Detection>) -> Result<(), SizeError> {
        self.fill(image)?;
        let mut candidates = core::mem::take(&mut self.candidates);
        self.candidates(&mut candidates);
        found.clear();
        found.extend(candidates.iter().map(|candidate| self.detection(candidate)));
        self.candidates = candidates;
        Ok(())
    }

    /// Computes the features of an image.
    ///
    /// # Errors
    /// If the image size differs from the scanner's.
    pub fn fill(&mut self, image: Rgb<'_>) -> Result<(), SizeError> {
        let found = [image.width(), image.height()];
        if found != self.size {
            return Err(SizeError { found, expected: self.size });
        }
        self.pyramid.fill(image);
        for (level, into) in self.pyramid.levels().iter().zip(&mut self.derived) {
            match self.weights.features() {
                Features::Channels => {}
                Features::Decorrelated => {
                    decorrelate(&level.cells, &self.weights.filters, &mut self.filtered, into);
                }
                Features::Blocks => self.blocks.fill(&level.cells, into),
            }
        }
        Ok(())
    }

    /// Collects all windows of the current image that are not rejected: everywhere, or near the boxes of [`look_near`].
    ///
    /// [`look_near`]: Self::look_near
    pub fn candidates(&mut self, found: &mut Vec<Candidate>) {
        found.clear();
        let mut search = core::mem::take(&mut self.search);
        for model in 0..self.weights.models.len() {
            for level in 0..self.pyramid.levels().len() {
                self.runs(model, level, &mut search);
                self.scan([model, level], &mut search, found);
            }
        }
        self.search = search;
    }

    /// Restricts the search to the surroundings of these boxes (left, top, width, height); an object's centre and size
    /// may differ from the box by a fraction of its size. `None` searches everywhere.
    pub fn look_near(&mut self, boxes: Option<&[[f64; 4]]>) {
        self.search.everywhere = boxes.is_none();
        self.search.near.clear();
        self.search.near.extend_from_slice(boxes.unwrap_or_default());
    }

    /// Scores the windows of a model on a level.
    fn scan(&self, [model, level]: [usize; 2], search: &mut Search, found: &mut Vec<Candidate>) {
        let (of, cells) = (&self.weights.models[model], self.cells(level));
        let (stride, reject) = (self.rung.stride, self.rung.reject);
        let windows = Windows { cells, runs: &search.runs, stride, reject };
        let report = &mut |at, score| found.push(Candidate { model, level, at, score });
        match &of.scorer {
            Scorer::Trees(trees) if trees.is_empty() => {}
            Scorer::Trees(trees) => {
                placed(trees, of.cells, cells, self.rung.trees, &mut search.nodes);
                let nodes = &search.nodes;
                widest(
                    #[inline(always)]
                    || match trees.depth {
                        2 => scan::<2>(trees, nodes, &windows, report),
                        3 => scan::<3>(trees, nodes, &windows, report),
                        4 => scan::<4>(trees, nodes, &windows, report),
                        _ => scan::<0>(trees, nodes, &windows, report),
                    },
                );
            }
            Scorer::Template(template) if template.weights.is_empty() => {}
            Scorer::Template(template) => widest(
                #[inline(always)]
                || template.scan(of.cells, &windows, report),
            ),
        }
    }

    /// Fills in the windows of a model to score on a level.
    fn runs(&self, model: usize, level: usize, search: &mut Search) {
        let (places, stride) = (self.places(model, level), self.rung.stride);
        if search.everywhere {
            return everywhere(places, stride, &mut search.runs);
        }
        search.areas.clear();
        search.areas.extend(search.near.iter().filter_map(|bbox| self.area(model, level, *bbox)));
        within(&search.areas, places, stride, &mut search.runs);
    }

    /// Start columns and lines of the model's windows that may contain the object of a box; `None` on a level where the
    /// object would be too large or too small.
    fn area(&self, model: usize, level: usize, bbox: [f64; 4]) -> Option<[Range<usize>; 2]> {
        let (window, at) = (&self.weights.models[model], &self.pyramid.levels()[level]);
        let apart = bbox[3] * at.scale[1] / window.object_px[1];
        if !(1.0 / NEAR_SIZE..=NEAR_SIZE).contains(&apart) {
            return None;
        }
        let inset = self.inset_px(window);
        let range = |k: usize, from_px: f64, reach_px: f64| {
            let middle_px = bbox[k] + 0.5 * bbox[k + 2] - from_px;
            let cell = |px: f64| (px * at.scale[k] - 0.5 * window.object_px[k] - inset[k]) / self.cell_px();
            let first = cell(middle_px - reach_px).floor().max(0.0) as usize;
            first..(cell(middle_px + reach_px).ceil().max(0.0) as usize).saturating_add(1)
        };
        let larger = bbox[2].max(bbox[3]);
        Some([range(0, 0.0, NEAR_SHARE * larger), range(1, at.top_px, NEAR_SHARE * bbox[3])])
    }

    /// Start columns and lines, in cells, at which windows of a model fit on a level.
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

    /// Left, top, width and height of a window's object in the image, pixels.
    pub fn bbox(&self, candidate: &Candidate) -> [f64; 4] {
        let (model, level) = (&self.weights.models[candidate.model], &self.pyramid.levels()[candidate.level]);
        let inset = self.inset_px(model);
        let start = |k: usize| (candidate.at[k] as f64 * self.cell_px() + inset[k]) / level.scale[k];
        let side = |k: usize| model.object_px[k] / level.scale[k];
        [start(0), start(1) + level.top_px, side(0), side(1)]
    }

    /// Windows of a model nearest to a box: one on each of the two levels nearest in height, if the heights differ by
    /// less than a factor of 1.2.
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

    /// Features of a window as bytes, in units of [`Weights::feature_step`].
    pub fn features(&self, candidate: &Candidate, into: &mut Vec<u8>) {
        let ([columns, lines], cells) =
            (self.weights.models[candidate.model].cells, self.cells(candidate.level));
        for plane in 0..self.weights.planes() {
            let units = 1.0 / self.weights.feature_step(plane);
            for line in 0..lines {
                let row = &cells.row(plane, candidate.at[1] + line)[candidate.at[0]..][..columns];
                into.extend(row.iter().map(|value| (value * units).clamp(0.0, 255.0) as u8));
            }
        }
    }

    /// Number of pyramid levels.
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
        match self.weights.features() {
            Features::Channels => &self.pyramid.levels()[level].cells,
            Features::Decorrelated | Features::Blocks => &self.derived[level],
        }
    }

    /// Size of a feature cell in pixels of the level's image.
    fn cell_px(&self) -> f64 {
        cell_px(&self.weights)
    }

    /// Offset from the corner of the window's first cell to the object's corner, in pixels of the level's image.
    fn inset_px(&self, model: &Model) -> [f64; 2] {
        let pad = pad(&self.weights);
        let of = |k: usize| {
            let around = model.cells[k] as f64 * self.cell_px() - model.object_px[k];
            0.5 * around - (pad[k] * self.weights.shrink) as f64
        };
        [of(0), of(1)]
    }
}

/// Size of a feature cell in pixels.
fn cell_px(weights: &Weights) -> f64 {
    let halved = if weights.filters.is_empty() { 1 } else { 2 };
    (weights.shrink * halved) as f64
}

/// Cells of padding around a level, so that windows fit around objects at the image border.
fn pad(weights: &Weights) -> [usize; 2] {
    let around = |model: &Model, k: usize| {
        let px = model.cells[k] as f64 * cell_px(weights) - model.object_px[k];
        (0.5 * px / weights.shrink as f64).ceil().max(0.0) as usize
    };
    [0, 1].map(|k| weights.models.iter().map(|model| around(model, k)).max().unwrap_or(0))
}

/// Image rows that a model's windows on a level of this scale can cover.
fn rows_px(model: &Model, weights: &Weights, rung: &Rung, ground: Option<Ground>, scale: f64) -> Range<f64> {
    let (Some(ground), Some(tolerance_rad)) = (ground, rung.tolerance_rad) else {
        return f64::NEG_INFINITY..f64::INFINITY;
    };
    let box_px = model.object_px[1] / scale;
    let foot = ground.foot_rows(box_px, model.heights_m, tolerance_rad);
    // Plus two cells on each side, the extent of the smoothing.
    let around_px = (0.5 * (model.cells[1] as f64 * cell_px(weights) - model.object_px[1])
        + 2.0 * cell_px(weights))
        / scale;
    foot.start - box_px - around_px..foot.end + around_px
}
