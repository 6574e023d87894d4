//! A filter that accepts measurements in any order: a late one is inserted at its stamp, and those after it are
//! filtered again.
//!
//! ```text
//! measurements by stamp   |base|--a--b--c--(late)--d--e
//! states after them             1  2  3            5' 6'   re-filtered from the late one on
//! ```
//!
//! The state after a measurement depends only on measurements of earlier stamps, and on those of equal stamps in an
//! order given by their contents. Any order of arrival within `horizon_s` therefore gives the same bits.

mod bridge;
mod fold;
mod repeats;
mod start;
mod trust;
mod unit;
mod window;

use std::collections::VecDeque;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use swerve_core::{ParamError, Span, Time};

use crate::params::Params;
use fold::Fold;
pub use unit::UnitHealth;

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
    fn key(&self) -> (Time, u8, [u64; 9]) {
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

/// Largest number of stored measurements: one second of all sensors at their highest rates.
const KEPT: usize = 2048;

/// The filter with a history of measurements that can be filtered again.
#[derive(Clone, Debug)]
pub struct Localizer {
    params: Params,
    /// State before the first of `entries`.
    base: Fold,
    /// Stamp of the newest measurement in `base`.
    base_stamp: Option<Time>,
    entries: VecDeque<Entry>,
    /// State after each of `entries`.
    states: VecDeque<Fold>,
    too_late: u64,
    nonsense: u64,
}

impl Localizer {
    /// Creates a localizer that waits for its first fix. `heading` is a known initial heading and its standard
    /// deviation, radians, such as that of the lane for a parked car. Without it the localizer initialises from the
    /// course while moving.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: Params, heading: Option<[f64; 2]>) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self::with(params, Fold::waiting(heading)))
    }

    /// Creates a localizer that continues from a known state at `stamp`.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn starting_at(params: Params, stamp: Time, initial: &Initial) -> Result<Self, ParamError> {
        params.validate()?;
        let fold = Fold::started(&params, stamp, initial);
        Ok(Self { base_stamp: Some(stamp), ..Self::with(params, fold) })
    }

    /// Sets the heading and its standard deviation, radians, before initialisation, for lanes that are known only
    /// with the first fix. Has no effect after a fix has been accepted.
    pub fn suppose_heading(&mut self, heading: [f64; 2]) {
        self.base.suppose_heading(heading);
        self.states.iter_mut().for_each(|state| state.suppose_heading(heading));
    }

    fn with(params: Params, base: Fold) -> Self {
        let (entries, states) = (VecDeque::with_capacity(KEPT + 1), VecDeque::with_capacity(KEPT + 1));
        Self { params, base, base_stamp: None, entries, states, too_late: 0, nonsense: 0 }
    }

    /// Processes a measurement, in any order of stamps.
    pub fn take(&mut self, stamp: Time, what: Sensed) -> Taken {
        if !what.is_sound() {
            self.nonsense += 1;
            return Taken::Nonsense;
        }
        let entry = Entry { stamp, what };
        if self.is_too_late(stamp) {
            self.too_late += 1;
            return Taken::TooLate;
        }
        let key = entry.key();
        let behind = self.entries.iter().rev().take_while(|other| other.key() > key).count();
        let place = self.entries.len() - behind;
        self.entries.insert(place, entry);
        self.states.truncate(place);
        for entry in self.entries.iter().skip(place) {
            let mut state = self.states.back().unwrap_or(&self.base).clone();
            state.take(&self.params, entry);
            self.states.push_back(state);
        }
        self.forget();
        if behind == 0 { Taken::InOrder } else { Taken::Late }
    }

    /// Returns true if a stamp is before the stored history. Based on the newest stamp, so that the order of arrival
    /// has no effect.
    fn is_too_late(&self, stamp: Time) -> bool {
        let newest = self.entries.back().map(|entry| entry.stamp).or(self.base_stamp);
        let by_horizon = newest.is_some_and(|newest| newest - stamp > Span::from_secs(self.params.horizon_s));
        by_horizon || self.base_stamp.is_some_and(|base| stamp < base)
    }

    /// Moves measurements beyond the horizon into the base state.
    fn forget(&mut self) {
        let Some(newest) = self.entries.back().map(|entry| entry.stamp) else { return };
        let horizon = Span::from_secs(self.params.horizon_s);
        while self.entries.front().is_some_and(|first| newest - first.stamp > horizon)
            || self.entries.len() > KEPT
        {
            let (Some(entry), Some(state)) = (self.entries.pop_front(), self.states.pop_front()) else {
                return;
            };
            self.base = state;
            self.base_stamp = Some(entry.stamp);
        }
    }

    /// Latest estimate; `None` before initialisation.
    pub fn estimate(&self) -> Option<Estimate> {
        self.newest().estimate(&self.params)
    }

    /// Latest estimate propagated to a later instant without measurements.
    pub fn estimate_at(&self, at: Time) -> Option<Estimate> {
        let mut fold = self.newest().clone();
        fold.filter()?;
        fold.advance(&self.params, at, None);
        fold.estimate(&self.params)
    }

    /// Condition of the inertial unit after the newest measurement.
    pub fn unit_health(&self) -> UnitHealth {
        let at = self.entries.back().map(|entry| entry.stamp).or(self.base_stamp);
        self.newest().unit.health(&self.params, at.unwrap_or(Time::ZERO))
    }

    /// Quality of the latest estimate.
    pub fn mode(&self) -> Mode {
        self.estimate().map_or(Mode::Lost, |estimate| estimate.mode)
    }

    /// The filter; `None` before initialisation.
    pub fn filter(&self) -> Option<&crate::Eskf> {
        self.newest().filter()
    }

    /// Innovation statistics of a source.
    pub fn tally(&self, source: Source) -> Tally {
        self.newest().tally(source)
    }

    /// Number of dropped measurements: too late, and invalid.
    pub fn dropped(&self) -> [u64; 2] {
        [self.too_late, self.nonsense]
    }

    fn newest(&self) -> &Fold {
        self.states.back().unwrap_or(&self.base)
    }
}

#[cfg(test)]
mod tests;
