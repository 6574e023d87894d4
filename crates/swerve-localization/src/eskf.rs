//! Error-state Kalman filter: 15 states of motion, the offset of satellite fixes (2) and the scale of the wheels (1).
//!
//! The nominal state is that of the inertial unit in the map; the attitude error is local (`R = R̂ exp(δθ)`), as in
//! Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, sections 5 to 7. Updates use the Joseph
//! form, followed by the reset of the error. Matrix products use one fixed order: the same bits on every machine.

use nalgebra::{Matrix3, Quaternion, SMatrix, SVector, UnitQuaternion, Vector3};
use swerve_geom::math;

use crate::params::Params;

/// Number of error states.
pub const STATES: usize = 18;
/// Index of each error: position, velocity, attitude, accelerometer biases, gyroscope biases, offset of the fixes
/// east and north, wheel scale.
pub(crate) const POSITION: usize = 0;
pub(crate) const VELOCITY: usize = 3;
pub(crate) const ATTITUDE: usize = 6;
pub(crate) const ACCEL_BIAS: usize = 9;
pub(crate) const GYRO_BIAS: usize = 12;
pub(crate) const OFFSET: usize = 15;
pub(crate) const SCALE: usize = 17;

/// Covariance of the error.
pub type Covariance = SMatrix<f64, STATES, STATES>;

/// Nominal state, at the inertial unit.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Nominal {
    /// Position in the map, metres.
    pub position_m: Vector3<f64>,
    /// Velocity in the map, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Rotation from the vehicle's axes to the map's.
    pub attitude: UnitQuaternion<f64>,
    /// Accelerometer biases, m/s²: measured minus true.
    pub accel_bias_mps2: Vector3<f64>,
    /// Gyroscope biases, rad/s: measured minus true.
    pub gyro_bias_radps: Vector3<f64>,
    /// Offset of fixes from the antenna's true position, east and north, metres.
    pub offset_m: [f64; 2],
    /// Ratio of measured to true wheel speed, minus 1.
    pub wheel_scale: f64,
}

/// Result of a measurement update.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Innovation {
    /// Normalised innovation squared; chi-square distributed.
    pub nis: f64,
    /// True if it passed the gate and the state was updated.
    pub accepted: bool,
}

/// A linearised measurement: `residual = measured - expected`, `rows` is its Jacobian by the error states.
pub(crate) struct Linear<const M: usize> {
    pub(crate) residual: SVector<f64, M>,
    pub(crate) rows: SMatrix<f64, M, STATES>,
    pub(crate) noise: SMatrix<f64, M, M>,
}

/// The filter: nominal state and covariance of its error.
#[derive(Clone, Debug)]
pub struct Eskf {
    /// Nominal state.
    pub nominal: Nominal,
    /// Covariance of the error.
    pub covariance: Covariance,
}

impl Eskf {
    /// Propagates by `dt_s` with a specific force and a turn rate, both as measured and taken as constant.
    pub fn predict(
        &mut self,
        params: &Params,
        accel_mps2: &Vector3<f64>,
        gyro_radps: &Vector3<f64>,
        dt_s: f64,
    ) {
        let n = &self.nominal;
        let force = accel_mps2 - n.accel_bias_mps2;
        let rotation = n.attitude.to_rotation_matrix().into_inner();
        let accel = rotation * force - Vector3::new(0.0, 0.0, params.gravity_mps2);
        // The paper's Jacobian uses the acceleration in the map instead of the specific force in the vehicle frame.
        let turned_by = match params.gravity_free_jacobian {
            false => -skew(&force),
            true => -skew(&accel) * rotation,
        };
        let turned_rad = (gyro_radps - n.gyro_bias_radps) * dt_s;
        self.step(params, &Motion { rotation, accel, turned_by, turned_rad, by_unit: true }, dt_s);
    }

