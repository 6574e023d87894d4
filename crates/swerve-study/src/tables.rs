//! Tables of a study file that ask for further results: a curve, a ranking, timely accuracy.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_measure::evaluate::prediction::Format;
use swerve_prediction::PredictorName;
use swerve_text::{Document, Problems, list, number};

use crate::columns::check_numeric;
use crate::grid::Step;

/// A quantity over time.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Curve {
    /// Difference quotient of the lateral acceleration at the centre of gravity over 50 ms, m/s³, as logged by Pylot:
    /// from the start to the first contact.
    LateralJerk,
}

/// Ranking of settings in a study.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ranking {
    /// Axes whose combinations are settings; all others are pooled.
    pub settings: Vec<String>,
    /// One of these axes: the best setting of each of its values is reported, and compared with the best of the others.
    pub best_of: Option<String>,
}

impl Ranking {
    /// Checks the ranking against the names of the axes.
    pub(super) fn check(&self, document: &Document, axes: &[String], problems: &mut Problems) {
        if self.settings.is_empty() {
            problems.push(document.problem("ranking.settings", "expected at least one axis"));
        }
        for name in self.settings.iter().filter(|name| !axes.contains(name)) {
            problems.push(document.problem("ranking.settings", no_axis(name, axes)));
        }
        if let Some(name) = first_twice(&self.settings) {
            problems.push(document.problem("ranking.settings", format!("`{name}` occurs twice")));
        }
        if let Some(name) = self.best_of.as_ref().filter(|name| !self.settings.contains(name)) {
            let settings: Vec<&str> = self.settings.iter().map(String::as_str).collect();
            let message = format!("`{name}` is not one of `settings`; expected one of {}", list(&settings));
            problems.push(document.problem("ranking.best_of", message));
        }
    }
}

/// Mean of a metric over a numeric axis.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plot {
    /// Axis with numbers.
    pub x: String,
    /// Column of `cells.csv`. Of booleans, the mean is the share of `true`.
    pub y: String,
    /// Axes whose combinations are lines; all others are pooled.
    #[serde(default)]
    pub lines: Vec<String>,
    /// Heading of the picture; default: the column.
    pub label: Option<String>,
}

impl Plot {
    /// Checks the plot against the axes and the labels of their steps.
    pub(super) fn check(
        &self,
        document: &Document,
        (axes, steps): (&[String], &[Vec<Step>]),
        problems: &mut Problems,
    ) {
        match axes.iter().position(|axis| *axis == self.x) {
            None => problems.push(document.problem("plot.x", no_axis(&self.x, axes))),
            Some(axis) => {
                let is_text = |step: &&Step| !step.label.parse().is_ok_and(f64::is_finite);
                if let Some(step) = steps[axis].iter().find(is_text) {
                    let message = format!("expected an axis with numbers, found `{}`", step.label);
                    problems.push(document.problem("plot.x", message));
                } else if let Some([one, other]) = equal_numbers(&steps[axis]) {
                    let message = format!("`{one}` and `{other}` are the same number");
                    problems.push(document.problem("plot.x", message));
                }
            }
        }
        if let Err(message) = check_numeric(&self.y) {
            problems.push(document.problem("plot.y", message));
        }
        for name in self.lines.iter().filter(|name| !axes.contains(name) || **name == self.x) {
            let others: Vec<String> = axes.iter().filter(|axis| **axis != self.x).cloned().collect();
            problems.push(document.problem("plot.lines", no_axis(name, &others)));
        }
        if let Some(name) = first_twice(&self.lines) {
            problems.push(document.problem("plot.lines", format!("`{name}` occurs twice")));
        }
    }
}

/// `[timely]` of a study file.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Timely {
    /// Measures of accuracy.
    pub measures: Vec<Measure>,
    /// Run times from a frame to its result, ms; instead of `of_published`.
    #[serde(default)]
    pub run_times_ms: Vec<f64>,
    /// Run times as multiples of the published run time of `perception.detector` on its authors' machine, or of the
    /// measured run time of the rung of the operator `camera_objects`; instead of `run_times_ms`.
    #[serde(default)]
    pub of_published: Vec<f64>,
    /// Numeric axis along which pictures and tables are drawn, if not the run time.
    pub over: Option<String>,
    /// Number of pedestrians on the pavements, drawn by the cell's seed.
    #[serde(default = "Timely::walkers")]
    pub walkers: u32,
    /// Length of the straight road, metres.
    #[serde(default = "Timely::length_m")]
    pub length_m: f64,
    /// Time between comparisons, ms; also the frame period of trackers.
    #[serde(default = "Timely::judge_ms")]
    pub judge_ms: f64,
    /// Maximum distance of pedestrians that count, metres.
    #[serde(default = "Timely::within_m")]
    pub within_m: f64,
}

