//! Detection of traffic signs by colour and shape: stop signs, no-entry signs and speed limits (Vienna Convention: a red
//! octagon with a word, a red disc with a white bar, and a red ring around a number).
//!
//! No training is needed. A connected red region is a sign if its outline fills its box as much as an octagon or a circle
//! does and its content is that of a type. A number is recognised by correlating the dark pixels inside the ring with
//! drawings of all numbers; a word and a bar by the position of their white.

mod field;
mod number;
#[cfg(test)]
mod tests;

use crate::Rgb;
use crate::regions::{Region, Regions};
use number::Reader;

/// Meaning of a sign.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Meaning {
    /// Stop sign.
    Stop,
    /// No entry.
    NoEntry,
    /// Speed limit, km/h.
    SpeedLimit(u8),
}

/// Sign detected in an image.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sign {
    /// Meaning of the sign.
    pub meaning: Meaning,
    /// Left, top, width and height of its red region, pixels.
    pub bbox: [f64; 4],
    /// Confidence, 0 to 1: the correlation of a number with its drawing, or the contrast of a word or bar with the red
    /// above and below it, relative to that of a clean sign.
    pub score: f64,
}

/// Smallest sign, pixels; numbers on smaller ones are not legible.
pub const SIZE_MIN_PX: usize = 12;
/// Range of width over height; signs are seen at up to 50 degrees from the side.
const ASPECT: [f64; 2] = [0.64, 1.25];
/// Range of the share of its box that an outline fills: a circle has 0.785, an octagon 0.828, a triangle 0.5, a box 1.
const FILLED: [f64; 2] = [0.68, 0.9];
/// Largest deviation of the sides from an octagon, as a share of the width, mean over rows; allows for coarse pixels.
const OFF_OCTAGON: f64 = 0.06;
/// Share of red in the outline of a stop or no-entry sign.
const RED_FIELD: [f64; 2] = [0.45, 0.95];
/// Share of red in the outline of a speed limit.
const RING: [f64; 2] = [0.15, 0.6];
/// Radius of the disc inside the ring, as a share of the sign's.
const DISC: f64 = 0.74;
/// Smallest correlation of a number with its drawing.
const LIKENESS_MIN: f64 = 0.55;

/// Detects signs; reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct SignFinder {
    regions: Regions,
    reader: Reader,
}

impl SignFinder {
    /// Appends the signs of an image, from top to bottom.
    pub fn find(&mut self, image: Rgb<'_>, found: &mut Vec<Sign>) {
        self.regions.find(image, is_red, SIZE_MIN_PX);
        for region in self.regions.regions() {
            let aspect = region.width() as f64 / region.height() as f64;
            if !(ASPECT[0]..=ASPECT[1]).contains(&aspect) {
                continue;
            }
            found.extend(sign(&mut self.reader, image, &self.regions, region));
        }
    }
}

/// Classifies a region; `None` if it is not a sign.
fn sign(reader: &mut Reader, image: Rgb<'_>, regions: &Regions, region: &Region) -> Option<Sign> {
    let (mut outline, mut red) = (0_usize, 0_usize);
    let mut off = 0.0;
    for y in region.top..region.bottom {
        let Some((from, to)) = regions.span(region, y) else { continue };
        outline += to - from;
        off += off_octagon(region, y, [from, to]);
        red += regions.row(y)[from..to].iter().filter(|label| **label == region.label).count();
    }
    let area = (region.width() * region.height()) as f64;
    let [filled, red] = [outline as f64 / area, red as f64 / outline as f64];
    let is_in = |share: f64, [low, high]: [f64; 2]| (low..=high).contains(&share);
    if !is_in(filled, FILLED) {
        return None;
    }
    let [left, top, width, height] =
        [region.left, region.top, region.width(), region.height()].map(|n| n as f64);
    let sign = |meaning, score| Sign { meaning, bbox: [left, top, width, height], score };
    if is_in(red, RING) {
        let middle = [left + 0.5 * width, top + 0.5 * height];
        let number = reader.read(image, middle, [DISC * width, DISC * height]);
        if let Some((number, score)) = number.filter(|(_, score)| *score >= LIKENESS_MIN) {
            return Some(sign(Meaning::SpeedLimit(number), score));
        }
    }
    let is_octagon = off <= OFF_OCTAGON * height;
    if !is_octagon || !is_in(red, RED_FIELD) {
        return None;
    }
    let (meaning, score) = field::read(image, region)?;
    Some(sign(meaning, score))
}

/// Mean deviation of both sides of a row from an octagon that fills the region's box, as a share of the width.
fn off_octagon(region: &Region, y: usize, sides: [usize; 2]) -> f64 {
    /// Size of a corner cut off a regular octagon, as a share of its width or height.
    const CORNER: f64 = 1.0 - core::f64::consts::FRAC_1_SQRT_2;
    let down = (y - region.top) as f64 + 0.5;
    let from_end = down.min(region.height() as f64 - down) / region.height() as f64;
    let width = region.width() as f64;
    let cut = width * (CORNER - from_end).max(0.0);
    let [from, to] = sides.map(|x| (x - region.left) as f64);
    0.5 * ((from - cut).abs() + (to - (width - cut)).abs()) / width
}

/// Returns true for the red of paint in any light, by the ratio of colours.
fn is_red(rgb: &[u8]) -> bool {
    let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(u32::from);
    let other = g.max(b);
    // 1.5 times the other colours; blue not far below green, which excludes orange and brown.
    r >= 28 && 2 * r >= 3 * other && r >= other + 14 && 3 * b + 30 >= 2 * g
}