    /// Propagates by `dt_s` with an acceleration (m/s²) and a turn rate (rad/s) along and about the vehicle's axes
    /// that are not from the inertial unit: gravity and the unit's biases are not involved, and later updates do not
    /// estimate the biases from this step.
    pub(crate) fn predict_without_unit(
        &mut self,
        params: &Params,
        accel_mps2: &Vector3<f64>,
        turn_radps: &Vector3<f64>,
        dt_s: f64,
    ) {
        let rotation = self.nominal.attitude.to_rotation_matrix().into_inner();
        let motion = Motion {
            rotation,
            accel: rotation * accel_mps2,
            turned_by: -skew(accel_mps2),
            turned_rad: turn_radps * dt_s,
            by_unit: false,
        };
        self.step(params, &motion, dt_s);
    }

    fn step(&mut self, params: &Params, motion: &Motion, dt_s: f64) {
        let Motion { rotation, accel, turned_rad, .. } = motion;
        let n = &mut self.nominal;
        let turn = exp(turned_rad);
        n.position_m += n.velocity_mps * dt_s + accel * (0.5 * dt_s * dt_s);
        n.velocity_mps += accel * dt_s;
        n.attitude = unit(n.attitude * turn);
        let forget = match params.offset_time_s > 0.0 {
            true => math::exp(-dt_s / params.offset_time_s),
            false => 1.0,
        };
        n.offset_m = n.offset_m.map(|x| x * forget);
        let bias_dt_s = if motion.by_unit { dt_s } else { 0.0 };
        let step = Step {
            dt_s,
            bias_dt_s,
            velocity_by_attitude: rotation * motion.turned_by * dt_s,
            velocity_by_bias: rotation * -bias_dt_s,
            attitude: turn.to_rotation_matrix().into_inner().transpose(),
            forget,
        };
        step.spread(&mut self.covariance);
        self.add_noise(params, rotation, turned_rad, dt_s, forget);
    }

    fn add_noise(
        &mut self,
        params: &Params,
        rotation: &Matrix3<f64>,
        turned_rad: &Vector3<f64>,
        dt_s: f64,
        forget: f64,
    ) {
        let p = &mut self.covariance;
        let square = |x: f64| x * x;
        let accel = Vector3::from(params.accel_noise.map(|d| square(d) * dt_s));
        let velocity = rotation * Matrix3::from_diagonal(&accel) * rotation.transpose();
        for j in 0..3 {
            for i in 0..3 {
                p[(VELOCITY + i, VELOCITY + j)] += velocity[(i, j)];
            }
            p[(ATTITUDE + j, ATTITUDE + j)] += square(params.gyro_noise[j]) * dt_s;
            // The error of a turn is `gyro_scale` times its angle; up to 2 rad, 2·|angle| bounds the angle squared.
            p[(ATTITUDE + j, ATTITUDE + j)] += 2.0 * square(params.gyro_scale) * turned_rad[j].abs();
            p[(ACCEL_BIAS + j, ACCEL_BIAS + j)] += square(params.accel_bias_walk) * dt_s;
            p[(GYRO_BIAS + j, GYRO_BIAS + j)] += square(params.gyro_bias_walk) * dt_s;
        }
        for j in OFFSET..SCALE {
            p[(j, j)] += square(params.offset_m) * (1.0 - forget * forget);
        }
        p[(SCALE, SCALE)] += square(params.wheel_scale_walk) * dt_s;
        symmetrise(p);
    }

    /// Updates the state by a measurement if its normalised innovation squared is at most `gate`.
    pub(crate) fn update<const M: usize>(
        &mut self,
        linear: &Linear<M>,
        gate: f64,
        degrees: bool,
    ) -> Innovation {
        let refused = Innovation { nis: f64::INFINITY, accepted: false };
        let across = self.covariance * linear.rows.transpose();
        let spread = linear.rows * across + linear.noise;
        let Some(inverse) = inverted(&spread) else { return refused };
        let nis = (linear.residual.transpose() * inverse * linear.residual)[0];
        if !nis.is_finite() {
            return refused;
        }
        if nis > gate {
            return Innovation { nis, accepted: false };
        }
        let gain = across * inverse;
        // (I - KH) P (I - KH)ᵀ + K R Kᵀ, with the products by I - KH expanded as subtractions.
        let once = self.covariance - gain * across.transpose();
        let twice = once - (once * linear.rows.transpose()) * gain.transpose();
        self.covariance = twice + gain * linear.noise * gain.transpose();
        symmetrise(&mut self.covariance);
        self.inject(&(gain * linear.residual), degrees);
        Innovation { nis, accepted: true }
    }

