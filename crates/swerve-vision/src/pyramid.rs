//! Channel pyramid of an image: channels are computed once per octave and resampled for the scales between by a power
//! law.
//!
//! Dollár, Appel, Belongie, Perona: "Fast feature pyramids for object detection", PAMI 2014, section 4: the channels of
//! an image resized by `s` approximate the resized channels times `s` to a channel-specific power. Each octave is
//! exactly half of the one before. A level is smoothed after resampling and padded by repeating its edges.

use core::ops::Range;

use serde::{Deserialize, Serialize};
use swerve_geom::math;

use crate::channels::{CHANNELS, Channels, Luv, Resampler, halve, smooth};
use crate::image::Rgb;
use crate::stack::Stack;

/// Scales of a pyramid and the parameters of its cells.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct PyramidParams {
    /// Side of a cell, pixels.
    pub shrink: usize,
    /// Levels per octave.
    pub per_octave: usize,
    /// First octave: 1 for the image at twice its size, 0 at its size, -1 at half its size.
    pub first_octave: i32,
    /// Cells of padding at the left and right, and at the top and bottom.
    pub pad: [usize; 2],
    /// Exponents of the power law by which colour, magnitude and orientations change with scale, negative.
    pub decay: [f32; 3],
    /// Width and height of the smallest useful image, pixels.
    pub least_px: [usize; 2],
}

/// Cells of the image at one scale.
#[derive(Clone, Debug, Default)]
pub struct Level {
    /// Ten planes, padded.
    pub cells: Stack,
    /// Pixels of this level's image per pixel of the original, horizontally and vertically.
    pub scale: [f64; 2],
    /// Image row at which the first line of cells starts, excluding padding.
    pub top_px: f64,
    octave: usize,
    /// Lines of its octave's cells from which it is resampled.
    lines: Range<usize>,
    /// Width and height in cells, excluding padding.
    size: [usize; 2],
    gains: [f32; 3],
    resampler: Resampler,
}

/// Octave: an image half as large as the one before.
#[derive(Clone, Debug, Default)]
struct Octave {
    luv: Stack,
    cells: Stack,
    /// Rows of `luv` covered by cells.
    rows: Range<usize>,
}

/// Computes the levels of images of one size; reuses its buffers.
#[derive(Clone, Debug)]
pub struct Pyramid {
    params: PyramidParams,
    /// Image rows that any level needs.
    rows: Range<usize>,
    octaves: Vec<Octave>,
    levels: Vec<Level>,
    luv: Luv,
    base: Stack,
    channels: Channels,
    resized: Vec<f32>,
    smoothed: Vec<f32>,
    doubler: Resampler,
    row: Vec<f32>,
}

impl Pyramid {
    /// Pyramid for images of this width and height in pixels. `rows_px(scale)` returns the image rows that a level of
    /// that scale must contain. There are no levels if the image is too small.
    pub fn new(params: PyramidParams, size: [usize; 2], rows_px: impl Fn(f64) -> Range<f64>) -> Self {
        let plan = Plan::new(&params, size, rows_px);
        Self {
            params,
            rows: plan.rows,
            octaves: plan.octaves,
            levels: plan.levels,
            luv: Luv::default(),
            base: Stack::default(),
            channels: Channels::default(),
            resized: Vec::new(),
            smoothed: Vec::new(),
            doubler: Resampler::default(),
            row: Vec::new(),
        }
    }

    /// Levels of the last image, from the largest scale to the smallest.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Computes the levels of an image.
    ///
    /// # Panics
    /// If the image size differs from the pyramid's.
    pub fn fill(&mut self, image: Rgb<'_>) {
        self.luv.compute(image, self.rows.clone(), &mut self.base);
        for k in 0..self.octaves.len() {
            let octave = self.params.first_octave - k as i32;
            let (before, rest) = self.octaves.split_at_mut(k);
            let Octave { luv, cells, rows } = &mut rest[0];
            let before = before.last().map_or(&self.base, |before| &before.luv);
            match octave {
                1 => double(before, luv, &mut self.doubler),
                0 => core::mem::swap(luv, &mut self.base),
                _ => half(before, luv),
            }
            self.channels.compute(luv, rows.clone(), self.params.shrink, cells);
        }
        for level in &mut self.levels {
            let from = &self.octaves[level.octave].cells;
            let ([width, height], [across, down]) = (level.size, self.params.pad);
            level.cells.shape(CHANNELS, width + 2 * across, height + 2 * down);
            self.resized.resize(width * height, 0.0);
            self.smoothed.resize(width * height, 0.0);
            level.resampler.set([from.width(), level.lines.len()], level.size);
            for plane in 0..CHANNELS {
                let gain = level.gains[plane.saturating_sub(2).min(2)];
                let lines = level.lines.clone();
                let part = &from.plane(plane)[lines.start * from.width()..lines.end * from.width()];
                level.resampler.plane(part, gain, &mut self.resized);
                smooth::<1>(&self.resized, width, &mut self.smoothed, &mut self.row);
                padded(&self.smoothed, self.params.pad, level.size, level.cells.plane_mut(plane));
            }
        }
        if let Some(k) = usize::try_from(self.params.first_octave).ok().filter(|k| *k < self.octaves.len()) {
            core::mem::swap(&mut self.octaves[k].luv, &mut self.base);
        }
    }
}

