//! Scenarios.

use std::collections::BTreeMap;

use swerve_geom::Point2;
use swerve_map_io::Problems;
use swerve_map_io::commonroad::Commonroad;

use crate::problem::Reaching;
use crate::{Goal, GoalPosition, Motion, Obstacle, PlanningProblem, Shape, SolutionState};

/// Bounds of a lanelet as in the file, and its place among the others.
#[derive(Clone, PartialEq, Debug)]
pub struct Lanelet {
    /// Left bound in the direction of travel.
    pub left: Vec<Point2>,
    /// Right bound in the direction of travel.
    pub right: Vec<Point2>,
    /// Lanelets beside it, to the left and to the right.
    pub beside: [Option<Beside>; 2],
}

/// A lanelet beside another.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Beside {
    /// Its identity.
    pub lanelet: u32,
    /// True if its traffic runs the other way.
    pub opposite: bool,
}

impl Lanelet {
    /// The ground between the bounds.
    pub fn shape(&self) -> Shape {
        Shape::Polygon(self.right.iter().chain(self.left.iter().rev()).copied().collect())
    }
}

/// A thing beside the road, such as a building.
#[derive(Clone, PartialEq, Debug)]
pub struct Environment {
    /// Identity in the file.
    pub id: u32,
    /// Type of the file, such as `building`.
    pub kind: String,
    /// Shapes in the map.
    pub shapes: Vec<Shape>,
}

/// A scenario of version 2020a.
#[derive(Clone, PartialEq, Debug)]
pub struct Scenario {
    /// Identity of the benchmark, such as `USA_US101-1_1_T-1`.
    pub benchmark: String,
    /// Duration of a time step, seconds.
    pub step_s: f64,
    /// Map, traffic lights and signs; `None` if the file has no lanelets.
    pub roads: Option<Commonroad>,
    /// Lanelets by their identity.
    pub lanelets: BTreeMap<u32, Lanelet>,
    /// Static and dynamic obstacles in the order of the file.
    pub obstacles: Vec<Obstacle>,
    /// Environment obstacles in the order of the file. They take no part in collisions, as in the official checker.
    pub environment: Vec<Environment>,
    /// Planning problems in the order of the file.
    pub problems: Vec<PlanningProblem>,
    /// Problems of the file that do not change its content.
    pub defects: Problems,
}

impl Scenario {
    /// True if a state fulfils a goal.
    pub(crate) fn fulfils(&self, goal: &Goal, state: &Reaching) -> bool {
        let is_there = match &goal.position {
            None => true,
            Some(GoalPosition::Shapes(shapes)) => shapes.iter().any(|shape| shape.contains(state.position)),
            Some(GoalPosition::Lanelets(ids)) => {
                let mut lanelets = ids.iter().filter_map(|id| self.lanelets.get(id));
                lanelets.any(|lanelet| lanelet.shape().contains(state.position))
            }
        };
        is_there
            && goal.steps.contains(f64::from(state.step))
            && goal.heading_rad.is_none_or(|headings| headings.contains_heading(state.heading_rad))
            && goal.speed_mps.is_none_or(|speeds| speeds.contains(state.speed_mps))
    }

    /// True if a state of a solution fulfils a goal of the problem.
    pub fn reaches(&self, problem: &PlanningProblem, state: &SolutionState) -> bool {
        let reaching = Reaching {
            step: state.step,
            position: state.position,
            heading_rad: state.heading_rad,
            speed_mps: state.speed_mps,
        };
        problem.goals.iter().any(|goal| self.fulfils(goal, &reaching))
    }

    /// The scenario without the road users that have a trajectory.
    #[must_use]
    pub fn without_trajectories(&self) -> Self {
        let mut scenario = self.clone();
        scenario.obstacles.retain(|obstacle| !matches!(obstacle.motion, Motion::Trajectory(_)));
        scenario
    }

    /// The planning problem of an identity.
    pub fn problem(&self, id: u32) -> Option<&PlanningProblem> {
        self.problems.iter().find(|problem| problem.id == id)
    }
}
