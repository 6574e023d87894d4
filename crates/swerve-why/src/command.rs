//! `swerve why`: prints the causal chain of a logged run.

use std::path::PathBuf;

use swerve_drive::page::given_log;
use swerve_drive::trust::CodeArgs;
use swerve_eval::{Metrics, Why};
use swerve_report::output::{print, tell};
use swerve_stack::Registry;

use super::Logged;

/// `swerve why`.
#[derive(clap::Args, Debug)]
pub struct WhyArgs {
    /// Log file (MCAP), or the folder of a run
    log: PathBuf,
    /// Actor to explain, by its name in the scenario [default: the one that decided the verdict]
    #[arg(long, value_name = "NAME", conflicts_with = "at")]
    actor: Option<String>,
    /// Explain the actor that was nearest at this instant, in seconds
    #[arg(long, value_name = "T")]
    at: Option<f64>,
    /// Ego of a run with several [default: the first]
    #[arg(long, value_name = "NAME")]
    ego: Option<String>,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    code: CodeArgs,
}

/// Memory limit for the log of a run that was just recorded, bytes: about four minutes of a drive with one actor.
const OF_RUN_BYTES: usize = 80 << 20;

/// Runs `swerve why`.
pub fn run(args: &WhyArgs, registry: &Registry) -> anyhow::Result<()> {
    let log = given_log(&args.log)?;
    let mut logged = Logged::read(&log, registry, args.ego.as_deref())?;
    logged.allow(args.code);
    let why = logged.why_of(args.actor.as_deref(), args.at)?;
    if args.json {
        return print(&(serde_json::to_string_pretty(&why)? + "\n"));
    }
    print(&why.text())
}

/// Causal chain of a run that was just recorded. If it cannot be computed, the run is complete all the same, and the
/// reason is reported on standard error.
pub fn of_run(log: &std::path::Path, registry: &Registry, metrics: &Metrics) -> Option<Why> {
    let why = Logged::read_within((log, None), registry, OF_RUN_BYTES).and_then(|mut logged| {
        // The programs of the run were started a moment ago.
        logged.allow(CodeArgs { allow_code: true });
        logged.why(metrics)
    });
    why.inspect_err(|error| tell(&format!("warning: why it ended so is not known: {error:#}"))).ok()
}
