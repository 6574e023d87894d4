//! A filter that takes measurements in any order: what comes late is put where its stamp says, and what came after it is
//! taken again.
//!
//! ```text
//! measurements by stamp   |base|--a--b--c--(late)--d--e
//! states after them             1  2  3            5' 6'   re-filtered from the late one on
//! ```
//!
//! The state after a measurement depends on those of earlier stamps alone, and of equal stamps in one order that their
//! contents give. So every order of arrival within `horizon_s` ends with the same bits.

mod bridge;
mod fold;
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

/// What a sensor says.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Sensed {
    /// Specific force (m/s²) and turn rate (rad/s) along and about the vehicle's axes.
    Imu {
        /// Acceleration less gravity.
        accel_mps2: [f64; 3],
        /// Turn rate.
        gyro_radps: [f64; 3],
    },
    /// A satellite fix, on the map.
    Fix {
        /// East, north, up, metres.
        at_m: [f64; 3],
        /// Standard deviation of each, without what the offset state stands for.
        sigma_m: [f64; 3],
    },
    /// A place of the inertial unit by other means than satellites.
    Place {
        /// In the map, metres.
        at_m: [f64; 3],
        /// Standard deviation of each.
        sigma_m: [f64; 3],
    },
    /// Place and heading of the ego origin by matching what is around with a map.
    Pose {
        /// In the map, metres.
        at_m: [f64; 3],
        /// Heading, radians.
        heading_rad: f64,
        /// Covariance of the place on the ground: xx, xy, yy, m². A direction that the match did not see has a large one.
        covariance_m2: [f64; 3],
        /// Standard deviations of height (m) and heading (rad).
        sigma: [f64; 2],
    },
    /// Odometry of the wheels.
    Wheels {
        /// Speed of the rear axle, the mean since the reading before, m/s.
        speed_mps: f64,
        /// Curvature of the way by the steering angle, 1/m, positive to the left; none where it is not measured.
        curvature_1pm: Option<f64>,
    },
}

/// A kind of measurement that innovations are counted for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Source {
    /// Satellite fixes.
    Fix,
    /// Places by other means, and those of poses.
    Place,
    /// Headings of poses.
    Heading,
    /// Speed by the wheels.
    Wheels,
    /// Neither to the side nor up.
    NonHolonomic,
    /// Standing.
    Standing,
}

/// Innovations of one source.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Tally {
    /// How many were taken.
    pub taken: u64,
    /// How many were refused.
    pub refused: u64,
    /// Sum of the squares of those that were taken, each over its covariance.
    pub nis_sum: f64,
    /// Refused in a row by now.
    pub refused_in_a_row: u32,
    /// Moving average of the squares per number, refused ones included: 1 where the filter knows how good it is.
    pub recent_nis: f64,
}

/// What became of a measurement.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Taken {
    /// It is the newest.
    InOrder,
    /// It came late, and what came after it was taken again.
    Late,
    /// It is older than what is kept.
    TooLate,
    /// It is no measurement: a number that is not finite, or one that no sensor has.
    Nonsense,
}

/// How good a pose is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Mode {
    /// Fixes come and are believed.
    Good,
    /// By inertia and wheels alone for now, or by fixes and wheels without inertia, or fixes are contested.
    Coasting,
    /// Not to be driven by: not started, too uncertain, or in contradiction with the sensors.
    #[default]
    Lost,
}

/// Where the ego origin is, and how sure that is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Estimate {
    /// Instant that this describes.
    pub stamp: Time,
    /// Ego origin in the map, metres.
    pub position_m: Vector3<f64>,
    /// From the ego's axes to the map's.
    pub attitude: UnitQuaternion<f64>,
    /// Heading, radians.
    pub heading_rad: f64,
    /// Velocity of the ego origin along the ego's axes, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Acceleration at the inertial unit along the ego's axes, gravity taken out, m/s².
    pub accel_mps2: Vector3<f64>,
    /// Turn rate about the ego's x axis, rad/s.
    pub roll_rate_radps: f64,
    /// Turn rate about the ego's z axis, rad/s.
    pub yaw_rate_radps: f64,
    /// Covariance of x (m), y (m) and heading (rad).
    pub covariance: Matrix3<f64>,
    /// Covariance of the position, m².
    pub position_covariance: Matrix3<f64>,
    /// How good it is.
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