/// Measure of accuracy. All values are 0 to 1, except that MOTA may be negative.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Mean intersection over union of the rendered classes.
    Miou,
    /// Mean intersection over union of the rendered truth in the classes of the segmentation `street`: the effect of
    /// latency alone.
    GroupedMiou,
    /// Mean intersection over union of the output of the segmentation `street` on the rendered colours.
    ForestMiou,
    /// Share of the rendered boxes of pedestrians in the old frame that still match a pedestrian (overlap 0.5). This is
    /// the paper's AP50 of a perfect detector, whose scores are all 1.
    Ap50,
    /// AP50 over the whole ride, of an operator of the kind `camera_objects` on rendered colours or, if there is none,
    /// of the detector that `perception.detector` emulates.
    DetectorAp50,
    /// MOTA, IDF1 and HOTA of SORT with that detector.
    Sort,
    /// MOTA, IDF1 and HOTA of ByteTrack with that detector.
    Bytetrack,
}

/// Maximum number of run times in one study.
const TIMES_MAX: usize = 200;

impl Timely {
    fn walkers() -> u32 {
        91
    }

    fn length_m() -> f64 {
        370.0
    }

    fn judge_ms() -> f64 {
        250.0
    }

    fn within_m() -> f64 {
        125.0
    }

    /// Checks the table itself.
    pub(super) fn check(&self, document: &Document, axes: &[String], problems: &mut Problems) {
        let mut wrong =
            |key: &str, message: String| problems.push(document.problem(&format!("timely.{key}"), message));
        if self.measures.is_empty() {
            wrong("measures", "expected at least one measure".into());
        }
        if first_twice(&self.measures).is_some() {
            wrong("measures", "expected each once".into());
        }
        if self.run_times_ms.is_empty() == self.of_published.is_empty() {
            wrong("run_times_ms", "expected numbers here or in `of_published`, not in both".into());
        }
        for (key, times, most) in
            [("run_times_ms", &self.run_times_ms, 5000.0), ("of_published", &self.of_published, 100.0)]
        {
            let rises = times.windows(2).all(|pair| pair[0] < pair[1]);
            let fits = times.iter().all(|x| (0.0..=most).contains(x)) && times.len() <= TIMES_MAX;
            if !(rises && fits) {
                let message =
                    format!("expected rising numbers from 0 to {}, at most {TIMES_MAX}", number(most));
                wrong(key, message);
            }
        }
        let ranges = [
            ("walkers", f64::from(self.walkers), [0.0, 1000.0]),
            ("length_m", self.length_m, [20.0, 5000.0]),
            ("judge_ms", self.judge_ms, [1.0, 10_000.0]),
            ("within_m", self.within_m, [1.0, 1000.0]),
        ];
        for (key, value, [least, most]) in ranges {
            if !(least..=most).contains(&value) {
                let (least, most) = (number(least), number(most));
                wrong(key, format!("expected {least} to {most}, found {}", number(value)));
            }
        }
        if let Some(axis) = self.over.as_ref().filter(|axis| !axes.contains(axis)) {
            wrong("over", no_axis(axis, axes));
        }
    }
}

/// `[timely_prediction]` of a study file.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimelyPrediction {
    /// Predictors to compare: all others with the first one at zero latency. The picture distinguishes the first eight.
    pub predictors: Vec<PredictorName>,
    /// Time for which `truth` knows the future, seconds; it continues straight on after that.
    #[serde(default = "TimelyPrediction::truth_s")]
    pub truth_s: f64,
    /// Latencies in the tables, ms.
    #[serde(default = "TimelyPrediction::latencies_ms")]
    pub latencies_ms: Vec<u32>,
    /// Maximum prediction horizon in the tables, seconds: integers from 0 up to this.
    #[serde(default = "TimelyPrediction::horizon_s")]
    pub horizon_s: u32,
    /// Sets of tracks.
    pub set: Vec<TrackSet>,
    /// Run times of the predictors, at which they are also compared.
    #[serde(default)]
    pub run_time: Vec<RunTimes>,
}

/// Set of tracks, and its evaluation.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrackSet {
    /// Name in tables.
    pub name: String,
    /// Recordings in a folder; if the folder is missing, the set is left out and the result states it.
    pub recorded: Option<RecordedSet>,
    /// Generated recordings of a crossing, one minute each.
    pub made: Option<MadeSet>,
    /// Observed steps, up to the present.
    #[serde(default = "TrackSet::observe")]
    pub observe: usize,
    /// Interval between evaluated instants, in steps of the recording.
    #[serde(default = "TrackSet::every")]
    pub every: usize,
}

