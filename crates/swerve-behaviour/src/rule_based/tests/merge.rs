//! Joining the traffic of a motorway from a ramp.

use super::*;

/// Speed of the traffic, m/s, and the middle of its lane, metres.
const TRAFFIC_MPS: f64 = 22.0;
const LANE_Y_M: f64 = -5.625;

/// Result of a ride from a ramp by the decisions' speeds alone, up to where the ego gets into the way of the traffic.
#[derive(Debug)]
struct Joined {
    /// Gaps to the cars ahead and behind, metres.
    gaps_m: [f64; 2],
    /// Largest deceleration until there, m/s², and the states.
    brake_mps2: f64,
    states: Vec<DrivingState>,
}

/// Joins a row of cars that are this far apart; the first one begins here along the motorway.
fn join(count: usize, apart_m: f64, first_x_m: f64) -> Joined {
    let from = Pose2::new(110.0, -111.0, 0.8);
    let mut posed = Posed::on("ramp.xodr").route(from, Pose2::new(800.0, LANE_Y_M, 0.0));
    let mut cars_x_m: Vec<f64> = (0..count).map(|k| first_x_m - apart_m * k as f64).collect();
    posed = posed.ego(from, 0.0, 20.0);
    posed.cruise_mps = 25.0;
    for x_m in &cars_x_m {
        posed = posed.car(Pose2::new(*x_m, LANE_Y_M, 0.0), TRAFFIC_MPS);
    }
    let half_m = 0.5 * swerve_vehicle::Shape::default().length_m;
    let mut joined = Joined { gaps_m: [f64::INFINITY; 2], brake_mps2: 0.0, states: Vec::new() };
    for _ in 0..600 {
        let decision = posed.decide();
        joined.states.extend(decision.state);
        let over_m = posed.planner.course.joins[0].over_m;
        if posed.front_m - half_m >= over_m {
            break;
        }
        // The motion planner looks a second ahead, and keeps to 2 m/s².
        let v = posed.speed_mps;
        let free_mps = decision.speed_mps(posed.front_m + v, 1.0);
        let gain_mps2 = (free_mps - v).clamp(-2.0, 2.0);
        joined.brake_mps2 = joined.brake_mps2.max(-gain_mps2);
        posed.speed_mps = v + 0.1 * gain_mps2;
        posed.front_m += 0.1 * posed.speed_mps;
        for (k, x_m) in cars_x_m.iter_mut().enumerate() {
            *x_m += 0.1 * TRAFFIC_MPS;
            posed.aim(k as u32 + 1, Pose2::new(*x_m, LANE_Y_M, 0.0), TRAFFIC_MPS);
        }
    }
    let x_m = posed.route.line().at(posed.front_m - half_m).pose.x_m;
    for car_x_m in cars_x_m {
        let gap = &mut joined.gaps_m[usize::from(car_x_m < x_m)];
        *gap = gap.min((car_x_m - x_m).abs() - half_m - 2.25);
    }
    joined
}

#[test]
fn ego_joins_in_a_gap_wherever_the_cars_are() {
    let mut merges = 0;
    for apart_m in [33.0, 44.0, 60.0] {
        for phase in 0..8 {
            let joined = join(8, apart_m, 210.0 + apart_m * f64::from(phase) / 8.0);
            // 2 m and 0.5 s ahead, 0.7 of 2 m and 0.6 s behind; the cars move 2.2 m in a frame, and in the tolerated
            // delay.
            let [ahead_m, behind_m] = joined.gaps_m;
            assert!(ahead_m > 13.0 - 4.4 && behind_m > 10.7 - 4.4, "{apart_m} m, {phase}: {joined:?}");
            assert!(joined.brake_mps2 < 1.6, "{apart_m} m, {phase}: {joined:?}");
            merges += usize::from(joined.states.contains(&DrivingState::Merge));
            let begins =
                joined.states.windows(2).filter(|two| two[0] != two[1] && two[1] == DrivingState::Merge);
            assert!(begins.count() <= 3, "{apart_m} m, {phase}: {joined:?}");
        }
    }
    assert!(merges > 12, "{merges}");
}

#[test]
fn ego_keeps_its_speed_if_the_way_is_free() {
    for first_x_m in [400.0, 0.0] {
        let joined = join(1, 0.0, first_x_m);
        assert!(!joined.states.contains(&DrivingState::Merge) && joined.brake_mps2 == 0.0, "{joined:?}");
    }
}

#[test]
fn ego_goes_behind_the_car_beside_it_and_names_it() {
    let from = Pose2::new(110.0, -111.0, 0.8);
    let mut posed = Posed::on("ramp.xodr").route(from, Pose2::new(800.0, LANE_Y_M, 0.0));
    posed = posed.ego(from, -150.0, 21.0);
    posed.cruise_mps = 25.0;
    let x_m = posed.route.line().at(posed.front_m).pose.x_m;
    let mut posed = posed.car(Pose2::new(x_m, LANE_Y_M, 0.0), TRAFFIC_MPS);
    let decision = posed.decide();
    assert_eq!((decision.state, decision.because), (Some(DrivingState::Merge), Some(ActorId(1))));
    assert!(decision.speed_mps(posed.front_m, 1.0) < 21.0, "{:?}", decision.limits);
    // A queue has no gaps to wait for.
    posed.aim(1, Pose2::new(x_m, LANE_Y_M, 0.0), 2.0);
    assert_eq!(posed.decide().state, Some(DrivingState::Cruise));
}
