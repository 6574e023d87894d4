//! How shapes and texts look.

use crate::color::{self, Color};

/// How a shape is filled and outlined.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Style {
    pub(crate) fill: Option<Color>,
    pub(crate) fill_opacity: f64,
    pub(crate) stroke: Option<Color>,
    pub(crate) width: f64,
    pub(crate) stroke_opacity: f64,
    /// Lengths of dash, gap, dash, gap; all zero for an unbroken line.
    pub(crate) dash: [f64; 4],
    /// Radius of the corners of a rectangle.
    pub(crate) corner: f64,
}

impl Style {
    const NONE: Self = Self {
        fill: None,
        fill_opacity: 1.0,
        stroke: None,
        width: 1.0,
        stroke_opacity: 1.0,
        dash: [0.0; 4],
        corner: 0.0,
    };

    /// An area.
    pub const fn fill(color: Color) -> Self {
        Self { fill: Some(color), ..Self::NONE }
    }

    /// A line, or the outline of an area.
    pub const fn line(color: Color, width: f64) -> Self {
        Self { stroke: Some(color), width, ..Self::NONE }
    }

    /// The same with an outline.
    #[must_use]
    pub const fn outlined(self, color: Color, width: f64) -> Self {
        Self { stroke: Some(color), width, ..self }
    }

    /// The same with an area that lets through what is below, 0 to 1.
    #[must_use]
    pub const fn filled_by(self, opacity: f64) -> Self {
        Self { fill_opacity: opacity, ..self }
    }

    /// The same with a line that lets through what is below, 0 to 1.
    #[must_use]
    pub const fn lined_by(self, opacity: f64) -> Self {
        Self { stroke_opacity: opacity, ..self }
    }

    /// The same with a line of dashes and gaps of these lengths.
    #[must_use]
    pub const fn dashed(self, dash: f64, gap: f64) -> Self {
        self.dashes([dash, gap, dash, gap])
    }

    /// The same with a line of dash, gap, dash, gap of these lengths; unbroken where all are zero.
    #[must_use]
    pub const fn dashes(self, dash: [f64; 4]) -> Self {
        Self { dash, ..self }
    }

    /// The same with round corners.
    #[must_use]
    pub const fn rounded(self, radius: f64) -> Self {
        Self { corner: radius, ..self }
    }

    /// The colour of its line.
    pub const fn color(&self) -> Option<Color> {
        self.stroke
    }

    pub(crate) fn is_dashed(&self) -> bool {
        self.dash.iter().any(|length| *length > 0.0)
    }
}

/// Which part of a text stands at its place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Anchor {
    /// Its beginning.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

impl Anchor {
    /// How much of a text's width is before its place.
    pub(crate) fn share(self) -> f64 {
        match self {
            Self::Start => 0.0,
            Self::Middle => 0.5,
            Self::End => 1.0,
        }
    }
}

/// How a text stands.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Text {
    /// Height, pixels.
    pub size: f64,
    /// Its colour.
    pub color: Color,
    /// What of it is at its place.
    pub anchor: Anchor,
    /// Whether in bold letters.
    pub bold: bool,
    /// Whether a light rim sets it off from what is below.
    pub rim: bool,
}

impl Text {
    /// Upright, dark, from its place on.
    pub const PLAIN: Self =
        Self { size: 12.0, color: color::INK, anchor: Anchor::Start, bold: false, rim: false };
    /// The heading of a picture.
    pub const TITLE: Self = Self { size: 16.0, bold: true, ..Self::PLAIN };
    /// What explains, in grey.
    pub const SOFT: Self = Self { color: color::SOFT, ..Self::PLAIN };
    /// The numbers along an axis.
    pub const TICK: Self = Self { size: 11.0, anchor: Anchor::Middle, ..Self::SOFT };
}

impl Default for Text {
    fn default() -> Self {
        Self::PLAIN
    }
}

/// Rims of texts: how wide, and how much of what is below they hide.
pub(crate) const RIM: Style = Style::line(color::PAPER, 3.0).lined_by(0.85);