/// Doubles the size of an image.
fn double(from: &Stack, into: &mut Stack, resampler: &mut Resampler) {
    let size = [from.width() * 2, from.height() * 2];
    into.shape(3, size[0], size[1]);
    resampler.set([from.width(), from.height()], size);
    for plane in 0..3 {
        resampler.plane(from.plane(plane), 1.0, into.plane_mut(plane));
    }
}

/// Halves the size of an image.
fn half(from: &Stack, into: &mut Stack) {
    into.shape(3, from.width() / 2, from.height() / 2);
    for plane in 0..3 {
        halve(from.plane(plane), from.width(), into.plane_mut(plane));
    }
}

/// Pads a plane of this width and height by repeating its edges, `pad` cells horizontally and vertically.
fn padded(from: &[f32], pad: [usize; 2], [width, height]: [usize; 2], into: &mut [f32]) {
    let [across, down] = pad;
    for (y, out) in into.chunks_exact_mut(width + 2 * across).enumerate() {
        let row = &from[y.saturating_sub(down).min(height - 1) * width..][..width];
        out[..across].fill(row[0]);
        out[across..across + width].copy_from_slice(row);
        out[across + width..].fill(row[width - 1]);
    }
}

/// Layout of the pyramid for images of one size.
struct Plan {
    rows: Range<usize>,
    octaves: Vec<Octave>,
    levels: Vec<Level>,
}

impl Plan {
    fn new(params: &PyramidParams, [width, height]: [usize; 2], rows_px: impl Fn(f64) -> Range<f64>) -> Self {
        let scales = scales(params, [width, height]);
        let of = |level: usize| {
            let n = params.per_octave;
            ((level + n - n / 2 - 1) / n).min((scales.len().max(1) - 1) / n)
        };
        let count = if scales.is_empty() { 0 } else { of(scales.len() - 1) + 1 };
        let within = |rows: Range<f64>| {
            let end = rows.end.clamp(0.0, height as f64);
            rows.start.clamp(0.0, end)..end
        };
        // Align the first row with the cells of every octave.
        let coarse = params.shrink << count;
        let needed = scales.iter().map(|scale| within(rows_px(*scale))).filter(|rows| rows.start < rows.end);
        let ends = needed.fold((height, 0), |(start, end), rows| {
            (start.min(rows.start as usize / coarse * coarse), end.max(rows.end.ceil() as usize))
        });
        let rows = ends.0.min(ends.1)..ends.1;
        let mut octaves = vec![Octave::default(); count];
        let mut levels = Vec::new();
        for (k, scale) in scales.iter().enumerate() {
            let octave = of(k);
            let times = math::pow(2.0, f64::from(params.first_octave - octave as i32));
            let picture = [width as f64 * times, (rows.len() as f64) * times].map(|size| size as usize);
            let all = picture.map(|size| size / params.shrink);
            let wanted = within(rows_px(*scale));
            let cell_px = params.shrink as f64 / times;
            let line = |row_px: f64| (row_px - rows.start as f64) / cell_px;
            let lines =
                line(wanted.start).max(0.0) as usize..(line(wanted.end).ceil().max(0.0) as usize).min(all[1]);
            let ratio = scale / times;
            let size = [all[0], lines.len()].map(|size| (size as f64 * ratio).round() as usize);
            if lines.is_empty() || size.contains(&0) {
                continue;
            }
            let covered = &mut octaves[octave].rows;
            let own = lines.start * params.shrink..lines.end * params.shrink;
            let start = if covered.end == 0 { own.start } else { covered.start.min(own.start) };
            *covered = start..covered.end.max(own.end);
            levels.push(Level {
                scale: [size[0] as f64 / all[0] as f64 * times, size[1] as f64 / lines.len() as f64 * times],
                top_px: rows.start as f64 + lines.start as f64 * cell_px,
                gains: params.decay.map(|power| math::pow(ratio, f64::from(-power)) as f32),
                cells: Stack::default(),
                resampler: Resampler::default(),
                octave,
                lines,
                size,
            });
        }
        for level in &mut levels {
            let first = octaves[level.octave].rows.start / params.shrink;
            level.lines = level.lines.start - first..level.lines.end - first;
        }
        Self { rows, octaves, levels }
    }
}

/// Scale of each level relative to the image, down to the smallest useful image.
fn scales(params: &PyramidParams, [width, height]: [usize; 2]) -> Vec<f64> {
    let [least_width, least_height] = params.least_px;
    let scale =
        |k: usize| math::pow(2.0, f64::from(params.first_octave) - k as f64 / params.per_octave as f64);
    let fits = |scale: &f64| {
        width as f64 * scale >= least_width as f64 && height as f64 * scale >= least_height as f64
    };
    (0..).map(scale).take_while(fits).filter(|scale| *scale > 1e-3).collect()
}
