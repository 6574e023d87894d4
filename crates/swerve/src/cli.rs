//! The command line.

use std::ffi::OsString;

use clap::{CommandFactory as _, Parser, Subcommand};
use swerve_drive::{graph, process, scenarios, suggest};
use swerve_learn::{calibrate, dataset, train};
use swerve_measure::{evaluate, map, track};
use swerve_stack::Registry;
use swerve_study::{report, suite};

use swerve_reference::{keys, operators};

use crate::{Summary, check, doctor, look, new, plan, replay, run, shell};

/// Runs a whole autonomous-driving stack in a simulated world in which every component's run time counts.
#[derive(Parser, Debug)]
#[command(name = "swerve", version, about, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Run a scenario: verdict, metrics, pictures, log
    Run(run::RunArgs),
    /// Watch a run live in the browser, or play back a log
    View(swerve_view::ViewArgs),
    /// Drive a vehicle over ROS 2 topics
    Live(swerve_live::LiveArgs),
    /// Run a scenario many times, varying configuration keys and seeds along axes
    Study(swerve_study::StudyArgs),
    /// Run scenarios with several seeds each and count the runs with the expected result
    Suite(suite::SuiteArgs),
    /// Explain the end of a logged run: from the instant an actor was first visible to the car's response
    Why(swerve_why::WhyArgs),
    /// Write the HTML report of a run or a study, or a comparison of two
    Report(report::ReportArgs),
    /// Recompute a log's streams and compare them, or recompute them with other settings
    Replay(replay::ReplayArgs),
    /// List the operator kinds available to a configuration, or show one
    Operators(operators::OperatorsArgs),
    /// List the configuration keys: type, default, unit, range, values, description
    Keys(keys::KeysArgs),
    /// Print the dataflow of a configuration
    Graph(graph::GraphArgs),
    /// Simulate a pipeline of timing models: response times, drops, misses, utilisation
    Timing(swerve_timing::TimingArgs),
    /// Solve the planning problems of a file with one planner
    Plan(plan::PlanArgs),
    /// Check scenario, configuration, study and timing files without running them
    Check(check::CheckArgs),
    /// Measure the planners' run times on this host, or fit an emulated detector, and store that in a configuration
    Calibrate(calibrate::CalibrateArgs),
    /// Write labelled images and point clouds of scenarios in KITTI and COCO format
    Dataset(dataset::DatasetArgs),
    /// Evaluate a detector or a tracker against ground truth
    Eval(evaluate::EvalArgs),
    /// Build a lidar map of a road, localize a lidar in it, or show a road network (OpenDRIVE)
    Map(map::MapArgs),
    /// Track the detections of a file
    Track(track::TrackArgs),
    /// Train the built-in perception models on simulated drives
    Train(train::TrainArgs),
    /// Detect objects, lanes, signs, lamps or depth in images; print a table or JSON, or draw pictures
    Look(look::LookArgs),
    /// Show what this machine offers (graphics adapters, shared memory) and what Swerve will use
    Doctor(doctor::DoctorArgs),
    /// Create a project folder: a scenario, a configuration, a custom operator and a README
    New(new::NewArgs),
    /// List the scenarios of a folder and the built-in ones
    Scenarios(scenarios::ScenariosArgs),
    /// Print the completion script of a shell
    Completions(shell::CompletionsArgs),
    /// Write the manual pages
    Man(shell::ManArgs),
    /// Step operators for a run in another process, which starts this one
    #[command(hide = true)]
    Worker,
    /// Run the DDS transport of a run in another process, which starts this one
    #[command(hide = true)]
    Transport,
}

/// Parses a command line, program name first. The error is the message for the terminal.
pub fn parse<W: Into<OsString> + Clone>(words: impl IntoIterator<Item = W>) -> Result<Cli, clap::Error> {
    let words: Vec<OsString> = words.into_iter().map(Into::into).collect();
    Cli::try_parse_from(&words).map_err(|error| {
        let program = Cli::command();
        suggest::by_key(suggest::visible(error, &program), &program, &words)
    })
}

/// Runs the command line.
pub fn main(cli: &Cli, registry: &Registry) -> anyhow::Result<()> {
    match &cli.command {
        Command::Run(args) => run::run(args, registry),
        Command::View(args) => swerve_view::run(args, registry, &|config, scenario, outcome| {
            Ok(serde_json::to_string(&Summary::of(config, scenario, outcome, None))?)
        }),
        Command::Live(args) => swerve_live::run(args, registry),
        Command::Study(args) => swerve_study::run(args, registry),
        Command::Suite(args) => suite::run(args, registry),
        Command::Why(args) => swerve_why::run(args, registry),
        Command::Report(args) => report::run(args, registry),
        Command::Replay(args) => replay::run(args, registry),
        Command::Operators(args) => operators::run(args, registry),
        Command::Keys(args) => keys::run(args, registry),
        Command::Graph(args) => graph::run(args, registry),
        Command::Timing(args) => swerve_timing::run(args),
        Command::Plan(args) => plan::run(args, registry),
        Command::Check(args) => check::run(args, registry),
        Command::Calibrate(args) => calibrate::run(args, registry),
        Command::Dataset(args) => dataset::run(args, registry),
        Command::Eval(args) => evaluate::run(args, registry),
        Command::Map(args) => map::run(args, registry),
        Command::Track(args) => track::run(args),
        Command::Train(args) => train::run(args, registry),
        Command::Look(args) => look::run(args),
        Command::Doctor(args) => doctor::run(args),
        Command::New(args) => new::run(args, registry),
        Command::Scenarios(args) => scenarios::run(args),
        Command::Completions(args) => shell::completions(args, Cli::command()),
        Command::Man(args) => shell::man(args, Cli::command()),
        Command::Worker => process::run_worker(registry),
        Command::Transport => swerve_live::orphan::run_transport(registry),
    }
}
