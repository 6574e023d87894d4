//! The planner's interface: request in, plan out, within a budget.

use swerve_core::Time;
use swerve_geom::{FrenetPoint, Point2, Pose2};
use swerve_msg::{ActorId, ActorKind, EgoState, Plan, Prediction, Route};
use swerve_vehicle::{Limits, Shape};

/// Input of a planner.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Stamp of the predictions; copied to the plan.
    pub stamp: Time,
    /// Start state of the plan: measured at the stamp, or predicted over the expected run time; its `stamp` is the
    /// instant at which the plan begins.
    pub start: EgoState,
    /// Route to follow, with the drivable ground.
    pub route: &'a Route,
    /// Arc length of the route near the start, metres: where a road meets itself, the nearest place may be a different
    /// one. `None` selects the nearest place with the start's direction.
    pub along_m: Option<f64>,
    /// Target speed on a free road, m/s.
    pub target_speed_mps: f64,
    /// Longest distance over the line of the own lane to overtake a moving road user, metres: as far as the pose
    /// estimate lasts without a fix.
    pub overtake_max_m: f64,
    /// Predicted motions of other road users, ordered by identity. The collision check adds one standard deviation of
    /// their covariances on each side; [`plan_within_risk`](crate::collision::plan_within_risk) scales covariances to
    /// its bound.
    pub predictions: &'a [Prediction],
    /// Identities of those that stopped, set off or came into sight moving in the last seconds, or wait in a queue: they may
    /// change their pace again.
    pub changed_lately: &'a [ActorId],
    /// Outline of the ego.
    pub shape: &'a Shape,
    /// Limits of the ego.
    pub limits: &'a Limits,
    /// The latest previous plan.
    pub previous: Option<&'a Plan>,
    /// Seed of the random numbers of this call.
    pub seed: u64,
}

/// Largest overlap of a stop over the left border of the ego's lane, metres.
const OVER_M: f64 = 0.3;

/// Largest distance from the start to a stop, metres.
const REST_AHEAD_M: f64 = 150.0;

/// Above this speed a pedestrian is walking, m/s.
const WALKS_MPS: f64 = 0.5;

/// Lowest speed of oncoming traffic, m/s.
const COMES_MPS: f64 = 1.0;

/// Search radius along the route for places near the start, metres.
const START_REACH_M: f64 = 15.0;

