//! Lanes of a file before they are a map: their borders, and statements about their neighbours and successors.

use std::collections::{BTreeMap, BTreeSet};

use swerve_geom::{FrenetPoint, Point2};
use swerve_map::{Lane, LaneId, LaneKind, LaneMarks, Mark, Neighbour};

use crate::slope::Raised;
use crate::xml::Element;

/// Width of a line that a file calls wide, metres: that of a wide line on German roads (RMS-1).
pub(crate) const WIDE_MARK_M: f64 = 0.25;

/// Centre line of a lane.
pub(crate) enum Center {
    /// Through the middles of pairs of points: both borders have as many.
    Middles,
    /// The same with rounded corners.
    RoundedMiddles,
    /// Between the borders.
    Between,
    /// The line of the file.
    Given(Vec<Point2>),
}

/// A lane of a file.
pub(crate) struct Draft<'a> {
    pub(crate) element: Element<'a>,
    /// Identity in the file.
    pub(crate) name: String,
    pub(crate) kind: LaneKind,
    pub(crate) speed_limit_mps: Option<f64>,
    /// Borders in the direction of travel.
    pub(crate) left: Vec<Point2>,
    pub(crate) right: Vec<Point2>,
    /// Both borders with heights, if the file has those of all their points.
    pub(crate) raised: Option<[Raised; 2]>,
    pub(crate) center: Center,
    /// Marks of the left and right border, each along the whole lane.
    pub(crate) marks: [Option<Mark>; 2],
    /// Neighbours to the left and to the right.
    pub(crate) beside: [Option<Neighbour>; 2],
    pub(crate) successors: BTreeSet<LaneId>,
}

/// Marks of the left and right border, each along the whole lane.
pub(crate) fn marks_along(marks: [Option<Mark>; 2]) -> LaneMarks {
    let [left, right] = marks.map(Vec::from_iter);
    // Readers make marks whose widths are lengths.
    LaneMarks::new(left, right).unwrap_or_default()
}

/// Lanes of a file by the identity that they have in the map.
pub(crate) type Drafts<'a> = BTreeMap<LaneId, Draft<'a>>;

/// A lane and one that continues it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Joint {
    pub(crate) from: LaneId,
    pub(crate) to: LaneId,
}

/// Outline of a lane: its left border forwards, its right border backwards.
pub(crate) fn outline(lane: &Lane) -> Vec<Point2> {
    let mut stations_m = vec![0.0];
    for two in lane.line.points().windows(2) {
        stations_m.push(stations_m[stations_m.len() - 1] + two[0].distance(two[1]));
    }
    let at = |s_m: f64, d_m: f64| lane.line.to_map(FrenetPoint { s_m, d_m });
    let left = stations_m.iter().map(|s_m| at(*s_m, lane.borders.left_m(*s_m)));
    let right = stations_m.iter().rev().map(|s_m| at(*s_m, -lane.borders.right_m(*s_m)));
    left.chain(right).collect()
}

/// Joints of lanes by their successors; those with lanes that are missing are dropped.
pub(crate) fn joints(drafts: &mut Drafts<'_>) -> Vec<Joint> {
    let ids: BTreeSet<LaneId> = drafts.keys().copied().collect();
    let mut joints = Vec::new();
    for (id, draft) in drafts {
        draft.successors.retain(|next| ids.contains(next));
        joints.extend(draft.successors.iter().map(|next| Joint { from: *id, to: *next }));
    }
    joints
}
