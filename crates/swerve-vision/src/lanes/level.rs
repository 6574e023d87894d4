//! Level view: an image with lens distortion and mounting rotation removed.

use swerve_geom::math;

use super::camera::{Lens, RoadCamera};
use crate::{Plane, Rgb};

/// Largest slope to the left and right: 60 degrees.
const LEFT_MAX: f64 = 1.7;
/// Largest slope below the horizon; beyond it is the ego's own bonnet.
const DOWN_MAX: f64 = 0.7;
/// Fractional bits of pixel positions.
const SHARE_BITS: u32 = 7;

/// Image of an ideal camera at the position of the real one that looks straight ahead.
///
/// Pixels hold red plus green minus blue, -255 to 510: grey keeps its brightness, and yellow paint stands out on
/// concrete.
#[derive(Clone, Debug)]
pub(super) struct LevelView {
    height_m: f64,
    focal_px: f64,
    left: f64,
    top: f64,
    lookups: Vec<Lookup>,
    /// Range of columns seen by the real camera, for each row.
    seen: Vec<[usize; 2]>,
    /// Image rows that are read.
    rows: [usize; 2],
    colour: Plane<i16>,
    pixels: Plane<i16>,
}

/// Source of a pixel: its upper left neighbour of four, and the weights of the right and lower ones.
#[derive(Clone, Copy, Debug, Default)]
struct Lookup {
    at: u32,
    right: u16,
    lower: u16,
}

impl LevelView {
    /// View of a road up to `reach_m` ahead, for any pitch up to `pitch_rad`.
    pub(super) fn new(camera: &RoadCamera, pitch_rad: f64, reach_m: f64) -> Self {
        let height_m = camera.ego_from_camera.origin().coords.z;
        let focal_px = camera.focal_px[0].min(camera.size_px[0].max(64) as f64 * 2.0);
        let lens = Lens::new(camera);
        let top = height_m / reach_m - math::tan(pitch_rad);
        let downs = (0..((DOWN_MAX - top) * focal_px) as usize).map(|v| top + (v as f64 + 0.5) / focal_px);
        let lefts = 0..(2.0 * LEFT_MAX * focal_px) as usize;
        let left_of = |u: usize| LEFT_MAX - (u as f64 + 0.5) / focal_px;
        let sees = |u: usize, down: f64| lens.pixel([left_of(u), down]).is_some();
        let is_column = |u: &usize| downs.clone().step_by(8).any(|down| sees(*u, down));
        let first = lefts.clone().find(is_column).unwrap_or(0);
        let end = lefts.rev().find(is_column).map_or(first, |last| last + 1);
        let mut view = Self {
            height_m,
            focal_px,
            left: LEFT_MAX - first as f64 / focal_px,
            top,
            lookups: Vec::new(),
            seen: Vec::new(),
            rows: [usize::MAX, 0],
            colour: Plane::default(),
            pixels: Plane::default(),
        };
        let rows: Vec<f64> = downs.collect();
        let last = rows.iter().rposition(|down| (first..end).step_by(4).any(|u| sees(u, *down)));
        for down in &rows[..last.map_or(0, |last| last + 1)] {
            view.add_row((first..end).map(|u| lens.pixel([left_of(u), *down])), camera.size_px[0]);
        }
        view.pixels = Plane::new(end - first, view.seen.len());
        view
    }

    fn add_row(&mut self, pixels: impl Iterator<Item = Option<[f64; 2]>>, width: usize) {
        let mut seen = [usize::MAX, 0];
        for (u, pixel) in pixels.enumerate() {
            let Some([column, row]) = pixel else {
                self.lookups.push(Lookup::default());
                continue;
            };
            let one = f64::from(1_u32 << SHARE_BITS);
            let share = |at: f64| ((at - at.floor()) * one) as u16;
            let at = row as usize * width + column as usize;
            self.lookups.push(Lookup { at: at as u32, right: share(column), lower: share(row) });
            seen = [seen[0].min(u), u + 1];
            self.rows = [self.rows[0].min(row as usize), self.rows[1].max(row as usize + 2)];
        }
        self.seen.push(if seen[1] == 0 { [0, 0] } else { seen });
    }

    /// Renders the view from a camera image.
    pub(super) fn look(&mut self, image: Rgb<'_>) {
        let (width, rows) = (image.width(), self.rows[0]..self.rows[1]);
        if rows.is_empty() {
            return;
        }
        if self.colour.width() != width {
            self.colour.reset(width, image.height());
        }
        for y in rows {
            let from = image.row(y).chunks_exact(3);
            for (into, rgb) in self.colour.row_mut(y).iter_mut().zip(from) {
                *into = i16::from(rgb[0]) + i16::from(rgb[1]) - i16::from(rgb[2]);
            }
        }
        let colour = self.colour.pixels();
        for (into, lookup) in self.pixels.pixels_mut().iter_mut().zip(&self.lookups) {
            let at = lookup.at as usize;
            // The last pixel has no neighbours; no valid lookup starts there.
            let Some(below) = colour.get(at + width..at + width + 2) else { continue };
            let (right, lower) = (i32::from(lookup.right), i32::from(lookup.lower));
            let one = 1 << SHARE_BITS;
            let upper = i32::from(colour[at]) * (one - right) + i32::from(colour[at + 1]) * right;
            let below = i32::from(below[0]) * (one - right) + i32::from(below[1]) * right;
            *into = ((upper * (one - lower) + below * lower) >> (2 * SHARE_BITS)) as i16;
        }
    }

    /// Height of the camera above the road, metres.
    pub(super) fn height_m(&self) -> f64 {
        self.height_m
    }

    /// Pixels per unit of slope.
    pub(super) fn focal_px(&self) -> f64 {
        self.focal_px
    }

    /// Pixels of the view.
    pub(super) fn pixels(&self) -> &Plane<i16> {
        &self.pixels
    }

    /// Range of columns of a row that were seen.
    pub(super) fn seen(&self, row: usize) -> [usize; 2] {
        self.seen[row]
    }

    /// Downward slope at the centre of a row.
    pub(super) fn down(&self, row: f64) -> f64 {
        self.top + (row + 0.5) / self.focal_px
    }

    /// Leftward slope at the centre of a column.
    pub(super) fn left(&self, column: f64) -> f64 {
        self.left - (column + 0.5) / self.focal_px
    }

    /// Width of a mark in a row, pixels, for a camera pitched down by `pitch_rad` relative to its mounting.
    pub(super) fn mark_px(&self, row: usize, pitch_rad: f64, mark_m: f64) -> f64 {
        (self.down(row as f64) + pitch_rad).max(0.0) * mark_m * self.focal_px / self.height_m
    }
}
