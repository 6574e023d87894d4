//! A drive followed by the kinematic single track, whose tyres do not slip.
//!
//! Each step has one input: the acceleration towards the next speed and place of the drive, and the steering rate that
//! leads the rear axle back to its path (a linear feedback of lateral distance and course, with the curvature of the
//! path ahead). The states are integrated by the equations of the model, so that each is feasible exactly.

use core::f64::consts::FRAC_PI_2;

use swerve_geom::{Point2, angle_between, math};

use crate::vehicle::{ACCEL_MAX_MPS2, STEERING_RATE_MAX_RADPS};
use crate::{Model, SolutionState, Vehicle};

/// Rate at which distances along the path are made up for, 1/s.
const ALONG_1PS: f64 = 1.0;

/// Distance over which lateral distances decay: by speed, seconds, and at least, metres.
const ACROSS_S: f64 = 0.4;
const ACROSS_MIN_M: f64 = 3.0;

/// Speed below which the course of the rear axle and the curvature of its path are not defined, m/s.
const SLOW_MPS: f64 = 0.5;

/// Share of the friction circle that inputs use.
const FRICTION_SHARE: f64 = 0.95;

/// The rear axle of a drive at a time step.
#[derive(Clone, Copy)]
struct Target {
    at: Point2,
    course_rad: f64,
    speed_mps: f64,
}

/// States of the kinematic vehicle that follows a drive, one for each of its states.
pub(crate) fn followed(vehicle: &Vehicle, states: &[SolutionState], step_s: f64) -> Vec<SolutionState> {
    let targets = targets(vehicle, states);
    let Some(first) = states.first() else { return Vec::new() };
    let curvature = |k: usize| -> f64 {
        let (Some(from), Some(to)) = (targets.get(k), targets.get(k + 1)) else { return 0.0 };
        let way_m = from.at.distance(to.at);
        let turn_rad = angle_between(from.course_rad, to.course_rad);
        if way_m < SLOW_MPS * step_s { 0.0 } else { turn_rad / way_m }
    };
    let steering = |curvature_1pm: f64| {
        let angle_rad = math::atan(curvature_1pm * vehicle.wheelbase_m());
        angle_rad.clamp(-vehicle.steering_max_rad, vehicle.steering_max_rad)
    };
    let mut values =
        vehicle.values(Model::Ks, &SolutionState { steering_rad: steering(curvature(0)), ..*first });
    let mut followed = vec![state(vehicle, first, &values)];
    for k in 0..states.len() - 1 {
        let (now, next) = (targets[k], targets[k + 1]);
        let [x, y, angle_rad, speed_mps, heading_rad, ..] = values;
        let off = Point2::new(x, y) - now.at;
        let along = swerve_geom::Vector2::<swerve_geom::Map>::from_heading(now.course_rad);
        let (along_m, across_m) = (off.dot(along), along.cross(off));
        let wanted_mps = (next.speed_mps - ALONG_1PS * along_m).max(next.speed_mps.min(0.0));
        let rate_radps = if speed_mps < SLOW_MPS {
            0.0
        } else {
            let length_m = (ACROSS_S * speed_mps).max(ACROSS_MIN_M);
            let off_rad = angle_between(now.course_rad, heading_rad).clamp(-FRAC_PI_2, FRAC_PI_2);
            let back_1pm = across_m / (length_m * length_m) + 2.0 * off_rad / length_m;
            let wanted_rad = steering(curvature(k + 1) - back_1pm);
            ((wanted_rad - angle_rad) / step_s).clamp(-STEERING_RATE_MAX_RADPS, STEERING_RATE_MAX_RADPS)
        };
        let turning_mps2 = speed_mps * speed_mps * math::tan(angle_rad) / vehicle.wheelbase_m();
        let circle = FRICTION_SHARE * ACCEL_MAX_MPS2;
        let most_mps2 = (circle * circle - turning_mps2 * turning_mps2).max(0.0).sqrt();
        let accel_mps2 = ((wanted_mps - speed_mps) / step_s).clamp(-most_mps2, most_mps2);
        // Beyond the friction circle no input is allowed; the state is kept, and the check reports it.
        values = vehicle.after(Model::Ks, values, [rate_radps, accel_mps2], step_s).unwrap_or(values);
        followed.push(state(vehicle, &states[k + 1], &values));
    }
    followed
}

