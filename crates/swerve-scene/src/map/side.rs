//! Sides of lanes, and what is beside them.

use swerve_map::{Lane, LaneKind, Map, Mark, Neighbour, Side};

/// True for lanes with asphalt.
pub(super) fn is_road(kind: LaneKind) -> bool {
    kind != LaneKind::Walking
}

/// Neighbour of a lane on a side.
pub(super) fn neighbour(lane: &Lane, side: Side) -> Option<Neighbour> {
    match side {
        Side::Left => lane.left,
        Side::Right => lane.right,
    }
}

/// Lanes on a side of a lane, from it outwards; true for those that run in its direction.
pub(super) fn outwards<'m>(map: &'m Map, lane: &Lane, side: Side) -> impl Iterator<Item = (&'m Lane, bool)> {
    let (mut beside, mut is_along) = (neighbour(lane, side), true);
    let lanes = core::iter::from_fn(move || {
        let Neighbour { lane: id, opposite } = beside?;
        let next = map.lane(id)?;
        is_along ^= opposite;
        let is_left = (side == Side::Left) == is_along;
        beside = neighbour(next, if is_left { Side::Left } else { Side::Right });
        Some((next, is_along))
    });
    // Neighbours that lead back to a lane have no end.
    lanes.take(map.lanes().len())
}

/// Marks along a border with their ends along the lane, metres.
pub(super) fn spans(lane: &Lane, side: Side) -> impl Iterator<Item = (&Mark, [f64; 2])> {
    let (marks, length_m) = (lane.marks.of(side), lane.line.length());
    let all = marks.iter().enumerate().map(move |(k, mark)| {
        let to_m = marks.get(k + 1).map_or(length_m, |next| next.from_m.min(length_m));
        (mark, [mark.from_m.max(0.0), to_m])
    });
    all.filter(|(_, [from_m, to_m])| from_m < to_m)
}

/// Sign of offsets to a side.
pub(super) fn sign(side: Side) -> f64 {
    match side {
        Side::Left => 1.0,
        Side::Right => -1.0,
    }
}
