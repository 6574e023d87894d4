//! The command line.

use std::ffi::OsString;

use clap::{CommandFactory as _, Parser, Subcommand};
use swerve_drive::{graph, process, scenarios, why};
use swerve_stack::Registry;
use swerve_study::{calibrate, dataset, evaluate, map, report, suite, track, train};

use swerve_reference::{keys, operators};

use crate::{Summary, check, doctor, look, new, plan, replay, run, shell};

/// Drives a whole autonomous-driving stack in a simulated world in which every component's run time counts.
#[derive(Parser, Debug)]
#[command(name = "swerve", version, about, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Drive a scenario: verdict, metrics, pictures, log
    Run(run::RunArgs),
    /// Drive a scenario before one's eyes: the report's player in a browser, live; or look at a log in it
    View(swerve_view::ViewArgs),
    /// Drive a vehicle over ROS 2's topics
    Live(swerve_live::LiveArgs),
    /// Vary a run along axes over configuration keys and seeds
    Study(swerve_study::StudyArgs),
    /// Drive scenarios with several seeds each: how many drives are as they expect
    Suite(suite::SuiteArgs),
    /// Say why a logged drive ended so: from the instant an actor was first visible to the car's answer
    Why(why::WhyArgs),
    /// Make the page of a run or a study from its folder, or of two beside each other
    Report(report::ReportArgs),
    /// Compute a log's streams again and compare, or compute what other settings would have given
    Replay(replay::ReplayArgs),
    /// List the kinds of operators that a configuration can name, or show one of them
    Operators(operators::OperatorsArgs),
    /// List the keys of a configuration: type, default, unit, range, values, what for
    Keys(keys::KeysArgs),
    /// Print the dataflow of a configuration
    Graph(graph::GraphArgs),
    /// Run a pipeline of black boxes: response times, drops, misses, utilisation
    Timing(swerve_timing::TimingArgs),
    /// Solve the planning problems of a file with a planner
    Plan(plan::PlanArgs),
    /// Check scenario, configuration, study and timing files without running them
    Check(check::CheckArgs),
    /// Measure what the planners cost on this host, or fit an emulated detector, and freeze that in a configuration
    Calibrate(calibrate::CalibrateArgs),
    /// Make labelled images and point clouds of scenarios in the formats of KITTI and COCO
    Dataset(dataset::DatasetArgs),
    /// Measure what a detector or a tracker reports against the truth
    Eval(evaluate::EvalArgs),
    /// Make a map of what stands along a road, and find a lidar by it
    Map(map::MapArgs),
    /// Make tracks of a file of detections
    Track(track::TrackArgs),
    /// Learn what perception is shipped with from simulated drives
    Train(train::TrainArgs),
    /// Find objects in images: boxes, as a table, JSON or pictures
    Look(look::LookArgs),
    /// Show what this machine has: graphics adapters, shared memory, and what will be used
    Doctor(doctor::DoctorArgs),
    /// Make a folder to begin in: a scenario, a configuration, an operator of one's own, and what is what
    New(new::NewArgs),
    /// List the scenarios of a folder, and those that are in the program
    Scenarios(scenarios::ScenariosArgs),
    /// Print what makes a shell complete commands and options
    Completions(shell::CompletionsArgs),
    /// Write manual pages
    Man(shell::ManArgs),
    /// Take steps for a run in another process, which starts this one
    #[command(hide = true)]
    Worker,
    /// Speak DDS for a run in another process, which starts this one
    #[command(hide = true)]
    Transport,
}

/// Reads a command line, the program's name first; the error is what the terminal would show.
pub fn parse<W: Into<OsString> + Clone>(words: impl IntoIterator<Item = W>) -> Result<Cli, clap::Error> {
    Cli::try_parse_from(words).map_err(|error| swerve_drive::suggest::visible(error, &Cli::command()))
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
        Command::Why(args) => why::run(args, registry),
        Command::Report(args) => report::run(args, registry),
        Command::Replay(args) => replay::run(args, registry),
        Command::Operators(args) => operators::run(args, registry),
        Command::Keys(args) => keys::run(args, registry),
        Command::Graph(args) => graph::run(args, registry),
        Command::Timing(args) => swerve_timing::run(args),
        Command::Plan(args) => plan::run(args),
        Command::Check(args) => check::run(args, registry),
        Command::Calibrate(args) => calibrate::run(args, registry),
        Command::Dataset(args) => dataset::run(args, registry),
        Command::Eval(args) => evaluate::run(args),
        Command::Map(args) => map::run(args, registry),
        Command::Track(args) => track::run(args),
        Command::Train(args) => train::run(args, registry),
        Command::Look(args) => look::run(args),
        Command::Doctor(args) => doctor::run(args),
        Command::New(args) => new::run(args),
        Command::Scenarios(args) => scenarios::run(args),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
        Command::Worker => process::run_worker(registry),
        Command::Transport => swerve_live::wire::run_transport(registry),
    }
}
