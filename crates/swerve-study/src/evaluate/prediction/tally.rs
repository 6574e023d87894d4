//! Errors of forecasts, window by window.

use std::collections::VecDeque;

use serde::Serialize;
use swerve_core::Time;
use swerve_eval::forecast::{BestOf, Coverage, Gaussian, ModeErrors, Recalibration, collide, nll};
use swerve_geom::{Obb, Point2};
use swerve_msg::{Forecast, ForecastList};
use swerve_prediction::recorded::{Scene, Window};

/// Latencies of the timely error, milliseconds.
const LATENCIES_MS: [u32; 6] = [0, 20, 50, 100, 200, 500];
/// How fast regions answer to a miss.
const RECALIBRATION_RATE: f64 = 0.02;

/// Means over windows.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub(crate) struct Figures {
    /// How many were judged.
    pub(crate) windows: usize,
    /// Mean distance of the likeliest mode, metres.
    pub(crate) ade_m: f64,
    /// Its distance at the end, metres.
    pub(crate) fde_m: f64,
    /// Of the best of the likeliest K modes, metres.
    pub(crate) min_ade_m: f64,
    pub(crate) min_fde_m: f64,
    pub(crate) brier_min_fde_m: f64,
    /// Share of windows in which all of these end more than 2 m off.
    pub(crate) missed: f64,
    /// Nats a step, with metres.
    pub(crate) nll: f64,
    /// Shares within the regions of 50, 80, 90 and 95 % at the end.
    pub(crate) coverage: Option<[f64; 4]>,
    /// Mean areas of these regions, m².
    pub(crate) areas_m2: Option<[f64; 4]>,
    /// Share within the region of 90 % at the end that is learnt while the recording goes on.
    pub(crate) recalibrated_90: Option<f64>,
    /// Share of windows whose likeliest mode runs into that of another.
    pub(crate) collisions: f64,
    /// By step: seconds ahead, mean and root mean square of the likeliest mode's distance.
    pub(crate) by_step: Vec<Step>,
    /// What is known so much later, of instants so far ahead of then.
    pub(crate) timely: Vec<Timely>,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub(crate) struct Step {
    ahead_s: f64,
    mean_m: f64,
    rms_m: f64,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub(crate) struct Timely {
    latency_ms: u32,
    ahead_s: f64,
    error_m: f64,
}

/// Sums of these.
#[derive(Clone, Debug)]
pub(crate) struct Tally {
    best_of: usize,
    step_s: f64,
    windows: usize,
    sums: [f64; 7],
    collisions: usize,
    coverage: Coverage,
    recalibration: Recalibration,
    held: [usize; 2],
    /// What is learnt once its end has come: when, the score, and whether it was held.
    to_come: VecDeque<(Time, f64, bool)>,
    /// Count, distances and squares by step.
    steps: Vec<[f64; 3]>,
}

impl Tally {
    pub(crate) fn new(best_of: usize, steps: usize) -> Self {
        Self {
            best_of,
            step_s: 0.0,
            windows: 0,
            sums: [0.0; 7],
            collisions: 0,
            coverage: Coverage::default(),
            recalibration: Recalibration::new(0.9, RECALIBRATION_RATE),
            held: [0; 2],
            to_come: VecDeque::new(),
            steps: vec![[0.0; 3]; steps],
        }
    }

    /// Another recording, whose time begins anew.
    pub(crate) fn begin(&mut self) {
        self.to_come.clear();
    }

    /// Everybody who is judged in a scene.
    pub(crate) fn add(&mut self, scene: &Scene, list: &ForecastList) {
        let now = scene.tracks.stamp;
        while let Some((_, squared, held)) = self.to_come.pop_front_if(|(at, ..)| *at <= now) {
            self.recalibration.learn(squared, held);
        }
        let found: Vec<(&Window, &Forecast)> = scene
            .windows
            .iter()
            .filter_map(|window| Some((window, list.forecasts.iter().find(|one| one.id == window.id)?)))
            .collect();
        let outlines: Vec<Vec<Obb>> = found.iter().map(|(_, one)| outlines(one)).collect();
        for (k, (window, forecast)) in found.iter().enumerate() {
            self.add_one(window, forecast);
            let hits = |j: usize| j != k && collide(&outlines[k], &outlines[j]);
            self.collisions += usize::from((0..outlines.len()).any(hits));
        }
    }

    fn add_one(&mut self, window: &Window, forecast: &Forecast) {
        let steps = window.truth.len();
        let path = |mode: &swerve_msg::Mode| -> Vec<Point2> {
            mode.path[1..=steps].iter().map(|at| at.pose.point()).collect()
        };
        let errors = forecast
            .modes
            .iter()
            .filter_map(|mode| ModeErrors::of(mode.probability, &path(mode), &window.truth));
        let Some(best) = BestOf::of(&errors.collect::<Vec<_>>(), self.best_of) else { return };
        let mixture = |k: usize| -> Vec<Gaussian> {
            let part = |mode: &swerve_msg::Mode| Gaussian {
                weight: mode.probability,
                mean: mode.path[k + 1].pose.point(),
                covariance_m2: mode.path[k + 1].covariance_m2,
            };
            forecast.modes.iter().map(part).collect()
        };
        let nats = (0..steps).map(|k| nll(&mixture(k), window.truth[k])).sum::<f64>() / steps as f64;
        self.windows += 1;
        let missed = f64::from(u8::from(best.missed));
        let one =
            [best.ade_m, best.fde_m, best.min_ade_m, best.min_fde_m, best.brier_min_fde_m, missed, nats];
        self.sums.iter_mut().zip(one).for_each(|(sum, one)| *sum += one);
        if let Some(region) = Gaussian::of_mixture(&mixture(steps - 1)) {
            let ends = forecast.modes[0].path[steps].at;
            self.judge_region(&region, window.truth[steps - 1], ends);
        }
        let Some(likeliest) = forecast.likeliest() else { return };
        self.step_s = (likeliest.path[1].at - likeliest.path[0].at).as_secs();
        for (sums, (place, truth)) in self.steps.iter_mut().zip(path(likeliest).iter().zip(&window.truth)) {
            let off_m = place.distance(*truth);
            sums.iter_mut().zip([1.0, off_m, off_m * off_m]).for_each(|(sum, one)| *sum += one);
        }
    }

    fn judge_region(&mut self, region: &Gaussian, place: Point2, ends: Time) {
        self.coverage.add(region, place);
        let squared = region.mahalanobis_squared(place);
        let held = squared <= self.recalibration.squared();
        self.held[0] += usize::from(held);
        self.held[1] += 1;
        self.to_come.push_back((ends, squared, held));
    }

    /// Takes in another file's, but for what is learnt of it.
    pub(crate) fn join(&mut self, other: &Self) {
        self.windows += other.windows;
        self.step_s = other.step_s.max(self.step_s);
        self.collisions += other.collisions;
        self.coverage.join(&other.coverage);
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, one)| *sum += one);
        self.held.iter_mut().zip(other.held).for_each(|(sum, one)| *sum += one);
        for (sums, others) in self.steps.iter_mut().zip(&other.steps) {
            sums.iter_mut().zip(others).for_each(|(sum, one)| *sum += one);
        }
    }

    pub(crate) fn figures(&self) -> Figures {
        let n = self.windows.max(1) as f64;
        let [ade_m, fde_m, min_ade_m, min_fde_m, brier_min_fde_m, missed, nll] = self.sums.map(|sum| sum / n);
        let step = |(k, [count, off, squares]): (usize, &[f64; 3])| Step {
            ahead_s: self.step_s * (k + 1) as f64,
            mean_m: off / count,
            rms_m: (squares / count).sqrt(),
        };
        let seen = self.steps.iter().enumerate().filter(|(_, sums)| sums[0] > 0.0);
        let by_step: Vec<Step> = seen.map(step).collect();
        Figures {
            windows: self.windows,
            ade_m,
            fde_m,
            min_ade_m,
            min_fde_m,
            brier_min_fde_m,
            missed,
            nll,
            coverage: self.coverage.shares(),
            areas_m2: self.coverage.areas_m2(),
            recalibrated_90: (self.held[1] > 0).then(|| self.held[0] as f64 / self.held[1] as f64),
            collisions: self.collisions as f64 / n,
            timely: timely(&by_step, self.step_s),
            by_step,
        }
    }
}