impl Request<'_> {
    /// Place of the start along the route.
    pub fn place(&self) -> FrenetPoint {
        let pose = self.start.pose;
        match self.along_m {
            Some(s_m) => self.route.project_near(pose.point(), s_m, START_REACH_M),
            None => self.route.line().project_pose(pose),
        }
    }

    /// Place of a point near the start or up to `ahead_m` further along the route.
    pub fn place_of(&self, point: Point2, ahead_m: f64) -> FrenetPoint {
        let half_m = 0.5 * ahead_m.max(0.0);
        self.route.project_near(point, self.place().s_m + half_m, half_m + START_REACH_M)
    }

    /// Largest offset at which the ego may come to rest at arc length `s_m`, metres: further left is another lane.
    pub(crate) fn rest_left_m(&self, s_m: f64) -> f64 {
        self.route.lane().left_m(s_m) - 0.5 * self.shape.width_m + OVER_M
    }

    /// Returns true if the ego may come to rest at this pose: not in another lane to the left.
    pub(crate) fn may_rest_at(&self, pose: Pose2) -> bool {
        let place = self.place_of(pose.point(), REST_AHEAD_M);
        place.d_m <= self.rest_left_m(place.s_m)
    }

    /// Returns true if a plan stays in the ego's lane.
    pub(crate) fn keeps_lane(&self, plan: &Plan) -> bool {
        plan.points.iter().all(|p| self.may_rest_at(p.pose))
    }

    /// Returns true if a plan leaves the ego's lane to the left and passes oncoming traffic before its end.
    pub(crate) fn meets_in_other_lane(&self, plan: &Plan) -> bool {
        self.passes_oncoming(plan) && self.leaves_lane(plan)
    }

    /// Returns true if a plan that begins in the ego's lane leaves it to the left.
    pub(crate) fn leaves_lane(&self, plan: &Plan) -> bool {
        self.may_rest_at(self.start.pose) && !self.keeps_lane(plan)
    }

    /// Returns true if a pedestrian is walking.
    pub(crate) fn somebody_walks(&self) -> bool {
        self.predictions.iter().filter(|one| one.kind == ActorKind::Pedestrian).any(|one| {
            let [first, .., last] = &one.path[..] else { return false };
            let walked_m = last.pose.point().distance(first.pose.point());
            walked_m > WALKS_MPS * (last.at - first.at).as_secs()
        })
    }

    /// Returns true if an oncoming vehicle is ahead now and behind the ego at the end of the plan.
    fn passes_oncoming(&self, plan: &Plan) -> bool {
        let Some(end) = plan.points.last() else { return false };
        let (start, line, from_m) = (self.start.pose, self.route.line(), self.place().s_m);
        let ends_s = (end.at - self.start.stamp).as_secs();
        let driven_m = start.point().distance(end.pose.point());
        self.predictions.iter().filter(|one| one.kind != ActorKind::Pedestrian).any(|one| {
            let [first, .., last] = &one.path[..] else { return false };
            let velocity_mps =
                (last.pose.point() - first.pose.point()) * (1.0 / (last.at - first.at).as_secs());
            let half_m = 0.5 * (driven_m + velocity_mps.norm() * ends_s);
            let place = self.route.project_near(first.pose.point(), from_m + half_m, half_m + START_REACH_M);
            let comes_mps = -velocity_mps.dot(line.at(place.s_m).pose.direction());
            let ahead_m = place.s_m - from_m;
            comes_mps > COMES_MPS && (0.0..driven_m + comes_mps * ends_s).contains(&ahead_m)
        })
    }

    /// Returns true if any predicted place is within `range_m` of the start (centre to ego origin).
    pub fn obstacle_in_range(&self, range_m: f64) -> bool {
        let start = self.start.pose.point();
        self.predictions
            .iter()
            .any(|p| p.path.iter().any(|place| place.pose.point().distance(start) <= range_m))
    }
}

/// Answer of a budget: continue or stop.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Progress {
    /// Budget is left.
    Continue,
    /// The budget is used up: return the best result so far.
    Stop,
}

/// Counts a planner's work and limits it.
pub trait Budget {
    /// Accounts for `units` of work about to be done.
    fn spend(&mut self, units: u64) -> Progress;
}

/// A budget that never stops and only counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Unlimited {
    /// Units spent so far.
    pub spent: u64,
}

impl Budget for Unlimited {
    fn spend(&mut self, units: u64) -> Progress {
        self.spent += units;
        Progress::Continue
    }
}

/// Counts the units that a planner spends, and never asks the inner budget again after [`Progress::Stop`].
pub struct Counted<'a> {
    inner: &'a mut dyn Budget,
    /// Units spent so far.
    pub spent: u64,
    /// True if the budget is used up.
    pub stopped: bool,
}

impl<'a> Counted<'a> {
    /// Creates a counter with nothing spent.
    pub fn new(inner: &'a mut dyn Budget) -> Self {
        Self { inner, spent: 0, stopped: false }
    }
}

impl Budget for Counted<'_> {
    fn spend(&mut self, units: u64) -> Progress {
        if self.stopped {
            return Progress::Stop;
        }
        self.spent += units;
        let progress = self.inner.spend(units);
        self.stopped = progress == Progress::Stop;
        progress
    }
}

/// A motion planner.
pub trait Planner: Send {
    /// Plans once. The plan's `work` is the number of units spent.
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan;
}

#[cfg(test)]
mod tests {
    use crate::testing::World;

    #[test]
    fn range_counts_every_predicted_place() {
        let world = World::straight(10.0).with_person((60.0, 0.0), (-10.0, 0.0));
        assert!(world.request().obstacle_in_range(11.0));
        assert!(!world.request().obstacle_in_range(9.0));
    }
}
