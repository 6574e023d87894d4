//! Measurements, and the estimates made from them.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use swerve_core::Time;

use crate::params::Params;

/// A sensor measurement.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Sensed {
    /// Specific force (m/s²) and angular rate (rad/s) along and about the vehicle's axes.
    Imu {
        /// Acceleration minus gravity.
        accel_mps2: [f64; 3],
        /// Angular rate.
        gyro_radps: [f64; 3],
    },
    /// Satellite fix in map coordinates.
    Fix {
        /// East, north, up, metres.
        at_m: [f64; 3],
        /// Standard deviation of each, without the common offset that the filter estimates.
        sigma_m: [f64; 3],
    },
    /// Position of the inertial unit from a source other than satellites.
    Place {
        /// Position in the map, metres.
        at_m: [f64; 3],
        /// Standard deviation of each coordinate.
        sigma_m: [f64; 3],
    },
    /// Position and heading of the ego origin from map matching.
    Pose {
        /// Position in the map, metres.
        at_m: [f64; 3],
        /// Heading, radians.
        heading_rad: f64,
        /// Covariance of the position on the ground: xx, xy, yy, m². Large along directions that the match does not
        /// constrain.
        covariance_m2: [f64; 3],
        /// Standard deviations of height (m) and heading (rad).
        sigma: [f64; 2],
    },
    /// Wheel odometry.
    Wheels {
        /// Speed of the rear axle, averaged since the previous reading, m/s.
        speed_mps: f64,
        /// Path curvature from the steering angle, 1/m, positive to the left; `None` if it is not measured.
        curvature_1pm: Option<f64>,
    },
}

/// A kind of measurement for which innovations are counted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Source {
    /// Satellite fixes.
    Fix,
    /// Positions from other sources, including those of poses.
    Place,
    /// Headings of poses.
    Heading,
    /// Speed from the wheels.
    Wheels,
    /// Constraint: no lateral or vertical velocity of the rear axle.
    NonHolonomic,
    /// Constraint: the vehicle is at rest.
    Standing,
}

/// Innovation statistics of one source.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Tally {
    /// Accepted measurements.
    pub taken: u64,
    /// Refused measurements.
    pub refused: u64,
    /// Sum of the normalised innovations squared of accepted measurements.
    pub nis_sum: f64,
    /// Consecutive refusals up to now.
    pub refused_in_a_row: u32,
    /// Moving average of the normalised innovation squared per degree of freedom, refused ones included: 1 for a
    /// consistent filter.
    pub recent_nis: f64,
}

/// Result of passing a measurement to the localizer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Taken {
    /// It is the newest.
    InOrder,
    /// It was late, and the measurements after it were filtered again.
    Late,
    /// It is older than the stored history.
    TooLate,
    /// It is invalid: a number is not finite or outside the range of the sensor.
    Nonsense,
}

/// Quality of a pose.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Mode {
    /// Fixes are received and accepted.
    Good,
    /// Fixes or matches are accepted, but their noise is measured to be far above the reported one.
    Noisy,
    /// Dead reckoning without fixes, fixes and wheels without the inertial unit, or contested fixes.
    Coasting,
    /// Unusable for driving: not initialised, too uncertain, or inconsistent with the sensors.
    #[default]
    Lost,
}

/// Pose and velocity of the ego origin, with covariances.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Estimate {
    /// Instant that this describes.
    pub stamp: Time,
    /// Ego origin in the map, metres.
    pub position_m: Vector3<f64>,
    /// Rotation from the ego's axes to the map's.
    pub attitude: UnitQuaternion<f64>,
    /// Heading, radians.
    pub heading_rad: f64,
    /// Velocity of the ego origin along the ego's axes, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Acceleration at the inertial unit along the ego's axes, gravity removed, m/s².
    pub accel_mps2: Vector3<f64>,
    /// Angular rate about the ego's x axis, rad/s.
    pub roll_rate_radps: f64,
    /// Angular rate about the ego's z axis, rad/s.
    pub yaw_rate_radps: f64,
    /// Covariance of x (m), y (m) and heading (rad).
    pub covariance: Matrix3<f64>,
    /// Covariance of the position, m².
    pub position_covariance: Matrix3<f64>,
    /// Quality of the pose.
    pub mode: Mode,
}

