//! The colour palette: distinguishable in greyscale and with colour-vision deficiency, as checked by the tests.

use core::fmt;

/// A colour: red, green, blue.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Color(pub [u8; 3]);

impl fmt::Display for Color {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02X}{g:02X}{b:02X}")
    }
}

impl Color {
    /// Creates a colour from a number such as `0x0072B2`.
    pub const fn hex(rgb: u32) -> Self {
        Self([(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8])
    }

    /// This colour mixed with a share of another one, 0 to 1.
    #[must_use]
    pub fn mixed(self, other: Self, share: f64) -> Self {
        let mix = |i: usize| {
            let (a, b) = (f64::from(self.0[i]), f64::from(other.0[i]));
            (a + (b - a) * share).round() as u8
        };
        Self([mix(0), mix(1), mix(2)])
    }
}

/// Background of the picture.
pub const PAPER: Color = Color::hex(0xFFFFFF);
/// Text.
pub const INK: Color = Color::hex(0x1F2328);
/// Secondary text, frames, ticks.
pub const SOFT: Color = Color::hex(0x5B636D);
/// Grid lines.
pub const GRID: Color = Color::hex(0xD9DDE2);
/// Background of a plot.
pub const PANEL: Color = Color::hex(0xFCFCFD);
/// Missing data.
pub const NOTHING: Color = Color::hex(0xEEEEEE);

/// The ego vehicle.
pub const EGO: Color = Color::hex(0x0072B2);
/// Pedestrians and cyclists.
pub const PERSON: Color = Color::hex(0xD55E00);
/// Vehicles and objects.
pub const VEHICLE: Color = Color::hex(0x6F7781);
/// A plan found.
pub const PLAN: Color = Color::hex(0x007D5A);
/// A fallback plan.
pub const FALLBACK: Color = Color::hex(0xB8578F);
/// Instant at which an actor was first visible.
pub const SIGHT: Color = Color::hex(0xB07A00);
/// Text colour for `SIGHT`.
pub const SIGHT_TEXT: Color = Color::hex(0x8A5E00);
/// Collisions, misses, limits.
pub const ALARM: Color = Color::hex(0xB00020);
/// Expected endings.
pub const GOOD: Color = Color::hex(0x00704F);
/// A safe stop.
pub const STOPPED: Color = Color::hex(0x6A4FA3);
/// Off the road.
pub const LEFT_ROAD: Color = Color::hex(0xA14A00);
/// Tracked object.
pub const TRACK: Color = Color::hex(0x7B3FA0);

/// Ground beside a road.
pub const GROUND: Color = Color::hex(0xF4F3EF);
/// A road.
pub const ROAD: Color = Color::hex(0xE6E8EB);
/// Slippery patch of a road.
pub const SLIPPERY: Color = Color::hex(0x9CC3E6);
/// Edge of a road.
pub const ROAD_EDGE: Color = Color::hex(0x7A828C);
/// Lines between lanes.
pub const LANE: Color = Color::hex(0xFFFFFF);

/// Appearance of one of several lines in a plot.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Look {
    /// Colour.
    pub color: Color,
    /// Lengths of dashes and gaps; all zero for a solid line.
    pub dash: [f64; 4],
}

/// Line styles of a plot, in order: four colours of different lightness, then the same dashed, dotted and dash-dotted.
pub const SERIES: [Look; 16] = {
    const DASHES: [[f64; 4]; 4] =
        [[0.0; 4], [7.0, 3.0, 7.0, 3.0], [1.5, 3.0, 1.5, 3.0], [9.0, 3.0, 1.5, 3.0]];
    const COLORS: [Color; 4] =
        [Color::hex(0x0072B2), Color::hex(0xC98A00), Color::hex(0x8B1A5C), Color::hex(0x1F2328)];
    let mut looks = [Look { color: COLORS[0], dash: DASHES[0] }; 16];
    let mut k = 0;
    while k < looks.len() {
        looks[k] = Look { color: COLORS[k % 4], dash: DASHES[k / 4] };
        k += 1;
    }
    looks
};

/// Style of the `k`-th line of a plot; beyond [`SERIES`] the styles repeat, which [`looks_repeat`] notes.
pub fn series(k: usize) -> Look {
    SERIES[k % SERIES.len()]
}

/// Note for a plot with more lines than styles.
pub fn looks_repeat(lines: usize) -> Option<String> {
    let looks = SERIES.len();
    (lines > looks)
        .then(|| format!("{lines} lines; their looks repeat after {looks}, in the order of the legend"))
}

/// Colour for a share from 0 (bad, pale orange) to 1 (good, dark blue); lightness alone gives the order.
pub fn graded(share: f64) -> Color {
    const STOPS: [Color; 4] =
        [Color::hex(0xFBD9B0), Color::hex(0xAEB8C6), Color::hex(0x5D8CB8), Color::hex(0x003F73)];
    let along = 3.0 * share.clamp(0.0, 1.0);
    let below = (along.floor() as usize).min(2);
    STOPS[below].mixed(STOPS[below + 1], along - below as f64)
}

/// Ink or paper, whichever has more contrast on a background colour.
pub fn ink_on(ground: Color) -> Color {
    if contrast(ground, INK) >= contrast(ground, PAPER) { INK } else { PAPER }
}

/// Contrast of two colours, 1 to 21 (WCAG 2).
pub fn contrast(a: Color, b: Color) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// Relative luminance, 0 to 1 (WCAG 2).
pub fn luminance(color: Color) -> f64 {
    let [r, g, b] = color.0.map(linear);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Linear light of an sRGB channel.
pub(crate) fn linear(channel: u8) -> f64 {
    let c = f64::from(channel) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { swerve_geom::math::pow((c + 0.055) / 1.055, 2.4) }
}