/// Rear axle of each state: its course is that of its motion, and the heading where it is slow.
fn targets(vehicle: &Vehicle, states: &[SolutionState]) -> Vec<Target> {
    let rear: Vec<Point2> = states
        .iter()
        .map(|state| {
            let [x, y, ..] = vehicle.values(Model::Ks, state);
            Point2::new(x, y)
        })
        .collect();
    let target = |(k, state): (usize, &SolutionState)| {
        let (from, to) = (rear[k.saturating_sub(1)], rear[(k + 1).min(rear.len() - 1)]);
        let is_slow = state.speed_mps < SLOW_MPS || k == 0;
        let course_rad = if is_slow { state.heading_rad } else { (to - from).heading() };
        Target { at: rear[k], course_rad, speed_mps: state.speed_mps }
    };
    states.iter().enumerate().map(target).collect()
}

/// State of a solution with these values of the kinematic model.
fn state(vehicle: &Vehicle, of: &SolutionState, values: &[f64; 7]) -> SolutionState {
    let [x, y, steering_rad, speed_mps, heading_rad, ..] = *values;
    let (sin, cos) = math::sin_cos(heading_rad);
    SolutionState {
        step: of.step,
        position: Point2::new(x + vehicle.rear_m * cos, y + vehicle.rear_m * sin),
        heading_rad,
        speed_mps,
        steering_rad,
        yaw_rate_radps: speed_mps * math::tan(steering_rad) / vehicle.wheelbase_m(),
        slip_rad: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CostFunction, Driven, VehicleKind, misses};

    /// A change of lanes at 15 m/s and a stop, with a body that is turned outwards of the course by a slip angle.
    #[test]
    fn kinematic_vehicle_follows_a_drive_with_slip_within_centimetres() {
        let kind = VehicleKind::Bmw320i;
        let vehicle = kind.vehicle();
        let step_s = 0.1;
        let mut drive = Vec::new();
        let mut way_m = 0.0;
        for step in 0..120_u32 {
            let t_s = step_s * f64::from(step);
            let speed_mps = (15.0 - 3.0 * (t_s - 6.0).max(0.0)).max(0.0);
            // From the right lane to the left one over 60 m.
            let share = (way_m / 60.0_f64).clamp(0.0, 1.0);
            let turn = core::f64::consts::TAU * share;
            let y_m = 3.5 * (share - math::sin(turn) / core::f64::consts::TAU);
            let slope = 3.5 / 60.0 * (1.0 - math::cos(turn));
            let slip_rad = -0.02 * math::sin(turn);
            let heading_rad = math::atan(slope) - slip_rad;
            let rear: Point2 = Point2::new(way_m, y_m);
            drive.push(SolutionState {
                step,
                position: Point2::new(
                    rear.x_m + vehicle.rear_m * math::cos(heading_rad),
                    rear.y_m + vehicle.rear_m * math::sin(heading_rad),
                ),
                heading_rad,
                speed_mps,
                steering_rad: 0.0,
                yaw_rate_radps: 0.0,
                slip_rad,
            });
            let next_mps = (15.0 - 3.0 * (t_s + step_s - 6.0).max(0.0)).max(0.0);
            way_m += 0.5 * (speed_mps + next_mps) * step_s;
        }
        let states = followed(&vehicle, &drive, step_s);
        let off_m =
            states.iter().zip(&drive).map(|(a, b)| a.position.distance(b.position)).fold(0.0, f64::max);
        assert!(off_m < 0.15, "{off_m}");
        let driven =
            |model, states| Driven { problem: 1, model, vehicle: kind, cost: CostFunction::Sm1, states };
        assert_eq!(misses(&driven(Model::Ks, states), step_s), []);
        assert!(!misses(&driven(Model::Ks, drive), step_s).is_empty(), "the drive itself slips");
    }
}
