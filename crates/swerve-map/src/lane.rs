//! Lanes.

use serde::{Deserialize, Serialize};
use swerve_geom::{FrenetPoint, Point2, Polyline};

use crate::Borders;

/// Identity of a lane in its map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct LaneId(pub u32);

/// Use that a lane is made for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneKind {
    /// Motor vehicles drive here.
    #[default]
    Driving,
    /// Paved ground beside a lane: may be driven on to make way.
    Shoulder,
    /// Bicycles.
    Cycling,
    /// People on foot.
    Walking,
    /// Vehicles stand here.
    Parking,
}

impl LaneKind {
    /// Whether a car may use the ground: its own lane, its neighbours', the shoulder.
    pub fn is_drivable(self) -> bool {
        matches!(self, Self::Driving | Self::Shoulder)
    }
}

/// A lane that shares a border with another one from end to end.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Neighbour {
    /// The lane beside.
    pub lane: LaneId,
    /// Whether it runs the other way.
    #[serde(default)]
    pub opposite: bool,
}

/// A strip of ground with a direction.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Lane {
    /// Identity.
    pub id: LaneId,
    /// Use.
    pub kind: LaneKind,
    /// Centre line, in the direction of travel.
    pub line: Polyline,
    /// Its own borders beside the centre line.
    pub borders: Borders,
    /// Highest speed that is allowed, m/s; `None`: none is known.
    #[serde(default)]
    pub speed_limit_mps: Option<f64>,
    /// The lane beyond the left border.
    #[serde(default)]
    pub left: Option<Neighbour>,
    /// The lane beyond the right border.
    #[serde(default)]
    pub right: Option<Neighbour>,
    /// Lanes that go on where this one ends.
    #[serde(default)]
    pub successors: Vec<LaneId>,
}

impl Lane {
    /// A driving lane without neighbours, successors or speed limit.
    pub const fn new(id: LaneId, line: Polyline, borders: Borders) -> Self {
        Self {
            id,
            kind: LaneKind::Driving,
            line,
            borders,
            speed_limit_mps: None,
            left: None,
            right: None,
            successors: Vec::new(),
        }
    }

    /// The place of `point` along the lane if it is on it: between its ends and between its borders, or on them.
    pub fn place_of(&self, point: Point2) -> Option<FrenetPoint> {
        let place = self.line.project(point);
        let along = 0.0 <= place.s_m && place.s_m <= self.line.length();
        (along && self.borders.contains(place)).then_some(place)
    }

    /// Distance between its borders at arc length `s_m`, metres.
    pub fn width_m(&self, s_m: f64) -> f64 {
        self.borders.left_m(s_m) + self.borders.right_m(s_m)
    }
}
