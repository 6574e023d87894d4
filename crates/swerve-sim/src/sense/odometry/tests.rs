use swerve_geom::{Vector, Vector2};
use swerve_msg::Command;

use super::*;
use crate::sense::tests::world;
use crate::tests::{PERSON_BEHIND_TRUCK, exact, keep, scenario};

fn fine(wheels: OdometryWheels) -> WheelOdometryParams {
    WheelOdometryParams { counts_per_turn: 1_000_000, wheels, ..WheelOdometryParams::default() }
}

/// A car that rolls on a circle without slip: its rear axle moves along its heading.
fn circling(stamp_ms: i64, speed_mps: f64, yaw_rate_radps: f64) -> WorldState {
    let vehicle = VehicleParams::default();
    let mut world = WorldState { stamp: Time::from_ms(stamp_ms), ..world(Vec::new()) };
    let heading = yaw_rate_radps * world.stamp.as_secs();
    let ahead: Vector2 = Vector2::from_heading(heading);
    let velocity = ahead * speed_mps + ahead.left() * (yaw_rate_radps * vehicle.cg_to_rear_m());
    world.ego.velocity_mps = Vector::new(velocity.x, velocity.y, 0.0);
    let state = &mut world.ego.state;
    (state.pose.heading_rad, state.speed_mps, state.yaw_rate_radps) = (heading, speed_mps, yaw_rate_radps);
    state.steering_rad = math::atan2(vehicle.shape.wheelbase_m * yaw_rate_radps, speed_mps);
    world
}

/// Readings every 10 ms.
fn readings(
    params: WheelOdometryParams,
    seed: u64,
    world: impl Fn(i64) -> WorldState,
    n: i64,
) -> Vec<WheelOdometry> {
    let vehicle = VehicleParams::default();
    let mut odometer = WheelOdometer::new(params, &vehicle, "odometry", seed);
    let read = |k: i64| {
        let world = world(10 * k);
        odometer.sense(&world, rolling_speeds_radps(&world.ego, &vehicle))
    };
    (0..=n).filter_map(read).collect()
}

#[test]
fn wheel_speeds_on_a_circle_match_their_radii_and_give_the_motion_back() {
    let (speed, yaw_rate) = (8.0, 0.4);
    let vehicle = VehicleParams::default();
    let (l, half, r) = (vehicle.shape.wheelbase_m, 0.5 * vehicle.body.track_m, vehicle.wheel.radius_m);
    // The centre of the circle is 20 m to the left of the rear axle; each wheel moves on a circle around it.
    let around = |x: f64, y: f64| yaw_rate * math::hypot(20.0 - y, x) / r;
    let want = [around(l, half), around(l, -half), around(0.0, half), around(0.0, -half)];
    let got = rolling_speeds_radps(&circling(0, speed, yaw_rate).ego, &vehicle);
    for (got, want) in got.iter().zip(want) {
        assert!((got - want).abs() < 1e-9, "{got} {want}");
    }
    for wheels in [OdometryWheels::Rear, OdometryWheels::All] {
        let all = readings(fine(wheels), 1, |ms| circling(ms, speed, yaw_rate), 200);
        assert_eq!(all.len(), 200);
        for reading in &all {
            // A count is 2.1 µm of distance, and 0.21 mm/s over 10 ms.
            assert!((reading.speed_mps - speed).abs() < 3e-4, "{reading:?}");
            assert!((reading.yaw_rate_radps - yaw_rate).abs() < 3e-4, "{reading:?}");
        }
        let turned = all.iter().map(|o| o.yaw_rate_radps * 0.01).sum::<f64>();
        assert!((turned - 0.8).abs() < 1e-5, "what is not counted now is counted later: {turned}");
    }
}

#[test]
fn reversing_gives_negative_speeds() {
    let last = readings(fine(OdometryWheels::All), 1, |ms| circling(ms, -3.0, 0.2), 5).pop().unwrap();
    assert!((last.speed_mps + 3.0).abs() < 1e-3 && (last.yaw_rate_radps - 0.2).abs() < 1e-3, "{last:?}");
    assert!(last.counts.iter().all(|c| *c < 0), "{last:?}");
}

#[test]
fn encoders_count_whole_steps_without_loss() {
    let params = WheelOdometryParams::default();
    let (vehicle, n) = (VehicleParams::default(), 300);
    let all = readings(params, 1, |ms| circling(ms, 10.0, 0.0), n);
    let per_count = core::f64::consts::TAU / 96.0;
    let per_reading = 10.0 / vehicle.wheel.radius_m * 0.01 / per_count;
    for (k, reading) in all.iter().enumerate() {
        let want = (per_reading * (k + 1) as f64).floor() as i64;
        assert!(reading.counts.iter().all(|c| (c - want).abs() <= 1), "{reading:?} {want}");
        let counted = reading.wheel_speeds_radps[2] * 0.01 / per_count;
        assert!((counted - counted.round()).abs() < 1e-9, "{counted}");
        // One count more or less in 10 ms.
        let step = per_count * vehicle.wheel.radius_m / 0.01;
        assert!((reading.speed_mps - 10.0).abs() < step, "{reading:?}");
    }
    let speeds: Vec<i64> = all.iter().map(|o| (o.speed_mps * 1e6).round() as i64).collect();
    assert!(speeds.iter().min() < speeds.iter().max(), "quantised speed is not constant");
    let mean = all.iter().map(|o| o.speed_mps).sum::<f64>() / n as f64;
    assert!((mean - 10.0).abs() < 0.01, "{mean}");
}

