//! The way of the ego over the map.

use core::fmt;

use swerve_geom::{Point2, angle_between};
use swerve_map::router::{self, Stop};
use swerve_map::{LaneId, Map};

use super::places;
use crate::{Goal, GoalPosition, PlanningProblem, Scenario, Shape};

/// Way beyond the place that the ego can reach, metres.
const BEYOND_M: f64 = 60.0;

/// Acceleration with which the ego could drive on, m/s²: bounds the way that is looked for.
const ACCEL_MPS2: f64 = 3.0;

/// Most lanes of a way straight on.
const LANES_MAX: usize = 200;

/// Distance between places of a lane that are compared with a goal, metres.
const STEP_M: f64 = 0.5;

/// Distance of the last place from the end of a lane, metres.
const BEFORE_END_M: f64 = 0.2;

/// Reason for which a scenario cannot be driven.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NoWay {
    /// It has no planning problem.
    NoProblem,
    /// It has no lanelets.
    NoLanelets,
    /// The start is on no driving lanelet in the direction of travel.
    OffLanelets,
    /// No way over lanelets leads to the goal.
    Unreachable,
    /// A road user is farther from the origin than scenarios can have places.
    Far,
}

impl fmt::Display for NoWay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoProblem => "expected a planning problem, found none",
            Self::NoLanelets => "expected lanelets, found none",
            Self::OffLanelets => "expected the start of the planning problem on a lanelet in its direction",
            Self::Unreachable => {
                "no way over lanelets leads from the start to the goal of the planning problem"
            }
            Self::Far => "expected road users within 100 km of the origin along x and y",
        })
    }
}

impl std::error::Error for NoWay {}

/// A way.
pub(super) struct Found {
    pub(super) start: Stop,
    /// Place at the goal, if the way goes on beyond it.
    pub(super) via: Option<Stop>,
    /// End of the way.
    pub(super) goal: Stop,
    /// Offset of the start from its lane, metres.
    pub(super) d_m: f64,
    /// Turn of the start from its lane, radians.
    pub(super) turn_rad: f64,
    /// First and last place of the goal along the way from the start, metres.
    pub(super) goal_m: Option<[f64; 2]>,
    /// Length of a way straight on, metres.
    pub(super) straight_m: f64,
}

impl Found {
    /// The way straight on from a start: offset and turn from its lane.
    fn straight(map: &Map, (start, d_m, turn_rad): (Stop, f64, f64), reach_m: f64) -> Self {
        let (goal, straight_m) = beyond(map, start, reach_m);
        Self { start, via: None, goal, d_m, turn_rad, goal_m: None, straight_m }
    }
}

/// Finds the way to the goal and beyond, or straight on.
pub(super) fn find(scenario: &Scenario, problem: &PlanningProblem, map: &Map) -> Result<Found, NoWay> {
    let initial = &problem.initial;
    let starts = places(map, initial.position, initial.heading_rad);
    if starts.is_empty() {
        return Err(NoWay::OffLanelets);
    }
    let lasts_s = f64::from(problem.last_step().saturating_sub(initial.step)) * scenario.step_s;
    let reach_m = initial.speed_mps * lasts_s + 0.5 * ACCEL_MPS2 * lasts_s * lasts_s + BEYOND_M;
    let targets: Vec<Target> = problem.goals.iter().flat_map(|goal| targets(scenario, map, goal)).collect();
    let has_place = problem.goals.iter().all(|goal| goal.position.is_some());
    if targets.is_empty() {
        // A goal without a place, or one that is on no lane: straight on.
        return Ok(Found::straight(map, starts[0], reach_m));
    }
    let mut best: Option<(f64, Found)> = None;
    for &(start, d_m, turn_rad) in &starts {
        for target in &targets {
            let is_behind = target.lane == start.lane && target.to_m <= start.s_m;
            let place = Stop { lane: target.lane, s_m: 0.5 * (target.from_m + target.to_m) };
            let place = match target.lane == start.lane && place.s_m <= start.s_m {
                true => Stop { s_m: 0.5 * (start.s_m + target.to_m), ..place },
                false => place,
            };
            let way = (!is_behind).then(|| router::find_over(map, &[start, place], &[]).ok()).flatten();
            let Some(way) = way else { continue };
            let cost_m = way.length_m + router::CHANGE_M * way.changes() as f64 + 3.0 * d_m.abs();
            if best.as_ref().is_some_and(|(least, _)| *least <= cost_m) {
                continue;
            }
            let at_m = way.length_m;
            let goal_m = [at_m - (place.s_m - target.from_m), at_m + (target.to_m - place.s_m)];
            let (goal, _) = beyond(map, place, (reach_m - at_m).max(BEYOND_M));
            let via = (goal != place).then_some(place);
            let goal_m = Some(goal_m.map(|way_m| way_m.max(0.0)));
            best = Some((cost_m, Found { start, via, goal, d_m, turn_rad, goal_m, straight_m: 0.0 }));
        }
    }
    match best {
        Some((_, found)) => Ok(found),
        None if has_place => Err(NoWay::Unreachable),
        None => Ok(Found::straight(map, starts[0], reach_m)),
    }
}

