//! The path to follow, by arc length: the plan, continued along the route where the plan ends.

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Pose2, angle_between};
use swerve_msg::{Plan, PlanPoint, Route};

/// Spacing of the points that continue a plan along the route, metres.
const ROUTE_STEP_M: f64 = 1.0;

/// Search radius for the place of a path's end along the route, metres.
const ROUTE_REACH_M: f64 = 15.0;

/// A path by arc length, extended straight before its first and beyond its last point; before the first point its
/// curvature already applies.
///
/// Buffers are kept between loads, so that a steady state allocates nothing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reference {
    points: Vec<PlanPoint>,
    s_m: Vec<f64>,
    /// Number of points from the plan; the points after them follow the route.
    planned: usize,
}

impl Reference {
    /// Loads the points of `plan`.
    pub(crate) fn load_plan(&mut self, plan: &Plan) {
        self.clear();
        for &point in &plan.points {
            self.push(point);
        }
        self.planned = self.points.len();
    }

    /// Loads the route at `speed_mps` from arc length `s_m` on, which is reached at `now`.
    pub(crate) fn load_route(&mut self, route: &Route, s_m: f64, speed_mps: f64, now: Time) {
        self.clear();
        self.push(on_route(route, s_m, 0.0, speed_mps, now));
        self.planned = 1;
    }

    /// Appends points along the route, at the offset from its line at which the path ends, until the path reaches at
    /// least `until_m`; they keep the last speed. `route_m` is the arc length of the route near the path's beginning.
    pub(crate) fn extend(&mut self, route: &Route, route_m: f64, until_m: f64) {
        let Some(&last) = self.points.last() else { return };
        let missing_m = until_m - self.length();
        if missing_m <= 0.0 {
            return;
        }
        // Along the route, the path's end is no further than the path's length, apart from shortcuts in bends.
        let half_m = 0.6 * self.length();
        let from = route.project_near(last.pose.point(), route_m + half_m, half_m + ROUTE_REACH_M);
        let speed = last.speed_mps.max(0.0);
        let per_step = Span::from_secs(ROUTE_STEP_M / speed.max(0.1));
        let steps = (missing_m / ROUTE_STEP_M).ceil() as i64;
        for k in 1..=steps {
            let s_m = from.s_m + ROUTE_STEP_M * k as f64;
            let at = last.at.saturating_add(per_step * k);
            self.push(on_route(route, s_m, from.d_m, speed, at));
        }
    }

    fn clear(&mut self) {
        self.points.clear();
        self.s_m.clear();
        self.planned = 0;
    }

    fn push(&mut self, point: PlanPoint) {
        let s_m = match (self.points.last(), self.s_m.last()) {
            (Some(last), Some(s_m)) => s_m + last.pose.point().distance(point.pose.point()),
            _ => 0.0,
        };
        self.points.push(point);
        self.s_m.push(s_m);
    }

    /// Arc length of the last point, metres.
    pub(crate) fn length(&self) -> f64 {
        self.s_m.last().copied().unwrap_or(0.0)
    }

    /// Arc length of the nearest place to `point`, metres: negative before the first point, beyond the length after the
    /// last.
    pub(crate) fn project(&self, point: Point2) -> f64 {
        self.project_near(point, 0.0, f64::INFINITY)
    }

