//! `swerve live`: drives a vehicle over ROS 2 topics.
//!
//! | module | content |
//! |---|---|
//! | [`input`], [`intake`] | inputs of the graph; from live or recorded ROS messages to them |
//! | [`time`] | from a sensor's clock to run time |
//! | [`simulated`] | clock of a drive: the host's, or simulated time |
//! | [`vehicle`] | vehicle interfaces: reports and commands; one small trait for each |
//! | [`graph`] | the graph, with sources instead of the simulated world |
//! | [`wire`] | transport of messages: the bridge, or a substitute in tests |
//! | [`feed`] | thread from the wire to the graph; operates the switch by [`engage`] and [`placement`] |
//! | [`sink`] | thread from the gate to the wire; stops the car if the gate falls silent |
//! | [`orphan`] | stop of a vehicle whose controlling program has died |
//! | [`recorded`] | the same for a recorded drive, in virtual time |
//! | [`notices`] | notices of unusable topics, of monitors, and of a drive in which nothing detects road users |
//! | [`watch`], [`summary`] | status during the drive, and results at its end |
//!
//! ```text
//! wire --> feed (intake, engage) --> sources | engine | gate --> outlet --> sink (interface) --> wire
//! separate thread                            | this thread      (observer)  separate thread
//! ```
//!
//! The graph depends on no transport: a bridge feeds it through [`graph::Inputs`], a recorded drive through
//! [`intake::Arrived::record`] and [`swerve_flow::Graph::playback`].

mod drive;
pub mod engage;
pub mod feed;
pub mod graph;
pub mod input;
pub mod intake;
mod legacy;
pub mod notices;
pub mod orphan;
pub mod placement;
mod reason;
pub mod recorded;
pub mod ros2;
mod route;
mod shared;
pub mod simulated;
pub mod sink;
pub mod summary;
pub mod time;
pub mod vehicle;
pub mod watch;
pub mod wire;

#[cfg(test)]
mod tests;

use core::time::Duration;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};

use anyhow::Context as _;
use swerve_core::{Span, Time};
use swerve_drive::interrupt::on_interrupt;
use swerve_drive::left_out_of_logs;
use swerve_drive::page::COMMAND;
use swerve_drive::process::Processes;
use swerve_drive::trust::CodeArgs;
use swerve_drive::views::live_views;
use swerve_flow::{Graph, Observer, RunError, RunOptions, RunReport, run_paced, run_wall};
use swerve_foxglove::Foxglove;
use swerve_log::{Recorder, RunStart, TraceWriter};
use swerve_msg::GateOutput;
use swerve_report::files::RunFolder;
use swerve_report::output::quoted;
use swerve_report::progress::LiveLine;
use swerve_stack::Registry;
use swerve_stack::config::live::{EnableBy, LiveClock};
use swerve_stack::pipeline::Pipeline;
use swerve_text::parse_assignments;

use drive::located_by;
pub use drive::{Drive, Driven};
use engage::Engagement;
use feed::{ControlFlags, Feed, Goal, StatusSink};
use graph::LiveGraph;
use intake::Intake;
use notices::Notices;
pub use route::route_problems;
use shared::lock;
use simulated::{DriveClock, Simulated};
use sink::Sink;
use summary::Summary;
use watch::Outlet;
use wire::{BridgeWire, HostClock, Wire};

/// Options of `swerve live`.
#[derive(clap::Args, Debug)]
pub struct LiveArgs {
    /// Configuration file (TOML) with `[live]` and `[ros2]`, or a name such as autoware
    config: PathBuf,
    /// Stop the car and end after this many seconds; default: on Ctrl-C or at the goal
    #[arg(long)]
    seconds: Option<f64>,
    /// Output folder [default: a new one, out/CONFIG-1 and so on; out/CONFIG links to the newest]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the results of an earlier run in the folder of --out
    #[arg(long, requires = "out")]
    overwrite: bool,
    /// Source of the enabling request, instead of the configuration's live.enable
    #[arg(long)]
    enable: Option<EnableBy>,
    /// Set a configuration key, such as ego.speed_mps=5. A table, KEY={...}, changes the keys that it names
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    code: CodeArgs,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    /// Worker threads for heavy steps
    #[arg(long, default_value_t = 2, value_parser = swerve_drive::threads::parser())]
    threads: usize,
}

