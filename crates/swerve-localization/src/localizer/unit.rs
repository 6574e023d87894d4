//! Health of the inertial unit by the signature of its own readings.
//!
//! A frozen unit repeats readings bit for bit although it never did before. The noise of a unit shows in second differences
//! of its readings, from which steady and evenly changing motion drops out: for white noise of variance σ² their variance
//! is 6σ² (von Neumann et al., "The mean square successive difference", 1941, does so with first differences). Squares are
//! clipped before they are averaged: a bump in the road is large once, noise nearly always.

use nalgebra::Vector3;
use swerve_core::Time;

use crate::params::Params;

/// Readings in a row that all differ, after which a repeated one is suspicious.
const LIVELY: u32 = 20;
/// Repetitions in a row that a live unit does not produce.
const REPEATS: u32 = 2;
/// Readings over which the noise is averaged.
const SPAN: f64 = 8.0;
/// A square over its variance counts no more than this in the average.
const CLIPPED: f64 = 9.0;
/// Above the first average a unit is noisy, until it is below the second again.
const NOISY: [f64; 2] = [6.5, 3.0];
/// Readings until a noisy unit is known as such.
const UNTIL_NOISY: f64 = 12.0;
/// Vibration of a car on a rough road, as a deviation: m/s² and rad/s. A unit that measures it is sound.
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
    /// There are no readings.
    Silent,
    /// The filter went astray with it again and again.
    Doubted,
}

/// Three axes of one kind: accelerometers or gyroscopes.
#[derive(Clone, Copy, Debug, Default)]
struct Triple {
    last: Vector3<f64>,
    difference: Vector3<f64>,
    /// Readings in a row that differ from the one before, and that do not.
    varied: u32,
    repeated: u32,
    /// Whether readings once all differed for long enough.
    is_lively: bool,
    /// Averages of the squares over their variance, as they are and clipped.
    average: f64,
    clipped: f64,
    is_noisy: bool,
}

impl Triple {
    /// `variance` is that of the noise of a reading, vibration included.
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

    /// Whether it repeats itself, and before never did.
    fn is_frozen(&self) -> bool {
        self.is_lively && self.repeated >= REPEATS
    }
}

/// What the readings of a unit say of the unit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Unit {
    accel: Triple,
    gyro: Triple,
    known: u32,
    last: Option<Time>,
    /// Time between the newest two readings, seconds.
    period_s: f64,
    /// Not used before this instant.
    doubted_until: Option<Time>,
}

impl Unit {
    /// One more reading. At standstill a quantised unit may well repeat itself; one that was frozen before stays so.
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
        // Across a gap there is no difference of neighbours.
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

    /// Does not use it before an instant.
    pub(super) fn doubt(&mut self, until: Time) {
        self.doubted_until = Some(until);
    }

    /// How long a reading holds, seconds: some are late or lost on every bus.
    pub(super) fn hold_s(&self, params: &Params) -> f64 {
        match self.period_s > 0.0 {
            true => (3.0 * self.period_s).min(params.imu_timeout_s),
            false => params.imu_timeout_s,
        }
    }

    /// Its condition at an instant.
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

    /// Variances of the noise of a reading with vibration: accelerations and turn rates, along the worst axis.
    fn variances(&self, params: &Params) -> [f64; 2] {
        let of = |density: [f64; 3], vibration: f64| {
            let worst = density.into_iter().fold(0.0, f64::max);
            (worst * worst / self.period_s.max(1e-4)).max(vibration * vibration)
        };
        [of(params.accel_noise, VIBRATION[0]), of(params.gyro_noise, VIBRATION[1])]
    }

    /// What the noise of a unit did to velocity (m²/s²) and attitude (rad²) before it was known, as variances.
    pub(super) fn leaked(&self, params: &Params) -> [f64; 2] {
        let [accel, gyro] = self.variances(params);
        let of = |triple: &Triple, variance: f64| match triple.is_noisy {
            true => triple.average * variance * self.period_s * self.period_s * UNTIL_NOISY,
            false => 0.0,
        };
        [of(&self.accel, accel), of(&self.gyro, gyro)]
    }
}
