//! Prediction errors as a function of the time at which they are read.

use swerve_core::{Span, Time};
use swerve_geom::Point2;
use swerve_msg::{Prediction, PredictionList, Track};
use swerve_prediction::recorded::{Protocol, Recording, Scene, Window};
use swerve_prediction::{Ground, Horizon, PredictorName, Telling, foretold, predict};

use crate::tables::TimelyPrediction;

/// Spacing of the instants at which errors are recorded, seconds.
const GRID_S: f64 = 0.01;

/// Predictor, including `truth` with its horizon.
pub(super) struct Foreteller {
    pub(super) name: PredictorName,
    pub(super) truth_s: f64,
}

impl Foreteller {
    fn list(&self, scene: &Scene, horizon: &Horizon, ground: Ground<'_>) -> PredictionList {
        if self.name != PredictorName::Truth {
            return predict(self.name, &scene.tracks, horizon, ground);
        }
        let told = |track: &Track, instants: &[Time]| -> Option<Vec<Point2>> {
            let k = scene.windows.binary_search_by_key(&track.id, |window| window.id).ok()?;
            let truth = Line::of(track.pose.point(), &scene.windows[k].truth);
            let step_s = horizon.step.as_secs();
            instants.iter().map(|at| truth.at((*at - scene.tracks.stamp).as_secs() / step_s)).collect()
        };
        let telling = Telling { horizon: Some(Span::from_secs(self.truth_s)), ..Telling::default() };
        foretold(&scene.tracks, horizon, &telling, &told)
    }
}

/// Positions one step apart, the present one first.
struct Line(Vec<Point2>);

impl Line {
    fn of(now: Point2, later: &[Point2]) -> Self {
        Self(core::iter::once(now).chain(later.iter().copied()).collect())
    }

    /// Position after this many steps, linearly interpolated; `None` beyond the last.
    fn at(&self, steps: f64) -> Option<Point2> {
        let below = (steps + 1e-9).floor() as usize;
        let (from, share) = (*self.0.get(below)?, (steps - below as f64).max(0.0));
        if share < 1e-9 {
            return Some(from);
        }
        Some(from + (*self.0.get(below + 1)? - from) * share)
    }
}

/// Mean errors of the likeliest mode.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Errors {
    pub(super) windows: usize,
    /// Mean error at multiples of [`GRID_S`], from the present on, metres.
    mean_m: Vec<f64>,
    /// Mean error if paths are read by index, metres, by horizon, then latency.
    pub(super) careless_m: Vec<Option<f64>>,
}

impl Errors {
    /// Evaluates a predictor on recordings, at every `every`-th instant.
    pub(super) fn of(
        recordings: &[Recording],
        by: &Foreteller,
        (observe, every): (usize, usize),
        asked: &TimelyPrediction,
    ) -> Self {
        let mut sums = Sums::new(asked);
        for recording in recordings {
            let step_s = recording.step.as_secs();
            let predict = (sums.longest_s() / step_s - 1e-9).ceil().max(1.0) as usize;
            let horizon = Horizon { steps: predict, step: recording.step };
            let scenes = recording.scenes(&Protocol::whole(observe, predict));
            let ground = Ground::lanes(recording.lanes.as_deref());
            for scene in scenes.iter().step_by(every) {
                let list = by.list(scene, &horizon, ground);
                for window in &scene.windows {
                    sums.add(scene, window, &list, step_s);
                }
            }
        }
        sums.means()
    }

    /// Mean error after this time, metres; `None` if no window is that long.
    pub(super) fn mean_m(&self, after_s: f64) -> Option<f64> {
        self.mean_m.get((after_s / GRID_S).round() as usize).copied().filter(|m| m.is_finite())
    }

    /// Time at which the error first reaches a value, seconds; `None` if it stays below.
    pub(super) fn reaches_s(&self, goal_m: f64) -> Option<f64> {
        let next = self.mean_m.iter().position(|m| *m > goal_m)?;
        let Some(before) = next.checked_sub(1) else { return Some(0.0) };
        let (low, high) = (self.mean_m[before], self.mean_m[next]);
        Some(GRID_S * (before as f64 + ((goal_m - low) / (high - low)).clamp(0.0, 1.0)))
    }
}

/// Sums of the errors.
struct Sums<'a> {
    asked: &'a TimelyPrediction,
    windows: usize,
    /// Sums at each instant on the grid, metres.
    off_m: Vec<f64>,
    careless: Vec<f64>,
}

impl<'a> Sums<'a> {
    fn new(asked: &'a TimelyPrediction) -> Self {
        let latest_ms = asked.latencies_ms.last().copied().unwrap_or_default();
        let run_times = asked.run_time.iter().flat_map(|times| times.ms.values()).flatten();
        let latest_s = run_times.fold(f64::from(latest_ms), |most, ms| most.max(*ms)) * 1e-3;
        let instants = ((f64::from(asked.horizon_s) + latest_s) / GRID_S).ceil() as usize + 1;
        let cells = asked.latencies_ms.len() * (asked.horizon_s as usize + 1);
        Self { asked, windows: 0, off_m: vec![0.0; instants], careless: vec![0.0; cells] }
    }

    /// Longest time needed, seconds.
    fn longest_s(&self) -> f64 {
        (self.off_m.len() - 1) as f64 * GRID_S
    }

    fn add(&mut self, scene: &Scene, window: &Window, list: &PredictionList, step_s: f64) {
        let track = scene.tracks.tracks.iter().find(|track| track.id == window.id);
        let mode = Prediction::likeliest(list.modes_of(window.id));
        let (Some(track), Some(mode)) = (track, mode) else {
            return;
        };
        let truth = Line::of(track.pose.point(), &window.truth);
        let told = Line(mode.path.iter().map(|at| at.pose.point()).collect());
        let off_m = |read_s: f64, true_s: f64| {
            let pair = told.at(read_s / step_s).zip(truth.at(true_s / step_s));
            pair.map_or(f64::NAN, |(told, truth)| told.distance(truth))
        };
        self.windows += 1;
        for (k, sum) in self.off_m.iter_mut().enumerate() {
            let after_s = k as f64 * GRID_S;
            *sum += off_m(after_s, after_s);
        }
        for ((ms, ahead_s), sum) in self.asked.cells().zip(&mut self.careless) {
            let ahead_s = f64::from(ahead_s);
            *sum += off_m(ahead_s, f64::from(ms) * 1e-3 + ahead_s);
        }
    }

    fn means(self) -> Errors {
        let mean = |sum: f64| sum / self.windows as f64;
        let careless_m = self.careless.iter().map(|sum| Some(mean(*sum)).filter(|m| m.is_finite()));
        Errors {
            windows: self.windows,
            careless_m: careless_m.collect(),
            mean_m: self.off_m.iter().map(|sum| mean(*sum)).collect(),
        }
    }
}
