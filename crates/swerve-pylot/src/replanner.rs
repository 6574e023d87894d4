//! The closed loop around the original's RRT* and Hybrid A*: a search if anything is in range, at constant speed,
//! without regard to the road; the route otherwise, and where nothing is found.

use swerve_geom::Pose2;
use swerve_msg::{Plan, PlanStatus};
use swerve_planning::path::ground::{Area, Clock, Ground, Outline, around};
use swerve_planning::path::points::PathPoint;
use swerve_planning::path::route::{follow_route, route_pose_ahead};
use swerve_planning::path::speed::{SpeedProfile, timed_points};
use swerve_planning::{Budget, CollisionMode, Counted, Obstacles, Request};

/// One search for a way from pose to pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task {
    /// From here.
    pub(crate) start: Pose2,
    /// To there.
    pub(crate) goal: Pose2,
    /// The planned point stays in x_min, y_min, x_max, y_max, metres.
    pub(crate) bounds: [f64; 4],
    /// Seed of the random numbers.
    pub(crate) seed: u64,
}

/// The search of one planner.
pub(crate) trait PathSearch {
    /// Appends the points of a path to `path`, which is empty; whether there is one.
    fn search(
        &mut self,
        ground: &Ground<'_>,
        task: &Task,
        budget: &mut dyn Budget,
        path: &mut Vec<PathPoint>,
    ) -> bool;
}

/// Settings that the planners share.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Settings {
    pub(crate) goal_ahead_m: f64,
    pub(crate) obstacle_range_m: f64,
    pub(crate) clearance_m: f64,
    pub(crate) lane_width_m: f64,
    pub(crate) horizon_s: f64,
    pub(crate) collision: CollisionMode,
    /// The outline that is planned for.
    pub(crate) outline: Outline,
}

/// Plans anew with every frame, with memory kept between calls; no call depends on an earlier one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Replanner {
    obstacles: Obstacles,
    path: Vec<PathPoint>,
}

impl Replanner {
    pub(crate) fn plan(
        &mut self,
        search: &mut impl PathSearch,
        settings: &Settings,
        request: &Request<'_>,
        budget: &mut dyn Budget,
    ) -> Plan {
        let start = request.start.pose;
        let range_m = settings.obstacle_range_m;
        if !request.obstacle_in_range(range_m) {
            return follow_route(request, SpeedProfile::Constant, settings.horizon_s, PlanStatus::Route);
        }
        self.obstacles.set_near(request.predictions, settings.collision, start.point(), range_m);
        let goal = route_pose_ahead(request.route.line(), start, settings.goal_ahead_m);
        let bounds = around(&[start, goal], settings.lane_width_m);
        let speed_mps = request.target_speed_mps;
        let ground = Ground {
            obstacles: &self.obstacles,
            clearance_m: settings.clearance_m,
            outline: settings.outline,
            area: Area::Box(bounds),
            clock: Clock { start: request.start.stamp, speed_mps, target_mps: speed_mps, accel_mps2: 1.0 },
        };
        let task = Task { start, goal, bounds, seed: request.seed };
        let mut counted = Counted::new(budget);
        self.path.clear();
        let plan = if search.search(&ground, &task, &mut counted, &mut self.path) {
            let points =
                timed_points(&self.path, &request.start, speed_mps, SpeedProfile::Constant, request.limits);
            Plan { stamp: request.stamp, status: PlanStatus::Found, points, work: 0 }
        } else {
            follow_regardless(request, settings.horizon_s)
        };
        Plan { work: counted.spent, ..plan }
    }
}

/// The route, whatever is in the way.
fn follow_regardless(request: &Request<'_>, horizon_s: f64) -> Plan {
    follow_route(request, SpeedProfile::Constant, horizon_s, PlanStatus::GaveUp)
}

#[cfg(test)]
mod tests {
    use swerve_planning::testing::World;

    use super::*;

    #[test]
    fn without_a_path_the_route_is_followed_regardless() {
        let regardless = follow_regardless(&World::straight(10.0).request(), 4.0);
        assert_eq!(regardless.status, PlanStatus::GaveUp);
        assert!(regardless.points.iter().all(|p| p.speed_mps == 10.0));
    }
}
