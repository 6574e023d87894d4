//! The closed loop around the originals' searches: the planned point, the route if nothing is in range, and the
//! fallback if no path is found.

use swerve_core::Span;
use swerve_geom::{Point2, Pose2};
use swerve_msg::{Plan, PlanPoint, PlanStatus};
use swerve_planning::path::ground::around;
use swerve_planning::path::points::with_curvature;
use swerve_planning::path::route::route_path;
use swerve_planning::{Budget, Counted, Request};

use crate::boxes::{Boxes, Sight};
use crate::posed::AxisBox;
use crate::{Fallback, Rules};

/// Number of route waypoints given to planners, a metre apart. Source: `pylot` be7bf9c, `planning/flags.py`.
pub(crate) const ROUTE_POINTS: usize = 30;

/// Lower bound on the speed used to time plans, so that their instants increase, m/s.
const TIMED_MPS: f64 = 1.0;

/// One search for a path between two poses.
pub(crate) struct Task<'a> {
    /// Obstacles.
    pub(crate) boxes: &'a Boxes,
    /// Start pose.
    pub(crate) start: Pose2,
    /// Goal pose.
    pub(crate) goal: Pose2,
    /// Bounds of start and goal, enlarged by the lane's width.
    pub(crate) bounds: AxisBox,
    /// Driving speed, m/s.
    pub(crate) speed_mps: f64,
    /// Seed of the random numbers.
    pub(crate) seed: u64,
}

/// The search of one planner.
pub(crate) trait PathSearch {
    /// Writes the poses of a path to `path`; returns true if there is one.
    fn search(&mut self, task: &Task<'_>, budget: &mut dyn Budget, path: &mut Vec<Pose2>) -> bool;
}

/// Parameters shared by RRT* and Hybrid A*.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Settings {
    pub(crate) rules: Rules,
    pub(crate) sight: Sight,
    pub(crate) goal_ahead_m: f64,
    pub(crate) clearance_m: f64,
    pub(crate) lane_width_m: f64,
}

/// Replans on every frame, with storage that is reused between calls; a call depends on earlier ones only through the
/// previous plan.
#[derive(Clone, Debug, Default)]
pub(crate) struct Replanner {
    boxes: Boxes,
    path: Vec<Pose2>,
}

impl Replanner {
    pub(crate) fn plan(
        &mut self,
        search: &mut impl PathSearch,
        settings: &Settings,
        request: &Request<'_>,
        budget: &mut dyn Budget,
    ) -> Plan {
        let rules = &settings.rules;
        let start = planned(request, rules);
        self.boxes.solid_left = rules.solid_left;
        self.boxes.set_predicted(request, start.point(), settings.sight, settings.clearance_m);
        if self.boxes.is_empty() {
            return along_route(request, rules, request.target_speed_mps, PlanStatus::Route);
        }
        let line = request.route.line();
        let goal = line.at(first_m(line.project(start.point()).s_m, rules) + settings.goal_ahead_m).pose;
        let task = Task {
            boxes: &self.boxes,
            start,
            goal,
            bounds: around(&[start, goal], settings.lane_width_m),
            speed_mps: request.target_speed_mps,
            seed: request.seed,
        };
        let mut counted = Counted::new(budget);
        let plan = if search.search(&task, &mut counted, &mut self.path) {
            through(request, rules, &self.path, (request.target_speed_mps, PlanStatus::Found))
        } else {
            nothing_found(request, rules)
        };
        Plan { work: counted.spent, ..plan }
    }
}

/// Distance from the ego origin forward to the planned point, metres.
pub(crate) fn planned_ahead_m(request: &Request<'_>, rules: &Rules) -> f64 {
    if rules.middle_of_car { request.shape.center_ahead_m() } else { 0.0 }
}

/// Arc length of the route's first waypoint for a point at this arc length, metres.
pub(crate) fn first_m(s_m: f64, rules: &Rules) -> f64 {
    if rules.whole_metres { s_m.round() } else { s_m }
}

/// Pose from which planning starts.
pub(crate) fn planned(request: &Request<'_>, rules: &Rules) -> Pose2 {
    request.start.pose.ahead(planned_ahead_m(request, rules))
}

/// Fallback plan if no path is found.
pub(crate) fn nothing_found(request: &Request<'_>, rules: &Rules) -> Plan {
    match rules.fallback {
        Fallback::FollowRoute => along_route(request, rules, request.target_speed_mps, PlanStatus::GaveUp),
        Fallback::StopOnRoute => along_route(request, rules, 0.0, PlanStatus::Stop),
        Fallback::StopOnLastPlan => {
            let Some(previous) = request.previous.filter(|plan| !plan.points.is_empty()) else {
                return along_route(request, rules, 0.0, PlanStatus::Stop);
            };
            let (here, ahead_m) = (planned(request, rules).point(), planned_ahead_m(request, rules));
            let away_m = |p: &PlanPoint| p.pose.ahead(ahead_m).point().distance(here);
            let nearest = (0..previous.points.len())
                .min_by(|&a, &b| away_m(&previous.points[a]).total_cmp(&away_m(&previous.points[b])));
            let rest: Vec<Pose2> = previous.points[nearest.unwrap_or(0)..].iter().map(|p| p.pose).collect();
            timed(request, &rest, (0.0, PlanStatus::Brake))
        }
    }
}

