//! Drivers who must give way to the ego on the priority road.

use super::*;

/// Place on the arm from the south from which a body of 5.6 m by 2.2 m touches the ego's lane, metres.
const ZONE_M: f64 = -6.13;
const CAR: u32 = 1;

/// The ego on the priority road with its front at a distance before the junction, and a car that must give way.
fn on_priority_road(before_m: f64) -> Posed {
    let posed = at_crossing("crossing_priority.xodr", [FROM_WEST, FROM_WEST], before_m, 9.0);
    posed.car(on_arm(FROM_SOUTH, -40.0), 9.0)
}

/// Gives the car a distance before its zone and a speed.
fn aim(posed: &mut Posed, in_m: f64, speed_mps: f64) {
    posed.aim(CAR, on_arm(FROM_SOUTH, ZONE_M - in_m), speed_mps);
}

#[test]
fn wobbling_speed_does_not_change_the_expectation() {
    for wobble_mps in [0.0, 0.1, 0.2, 0.3] {
        let (mut in_m, mut speed_mps) = (28.0, 9.0);
        let mut posed = on_priority_road(10.0);
        for k in 0..80 {
            // It brakes with 1.6 m/s² and comes to rest 1 m before the zone.
            let needed_mps2 = needed_mps2(speed_mps, in_m - 1.0);
            speed_mps = f64::max(speed_mps - if needed_mps2 > 1.6 { 0.1 * needed_mps2 } else { 0.0 }, 0.0);
            in_m -= 0.1 * speed_mps;
            let wobble_mps = if k % 4 < 2 { wobble_mps } else { -wobble_mps };
            aim(&mut posed, in_m, (speed_mps + wobble_mps).max(0.0));
            let decision = posed.decide();
            let found = (causes(&decision), ids(&decision));
            assert_eq!(
                found,
                (vec![], [vec![], vec![CAR]]),
                "{k}: {in_m:.2} m, {speed_mps:.2} m/s ± {wobble_mps}"
            );
        }
    }
}

#[test]
fn driver_who_keeps_its_speed_is_not_expected_to_yield_and_stops_the_ego() {
    let mut in_m = 30.0;
    let mut posed = on_priority_road(15.0);
    while in_m > 5.0 {
        in_m -= 0.9;
        aim(&mut posed, in_m, 9.0);
        let decision = posed.decide();
        let [yields, expected] = ids(&decision);
        // 2 m/s² suffice up to 20.2 m before the zone, 4 m/s² up to 10.1 m.
        match in_m {
            22.0.. => assert_eq!(expected, [CAR], "{in_m}"),
            ..19.3 => assert!(expected.is_empty(), "{in_m}"),
            _ => {}
        }
        if (in_m - 10.1).abs() > 0.5 {
            assert_eq!(yields.is_empty(), in_m > 10.1, "{in_m}");
        }
    }
}

#[test]
fn driver_who_speeds_up_before_the_zone_stops_the_ego_in_time() {
    let (mut in_m, mut speed_mps) = (4.0, 0.0);
    let mut posed = on_priority_road(15.0);
    aim(&mut posed, in_m, speed_mps);
    assert_eq!(ids(&posed.decide())[1], [CAR]);
    let stops_at_m = loop {
        speed_mps += 0.12;
        in_m -= 0.1 * speed_mps;
        aim(&mut posed, in_m, speed_mps);
        let decision = posed.decide();
        if causes(&decision) == [StopReason::GiveWay] {
            break in_m;
        }
    };
    assert!((1.0..3.0).contains(&stops_at_m), "{stops_at_m}");
}
