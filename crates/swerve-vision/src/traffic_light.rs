//! Traffic lights: classification of the lit lamp in a crop by colour and position, and filtering over time.
//!
//! Pixels vote by hue, without training, weighted by saturation times squared brightness and by the distance to the
//! lamp's position in an upright head of three.

mod crop;
mod find;
#[cfg(test)]
mod tests;

use swerve_geom::math;

use crate::Rgb;

pub use crop::lit_head;
pub use find::{Head, LightFinder, Looker};

/// Lamp of a traffic light.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Lamp {
    /// Lowest lamp.
    Green,
    /// Middle lamp.
    Yellow,
    /// Highest lamp.
    Red,
}

impl Lamp {
    /// All lamps, from the lowest.
    pub const ALL: [Self; 3] = [Self::Green, Self::Yellow, Self::Red];

    /// Name of the lamp.
    pub fn name(self) -> &'static str {
        ["green", "yellow", "red"][self as usize]
    }

    /// Vertical position in an upright head, as a fraction of the height from the top.
    fn place(self) -> f64 {
        [0.8, 0.5, 0.2][self as usize]
    }

    /// Lamps that may have a hue, degrees. The ranges are wider than the lamps' own, for cameras with a wrong white
    /// balance. Overexposed red, as at night, appears orange.
    fn of_hue(degrees: f64) -> &'static [Self] {
        match degrees {
            _ if !(16.0..=330.0).contains(&degrees) => &[Self::Red],
            _ if (16.0..24.0).contains(&degrees) => &[Self::Red, Self::Yellow],
            _ if (24.0..70.0).contains(&degrees) => &[Self::Yellow],
            _ if (80.0..200.0).contains(&degrees) => &[Self::Green],
            _ => &[],
        }
    }

    /// Returns true if this lamp follows `before`: green, yellow, red, green.
    fn follows(self, before: Self) -> bool {
        matches!(
            (before, self),
            (Self::Green, Self::Yellow) | (Self::Yellow, Self::Red) | (Self::Red, Self::Green)
        )
    }
}

/// Standard deviation of a lamp's position, as a fraction of the height.
const SPREAD: f64 = 0.15;
/// Column range that is evaluated, as fractions of the width; the margins show the background.
const COLUMNS: [f64; 2] = [0.2, 0.8];
/// Smallest mean vote of a lit lamp over the evaluated pixels; of 1,469 photographs that are classified correctly
/// without this threshold, one is below it.
const LEAST: f64 = 2e-4;

/// Lit lamp in a crop around the head of a light, and its share of all votes, 0 to 1; `None` if no pixel is bright and
/// coloured, as in a black or white crop.
pub fn lit(crop: Rgb<'_>) -> Option<(Lamp, f64)> {
    lit_within(crop, 1.0)
}

/// Lit lamp in a crop that is `around` times as wide and high as the head at its centre.
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

/// Votes of pixels for each lamp.
fn votes_of(pixels: &[u8]) -> [f64; 3] {
    let mut votes = [0.0; 3];
    for (lamps, vote) in pixels.chunks_exact(3).map(vote_of) {
        lamps.iter().for_each(|lamp| votes[*lamp as usize] += vote);
    }
    votes
}

/// Lamps that match a pixel's hue, and the pixel's vote, 0 to 1.
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

/// Largest of a pixel's colour values.
fn brightness(rgb: &[u8]) -> u32 {
    rgb.iter().copied().map(u32::from).max().unwrap_or(0)
}

/// Frames needed to change the reported lamp.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LightSettings {
    /// Consecutive frames with another lamp before it is reported. Higher values suppress more flicker but react later.
    pub confirm_frames: u32,
    /// Consecutive frames without a lamp before the state is unknown. Must exceed the dark phase of a pulsed lamp.
    pub forget_frames: u32,
}

impl Default for LightSettings {
    fn default() -> Self {
        Self { confirm_frames: 3, forget_frames: 10 }
    }
}

/// State of a light, filtered over frames.
///
/// Lamps follow each other as green, yellow, red. A lamp that cannot follow, such as red after green, sets the state to
/// unknown first and must be confirmed again.
#[derive(Clone, Debug, Default)]
pub struct Light {
    settings: LightSettings,
    shown: Option<Lamp>,
    /// Latest observation that differs from the state, and its number of consecutive frames.
    instead: (Option<Lamp>, u32),
}

impl Light {
    /// Light in an unknown state.
    pub fn new(settings: LightSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// Current state; `None` if unknown.
    pub fn shown(&self) -> Option<Lamp> {
        self.shown
    }

    /// Updates the state with the observation of one frame and returns it.
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
