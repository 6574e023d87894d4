//! `swerve calibrate`: planner run times measured on this host, one run at a time, and stored as percentiles;
//! parameters of an emulated detector fitted to an accuracy.

mod detector;

use std::path::PathBuf;

use anyhow::Context as _;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::{RunInput, drive_observed, load, trust};
use swerve_flow::{Event, Observer};
use swerve_msg::Plan;
use swerve_stack::Registry;
use swerve_stack::config::execution::Runtime;
use swerve_stack::config::{Fineness, PlannerName};
use swerve_stack::pipeline::Pipeline;

/// `swerve calibrate`.
#[derive(clap::Args, Debug)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct CalibrateArgs {
    #[command(subcommand)]
    what: Option<What>,
    #[command(flatten)]
    input: Option<RunInput>,
    /// Ego speeds to drive the scenario at, m/s
    #[arg(long, value_delimiter = ',', default_value = "16,18,20,22", value_parser = speed)]
    speeds: Vec<f64>,
    /// Write the configuration with the measured run times to this file instead of standard output
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

/// Further calibrations.
#[derive(clap::Subcommand, Debug)]
enum What {
    /// Fit an emulated detector to an accuracy, over the frames of the scenarios
    Detector(detector::DetectorArgs),
}

/// Stored percentiles.
const PERCENTILES: [f64; 8] = [0.0, 10.0, 25.0, 50.0, 75.0, 90.0, 99.0, 100.0];

/// Parses a speed above zero, m/s, at which a planner has something to plan.
fn speed(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(mps) if mps > 0.0 && mps <= 70.0 => Ok(mps),
        _ => Err("expected m/s above 0 and at most 70".to_owned()),
    }
}

/// Measures all planners at both discretisations, one run at a time.
pub fn run(args: &CalibrateArgs, registry: &Registry) -> anyhow::Result<()> {
    if let Some(What::Detector(args)) = &args.what {
        return detector::run(args, registry);
    }
    let input = args.input.as_ref().context("a scenario is required")?;
    let (base, scenario) = load(registry, input)?;
    trust::start(&base)?;
    args.overwrite.check(args.out.as_deref())?;
    let assembly = Pipeline::build(&base, &scenario)?.assembly;
    let planning = assembly.publisher::<Plan>().context("no operator of the pipeline plans")?.to_owned();
    let mut config = base.clone();
    for planner in registry.planners().map(PlannerName::new) {
        for fineness in [Fineness::Fast, Fineness::Slow] {
            let mut host = HostTimes { planner: planning.clone(), ms: Vec::new() };
            for (i, speed) in std::iter::once(&args.speeds[0]).chain(&args.speeds).enumerate() {
                let mut cell = base.clone();
                cell.planning.planner = planner.clone();
                cell.planning.discretisation = fineness;
                cell.ego.speed_mps = Some(*speed);
                drive_observed(&cell, &scenario, 1, &mut [&mut host])?;
                if i == 0 {
                    // The first run warms caches and branch predictors; its times are not representative.
                    host.ms.clear();
                }
            }
            let runtime =
                host.percentiles().with_context(|| format!("{} never planned", planner.as_str()))?;
            let of = |p: usize| runtime.percentiles_ms.as_ref().map_or(0.0, |points| points[p][1]);
            eprintln!(
                "{:>13} {}: {} plans, median {:.3} ms, p99 {:.3} ms",
                planner.as_str(),
                fineness.as_str(),
                host.ms.len(),
                of(3),
                of(6)
            );
            config.planning.cost.entry(planner.clone()).or_default().insert(fineness, runtime);
        }
    }
    match &args.out {
        Some(path) => swerve_report::files::write_whole(path, config.to_text().as_bytes()),
        None => swerve_report::output::print(&config.to_text()),
    }
}

/// Run times of the planner's steps on this host, ms.
struct HostTimes {
    planner: String,
    ms: Vec<f64>,
}

impl HostTimes {
    fn percentiles(&mut self) -> Option<Runtime> {
        self.ms.sort_by(f64::total_cmp);
        let last = self.ms.len().checked_sub(1)?;
        let at = |p: f64| {
            let ms = self.ms[(p / 100.0 * last as f64).round() as usize];
            (ms * 1e4).round() * 1e-4
        };
        let points = PERCENTILES.iter().map(|&p| [p, at(p)]).collect();
        Some(Runtime { percentiles_ms: Some(points), ..Runtime::default() })
    }
}

impl Observer for HostTimes {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::StepEnd(step) = event
            && step.operator == self.planner
        {
            self.ms.push(step.host_ns as f64 * 1e-6);
        }
    }
}
