//! Router: the cheapest way over lanes from a place to another.
//!
//! A* over driving lanes: the cost is the length of the way, with [`CHANGE_M`] for each change to a lane beside it of
//! the same direction, nowhere over a line that must not be crossed; the estimate is the distance to the destination. Of equal costs, the lane with the smaller
//! identity is taken first, so that the way is the same on every machine. Lanes too tight for a car are taken only where
//! nothing else leads to the destination.
//!
//! A [`Navigator`] keeps the route of a drive, and finds another one where it is closed or the ego has left it.

use core::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BinaryHeap};

use serde::{Deserialize, Serialize};
use swerve_geom::{Point2, angle_between};

use crate::{Lane, LaneId, LaneKind, Map, Side};

/// Cost of a lane change, metres of way.
pub const CHANGE_M: f64 = 20.0;

/// Cost of a lane with a radius that is too small for a car, such as one for turning around on the spot, metres of way.
const TIGHT_M: f64 = 2_000.0;
/// Smallest radius of a lane for a car, metres.
const RADIUS_MIN_M: f64 = 4.5;

/// A place on a lane of a map.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Stop {
    /// The lane.
    pub lane: LaneId,
    /// Arc length along its centre line in the direction of travel, metres.
    pub s_m: f64,
}

/// Step of a way to a lane.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// The way begins on it.
    Begin,
    /// It continues the lane before.
    Follow,
    /// It is to the left of the lane before.
    ChangeLeft,
    /// It is to the right of the lane before.
    ChangeRight,
}

impl Step {
    /// Returns true for a lane change.
    pub fn is_change(self) -> bool {
        matches!(self, Self::ChangeLeft | Self::ChangeRight)
    }

    /// Name in output.
    pub fn name(self) -> &'static str {
        match self {
            Self::Begin => "begin",
            Self::Follow => "follow",
            Self::ChangeLeft => "change left",
            Self::ChangeRight => "change right",
        }
    }
}

/// A way over lanes.
#[derive(Clone, PartialEq, Debug)]
pub struct Way {
    /// Lanes in order, and the way to each.
    pub lanes: Vec<(Step, LaneId)>,
    /// Length from start to destination without lane changes, metres.
    pub length_m: f64,
    /// Place of the start along the first lane, and of the destination along the last one, metres.
    pub ends_m: [f64; 2],
    /// Places between them that it passes: index of the lane, and place along it, metres.
    pub via: Vec<(usize, f64)>,
}

impl Way {
    /// Centre line of the `k`-th lane of the way; the first begins at the start, the last ends at the destination.
    pub fn line(&self, map: &Map, k: usize) -> Vec<Point2> {
        let Some(lane) = self.lanes.get(k).and_then(|(_, lane)| map.lane(*lane)) else { return Vec::new() };
        let from_m = if k == 0 { self.ends_m[0] } else { 0.0 };
        let to_m = if k + 1 == self.lanes.len() { self.ends_m[1] } else { lane.line.length() };
        let points = lane.line.points();
        let mut s_m = 0.0;
        let mut line = vec![lane.line.at(from_m).pose.point()];
        for two in points.windows(2) {
            s_m += two[0].distance(two[1]);
            if from_m < s_m && s_m < to_m {
                line.push(two[1]);
            }
        }
        line.push(lane.line.at(to_m).pose.point());
        line
    }

    /// Number of lane changes.
    pub fn changes(&self) -> usize {
        self.lanes.iter().filter(|(step, _)| step.is_change()).count()
    }
}

/// A lane, and true if it is entered beside the start rather than at its begin.
type Node = (LaneId, bool);

/// An open node; the smallest is the next.
struct Open {
    estimate_m: f64,
    node: Node,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        self.estimate_m.total_cmp(&other.estimate_m).then(self.node.cmp(&other.node))
    }
}

/// Best way to a node so far.
#[derive(Clone, Copy)]
struct Reached {
    /// Cost up to the place where the lane is entered, metres.
    cost_m: f64,
    /// That place along the lane, metres.
    entry_m: f64,
    from: Option<Node>,
    step: Step,
    closed: bool,
}

/// State of a search.
struct Search<'m> {
    map: &'m Map,
    goal: Point2,
    closed: &'m [Stop],
    reached: BTreeMap<Node, Reached>,
    open: BinaryHeap<Reverse<Open>>,
}

/// Finds the cheapest way over all of these places in order.
///
/// # Errors
/// Index of the first place that no way reaches.
pub fn find_over(map: &Map, stops: &[Stop], closed: &[Stop]) -> Result<Way, usize> {
    let Some(&start) = stops.first() else { return Err(0) };
    let lanes = vec![(Step::Begin, start.lane)];
    let mut whole = Way { lanes, length_m: 0.0, ends_m: [start.s_m; 2], via: Vec::new() };
    for (k, two) in stops.windows(2).enumerate() {
        let leg = find(map, two[0], two[1], closed).ok_or(k + 1)?;
        if k > 0 {
            whole.via.push((whole.lanes.len() - 1, two[0].s_m));
        }
        whole.lanes.extend(&leg.lanes[1..]);
        whole.length_m += leg.length_m;
        whole.ends_m[1] = leg.ends_m[1];
    }
    Ok(whole)
}

