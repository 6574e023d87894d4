//! Planning problems and their goals.

use swerve_geom::{Point2, angle_between};

use crate::{Shape, State};

/// A closed interval.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Interval {
    /// Lower end.
    pub from: f64,
    /// Upper end.
    pub to: f64,
}

impl Interval {
    /// True if a value is inside or at an end.
    pub fn contains(self, value: f64) -> bool {
        self.from <= value && value <= self.to
    }

    /// Distance of a value from the interval; 0 inside.
    pub fn beyond(self, value: f64) -> f64 {
        (self.from - value).max(value - self.to).max(0.0)
    }

    /// True if a heading is inside, counted from the lower end by the short way.
    pub fn contains_heading(self, heading_rad: f64) -> bool {
        let width_rad = angle_between(self.from, self.to);
        (0.0..=width_rad).contains(&angle_between(self.from, heading_rad))
    }
}

/// Position of a goal.
#[derive(Clone, PartialEq, Debug)]
pub enum GoalPosition {
    /// Inside one of these shapes.
    Shapes(Vec<Shape>),
    /// Inside one of these lanelets.
    Lanelets(Vec<u32>),
}

/// A goal state: all its conditions hold at one time step.
#[derive(Clone, PartialEq, Debug)]
pub struct Goal {
    /// Allowed time steps.
    pub steps: Interval,
    /// Position of the vehicle's centre of gravity.
    pub position: Option<GoalPosition>,
    /// Heading, radians.
    pub heading_rad: Option<Interval>,
    /// Speed, m/s.
    pub speed_mps: Option<Interval>,
}

/// A planning problem.
#[derive(Clone, PartialEq, Debug)]
pub struct PlanningProblem {
    /// Identity in the file.
    pub id: u32,
    /// State in which the vehicle starts.
    pub initial: State,
    /// Goal states, of which one has to be reached.
    pub goals: Vec<Goal>,
}

impl PlanningProblem {
    /// Last time step at which the goal can be reached.
    pub fn last_step(&self) -> u32 {
        let last = self.goals.iter().map(|goal| goal.steps.to).fold(0.0, f64::max);
        last.clamp(0.0, f64::from(u32::MAX)) as u32
    }
}

/// State in which a goal may be reached.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Reaching {
    pub(crate) step: u32,
    pub(crate) position: Point2,
    pub(crate) heading_rad: f64,
    pub(crate) speed_mps: f64,
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    #[test]
    fn heading_interval_is_counted_across_the_turn() {
        let around = Interval { from: PI - 0.1, to: PI + 0.1 };
        for (heading, inside) in [(PI, true), (-PI + 0.05, true), (-PI + 0.2, false), (0.0, false)] {
            assert_eq!(around.contains_heading(heading), inside, "{heading}");
        }
    }
}
