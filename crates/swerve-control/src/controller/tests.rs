use super::*;
use crate::SlipParams;
use crate::bicycle::{self, DRIVE, curve, ego, lane_change, road, slalom};
use swerve_geom::{Point2, Polyline, Pose2};
use swerve_map::{Border, Borders, Station};

/// Control period: as in a vehicle, and longer for the law that takes longer to test.
fn tick(law: Law) -> Span {
    Span::from_ms(if law == Law::Mpc { 50 } else { 10 })
}

const LAWS: [Law; 4] = [Law::Pid, Law::PurePursuit, Law::Stanley, Law::Mpc];

fn controller(params: Params) -> LawController {
    LawController::new(params, Shape::default(), Limits::default(), Box::new(DRIVE))
}

/// A run: the states, one per tick, and the last output.
fn run(
    params: Params,
    start: EgoState,
    plan: Option<&Plan>,
    route: &Route,
    seconds: f64,
) -> (Vec<EgoState>, Output) {
    let mut controller = controller(params);
    let mut state = start;
    let mut states = Vec::new();
    let mut last = None;
    let end = start.stamp + Span::from_secs(seconds);
    while state.stamp < end {
        let output = controller.step(&Input { now: state.stamp, ego: &state, plan, route });
        bicycle::drive(&mut state, output.command, tick(params.law));
        states.push(state);
        last = Some(output);
    }
    (states, last.unwrap())
}

/// Largest distance from the plan's path, metres, and worst lag in time, metres.
fn errors(states: &[EgoState], plan: &Plan) -> (f64, f64) {
    let points: Vec<Point2> = plan.points.iter().map(|p| p.pose.point()).collect();
    let line = Polyline::smooth(&points, 0.05).unwrap();
    let mut near = 0.0;
    states.iter().fold((0.0, 0.0), |(cross, lag): (f64, f64), state| {
        let at = line.project_near(state.pose.point(), near, 20.0);
        near = at.s_m;
        let due = line.project_near(plan.at(state.stamp).unwrap().pose.point(), near, 20.0).s_m;
        (cross.max(at.d_m.abs()), lag.max((due - at.s_m).abs()))
    })
}

/// Parameters for the bicycle of these tests, which has neither lag nor slip.
fn law(law: Law, following: Following) -> Params {
    let mut params = Params { law, following, ..Params::default() };
    params.slip = SlipParams::NONE;
    (params.pure_pursuit.preview_s, params.stanley.preview_s, params.stanley.yaw_damping_s) = (0.0, 0.0, 0.0);
    params.mpc.lead_s = params.mpc.dt_s;
    params
}

#[test]
fn every_law_returns_to_a_straight_path_from_a_metre_beside_it() {
    let plan = curve(|_| (0.0, 0.0, 0.0), 10.0, 12.0);
    for (law_, settle_s, overshoot_m) in [
        (Law::Pid, 3.0, 0.10),
        (Law::PurePursuit, 4.0, 0.10),
        (Law::Stanley, 4.0, 0.05),
        (Law::Mpc, 4.0, 0.10),
    ] {
        for side in [1.0, -1.0] {
            let start = ego(Pose2::new(0.0, side, 0.0), 10.0);
            let (states, _) = run(law(law_, Following::Projection), start, Some(&plan), &road(), 10.0);
            let over = states.iter().map(|s| -side * s.pose.y_m).fold(0.0, f64::max);
            let late = states
                .iter()
                .filter(|s| s.pose.y_m.abs() > 0.05)
                .map(|s| s.stamp.as_secs())
                .fold(0.0, f64::max);
            eprintln!("{law_:?}: overshoot {over:.3} m, within 5 cm after {late:.2} s");
            assert!(over < overshoot_m && late < settle_s, "{law_:?}");
        }
    }
}