    /// As [`project`](Self::project), limited to arc lengths within `reach_m` of `near_m`.
    pub(crate) fn project_near(&self, point: Point2, near_m: f64, reach_m: f64) -> f64 {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else { return 0.0 };
        let before_m = first.pose.direction().dot(point - first.pose.point());
        let beyond_m = last.pose.direction().dot(point - last.pose.point());
        // The straight continuations, then every segment.
        let mut best = (f64::INFINITY, 0.0);
        let mut offer = |place: Point2, s_m: f64| {
            let off = (point - place).norm_squared();
            if off < best.0 && (s_m - near_m).abs() <= reach_m {
                best = (off, s_m);
            }
        };
        offer(first.pose.ahead(before_m.min(0.0)).point(), before_m.min(0.0));
        offer(last.pose.ahead(beyond_m.max(0.0)).point(), self.length() + beyond_m.max(0.0));
        for (pair, s_m) in self.points.windows(2).zip(self.s_m.windows(2)) {
            let (a, b) = (pair[0].pose.point(), pair[1].pose.point());
            let squared = (b - a).norm_squared();
            if squared > 0.0 {
                let t = ((point - a).dot(b - a) / squared).clamp(0.0, 1.0);
                offer(a + (b - a) * t, s_m[0] + (s_m[1] - s_m[0]) * t);
            }
        }
        if best.0.is_finite() { best.1 } else { near_m }
    }

    /// The path at arc length `s_m`; `None` if it has no points.
    pub(crate) fn at(&self, s_m: f64) -> Option<PlanPoint> {
        let after = self.s_m.partition_point(|&s| s <= s_m);
        let first = self.points.first()?;
        if after == 0 {
            return Some(PlanPoint { pose: first.pose.ahead(s_m), ..*first });
        }
        let a = &self.points[after - 1];
        let Some(b) = self.points.get(after) else {
            let beyond_m = s_m - self.s_m[after - 1];
            let curvature_1pm = if beyond_m > 0.0 { 0.0 } else { a.curvature_1pm };
            return Some(PlanPoint { pose: a.pose.ahead(beyond_m), curvature_1pm, ..*a });
        };
        let t = (s_m - self.s_m[after - 1]) / (self.s_m[after] - self.s_m[after - 1]);
        Some(mix(a, b, t))
    }

    /// Arc length of the path at `instant`, metres: before its first point extrapolated at constant speed, after its
    /// end the last point.
    pub(crate) fn s_at(&self, instant: Time) -> f64 {
        let after = self.points.partition_point(|p| p.at <= instant);
        if after == 0 {
            return self.points.first().map_or(0.0, |p| p.speed_mps * (instant - p.at).as_secs());
        }
        if after == self.points.len() {
            return self.length();
        }
        let (a, b) = (self.points[after - 1].at, self.points[after].at);
        let t = (instant - a).as_secs() / (b - a).as_secs();
        self.s_m[after - 1] + (self.s_m[after] - self.s_m[after - 1]) * t
    }

    /// Pylot's waypoint: the first point after arc length `passed_m` that is at least `min_m` away from `from`,
    /// otherwise the last point. `None` if the path has no points.
    pub(crate) fn waypoint(&self, from: Point2, passed_m: f64, min_m: f64) -> Option<&PlanPoint> {
        let first = self.s_m.partition_point(|&s| s <= passed_m);
        let ahead = &self.points[first..];
        ahead.iter().find(|p| p.pose.point().distance(from) >= min_m).or(self.points.last())
    }
}

fn on_route(route: &Route, s_m: f64, d_m: f64, speed_mps: f64, at: Time) -> PlanPoint {
    let on_line = route.line().at(s_m);
    let point = on_line.pose.point() + on_line.pose.direction().left() * d_m;
    let curvature_1pm = on_line.curvature_1pm / (1.0 - on_line.curvature_1pm * d_m).max(0.1);
    let pose = Pose2::new(point.x_m, point.y_m, on_line.pose.heading_rad);
    PlanPoint { at, pose, curvature_1pm, speed_mps, accel_mps2: 0.0 }
}