/// A path is read at its instants, so that what is late is a longer way ahead: the mean error at the sum of both, linear
/// between the steps.
fn timely(by_step: &[Step], step_s: f64) -> Vec<Timely> {
    let error_m = |after_s: f64| {
        let at = after_s / step_s;
        let (below, share) = (at.floor() as usize, at.fract());
        let mean_m = |k: usize| if k == 0 { Some(0.0) } else { by_step.get(k - 1).map(|step| step.mean_m) };
        match share < 1e-9 {
            true => mean_m(below),
            false => Some(mean_m(below)? * (1.0 - share) + mean_m(below + 1)? * share),
        }
    };
    let one = |latency_ms: u32, ahead_s: u32| {
        let ahead_s = f64::from(ahead_s);
        let error_m = error_m(f64::from(latency_ms) * 1e-3 + ahead_s)?;
        Some(Timely { latency_ms, ahead_s, error_m })
    };
    let seconds = (by_step.len() as f64 * step_s) as u32;
    (0..=seconds)
        .flat_map(|ahead_s| LATENCIES_MS.into_iter().filter_map(move |ms| one(ms, ahead_s)))
        .collect()
}

/// The likeliest mode's outlines.
fn outlines(forecast: &Forecast) -> Vec<Obb> {
    let path = forecast.likeliest().map_or(&[][..], |mode| &mode.path);
    path.iter().map(|at| forecast.extent.footprint(at.pose)).collect()
}