#[test]
fn laws_track_the_slalom_at_10() {
    let plan = curve(slalom, 10.0, 20.0);
    let start = ego(plan.points[0].pose, 10.0);
    let wide = Route::uniform(road().line().clone(), 6.0, 6.0);
    for (law_, following, bound_m) in [
        (Law::Pid, Following::Projection, 0.05),
        (Law::PurePursuit, Following::Projection, 0.01),
        (Law::Stanley, Following::Projection, 0.01),
        (Law::PurePursuit, Following::Time, 0.01),
        (Law::Mpc, Following::Projection, 0.05),
        (Law::Mpc, Following::Time, 0.05),
        (Law::Stanley, Following::Time, 0.01),
    ] {
        let start = EgoState { steering_rad: 0.0, ..start };
        let (states, output) = run(law(law_, following), start, Some(&plan), &wide, 19.5);
        let (cross, lag) = errors(&states, &plan);
        eprintln!("{law_:?} {following:?}: cross-track {cross:.3} m, lag {lag:.3} m");
        assert_eq!(output.status, Status::Plan);
        assert!(cross < bound_m, "{law_:?} {following:?}: {cross}");
        if following == Following::Time {
            assert!(lag < 0.05, "{law_:?}: {lag}");
        }
    }
}

#[test]
fn laws_change_lane_at_20() {
    let plan = curve(lane_change, 20.0, 8.0);
    let start = ego(Pose2::new(0.0, 0.0, 0.0), 20.0);
    for (law_, bound_m) in
        [(Law::Pid, 0.05), (Law::PurePursuit, 0.01), (Law::Stanley, 0.01), (Law::Mpc, 0.05)]
    {
        let (states, _) = run(law(law_, Following::Time), start, Some(&plan), &road(), 7.5);
        let (cross, _) = errors(&states, &plan);
        eprintln!("{law_:?}: cross-track {cross:.3} m");
        assert!(cross < bound_m, "{law_:?}: {cross}");
    }
}

#[test]
fn controller_follows_the_route_at_the_first_speed_before_any_plan() {
    for law_ in LAWS {
        let start = ego(Pose2::new(0.0, 0.5, 0.0), 12.0);
        let (states, output) = run(law(law_, Following::Time), start, None, &road(), 6.0);
        let end = states.last().unwrap();
        assert_eq!(output.status, Status::Route);
        assert!(end.pose.y_m.abs() < 0.05 && (end.speed_mps - 12.0).abs() < 0.1, "{law_:?}: {end:?}");
    }
}

#[test]
fn an_expired_plan_brings_a_comfortable_stop_beside_the_route() {
    let mut plan = curve(|_| (1.5, 0.0, 0.0), 10.0, 2.0);
    plan.stamp = Time::ZERO;
    for law_ in LAWS {
        for following in [Following::Time, Following::Projection] {
            let start = ego(plan.points[0].pose, 10.0);
            let (states, output) = run(law(law_, following), start, Some(&plan), &road(), 12.0);
            assert_eq!(output.status, Status::Stopping(StopReason::PlanExpired));
            let end = states.last().unwrap();
            assert!(end.speed_mps < 0.01, "{law_:?}: {end:?}");
            // 20 m of plan and 25 m at 2 m/s².
            assert!((end.pose.x_m - 45.0).abs() < 1.5, "{law_:?} {following:?}: {}", end.pose.x_m);
            assert!((end.pose.y_m - 1.5).abs() < 0.05, "{law_:?}: stays in its lane: {}", end.pose.y_m);
            if law_ != Law::Pid {
                let hardest =
                    states.iter().filter(|s| s.speed_mps > 0.5).map(|s| -s.accel_mps2).fold(0.0, f64::max);
                assert!(hardest < 2.5, "{law_:?}: {hardest}");
            }
        }
    }
}

