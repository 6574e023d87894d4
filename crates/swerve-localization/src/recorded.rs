//! Evaluation of a localizer on a recorded drive with ground truth.
//!
//! The arrays are those of the CARLA log of the University of Toronto's course: `imu_f` and `imu_w` (specific force
//! and turn rate), `gnss` and `lidar` (positions), each with `.data` and `.t`, and the truth `gt.p_init`, `gt.v`,
//! `gt.r_init` (position, velocity, roll-pitch-yaw) at the stamps of the inertial unit.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use swerve_core::{Span, Time};

use crate::eskf::{angle_between, from_euler};
use crate::localizer::{Estimate, Initial, Localizer, Sensed, Source};
use crate::npz::Array;
use crate::params::{Hold, Params};

/// Rotation from the lidar's axes to the inertial unit's, and the lidar's position there, metres: calibration of the
/// course.
const LIDAR_TURN: [[f64; 3]; 3] =
    [[0.99376, -0.09722, 0.05466], [0.09971, 0.99401, -0.04475], [-0.04998, 0.04992, 0.9975]];
const LIDAR_AT_M: [f64; 3] = [0.5, 0.1, 0.5];
/// Standard deviation of each coordinate from the lidar, metres.
const LIDAR_SIGMA_M: f64 = 0.5;
/// Standard deviation of each coordinate of a fix, metres.
const FIX_SIGMA_M: f64 = 0.1;

/// Settings for a recorded drive.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Preset {
    /// All sensors, with calibrated noise and vehicle constraints.
    Best,
    /// Pylot's filter, with fixes and inertial unit only.
    Paper,
}

/// A recorded drive.
#[derive(Clone, Debug)]
pub struct Recorded {
    imu: Vec<(Time, [f64; 3], [f64; 3])>,
    fixes: Vec<(Time, [f64; 3])>,
    places: Vec<(Time, [f64; 3])>,
    truth: Vec<(Vector3<f64>, [f64; 3])>,
    velocity_mps: Vector3<f64>,
}

/// Errors and consistency of a localizer on a drive.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Report {
    /// Number of compared estimates.
    pub samples: usize,
    /// Root mean square of the horizontal error, metres.
    pub rmse_2d_m: f64,
    /// Root mean square of the error in three dimensions, metres.
    pub rmse_3d_m: f64,
    /// Largest error in three dimensions, metres.
    pub largest_m: f64,
    /// Root mean square of the angle between true and estimated attitude, degrees.
    pub attitude_deg: f64,
    /// Mean normalised estimation error squared of the position: 3 for a consistent filter.
    pub nees: f64,
    /// Share of estimates within the two-sided 95 % bounds.
    pub nees_in_95: f64,
    /// Innovation statistics by sensor: mean normalised square (its number of coordinates for a consistent filter),
    /// accepted, refused.
    pub nis: BTreeMap<&'static str, Nis>,
}

/// Innovations of one source.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Nis {
    /// Mean normalised innovation squared.
    pub mean: f64,
    /// Number of accepted measurements.
    pub taken: u64,
    /// Number of refused measurements.
    pub refused: u64,
}

impl Recorded {
    /// Creates a drive from these arrays.
    ///
    /// # Errors
    /// The first array that is missing or has the wrong shape.
    pub fn new(arrays: &BTreeMap<String, Array>) -> Result<Self, String> {
        let get = |key: &str| arrays.get(key).ok_or_else(|| format!("no array `{key}`"));
        let rows = |key: &str| {
            get(key)?
                .rows::<3>()
                .ok_or_else(|| format!("`{key}` has another shape: expected rows of 3 numbers"))
        };
        let stamped = |key: &str| -> Result<Vec<(Time, [f64; 3])>, String> {
            let stamps = &get(&format!("{key}.t"))?.values;
            let data = rows(&format!("{key}.data"))?;
            // The log has surplus stamps after the last reading.
            if stamps.len() < data.len() {
                return Err(format!("`{key}.t` has {} stamps for {} rows", stamps.len(), data.len()));
            }
            stamps.iter().zip(data).map(|(t, row)| Ok((instant(*t, key)?, *row))).collect()
        };
        let (force, turn) = (stamped("imu_f")?, rows("imu_w.data")?);
        if force.len() < 2 || turn.len() < force.len() {
            return Err(format!(
                "{} accelerations and {} turn rates: expected as many",
                force.len(),
                turn.len()
            ));
        }
        let imu: Vec<_> = force.into_iter().zip(turn).map(|((t, f), w)| (t, f, *w)).collect();
        let turned = |y: [f64; 3]| {
            core::array::from_fn(|i| (0..3).map(|j| LIDAR_TURN[i][j] * y[j]).sum::<f64>() + LIDAR_AT_M[i])
        };
        let places = stamped("lidar")?.into_iter().map(|(t, y)| (t, turned(y))).collect();
        let (at, attitude) = (rows("gt.p_init")?, rows("gt.r_init")?);
        let velocity = rows("gt.v")?.first().copied().ok_or("`gt.v` is empty")?;
        let first = Vector3::from(*at.first().ok_or("`gt.p_init` is empty")?);
        let truth = at.iter().zip(attitude).map(|(p, r)| (Vector3::from(*p) - first, *r)).collect();
        Ok(Self { imu, fixes: stamped("gnss")?, places, truth, velocity_mps: Vector3::from(velocity) })
    }

