//! Control laws on the dynamic single-track model with actuator lags and tyre slip.

use super::*;
use crate::Pedals;
use crate::bicycle::{curve, road};
use swerve_geom::{Polyline, Pose2};
use swerve_vehicle::{SingleTrack, VehicleParams, pedals_for_accel};

/// A swerve of 3 m that starts after `lead_m` and takes `length_m`: a quintic, and its derivatives.
fn swerve(lead_m: f64, length_m: f64) -> impl Fn(f64) -> (f64, f64, f64) {
    move |x| {
        let t = ((x - lead_m) / length_m).clamp(0.0, 1.0);
        let y = 3.0 * t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
        let slope = 3.0 / length_m * 30.0 * t * t * (1.0 - t) * (1.0 - t);
        let bend = 3.0 / (length_m * length_m) * 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t);
        (y, slope, bend)
    }
}

/// Largest distances from the path of a swerve with a peak lateral acceleration of `accel_mps2`: during it, and from
/// two seconds after it on.
fn off_path(params: Params, speed_mps: f64, accel_mps2: f64) -> (f64, f64) {
    let vehicle = VehicleParams::default();
    // The second derivative of a quintic is at most 5.77 d / l².
    let length_m = speed_mps * (5.77 * 3.0 / accel_mps2).sqrt();
    let plan = curve(swerve(10.0, length_m), speed_mps, 8.0);
    let points: Vec<_> = plan.points.iter().map(|p| p.pose.point()).collect();
    let line = Polyline::smooth(&points, 0.1).unwrap();
    let pedals = vehicle.clone();
    let drive = move |accel: f64, speed: f64| {
        let p = pedals_for_accel(&pedals, speed, accel);
        Pedals { throttle: p.throttle, brake: p.brake }
    };
    let limits = vehicle.limits;
    let mut controller = LawController::new(params, Shape::default(), limits, Box::new(drive));
    let model = SingleTrack::new(&vehicle, 0.9);
    let mut state = SingleTrack::straight(Pose2::new(0.0, 0.0, 0.0), speed_mps);
    let (mut steering, mut accel) = (0.0, 0.0);
    let mut command = swerve_msg::Command::default();
    // The predictive law is called half as often to shorten the test.
    let every = if params.law == Law::Mpc { 2 } else { 1 };
    let (mut during, mut after) = (0.0f64, 0.0f64);
    for k in 0..500 {
        let now = Time::from_ms(10 * k);
        let ego = EgoState {
            stamp: now,
            pose: state.pose,
            speed_mps: state.vx_mps,
            accel_mps2: state.accel_mps2,
            lateral_accel_mps2: state.lateral_accel_mps2,
            yaw_rate_radps: state.yaw_rate_radps,
            steering_rad: state.steering_rad,
        };
        let route = Route::uniform(road().line().clone(), 9.0, 9.0);
        if k % every == 0 {
            command = controller.step(&Input { now, ego: &ego, plan: Some(&plan), route: &route }).command;
        }
        // Lags of steering (0.05 s) and of drive or brakes (0.15 s), in steps of 5 ms.
        let asked = 3.5 * command.throttle - 10.0 * command.brake;
        for _ in 0..2 {
            steering += (command.steering_rad - steering) * 0.1;
            accel += (asked - accel) / 30.0;
            state = model.step(state, steering, accel, 0.005);
        }
        let s = speed_mps * now.as_secs();
        let d = line.project_near(state.pose.point(), s, 30.0).d_m.abs();
        let end_s = (10.0 + length_m) / speed_mps + 2.0;
        if now.as_secs() < end_s {
            during = during.max(d);
        } else {
            after = after.max(d);
        }
    }
    (during, after)
}

/// Bounds on the largest distances from the path, metres: the observed values plus a third.
#[test]
fn hard_swerves_are_driven_within_decimetres() {
    for (law, speed_mps, accel_mps2, bound_m) in [
        (Law::PurePursuit, 16.0, 6.0, 0.05),
        (Law::PurePursuit, 22.0, 6.0, 0.26),
        (Law::PurePursuit, 22.0, 7.8, 0.45),
        (Law::Stanley, 16.0, 6.0, 0.03),
        (Law::Stanley, 22.0, 6.0, 0.10),
        (Law::Stanley, 22.0, 7.8, 0.20),
        (Law::Stanley, 30.0, 7.8, 0.35),
        (Law::Mpc, 16.0, 6.0, 0.16),
        (Law::Mpc, 22.0, 7.8, 0.36),
    ] {
        let params = Params { law, following: Following::Time, ..Params::default() };
        let (during, after) = off_path(params, speed_mps, accel_mps2);
        eprintln!("{law:?} {speed_mps} m/s {accel_mps2} m/s2: {during:.3} m, after {after:.3} m");
        assert!(during < bound_m && after < 0.06, "{law:?} {speed_mps} m/s: {during} {after}");
    }
}

/// Pylot's law looks 5 m ahead at any speed: at 22 m/s a quarter of a second, about the lag of the car.
#[test]
fn law_of_the_paper_tracks_at_16_and_oscillates_at_22() {
    let params = Params { law: Law::Pid, following: Following::Projection, ..Params::default() };
    let (during, after) = off_path(params, 16.0, 6.0);
    assert!(during < 0.3 && after < 0.05, "{during} {after}");
    let (_, after) = off_path(params, 22.0, 7.8);
    assert!(after > 1.0, "{after}");
}