/// A stop that ends 56 m beyond its plan, in a bend of 60 m that begins beyond the plan: 14 m/s at 2 m/s² take 49 m.
#[test]
fn a_stop_after_an_expired_plan_follows_the_road_wherever_it_ends() {
    let mut points: Vec<Point2> = (-5..=6).map(|k| Point2::new(10.0 * f64::from(k), 0.0)).collect();
    points.extend((1..=60).map(|k| {
        let (sin, cos) = math::sin_cos(0.03 * f64::from(k));
        Point2::new(60.0 + 60.0 * sin, 60.0 - 60.0 * cos)
    }));
    let bend = Route::uniform(Polyline::smooth(&points, 0.5).unwrap(), 6.0, 2.0);
    let plan = curve(|_| (0.5, 0.0, 0.0), 14.0, 2.0);
    for law_ in LAWS {
        let start = ego(plan.points[0].pose, 14.0);
        let (states, output) = run(law(law_, Following::Time), start, Some(&plan), &bend, 12.0);
        assert_eq!(output.status, Status::Stopping(StopReason::PlanExpired));
        let end = states.last().unwrap();
        let came_m = bend.project(end.pose.point()).s_m - bend.project(start.pose.point()).s_m;
        assert!(end.speed_mps < 0.01 && (came_m - 77.0).abs() < 3.0, "{law_:?}: {came_m}");
        let off = states.iter().map(|state| (bend.project(state.pose.point()).d_m - 0.5).abs());
        let off_m = off.fold(0.0, f64::max);
        assert!(off_m < 0.3, "{law_:?}: {off_m}");
    }
}

#[test]
fn empty_and_non_finite_plans_lead_to_a_stop() {
    let mut bad = curve(|_| (0.0, 0.0, 0.0), 10.0, 9.0);
    bad.points[3].curvature_1pm = f64::NAN;
    for law_ in LAWS {
        for (plan, reason) in [(&Plan::default(), StopReason::PlanEmpty), (&bad, StopReason::PlanNotFinite)] {
            let start = ego(Pose2::new(0.0, 0.0, 0.0), 10.0);
            let (states, output) = run(law(law_, Following::Time), start, Some(plan), &road(), 8.0);
            assert_eq!(output.status, Status::Stopping(reason));
            assert!(states.last().unwrap().speed_mps < 0.01 && states.last().unwrap().pose.y_m.abs() < 0.01);
        }
    }
}

#[test]
fn a_plan_of_one_point_is_followed_straight_ahead() {
    let mut plan = curve(|_| (0.0, 0.0, 0.0), 10.0, 1.0);
    plan.points.truncate(1);
    plan.points[0].at = Time::from_ms(3000);
    for law_ in LAWS {
        let start = ego(Pose2::new(-25.0, 0.2, 0.0), 10.0);
        let (states, output) = run(law(law_, Following::Projection), start, Some(&plan), &road(), 2.5);
        assert_eq!(output.status, Status::Plan);
        assert!(states.last().unwrap().pose.y_m.abs() < 0.1, "{law_:?}: {}", states.last().unwrap().pose.y_m);
    }
}

#[test]
fn the_corridor_ends_where_the_road_narrows() {
    let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(100.0, 0.0)]).unwrap();
    let stations = [(20.0, 6.0), (40.0, 2.0)].map(|(s_m, distance_m)| Station { s_m, distance_m });
    let borders = Borders::new(Border::linear(&stations).unwrap(), Border::constant(2.0));
    let route = Route::new(line, borders);
    let mut params = law(Law::Mpc, Following::Time);
    (params.mpc.corridor_m, params.mpc.edge_m) = (10.0, 0.1);
    let controller = controller(params);
    let aside_m = 0.5 * Shape::default().width_m + 0.1;
    for (x_m, wanted_m) in [(10.0, 6.0), (30.0, 4.0), (50.0, 2.0)] {
        let on_path = PlanPoint { pose: Pose2::new(x_m, 0.5, 0.0), ..PlanPoint::default() };
        let (left_m, right_m) = controller.room(&route, &on_path, x_m);
        assert!((left_m - (wanted_m - 0.5 - aside_m)).abs() < 1e-12, "{x_m}: {left_m}");
        assert!((right_m - (2.5 - aside_m)).abs() < 1e-12, "{x_m}: {right_m}");
    }
}