/// Finds the cheapest way that passes none of the `closed` places; `None` if there is none.
pub fn find(map: &Map, from: Stop, to: Stop, closed: &[Stop]) -> Option<Way> {
    let goal = map.lane(to.lane)?.line.at(to.s_m).pose.point();
    let mut search = Search { map, goal, closed, reached: BTreeMap::new(), open: BinaryHeap::new() };
    search.offer((from.lane, true), 0.0, from.s_m, (None, Step::Begin));
    let mut best: Option<(f64, Node)> = None;
    while let Some(Reverse(Open { estimate_m, node })) = search.open.pop() {
        if best.is_some_and(|(cost_m, _)| cost_m <= estimate_m) {
            break;
        }
        let Some(at) = search.reached.get_mut(&node).filter(|at| !at.closed) else { continue };
        at.closed = true;
        let at = *at;
        if node.0 == to.lane && at.entry_m <= to.s_m && !search.is_closed(to.lane, [at.entry_m, to.s_m]) {
            let cost_m = at.cost_m + to.s_m - at.entry_m;
            if best.is_none_or(|(best_m, _)| cost_m < best_m) {
                best = Some((cost_m, node));
            }
        }
        search.expand(node, at);
    }
    let (cost_m, last) = best?;
    let mut lanes = Vec::new();
    let mut node = Some(last);
    while let Some(at) = node.and_then(|node| Some((node, search.reached.get(&node)?))) {
        lanes.push((at.1.step, at.0.0));
        node = at.1.from;
    }
    lanes.reverse();
    let mut way = Way { lanes, length_m: cost_m, ends_m: [from.s_m, to.s_m], via: Vec::new() };
    let tight = way.lanes.iter().filter(|(step, _)| *step == Step::Follow);
    let tight = tight.filter(|(_, lane)| map.lane(*lane).is_some_and(is_tight)).count();
    way.length_m -= CHANGE_M * way.changes() as f64 + TIGHT_M * tight as f64;
    Some(way)
}

/// Returns true if a lane turns with a smaller radius than a car can.
fn is_tight(lane: &Lane) -> bool {
    let [begin, end] = [0.0, lane.line.length()].map(|s_m| lane.line.at(s_m).pose.heading_rad);
    angle_between(begin, end).abs() > lane.line.length() / RADIUS_MIN_M
}

impl Search<'_> {
    /// Returns true if a place of the lane between these arc lengths is closed.
    fn is_closed(&self, lane: LaneId, [from_m, to_m]: [f64; 2]) -> bool {
        self.closed.iter().any(|place| place.lane == lane && (from_m..=to_m).contains(&place.s_m))
    }

    fn expand(&mut self, node: Node, at: Reached) {
        let Some(lane) = self.map.lane(node.0) else { return };
        let length_m = lane.line.length();
        let through = if self.is_closed(node.0, [at.entry_m, length_m]) { &[][..] } else { &lane.successors };
        for &next in through {
            self.offer((next, false), at.cost_m + length_m - at.entry_m, 0.0, (Some(node), Step::Follow));
        }
        for (beside, step, side) in
            [(lane.left, Step::ChangeLeft, Side::Left), (lane.right, Step::ChangeRight, Side::Right)]
        {
            let Some(other) = beside.filter(|beside| !beside.opposite) else { continue };
            if !lane.marks.may_cross_after(side, at.entry_m) {
                continue;
            }
            let other_m = self.map.lane(other.lane).map_or(0.0, |other| other.line.length());
            let entry_m = at.entry_m * (other_m / length_m);
            self.offer((other.lane, node.1), at.cost_m + CHANGE_M, entry_m, (Some(node), step));
        }
    }

    fn offer(&mut self, node: Node, cost_m: f64, entry_m: f64, (from, step): (Option<Node>, Step)) {
        let Some(lane) = self.map.lane(node.0).filter(|lane| lane.kind == LaneKind::Driving) else { return };
        let cost_m = if step == Step::Follow && is_tight(lane) { cost_m + TIGHT_M } else { cost_m };
        if self.reached.get(&node).is_some_and(|at| at.closed || at.cost_m <= cost_m) {
            return;
        }
        let left_m = lane.line.at(entry_m).pose.point().distance(self.goal);
        self.reached.insert(node, Reached { cost_m, entry_m, from, step, closed: false });
        self.open.push(Reverse(Open { estimate_m: cost_m + left_m, node }));
    }
}

mod navigator;

pub use navigator::Navigator;

#[cfg(test)]
mod tests;
