//! Accuracy of late predictions: errors over latency and horizon, on recorded or generated tracks.
//! `[timely_prediction]` in a study file, in addition to its drives.
//!
//! A path is read at its instants. Read `l` after the instant that it describes, for an instant `h` ahead, it therefore
//! has the error of a path after `l + h`. Reading it by index instead, as if it had just been made, is `careless`: all
//! road users have moved on for `l` meanwhile.

mod chart;
mod errors;
#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::path::Path;

use rayon::prelude::*;
use swerve_measure::evaluate::prediction::{file, on_lanes};
use swerve_prediction::PredictorName;
use swerve_prediction::recorded::{Recording, made};
use swerve_report::files::entries;
use swerve_report::output::align;

use super::csv::quoted;
use super::tables::{MadeSet, RunTimes, TimelyPrediction, TrackSet};
use errors::{Errors, Foreteller};

impl RunTimes {
    /// Run time of a predictor for this many seconds ahead, from 1 on, ms; `None` if not given.
    fn of(&self, name: PredictorName, ahead_s: u32) -> Option<f64> {
        let ms = self.ms.get(&name)?;
        ms.get(if ms.len() == 1 { 0 } else { ahead_s as usize - 1 }).copied()
    }
}

impl TimelyPrediction {
    /// Evaluates the predictors on every available set; `folder` is the study's.
    ///
    /// # Errors
    /// If a file of an available set cannot be read or has another format.
    pub(super) fn measure(&self, folder: &Path) -> anyhow::Result<Measured<'_>> {
        let (mut sets, mut absent) = (Vec::new(), Vec::new());
        for set in &self.set {
            match set.recordings(folder)? {
                Some(recordings) => sets.push((set, recordings)),
                None => absent.push(set.name.as_str()),
            }
        }
        let of_set = |(set, recordings): &(&TrackSet, Vec<Recording>)| -> Vec<Errors> {
            let of = |name: &PredictorName| {
                let by = Foreteller { name: *name, truth_s: self.truth_s };
                Errors::of(recordings, &by, (set.observe, set.every), self)
            };
            self.predictors.par_iter().map(of).collect()
        };
        let errors = sets.iter().map(of_set).collect::<Vec<_>>();
        let sets = sets.iter().zip(errors).map(|((set, recordings), errors)| OfSet {
            name: &set.name,
            unseen_per_s: unseen_per_s(recordings),
            errors,
        });
        Ok(Measured { asked: self, sets: sets.collect(), absent })
    }

    /// Latency (ms) and horizon (s) of each cell of the tables, with the latencies of a horizon adjacent.
    fn cells(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let latencies = self.latencies_ms.clone();
        (0..=self.horizon_s)
            .flat_map(move |ahead_s| latencies.clone().into_iter().map(move |ms| (ms, ahead_s)))
    }

    /// Name of a predictor in tables.
    fn named(&self, name: PredictorName) -> String {
        match name {
            PredictorName::Truth => format!("truth of {} s", self.truth_s),
            name => name.name().to_owned(),
        }
    }
}

impl TrackSet {
    /// Reads or generates the recordings; `None` if the folder is missing.
    fn recordings(&self, folder: &Path) -> anyhow::Result<Option<Vec<Recording>>> {
        if let Some(MadeSet { seeds: [first, last], people }) = self.made {
            return Ok(Some((first..=last).map(|seed| made(seed, people)).collect()));
        }
        let Some(recorded) = &self.recorded else { return Ok(None) };
        let folder = folder.join(&recorded.folder);
        if entries(&folder).is_err() {
            return Ok(None);
        }
        let mut all = Vec::new();
        for name in &recorded.files {
            let path = folder.join(name);
            all.extend(on_lanes(file(&path, recorded.format)?, &path)?.recordings());
        }
        Ok(Some(all))
    }
}

/// Rate of road users that come into sight, per second and road user present: a late prediction does not include them.
fn unseen_per_s(recordings: &[Recording]) -> f64 {
    let (mut come, mut seconds) = (0.0, 0.0);
    for recording in recordings {
        let first =
            recording.tracks.iter().filter_map(|track| track.samples.first()).map(|(at, _)| *at).min();
        for track in &recording.tracks {
            let begins = track.samples.first().map(|(at, _)| *at);
            come += f64::from(u8::from(begins > first));
            seconds += track.samples.len() as f64 * recording.step.as_secs();
        }
    }
    if seconds > 0.0 { come / seconds } else { 0.0 }
}

/// Results of a study's `[timely_prediction]`.
pub(crate) struct Measured<'a> {
    asked: &'a TimelyPrediction,
    sets: Vec<OfSet<'a>>,
    /// Sets whose data are missing.
    absent: Vec<&'a str>,
}

/// Results on one set.
struct OfSet<'a> {
    name: &'a str,
    unseen_per_s: f64,
    /// Errors, in the order of the predictors.
    errors: Vec<Errors>,
}

impl OfSet<'_> {
    /// Maximum latency at which a predictor is at least as good as the first one at zero latency, ms; negative if it is
    /// worse even without latency. `None` if the tracks are too short.
    fn may_be_late_ms(&self, predictor: usize, ahead_s: u32) -> Option<f64> {
        let ahead_s = f64::from(ahead_s);
        let goal_m = self.errors[0].mean_m(ahead_s)?;
        let reached_s = self.errors[predictor].reaches_s(goal_m)?;
        Some((reached_s - ahead_s) * 1e3)
    }
}

