//! Worlds and the conformance suite for planner tests, also in other crates.

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline, Pose2};
use swerve_map::{Border, Borders, Station};
use swerve_msg::{
    ActorId, ActorKind, EgoState, Extent, Plan, PlanPoint, PlanStatus, PredictedPose, Prediction, Route,
};
use swerve_vehicle::{Limits, Shape};

use crate::collision::{CollisionMode, Obstacles};
use crate::request::{Budget, Planner, Progress, Request, Unlimited};

/// Owner of the data that a request refers to.
pub struct World {
    /// Route to follow.
    pub route: Route,
    /// Predicted motions of other road users.
    pub predictions: Vec<Prediction>,
    /// Outline of the ego.
    pub shape: Shape,
    /// Limits of the ego.
    pub limits: Limits,
    /// State of the ego.
    pub start: EgoState,
    /// Target speed, m/s.
    pub target_speed_mps: f64,
}

impl World {
    /// A straight road along x with 6 m to the left and 2 m to the right; the ego at the origin.
    pub fn straight(speed_mps: f64) -> Self {
        let line: Vec<Point2> = (-30..200).map(|x| Point2::new(f64::from(x), 0.0)).collect();
        Self::on(&line, speed_mps)
    }

    /// A road through `points`; the ego starts at its nearest place to the origin.
    pub fn on(points: &[Point2], speed_mps: f64) -> Self {
        let line = Polyline::new(points).expect("a test's points make a line");
        let pose = line.at(line.project(Point2::new(0.0, 0.0)).s_m).pose;
        Self {
            route: Route::uniform(line, 6.0, 2.0),
            predictions: Vec::new(),
            shape: Shape::default(),
            limits: Limits::default(),
            start: EgoState { stamp: Time::from_ms(1000), pose, speed_mps, ..EgoState::default() },
            target_speed_mps: speed_mps,
        }
    }

    /// A left-hand bend of the given radius.
    pub fn bend(radius_m: f64, speed_mps: f64) -> Self {
        let points: Vec<Point2> = (-20..150)
            .map(|k| {
                let (sin, cos) = swerve_geom::math::sin_cos(f64::from(k) / radius_m);
                Point2::new(radius_m * sin, radius_m * (1.0 - cos))
            })
            .collect();
        Self::on(&points, speed_mps)
    }

    /// Narrows the left border to `left_m` on the straight road: it moves in from x = 15 to 25 m and out again from x =
    /// 45 to 55 m.
    #[must_use]
    pub(crate) fn narrowing(mut self, left_m: f64) -> Self {
        let stations = [(45.0, 6.0), (55.0, left_m), (75.0, left_m), (85.0, 6.0)];
        let station = |(s_m, distance_m)| Station { s_m, distance_m };
        let left = Border::linear(&stations.map(station)).expect("stations in their order make a border");
        self.route = Route::new(self.route.line().clone(), Borders::new(left, Border::constant(2.0)));
        self
    }

    /// Adds a road user of the given size that moves steadily from `from` at `velocity_mps`.
    #[must_use]
    pub fn with(
        mut self,
        kind: ActorKind,
        size: (f64, f64),
        from: (f64, f64),
        velocity_mps: (f64, f64),
    ) -> Self {
        let path = (0..=50)
            .map(|k| {
                let t = f64::from(k) * 0.1;
                let (x, y) = (from.0 + velocity_mps.0 * t, from.1 + velocity_mps.1 * t);
                PredictedPose { at: self.start.stamp + Span::from_secs(t), pose: Pose2::new(x, y, 0.0) }
            })
            .collect();
        let id = ActorId(self.predictions.len() as u32 + 1);
        let extent = Extent { length_m: size.0, width_m: size.1, height_m: 1.8 };
        self.predictions.push(Prediction::single(id, kind, extent, path));
        self
    }

    /// Adds a pedestrian of half a metre.
    #[must_use]
    pub fn with_person(self, from: (f64, f64), velocity_mps: (f64, f64)) -> Self {
        self.with(ActorKind::Pedestrian, (0.5, 0.5), from, velocity_mps)
    }

    /// A person walks into the lane from behind an oncoming truck, first seen `late_s` ago 21.2 m ahead.
    pub fn person_stepping_out(speed_mps: f64, late_s: f64) -> Self {
        let driven_m = speed_mps * late_s;
        Self::straight(speed_mps)
            .with(ActorKind::Truck, (5.2, 2.6), (14.2 - driven_m, 4.0), (0.0, 0.0))
            .with_person((21.2 - driven_m, 3.67 - 2.75 * late_s), (0.0, -2.75))
    }

