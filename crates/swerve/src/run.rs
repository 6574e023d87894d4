//! `swerve run`: simulates, measures, records and draws a scenario.

use std::path::{Path, PathBuf};

use swerve_drive::commonroad::{SolutionArgs, Solving};
use swerve_drive::frames::{Frames, Sinks};
use swerve_drive::graph::note_redirected;
use swerve_drive::interrupt::stop_on_interrupt;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::page::{COMMAND, RunReport, command_line};
use swerve_drive::pictures::PictureArgs;
use swerve_drive::process::{Processes, threads};
use swerve_drive::realtime::Realtime;
use swerve_drive::{
    Outcome, Recording, RunInput, conclude, drive_recorded, load, note_idle, operators_with_runtime,
    record_run_times, run_start, set_up, story, title, trust,
};
use swerve_flow::{EndReason, Observer};
use swerve_live::ros2::Ros2Car;
use swerve_log::{Log, Recorder, TraceWriter};
use swerve_msg::{Command, MotionCommand};
use swerve_report::files::RunFolder;
use swerve_report::output::print;
use swerve_report::progress::Progress;
use swerve_report::story::{Story, draw};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::clock::Clock;
use swerve_stack::pipeline::Pipeline;
use swerve_why::of_run;

use crate::summary::Summary;

/// `swerve run`.
#[derive(clap::Args, Debug)]
pub(crate) struct RunArgs {
    #[command(flatten)]
    pictures: PictureArgs,
    #[command(flatten)]
    input: RunInput,
    /// Output folder [default: a new one, out/SCENARIO-1 and so on; out/SCENARIO links to the newest]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the contents of the folder of --out, and the file of --video
    #[arg(long)]
    overwrite: bool,
    /// Exit with an error unless the result is as the scenario expects
    #[arg(long)]
    strict: bool,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    /// Number of threads; the result does not depend on it [default: one per processor]
    #[arg(long, value_parser = swerve_drive::threads::parser())]
    threads: Option<usize>,
    /// Write a picture every 50 ms of the run into this folder, replacing those of an earlier run
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Encode these pictures as a video with ffmpeg
    #[arg(long, value_name = "FILE")]
    video: Option<PathBuf>,
    /// Take run times from an earlier log instead of the configuration; --set operator.NAME.runtime takes precedence
    #[arg(long, value_name = "LOG")]
    runtimes: Option<PathBuf>,
    #[command(flatten)]
    solution: SolutionArgs,
    /// Clock that advances the run, in place of the configuration's clock.source
    #[arg(long)]
    clock: Option<Clock>,
    /// Under wall clock, publish the car on the ROS 2 topics of [ros2], and let this or another stack drive it
    #[arg(long, value_name = "ROLE", num_args = 0..=1, require_equals = true, default_missing_value = "show")]
    ros2: Option<Ros2Role>,
}

/// Role of the simulated car on ROS 2.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
enum Ros2Role {
    /// This stack drives; ROS 2 nodes only observe
    Show,
    /// Another stack drives, through the safety gate
    Drive,
}