impl Estimate {
    /// Standard deviation of the position on the ground along its worst direction, metres.
    pub fn sigma_m(&self) -> f64 {
        let c = &self.covariance;
        let (mean, half) = (0.5 * (c[(0, 0)] + c[(1, 1)]), 0.5 * (c[(0, 0)] - c[(1, 1)]));
        (mean + (half * half + c[(0, 1)] * c[(0, 1)]).sqrt()).max(0.0).sqrt()
    }
}

/// A known initial state of the inertial unit.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Initial {
    /// Position in the map, metres.
    pub position_m: Vector3<f64>,
    /// Velocity in the map, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Rotation from the vehicle's axes to the map's.
    pub attitude: UnitQuaternion<f64>,
    /// Standard deviations per axis of position (m), velocity (m/s) and attitude (rad).
    pub sigma: [f64; 3],
}

impl Initial {
    /// State of a car on level ground, with its ego origin at x and y (m), a heading (rad) and a wheel speed (m/s).
    /// `sigma` is the standard deviation of the position per axis (m) and of the heading (rad).
    pub fn level(params: &Params, pose: [f64; 3], speed_mps: f64, sigma: [f64; 2]) -> Self {
        let ([x_m, y_m, heading_rad], [place_m, turn_rad]) = (pose, sigma);
        let attitude = crate::eskf::from_euler(0.0, 0.0, heading_rad);
        Self {
            position_m: Vector3::new(x_m, y_m, 0.0) + attitude * Vector3::from(params.imu_at_m),
            velocity_mps: attitude * (Vector3::x() * speed_mps),
            attitude,
            sigma: [place_m, ROLLING_MPS.max(speed_mps.abs() * turn_rad), turn_rad],
        }
    }
}

/// Standard deviation of a wheel speed while the wheel scale is unknown, m/s.
const ROLLING_MPS: f64 = 0.3;

/// A measurement in the history.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Entry {
    pub(crate) stamp: Time,
    pub(crate) what: Sensed,
}

impl Entry {
    /// Sort key: stamp, then kind with the inertial unit first, then contents.
    pub(super) fn key(&self) -> (Time, u8, [u64; 9]) {
        let rank = match self.what {
            Sensed::Imu { .. } => 0,
            Sensed::Wheels { .. } => 1,
            Sensed::Fix { .. } => 2,
            Sensed::Place { .. } => 3,
            Sensed::Pose { .. } => 4,
        };
        (self.stamp, rank, self.what.numbers().map(f64::to_bits))
    }
}

impl Sensed {
    fn numbers(&self) -> [f64; 9] {
        match *self {
            Self::Imu { accel_mps2: [a, b, c], gyro_radps: [d, e, f] } => [a, b, c, d, e, f, 0.0, 0.0, 0.0],
            Self::Fix { at_m: [a, b, c], sigma_m: [d, e, f] }
            | Self::Place { at_m: [a, b, c], sigma_m: [d, e, f] } => [a, b, c, d, e, f, 0.0, 0.0, 0.0],
            Self::Pose { at_m: [a, b, c], heading_rad, covariance_m2: [d, e, f], sigma: [g, h] } => {
                [a, b, c, heading_rad, d, e, f, g, h]
            }
            Self::Wheels { speed_mps, curvature_1pm } => {
                [speed_mps, curvature_1pm.unwrap_or(0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
            }
        }
    }

    /// Returns true if the measurement is within the range of a sensor on a road vehicle.
    pub fn is_sound(&self) -> bool {
        let within = |of: [f64; 3], most: f64| of.iter().all(|x| x.abs() <= most);
        match *self {
            Self::Imu { accel_mps2, gyro_radps } => within(accel_mps2, 500.0) && within(gyro_radps, 100.0),
            Self::Fix { at_m, sigma_m } | Self::Place { at_m, sigma_m } => {
                within(at_m, 1e7) && sigma_m.iter().all(|s| (1e-4..=1e4).contains(s))
            }
            Self::Pose { at_m, heading_rad, covariance_m2: [xx, xy, yy], sigma } => {
                let is_covariance = [xx, yy].iter().all(|x| (1e-8..=1e8).contains(x)) && xy * xy < xx * yy;
                let sigmas = sigma.iter().all(|s| (1e-5..=1e4).contains(s));
                within(at_m, 1e7) && heading_rad.abs() <= 100.0 && is_covariance && sigmas
            }
            Self::Wheels { speed_mps, curvature_1pm } => {
                speed_mps.abs() <= 150.0 && curvature_1pm.is_none_or(|curvature| curvature.abs() <= 1.0)
            }
        }
    }
}