    /// The request to a planner in this world.
    pub fn request(&self) -> Request<'_> {
        Request {
            stamp: self.start.stamp,
            start: self.start,
            route: &self.route,
            along_m: None,
            target_speed_mps: self.target_speed_mps,
            overtake_max_m: f64::INFINITY,
            changed_lately: &[],
            predictions: &self.predictions,
            shape: &self.shape,
            limits: &self.limits,
            previous: None,
            seed: 7,
        }
    }

    /// Smallest distance of the plan's outline to any obstacle, metres.
    pub fn clearance_m(&self, plan: &Plan, mode: CollisionMode) -> f64 {
        let path: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, p.at)).collect();
        Obstacles::new(&self.predictions, mode).path_clearance_m(
            |pose| self.shape.footprint(pose),
            &path,
            0.05,
        )
    }

    /// Smallest margin of the plan's outline on the road, metres.
    pub fn margin_m(&self, plan: &Plan) -> f64 {
        plan.points
            .iter()
            .map(|p| self.route.margin_m(&self.shape.footprint(p.pose)))
            .fold(f64::INFINITY, f64::min)
    }
}

/// A budget that stops after a number of units.
pub struct Capped {
    left: u64,
    /// Units spent so far.
    pub spent: u64,
    /// True if it was asked again after it had returned stop.
    pub asked_after_stop: bool,
}

impl Capped {
    /// Creates a budget of this many units.
    pub fn new(units: u64) -> Self {
        Self { left: units, spent: 0, asked_after_stop: false }
    }
}

impl Budget for Capped {
    fn spend(&mut self, units: u64) -> Progress {
        self.asked_after_stop |= self.left == 0;
        self.spent += units;
        self.left = self.left.saturating_sub(units);
        if self.left == 0 { Progress::Stop } else { Progress::Continue }
    }
}

/// Conformance suite of planners: checks form, determinism, counted work and early stops in eleven worlds, from an
/// empty road to a blocked one. `make` builds a fresh planner; with `drivable`, plans that were found must also start at the
/// state, stay collision-free and on the road, and keep the limits of the vehicle.
///
/// # Panics
/// If a check fails.
pub fn conformance<P: Planner>(make: &dyn Fn() -> P, drivable: bool) {
    for (name, world) in worlds() {
        let request = world.request();
        let mut counted = Unlimited::default();
        let plan = make().plan(&request, &mut counted);
        check_form(name, &plan, &request);
        check_work(name, &plan, counted.spent);
        let again = make().plan(&request, &mut Unlimited::default());
        let differ = "expected the same plan for the same request";
        assert!(plan == again, "{name}: {differ}, from two new planners; found {plan:?} and {again:?}");
        let mut reused = make();
        reused.plan(&request, &mut Unlimited::default());
        let second = reused.plan(&request, &mut Unlimited::default());
        assert!(plan == second, "{name}: {differ}, in the second call; found {plan:?} and {second:?}");
        bounded_work(name, make, &request, counted.spent);
        if drivable && plan.status == PlanStatus::Found {
            let (first, start) = (plan.points[0], &request.start);
            let from_m = first.pose.point().distance(start.pose.point());
            assert!(
                from_m < 0.3,
                "{name}: expected a first point at most 0.3 m from the start state, found {from_m} m"
            );
            let clearance_m = world.clearance_m(&plan, CollisionMode::TimeIndexed);
            assert!(
                clearance_m > 0.0,
                "{name}: expected a plan with the status `Found` to touch no road user, found a clearance of {clearance_m} m"
            );
            let margin_m = world.margin_m(&plan);
            assert!(
                margin_m > -0.02,
                "{name}: expected a plan with the status `Found` to stay on the road, found {} m beyond its edge",
                -margin_m
            );
            within_limits(name, &plan, &world.limits);
        }
    }
}

/// Checks that a planner yields with [`CollisionMode::MayStop`]; `make` builds one with the given mode.
///
/// # Panics
/// If it does not yield.
pub fn yields_to_pedestrians<P: Planner>(make: &dyn Fn(CollisionMode) -> P) {
    conformance(&|| make(CollisionMode::MayStop), true);
    let plan = |world: &World, mode| make(mode).plan(&world.request(), &mut Unlimited::default());
    // She will have crossed when the ego arrives, unless she stops in its path.
    let crossing = World::straight(12.0).with_person((29.0, 3.5), (0.0, -3.5));
    let trusting = plan(&crossing, CollisionMode::TimeIndexed);
    assert!(crossing.clearance_m(&trusting, CollisionMode::MayStop) == 0.0);
    let careful = plan(&crossing, CollisionMode::MayStop);
    assert!(crossing.clearance_m(&careful, CollisionMode::MayStop) > 0.25, "{careful:?}");
    assert!(careful.points.iter().all(|p| p.accel_mps2 > -0.75 * crossing.limits.brake_max_mps2 - 0.05));
    // People who walk away from the lane, or along it, must not slow the ego.
    for (from, velocity_mps) in [((25.0, -2.5), (0.0, -1.5)), ((20.0, 5.0), (-1.5, 0.0))] {
        let away = World::straight(12.0).with_person(from, velocity_mps);
        let plan = plan(&away, CollisionMode::MayStop);
        assert!(plan.points.iter().all(|p| p.speed_mps > 11.4), "{from:?}");
    }
    // No stop is possible: she is taken as predicted, which leaves a gap.
    for speed_mps in [16.0, 20.0] {
        let sudden = World::person_stepping_out(speed_mps, 0.05);
        let plans = [CollisionMode::MayStop, CollisionMode::TimeIndexed].map(|mode| plan(&sudden, mode));
        assert_eq!(plans[0].points, plans[1].points);
    }
}

