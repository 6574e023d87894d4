//! Styles of shapes and texts.

use crate::color::{self, Color, Look};

/// Fill and outline of a shape.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Style {
    pub(crate) fill: Option<Color>,
    pub(crate) fill_opacity: f64,
    pub(crate) stroke: Option<Color>,
    pub(crate) width: f64,
    pub(crate) stroke_opacity: f64,
    /// Lengths of dash, gap, dash, gap; all zero for a solid line.
    pub(crate) dash: [f64; 4],
    /// Radius of the corners of a rectangle.
    pub(crate) corner: f64,
}

impl Look {
    /// A line of this colour and these dashes.
    pub const fn line(self, width: f64) -> Style {
        Style::line(self.color, width).dashes(self.dash)
    }
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

    /// A filled area.
    pub const fn fill(color: Color) -> Self {
        Self { fill: Some(color), ..Self::NONE }
    }

    /// A line, or the outline of an area.
    pub const fn line(color: Color, width: f64) -> Self {
        Self { stroke: Some(color), width, ..Self::NONE }
    }

    /// This style with an outline.
    #[must_use]
    pub const fn outlined(self, color: Color, width: f64) -> Self {
        Self { stroke: Some(color), width, ..self }
    }

    /// This style with an area of this opacity, 0 to 1.
    #[must_use]
    pub const fn filled_by(self, opacity: f64) -> Self {
        Self { fill_opacity: opacity, ..self }
    }

    /// This style with a line of this opacity, 0 to 1.
    #[must_use]
    pub const fn lined_by(self, opacity: f64) -> Self {
        Self { stroke_opacity: opacity, ..self }
    }

    /// This style with dashes and gaps of these lengths.
    #[must_use]
    pub const fn dashed(self, dash: f64, gap: f64) -> Self {
        self.dashes([dash, gap, dash, gap])
    }

    /// This style with dash, gap, dash, gap of these lengths; solid if all are zero.
    #[must_use]
    pub const fn dashes(self, dash: [f64; 4]) -> Self {
        Self { dash, ..self }
    }

    /// This style with rounded corners.
    #[must_use]
    pub const fn rounded(self, radius: f64) -> Self {
        Self { corner: radius, ..self }
    }

    /// Colour of the line.
    pub const fn color(&self) -> Option<Color> {
        self.stroke
    }

    pub(crate) fn is_dashed(&self) -> bool {
        self.dash.iter().any(|length| *length > 0.0)
    }
}

/// Horizontal alignment of a text at its position.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Anchor {
    /// The text starts there.
    Start,
    /// The text is centred there.
    Middle,
    /// The text ends there.
    End,
}

impl Anchor {
    /// Share of a text's width before its position.
    pub(crate) fn share(self) -> f64 {
        match self {
            Self::Start => 0.0,
            Self::Middle => 0.5,
            Self::End => 1.0,
        }
    }
}

/// Style of a text.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Text {
    /// Font size, pixels.
    pub size: f64,
    /// Colour.
    pub color: Color,
    /// Alignment.
    pub anchor: Anchor,
    /// True for bold letters.
    pub bold: bool,
    /// True for a light outline that separates the text from its background.
    pub rim: bool,
}

impl Text {
    /// Regular, dark, left-aligned.
    pub const PLAIN: Self =
        Self { size: 12.0, color: color::INK, anchor: Anchor::Start, bold: false, rim: false };
    /// Title of a picture.
    pub const TITLE: Self = Self { size: 16.0, bold: true, ..Self::PLAIN };
    /// Secondary text, in grey.
    pub const SOFT: Self = Self { color: color::SOFT, ..Self::PLAIN };
    /// Tick labels of an axis.
    pub const TICK: Self = Self { size: 11.0, anchor: Anchor::Middle, ..Self::SOFT };
}

impl Default for Text {
    fn default() -> Self {
        Self::PLAIN
    }
}

/// Outline of texts: width and opacity.
pub(crate) const RIM: Style = Style::line(color::PAPER, 3.0).lined_by(0.85);
