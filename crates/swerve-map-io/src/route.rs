//! Routes: the lanes from a place to another.
//!
//! A* over driving lanes: the cost is the length of the way, with [`CHANGE_M`] for each change to a lane beside it of
//! the same direction; the estimate is the distance to the destination. Of equal costs, the lane with the smaller
//! identity is taken first, so that the route is the same on every machine.

use core::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BinaryHeap};

use serde_json::{Value, json};
use swerve_geom::Point2;
use swerve_map::{LaneHint, LaneId, LaneIndex, LaneKind, Map};

use crate::import::{Imported, LaneSource};
use crate::lane_map::LaneMap;
use crate::opendrive::Network;

/// Cost of a lane change, metres of way.
pub const CHANGE_M: f64 = 20.0;

/// A place on a lane of a map.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Stop {
    /// The lane.
    pub lane: LaneId,
    /// Arc length along its centre line in the direction of travel, metres.
    pub s_m: f64,
}

/// Step of a route to a lane.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// The route begins on it.
    Begin,
    /// It continues the lane before.
    Follow,
    /// It is to the left of the lane before.
    ChangeLeft,
    /// It is to the right of the lane before.
    ChangeRight,
}

impl Step {
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

/// A route over lanes.
#[derive(Clone, PartialEq, Debug)]
pub struct Way {
    /// Lanes in order, and the way to each.
    pub lanes: Vec<(Step, LaneId)>,
    /// Length from start to destination without lane changes, metres.
    pub length_m: f64,
    /// Place of the start along the first lane, and of the destination along the last one, metres.
    pub ends_m: [f64; 2],
}

impl Way {
    /// Centre line of the `k`-th lane of the route; the first begins at the start, the last ends at the destination.
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
        self.lanes.iter().filter(|(step, _)| matches!(step, Step::ChangeLeft | Step::ChangeRight)).count()
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
    reached: BTreeMap<Node, Reached>,
    open: BinaryHeap<Reverse<Open>>,
}

/// Finds the cheapest route; `None` if there is none.
pub fn find(map: &Map, from: Stop, to: Stop) -> Option<Way> {
    let goal = map.lane(to.lane)?.line.at(to.s_m).pose.point();
    let mut search = Search { map, goal, reached: BTreeMap::new(), open: BinaryHeap::new() };
    search.offer((from.lane, true), 0.0, from.s_m, (None, Step::Begin));
    let mut best: Option<(f64, Node)> = None;
    while let Some(Reverse(Open { estimate_m, node })) = search.open.pop() {
        if best.is_some_and(|(cost_m, _)| cost_m <= estimate_m) {
            break;
        }
        let Some(at) = search.reached.get_mut(&node).filter(|at| !at.closed) else { continue };
        at.closed = true;
        let at = *at;
        if node.0 == to.lane && at.entry_m <= to.s_m {
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
    let mut way = Way { lanes, length_m: cost_m, ends_m: [from.s_m, to.s_m] };
    way.length_m -= CHANGE_M * way.changes() as f64;
    Some(way)
}

impl Search<'_> {
    fn expand(&mut self, node: Node, at: Reached) {
        let Some(lane) = self.map.lane(node.0) else { return };
        let length_m = lane.line.length();
        for &next in &lane.successors {
            self.offer((next, false), at.cost_m + length_m - at.entry_m, 0.0, (Some(node), Step::Follow));
        }
        for (beside, step) in [(lane.left, Step::ChangeLeft), (lane.right, Step::ChangeRight)] {
            let Some(other) = beside.filter(|beside| !beside.opposite) else { continue };
            let other_m = self.map.lane(other.lane).map_or(0.0, |other| other.line.length());
            let entry_m = at.entry_m * (other_m / length_m);
            self.offer((other.lane, node.1), at.cost_m + CHANGE_M, entry_m, (Some(node), step));
        }
    }

    fn offer(&mut self, node: Node, cost_m: f64, entry_m: f64, (from, step): (Option<Node>, Step)) {
        let Some(lane) = self.map.lane(node.0).filter(|lane| lane.kind == LaneKind::Driving) else { return };
        if self.reached.get(&node).is_some_and(|at| at.closed || at.cost_m <= cost_m) {
            return;
        }
        let left_m = lane.line.at(entry_m).pose.point().distance(self.goal);
        self.reached.insert(node, Reached { cost_m, entry_m, from, step, closed: false });
        self.open.push(Reverse(Open { estimate_m: cost_m + left_m, node }));
    }
}

/// Place of a text `x,y` in the frame of the map, metres: on the nearest driving lane. `None` for texts without comma.
fn stop_near(map: &Map, text: &str, form: &dyn Fn() -> String) -> Option<Result<Stop, String>> {
    let (x, y) = text.split_once(',')?;
    let [x, y] = [x, y].map(|part| part.trim().parse::<f64>().ok().filter(|value| value.is_finite()));
    let (Some(x), Some(y)) = (x, y) else { return Some(Err(form())) };
    let index = LaneIndex::of(map, |lane| lane.kind == LaneKind::Driving);
    let found = index.nearest_from(Point2::new(x, y), &mut LaneHint::default());
    Some(match found {
        Some(found) => Ok(on_lane(map, found.lane, found.place.s_m)),
        None => Err("the map has no driving lanes".to_owned()),
    })
}

/// Place in a text: `lane:s` with the identity of the lane in the file and s along it, or `x,y` in the frame of the map,
/// metres; the nearest driving lane.
///
/// # Errors
/// If the text has neither form, or names a place that is not on a driving lane.
pub fn stop_on(lanes: &LaneMap, text: &str) -> Result<Stop, String> {
    let form = || format!("expected lane:s or x,y, found {text:?}");
    if let Some(stop) = stop_near(&lanes.map, text, &form) {
        return stop;
    }
    let (name, s) = text.rsplit_once(':').ok_or_else(form)?;
    let s_m = s.parse::<f64>().map_err(|_| form())?;
    let lane = lanes.lane_named(name).and_then(|lane| lanes.map.lane(lane));
    let lane = lane.ok_or_else(|| format!("there is no lane {name:?}"))?;
    let length_m = lane.line.length();
    if lane.kind != LaneKind::Driving {
        return Err(format!("expected a driving lane, found one of another kind: {text}"));
    }
    if !(0.0..=length_m).contains(&s_m) {
        return Err(format!("expected a place from 0 to {length_m:.3} m on lane {name}, found {s}"));
    }
    Ok(Stop { lane: lane.id, s_m })
}

/// Place in a text: `road:lane:s` with s along the road, or `x,y` in the frame of the map, metres; the nearest driving
/// lane.
///
/// # Errors
/// If the text has neither form, or names a place that is not on a driving lane.
pub fn stop(network: &Network, imported: &Imported, text: &str) -> Result<Stop, String> {
    let form = || format!("expected road:lane:s or x,y, found {text:?}");
    if let Some(stop) = stop_near(&imported.map, text, &form) {
        return stop;
    }
    let mut parts = text.rsplitn(3, ':');
    let (Some(s), Some(lane), Some(road)) = (parts.next(), parts.next(), parts.next()) else {
        return Err(form());
    };
    let (Ok(s_m), Ok(lane)) = (s.parse::<f64>(), lane.parse::<i32>()) else { return Err(form()) };
    let section = network.road(road).map_or(0, |road| road.section_at(s_m));
    let sample = network.sample(road, section, lane, s_m).map_err(|error| error.to_string())?;
    let is = |source: &LaneSource| {
        network.roads[source.road].id == road && source.section == section && source.lane == lane
    };
    let found = imported.lanes.iter().position(is).map(|k| &imported.map.lanes()[k]);
    let found = found.filter(|lane| lane.kind == LaneKind::Driving).ok_or_else(|| {
        let kind = network.road(road).and_then(|road| road.sections.get(section)?.lane(lane));
        format!(
            "expected a driving lane, found one of type {}: {text}",
            kind.map_or("none", |lane| lane.kind.name())
        )
    })?;
    let [x, y, _] = sample.position_m;
    Ok(on_lane(&imported.map, found.id, found.line.project(Point2::new(x, y)).s_m))
}

fn on_lane(map: &Map, lane: LaneId, s_m: f64) -> Stop {
    let length_m = map.lane(lane).map_or(0.0, |lane| lane.line.length());
    Stop { lane, s_m: s_m.clamp(0.0, length_m) }
}

/// Name of a lane of a network as `road:section:lane`.
pub fn lane_name(network: &Network, imported: &Imported, lane: LaneId) -> String {
    let source = imported.lanes[lane.0 as usize];
    format!("{}:{}:{}", network.roads[source.road].id, source.section, source.lane)
}

/// Route for a terminal, with the names of its lanes.
pub fn text(map: &Map, name: &dyn Fn(LaneId) -> String, way: &Way) -> String {
    let mut out = format!(
        "route       {:.1} m over {} lanes, {} lane changes\n",
        way.length_m,
        way.lanes.len(),
        way.changes()
    );
    for (step, lane) in &way.lanes {
        let length_m = map.lane(*lane).map_or(0.0, |lane| lane.line.length());
        out.push_str(&format!("  {:<14}{:<16}{length_m:>9.1} m long\n", step.name(), name(*lane)));
    }
    out
}

/// Route for programs, with the names of its lanes.
pub fn json(name: &dyn Fn(LaneId) -> String, way: &Way) -> Value {
    let lane = |(step, lane): &(Step, LaneId)| json!({ "lane": name(*lane), "step": step.name() });
    let lanes: Vec<Value> = way.lanes.iter().map(lane).collect();
    json!({ "length_m": way.length_m, "changes": way.changes(), "lanes": lanes })
}

#[cfg(test)]
mod tests;
