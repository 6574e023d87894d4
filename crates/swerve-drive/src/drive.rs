//! Running a pipeline, and its outcome.

use core::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context as _;
use swerve_core::Digest;
use swerve_eval::{Metrics, Verdict};
use swerve_flow::{
    EndReason, Event, Observer, RunOptions, RunReport, RuntimeModel, StopHandle, run_virtual, run_wall,
};
use swerve_log::Log;
use swerve_scenario::{Expectation, Metric, Scenario};
use swerve_stack::config::clock::Clock;
use swerve_stack::pipeline::Pipeline;
use swerve_stack::{Namespace, Rendered, Setup};

use crate::ego::OfEgo;
use crate::measured::Measured;
use crate::process::Processes;
use crate::rungs::Rungs;

/// Result of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Name of the ego; the first, if there are several.
    pub ego: String,
    /// Metrics.
    pub metrics: Metrics,
    /// Digest of the run; equal for identical runs.
    pub digest: Digest,
    /// Smallest distance of the ego's outline to the edge of the drivable ground, m; negative outside.
    pub road_margin_m: f64,
    /// Counters of the engine.
    pub report: RunReport,
    /// Device that rendered the images, if any.
    pub rendered: Option<Rendered>,
    /// Rungs and time budgets chosen under deadlines.
    pub rungs: Rungs,
    /// Results of the other egos, ordered by identity.
    pub others: Vec<OtherOutcome>,
}

/// Result of an ego beside the first.
#[derive(Clone, Debug)]
pub struct OtherOutcome {
    /// Name of the ego.
    pub ego: String,
    /// Metrics.
    pub metrics: Metrics,
    /// As [`Outcome::road_margin_m`].
    pub road_margin_m: f64,
}

/// Runs a scenario without writing files.
pub fn drive(config: &Setup, scenario: &Scenario) -> anyhow::Result<Outcome> {
    drive_observed(config, scenario, 1, &mut [])
}

/// Runs a scenario and passes all events to `observers`; with several egos, those of the first.
pub fn drive_observed(
    config: &Setup,
    scenario: &Scenario,
    threads: usize,
    observers: &mut [&mut dyn Observer],
) -> anyhow::Result<Outcome> {
    let mut pipeline = Pipeline::build(config, scenario)?;
    let _processes = Processes::start_needed(config, &mut pipeline)?;
    drive_pipeline(pipeline, config.seed, threads, observers)
}

/// Error of a drive that was stopped before its end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stopped;

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("stopped before the end of the drive")
    }
}

impl core::error::Error for Stopped {}

/// As [`drive_observed`], on one thread; a drive ends at its next event once `stop` is set.
///
/// # Errors
/// [`Stopped`] if the drive was ended in this way.
pub fn drive_unless(
    stop: &AtomicBool,
    config: &Setup,
    scenario: &Scenario,
    observers: &mut [&mut dyn Observer],
) -> anyhow::Result<Outcome> {
    let mut pipeline = Pipeline::build(config, scenario)?;
    let _processes = Processes::start_needed(config, &mut pipeline)?;
    let mut ends = EndsOn { stop, run: pipeline.graph.stop_handle() };
    let outcome = drive_recorded(pipeline, config.seed, 1, (&mut [&mut ends], observers))?;
    match outcome.report.end {
        EndReason::Interrupted => Err(Stopped.into()),
        _ => Ok(outcome),
    }
}

/// Ends a run once a flag is set.
struct EndsOn<'a> {
    stop: &'a AtomicBool,
    run: StopHandle,
}

impl Observer for EndsOn<'_> {
    fn event(&mut self, _: &Event<'_>) {
        if self.stop.load(Ordering::Relaxed) {
            self.run.stop();
        }
    }
}

/// Runs a pipeline; `observers` as in [`drive_observed`].
pub fn drive_pipeline(
    pipeline: Pipeline,
    seed: u64,
    threads: usize,
    observers: &mut [&mut dyn Observer],
) -> anyhow::Result<Outcome> {
    drive_recorded(pipeline, seed, threads, (&mut [], observers))
}

/// Same as [`drive_pipeline`]; the observers that come first get the events of all egos, under the names of the graph.
pub fn drive_recorded(
    pipeline: Pipeline,
    seed: u64,
    threads: usize,
    (of_all, of_first): (&mut [&mut dyn Observer], &mut [&mut dyn Observer]),
) -> anyhow::Result<Outcome> {
    anyhow::ensure!(
        pipeline.fed.is_empty(),
        "sim.guest: there is no world: only a program that feeds the stack can run it (swerve_drive::Stack, swerve.Stack)"
    );
    let stacks = pipeline.stacks();
    let measured: anyhow::Result<Vec<Measured>> =
        stacks.iter().map(|stack| Measured::new(&pipeline, stack)).collect();
    let mut measured = measured?;
    let names: Vec<Namespace> = stacks.iter().map(|stack| stack.names.clone()).collect();
    let egos: Vec<String> = stacks.iter().map(|stack| stack.scenario.ego_name.clone()).collect();
    let rendered = pipeline.rendered();
    let run = match pipeline.clock {
        Clock::Virtual => run_virtual,
        Clock::Wall => run_wall,
    };
    let options = RunOptions::until(pipeline.until).seed(seed).threads(threads);
    let report = {
        let measuring = names.iter().zip(measured.iter_mut().map(|m| m as &mut dyn Observer));
        let shown =
            of_first.iter_mut().map(|observer| (&pipeline.names, &mut **observer as &mut dyn Observer));
        let mut of_egos: Vec<_> =
            measuring.chain(shown).map(|(names, observer)| OfEgo::new(names, observer)).collect();
        let (measuring, shown) = of_egos.split_at_mut(names.len());
        let mut all: Vec<&mut dyn Observer> = Vec::new();
        all.extend(measuring.iter_mut().map(|of_ego| of_ego as &mut dyn Observer));
        all.extend(of_all.iter_mut().map(|observer| &mut **observer as &mut dyn Observer));
        all.extend(shown.iter_mut().map(|of_ego| of_ego as &mut dyn Observer));
        run(pipeline.graph, &options, all)?
    };
    let mut measured = egos.into_iter().zip(measured);
    let (ego, first) = measured.next().context("a run has an ego")?;
    let other = |(ego, measured): (String, Measured)| OtherOutcome {
        ego,
        metrics: measured.metrics(),
        road_margin_m: measured.road_margin_m,
    };
    Ok(Outcome {
        ego,
        metrics: first.metrics(),
        digest: report.digest,
        road_margin_m: first.road_margin_m,
        report,
        rendered: rendered(),
        rungs: first.rungs,
        others: measured.map(other).collect(),
    })
}