impl Measured<'_> {
    /// CSV with one row per set, predictor, latency and horizon.
    pub(crate) fn csv(&self) -> String {
        let mut csv = "set,predictor,windows,latency_ms,ahead_s,error_m,careless_m\n".to_owned();
        for set in &self.sets {
            for (name, errors) in self.asked.predictors.iter().zip(&set.errors) {
                for ((latency_ms, ahead_s), careless_m) in self.asked.cells().zip(&errors.careless_m) {
                    let error_m = errors.mean_m(f64::from(latency_ms) * 1e-3 + f64::from(ahead_s));
                    let (set, name) = (quoted(set.name), self.asked.named(*name));
                    let number = |m: Option<f64>| m.map_or(String::new(), |m| format!("{m:.4}"));
                    let (error, careless) = (number(error_m), number(*careless_m));
                    let count = errors.windows;
                    let _infallible =
                        writeln!(csv, "{set},{name},{count},{latency_ms},{ahead_s},{error},{careless}");
                }
            }
        }
        csv
    }

    /// CSV of the maximum latencies at which predictors are at least as good as the first: one row per set, predictor
    /// and horizon.
    pub(crate) fn crossover_csv(&self) -> String {
        let mut csv = "set,predictor,ahead_s,may_be_late_ms\n".to_owned();
        for set in &self.sets {
            for (k, name) in self.asked.predictors.iter().enumerate() {
                for ahead_s in 1..=self.asked.horizon_s {
                    let ms = set.may_be_late_ms(k, ahead_s).map_or(String::new(), |ms| format!("{ms:.0}"));
                    let (set, name) = (quoted(set.name), self.asked.named(*name));
                    let _infallible = writeln!(csv, "{set},{name},{ahead_s},{ms}");
                }
            }
        }
        csv
    }

    /// Tables: errors without latency and with the largest one, the maximum latencies, and the errors at the run times.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        let whole: Vec<u32> = (1..=self.asked.horizon_s).collect();
        let head = |title: String| -> Vec<String> {
            std::iter::once(title).chain(whole.iter().map(|s| format!("{s} s ahead"))).collect()
        };
        let cell = |m: Option<f64>, digits: usize| m.map_or("-".to_owned(), |m| format!("{m:.digits$}"));
        for set in &self.sets {
            let late_ms = self.asked.latencies_ms.last().copied().unwrap_or_default();
            for latency_ms in [0, late_ms] {
                let windows = set.errors.iter().map(|errors| errors.windows).max().unwrap_or_default();
                let title =
                    format!("{} ({windows} windows): error in metres, {latency_ms} ms late", set.name);
                let row = |(name, errors): (&PredictorName, &Errors)| {
                    let at = |s: &u32| cell(errors.mean_m(f64::from(latency_ms) * 1e-3 + f64::from(*s)), 3);
                    std::iter::once(self.asked.named(*name)).chain(whole.iter().map(at)).collect()
                };
                let rows = self.asked.predictors.iter().zip(&set.errors).map(row);
                text += &align(&std::iter::once(head(title)).chain(rows).collect::<Vec<_>>());
                text.push('\n');
            }
            let _infallible = writeln!(
                text,
                "{:.1} % of those in sight came within the last {late_ms} ms: a consumer that late does not know them\n",
                100.0 * set.unseen_per_s * f64::from(late_ms) * 1e-3
            );
            text += &self.crossovers(set, &head);
            self.asked.run_time.iter().for_each(|times| text += &self.with_run_times(set, times, &head));
        }
        for set in &self.absent {
            let _infallible = writeln!(text, "{set}: its data are not there, left out");
        }
        text
    }

    fn crossovers(&self, set: &OfSet<'_>, head: &dyn Fn(String) -> Vec<String>) -> String {
        let first = self.asked.named(self.asked.predictors[0]);
        let mut rows = vec![head(format!("{}: ms late at which it falls behind {first} at 0 ms", set.name))];
        for (k, name) in self.asked.predictors.iter().enumerate().skip(1) {
            let cell = |s: u32| match set.may_be_late_ms(k, s) {
                Some(ms) if ms < 0.0 => "is behind".to_owned(),
                Some(ms) => format!("{ms:.0}"),
                None => "-".to_owned(),
            };
            rows.push(
                std::iter::once(self.asked.named(*name))
                    .chain((1..=self.asked.horizon_s).map(cell))
                    .collect(),
            );
        }
        align(&rows) + "\n"
    }

    /// Table of errors, each predictor at its own run time.
    fn with_run_times(
        &self,
        set: &OfSet<'_>,
        times: &RunTimes,
        head: &dyn Fn(String) -> Vec<String>,
    ) -> String {
        let mut rows =
            vec![head(format!("{}: error in metres, late by the run time {}", set.name, times.name))];
        for (name, errors) in self.asked.predictors.iter().zip(&set.errors) {
            if !times.ms.contains_key(name) {
                continue;
            }
            let cell = |s: u32| {
                let Some(ms) = times.of(*name, s) else { return "-".to_owned() };
                let m = errors.mean_m(ms * 1e-3 + f64::from(s));
                m.map_or("-".to_owned(), |m| format!("{m:.3} ({ms} ms)"))
            };
            let cells = (1..=self.asked.horizon_s).map(cell);
            rows.push(std::iter::once(self.asked.named(*name)).chain(cells).collect());
        }
        align(&rows) + "\n"
    }
}
