//! Rules of the road and of the scenario: when the ego is off the road, and when the run is over.

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Point2};
use swerve_msg::Route;
use swerve_msg::truth::{EndReason, WorldState};
use swerve_scenario::{End, Scenario, Standstill};

/// Below this the ego stands still, m/s.
const STILL_MPS: f64 = 0.05;
/// How far from its last known place along the road the ego is looked for, metres.
const REACH_M: f64 = 15.0;

/// What the rules remember from step to step.
#[derive(Clone, Debug)]
pub(crate) struct Rules {
    end: End,
    end_m: f64,
    s_m: f64,
    off_road: bool,
    first_collision: Option<Time>,
    still_since: Option<Time>,
}

impl Rules {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        Self {
            end: scenario.end,
            end_m: scenario.ego.end_m,
            s_m: scenario.ego.s_m,
            off_road: false,
            first_collision: None,
            still_since: None,
        }
    }

    /// Where the centre of the ego's outline is along the road; called once per step, before the others.
    pub(crate) fn follow(&mut self, route: &Route, center: Point2) {
        self.s_m = route.line.project_near(center, self.s_m, REACH_M).s_m;
    }

    /// Metres along the road of the centre of the ego's outline.
    pub(crate) fn s_m(&self) -> f64 {
        self.s_m
    }

    /// Whether the ego leaves the drivable ground in this step, having been on it before.
    pub(crate) fn leaves_road(&mut self, route: &Route, outline: &Obb) -> bool {
        let outside = |corner: Point2| {
            let d_m = route.line.project_near(corner, self.s_m, REACH_M).d_m;
            d_m > route.left_m || d_m < -route.right_m
        };
        let off_road = outline.corners().into_iter().any(outside);
        let leaves = off_road && !self.off_road;
        self.off_road = off_road;
        leaves
    }

    /// Whether and why the run is over with this state.
    pub(crate) fn ended(&mut self, state: &WorldState, center: Point2) -> Option<EndReason> {
        let now = state.stamp;
        if self.first_collision.is_none() {
            self.first_collision = state.collisions.first().map(|c| c.stamp);
        }
        let stands = self.stands(state, center);
        let over = |since: Option<Time>, for_s: f64| since.is_some_and(|t| now - t >= Span::from_secs(for_s));
        if over(self.first_collision, self.end.after_collision_s) {
            Some(EndReason::Collision)
        } else if self.s_m >= self.end_m {
            Some(EndReason::Goal)
        } else if stands {
            Some(EndReason::Stopped)
        } else if over(Some(Time::ZERO), self.end.timeout_s) {
            Some(EndReason::Timeout)
        } else {
            None
        }
    }

    fn stands(&mut self, state: &WorldState, center: Point2) -> bool {
        let Some(Standstill { near, within_m, for_s }) = self.end.standstill else { return false };
        let there = near.is_none_or(|i| state.actors[i].pose.point().distance(center) <= within_m);
        if !there || state.ego.velocity_mps.norm() > STILL_MPS {
            self.still_since = None;
            return false;
        }
        let since = *self.still_since.get_or_insert(state.stamp);
        state.stamp - since >= Span::from_secs(for_s)
    }
}
