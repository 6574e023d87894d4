use super::*;
use crate::score::leaderboard::{Failure, Status, Struck};

const LENGTH_M: f64 = 200.0;

/// Facts of an ego that drives along x, its route, without anything else.
fn facts(at_s: f64, x_m: f64, speed_mps: f64) -> StepFacts<'static> {
    StepFacts {
        at_s,
        ego: Ego { center: Pose2::new(x_m, 0.0, 0.0), half_length_m: 2.5, speed_mps, forward_mps: speed_mps },
        place: RoutePlace { s_m: x_m, to_end_m: LENGTH_M - x_m, limit_mps: 10.0, ..RoutePlace::default() },
        touches: &[],
        red_lights: &[],
        stop_signs: &[],
        traffic_mps: None,
        scenarios: &[],
    }
}

/// A drive at 10 m/s in steps of 0.1 s until it ends, with facts changed by `set`; both versions.
fn drive(set: impl Fn(&mut StepFacts<'static>)) -> [(RouteRecord, Option<Ending>, f64); 2] {
    [Version::V1_0, Version::V2_0].map(|version| {
        let mut judge = RouteJudge::new(version, JudgedRoute::of_length(LENGTH_M));
        let mut last = (None, 0.0);
        for k in 0..=199 {
            let mut facts = facts(0.1 * f64::from(k), f64::from(k), 10.0);
            set(&mut facts);
            last = (judge.take(&facts), facts.at_s);
            if last.0.is_some() {
                break;
            }
        }
        (judge.record(), last.0, last.1)
    })
}

#[test]
fn route_ends_beyond_99_percent_and_near_its_end() {
    for (record, ending, _) in drive(|_| {}) {
        assert_eq!((ending, record.route_completion), (Some(Ending::Completed), 100.0));
        assert_eq!(record.infractions(), 0, "{record:?}");
    }
    for (record, ending, _) in drive(|facts| facts.place.to_end_m = 10.0) {
        assert_eq!((ending, record.route_completion), (None, 99.5));
    }
    // 123.456 m of 200 m: 2.x rounds.
    let percent =
        drive(|facts| facts.place.s_m = facts.place.s_m.min(123.456)).map(|(r, ..)| r.route_completion);
    assert_eq!(percent, [123.456 / 200.0 * 100.0, 61.73]);
}

#[test]
fn contacts_are_counted_by_kind() {
    const CAR: &[Touch] = &[Touch { other: Some(4), kind: Struck::Vehicle }];
    const PERSON: &[Touch] = &[Touch { other: Some(5), kind: Struck::Pedestrian }];
    let found = drive(|facts| {
        facts.touches = match facts.ego.center.x_m {
            // For 0.3 s, 3 m.
            x if (50.0..53.0).contains(&x) => CAR,
            // 4 m on: near for 2.x only.
            54.0 => PERSON,
            _ => &[],
        };
    });
    let counts =
        found.map(|(record, ..)| (record.counts.collisions_vehicle, record.counts.collisions_pedestrian));
    assert_eq!(counts, [(1, 1), (1, 0)]);
}

#[test]
fn outside_lanes_is_a_share_of_the_completed_route() {
    let share = |off_m: f64, against: bool| {
        drive(|facts| {
            if (100.0..120.0).contains(&facts.ego.center.x_m) {
                (facts.place.off_lanes_m, facts.place.against_traffic) = (off_m, against);
            }
        })
        .map(|(record, ..)| record.outside_route_lanes_percent)
    };
    let tenth = 20.0 / 199.0 * 100.0;
    assert_eq!(share(0.5, false), [0.0, 0.0]);
    assert_eq!(share(1.0, false), [0.0, tenth]);
    assert_eq!(share(1.4, false), [tenth, tenth]);
    assert_eq!(share(0.0, true), [tenth, tenth]);
}

fn red_lights(light: RedLight) -> [u32; 2] {
    // The facts borrow for the whole test.
    let lights: &'static [RedLight] = Box::leak(Box::new([light]));
    drive(|facts| facts.red_lights = lights).map(|(record, ..)| record.counts.red_light)
}

#[test]
fn red_light_is_run_once_when_the_tail_crosses_the_line() {
    let light = RedLight {
        id: 9,
        center: Point2::new(100.0, 0.0),
        line: Pose2::new(100.0, 0.0, 0.0),
        lane_width_m: 3.5,
        is_own_lane: true,
    };
    assert_eq!(red_lights(light), [1, 1]);
    // The line is 0.4 of the lane's width to either side of its middle in 1.0, 0.6 in 2.x.
    let beside = |y_m: f64| red_lights(RedLight { line: Pose2::new(100.0, y_m, 0.0), ..light });
    assert_eq!([beside(1.39), beside(1.5), beside(2.2)], [[1, 1], [0, 1], [0, 0]]);
    assert_eq!(red_lights(RedLight { is_own_lane: false, ..light }), [0, 0]);
    assert_eq!(red_lights(RedLight { line: Pose2::new(100.0, 0.0, 3.0), ..light }), [0, 0], "oncoming lane");
    assert_eq!(red_lights(RedLight { center: Point2::new(100.0, 40.0), ..light }), [0, 0], "far");
}

#[test]
fn waiting_at_a_red_light_is_no_infraction() {
    let line = Pose2::new(100.0, 0.0, 0.0);
    let light = RedLight { id: 1, center: line.point(), line, lane_width_m: 3.5, is_own_lane: true };
    for (stop_m, wanted) in [(97.0, 0), (101.0, 0), (102.1, 1), (103.4, 1), (104.0, 0)] {
        // The front is 2.5 m ahead of the centre; the tail piece is from 2.0 m to 3.5 m behind it.
        let mut judge = RouteJudge::new(Version::V2_1, JudgedRoute::of_length(LENGTH_M));
        for k in 0..20 {
            judge.take(&StepFacts { red_lights: &[light], ..facts(0.1 * f64::from(k), stop_m, 0.0) });
        }
        assert_eq!(judge.record().counts.red_light, wanted, "at {stop_m} m");
    }
}

/// Drives past a sign whose area is from 98 m to 102 m with the speed `speed_mps` at `slow_m`.
fn stop_signs(slow_m: f64, speed_mps: f64) -> [u32; 2] {
    [Version::V1_0, Version::V2_0].map(|version| {
        let mut judge = RouteJudge::new(version, JudgedRoute::of_length(LENGTH_M));
        for k in 0..=280 {
            let x_m = 0.5 * f64::from(k);
            let speed = if x_m == slow_m { speed_mps } else { 5.0 };
            let sign =
                StopSign { id: 3, from_m: 98.0 - x_m, to_m: 102.0 - x_m, distance_m: (100.0 - x_m).abs() };
            judge.take(&StepFacts { stop_signs: &[sign], ..facts(0.1 * f64::from(k), x_m, speed) });
        }
        judge.record().counts.stop_infraction
    })
}

#[test]
fn stop_sign_needs_a_stop_within_its_effect() {
    assert_eq!(stop_signs(99.0, 0.05), [0, 0]);
    assert_eq!(stop_signs(99.0, 0.2), [1, 1]);
    // 10 m before: 1.0 looks 20 m ahead, 2.x 4 m.
    assert_eq!(stop_signs(88.0, 0.0), [0, 1]);
    assert_eq!(stop_signs(60.0, 0.0), [1, 1]);
}

#[test]
fn leaving_the_route_ends_it() {
    for (record, ending, at_s) in drive(|facts| facts.place.off_route_m = facts.ego.center.x_m) {
        assert_eq!((ending, at_s, record.counts.route_dev), (Some(Ending::Deviated), 3.0, 1));
        assert_eq!(record.status(Version::V2_0), Status::Failed(Some(Failure::Deviated)));
    }
    // 15 m off: 30 % of the route may be driven so.
    for (_, ending, at_s) in drive(|facts| facts.place.off_route_m = 15.0) {
        assert_eq!((ending, (at_s * 10.0).round()), (Some(Ending::Deviated), 61.0));
    }
    assert!(
        drive(|facts| facts.place.off_route_m = 14.9).iter().all(|(_, e, _)| *e == Some(Ending::Completed))
    );
}

#[test]
fn standing_and_slow_routes_end() {
    let stand = |version, speed_mps: f64, at_s: f64| {
        let mut judge = RouteJudge::new(version, JudgedRoute::of_length(LENGTH_M));
        judge.take(&facts(0.0, 50.0, 5.0));
        let ending = judge.take(&facts(at_s, 50.0, speed_mps));
        (ending, judge.record())
    };
    assert_eq!(stand(Version::V2_0, 0.05, 180.0).0, None);
    assert_eq!(stand(Version::V2_0, 0.05, 180.1).0, Some(Ending::Blocked));
    // 1.0: 0.8 s/m and 5 s. 2.x: 300 s and 50 m at a tenth of 10 m/s.
    assert_eq!(stand(Version::V1_0, 1.0, 165.0).0, None);
    assert_eq!(stand(Version::V1_0, 1.0, 165.1).0, Some(Ending::TimedOut));
    assert_eq!(stand(Version::V2_1, 1.0, 350.0).0, None);
    let (ending, record) = stand(Version::V2_1, 1.0, 350.1);
    assert_eq!((ending, record.counts.route_timeout), (Some(Ending::TimedOut), 1));
}

#[test]
fn speed_is_compared_with_the_traffic_in_four_sections() {
    let [(first, ..), (second, ..)] = drive(|facts| {
        let x_m = facts.ego.center.x_m;
        facts.traffic_mps = if x_m < 60.0 { Some(12.5) } else { (x_m < 160.0).then_some(8.0) };
    });
    assert_eq!(first.min_speed_checkpoints_percent, [0.0; 0]);
    // Sections begin at 0, 51, 102 and 153 m: 12.5 m/s; 9 of 51 samples at 12.5 and 42 at 8 m/s; 8 m/s; 8 m/s.
    let mixed = 10.0 / ((9.0 * 12.5 + 42.0 * 8.0) / 51.0) * 100.0;
    assert_eq!(second.min_speed_checkpoints_percent, [80.0, rounded(mixed, 2), 125.0, 125.0]);
    let without = drive(|_| {})[1].0.min_speed_checkpoints_percent.clone();
    assert_eq!(without, [100.0; 4]);
    let short = drive(|facts| facts.place.s_m = facts.place.s_m.min(180.0))[1].0.clone();
    assert_eq!(short.min_speed_checkpoints_percent.len(), 3, "the last section counts beyond 95 %");
}

#[test]
fn scenarios_time_out_once_and_emergency_vehicles_must_pass() {
    for (version, wanted) in [(Version::V1_0, (0, 0)), (Version::V2_1, (1, 1))] {
        let mut judge = RouteJudge::new(version, JudgedRoute::of_length(1000.0));
        for at_s in [240.0, 250.1, 251.0] {
            judge.take(&StepFacts { scenarios: &[(6, 10.0)], ..facts(at_s, at_s, 1.0) });
        }
        let vehicle = |x_m: f64| EmergencyVehicle(Pose2::new(x_m, 0.0, 0.0));
        judge.emergency_ends(Point2::new(250.0, 0.0), vehicle(260.0));
        judge.emergency_ends(Point2::new(250.0, 0.0), vehicle(240.0));
        let counts = judge.record().counts;
        assert_eq!((counts.scenario_timeouts, counts.yield_emergency_vehicle_infractions), wanted);
    }
}