#[test]
fn headings_around_the_half_circle_are_tracked_like_others() {
    // A road to the west that bends slightly, so that its heading passes from pi to -pi.
    let points: Vec<Point2> = (0..200)
        .map(|k| {
            let x = f64::from(k);
            Point2::new(-x, 4.0 - (x - 100.0) * (x - 100.0) / 2500.0)
        })
        .collect();
    let line = Polyline::new(&points).unwrap();
    let route = Route::uniform(line, 6.0, 6.0);
    for law_ in LAWS {
        let start = ego(route.line().at(0.0).pose, 10.0);
        let (states, _) = run(law(law_, Following::Time), start, None, &route, 15.0);
        let worst = states.iter().map(|s| route.project(s.pose.point()).d_m.abs()).fold(0.0, f64::max);
        assert!(worst < 0.1, "{law_:?}: {worst}");
        let crosses = states.iter().any(|s| s.pose.heading_rad > 3.0)
            && states.iter().any(|s| s.pose.heading_rad < -3.0);
        assert!(crosses, "the test drives across the half circle");
        assert!(states.iter().all(|s| s.steering_rad.abs() < 0.1), "no sudden turn");
    }
}

#[test]
fn a_car_before_the_start_of_the_plan_is_on_time() {
    // The plan begins 0.5 s from now, as with a predicted start state.
    let mut plan = curve(|_| (0.0, 0.0, 0.0), 10.0, 6.0);
    for point in &mut plan.points {
        point.at += Span::from_ms(500);
    }
    let (states, output) = run(
        law(Law::Stanley, Following::Time),
        ego(Pose2::new(-5.0, 0.0, 0.0), 10.0),
        Some(&plan),
        &road(),
        1.0,
    );
    assert_eq!(output.status, Status::Plan);
    assert!(states.iter().all(|s| (s.speed_mps - 10.0).abs() < 0.01), "no reason to change the speed");
}

#[test]
fn following_by_time_catches_up() {
    let plan = curve(|_| (0.0, 0.0, 0.0), 10.0, 15.0);
    let (states, _) = run(
        law(Law::Stanley, Following::Time),
        ego(Pose2::new(-3.0, 0.0, 0.0), 10.0),
        Some(&plan),
        &road(),
        14.0,
    );
    let lag = plan.at(states.last().unwrap().stamp).unwrap().pose.x_m - states.last().unwrap().pose.x_m;
    assert!(lag.abs() < 0.1, "{lag}");
    let (states, _) = run(
        law(Law::Stanley, Following::Projection),
        ego(Pose2::new(-3.0, 0.0, 0.0), 10.0),
        Some(&plan),
        &road(),
        14.0,
    );
    let lag = plan.at(states.last().unwrap().stamp).unwrap().pose.x_m - states.last().unwrap().pose.x_m;
    assert!((lag - 3.0).abs() < 0.1, "by projection it stays behind: {lag}");
}

#[test]
fn wheels_never_turn_beyond_the_limit() {
    for law_ in LAWS {
        let start = ego(Pose2::new(0.0, 5.0, -2.5), 5.0);
        let plan = curve(|_| (0.0, 0.0, 0.0), 5.0, 20.0);
        let (states, _) = run(law(law_, Following::Projection), start, Some(&plan), &road(), 5.0);
        assert!(states.iter().all(|s| s.steering_rad.abs() <= Limits::default().steering_max_rad));
    }
}

#[test]
fn the_same_inputs_give_the_same_bits() {
    let plan = curve(slalom, 10.0, 10.0);
    for law_ in LAWS {
        let go =
            || run(law(law_, Following::Time), ego(plan.points[0].pose, 10.0), Some(&plan), &road(), 3.0).0;
        assert_eq!(go(), go());
    }
}