/// Recordings in a folder.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordedSet {
    /// Format of the recordings.
    pub format: Format,
    /// Folder, relative to the study's.
    pub folder: PathBuf,
    /// Names of the files.
    pub files: Vec<String>,
}

/// Generated recordings of one minute each, with cars following the intelligent driver model and pedestrians using
/// reciprocal collision avoidance.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MadeSet {
    /// First and last seed.
    pub seeds: [u64; 2],
    /// Number of pedestrians at the same time.
    pub people: usize,
}

/// Run times of predictors.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunTimes {
    /// Source of the run times.
    pub name: String,
    /// Run times by predictor, ms: one for every horizon, or one for each integer second ahead, from 1 on.
    pub ms: BTreeMap<PredictorName, Vec<f64>>,
}

/// Maximum latency, ms; run times in a study are not longer.
const LATENCY_MAX_MS: u32 = 2000;

impl TimelyPrediction {
    fn truth_s() -> f64 {
        1.0
    }

    fn latencies_ms() -> Vec<u32> {
        vec![0, 20, 50, 100, 200, 500]
    }

    fn horizon_s() -> u32 {
        5
    }

    /// Checks the table.
    pub(super) fn check(&self, document: &Document, problems: &mut Problems) {
        let mut ensure = |holds: bool, key: String, expected: &str| {
            if !holds {
                problems.push(document.problem(&format!("timely_prediction.{key}"), expected));
            }
        };
        let mut once = self.predictors.clone();
        once.sort();
        once.dedup();
        ensure(self.predictors.len() > 1, "predictors".into(), "expected two or more to compare");
        ensure(once.len() == self.predictors.len(), "predictors".into(), "expected each once");
        ensure((0.0..=60.0).contains(&self.truth_s), "truth_s".into(), "expected 0 to 60");
        let rise = self.latencies_ms.windows(2).all(|pair| pair[0] < pair[1]);
        let fit = self.latencies_ms.last().is_some_and(|last| *last <= LATENCY_MAX_MS);
        ensure(rise && fit, "latencies_ms".into(), "expected rising whole numbers from 0 to 2000");
        ensure((1..=20).contains(&self.horizon_s), "horizon_s".into(), "expected 1 to 20");
        ensure(!self.set.is_empty(), "set".into(), "expected at least one set of tracks");
        for (k, set) in self.set.iter().enumerate() {
            let key = |key: &str| format!("set[{k}].{key}");
            ensure(
                set.recorded.is_some() != set.made.is_some(),
                key("name"),
                "expected `recorded` or `made`",
            );
            ensure((2..=1000).contains(&set.observe), key("observe"), "expected 2 to 1000");
            ensure((1..=1000).contains(&set.every), key("every"), "expected 1 to 1000");
            if let Some(made) = &set.made {
                let [first, last] = made.seeds;
                let some = first <= last && last - first < 1000;
                ensure(some, key("made.seeds"), "expected the first and the last of at most 1000");
                ensure(made.people <= 200, key("made.people"), "expected at most 200");
            }
        }
        for (k, times) in self.run_time.iter().enumerate() {
            let most = f64::from(LATENCY_MAX_MS);
            let fits = |ms: &Vec<f64>| {
                (ms.len() == 1 || ms.len() == self.horizon_s as usize)
                    && ms.iter().all(|ms| (0.0..=most).contains(ms))
            };
            let expected = "expected 0 to 2000, once or for each second of `horizon_s`";
            ensure(times.ms.values().all(fits), format!("run_time[{k}].ms"), expected);
        }
    }
}

impl TrackSet {
    fn observe() -> usize {
        8
    }

    fn every() -> usize {
        1
    }
}

/// The first item that occurs a second time.
fn first_twice<T: PartialEq>(items: &[T]) -> Option<&T> {
    items.iter().enumerate().find(|(k, item)| items[..*k].contains(item)).map(|(_, item)| item)
}

/// Labels of the first two steps of an axis that are the same number in two notations.
fn equal_numbers(steps: &[Step]) -> Option<[&str; 2]> {
    let number = |step: &Step| step.label.parse().unwrap_or(f64::NAN);
    let mut numbers: Vec<(f64, &str)> = steps.iter().map(|step| (number(step), &*step.label)).collect();
    numbers.sort_by(|a, b| a.0.total_cmp(&b.0));
    numbers.windows(2).find(|pair| pair[0].0 == pair[1].0).map(|pair| [pair[0].1, pair[1].1])
}

/// Error message for an unknown axis.
pub(crate) fn no_axis(name: &str, axes: &[String]) -> String {
    let axes: Vec<&str> = axes.iter().map(String::as_str).collect();
    let expected = if axes.is_empty() {
        "the study has none".into()
    } else {
        format!("expected one of {}", list(&axes))
    };
    format!("no axis of the name `{name}`; {expected}")
}
