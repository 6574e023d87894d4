//! Traffic lights: which lamp of a crop is lit, by colour and place, and what a light shows over time.
//!
//! Nothing is trained. Colours vote by hue, each with its saturation times the square of its brightness, and the more
//! the nearer they are to where their lamp is in an upright head of three.

mod find;
#[cfg(test)]
mod tests;

use swerve_geom::math;

use crate::Rgb;

pub use find::{Head, LightFinder, Looker};

/// A lamp of a traffic light.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Lamp {
    /// The lowest.
    Green,
    /// The middle one.
    Yellow,
    /// The highest.
    Red,
}

impl Lamp {
    /// All, from the lowest.
    pub const ALL: [Self; 3] = [Self::Green, Self::Yellow, Self::Red];

    /// Its name.
    pub fn name(self) -> &'static str {
        ["green", "yellow", "red"][self as usize]
    }

    /// Where it is in an upright head: parts of the height, from above.
    fn place(self) -> f64 {
        [0.8, 0.5, 0.2][self as usize]
    }

    /// The lamps that may have a hue, degrees; the bounds are wider than the lamps', for cameras that are off balance. What
    /// is red and overexposed, as at night, is orange.
    fn of_hue(degrees: f64) -> &'static [Self] {
        match degrees {
            _ if !(16.0..=330.0).contains(&degrees) => &[Self::Red],
            _ if (16.0..24.0).contains(&degrees) => &[Self::Red, Self::Yellow],
            _ if (24.0..70.0).contains(&degrees) => &[Self::Yellow],
            _ if (80.0..200.0).contains(&degrees) => &[Self::Green],
            _ => &[],
        }
    }

    /// Whether this comes after `before`: green, yellow, red, and green again.
    fn follows(self, before: Self) -> bool {
        matches!(
            (before, self),
            (Self::Green, Self::Yellow) | (Self::Yellow, Self::Red) | (Self::Red, Self::Green)
        )
    }
}

/// How far lamps are from where they should be, parts of the height, as a standard deviation.
const SPREAD: f64 = 0.15;
/// The columns that are looked at, parts of the width: beside them is what stands behind the head.
const COLUMNS: [f64; 2] = [0.2, 0.8];
/// Mean vote of a lit lamp over the pixels looked at, at the least: of 1,469 photographs told rightly without it, one is
/// below.
const LEAST: f64 = 2e-4;

/// Which lamp is lit in a crop around the head of a light, and by which share of all votes, 0 to 1; none where nothing
/// of the crop is bright and coloured, as in a black or a white one.
pub fn lit(crop: Rgb<'_>) -> Option<(Lamp, f64)> {
    lit_within(crop, 1.0)
}

/// The same of a crop that is `around` times as wide and as high as the head in its middle.
fn lit_within(crop: Rgb<'_>, around: f64) -> Option<(Lamp, f64)> {
    let columns = COLUMNS.map(|part| (part * crop.width() as f64).round() as usize);
    let columns = if columns[0] < columns[1] { columns[0]..columns[1] } else { 0..crop.width() };
    let mut votes = [0.0; 3];
    for y in 0..crop.height() {
        let of_row = votes_of(&crop.row(y)[3 * columns.start..3 * columns.end]);
        let place = 0.5 + around * ((y as f64 + 0.5) / crop.height() as f64 - 0.5);
        for lamp in Lamp::ALL {
            let away = (place - lamp.place()) / SPREAD;
            votes[lamp as usize] += of_row[lamp as usize] * math::exp(-0.5 * away * away);
        }
    }
    let best = Lamp::ALL.into_iter().max_by(|a, b| votes[*a as usize].total_cmp(&votes[*b as usize]))?;
    let most = votes[best as usize];
    let pixels = (columns.len() * crop.height()) as f64;
    (most > LEAST * pixels).then(|| (best, most / votes.iter().sum::<f64>()))
}

/// Votes of some pixels for each lamp.
fn votes_of(pixels: &[u8]) -> [f64; 3] {
    let mut votes = [0.0; 3];
    for (lamps, vote) in pixels.chunks_exact(3).map(vote_of) {
        lamps.iter().for_each(|lamp| votes[*lamp as usize] += vote);
    }
    votes
}

/// The lamps that a pixel may be of by its colour, and how much it is like a lit one, 0 to 1.
fn vote_of(pixel: &[u8]) -> (&'static [Lamp], f64) {
    let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(f64::from);
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let range = most - least;
    if range == 0.0 {
        return (&[], 0.0);
    }
    let sixth = match most {
        _ if most == r => ((g - b) / range).rem_euclid(6.0),
        _ if most == g => (b - r) / range + 2.0,
        _ => (r - g) / range + 4.0,
    };
    (Lamp::of_hue(60.0 * sixth), range * most / (255.0 * 255.0))
}

/// How many frames it takes to change one's mind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LightSettings {
    /// Frames in a row of another lamp before it is believed. More of them: fewer flickers, later.
    pub confirm_frames: u32,
    /// Frames in a row without any lamp before nothing is known. More than a pulsed lamp is dark for.
    pub forget_frames: u32,
}

impl Default for LightSettings {
    fn default() -> Self {
        Self { confirm_frames: 3, forget_frames: 10 }
    }
}

/// What a light shows, from what was seen of it frame by frame.
///
/// Lamps follow each other as green, yellow, red. One that cannot follow, red after green, is not believed at once: what
/// the light shows is unknown first, and it takes as many frames again.
#[derive(Clone, Debug, Default)]
pub struct Light {
    settings: LightSettings,
    shown: Option<Lamp>,
    /// What was seen instead last, and for how many frames.
    instead: (Option<Lamp>, u32),
}

impl Light {
    /// A light of which nothing is known.
    pub fn new(settings: LightSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// What it shows, as far as is known.
    pub fn shown(&self) -> Option<Lamp> {
        self.shown
    }

    /// Takes what one more frame shows of it, and tells what it shows.
    pub fn see(&mut self, seen: Option<Lamp>) -> Option<Lamp> {
        self.instead.1 = if self.instead.0 == seen { self.instead.1 + 1 } else { 1 };
        self.instead.0 = seen;
        if seen == self.shown {
            self.instead.1 = 0;
        }
        let enough = if seen.is_some() { self.settings.confirm_frames } else { self.settings.forget_frames };
        if seen != self.shown && self.instead.1 >= enough {
            self.shown = seen.filter(|lamp| self.shown.is_none_or(|before| lamp.follows(before)));
            self.instead.1 = 0;
        }
        self.shown
    }
}