/// Part of a lane that is in a goal.
struct Target {
    lane: LaneId,
    from_m: f64,
    to_m: f64,
}

fn targets(scenario: &Scenario, map: &Map, goal: &Goal) -> Vec<Target> {
    let shapes: Vec<Shape> = match &goal.position {
        None => return Vec::new(),
        Some(GoalPosition::Lanelets(ids)) => {
            let lane = |id: &u32| {
                let lane = map.lane(LaneId(*id)).filter(|lane| lane.kind.is_drivable())?;
                Some(Target { lane: lane.id, from_m: 0.0, to_m: lane.line.length() })
            };
            return ids.iter().filter(|id| scenario.lanelets.contains_key(id)).filter_map(lane).collect();
        }
        Some(GoalPosition::Shapes(shapes)) => shapes.clone(),
    };
    let is_inside = |point: Point2| shapes.iter().any(|shape| shape.contains(point));
    let mut found = Vec::new();
    for lane in map.lanes().iter().filter(|lane| lane.kind.is_drivable()) {
        let steps = (lane.line.length() / STEP_M).ceil() as usize;
        let places = lane.line.at_each((0..=steps).map(|k| (k as f64 * STEP_M).min(lane.line.length())));
        let inside: Vec<f64> = places
            .enumerate()
            .filter(|(_, at)| {
                let headings = goal.heading_rad;
                is_inside(at.pose.point())
                    && headings.is_none_or(|headings| {
                        angle_between(headings.from, at.pose.heading_rad).abs() < core::f64::consts::FRAC_PI_2
                    })
            })
            .map(|(k, _)| (k as f64 * STEP_M).min(lane.line.length()))
            .collect();
        if let [from_m, ..] = inside[..] {
            found.push(Target { lane: lane.id, from_m, to_m: inside[inside.len() - 1] });
        }
    }
    found
}

/// The place `way_m` metres after a place, along the lanes that turn least, or the end of the last lane; and the length of
/// the way to it, metres.
fn beyond(map: &Map, from: Stop, way_m: f64) -> (Stop, f64) {
    let (mut at, mut left_m) = (from, way_m);
    for _ in 0..LANES_MAX {
        let Some(lane) = map.lane(at.lane) else { return (from, 0.0) };
        let end_m = (lane.line.length() - BEFORE_END_M).max(at.s_m);
        if at.s_m + left_m <= end_m {
            return (Stop { s_m: at.s_m + left_m, ..at }, way_m);
        }
        left_m -= lane.line.length() - at.s_m;
        let heading_rad = lane.line.at(lane.line.length()).pose.heading_rad;
        let turn = |next: &LaneId| {
            let lane = map.lane(*next).filter(|lane| lane.kind.is_drivable())?;
            let later_rad = lane.line.at(lane.line.length().min(30.0)).pose.heading_rad;
            Some((angle_between(heading_rad, later_rad).abs(), *next))
        };
        let next = lane.successors.iter().filter_map(turn).min_by(|a, b| a.0.total_cmp(&b.0));
        match next {
            Some((_, next)) if left_m > 0.0 => at = Stop { lane: next, s_m: 0.0 },
            _ => return (Stop { s_m: end_m, ..at }, way_m - left_m),
        }
    }
    (at, way_m - left_m)
}
