//! The kinematic single-track model: wheels roll without slip, within the car's limits.

use swerve_geom::{Pose2, math};

use crate::{Limits, VehicleParams};

/// State of the kinematic model.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct KinematicState {
    /// Pose of the ego origin (centre of the rear axle).
    pub pose: Pose2,
    /// Speed of the ego origin along its heading, m/s, never negative.
    pub speed_mps: f64,
    /// Angle of the front road wheels, radians.
    pub steering_rad: f64,
}

/// A car whose wheels roll without slip.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Kinematic {
    /// Distance between the axles, metres.
    pub wheelbase_m: f64,
    /// Bounds that commands are clamped to.
    pub limits: Limits,
}

impl Kinematic {
    /// Creates the kinematic model of a car.
    pub fn new(params: &VehicleParams) -> Self {
        Self { wheelbase_m: params.shape.wheelbase_m, limits: params.limits }
    }

    /// Yaw rate at a speed and steering angle, rad/s.
    pub fn yaw_rate_radps(&self, speed_mps: f64, steering_rad: f64) -> f64 {
        speed_mps * math::tan(steering_rad) / self.wheelbase_m
    }

    /// The largest steering angle at which the lateral acceleration stays within the limits at this speed, radians.
    pub fn steering_max_rad(&self, speed_mps: f64) -> f64 {
        let v2 = (speed_mps * speed_mps).max(1e-9);
        math::atan(self.wheelbase_m * self.limits.lateral_accel_max_mps2 / v2)
            .min(self.limits.steering_max_rad)
    }

    /// Advances one step towards the target steering angle at the target acceleration: steering is bounded by angle,
    /// rate and lateral acceleration, acceleration by the limits; the speed never becomes negative.
    ///
    /// The pose moves along the arc of the step's mean speed and curvature, which is exact while both hold.
    pub fn step(
        &self,
        state: KinematicState,
        steering_rad: f64,
        accel_mps2: f64,
        dt_s: f64,
    ) -> KinematicState {
        let limits = &self.limits;
        let accel = accel_mps2.clamp(-limits.brake_max_mps2, limits.accel_max_mps2);
        let speed = (state.speed_mps + accel * dt_s).max(0.0);
        let angle_most = self.steering_max_rad(speed);
        let turn_most = limits.steering_rate_max_radps * dt_s;
        let wanted = steering_rad.clamp(-angle_most, angle_most);
        let steering = state.steering_rad + (wanted - state.steering_rad).clamp(-turn_most, turn_most);
        let travelled_s = if accel < 0.0 && speed <= 0.0 { state.speed_mps / -accel } else { dt_s };
        let way = 0.5 * (state.speed_mps + speed) * travelled_s;
        let mean_steering = 0.5 * (state.steering_rad + steering);
        let turned = way * math::tan(mean_steering) / self.wheelbase_m;
        // Chord of the arc: its direction is half the turn, its length the distance times sin(x)/x.
        let half = 0.5 * turned;
        let chord = if half.abs() < 1e-6 { way } else { way * math::sin(half) / half };
        let (sin, cos) = math::sin_cos(state.pose.heading_rad + half);
        KinematicState {
            pose: Pose2::new(
                state.pose.x_m + chord * cos,
                state.pose.y_m + chord * sin,
                state.pose.heading_rad + turned,
            ),
            speed_mps: speed,
            steering_rad: steering,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car() -> Kinematic {
        Kinematic::new(&VehicleParams::default())
    }

    /// A quarter of a circle of radius `L / tan(delta)` around the point to the left.
    #[test]
    fn kinematic_car_drives_circles() {
        let steering_rad = 0.3;
        let radius_m = 2.85 / math::tan(steering_rad);
        let dt_s = 0.01;
        let quarter_s = core::f64::consts::FRAC_PI_2 * radius_m / 4.0;
        let mut state = KinematicState { speed_mps: 4.0, steering_rad, ..KinematicState::default() };
        let steps = 100;
        for _ in 0..steps {
            state = car().step(state, steering_rad, 0.0, quarter_s / f64::from(steps));
        }
        assert!((state.pose.x_m - radius_m).abs() < 1e-9 && (state.pose.y_m - radius_m).abs() < 1e-9);
        let next = car().step(state, steering_rad, 0.0, dt_s);
        let turned = next.pose.heading_rad - state.pose.heading_rad;
        assert!((turned / dt_s - car().yaw_rate_radps(4.0, steering_rad)).abs() < 1e-9);
    }

    #[test]
    fn kinematic_car_stops_at_the_closed_form_distance_and_stays() {
        let mut state = KinematicState { speed_mps: 10.0, ..KinematicState::default() };
        for _ in 0..200 {
            state = car().step(state, 0.0, -99.0, 0.01);
        }
        assert_eq!(state.speed_mps, 0.0);
        assert!((state.pose.x_m - 100.0 / 16.0).abs() < 1e-9, "{state:?}");
    }

    #[test]
    fn kinematic_car_keeps_rate_angle_and_lateral_acceleration() {
        let mut state = KinematicState { speed_mps: 20.0, ..KinematicState::default() };
        for _ in 0..100 {
            let next = car().step(state, 1.0, 0.0, 0.01);
            assert!(next.steering_rad - state.steering_rad <= 0.007 + 1e-12);
            state = next;
        }
        let lateral = state.speed_mps * car().yaw_rate_radps(state.speed_mps, state.steering_rad);
        assert!((lateral - 7.85).abs() < 1e-6, "{lateral}");
        assert!((car().steering_max_rad(0.0) - 0.61).abs() < 1e-12);
    }
}