    /// Injects an error into the nominal state, and resets the error's frame.
    fn inject(&mut self, error: &SVector<f64, STATES>, degrees: bool) {
        let part = |from: usize| Vector3::new(error[from], error[from + 1], error[from + 2]);
        let n = &mut self.nominal;
        n.position_m += part(POSITION);
        n.velocity_mps += part(VELOCITY);
        let turn = part(ATTITUDE);
        // The paper's correction converts the angles as if they were degrees.
        let applied = if degrees { turn * (core::f64::consts::PI / 180.0) } else { turn };
        n.attitude = unit(n.attitude * exp(&applied));
        n.accel_bias_mps2 += part(ACCEL_BIAS);
        n.gyro_bias_radps += part(GYRO_BIAS);
        n.offset_m = [n.offset_m[0] + error[OFFSET], n.offset_m[1] + error[OFFSET + 1]];
        n.wheel_scale += error[SCALE];
        let reset = Matrix3::identity() - skew(&applied) * 0.5;
        let p = &mut self.covariance;
        let rows = reset * p.fixed_rows::<3>(ATTITUDE);
        p.fixed_rows_mut::<3>(ATTITUDE).copy_from(&rows);
        let columns = p.fixed_columns::<3>(ATTITUDE) * reset.transpose();
        p.fixed_columns_mut::<3>(ATTITUDE).copy_from(&columns);
    }

    /// Returns true if all numbers are finite and no variance is negative.
    pub fn is_sound(&self) -> bool {
        let n = &self.nominal;
        let numbers = n.position_m.iter().chain(&n.velocity_mps).chain(n.attitude.coords.iter());
        numbers.chain(self.covariance.iter()).all(|x| x.is_finite())
            && (0..STATES).all(|i| self.covariance[(i, i)] >= 0.0)
    }
}

/// Motion that propagates the nominal state.
struct Motion {
    /// Rotation from the vehicle's axes to the map's, before the step.
    rotation: Matrix3<f64>,
    /// Acceleration in the map, m/s².
    accel: Vector3<f64>,
    /// Derivative of the acceleration along the vehicle's axes by the attitude error, m/s².
    turned_by: Matrix3<f64>,
    /// Rotation about the vehicle's axes, radians.
    turned_rad: Vector3<f64>,
    /// True if the inertial unit measured it, with its biases.
    by_unit: bool,
}

/// Transition matrix of one step: its blocks that differ from the identity.
struct Step {
    dt_s: f64,
    /// Step for the biases of the inertial unit; 0 without it.
    bias_dt_s: f64,
    velocity_by_attitude: Matrix3<f64>,
    velocity_by_bias: Matrix3<f64>,
    attitude: Matrix3<f64>,
    forget: f64,
}

impl Step {
    /// `F P Fᵀ`: the same linear combination of rows, then of columns. `P` is symmetric, so both are done on columns
    /// with a transposition in between.
    fn spread(&self, p: &mut Covariance) {
        self.change_columns(p);
        p.transpose_mut();
        self.change_columns(p);
    }