/// Gives every operator accepted by `takes` its run times from a log.
pub fn record_run_times(pipeline: &mut Pipeline, log: &Log, takes: impl Fn(&str) -> bool) {
    for (operator, times) in log.run_times().into_iter().filter(|(operator, _)| takes(operator)) {
        if let Ok(node) = pipeline.graph.operator(&operator) {
            let times = Arc::new(times.into_iter().collect());
            let _configured = node.runtime(RuntimeModel::Recorded(times));
        }
    }
}

impl Outcome {
    /// The drive that ended worst: with a collision, off the road, or short of its end; the first of several. Its ego is
    /// named if the run has several.
    pub fn worst(&self) -> (Option<&str>, &Metrics) {
        let badness = |metrics: &Metrics| match metrics.verdict {
            Verdict::Avoided | Verdict::Completed => 0,
            Verdict::Stopped => 1,
            Verdict::Timeout => 2,
            Verdict::Unfinished => 3,
            Verdict::LeftRoad => 4,
            Verdict::Collision => 5,
        };
        let first = (!self.others.is_empty()).then_some(self.ego.as_str());
        let others = self.others.iter().map(|other| (Some(other.ego.as_str()), &other.metrics));
        others.fold(
            (first, &self.metrics),
            |worst, next| {
                if badness(next.1) > badness(worst.1) { next } else { worst }
            },
        )
    }

    /// Lists the deviations from the expected result, which is that of every ego.
    pub fn broken(&self, expected: &Expectation) -> Vec<String> {
        let first = broken((&self.metrics, self.road_margin_m), expected);
        let others = self.others.iter().flat_map(|other| {
            let found = broken((&other.metrics, other.road_margin_m), expected);
            found.into_iter().map(|found| format!("{}: {found}", other.ego))
        });
        first.into_iter().chain(others).collect()
    }
}

/// Deviations of one ego's drive, by its metrics and its distance to the edge of the road, m, from the expected result.
fn broken((metrics, road_margin_m): (&Metrics, f64), expected: &Expectation) -> Vec<String> {
    if metrics.verdict == Verdict::Unfinished {
        return vec!["the run was ended before the scenario was".into()];
    }
    let value = |metric| value_of((metrics, road_margin_m), metric);
    match metrics.verdict {
        // A stop for an uncertain pose may end at another place and time.
        Verdict::Stopped
            if metrics.plans.pose_uncertain_since_s.or(metrics.pose_silent_since_s).is_some() =>
        {
            let until_stop = expected.until_stop();
            until_stop.broken_by(until_stop.verdict, value)
        }
        verdict => expected.broken_by(verdict, value),
    }
}

/// Value of a metric that a scenario can bound.
fn value_of((metrics, road_margin_m): (&Metrics, f64), metric: Metric) -> Option<f64> {
    match metric {
        Metric::MinDistanceM => metrics.min_distance_m,
        Metric::ImpactSpeedMps => metrics.impact_speed_mps,
        Metric::ClosingSpeedMps => metrics.impact.map(|i| i.closing_speed_mps),
        Metric::EndSpeedMps => Some(metrics.drive.speed_end_mps),
        Metric::DurationS => Some(metrics.drive.duration_s),
        Metric::LateralAccelMaxMps2 => Some(metrics.drive.lateral_accel_max_mps2),
        Metric::LateralJerkMaxMps3 => metrics.lateral_jerk.raw_max_mps3,
        Metric::DecelerationMaxMps2 => Some(metrics.drive.deceleration_max_mps2),
        Metric::ComfortShare => metrics.comfort.map(|comfort| comfort.share_within),
        Metric::RoadMarginM => Some(road_margin_m),
        Metric::RedLightsPassed => Some(metrics.red_lights_passed as f64),
        Metric::MinTtcS => metrics.safety.min_ttc_s,
        Metric::MinHeadwayS => metrics.safety.min_headway_s,
        Metric::DistanceOverLineM => metrics.safety.distance_over_line_m,
        Metric::TimeInOncomingLaneS => metrics.safety.time_in_oncoming_lane_s,
        Metric::SpeedOverTargetMps => metrics.safety.speed_over_target_mps,
    }
}
