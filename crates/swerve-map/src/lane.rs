//! Lanes.

use serde::{Deserialize, Serialize};
use swerve_geom::{FrenetPoint, Point2, Polyline};

use crate::{Borders, LaneMarks, Mark, Side};

/// Identity of a lane in its map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct LaneId(pub u32);

/// Intended use of a lane.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneKind {
    /// Motor vehicles.
    #[default]
    Driving,
    /// Paved ground beside a lane, which may be used to give way.
    Shoulder,
    /// Bicycles.
    Cycling,
    /// Pedestrians.
    Walking,
    /// Parked vehicles.
    Parking,
}

impl LaneKind {
    /// Returns true if a car may drive on it: driving lanes and shoulders.
    pub fn is_drivable(self) -> bool {
        matches!(self, Self::Driving | Self::Shoulder)
    }
}

/// A lane that shares a border with another lane along its whole length.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Neighbour {
    /// The adjacent lane.
    pub lane: LaneId,
    /// True if it runs in the opposite direction.
    #[serde(default)]
    pub opposite: bool,
}

/// A strip of ground with a direction.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Lane {
    /// Identity in the map.
    pub id: LaneId,
    /// Intended use.
    pub kind: LaneKind,
    /// Centre line, in the direction of travel.
    pub line: Polyline,
    /// Borders of the lane beside the centre line.
    pub borders: Borders,
    /// Marks along the borders.
    #[serde(default, skip_serializing_if = "LaneMarks::is_unknown")]
    pub marks: LaneMarks,
    /// Speed limit, m/s; `None` if unknown.
    #[serde(default)]
    pub speed_limit_mps: Option<f64>,
    /// The lane beyond the left border.
    #[serde(default)]
    pub left: Option<Neighbour>,
    /// The lane beyond the right border.
    #[serde(default)]
    pub right: Option<Neighbour>,
    /// Lanes that continue from the end of this one.
    #[serde(default)]
    pub successors: Vec<LaneId>,
}

impl Lane {
    /// Creates a driving lane without marks, neighbours, successors or speed limit.
    pub const fn new(id: LaneId, line: Polyline, borders: Borders) -> Self {
        Self {
            id,
            kind: LaneKind::Driving,
            line,
            borders,
            marks: LaneMarks::unknown(),
            speed_limit_mps: None,
            left: None,
            right: None,
            successors: Vec::new(),
        }
    }

    /// Position of `point` along the lane if it is between its ends and borders, or on them.
    pub fn place_of(&self, point: Point2) -> Option<FrenetPoint> {
        let place = self.line.project(point);
        let along = 0.0 <= place.s_m && place.s_m <= self.line.length();
        (along && self.borders.contains(place)).then_some(place)
    }

    /// Distance between the borders at arc length `s_m`, metres.
    pub fn width_m(&self, s_m: f64) -> f64 {
        self.borders.left_m(s_m) + self.borders.right_m(s_m)
    }
    /// Returns true if traffic of the lane may cross its border on a side at arc length `s_m`: unknown marks may be
    /// crossed.
    pub fn may_cross(&self, side: Side, s_m: f64) -> bool {
        self.marks.at(side, s_m).is_none_or(Mark::may_be_crossed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MarkKind;

    fn lane() -> Lane {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(50.0, 0.0)]).unwrap();
        Lane::new(LaneId(7), line, Borders::constant(1.5, 2.0))
    }

    #[test]
    fn solid_line_stops_lane_changes_and_an_unknown_one_does_not() {
        let left = vec![Mark::new(0.0, MarkKind::Broken), Mark::new(30.0, MarkKind::SolidBroken)];
        let lane = Lane { marks: LaneMarks::new(left, Vec::new()).unwrap(), ..lane() };
        assert!(lane.may_cross(Side::Left, 29.0) && !lane.may_cross(Side::Left, 30.0));
        assert!(lane.may_cross(Side::Right, 30.0));
    }

    #[test]
    fn text_of_a_lane_without_marks_is_that_of_older_versions() {
        let text = serde_json::to_value(lane()).unwrap();
        assert_eq!(text.get("marks"), None);
        assert_eq!(serde_json::from_value::<Lane>(text).unwrap(), lane());
        let right = vec![Mark::new(0.0, MarkKind::Kerb)];
        let marked = Lane { marks: LaneMarks::new(Vec::new(), right).unwrap(), ..lane() };
        let text = serde_json::to_value(&marked).unwrap();
        assert_eq!(text["marks"]["right"][0]["kind"], "kerb");
        assert_eq!(serde_json::from_value::<Lane>(text).unwrap(), marked);
    }
}
