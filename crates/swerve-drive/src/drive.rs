//! Running a pipeline, and its outcome.

use std::sync::Arc;

use swerve_core::Digest;
use swerve_eval::{Metrics, Verdict};
use swerve_flow::{Observer, RunOptions, RunReport, RuntimeModel, run_virtual, run_wall};
use swerve_log::Log;
use swerve_scenario::{Expectation, Metric, Scenario};
use swerve_stack::Rendered;
use swerve_stack::Setup;
use swerve_stack::config::clock::Clock;
use swerve_stack::pipeline::Pipeline;

use crate::measured::Measured;
use crate::process::Processes;
use crate::rungs::Rungs;

/// Result of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
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
}

/// Runs a scenario without writing files.
pub fn drive(config: &Setup, scenario: &Scenario) -> anyhow::Result<Outcome> {
    drive_observed(config, scenario, 1, &mut [])
}

/// Runs a scenario and passes all events to `observers`.
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

/// Runs a pipeline.
pub fn drive_pipeline(
    pipeline: Pipeline,
    seed: u64,
    threads: usize,
    observers: &mut [&mut dyn Observer],
) -> anyhow::Result<Outcome> {
    let mut measured = Measured::new(&pipeline)?;
    let rendered = pipeline.rendered();
    let run = match pipeline.clock {
        Clock::Virtual => run_virtual,
        Clock::Wall => run_wall,
    };
    let options = RunOptions::until(pipeline.until).seed(seed).threads(threads);
    let report = {
        let mut all: Vec<&mut dyn Observer> = vec![&mut measured];
        all.extend(observers.iter_mut().map(|o| &mut **o as &mut dyn Observer));
        run(pipeline.graph, &options, all)?
    };
    Ok(Outcome {
        metrics: measured.evaluation.metrics(),
        digest: report.digest,
        road_margin_m: measured.road_margin_m,
        report,
        rendered: rendered(),
        rungs: measured.rungs,
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
    /// Lists the deviations from the expected result.
    pub fn broken(&self, expected: &Expectation) -> Vec<String> {
        if self.metrics.verdict == Verdict::Unfinished {
            return vec!["the run was ended before the scenario was".into()];
        }
        let plans = &self.metrics.plans;
        match self.metrics.verdict {
            // A stop for an uncertain pose may end at another place and time.
            Verdict::Stopped
                if plans.pose_uncertain_since_s.or(self.metrics.pose_silent_since_s).is_some() =>
            {
                let until_stop = expected.until_stop();
                until_stop.broken_by(until_stop.verdict, |metric| self.value_of(metric))
            }
            verdict => expected.broken_by(verdict, |metric| self.value_of(metric)),
        }
    }

    /// Value of a metric that a scenario can bound.
    fn value_of(&self, metric: Metric) -> Option<f64> {
        let metrics = &self.metrics;
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
            Metric::RoadMarginM => Some(self.road_margin_m),
            Metric::RedLightsPassed => Some(metrics.red_lights_passed as f64),
            Metric::MinTtcS => metrics.safety.min_ttc_s,
            Metric::MinHeadwayS => metrics.safety.min_headway_s,
            Metric::DistanceOverLineM => metrics.safety.distance_over_line_m,
            Metric::TimeInOncomingLaneS => metrics.safety.time_in_oncoming_lane_s,
            Metric::SpeedOverTargetMps => metrics.safety.speed_over_target_mps,
        }
    }
}