impl LiveArgs {
    /// Creates the options for a configuration with these keys set, and defaults otherwise.
    pub fn of(config: PathBuf, set: Vec<String>, code: CodeArgs) -> Self {
        let (seconds, out, enable) = (None, None, None);
        Self { config, code, seconds, out, overwrite: false, enable, set, json: false, threads: 2 }
    }

    /// Error for a file named by a key of the configuration.
    fn wrong_file(&self, key: &str, error: &anyhow::Error) -> anyhow::Error {
        let is_set = self.set.iter().any(|set| set.starts_with(key));
        route::wrong_file(&self.config, is_set, key, error)
    }

    /// Command line that repeats the drive.
    fn command_line(&self) -> String {
        let mut line = format!("swerve live {}", quoted(&self.config.display().to_string()));
        if let Some(seconds) = self.seconds {
            line += &format!(" --seconds {seconds}");
        }
        if let Some(enable) = self.enable.as_ref().and_then(clap::ValueEnum::to_possible_value) {
            line += &format!(" --enable {}", enable.get_name());
        }
        self.set.iter().for_each(|set| line += &format!(" --set {}", quoted(set)));
        line + self.code.words()
    }
}

/// Maximum time for the transport to end.
const BRIDGE_END: Duration = Duration::from_secs(3);

/// Options of a drive: duration, threads, progress reports.
pub struct DriveOptions<'a> {
    /// Instant at which the drive ends, if limited.
    pub until: Option<Time>,
    /// Worker threads.
    pub threads: usize,
    /// Receiver of progress reports.
    pub status_sink: Box<dyn StatusSink>,
    /// Flags that the threads of the drive use to signal each other.
    pub flags: &'a ControlFlags,
}

/// Log and trace of a drive while they are written.
struct DriveFiles {
    recorder: Recorder,
    trace: TraceWriter,
    /// Folder of the files.
    folder: RunFolder,
}

/// Complete files of a drive, still under temporary names.
struct Finished(RunFolder);

impl DriveFiles {
    /// Completes the files; data recorded before a failure stays readable.
    fn finish(self) -> anyhow::Result<Finished> {
        self.recorder.finish()?;
        self.trace.finish()?;
        Ok(Finished(self.folder))
    }
}

impl Finished {
    /// Renames the complete files to their final names; returns their folder.
    fn name_whole(self) -> anyhow::Result<RunFolder> {
        let Self(folder) = self;
        folder.name_whole()?;
        Ok(folder)
    }
}

/// Drives over a wire until the end and passes all events to `observers`. The car has been released on return.
pub fn drive(
    drive: &Drive,
    wire: &dyn Wire,
    options: DriveOptions<'_>,
    observers: &mut [&mut dyn Observer],
) -> anyhow::Result<Driven> {
    let mut graph = LiveGraph::build(&drive.config, &drive.scenario)?;
    let _processes = Processes::start_all(&drive.config, &mut graph.pipeline)?;
    // Each process needs a thread that waits for it, in addition to those requested.
    let options = DriveOptions { threads: options.threads + drive.config.process.len(), ..options };
    // Run time starts once everything is ready, for the engine as for messages.
    let clock = match drive.live.clock {
        LiveClock::Host => HostClock::start().into(),
        LiveClock::Topic => {
            let timeout = Span::from_secs(drive.live.clock_timeout_s);
            DriveClock::Simulated(Simulated::wait_for(wire, timeout, &options.flags.interrupted)?)
        }
    };
    drive_graph(drive, graph, wire, options, observers, clock)
}