    /// Mean period of the inertial unit, seconds.
    pub fn period_s(&self) -> f64 {
        let (first, last) = (self.imu[0].0, self.imu[self.imu.len() - 1].0);
        (last - first).as_secs() / (self.imu.len() - 1) as f64
    }

    /// Parameters of a preset for this drive's sensors.
    pub fn params(&self, preset: Preset) -> Params {
        let paper = Params { gravity_mps2: -9.81, ..Params::paper(self.period_s()) };
        match preset {
            Preset::Paper => paper,
            Preset::Best => Params {
                // From readings minus truth: 0.06, 0.54, 0.04 m/s² and 0.1 rad/s at 200 Hz.
                hold: Hold::Previous,
                accel_noise: [0.0045, 0.038, 0.003],
                gyro_noise: [0.007_07; 3],
                // The car slides at 0.5 m/s in hard turns.
                non_holonomic_mps: 0.3,
                gate_one_in: 1000,
                ..paper
            },
        }
    }

    /// Runs a localizer on the drive, starting from the true state.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn run(&self, params: Params, preset: Preset) -> Result<Report, swerve_core::ParamError> {
        let (position_m, [roll, pitch, yaw]) = self.truth[0];
        let attitude = from_euler(roll, pitch, yaw);
        let initial =
            Initial { position_m, velocity_mps: self.velocity_mps, attitude, sigma: [0.1, 0.1, 0.01] };
        let mut localizer = Localizer::starting_at(params, self.imu[0].0, &initial)?;
        let fix_sigma_m = if preset == Preset::Paper { Params::PAPER_FIX_M2.sqrt() } else { FIX_SIGMA_M };
        let fix = |at_m: [f64; 3]| Sensed::Fix { at_m, sigma_m: [fix_sigma_m; 3] };
        let place = |at_m: [f64; 3]| Sensed::Place { at_m, sigma_m: [LIDAR_SIGMA_M; 3] };
        let mut beside: Vec<(Time, Sensed)> = self.fixes.iter().map(|(t, y)| (*t, fix(*y))).collect();
        if preset == Preset::Best {
            beside.extend(self.places.iter().map(|(t, y)| (*t, place(*y))));
        }
        beside.sort_by_key(|(t, _)| *t);
        let mut beside = beside.into_iter().filter(|(t, _)| *t >= self.imu[0].0).peekable();
        let mut score = Score::default();
        for (&(stamp, accel_mps2, gyro_radps), truth) in self.imu.iter().zip(&self.truth) {
            let _taken = localizer.take(stamp, Sensed::Imu { accel_mps2, gyro_radps });
            while let Some((t, what)) = beside.next_if(|(t, _)| *t <= stamp) {
                let _taken = localizer.take(t, what);
            }
            if let Some(estimate) = localizer.estimate() {
                score.add(&estimate, truth);
            }
        }
        Ok(score.report(&localizer))
    }
}

fn instant(t_s: f64, key: &str) -> Result<Time, String> {
    match (0.0..1e9).contains(&t_s) {
        true => Ok(Time::ZERO + Span::from_secs(t_s)),
        false => Err(format!("`{key}.t` holds {t_s}: expected seconds from 0 on")),
    }
}

/// Accumulated errors.
#[derive(Default)]
struct Score {
    samples: usize,
    square_2d: f64,
    square_3d: f64,
    largest_m: f64,
    square_rad: f64,
    nees: f64,
    inside: usize,
}

impl Score {
    fn add(&mut self, estimate: &Estimate, (at_m, [roll, pitch, yaw]): &(Vector3<f64>, [f64; 3])) {
        let error = at_m - estimate.position_m;
        let square = error.dot(&error);
        self.samples += 1;
        self.square_2d += error.x * error.x + error.y * error.y;
        self.square_3d += square;
        self.largest_m = self.largest_m.max(square.sqrt());
        let angle = angle_between(&from_euler(*roll, *pitch, *yaw), &estimate.attitude);
        self.square_rad += angle * angle;
        let inverse: Matrix3<f64> = estimate.position_covariance.try_inverse().unwrap_or_default();
        let nees = error.dot(&(inverse * error));
        self.nees += nees;
        // 2.5 % and 97.5 % quantiles of chi-square with three degrees of freedom.
        self.inside += usize::from((0.216..=9.348).contains(&nees));
    }

    fn report(&self, localizer: &Localizer) -> Report {
        let n = self.samples.max(1) as f64;
        let sources = [
            ("gnss", Source::Fix),
            ("lidar", Source::Place),
            ("wheels", Source::Wheels),
            ("non_holonomic", Source::NonHolonomic),
            ("standing", Source::Standing),
        ];
        let nis = sources.into_iter().filter_map(|(name, source)| {
            let tally = localizer.tally(source);
            let mean = tally.nis_sum / tally.taken.max(1) as f64;
            let nis = Nis { mean, taken: tally.taken, refused: tally.refused };
            (tally.taken + tally.refused > 0).then_some((name, nis))
        });
        Report {
            samples: self.samples,
            rmse_2d_m: (self.square_2d / n).sqrt(),
            rmse_3d_m: (self.square_3d / n).sqrt(),
            largest_m: self.largest_m,
            attitude_deg: (self.square_rad / n).sqrt().to_degrees(),
            nees: self.nees / n,
            nees_in_95: self.inside as f64 / n,
            nis: nis.collect(),
        }
    }
}

#[cfg(test)]
mod tests;
