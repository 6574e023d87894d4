//! Health of the inertial unit by the signature of its readings.
//!
//! A frozen unit repeats readings bit for bit after never having done so. The noise of a unit is measured in second
//! differences of its readings, which cancel steady and uniformly changing motion: for white noise of variance σ²
//! their variance is 6σ² (von Neumann et al., "The mean square successive difference", 1941, uses first differences).
//! Squares are clipped before they are averaged: a bump in the road gives one large square, noise gives many.

use nalgebra::Vector3;
use swerve_core::Time;

use crate::params::Params;

/// Consecutive distinct readings after which a repetition is suspicious.
const LIVELY: u32 = 20;
/// Consecutive repetitions that a working unit does not produce.
const REPEATS: u32 = 2;
/// Number of readings over which the noise is averaged.
const SPAN: f64 = 8.0;
/// Upper limit of a normalised square in the average.
const CLIPPED: f64 = 9.0;
/// A unit becomes noisy if the average exceeds the first, and recovers below the second.
const NOISY: [f64; 2] = [6.5, 3.0];
/// Number of readings until a noisy unit is detected.
const UNTIL_NOISY: f64 = 12.0;
/// Vibration of a car on a rough road, as a standard deviation: m/s² and rad/s. Readings with it are sound.
const VIBRATION: [f64; 2] = [1.0, 0.02];

/// Condition of the inertial unit.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum UnitHealth {
    /// Its readings are used.
    #[default]
    Sound,
    /// It repeats its readings.
    Frozen,
    /// Its noise is far above the model.
    Noisy,
    /// No readings are received.
    Silent,
    /// The filter diverged with it repeatedly.
    Doubted,
}

/// Three axes of one kind: accelerometers or gyroscopes.
#[derive(Clone, Copy, Debug, Default)]
struct Triple {
    last: Vector3<f64>,
    difference: Vector3<f64>,
    /// Consecutive readings that differ from the one before, and that do not.
    varied: u32,
    repeated: u32,
    /// True once enough consecutive readings were distinct.
    is_lively: bool,
    /// Averages of the normalised squares, unclipped and clipped.
    average: f64,
    clipped: f64,
    is_noisy: bool,
}

impl Triple {
    /// Processes a reading. `variance` is that of the reading's noise, vibration included; `known` counts the
    /// readings before it since the last gap.
    fn take(&mut self, reading: &Vector3<f64>, variance: f64, known: u32) {
        match *reading == self.last {
            true => (self.repeated, self.varied) = (self.repeated.saturating_add(1), 0),
            false => (self.varied, self.repeated) = (self.varied.saturating_add(1), 0),
        }
        self.is_lively |= self.varied >= LIVELY;
        let difference = reading - self.last;
        let squares = (difference - self.difference).map(|x| x * x / (6.0 * variance));
        (self.last, self.difference) = (*reading, difference);
        // The first two readings have no second difference.
        if known < 2 || self.repeated > 0 {
            return;
        }
        self.average += (squares.mean() - self.average) / SPAN;
        self.clipped += (squares.map(|x| x.min(CLIPPED)).mean() - self.clipped) / SPAN;
        self.is_noisy = self.clipped > NOISY[usize::from(self.is_noisy)];
    }

    /// Returns true if it repeats readings, after never having done so.
    fn is_frozen(&self) -> bool {
        self.is_lively && self.repeated >= REPEATS
    }
}

/// Condition of the unit as estimated from its readings.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Unit {
    accel: Triple,
    gyro: Triple,
    known: u32,
    last: Option<Time>,
    /// Time between the latest two readings, seconds.
    period_s: f64,
    /// The unit is not used before this instant.
    doubted_until: Option<Time>,
}

impl Unit {
    /// Processes a reading. At standstill a quantised unit may repeat readings without fault; one that was frozen
    /// before remains so.
    pub(super) fn take(
        &mut self,
        params: &Params,
        stamp: Time,
        [accel_mps2, gyro_radps]: [[f64; 3]; 2],
        stands: bool,
    ) {
        let since_s = self.last.map_or(0.0, |last| (stamp - last).as_secs());
        self.last = Some(stamp);
        if since_s <= 0.0 {
            return;
        }
        let was_frozen = self.is_frozen();
        // Differences across a gap are not used.
        if since_s > params.imu_timeout_s {
            self.known = 0;
        } else {
            self.period_s = since_s;
        }
        let [accel, gyro] = self.variances(params);
        self.accel.take(&Vector3::from(accel_mps2), accel, self.known);
        self.gyro.take(&Vector3::from(gyro_radps), gyro, self.known);
        self.known = self.known.saturating_add(1);
        if stands && !was_frozen {
            (self.accel.repeated, self.gyro.repeated) = (0, 0);
        }
    }

    /// Excludes the unit until an instant.
    pub(super) fn doubt(&mut self, until: Time) {
        self.doubted_until = Some(until);
    }

    /// Validity of a reading, seconds: on any bus some are late or lost.
    pub(super) fn hold_s(&self, params: &Params) -> f64 {
        match self.period_s > 0.0 {
            true => (3.0 * self.period_s).min(params.imu_timeout_s),
            false => params.imu_timeout_s,
        }
    }

    /// Condition at an instant.
    pub(super) fn health(&self, params: &Params, at: Time) -> UnitHealth {
        let is_silent = self.last.is_none_or(|last| (at - last).as_secs() > params.imu_timeout_s);
        if is_silent {
            UnitHealth::Silent
        } else if self.is_frozen() {
            UnitHealth::Frozen
        } else if self.accel.is_noisy || self.gyro.is_noisy {
            UnitHealth::Noisy
        } else if self.doubted_until.is_some_and(|until| at < until) {
            UnitHealth::Doubted
        } else {
            UnitHealth::Sound
        }
    }

    fn is_frozen(&self) -> bool {
        self.accel.is_frozen() || self.gyro.is_frozen()
    }

    /// Noise variances of a reading, vibration included: accelerations and turn rates, along the worst axis.
    fn variances(&self, params: &Params) -> [f64; 2] {
        let of = |density: [f64; 3], vibration: f64| {
            let worst = density.into_iter().fold(0.0, f64::max);
            (worst * worst / self.period_s.max(1e-4)).max(vibration * vibration)
        };
        [of(params.accel_noise, VIBRATION[0]), of(params.gyro_noise, VIBRATION[1])]
    }

    /// Variances that the unit's noise added to velocity (m²/s²) and attitude (rad²) before it was detected.
    pub(super) fn leaked(&self, params: &Params) -> [f64; 2] {
        let [accel, gyro] = self.variances(params);
        let of = |triple: &Triple, variance: f64| match triple.is_noisy {
            true => triple.average * variance * self.period_s * self.period_s * UNTIL_NOISY,
            false => 0.0,
        };
        [of(&self.accel, accel), of(&self.gyro, gyro)]
    }
}