    /// `P Fᵀ`, column by column.
    fn change_columns(&self, p: &mut Covariance) {
        let columns = p.as_mut_slice().as_chunks_mut::<STATES>().0;
        for i in 0..3 {
            // Position columns are updated first: they need the old velocity columns.
            let velocity = columns[VELOCITY + i];
            add(&mut columns[POSITION + i], &velocity, self.dt_s);
        }
        for i in 0..3 {
            for j in 0..3 {
                let (attitude, bias) = (columns[ATTITUDE + j], columns[ACCEL_BIAS + j]);
                add(&mut columns[VELOCITY + i], &attitude, self.velocity_by_attitude[(i, j)]);
                add(&mut columns[VELOCITY + i], &bias, self.velocity_by_bias[(i, j)]);
            }
        }
        let old = [columns[ATTITUDE], columns[ATTITUDE + 1], columns[ATTITUDE + 2]];
        for i in 0..3 {
            columns[ATTITUDE + i] = columns[GYRO_BIAS + i].map(|x| -self.bias_dt_s * x);
            for (j, old) in old.iter().enumerate() {
                add(&mut columns[ATTITUDE + i], old, self.attitude[(i, j)]);
            }
        }
        for column in &mut columns[OFFSET..SCALE] {
            column.iter_mut().for_each(|x| *x *= self.forget);
        }
    }
}

fn add(to: &mut [f64; STATES], what: &[f64; STATES], times: f64) {
    to.iter_mut().zip(what).for_each(|(to, x)| *to += times * x);
}

/// Replaces a matrix by the mean of itself and its transpose.
fn symmetrise(p: &mut Covariance) {
    for j in 0..STATES {
        for i in 0..j {
            let mean = 0.5 * (p[(i, j)] + p[(j, i)]);
            p[(i, j)] = mean;
            p[(j, i)] = mean;
        }
    }
}

/// Inverse of a 1x1 to 3x3 covariance; `None` if it is not positive definite.
fn inverted<const M: usize>(spread: &SMatrix<f64, M, M>) -> Option<SMatrix<f64, M, M>> {
    // Gauss-Jordan elimination without pivoting: the pivots of a positive definite matrix are positive.
    let (mut left, mut right) = (*spread, SMatrix::<f64, M, M>::identity());
    for k in 0..M {
        let pivot = left[(k, k)];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        for j in 0..M {
            left[(k, j)] /= pivot;
            right[(k, j)] /= pivot;
        }
        for i in (0..M).filter(|i| *i != k) {
            let times = left[(i, k)];
            for j in 0..M {
                left[(i, j)] -= times * left[(k, j)];
                right[(i, j)] -= times * right[(k, j)];
            }
        }
    }
    Some(right)
}

/// Cross-product matrix of a vector.
pub(crate) fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Exponential map: rotation about the vector's axis by its length, radians.
pub(crate) fn exp(v: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle = v.dot(v).sqrt();
    if angle.is_nan() || angle <= 1e-12 {
        return unit_of(Quaternion::new(1.0, 0.5 * v.x, 0.5 * v.y, 0.5 * v.z));
    }
    let (sin, cos) = math::sin_cos(0.5 * angle);
    let k = sin / angle;
    unit_of(Quaternion::new(cos, k * v.x, k * v.y, k * v.z))
}

/// Angle of the rotation between two attitudes, radians.
pub fn angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    let between = a.inverse() * b;
    let v = between.coords.xyz();
    2.0 * math::atan2(v.dot(&v).sqrt(), between.coords.w.abs())
}

/// Attitude from roll, pitch and yaw, rotated about z, then y, then x.
pub fn from_euler(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> UnitQuaternion<f64> {
    exp(&(Vector3::z() * yaw_rad)) * exp(&(Vector3::y() * pitch_rad)) * exp(&(Vector3::x() * roll_rad))
}

/// Heading: direction of the x axis on the ground, radians.
pub fn yaw_rad(attitude: &UnitQuaternion<f64>) -> f64 {
    let forward = attitude.to_rotation_matrix().into_inner().column(0).into_owned();
    math::atan2(forward.y, forward.x)
}

/// Normalises a rotation, whose length drifts with repeated products.
pub(crate) fn unit(q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    unit_of(q.into_inner())
}

fn unit_of(q: Quaternion<f64>) -> UnitQuaternion<f64> {
    let norm = q.coords.dot(&q.coords).sqrt();
    UnitQuaternion::new_unchecked(Quaternion::from(q.coords / norm))
}

#[cfg(test)]
mod tests;