/// Checks that a planner keeps the ego's own lane before an oncoming car that strays into it; `make` builds a planner
/// with a clearance above 0.07 m.
///
/// The ego drives 1 m to the right of the centre of its lane, 4 m wide. An oncoming car of 1.8 m drives 0.9 m to the
/// left of it: the gap is 0.9 - 0.9 - (-1 + 0.93) = 0.07 m. To the left of the car the ground is free from 1.8 m to 6
/// m.
///
/// # Panics
/// If the planner leaves its lane.
pub fn keeps_its_lane<P: Planner>(make: &dyn Fn() -> P) {
    let goes = |along_mps: f64, from_m: f64| {
        let mut world =
            World::straight(12.0).with(ActorKind::Car, (4.5, 1.8), (from_m, 0.9), (along_mps, 0.0));
        world.route = world.route.in_lane(Borders::constant(2.0, 2.0));
        world.start.pose = Pose2::new(0.0, -1.0, 0.0);
        let on = |k: i64| PlanPoint {
            at: world.start.stamp + Span::from_ms(100) * k,
            pose: world.start.pose.ahead(1.2 * k as f64),
            speed_mps: 12.0,
            ..PlanPoint::default()
        };
        let previous = Plan { points: (0..50).map(on).collect(), ..Plan::default() };
        let request = Request { previous: Some(&previous), ..world.request() };
        let plan = make().plan(&request, &mut Unlimited::default());
        assert!(world.clearance_m(&plan, CollisionMode::TimeIndexed) > 0.05, "{plan:?}");
        plan.points.iter().map(|p| p.pose.y_m).fold(f64::NEG_INFINITY, f64::max)
    };
    let (oncoming_m, standing_m) = (goes(-12.0, 60.0), goes(0.0, 30.0));
    assert!(oncoming_m + 0.93 < 2.3, "own lane before oncoming traffic: {oncoming_m}");
    assert!(standing_m - 0.93 > 1.8, "to the left of a standing car: {standing_m}");
}

fn worlds() -> Vec<(&'static str, World)> {
    let mut hemmed = World::straight(15.0);
    for y in [-1.5, 1.0, 3.5, 6.0] {
        hemmed = hemmed.with(ActorKind::Car, (4.5, 2.0), (18.0, y), (0.0, 0.0));
    }
    let stub = World::on(&[Point2::new(0.0, 0.0), Point2::new(0.5, 0.0)], 8.0);
    let person_ahead = |speed_mps| World::straight(speed_mps).with_person((35.0, 0.0), (0.0, 0.0));
    let mut touching = World::straight(10.0).with_person((3.5, 0.0), (0.0, 0.0));
    touching.start.yaw_rate_radps = 0.2;
    vec![
        ("empty", World::straight(15.0)),
        ("standing", World::straight(0.0)),
        ("person ahead", person_ahead(16.0)),
        ("person crossing", World::straight(16.0).with_person((30.0, 4.5), (0.0, -2.75))),
        (
            "car ahead standing",
            World::straight(0.0).with(ActorKind::Car, (4.5, 1.9), (15.0, 0.5), (0.0, 0.0)),
        ),
        ("hemmed in", hemmed),
        ("bend", World::bend(40.0, 10.0).with_person((20.0, 8.0), (0.0, 0.0))),
        ("very short route", stub),
        ("already touching", touching),
        ("way round in a narrow place", person_ahead(16.0).narrowing(3.2)),
        ("no way round in a narrow place", person_ahead(16.0).narrowing(1.6)),
    ]
}

fn check_work(name: &str, plan: &Plan, spent: u64) {
    let work = plan.work;
    assert!(
        work == spent,
        "{name}: expected `plan.work` to be the number of units passed to `budget.spend`, {spent}; found {work}"
    );
}