/// As [`drive`](self::drive), with an existing graph.
fn drive_graph(
    drive: &Drive,
    LiveGraph { pipeline, inputs }: LiveGraph,
    wire: &dyn Wire,
    options: DriveOptions<'_>,
    observers: &mut [&mut dyn Observer],
    clock: DriveClock,
) -> anyhow::Result<Driven> {
    let Drive { config, live, mapping, scenario, .. } = drive;
    let DriveOptions { until, threads, status_sink, flags } = options;
    let sees = notices::sees(config, &pipeline);
    let Pipeline { graph, assembly, route, .. } = pipeline;
    let interface = || vehicle::interface(mapping.vehicle, config);
    let intake = Intake::new(mapping, interface(), config, clock.epoch_ns()).judged_by(&clock);
    let (orders, received) = mpsc::channel();
    let status = Arc::new(Mutex::new(watch::DriveStatus::default()));
    let stop_max = Span::from_secs(live.stop_timeout_s);
    let gate = assembly.publisher::<GateOutput>().and_then(|gate| assembly.operator(gate));
    let stop = gate.context("the pipeline has no safety gate")?.resolved.gate;
    let sink = Sink {
        wire,
        interface: interface(),
        car: intake.car(),
        clock: clock.clone(),
        epoch: intake.epoch(),
        stop,
        stop_max,
        has_mode_service: !live.control_mode_service.is_empty(),
        says_enable: live.enable == EnableBy::AtStart,
        gave_up: flags.gave_up.clone(),
    };
    let outlet = Outlet::new(orders.clone(), status.clone(), route.clone());
    *lock(&outlet.checks()) = notices::unchecked(config);
    let feed = Feed {
        wire,
        intake,
        inputs,
        located_by: located_by(config),
        clock: clock.clone(),
        engagement: Engagement::new(live.enable, Span::from_secs(live.enable_timeout_s)),
        status,
        orders: Some(orders),
        stop: graph.stop_handle(),
        until,
        goal: Goal { route, s_m: scenario.ego.end_m },
        stop_max,
        stop_params: stop,
        flags,
        status_sink,
        notices: Notices::new(config, mapping, sees, outlet.checks()),
    };
    let options = RunOptions::default().seed(config.seed).threads(threads);
    std::thread::scope(|scope| {
        let sinking = scope.spawn(move || {
            // The feed runs until then, because it monitors the standstill.
            let _done = Set(&flags.done);
            sink.run(&received)
        });
        let feeding = scope.spawn(move || feed.run());
        // Signals the end to the other threads in any case.
        let over = Set(&flags.run_over);
        let mut outlet = outlet;
        let report = {
            let mut all: Vec<&mut dyn Observer> = vec![&mut outlet];
            all.extend(observers.iter_mut().map(|o| &mut **o as &mut dyn Observer));
            run_by(&clock, graph, &options, all)
        };
        let figures = outlet.conclude();
        drop(over);
        let sink = sinking.join();
        let fed = feeding.join();
        let gone = |what: &str| anyhow::anyhow!("the thread that {what} panicked: this is a bug");
        Ok(Driven {
            report,
            feed: fed.map_err(|_| gone("feeds the graph"))?,
            sink: sink.map_err(|_| gone("talks to the vehicle"))?,
            figures,
        })
    })
}

/// Runs a graph, paced by a clock.
fn run_by(
    clock: &DriveClock,
    graph: Graph,
    options: &RunOptions,
    observers: Vec<&mut dyn Observer>,
) -> Result<RunReport, RunError> {
    match clock.simulated() {
        None => run_wall(graph, options, observers),
        Some(clock) => run_paced(graph, options, observers, clock.time()),
    }
}

/// Sets a flag when dropped, also during a panic.
struct Set<'a>(&'a AtomicBool);

impl Drop for Set<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Passive viewer of a drive while it runs.
pub trait Onlooker: Observer {
    /// Announces the drive and the command line that started it.
    ///
    /// # Errors
    /// If it cannot be shown; the drive does not start then.
    fn begin(&mut self, drive: &Drive, command: String) -> anyhow::Result<()>;
}

/// Runs `swerve live`.
///
/// # Errors
/// If the configuration is invalid, or the drive failed.
pub fn run(args: &LiveArgs, registry: &Registry) -> anyhow::Result<()> {
    run_before(args, registry, None)
}

