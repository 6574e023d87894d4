//! Timely accuracy as a study: accuracy of perception at the time of its result, on a ride at a given speed (Gog et al.
//! 2021, section 5). `[timely]` in a study file replaces the verdict.
//!
//! A cell is a ride along a straight road between pedestrians. The perception of one instant is compared with the
//! ground truth at the instant at which its run time is over. There are two anchors: `start`, one result every
//! `judge_ms`, each compared at its end (as in the paper); `end`, one result after the other as soon as the processor
//! is free, and every `judge_ms` the newest finished one is compared (streaming accuracy, Li et al. 2020).

pub(super) mod chart;
mod ride;
mod score;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use anyhow::{Context as _, ensure};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_eval::timely::{Finished, Snap, end_anchored, start_anchored};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::config::camera_detectors::CameraObjectsTable;
use swerve_stack::span_of_ms;
use swerve_text::{Document, Problems, number};

use super::cells::CellResult;
use super::grid::{Cell, no_axis};
use ride::{Eyes, Ride, Sight};
use score::Score;

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
    pub walkers: usize,
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

/// Selection of the frames that are compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Anchor {
    Start,
    End,
}

/// Values of one measure at one run time: one per comparison, or one for the whole ride.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Reading {
    /// Measure and anchor.
    pub series: String,
    /// Run time, ms or multiple of the published one.
    pub at: f64,
    /// Values.
    pub values: Vec<f64>,
}

/// One comparison: the perceived frame, `None` if no result is finished yet, and the frame of the ground truth.
struct Pair {
    anchor: Anchor,
    /// Index of the run time.
    time: usize,
    seen: Option<usize>,
    there: usize,
}

/// Maximum number of run times in one study.
const TIMES_MAX: usize = 200;

impl Timely {
    fn walkers() -> usize {
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
            ("walkers", self.walkers as f64, [0.0, 1000.0]),
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

    /// Run times in the units of the picture.
    fn named_times(&self) -> &[f64] {
        if self.run_times_ms.is_empty() { &self.of_published } else { &self.run_times_ms }
    }

    fn times(&self, config: &Setup) -> anyhow::Result<Vec<Span>> {
        let unit_ms = match self.of_published.is_empty() {
            true => 1.0,
            false => match CameraObjectsTable::first(config) {
                Some(table) => {
                    let time = table.run_time(&config.registry);
                    time.with_context(|| format!("rung `{}` has no measured run time", table.rung))?
                        .typical_ms()
                }
                None => config.perception.published_ms().with_context(|| {
                    format!("perception.detector: `{}` has no published run time", config.perception.detector)
                })?,
            },
        };
        Ok(self.named_times().iter().map(|x| span_of_ms(x * unit_ms)).collect())
    }

    /// Simulates and measures one ride.
    ///
    /// # Errors
    /// If the configuration lacks a measured component, or the camera's images cannot be rendered.
    pub(super) fn run(&self, cell: &Cell, config: &Setup, scenario: &Scenario) -> anyhow::Result<CellResult> {
        let times = self.times(config)?;
        let mut ride = Ride::new(self, config, scenario)?;
        let mut eyes = Eyes::new(self, config, &ride)?;
        let due = self.due(&ride.frames);
        let pairs = self.pairs(&ride.frames, &times, &due);
        let mut by_frame: Vec<Vec<&Pair>> = ride.frames.iter().map(|_| Vec::new()).collect();
        let mut last_use = BTreeMap::<usize, usize>::new();
        for pair in &pairs {
            by_frame[pair.there].push(pair);
            for frame in pair.seen.into_iter().chain([pair.there]) {
                let last = last_use.entry(frame).or_default();
                *last = pair.there.max(*last);
            }
        }
        let mut scores: Vec<Score> = self
            .measures
            .iter()
            .flat_map(|&measure| (0..times.len()).flat_map(move |time| Score::both(measure, time)))
            .collect();
        let mut is_seen = vec![false; ride.frames.len()];
        pairs.iter().filter_map(|pair| pair.seen).for_each(|seen| is_seen[seen] = true);
        let mut sights = BTreeMap::<usize, Sight>::new();
        for (frame, judged) in by_frame.iter().enumerate() {
            let world = ride.next();
            if last_use.contains_key(&frame) {
                sights.insert(frame, eyes.look(&world, due.binary_search(&frame).is_ok(), is_seen[frame])?);
            }
            for pair in judged {
                let seen = pair.seen.and_then(|seen| sights.get(&seen));
                let of_pair = |s: &&mut Score| s.time == pair.time && s.anchor == pair.anchor;
                scores.iter_mut().filter(of_pair).for_each(|score| score.take(seen, &sights[&frame]));
            }
            sights.retain(|seen, _| last_use[seen] > frame);
        }
        let named = self.named_times();
        let timely = scores.into_iter().flat_map(|score| score.readings(named)).collect();
        Ok(CellResult { timely, ..CellResult::blank(cell, "measured") })
    }

    /// Frames at intervals of `judge_ms`: the first one in each interval.
    fn due(&self, frames: &[Time]) -> Vec<usize> {
        let judge = span_of_ms(self.judge_ms);
        let nth = |frame: usize| frames[frame].ns() / judge.ns();
        (0..frames.len()).filter(|&frame| frame == 0 || nth(frame) > nth(frame - 1)).collect()
    }

    /// All comparisons of a ride.
    fn pairs(&self, frames: &[Time], times: &[Span], due: &[usize]) -> Vec<Pair> {
        let streams = self.measures.iter().any(|measure| !measure.tracks());
        let mut pairs = Vec::new();
        for (time, &after) in times.iter().enumerate() {
            let finished = |&frame: &usize| Finished { stamp: frames[frame], after };
            let results: Vec<Finished> = due.iter().map(finished).collect();
            pairs.extend(
                start_anchored(frames, &results, Snap::Ceil).into_iter().map(|(result, there)| Pair {
                    anchor: Anchor::Start,
                    time,
                    seen: Some(due[result]),
                    there,
                }),
            );
            if !streams {
                continue;
            }
            let taken = back_to_back(frames, after);
            let results: Vec<Finished> = taken.iter().map(finished).collect();
            let newest = end_anchored(frames, &results, Snap::Ceil);
            pairs.extend(due.iter().map(|&there| Pair {
                anchor: Anchor::End,
                time,
                seen: newest[there].map(|result| taken[result]),
                there,
            }));
        }
        pairs
    }
}

/// Frames processed by a single processor: each time the first one that arrives when it is free.
fn back_to_back(frames: &[Time], after: Span) -> Vec<usize> {
    let (mut taken, mut free) = (Vec::new(), Time::ZERO);
    for (frame, &stamp) in frames.iter().enumerate() {
        if stamp >= free {
            taken.push(frame);
            free = stamp + after;
        }
    }
    taken
}

/// Speed imposed on the ego, m/s.
fn speed_mps(config: &Setup, scenario: &Scenario) -> anyhow::Result<f64> {
    let speed_mps = config.ego.speed_mps.unwrap_or(scenario.ego.target_speed_mps);
    ensure!(speed_mps > 0.0, "ego.speed_mps: expected a speed above 0, found {}", number(speed_mps));
    Ok(speed_mps)
}
