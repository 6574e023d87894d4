//! Initialisation from the first measurements: roll and pitch from gravity at rest, heading from prior knowledge or
//! from the course between two fixes.

use nalgebra::{UnitQuaternion, Vector3};
use swerve_core::Time;
use swerve_geom::math;

use super::estimate::{Entry, Initial, Sensed};
use crate::eskf::{
    ACCEL_BIAS, ATTITUDE, Covariance, Eskf, GYRO_BIAS, Nominal, OFFSET, POSITION, SCALE, VELOCITY, from_euler,
};
use crate::params::Params;

/// First indices of the states whose variances are given by the initial state.
pub(super) const KNOWN: [usize; 3] = [POSITION, VELOCITY, ATTITUDE];
/// First indices of the states whose variances are given by the sensor parameters.
pub(super) const LEARNT: [usize; 4] = [ACCEL_BIAS, GYRO_BIAS, OFFSET, SCALE];

/// Lowest speed for a course from two fixes, m/s.
const COURSE_MPS: f64 = 2.0;
/// Largest standard deviation of a course, radians.
const COURSE_RAD: f64 = 0.15;
/// Largest time between two fixes of a course, as the chord of an arc, seconds.
const CHORD_S: f64 = 5.0;
/// Largest speed that counts as standstill, m/s.
const STANDSTILL_MPS: f64 = 0.05;

/// An initial state and the standard deviations of its nine numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Begin {
    pub(super) position_m: Vector3<f64>,
    pub(super) velocity_mps: Vector3<f64>,
    pub(super) attitude: UnitQuaternion<f64>,
    /// Standard deviations of position (without the offset of fixes), velocity and attitude.
    pub(super) sigma: [[f64; 3]; 3],
    /// True if the position is from a fix, and so includes the common offset of fixes.
    pub(super) by_fix: bool,
}

impl Default for Begin {
    fn default() -> Self {
        let zero = Vector3::zeros();
        Self {
            position_m: zero,
            velocity_mps: zero,
            attitude: UnitQuaternion::identity(),
            sigma: [[1.0; 3]; 3],
            by_fix: false,
        }
    }
}

impl From<&Initial> for Begin {
    fn from(initial: &Initial) -> Self {
        let Initial { position_m, velocity_mps, attitude, sigma } = *initial;
        Self { position_m, velocity_mps, attitude, sigma: sigma.map(|s| [s; 3]), by_fix: false }
    }
}

impl Begin {
    /// Creates the filter with this initial state.
    pub(super) fn filter(&self, params: &Params) -> Eskf {
        let mut covariance = Covariance::zeros();
        for (from, sigma) in KNOWN.into_iter().zip(self.sigma) {
            for (i, s) in sigma.into_iter().enumerate() {
                covariance[(from + i, from + i)] = s * s;
            }
        }
        let own = [params.accel_bias_mps2, params.gyro_bias_radps, params.offset_m, params.wheel_scale];
        for ((from, count), s) in LEARNT.into_iter().zip([3, 3, 2, 1]).zip(own) {
            for i in from..from + count {
                covariance[(i, i)] = s * s;
            }
        }
        if self.by_fix {
            // Position and fix offset are correlated: the position has the error of the fix.
            for i in 0..2 {
                let (p, o) = (KNOWN[0] + i, LEARNT[2] + i);
                let common = params.offset_m * params.offset_m;
                covariance[(p, p)] += common;
                covariance[(p, o)] = -common;
                covariance[(o, p)] = -common;
            }
        }
        let nominal = Nominal {
            position_m: self.position_m,
            velocity_mps: self.velocity_mps,
            attitude: self.attitude,
            accel_bias_mps2: Vector3::zeros(),
            gyro_bias_radps: Vector3::zeros(),
            offset_m: [0.0; 2],
            wheel_scale: 0.0,
        };
        Eskf { nominal, covariance }
    }
}

/// A fix, and the car's turn since then.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    stamp: Time,
    at_m: [f64; 3],
    sigma_m: f64,
    turned_rad: f64,
}

/// Measurements collected for initialisation.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Start {
    accel_sum_mps2: Vector3<f64>,
    readings: u32,
    last_turn: Option<(Time, f64)>,
    wheels_mps: Option<f64>,
    anchor: Option<Anchor>,
}

