//! Lanes and their boundaries.

use swerve_geom::{FrenetPoint, Point2};
use swerve_map::{Lane as MapLane, LaneId, LaneKind, Map, Mark, MarkColour, MarkKind, Side};

use crate::message::{
    BoundaryClassification, BoundaryPoint, Identifier, Lane, LaneBoundary, LaneClassification, LanePairing,
    Vector3d,
};
use crate::truth::{BOUNDARIES, LANES};

// Values of enumerations of OSI.
const DRIVING: i32 = 2;
const NONDRIVING: i32 = 3;
const INTERSECTION: i32 = 4;

/// Identity of a lane in messages.
pub(crate) fn identity(id: LaneId) -> Option<Identifier> {
    Identifier::new(LANES + u64::from(id.0))
}

/// Lanes of a map, and the boundaries of each: one for each mark along its left and its right border.
pub(crate) fn lanes(map: &Map) -> (Vec<Lane>, Vec<LaneBoundary>) {
    let mut boundaries = Vec::new();
    let lanes = map.lanes().iter().map(|lane| {
        let [left, right] = [Side::Left, Side::Right].map(|side| add_border(&mut boundaries, lane, side));
        let lane_type = match (lane.kind, map.is_in_junction(lane.id)) {
            (LaneKind::Driving, true) => INTERSECTION,
            (LaneKind::Driving, false) => DRIVING,
            _ => NONDRIVING,
        };
        let beside =
            |of: Option<swerve_map::Neighbour>| of.and_then(|of| identity(of.lane)).into_iter().collect();
        Lane {
            id: identity(lane.id),
            classification: Some(LaneClassification {
                r#type: Some(lane_type),
                centerline: lane.line.points().iter().map(|point| on_ground(*point)).collect(),
                centerline_is_driving_direction: Some(true),
                left_adjacent_lane_id: beside(lane.left),
                right_adjacent_lane_id: beside(lane.right),
                lane_pairing: pairings(map.predecessors(lane.id), &lane.successors),
                right_lane_boundary_id: right,
                left_lane_boundary_id: left,
                subtype: Some(subtype(lane.kind)),
            }),
        }
    });
    (lanes.collect(), boundaries)
}

fn on_ground(point: Point2) -> Vector3d {
    Vector3d::new([point.x_m, point.y_m, 0.0])
}

/// Pairs in which each lane before and after is named at least once.
fn pairings(before: &[LaneId], after: &[LaneId]) -> Vec<LanePairing> {
    let nth = |of: &[LaneId], k: usize| of.get(k).or(of.last()).and_then(|id| identity(*id));
    let pair = |k| LanePairing { antecessor_lane_id: nth(before, k), successor_lane_id: nth(after, k) };
    (0..before.len().max(after.len())).map(pair).collect()
}

fn subtype(kind: LaneKind) -> i32 {
    match kind {
        LaneKind::Driving => 2,
        LaneKind::Cycling => 3,
        LaneKind::Walking => 4,
        LaneKind::Parking => 5,
        LaneKind::Shoulder => 9,
    }
}

/// Adds the boundaries along one side of a lane; returns their identities, in the direction of the lane.
fn add_border(boundaries: &mut Vec<LaneBoundary>, lane: &MapLane, side: Side) -> Vec<Identifier> {
    let (end_m, bends_m) = (lane.line.length(), lane.bends_m());
    let inner =
        lane.marks.of(side).iter().map(|mark| mark.from_m).filter(|from_m| 0.0 < *from_m && *from_m < end_m);
    let mut cuts_m: Vec<f64> = core::iter::once(0.0).chain(inner).chain([end_m]).collect();
    cuts_m.dedup();
    let part = |part_m: &[f64]| {
        let [from_m, to_m] = [part_m[0], part_m[1]];
        let mark = lane.marks.at(side, from_m);
        let between = bends_m.iter().copied().filter(|s_m| from_m < *s_m && *s_m < to_m);
        let width = mark.filter(|mark| mark.kind != MarkKind::None).map(|mark| mark.width_m);
        let point = |s_m: f64| {
            let d_m = match side {
                Side::Left => lane.borders.left_m(s_m),
                Side::Right => -lane.borders.right_m(s_m),
            };
            let at = lane.line.to_map(FrenetPoint { s_m, d_m });
            BoundaryPoint { position: Some(on_ground(at)), width }
        };
        let id = Identifier { value: Some(BOUNDARIES + boundaries.len() as u64) };
        boundaries.push(LaneBoundary {
            id: Some(id),
            boundary_line: core::iter::once(from_m).chain(between).chain([to_m]).map(point).collect(),
            classification: Some(classification(mark)),
        });
        id
    };
    cuts_m.windows(2).map(part).collect()
}

fn classification(mark: Option<&Mark>) -> BoundaryClassification {
    let kind = match mark.map(|mark| mark.kind) {
        None => 0,
        Some(MarkKind::None) => 2,
        Some(MarkKind::Solid | MarkKind::SolidSolid | MarkKind::SolidBroken) => 3,
        Some(MarkKind::Broken | MarkKind::BrokenSolid | MarkKind::BrokenBroken) => 4,
        Some(MarkKind::Dots) => 5,
        Some(MarkKind::Edge) => 6,
        Some(MarkKind::Kerb) => 12,
        Some(MarkKind::Barrier) => 14,
    };
    let color = match mark.map(|mark| (mark.kind, mark.colour)) {
        None => 0,
        Some((MarkKind::None | MarkKind::Edge | MarkKind::Kerb | MarkKind::Barrier, _)) => 2,
        Some((_, MarkColour::White)) => 3,
        Some((_, MarkColour::Yellow)) => 4,
        Some((_, MarkColour::Red)) => 5,
        Some((_, MarkColour::Blue)) => 6,
    };
    BoundaryClassification { r#type: Some(kind), color: Some(color) }
}