fn along_route(request: &Request<'_>, rules: &Rules, speed_mps: f64, status: PlanStatus) -> Plan {
    let line = request.route.line();
    let first = line.at(first_m(line.project(planned(request, rules).point()).s_m, rules)).pose;
    let path = route_path(line, line.project(first.point()).s_m, (ROUTE_POINTS - 1) as f64);
    let poses: Vec<Pose2> = path.iter().map(|p| p.pose).collect();
    through(request, rules, &poses, (speed_mps, status))
}

/// A plan over poses of the planned point, all at one speed.
fn through(request: &Request<'_>, rules: &Rules, path: &[Pose2], as_what: (f64, PlanStatus)) -> Plan {
    let back_m = -planned_ahead_m(request, rules);
    let poses: Vec<Pose2> = path.iter().map(|pose| pose.ahead(back_m)).collect();
    timed(request, &poses, as_what)
}

/// A plan over poses of the ego origin. Its instants are those of a car that keeps its current speed.
fn timed(request: &Request<'_>, poses: &[Pose2], (speed_mps, status): (f64, PlanStatus)) -> Plan {
    let driven_mps = request.start.speed_mps.max(TIMED_MPS);
    let mut at = request.start.stamp;
    let mut points: Vec<PlanPoint> = Vec::with_capacity(poses.len());
    for p in with_curvature(poses) {
        if let Some(last) = points.last() {
            let gap_m = last.pose.point().distance(p.pose.point());
            at += Span::from_secs(gap_m / driven_mps).max(Span::from_ns(1));
        }
        let PlanPoint { accel_mps2, .. } = PlanPoint::default();
        points.push(PlanPoint { at, pose: p.pose, curvature_1pm: p.curvature_1pm, speed_mps, accel_mps2 });
    }
    Plan { stamp: request.stamp, status, points, work: 0 }
}

/// Poses along the straight lines between points; the last has the heading of the line before it.
pub(crate) fn headed(points: &[Point2], start: Pose2, path: &mut Vec<Pose2>) {
    path.clear();
    let mut heading_rad = start.heading_rad;
    for (i, point) in points.iter().enumerate() {
        if let Some(next) = points.get(i + 1)
            && *next != *point
        {
            heading_rad = (*next - *point).heading();
        }
        path.push(Pose2::new(point.x_m, point.y_m, heading_rad));
    }
}

#[cfg(test)]
mod tests {
    use swerve_planning::testing::World;

    use super::*;
    use crate::{Era, Original};

    fn rules(fallback: Fallback) -> Rules {
        Rules { fallback, ..Rules::of(Era::May2020, Original::RrtStar) }
    }

    #[test]
    fn fallback_rule_selects_the_plan_if_no_path_is_found() {
        let mut world = World::straight(10.0);
        let request = world.request();
        let speeds = |plan: &Plan| plan.points.iter().map(|p| p.speed_mps).fold(0.0, f64::max);
        let stop = nothing_found(&request, &rules(Fallback::StopOnRoute));
        assert_eq!((stop.status, speeds(&stop)), (PlanStatus::Stop, 0.0));
        let regardless = nothing_found(&request, &rules(Fallback::FollowRoute));
        assert_eq!((regardless.status, speeds(&regardless)), (PlanStatus::GaveUp, 10.0));
        assert_eq!(nothing_found(&request, &rules(Fallback::StopOnLastPlan)).status, PlanStatus::Stop);
        // The last plan led to the left: the rest of it, at speed zero.
        let aside: Vec<Pose2> = (0..20).map(|k| Pose2::new(f64::from(k), 1.5, 0.0)).collect();
        let last = timed(&request, &aside, (10.0, PlanStatus::Found));
        world.start.pose = Pose2::new(5.2, 1.4, 0.0);
        let along = Request { previous: Some(&last), ..world.request() };
        let along = nothing_found(&along, &rules(Fallback::StopOnLastPlan));
        assert_eq!((along.status, speeds(&along), along.points.len()), (PlanStatus::Brake, 0.0, 15));
        assert_eq!(along.points[0].pose.point(), Point2::new(5.0, 1.5));
    }

    #[test]
    fn plan_is_of_the_ego_origin_for_any_planned_point() {
        let world = World::straight(10.0);
        for middle_of_car in [true, false] {
            let first = |whole_metres| {
                let rules = Rules { middle_of_car, whole_metres, ..rules(Fallback::StopOnRoute) };
                along_route(&world.request(), &rules, 10.0, PlanStatus::Route).points[0].pose.x_m
            };
            let ahead_m = if middle_of_car { world.shape.center_ahead_m() } else { 0.0 };
            assert!(first(false).abs() < 1e-9);
            assert!((first(true) - (ahead_m.round() - ahead_m)).abs() < 1e-9);
        }
    }
}