impl Start {
    /// Processes a measurement; returns the initial state once it is determined.
    pub(super) fn take(
        &mut self,
        params: &Params,
        heading: Option<[f64; 2]>,
        entry: &Entry,
    ) -> Option<Begin> {
        match entry.what {
            Sensed::Imu { accel_mps2, gyro_radps } => {
                self.accel_sum_mps2 += Vector3::from(accel_mps2);
                self.readings += 1;
                if let (Some((last, turn)), Some(anchor)) = (self.last_turn, &mut self.anchor) {
                    anchor.turned_rad += turn * (entry.stamp - last).as_secs();
                }
                self.last_turn = Some((entry.stamp, gyro_radps[2]));
                None
            }
            Sensed::Wheels { speed_mps, .. } => {
                self.wheels_mps = Some(speed_mps);
                if speed_mps.abs() > STANDSTILL_MPS {
                    (self.accel_sum_mps2, self.readings) = (Vector3::zeros(), 0);
                }
                None
            }
            Sensed::Fix { at_m, sigma_m } => {
                let begin = self.fixed(params, heading, entry.stamp, at_m, sigma_m);
                let sigma_m = sigma_m[0].max(sigma_m[1]);
                if self.anchor.is_none_or(|anchor| (entry.stamp - anchor.stamp).as_secs() > CHORD_S) {
                    self.anchor = Some(Anchor { stamp: entry.stamp, at_m, sigma_m, turned_rad: 0.0 });
                }
                begin
            }
            Sensed::Place { .. } | Sensed::Pose { .. } => None,
        }
    }

    fn fixed(
        &self,
        params: &Params,
        heading: Option<[f64; 2]>,
        stamp: Time,
        at_m: [f64; 3],
        sigma_m: [f64; 3],
    ) -> Option<Begin> {
        // At least one inertial reading is required for levelling and propagation.
        self.last_turn?;
        let course = self.anchor.and_then(|anchor| course(&anchor, stamp, at_m, sigma_m));
        let [yaw, yaw_sigma] = match (heading, course) {
            (Some(known), _) => known,
            (None, Some(course)) => [course.yaw_rad, course.sigma_rad],
            (None, None) => return None,
        };
        let (speed, speed_sigma) = match (self.wheels_mps, course) {
            (Some(speed_mps), _) => (speed_mps, 0.3),
            (None, Some(course)) => (course.speed_mps, course.speed_sigma_mps),
            (None, None) => return None,
        };
        let (roll, pitch, level) = self.level(params);
        let attitude = from_euler(roll, pitch, yaw);
        let lever = Vector3::from(params.antenna_at_m) - Vector3::from(params.imu_at_m);
        Some(Begin {
            position_m: Vector3::from(at_m) - attitude * lever,
            velocity_mps: attitude * (Vector3::x() * speed),
            attitude,
            sigma: [sigma_m, [speed_sigma.max(speed.abs() * yaw_sigma); 3], [level, level, yaw_sigma]],
            by_fix: params.offset_m > 0.0,
        })
    }

    /// Roll, pitch and their standard deviation: from gravity at rest, else those of a level road.
    fn level(&self, params: &Params) -> (f64, f64, f64) {
        let rests = self.wheels_mps.is_some_and(|speed| speed.abs() <= STANDSTILL_MPS) && self.readings > 0;
        if !rests {
            return (0.0, 0.0, params.level_rad);
        }
        let up = self.accel_sum_mps2 * params.gravity_mps2.signum();
        let roll = math::atan2(up.y, up.z);
        let pitch = math::atan2(-up.x, math::hypot(up.y, up.z));
        (roll, pitch, (params.accel_bias_mps2 / params.gravity_mps2.abs().max(1.0)).max(0.003))
    }
}

/// Course and speed between two fixes.
#[derive(Clone, Copy)]
struct Course {
    yaw_rad: f64,
    sigma_rad: f64,
    speed_mps: f64,
    speed_sigma_mps: f64,
}

fn course(anchor: &Anchor, stamp: Time, at_m: [f64; 3], sigma_m: [f64; 3]) -> Option<Course> {
    let dt_s = (stamp - anchor.stamp).as_secs();
    if dt_s <= 0.0 || dt_s > CHORD_S {
        return None;
    }
    let (dx, dy) = (at_m[0] - anchor.at_m[0], at_m[1] - anchor.at_m[1]);
    let way_m = math::hypot(dx, dy);
    let sigma_m = math::hypot(anchor.sigma_m, sigma_m[0].max(sigma_m[1]));
    let sure = way_m > COURSE_MPS * dt_s && sigma_m <= COURSE_RAD * way_m;
    sure.then(|| Course {
        // The tangent at the end of an arc differs from the chord by half of the turn.
        yaw_rad: math::atan2(dy, dx) + 0.5 * anchor.turned_rad,
        sigma_rad: sigma_m / way_m + 0.1 * anchor.turned_rad.abs(),
        speed_mps: way_m / dt_s,
        // Allows for acceleration or braking at 1 m/s² in between.
        speed_sigma_mps: sigma_m / dt_s + 0.5 * dt_s,
    })
}