fn check_form(name: &str, plan: &Plan, request: &Request<'_>) {
    let (found, stamp) = (plan.stamp, request.stamp);
    assert!(
        found == stamp,
        "{name}: expected `plan.stamp` to be `request.stamp`, {stamp:?}; found {found:?}"
    );
    assert!(!plan.points.is_empty(), "{name}: expected at least one point in the plan, found none");
    let (first, start) = (plan.points[0].at, request.start.stamp);
    assert!(
        first >= start,
        "{name}: expected the first point at or after the start, {start:?}; found {first:?}"
    );
    for pair in plan.points.windows(2) {
        let [a, b] = [pair[0].at, pair[1].at];
        assert!(a < b, "{name}: expected points at increasing instants, found {a:?} before {b:?}");
    }
    for p in &plan.points {
        let finite = p.pose.is_finite()
            && p.curvature_1pm.is_finite()
            && p.speed_mps.is_finite()
            && p.accel_mps2.is_finite();
        assert!(finite, "{name}: expected finite numbers in every point, found {p:?}");
        assert!(p.speed_mps >= -1e-6, "{name}: expected no negative speed, found {p:?}");
    }
}

fn bounded_work<P: Planner>(name: &str, make: &dyn Fn() -> P, request: &Request<'_>, full: u64) {
    for units in [1, full / 3, full] {
        if units == 0 {
            continue;
        }
        let mut capped = Capped::new(units);
        let plan = make().plan(request, &mut capped);
        let name = &format!("{name}, with a budget of {units} units");
        check_form(name, &plan, request);
        assert!(
            !capped.asked_after_stop,
            "{name}: expected no call of `budget.spend` after it returned `Progress::Stop`, found one"
        );
        check_work(name, &plan, capped.spent);
    }
}

fn within_limits(name: &str, plan: &Plan, limits: &Limits) {
    let curvature_max = swerve_geom::math::tan(limits.steering_max_rad) / Shape::default().wheelbase_m;
    for p in &plan.points {
        let lateral = p.curvature_1pm.abs() * p.speed_mps * p.speed_mps;
        let check = |what: &str, found: f64, [least, most]: [f64; 2]| {
            assert!(
                (least..=most).contains(&found),
                "{name}: expected {what} within the vehicle's limits, {least} to {most}; found {found} at {p:?}"
            );
        };
        check("a lateral acceleration, m/s2,", lateral, [0.0, limits.lateral_accel_max_mps2 * 1.05 + 0.05]);
        check("a curvature, 1/m,", p.curvature_1pm.abs(), [0.0, curvature_max * 1.02 + 1e-6]);
        let accels = [-limits.brake_max_mps2 - 0.05, limits.accel_max_mps2 + 0.05];
        check("an acceleration, m/s2,", p.accel_mps2, accels);
    }
}

/// Distance travelled until `t_s` by a vehicle that brakes to a stop from `speed_mps` with `brake_mps2` from `from_s`
/// on, metres.
pub fn braking_m(speed_mps: f64, brake_mps2: f64, from_s: f64, t_s: f64) -> f64 {
    let braking_s = (t_s - from_s).clamp(0.0, speed_mps / brake_mps2);
    let moving_s = t_s.min(from_s + speed_mps / brake_mps2);
    speed_mps * moving_s - 0.5 * brake_mps2 * braking_s * braking_s
}

/// The minimum constant deceleration, starting `reaction_s` after the lead vehicle's, that leaves `rest_m` of the gap,
/// m/s², in steps of 0.05; infinite above 20. Both drive at `speed_mps` before.
pub fn least_braking_mps2(speed_mps: f64, brake_mps2: f64, gap_m: f64, reaction_s: f64, rest_m: f64) -> f64 {
    let keeps = |own_mps2: f64| {
        (0..4000).map(|k| 0.01 * f64::from(k)).all(|t_s| {
            let lead_m = braking_m(speed_mps, brake_mps2, 0.0, t_s);
            gap_m + lead_m - braking_m(speed_mps, own_mps2, reaction_s, t_s) >= rest_m
        })
    };
    (1..400).map(|k| 0.05 * f64::from(k)).find(|own_mps2| keeps(*own_mps2)).unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::route::follow_route;
    use crate::path::speed::SpeedProfile;

    /// Follows the route and reports `work` for each unit spent.
    struct Miscounting {
        work: u64,
    }

    impl Planner for Miscounting {
        fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
            budget.spend(1);
            let plan = follow_route(request, SpeedProfile::Limited, 5.0, PlanStatus::Route);
            Plan { work: self.work, ..plan }
        }
    }

    #[test]
    fn conformance_reports_the_expected_and_the_found_value() {
        conformance(&|| Miscounting { work: 1 }, false);
        let failed =
            std::panic::catch_unwind(|| conformance(&|| Miscounting { work: 0 }, false)).unwrap_err();
        assert_eq!(
            failed.downcast_ref::<String>().unwrap(),
            "empty: expected `plan.work` to be the number of units passed to `budget.spend`, 1; found 0"
        );
    }
}
