//! The check of a solution, in the order of the official checker.
//!
//! Source: `valid_solution` of `commonroad-drivability-checker` 2025.4.0. It ends at the first failure; here all are
//! found, and the first one decides the official verdict.

mod text;

use std::collections::BTreeSet;

use swerve_geom::{Obb, Pose2, shared_area_m2};

use crate::feasible::{Miss, misses};
use crate::{
    Driven, Goal, GoalPosition, Model, PlanningProblem, Road, Scenario, Shape, Solution, SolutionState,
};

/// Tolerance of the initial state: position in metres, angles in radians, yaw rate in rad/s, time in steps.
const START: f64 = 0.1;

/// Tolerance of the initial speed, m/s.
const START_SPEED_MPS: f64 = 2.0;

/// Share of the value that is added to a tolerance, as `numpy.allclose` does.
const RELATIVE: f64 = 1e-5;

/// A state of a solution: planning problem and time step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StateId {
    /// Identity of the planning problem.
    pub problem: u32,
    /// Time step.
    pub step: u32,
}

/// A reason for which a solution is not valid.
#[derive(Clone, PartialEq, Debug)]
pub enum Failure {
    /// Problems without a solution, and solutions without a problem.
    Unsolved {
        /// Identities of the problems that are not solved.
        missing: Vec<u32>,
        /// Identities of solutions that the scenario does not have.
        unknown: Vec<u32>,
    },
    /// No state fulfils a goal.
    Goal {
        /// The state within the goal's time that is nearest to it, or the last state.
        at: StateId,
        /// Time steps by which the solution is too short.
        late_steps: u32,
        /// Distance from the goal, metres.
        off_m: f64,
        /// Speed outside the goal's interval, m/s.
        off_mps: f64,
        /// True if the heading is outside the goal's interval.
        is_turned: bool,
    },
    /// A value of the first state is not that of the problem.
    Start {
        /// The first state.
        at: StateId,
        /// The value, with its unit.
        quantity: &'static str,
        /// Value of the problem.
        expected: f64,
        /// Value of the solution.
        found: f64,
    },
    /// The outline has ground in common with an obstacle.
    Obstacle {
        /// The first such state.
        at: StateId,
        /// Identity of the obstacle.
        obstacle: u32,
        /// Common area with a rectangle, m²; `None` for other shapes.
        shared_m2: Option<f64>,
        /// True if the middle of the obstacle is behind the rear axle: it drove into the vehicle from behind.
        from_behind: bool,
    },
    /// A part of the outline is on no lanelet.
    OffRoad {
        /// The first such state.
        at: StateId,
        /// Area on no lanelet, m².
        outside_m2: f64,
    },
    /// Two solved vehicles collide.
    EachOther {
        /// The first such state.
        at: StateId,
        /// Identity of the other planning problem.
        other: u32,
    },
    /// No input leads to a state.
    Infeasible {
        /// The first such state.
        at: StateId,
        /// Remaining differences there.
        miss: Miss,
        /// Number of such states.
        count: usize,
        /// Number of transitions.
        of: usize,
    },
}

/// Result of a check.
#[derive(Clone, PartialEq, Debug)]
pub struct Verdict {
    /// Failures in the order of the official checker.
    pub failures: Vec<Failure>,
}

impl Verdict {
    /// True if the solution is valid.
    pub fn is_valid(&self) -> bool {
        self.failures.is_empty()
    }

    /// The official verdict: empty if valid, else the name of its exception, or `infeasible`.
    pub fn official(&self) -> &'static str {
        self.failures.first().map_or("", Failure::official)
    }
}

impl Failure {
    /// Name of the exception of the official checker, or `infeasible`, where it returns false.
    pub fn official(&self) -> &'static str {
        match self {
            Self::Unsolved { .. } => "MissingSolutionException",
            Self::Goal { .. } => "GoalNotReachedException",
            Self::Start { .. } => "SolutionCheckerException",
            Self::Obstacle { .. } | Self::OffRoad { .. } | Self::EachOther { .. } => "CollisionException",
            Self::Infeasible { .. } => "infeasible",
        }
    }
}

/// Checks a solution of a scenario.
pub fn check(scenario: &Scenario, solution: &Solution) -> Verdict {
    let road = Road::new(&scenario.lanelets);
    let solved: Vec<(&PlanningProblem, &Driven)> = solution
        .driven
        .iter()
        .filter_map(|driven| Some((scenario.problem(driven.problem)?, driven)))
        .collect();
    let mut failures: Vec<Failure> = unsolved(scenario, solution).into_iter().collect();
    failures.extend(solved.iter().filter_map(|(problem, driven)| goal(scenario, problem, driven)));
    failures.extend(solved.iter().filter_map(|(problem, driven)| start(problem, driven)));
    failures.extend(solved.iter().filter_map(|(_, driven)| obstacle(scenario, driven)));
    failures.extend(solved.iter().filter_map(|(_, driven)| off_road(&road, driven)));
    failures.extend(each_other(&solved));
    failures.extend(solved.iter().filter_map(|(_, driven)| infeasible(driven, scenario.step_s)));
    Verdict { failures }
}

/// Outline of the vehicle in a state.
fn outline(driven: &Driven, state: &SolutionState) -> Obb {
    let vehicle = driven.vehicle.vehicle();
    let center = Pose2::new(state.position.x_m, state.position.y_m, state.heading_rad);
    Obb::new(center, vehicle.length_m, vehicle.width_m)
}

fn place(driven: &Driven, state: &SolutionState) -> StateId {
    StateId { problem: driven.problem, step: state.step }
}