/// As [`run`], with a viewer.
///
/// # Errors
/// As [`run`], or if the drive is recorded: it ends too quickly to be watched.
pub fn run_before(
    args: &LiveArgs,
    registry: &Registry,
    mut onlooker: Option<&mut dyn Onlooker>,
) -> anyhow::Result<()> {
    let mut sets = parse_assignments(&args.set)?;
    if let Some(enable) = args.enable {
        let word = match enable {
            EnableBy::Topic => "topic",
            EnableBy::AtStart => "at_start",
        };
        sets.push(("live.enable".into(), word.into()));
    }
    let mut drive = Drive::load(registry, &args.config, &sets)?;
    args.code.start(&mut drive.config)?;
    if let Some(seconds) = args.seconds {
        anyhow::ensure!(seconds > 0.0 && seconds < 1e6, "--seconds {seconds}: expected more than 0");
    }
    if let Some(why) = swerve_ros2::bridge::MISSING.filter(|_| drive.config.source.is_none()) {
        anyhow::bail!(why);
    }
    let name = args.config.file_stem().map_or_else(|| "live".into(), |s| s.to_string_lossy().into_owned());
    if let Some(onlooker) = &mut onlooker {
        let is_recorded = drive.config.source.is_some();
        anyhow::ensure!(
            !is_recorded,
            "source: a recorded drive is not shown live; `swerve view` shows its log"
        );
        onlooker.begin(&drive, args.command_line())?;
    }
    let folder = RunFolder::claim(args.out.as_deref(), &name, args.overwrite)?;
    let out = &folder.path;
    let (log_part, trace_part) = (out.join("log.partial.mcap"), out.join("trace.partial.json"));
    let mut start = run_start(&drive);
    start.extra.insert(COMMAND.into(), args.command_line());
    let mut recorder = Recorder::create(&log_part, &start)?;
    set_up(&mut recorder, &drive);
    let trace = TraceWriter::create(&trace_part, &["gate"])?;
    let mut files = DriveFiles { recorder, trace, folder };

    if let Some(source) = &drive.config.source {
        return recorded::run(args, &drive, source, files);
    }
    let flags = Arc::new(ControlFlags::default());
    let interrupted = flags.clone();
    // If a program has run in this process before, its handler exists and is kept.
    let _first = on_interrupt(move || interrupted.interrupted.store(true, Ordering::Relaxed));
    let wire = BridgeWire::start(&drive.config, &drive.mapping, &drive.live)?;
    let until = args.seconds.map(|seconds| Time::ZERO + Span::from_secs(seconds));
    let status_sink = Box::new(LiveLine::new(!args.json));
    let options = DriveOptions { until, threads: args.threads, status_sink, flags: &flags };
    let mut observers: Vec<&mut dyn Observer> = vec![&mut files.recorder, &mut files.trace];
    observers.extend(onlooker.map(|onlooker| onlooker as &mut dyn Observer));
    let driven = self::drive(&drive, &wire, options, &mut observers);
    let (topics, lost) = (wire.statistics(), wire.lost());
    wire.stop(BRIDGE_END);
    conclude(args, &drive, files, driven, &topics, lost)
}

/// Completes the files and reports the result.
fn conclude(
    args: &LiveArgs,
    drive: &Drive,
    files: DriveFiles,
    driven: anyhow::Result<Driven>,
    topics: &[swerve_ros2::bridge::TopicStatistics],
    transports_lost: u64,
) -> anyhow::Result<()> {
    let part = files.finish()?;
    let driven = driven?;
    let out = part.name_whole()?;
    let summary = Summary::new(drive, &driven, topics).with_lost(transports_lost);
    let json = serde_json::to_string_pretty(&summary)? + "\n";
    let place = out.conclude("report.html, log.mcap, trace.json", &json)?;
    drive.report(&out.path)?;
    swerve_report::output::print(&if args.json { json } else { summary.text() + &place })?;
    driven.report.context("the car was stopped by what talks to it, and the run ended")?;
    if let Some(failure) = driven.feed.clock_failure {
        anyhow::bail!("{failure}: the drive ended");
    }
    anyhow::ensure!(
        driven.feed.was_ready || args.seconds.is_none(),
        "not all topics that are needed were there: {}",
        summary.missing()
    );
    Ok(())
}

/// Configures a recorder for the log of a drive.
fn set_up(recorder: &mut Recorder, drive: &Drive) {
    let Drive { config, scenario, .. } = drive;
    if let Some(images) = left_out_of_logs(config.log.images) {
        recorder.leave_out(images);
    }
    if config.log.foxglove {
        let own = Foxglove::new(live_views(config, scenario));
        recorder.show(Box::new(config.registry.with_views_of(own)));
    }
}

/// Head of the log: everything needed to recompute it without the files.
fn run_start(drive: &Drive) -> RunStart {
    swerve_drive::run_start(&drive.config, &drive.scenario, &drive.route)
}
