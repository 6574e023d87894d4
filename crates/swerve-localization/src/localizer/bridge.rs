//! Propagation without an inertial unit: by wheels and steering angle.

use nalgebra::{Matrix3, Vector3};
use swerve_geom::math;

use super::fold::Fold;
use crate::eskf::{ATTITUDE, VELOCITY};
use crate::params::Params;

/// Process noise without an inertial unit. Accelerations in m/s²/√Hz: braking, sliding and bumps at their hardest;
/// rotations in rad/s/√Hz: roll and pitch, and yaw at its hardest for the case that the steering angle is unknown
/// too.
const BLIND_ACCEL: [f64; 3] = [5.0, 2.0, 1.0];
const BLIND_ROLL: f64 = 0.03;
const BLIND_YAW: f64 = 0.5;
/// Error of the yaw rate from the steering angle: absolute in rad/s, and as a share (understeer and steering play).
/// Its correlation time is about one second.
const STEERED_RADPS: f64 = 0.02;
const STEERED_SHARE: f64 = 0.1;
/// A steering angle or a wheel speed is valid for this long, seconds.
const WHEELS_HOLD_S: f64 = 0.4;

impl Fold {
    /// Inflates velocity and attitude variances by the noise that a noisy unit added before it was detected.
    pub(super) fn open_leaked(&mut self, params: &Params) {
        let [velocity, attitude] = self.unit.leaked(params);
        for axis in 0..3 {
            self.filter.covariance[(VELOCITY + axis, VELOCITY + axis)] += velocity;
            self.filter.covariance[(ATTITUDE + axis, ATTITUDE + axis)] += attitude;
        }
    }

    /// Propagates without an inertial unit: at constant speed along the circle given by the steering angle, with
    /// large process noise.
    pub(super) fn bridge(&mut self, params: &Params, dt_s: f64) {
        let steered = self.steered_radps();
        let rate_radps = steered.unwrap_or(0.0);
        let yaw_noise = match steered {
            // At standstill the car does not turn.
            Some(_) if self.wheels.standing_since.is_some() => 0.0,
            Some(rate) => core::f64::consts::SQRT_2 * math::hypot(STEERED_RADPS, STEERED_SHARE * rate),
            None => BLIND_YAW,
        };
        let gyro_noise = [BLIND_ROLL, BLIND_ROLL, yaw_noise];
        let blind = Params { accel_noise: BLIND_ACCEL, gyro_noise, gyro_scale: 0.0, ..*params };
        let accel = Vector3::new(0.0, rate_radps * self.axle_mps().x, 0.0);
        let turn = Vector3::new(0.0, 0.0, rate_radps);
        self.filter.predict_without_unit(&blind, &accel, &turn, dt_s);
    }

    /// Yaw rate from the steering angle at the wheel speed, rad/s; `None` without a recent angle.
    pub(super) fn steered_radps(&self) -> Option<f64> {
        let (stamp, curvature_1pm) = self.wheels.curvature_1pm?;
        let is_fresh = (self.at - stamp).as_secs() <= WHEELS_HOLD_S;
        is_fresh.then(|| curvature_1pm * self.speed_mps())
    }

    /// Advances both odometry paths: the steering angle replaces an inertial unit that is not used.
    pub(super) fn go(&mut self, dt_s: f64) {
        let speed_mps = self.speed_mps();
        let gyro_radps = self.imu.map_or(0.0, |imu| imu.gyro_radps.z - self.filter.nominal.gyro_bias_radps.z);
        let steered = self.wheels.curvature_1pm.map_or(gyro_radps, |(_, curvature)| curvature * speed_mps);
        let turned = if self.is_bridging { steered } else { gyro_radps };
        for (way, rate_radps) in self.ways.iter_mut().zip([turned, steered]) {
            way.go(speed_mps * dt_s, rate_radps * dt_s);
        }
    }

    /// Speed from the wheels while their readings are recent, else from the filter, m/s.
    pub(super) fn speed_mps(&self) -> f64 {
        let is_heard = self.wheels.last.is_some_and(|last| (self.at - last).as_secs() <= WHEELS_HOLD_S);
        if is_heard { self.wheels.speed_mps } else { self.axle_mps().x }
    }

    pub(super) fn turn_radps(&self) -> Vector3<f64> {
        match self.imu.filter(|_| !self.is_bridging) {
            Some(imu) => imu.gyro_radps - self.filter.nominal.gyro_bias_radps,
            None => Vector3::new(0.0, 0.0, self.steered_radps().unwrap_or(0.0)),
        }
    }

    /// Acceleration along the ego's axes: from the unit, or centripetal on the car's circle.
    pub(super) fn accel_mps2(&self, params: &Params, rotation: &Matrix3<f64>) -> Vector3<f64> {
        let Some(imu) = self.imu.filter(|_| !self.is_bridging) else {
            return Vector3::new(0.0, self.turn_radps().z * self.axle_mps().x, 0.0);
        };
        self.without_gravity(params, imu.accel_mps2, rotation)
    }

    /// Acceleration of the inertial unit along the ego's axes, gravity and bias removed, m/s².
    fn without_gravity(&self, params: &Params, force: Vector3<f64>, rotation: &Matrix3<f64>) -> Vector3<f64> {
        let down = rotation.transpose() * Vector3::new(0.0, 0.0, -params.gravity_mps2);
        force - self.filter.nominal.accel_bias_mps2 + down
    }

    /// Forward acceleration for a reading of the accelerometers, m/s².
    pub(super) fn forward_mps2(&self, params: &Params, accel_mps2: [f64; 3]) -> f64 {
        let rotation = self.filter.nominal.attitude.to_rotation_matrix().into_inner();
        self.without_gravity(params, Vector3::from(accel_mps2), &rotation).x
    }
}