fn unsolved(scenario: &Scenario, solution: &Solution) -> Option<Failure> {
    let wanted: BTreeSet<u32> = scenario.problems.iter().map(|problem| problem.id).collect();
    let found: BTreeSet<u32> = solution.driven.iter().map(|driven| driven.problem).collect();
    (wanted != found).then(|| Failure::Unsolved {
        missing: wanted.difference(&found).copied().collect(),
        unknown: found.difference(&wanted).copied().collect(),
    })
}

fn goal(scenario: &Scenario, problem: &PlanningProblem, driven: &Driven) -> Option<Failure> {
    if driven.states.iter().any(|state| scenario.reaches(problem, state)) {
        return None;
    }
    let mut nearest: Option<(f64, Failure)> = None;
    for goal in &problem.goals {
        let last = driven.states.last()?;
        let within = driven.states.iter().filter(|state| goal.steps.contains(f64::from(state.step)));
        for state in within.chain([last]) {
            let (off, failure) = shortfall(scenario, goal, driven, state);
            if nearest.as_ref().is_none_or(|(least, _)| off < *least) {
                nearest = Some((off, failure));
            }
        }
    }
    nearest.map(|(_, failure)| failure)
}

/// Difference of a state from a goal: one number to compare states by, and the failure.
fn shortfall(scenario: &Scenario, goal: &Goal, driven: &Driven, state: &SolutionState) -> (f64, Failure) {
    let distance = |shape: &Shape| shape.distance_m(state.position);
    let off_m = match &goal.position {
        None => 0.0,
        Some(GoalPosition::Shapes(shapes)) => shapes.iter().map(distance).fold(f64::INFINITY, f64::min),
        Some(GoalPosition::Lanelets(ids)) => {
            let lanelets = ids.iter().filter_map(|id| scenario.lanelets.get(id));
            lanelets.map(|lanelet| distance(&lanelet.shape())).fold(f64::INFINITY, f64::min)
        }
    };
    let off_mps = goal.speed_mps.map_or(0.0, |speeds| speeds.beyond(state.speed_mps));
    let is_turned = goal.heading_rad.is_some_and(|headings| !headings.contains_heading(state.heading_rad));
    let late = goal.steps.beyond(f64::from(state.step)).max(0.0);
    let off = off_m + off_mps + f64::from(u8::from(is_turned)) + 100.0 * late;
    let late_steps = late as u32;
    (off, Failure::Goal { at: place(driven, state), late_steps, off_m, off_mps, is_turned })
}

fn start(problem: &PlanningProblem, driven: &Driven) -> Option<Failure> {
    let (first, wanted) = (driven.states.first()?, &problem.initial);
    let mut values = vec![
        ("x in m", wanted.position.x_m, first.position.x_m, START),
        ("y in m", wanted.position.y_m, first.position.y_m, START),
        ("heading in rad", wanted.heading_rad, first.heading_rad, START),
        ("speed in m/s", wanted.speed_mps, first.speed_mps, START_SPEED_MPS),
        ("time step", f64::from(wanted.step), f64::from(first.step), START),
    ];
    if driven.model == Model::St {
        values.push(("yaw rate in rad/s", wanted.yaw_rate_radps, first.yaw_rate_radps, START));
        values.push(("slip angle in rad", wanted.slip_rad, first.slip_rad, START));
    }
    let is_off = |(_, expected, found, within): &&(_, f64, f64, f64)| {
        (expected - found).abs() > within + RELATIVE * found.abs()
    };
    let (quantity, expected, found, _) = *values.iter().find(is_off)?;
    Some(Failure::Start { at: place(driven, first), quantity, expected, found })
}

fn obstacle(scenario: &Scenario, driven: &Driven) -> Option<Failure> {
    for state in &driven.states {
        let own = outline(driven, state);
        for obstacle in &scenario.obstacles {
            let hit = obstacle.at(state.step).into_iter().find(|shape| shape.overlaps(&own));
            let Some(shape) = hit else { continue };
            let shared_m2 = match &shape {
                Shape::Rectangle(other) => Some(shared_area_m2(&own, other)),
                _ => None,
            };
            let behind_m = -own.center.to_local::<swerve_geom::Ego>(shape.center()).x_m;
            let from_behind = behind_m > driven.vehicle.vehicle().rear_m;
            let (at, obstacle) = (place(driven, state), obstacle.id);
            return Some(Failure::Obstacle { at, obstacle, shared_m2, from_behind });
        }
    }
    None
}

fn off_road(road: &Road, driven: &Driven) -> Option<Failure> {
    driven.states.iter().find_map(|state| {
        let outside_m2 = road.outside_m2(&outline(driven, state));
        (outside_m2 > 0.0).then(|| Failure::OffRoad { at: place(driven, state), outside_m2 })
    })
}

fn each_other(solved: &[(&PlanningProblem, &Driven)]) -> Option<Failure> {
    for (k, (_, driven)) in solved.iter().enumerate() {
        for (_, other) in &solved[..k] {
            let meeting = driven.states.iter().find(|state| {
                let same = other.states.iter().find(|one| one.step == state.step);
                same.is_some_and(|one| outline(other, one).overlaps(&outline(driven, state)))
            });
            if let Some(state) = meeting {
                return Some(Failure::EachOther { at: place(driven, state), other: other.problem });
            }
        }
    }
    None
}

fn infeasible(driven: &Driven, step_s: f64) -> Option<Failure> {
    let misses = misses(driven, step_s);
    let miss = *misses.first()?;
    let at = StateId { problem: driven.problem, step: miss.step };
    Some(Failure::Infeasible { at, miss, count: misses.len(), of: driven.states.len() - 1 })
}

#[cfg(test)]
mod tests;
