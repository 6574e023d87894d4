//! Marks at the borders of lanes: lines of paint, kerbs, barriers.

use serde::{Deserialize, Serialize};

/// Width of a line whose width is unknown, metres: that of a narrow line on German roads (RMS-1).
pub const MARK_WIDTH_M: f64 = 0.12;

/// Side of a lane, seen in its direction.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// To the left.
    Left,
    /// To the right.
    Right,
}

/// Paint or structure along the border of a lane. Of two lines, the one nearer to the lane is named first.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MarkKind {
    /// Nothing.
    None,
    /// One solid line.
    Solid,
    /// One broken line.
    Broken,
    /// Two solid lines.
    SolidSolid,
    /// A solid line and a broken one beyond it.
    SolidBroken,
    /// A broken line and a solid one beyond it.
    BrokenSolid,
    /// Two broken lines.
    BrokenBroken,
    /// A row of raised dots (Botts' dots).
    Dots,
    /// A kerb.
    Kerb,
    /// The unpainted end of the paved ground.
    Edge,
    /// A guard rail, fence or wall.
    Barrier,
}

impl MarkKind {
    /// The same mark for the lane on its other side.
    #[must_use]
    pub const fn mirrored(self) -> Self {
        match self {
            Self::SolidBroken => Self::BrokenSolid,
            Self::BrokenSolid => Self::SolidBroken,
            other => other,
        }
    }

    /// Returns true if traffic of the lane may cross it: the line nearer to the lane is not solid, and nothing is built.
    pub const fn may_be_crossed(self) -> bool {
        matches!(self, Self::None | Self::Broken | Self::BrokenSolid | Self::BrokenBroken | Self::Dots)
    }
}

/// Colour of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MarkColour {
    /// White.
    #[default]
    White,
    /// Yellow or orange.
    Yellow,
    /// Blue.
    Blue,
    /// Red.
    Red,
}

impl MarkColour {
    fn is_white(&self) -> bool {
        *self == Self::White
    }
}

/// A mark along the border of a lane, up to the next one.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    /// Begin along the lane, metres.
    #[serde(default)]
    pub from_m: f64,
    /// Kind.
    pub kind: MarkKind,
    /// Colour of its lines.
    #[serde(default, skip_serializing_if = "MarkColour::is_white")]
    pub colour: MarkColour,
    /// Width of one line, or of the kerb, metres.
    #[serde(default = "usual_width_m")]
    pub width_m: f64,
    /// Permission of the map to cross it from the lane; `None` if its kind decides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub permission: Option<bool>,
}

fn usual_width_m() -> f64 {
    MARK_WIDTH_M
}

impl Mark {
    /// Creates a white mark of usual width.
    pub const fn new(from_m: f64, kind: MarkKind) -> Self {
        Self { from_m, kind, colour: MarkColour::White, width_m: MARK_WIDTH_M, permission: None }
    }

    /// Returns true if traffic of the lane may cross it.
    pub fn may_be_crossed(&self) -> bool {
        self.permission.unwrap_or(self.kind.may_be_crossed())
    }

    fn is_valid(&self) -> bool {
        self.from_m.is_finite() && self.width_m.is_finite() && self.width_m >= 0.0
    }
}

/// Error of marks.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum MarkError {
    /// A number is infinite or NaN, or a width is negative.
    #[error("mark {0} of the lane has a begin or width that is not a length")]
    Length(usize),
    /// A mark does not begin beyond its predecessor.
    #[error("mark {0} of the lane does not begin beyond the one before it")]
    Order(usize),
}

/// Marks at both borders of a lane; empty where they are unknown.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(try_from = "Text")]
pub struct LaneMarks {
    #[serde(skip_serializing_if = "Vec::is_empty")]
    left: Vec<Mark>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    right: Vec<Mark>,
}

/// Text form of marks.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    #[serde(default)]
    left: Vec<Mark>,
    #[serde(default)]
    right: Vec<Mark>,
}

impl TryFrom<Text> for LaneMarks {
    type Error = MarkError;
    fn try_from(Text { left, right }: Text) -> Result<Self, MarkError> {
        Self::new(left, right)
    }
}

impl LaneMarks {
    /// Creates marks that are known nowhere.
    pub const fn unknown() -> Self {
        Self { left: Vec::new(), right: Vec::new() }
    }

    /// Creates marks of the left and right border, each in order.
    ///
    /// # Errors
    /// If a begin or width is not a length, or a mark does not begin beyond the one before it.
    pub fn new(left: Vec<Mark>, right: Vec<Mark>) -> Result<Self, MarkError> {
        for marks in [&left, &right] {
            if let Some(bad) = marks.iter().position(|mark| !mark.is_valid()) {
                return Err(MarkError::Length(bad));
            }
            if let Some(before) = marks.windows(2).position(|two| two[1].from_m <= two[0].from_m) {
                return Err(MarkError::Order(before + 1));
            }
        }
        Ok(Self { left, right })
    }

    /// Marks of one border, in order.
    pub fn of(&self, side: Side) -> &[Mark] {
        match side {
            Side::Left => &self.left,
            Side::Right => &self.right,
        }
    }

    /// Mark of a border at arc length `s_m` of the lane; `None` if unknown.
    pub fn at(&self, side: Side, s_m: f64) -> Option<&Mark> {
        let marks = self.of(side);
        marks[..marks.partition_point(|mark| mark.from_m <= s_m)].last()
    }

    /// Returns true if traffic of the lane may cross a border somewhere at or after arc length `s_m`.
    pub fn may_cross_after(&self, side: Side, s_m: f64) -> bool {
        let marks = self.of(side);
        let here = marks.partition_point(|mark| mark.from_m <= s_m);
        here == 0 || marks[here - 1..].iter().any(Mark::may_be_crossed)
    }

    /// Returns true if nothing is known.
    pub fn is_unknown(&self) -> bool {
        self.left.is_empty() && self.right.is_empty()
    }
}

#[cfg(test)]
mod tests;