#[test]
fn larger_wheel_underestimates_speed_for_the_whole_run() {
    let params = WheelOdometryParams { radius_error: 0.01, ..fine(OdometryWheels::Rear) };
    let of = |seed: u64| {
        let mut odometer = WheelOdometer::new(params, &VehicleParams::default(), "odometry", seed);
        let world = circling(0, 10.0, 0.0);
        let speeds = rolling_speeds_radps(&world.ego, &VehicleParams::default());
        odometer.sense(&world, speeds);
        let reading = odometer.sense(&circling(1000, 10.0, 0.0), speeds).unwrap();
        (odometer.scale, reading)
    };
    let n = 500;
    let mut square = 0.0;
    for seed in 0..n {
        let (scale, reading) = of(seed);
        for (i, scale) in scale.iter().enumerate() {
            let want = 10.0 / VehicleParams::default().wheel.radius_m / scale;
            assert!((reading.wheel_speeds_radps[i] - want).abs() < 1e-4);
            square += (scale - 1.0) * (scale - 1.0) / (4.0 * n as f64);
        }
        // Rear wheels of different size look like a turn.
        let apart = 10.0 / scale[3] - 10.0 / scale[2];
        let yaw_rate = apart / VehicleParams::default().body.track_m;
        assert!((reading.yaw_rate_radps - yaw_rate).abs() < 1e-4, "{reading:?}");
    }
    assert!((square.sqrt() - 0.01).abs() < 0.001, "{}", square.sqrt());
    assert_eq!(of(3), of(3));
    assert_ne!(of(3).0, of(4).0);
}

#[test]
fn steering_sensor_has_its_errors() {
    let with = |noise: f64, bias: f64, seed: u64| {
        let params = WheelOdometryParams {
            steering_noise_rad: noise,
            steering_bias_rad: bias,
            ..WheelOdometryParams::default()
        };
        let all = readings(params, seed, |ms| circling(ms, 8.0, 0.4), 3);
        all.iter().map(|o| o.steering_rad).collect::<Vec<_>>()
    };
    let truth = math::atan2(2.85 * 0.4, 8.0);
    assert_eq!(with(0.0, 0.0, 1), [truth; 3]);
    let biased = with(0.0, 0.01, 1);
    assert!(biased[0] != truth && biased[0] == biased[1], "{biased:?}");
    let noisy = with(0.01, 0.0, 1);
    assert!(noisy[0] != noisy[1] && noisy == with(0.01, 0.0, 1) && noisy != with(0.01, 0.0, 2));
}

#[test]
fn repeated_stamp_gives_no_reading() {
    let mut odometer =
        WheelOdometer::new(WheelOdometryParams::default(), &VehicleParams::default(), "odometry", 1);
    let at = |ms: i64| circling(ms, 5.0, 0.0);
    assert_eq!(odometer.sense(&at(10), [15.0; 4]), None);
    assert_eq!(odometer.sense(&at(10), [15.0; 4]), None);
    assert!(odometer.sense(&at(20), [15.0; 4]).is_some());
    assert_eq!(odometer.sense(&at(15), [15.0; 4]), None);
}

#[test]
fn simulated_wheels_slip_little_in_a_bend_and_more_under_full_brake() {
    let mut sim = exact(&scenario(PERSON_BEHIND_TRUCK), 200);
    let vehicle = sim.params().vehicle.clone();
    let mut odometer = WheelOdometer::new(fine(OdometryWheels::Rear), &vehicle, "odometry", 1);
    let mut worst = [0.0_f64; 2];
    while sim.state().stamp < Time::from_ms(2500) {
        let steering_rad = if sim.state().stamp < Time::from_ms(200) { 0.0 } else { 0.01 };
        let brakes = sim.state().stamp >= Time::from_ms(1500);
        let command = if brakes { Command::FULL_BRAKE } else { keep(sim.state(), 20.0) };
        sim.step(Command { steering_rad, ..command });
        let Some(reading) = odometer.sense(sim.state(), sim.wheel_speeds_radps()) else { continue };
        let state = &sim.state().ego.state;
        let off = (reading.speed_mps - state.speed_mps).abs();
        let phase = usize::from(brakes);
        worst[phase] = worst[phase].max(off);
        if !brakes {
            assert!((reading.yaw_rate_radps - state.yaw_rate_radps).abs() < 0.02, "{reading:?} {state:?}");
        }
    }
    assert!(worst[0] < 0.2 && worst[1] > 0.4 && worst[1] < 6.0, "{worst:?}");
}

#[test]
fn parameters_that_cannot_be_are_all_named() {
    let read = |text: &str| serde_json::from_str::<WheelOdometryParams>(text);
    assert_eq!(read("{}").unwrap(), WheelOdometryParams::default());
    assert_eq!(read(r#"{"wheels": "all"}"#).unwrap().wheels, OdometryWheels::All);
    assert!(read(r#"{"counts": 3}"#).unwrap_err().to_string().contains("unknown field `counts`"));
    assert!(read(r#"{"counts_per_turn": -3}"#).unwrap_err().to_string().contains("invalid value"));
    assert_eq!(WheelOdometryParams::default().out_of_range(), []);
    let wrong = WheelOdometryParams {
        counts_per_turn: 0,
        radius_error: 0.5,
        steering_noise_rad: f64::NAN,
        ..WheelOdometryParams::default()
    };
    let problems: Vec<String> = wrong.out_of_range().iter().map(ToString::to_string).collect();
    assert_eq!(
        problems,
        [
            "`counts_per_turn` is 0, expected 1 to 1000000",
            "`radius_error` is 0.5, expected 0 to 0.1",
            "`steering_noise_rad` is NaN, expected 0 to 1",
        ]
    );
}
