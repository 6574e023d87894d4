//! Lanes that share borders, and lanes that continue each other.

use std::collections::BTreeMap;

use swerve_geom::Point2;
use swerve_map::{LaneId, Neighbour};

use super::lanelets::{Lanelet, lane_id};
use super::osm::Osm;
use crate::joints::CLOSED_M;
use crate::xml::Reader;

/// Most lanes at a border or at one end of a lane; the rest is left out and reported.
const LANES_MAX: usize = 64;

/// A lane at a border: its index, and the side on which the border is.
#[derive(Clone, Copy)]
struct User {
    lane: usize,
    side: usize,
    inverted: bool,
}

/// Lanes on the two sides of a way are neighbours. Where several lanes have a way on the same side of it, the first ones
/// of the same kind are.
pub(super) fn neighbours(xml: &mut Reader, osm: &Osm<'_>, lanes: &mut [Lanelet<'_>]) {
    // To the left and to the right of each way, in its direction.
    let mut users: BTreeMap<i64, [Vec<User>; 2]> = BTreeMap::new();
    for (lane, lanelet) in lanes.iter().enumerate().filter(|(_, lanelet)| !lanelet.backward) {
        for (side, border) in lanelet.sides.iter().enumerate() {
            // A lane is to the right of its left border.
            let of_way = if border.inverted { side } else { 1 - side };
            let beside = &mut users.entry(border.way).or_default()[of_way];
            beside.push(User { lane, side, inverted: border.inverted });
        }
    }
    for (way, [left, right]) in users {
        if left.len() > LANES_MAX || right.len() > LANES_MAX {
            if let Some(way) = osm.ways.get(&way) {
                xml.defect(way.element, || format!("expected a border of at most {LANES_MAX} lanes"));
            }
            continue;
        }
        let mut free = right;
        for same_kind in [true, false] {
            for a in &left {
                if lanes[a.lane].draft.beside[a.side].is_some() {
                    continue;
                }
                let is_fit = |b: &User| !same_kind || lanes[a.lane].draft.kind == lanes[b.lane].draft.kind;
                let Some(k) = free.iter().position(is_fit) else { continue };
                let b = free.remove(k);
                let opposite = a.inverted != b.inverted;
                for (one, other) in [(a, &b), (&b, a)] {
                    lanes[one.lane].draft.beside[one.side] =
                        Some(Neighbour { lane: lane_id(other.lane), opposite });
                }
            }
        }
    }
}

/// Lanes whose borders begin at the nodes at which those of another end continue it. Where the nodes are different and
/// at most [`CLOSED_M`] apart, a lane of the same kind and direction does if one of the two has no other.
pub(super) fn successors(xml: &mut Reader, lanes: &mut [Lanelet<'_>]) {
    let mut begins: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for (lane, lanelet) in lanes.iter().enumerate() {
        begins.entry(ends(lanelet, 0)).or_default().push(lane);
    }
    let mut has_before = vec![false; lanes.len()];
    for (lane, lanelet) in lanes.iter_mut().enumerate() {
        let next = begins.get(&ends(lanelet, 1)).map_or(&[][..], Vec::as_slice);
        if next.len() > LANES_MAX {
            xml.defect(lanelet.draft.element, || format!("expected at most {LANES_MAX} lanes at its end"));
        }
        let next: Vec<usize> = next.iter().copied().filter(|next| *next != lane).take(LANES_MAX).collect();
        next.iter().for_each(|next| has_before[*next] = true);
        lanelet.draft.successors = next.into_iter().map(lane_id).collect();
    }
    let cells = cells(lanes);
    let near: Vec<Vec<LaneId>> = (0..lanes.len())
        .map(|lane| {
            let is_open = lanes[lane].draft.successors.is_empty();
            let near = near(lanes, &cells, lane).filter(|next| is_open || !has_before[*next]);
            near.take(LANES_MAX).map(lane_id).collect()
        })
        .collect();
    for (lanelet, near) in lanes.iter_mut().zip(near) {
        lanelet.draft.successors.extend(near);
    }
}

/// Nodes at the begin (0) or end (1) of a lane.
fn ends(lanelet: &Lanelet<'_>, end: usize) -> [i64; 2] {
    [lanelet.sides[0].ends[end], lanelet.sides[1].ends[end]]
}

/// Lanes by the cell of the begin of their left border.
type Cells = BTreeMap<[i64; 2], Vec<usize>>;

fn cell(at: Point2) -> [i64; 2] {
    [at.x_m, at.y_m].map(|value| (value / CLOSED_M).floor() as i64)
}

fn cells(lanes: &[Lanelet<'_>]) -> Cells {
    let mut cells = Cells::new();
    for (lane, lanelet) in lanes.iter().enumerate() {
        if let Some(at) = lanelet.draft.left.first() {
            let beside = cells.entry(cell(*at)).or_default();
            if beside.len() < LANES_MAX {
                beside.push(lane);
            }
        }
    }
    cells
}

/// Lanes of the same kind and direction that begin near the end of a lane, other than its successors.
fn near<'l>(
    lanes: &'l [Lanelet<'_>],
    cells: &'l Cells,
    lane: usize,
) -> impl Iterator<Item = usize> + use<'l> {
    let draft = &lanes[lane].draft;
    let [column, row] = draft.left.last().map_or([0, 0], |at| cell(*at));
    let around = (-1..=1).flat_map(move |x| (-1..=1).map(move |y| [column + x, row + y]));
    let is_near = move |next: &usize| {
        let other = &lanes[*next].draft;
        let is_next = lanes[*next].relation != lanes[lane].relation && other.kind == draft.kind;
        let known = draft.successors.contains(&lane_id(*next));
        is_next && !known && meet(&draft.left, &other.left) && meet(&draft.right, &other.right)
    };
    around.filter_map(|cell| cells.get(&cell)).flatten().copied().filter(is_near)
}

/// True if a line begins near the end of another, in about its direction.
fn meet(line: &[Point2], next: &[Point2]) -> bool {
    let ([.., before, end], [begin, after, ..]) = (line, next) else { return false };
    end.distance(*begin) <= CLOSED_M && (*end - *before).dot(*after - *begin) > 0.0
}