/// A state of the inertial unit that is known beforehand.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Initial {
    /// In the map, metres.
    pub position_m: Vector3<f64>,
    /// In the map, m/s.
    pub velocity_mps: Vector3<f64>,
    /// From the vehicle's axes to the map's.
    pub attitude: UnitQuaternion<f64>,
    /// Standard deviations of each axis of the three: metres, m/s, radians.
    pub sigma: [f64; 3],
}

impl Initial {
    /// A car on level ground with its ego origin at x and y (m) and a heading (rad), at a speed by its wheels (m/s), with
    /// the deviations of each axis of the place (m) and of the heading (rad).
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

/// Standard deviation of a speed by wheels whose scale is not known yet, m/s.
const ROLLING_MPS: f64 = 0.3;

/// One measurement in its place.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Entry {
    pub(crate) stamp: Time,
    pub(crate) what: Sensed,
}

impl Entry {
    /// Order among equal stamps: the inertial unit first, then by contents.
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

    /// Whether a sensor on a road can say this.
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

/// Most measurements that are kept: a second of all sensors at their fastest.
const KEPT: usize = 2048;

/// The filter and what it may have to take again.
#[derive(Clone, Debug)]
pub struct Localizer {
    params: Params,
    /// The state before the first of `entries`.
    base: Fold,
    /// Stamp of the newest that went into `base`.
    base_stamp: Option<Time>,
    entries: VecDeque<Entry>,
    /// The state after each of `entries`.
    states: VecDeque<Fold>,
    too_late: u64,
    nonsense: u64,
}

impl Localizer {
    /// One that waits for its first fix. `heading` is what is known of the heading beforehand and its standard
    /// deviation, radians: of a car that stands on its lane that of the lane. Without one it starts in motion.
    ///
    /// # Errors
    /// A parameter that is out of its range.
    pub fn new(params: Params, heading: Option<[f64; 2]>) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self::with(params, Fold::waiting(heading)))
    }

    /// One that goes on from a known state of `stamp`.
    ///
    /// # Errors
    /// A parameter that is out of its range.
    pub fn starting_at(params: Params, stamp: Time, initial: &Initial) -> Result<Self, ParamError> {
        params.validate()?;
        let fold = Fold::started(&params, stamp, initial);
        Ok(Self { base_stamp: Some(stamp), ..Self::with(params, fold) })
    }

    /// Tells the heading and its standard deviation, radians, to one that has not started yet: where the lane is known only
    /// with the first fix. Without effect on one that has taken a fix.
    pub fn suppose_heading(&mut self, heading: [f64; 2]) {
        self.base.suppose_heading(heading);
        self.states.iter_mut().for_each(|state| state.suppose_heading(heading));
    }

    fn with(params: Params, base: Fold) -> Self {
        let (entries, states) = (VecDeque::with_capacity(KEPT + 1), VecDeque::with_capacity(KEPT + 1));
        Self { params, base, base_stamp: None, entries, states, too_late: 0, nonsense: 0 }
    }

    /// Takes a measurement, whenever it comes.
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

    /// Whether it is older than what can be taken again: by the newest stamp, so that the order of arrival does not show.
    fn is_too_late(&self, stamp: Time) -> bool {
        let newest = self.entries.back().map(|entry| entry.stamp).or(self.base_stamp);
        let by_horizon = newest.is_some_and(|newest| newest - stamp > Span::from_secs(self.params.horizon_s));
        by_horizon || self.base_stamp.is_some_and(|base| stamp < base)
    }

    /// Puts what is beyond the horizon to the base.
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

    /// The newest estimate; none before there was a start.
    pub fn estimate(&self) -> Option<Estimate> {
        self.newest().estimate(&self.params)
    }

    /// The newest estimate carried on to an instant after it, as if no measurement came.
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

    /// How good the newest estimate is.
    pub fn mode(&self) -> Mode {
        self.estimate().map_or(Mode::Lost, |estimate| estimate.mode)
    }

    /// The filter itself, once it has started.
    pub fn filter(&self) -> Option<&crate::Eskf> {
        self.newest().filter()
    }

    /// Innovations of a source so far.
    pub fn tally(&self, source: Source) -> Tally {
        self.newest().tally(source)
    }

    /// Measurements that were not taken: those that came too late, and those that were none.
    pub fn dropped(&self) -> [u64; 2] {
        [self.too_late, self.nonsense]
    }

    fn newest(&self) -> &Fold {
        self.states.back().unwrap_or(&self.base)
    }
}

#[cfg(test)]
mod tests;