fn mix(a: &PlanPoint, b: &PlanPoint, t: f64) -> PlanPoint {
    let mix = |a: f64, b: f64| a + (b - a) * t;
    let turn = angle_between(a.pose.heading_rad, b.pose.heading_rad);
    PlanPoint {
        at: a.at + Span::from_secs((b.at - a.at).as_secs() * t),
        pose: Pose2::new(
            mix(a.pose.x_m, b.pose.x_m),
            mix(a.pose.y_m, b.pose.y_m),
            a.pose.heading_rad + turn * t,
        ),
        curvature_1pm: mix(a.curvature_1pm, b.curvature_1pm),
        speed_mps: mix(a.speed_mps, b.speed_mps),
        accel_mps2: mix(a.accel_mps2, b.accel_mps2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_geom::Polyline;

    fn route() -> Route {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(200.0, 0.0)]).unwrap();
        Route::uniform(line, 6.0, 2.0)
    }

    /// Points every 2 m along y = 1 from x = 10, one every 0.2 s.
    fn plan(n: i64) -> Plan {
        let points = (0..n)
            .map(|k| PlanPoint {
                at: Time::from_ms(200 * k),
                pose: Pose2::new(10.0 + 2.0 * k as f64, 1.0, 0.0),
                speed_mps: 10.0,
                ..Default::default()
            })
            .collect();
        Plan { points, ..Default::default() }
    }

    fn loaded(n: i64) -> Reference {
        let mut reference = Reference::default();
        reference.load_plan(&plan(n));
        reference
    }

    #[test]
    fn reference_projects_before_on_and_beyond_the_path() {
        let reference = loaded(6);
        for (x, want) in [(7.0, -3.0), (13.5, 3.5), (25.0, 15.0)] {
            assert!((reference.project(Point2::new(x, 3.0)) - want).abs() < 1e-12, "{x}");
            let back = reference.at(want).unwrap().pose;
            assert!((back.x_m - x).abs() < 1e-12 && back.y_m == 1.0);
        }
    }

    #[test]
    fn instants_and_arc_lengths_agree() {
        let reference = loaded(6);
        assert!((reference.s_at(Time::from_ms(300)) - 3.0).abs() < 1e-12);
        assert!((reference.s_at(Time::from_ms(-50)) + 0.5).abs() < 1e-12, "half a metre before the start");
        assert_eq!(reference.s_at(Time::from_ms(9000)), 10.0);
        assert_eq!(reference.at(3.0).unwrap().at, Time::from_ms(300));
    }

    #[test]
    fn path_continues_along_the_route_at_the_same_offset() {
        let mut reference = loaded(6);
        reference.extend(&route(), 10.0, 50.0);
        assert!(reference.length() >= 50.0 - 1e-9);
        let at = reference.at(45.5).unwrap();
        assert!((at.pose.x_m - 55.5).abs() < 1e-9 && (at.pose.y_m - 1.0).abs() < 1e-9);
        assert_eq!(at.speed_mps, 10.0);
    }

    #[test]
    fn path_of_one_point_is_a_straight_line_and_empty_path_has_no_pose() {
        let one = loaded(1);
        assert_eq!(one.project(Point2::new(14.0, 0.0)), 4.0);
        assert_eq!(one.at(-3.0).unwrap().pose.x_m, 7.0);
        let none = Reference::default();
        assert!(none.at(0.0).is_none() && none.waypoint(Point2::new(0.0, 0.0), 0.0, 5.0).is_none());
        assert_eq!(none.project(Point2::new(1.0, 1.0)), 0.0);
    }

    #[test]
    fn repeated_points_do_not_divide_by_zero() {
        let mut standing = plan(3);
        for point in &mut standing.points {
            point.pose = Pose2::new(10.0, 1.0, 0.0);
        }
        let mut reference = Reference::default();
        reference.load_plan(&standing);
        assert_eq!(reference.project(Point2::new(12.0, 1.0)), 2.0);
        assert_eq!(reference.at(0.0).unwrap().pose.x_m, 10.0);
    }

    #[test]
    fn the_waypoint_is_ahead_and_far_enough() {
        let reference = loaded(6);
        let ego = Point2::new(13.0, 1.0);
        assert_eq!(reference.waypoint(ego, 3.0, 5.0).unwrap().pose.x_m, 18.0);
        assert_eq!(reference.waypoint(ego, 3.0, 99.0).unwrap().pose.x_m, 20.0);
    }
}
