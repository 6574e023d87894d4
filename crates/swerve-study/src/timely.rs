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
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context as _;
use swerve_core::{Span, Time};
use swerve_drive::Stopped;
use swerve_eval::timely::{Finished, Snap, end_anchored, start_anchored};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::config::camera_detectors::CameraObjectsTable;
use swerve_stack::span_of_ms;

use super::grid::Cell;
use super::result::CellResult;
use super::tables::Timely;
use ride::{Eyes, Ride, Sight};
use score::{Anchor, Score};

/// One comparison: the perceived frame, `None` if no result is finished yet, and the frame of the ground truth.
struct Pair {
    anchor: Anchor,
    /// Index of the run time.
    time: usize,
    seen: Option<usize>,
    there: usize,
}

impl Timely {
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
    /// If the configuration lacks a measured component, or the camera's images cannot be rendered; [`Stopped`] once `stop`
    /// is set.
    pub(super) fn run(
        &self,
        cell: &Cell,
        config: &Setup,
        scenario: &Scenario,
        stop: &AtomicBool,
    ) -> anyhow::Result<CellResult> {
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
            if stop.load(Ordering::Relaxed) {
                return Err(Stopped.into());
            }
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
