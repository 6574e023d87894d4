//! `swerve run`: a scenario driven by a pipeline, measured, recorded, drawn.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use swerve_core::{Digest, Span};
use swerve_eval::{Evaluation, Metrics, Outline};
use swerve_flow::{Event, Observer, RunOptions, RunReport, run_virtual};
use swerve_msg::truth::WorldState;
use swerve_msg::{Imu, ObstacleList, Plan};
use swerve_scenario::{Metric, Scenario};

use crate::config::Config;
use crate::config::text::{Problem, parse_assignment};
use crate::pipeline::Pipeline;
use crate::progress::Progress;

/// What is driven, by what.
#[derive(clap::Args, Debug)]
pub struct RunInput {
    /// Scenario file (TOML)
    pub scenario: PathBuf,
    /// Configuration file (TOML); every key that it leaves out has a default
    #[arg(short, long)]
    pub config: Option<PathBuf>,
    /// Set a configuration key, such as planning.planner=rrt_star
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Seed of everything random
    #[arg(long)]
    pub seed: Option<u64>,
}

/// `swerve run`.
#[derive(clap::Args, Debug)]
pub struct RunArgs {
    #[command(flatten)]
    input: RunInput,
    /// Output folder [default: out/<scenario>]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    /// Worker threads for heavy steps; the result does not depend on them
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Take run times from an earlier log instead of the configuration
    #[arg(long, value_name = "LOG")]
    runtimes: Option<PathBuf>,
}

/// What a run came to.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its measures.
    pub metrics: Metrics,
    /// One number that two equal runs share.
    pub digest: Digest,
    /// What the engine counted.
    pub report: RunReport,
}

/// Several problems as one error.
pub fn problems_error<P: ToString>(problems: &[P]) -> anyhow::Error {
    let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
    anyhow!(lines.join("\n"))
}

/// Reads a scenario file; all its problems in one error.
pub fn read_scenario(path: &Path) -> anyhow::Result<Scenario> {
    Scenario::read(path).map_err(|problems| problems_error(&problems))
}

/// Reads and checks what a command line names.
pub fn load(input: &RunInput) -> anyhow::Result<(Config, Scenario)> {
    let sets: Result<Vec<_>, Problem> = input.set.iter().map(|s| parse_assignment(s)).collect();
    let mut sets = sets?;
    if let Some(seed) = input.seed {
        sets.push(("seed".into(), toml::Value::Integer(i64::try_from(seed).context("--seed is too large")?)));
    }
    let config = Config::load(input.config.as_deref(), &sets).map_err(|problems| problems_error(&problems))?;
    Ok((config, read_scenario(&input.scenario)?))
}

/// Drives a scenario without leaving files.
pub fn drive(config: &Config, scenario: &Scenario) -> anyhow::Result<Outcome> {
    drive_observed(config, scenario, 1, &mut [])
}

/// Drives a scenario; `observers` are told everything that happens.
pub fn drive_observed(
    config: &Config,
    scenario: &Scenario,
    threads: usize,
    observers: &mut [&mut dyn Observer],
) -> anyhow::Result<Outcome> {
    let pipeline = Pipeline::build(config, scenario)?;
    drive_pipeline(pipeline, config.seed, threads, observers)
}

/// Runs a pipeline that is already built.
pub fn drive_pipeline(
    pipeline: Pipeline,
    seed: u64,
    threads: usize,
    observers: &mut [&mut dyn Observer],
) -> anyhow::Result<Outcome> {
    let mut measured = Measured::of(&pipeline)?;
    let options = RunOptions::until(pipeline.until).seed(seed).threads(threads);
    let report = {
        let mut all: Vec<&mut dyn Observer> = vec![&mut measured];
        all.extend(observers.iter_mut().map(|o| &mut **o as &mut dyn Observer));
        run_virtual(pipeline.graph, &options, all)?
    };
    Ok(Outcome { metrics: measured.evaluation.metrics(), digest: report.digest, report })
}

/// Feeds the evaluation with what the engine tells.
struct Measured {
    evaluation: Evaluation,
    operators: Vec<String>,
}

impl Measured {
    fn of(pipeline: &Pipeline) -> anyhow::Result<Self> {
        let shape = pipeline.vehicle.shape;
        let ego = Outline {
            length_m: shape.length_m,
            width_m: shape.width_m,
            center_ahead_m: shape.center_ahead_m(),
        };
        let operators: Vec<String> =
            pipeline.graph.describe()?.operators.iter().map(|o| o.name.to_string()).collect();
        let dead_time = Span::from_secs(pipeline.vehicle.dead_time_s);
        let params = swerve_eval::Params { ego, dead_time, operators: operators.clone() };
        Ok(Self { evaluation: Evaluation::new(params), operators })
    }

    fn operator(&self, name: &str) -> Option<usize> {
        self.operators.iter().position(|o| o == name)
    }
}

impl Observer for Measured {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Publication(publication) => {
                let Some(payload) = publication.payload.map(|p| p.as_any()) else { return };
                let evaluation = &mut self.evaluation;
                if let Some(world) = payload.downcast_ref::<WorldState>() {
                    evaluation.world(world);
                } else if let Some(imu) = payload.downcast_ref::<Imu>() {
                    evaluation.imu(imu);
                } else if let Some(list) = payload.downcast_ref::<ObstacleList>() {
                    evaluation.seen(list);
                } else if let Some(plan) = payload.downcast_ref::<Plan>() {
                    evaluation.plan(plan);
                } else if publication.operator == "controller" {
                    evaluation.command(publication.visible_at, publication.origin);
                }
            }
            Event::StepEnd(step) => {
                if let Some(operator) = self.operator(step.operator) {
                    self.evaluation.runtimes().step(operator, step.end - step.start);
                }
            }
            Event::Miss(miss) => {
                if let Some(operator) = self.operator(miss.operator) {
                    self.evaluation.runtimes().missed(operator);
                }
            }
            Event::Drop(dropped) => {
                if let Some(operator) = self.operator(dropped.operator) {
                    self.evaluation.runtimes().dropped(operator);
                }
            }
            Event::StepStart(_) | Event::Decision(_) | Event::End(_) => {}
        }
    }
}

/// Shows how far simulated time has come.
struct Shown {
    progress: Progress,
}

impl Observer for Shown {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(publication) = event
            && publication.operator == "pose"
        {
            self.progress.simulated_to(publication.visible_at.as_secs());
        }
    }
}

/// A figure of a run that a scenario can put bounds on.
pub fn figure(metrics: &Metrics, metric: Metric) -> Option<f64> {
    match metric {
        Metric::MinDistanceM => metrics.min_distance_m,
        Metric::ImpactSpeedMps => Some(metrics.impact_speed_mps),
        Metric::ClosingSpeedMps => Some(metrics.impact.map_or(0.0, |i| i.closing_speed_mps)),
        Metric::EndSpeedMps => Some(metrics.drive.speed_end_mps),
        Metric::DurationS => Some(metrics.drive.duration_s),
        Metric::LateralAccelMaxMps2 => Some(metrics.drive.lateral_accel_max_mps2),
        Metric::LateralJerkMaxMps3 => metrics.lateral_jerk.raw_max_mps3,
        Metric::RoadMarginM => None,
    }
}