/// Runs `swerve run`.
pub(crate) fn run(args: &RunArgs, registry: &Registry) -> anyhow::Result<()> {
    let mut input = args.input.clone();
    anyhow::ensure!(
        args.ros2.is_none() || args.clock != Some(Clock::Virtual),
        "--ros2 and --clock virtual: ROS 2 topics need the real clock"
    );
    let clock = if args.ros2.is_some() { Some(Clock::Wall) } else { args.clock };
    input.set.extend(clock.map(|clock| format!("clock.source={}", clock.name())));
    if args.ros2 == Some(Ros2Role::Drive) {
        input.set.extend(["gate.enabled=true".into(), "ego.driver=ros2".into()]);
    }
    let (config, scenario) = load(registry, &input)?;
    let on_ros2 = args.ros2.is_some() || config.is_driven_over_ros2();
    ensure_built_in(on_ros2, &config)?;
    trust::start(&config)?;
    let mut pipeline = Pipeline::build(&config, &scenario)?;
    note_redirected(&config, &pipeline.assembly);
    note_idle(&config, &args.input);
    // The log is read before any file is created: it may be in the output folder itself.
    if let Some(log) = &args.runtimes {
        let set = operators_with_runtime(&input.set)?;
        record_run_times(&mut pipeline, &Log::read(log)?, |name| !set.contains(name));
    }
    // Before the run's folder is created: a missing ffmpeg leaves no folder.
    let mut frames = frames(args, &config, &pipeline)?;
    let mut solving = Solving::of(&args.solution, &args.input.scenario, &pipeline)?;
    let folder = RunFolder::claim(args.out.as_deref(), &stem(&args.input.scenario), args.overwrite)?;
    let out = &folder.path;
    let mut progress = Progress::simulated(scenario.end.timeout_s);
    // Partial names until the files are complete: an interrupted run leaves earlier results unchanged.
    let (log_part, trace_part) = (out.join("log.partial.mcap"), out.join("trace.partial.json"));
    let mut realtime = Realtime::begin(&config.clock);
    let mut start = run_start(&config, &scenario, &args.input.scenario);
    let command = command_line(&input, args.runtimes.as_deref());
    start.extra.insert(COMMAND.into(), command.clone());
    let mut recorder = Recorder::create(&log_part, &start)?;
    set_up(&mut recorder, &config, &pipeline);
    let mut recording = Recording::new(recorder, pipeline.clock, pipeline.graph.stop_handle());
    let mut trace = TraceWriter::create(&trace_part, &acting(&pipeline))?;
    let mut story = story(&config, &scenario, &pipeline);
    let mut report = RunReport::new(&config, &pipeline, command);
    let mut pictured: Vec<&mut dyn Observer> = vec![&mut story, &mut report];
    pictured.extend(solving.as_mut().map(|solving| solving as &mut dyn Observer));
    pictured.extend(frames.as_mut().map(|frames| frames as &mut dyn Observer));
    let mut observers: Vec<&mut dyn Observer> = vec![&mut progress, &mut recording, &mut trace];
    observers.extend(realtime.as_mut().map(|realtime| realtime as &mut dyn Observer));
    let mut car = on_ros2.then(|| Ros2Car::start(&config, &mut pipeline)).transpose()?;
    observers.extend(car.as_mut().map(Ros2Car::observer));
    let processes = Processes::start_all(&config, &mut pipeline)?;
    stop_on_interrupt(pipeline.graph.stop_handle());
    let threads = threads(args.threads.unwrap_or_else(swerve_drive::threads::cores), &config);
    let driven = drive_recorded(pipeline, config.seed, threads, (&mut observers, &mut pictured));
    let traffic = processes.as_ref().map(Processes::traffic);
    drop(processes);
    let ros2 = car.map(Ros2Car::finish);
    progress.finish();
    let ends = Ends { clock: config.clock.source, folder: &folder, pictures: args.pictures };
    let realtime = realtime.map(|realtime| realtime.obtained());
    // A partial recording is kept, readable, after a failure.
    let recorded = recording.finish();
    let metrics = driven.as_ref().ok().filter(|_| recorded.is_ok()).map(|outcome| &outcome.metrics);
    let why = metrics.and_then(|metrics| of_run(&log_part, registry, metrics));
    why.iter().for_each(|why| {
        let of = why.actor.as_deref().unwrap_or("the car");
        trace.mark_chain(why.steps.iter().map(|s| (s.at_s, s.what.name())), of);
    });
    let recorded = recorded.and(trace.finish()).map_err(anyhow::Error::from);
    let outcome = ends.in_order(driven, &recorded, &log_part)?;
    if recorded.is_ok() {
        folder.name_whole()?;
    }
    conclude(&mut story, &scenario, &outcome.metrics, why.as_ref());
    let mut summary = Summary::of(&config, &scenario, &outcome, why);
    (summary.traffic, summary.ros2, summary.realtime) = (traffic, ros2, realtime);
    let drawn = frames.as_mut().map_or(Ok(0), Frames::finish);
    let json = serde_json::to_string_pretty(&summary)? + "\n";
    let written = report.write(out, &outcome.digest.to_string(), &json);
    let left = written.and_then(|()| ends.leave(&json, &story));
    let place = left.as_deref().unwrap_or_default();
    let solved = solving.map_or_else(|| Ok(String::new()), |solving| solving.write())?;
    print(&if args.json { json } else { summary.text() + &solved + place })?;
    // The run is complete and reported at this point.
    recorded.and(left.map(drop)).and(drawn.map(drop))?;
    anyhow::ensure!(!args.strict || summary.is_as_expected(), "not as the scenario expects (--strict)");
    Ok(())
}

/// Ends with an error if the program was built without a part that the run needs.
fn ensure_built_in(on_ros2: bool, config: &Setup) -> anyhow::Result<()> {
    let needed = [(on_ros2, swerve_ros2::bridge::MISSING), (!config.process.is_empty(), swerve_ipc::MISSING)];
    let missing = needed.into_iter().find_map(|(is_needed, missing)| missing.filter(|_| is_needed));
    missing.map_or(Ok(()), |why| Err(anyhow::anyhow!(why)))
}

/// State needed to conclude a run.
struct Ends<'a> {
    clock: Clock,
    folder: &'a RunFolder,
    pictures: PictureArgs,
}

impl Ends<'_> {
    /// Summary of a run, if there is one: an interrupted run in virtual time has no result.
    fn in_order(
        &self,
        driven: anyhow::Result<Outcome>,
        recorded: &anyhow::Result<()>,
        log: &Path,
    ) -> anyhow::Result<Outcome> {
        let partial = format!("what was recorded until then is in {}", log.display());
        let outcome = driven.map_err(|error| anyhow::anyhow!("{error:#}\n{partial}"))?;
        if self.clock == Clock::Wall {
            return Ok(outcome);
        }
        if let Err(error) = recorded {
            anyhow::bail!("{error:#}");
        }
        if outcome.report.end == EndReason::Interrupted {
            let at = outcome.report.at.as_secs();
            anyhow::bail!("interrupted at {at:.2} s; {partial}");
        }
        Ok(outcome)
    }

    /// Writes the remaining files of a run beside its log; returns a line that names the folder.
    fn leave(&self, json: &str, story: &Story) -> anyhow::Result<String> {
        let drawn = self.pictures.write_in(&self.folder.path, "story", &draw(story))?;
        self.folder.conclude(&format!("report.html, {drawn}, log.mcap, trace.json"), json)
    }
}

/// The operator that commands the car: flow arrows from a sensor's frame end there.
fn acting(pipeline: &Pipeline) -> Vec<&str> {
    let assembly = &pipeline.assembly;
    assembly.publisher::<MotionCommand>().or(assembly.publisher::<Command>()).into_iter().collect()
}

/// Frame writer, if pictures or a video are requested.
fn frames(args: &RunArgs, config: &Setup, pipeline: &Pipeline) -> anyhow::Result<Option<Frames>> {
    let to = Sinks { folder: args.frames.as_deref(), video: args.video.as_deref() };
    if to.is_none() {
        return Ok(None);
    }
    OverwriteArgs { overwrite: args.overwrite }.check(args.video.as_deref())?;
    Frames::create(to, title(config, &pipeline.scenario), &pipeline.scenario, config).map(Some)
}

pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "run".into(), |s| s.to_string_lossy().into_owned())
}
