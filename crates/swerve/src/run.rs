//! `swerve run`: a scenario driven by a pipeline, measured, recorded, drawn.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, anyhow};
use swerve_core::Digest;
use swerve_eval::{Metrics, Verdict};
use swerve_flow::{
    EndReason, Event, Observer, RunOptions, RunReport, RuntimeModel, StopHandle, run_virtual, run_wall,
};
use swerve_foxglove::Foxglove;
use swerve_log::{LeavesOut, Log, Recorder, RunStart, TraceWriter};
use swerve_msg::truth::PointInstances;
use swerve_msg::{EgoState, Image, PointCloud};
use swerve_scenario::{Expectation, Metric, Scenario};
use swerve_stack::{Registry, Rendered};
use swerve_text::{Document, Problem, nearest, parse_assignment};

use crate::config::clock::Clock;
use crate::config::{Config, Images};
use crate::files::write_whole;
use crate::frames::Frames;
use crate::measured::{Measured, outline};
use crate::pipeline::Pipeline;
use crate::process::Processes;
use crate::program::Program;
use crate::progress::Progress;
use crate::realtime::Realtime;
use crate::recording::Recording;
use crate::ros2::Ros2Car;
use crate::rungs::Rungs;
use crate::shipped::Kind;
use crate::story::{Story, draw};
pub use crate::summary::Summary;
use crate::views::views_of;

/// What is driven, by what.
#[derive(clap::Args, Clone, Debug)]
pub struct RunInput {
    /// Scenario file (TOML), or the name of one that is in the program: `swerve scenarios`
    pub scenario: PathBuf,
    /// Configuration file (TOML), or a name such as best; every key that it leaves out has a default
    #[arg(short, long)]
    pub config: Option<PathBuf>,
    /// Set a configuration key, such as planning.planner=rrt_star
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Seed of everything random
    #[arg(long, value_parser = clap::value_parser!(i64).range(0..))]
    pub seed: Option<i64>,
}

/// `swerve run`.
#[derive(clap::Args, Debug)]
pub struct RunArgs {
    #[command(flatten)]
    input: RunInput,
    /// Output folder [default: out/ and the scenario's name]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    /// Worker threads for heavy steps; the result does not depend on them
    #[arg(long, default_value_t = 1, value_parser = crate::threads::parser())]
    threads: usize,
    /// Write a picture of the drive every 50 ms into this folder
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Take run times from an earlier log instead of the configuration
    #[arg(long, value_name = "LOG")]
    runtimes: Option<PathBuf>,
    /// What moves the run, in place of the configuration's clock.source
    #[arg(long)]
    clock: Option<Clock>,
    /// Against the real clock, with the car on ROS 2's topics as [ros2] names them: to be shown, or to be driven
    #[arg(long, value_name = "ROLE", num_args = 0..=1, require_equals = true, default_missing_value = "show")]
    ros2: Option<Ros2Role>,
}

/// What the car is to others on ROS 2's topics.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
enum Ros2Role {
    /// Our own stack drives, others watch
    Show,
    /// Another stack drives, through the safety gate
    Drive,
}

/// What a run came to.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its measures.
    pub metrics: Metrics,
    /// One number that two equal runs share.
    pub digest: Digest,
    /// Smallest distance of the ego's outline to the edge of the drivable ground, m; negative outside.
    pub road_margin_m: f64,
    /// What the engine counted.
    pub report: RunReport,
    /// What computed the images, if there were any.
    pub rendered: Option<Rendered>,
    /// What deadlines made of it.
    pub rungs: Rungs,
}

/// Several problems as one error.
pub fn problems_error<P: ToString>(problems: &[P]) -> anyhow::Error {
    let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
    anyhow!(lines.join("\n"))
}

/// Reads a scenario, from a file or by its name; all its problems in one error.
pub fn read_scenario(path: &Path) -> anyhow::Result<Scenario> {
    let (file, text) = (path.display().to_string(), Kind::Scenario.text(path)?);
    let scenario = Scenario::parse(&file, &text).map_err(|problems| problems_error(&problems))?;
    let names: Vec<String> = Config::pipeline_names().collect();
    let known = |name: &&String| names.contains(name);
    let unknown: Vec<&String> =
        scenario.expect.iter().filter_map(|e| e.pipeline.as_ref()).filter(|name| !known(name)).collect();
    if unknown.is_empty() {
        return Ok(scenario);
    }
    let document = Document::parse(&file, &text)?;
    let problem = |name: &&String| {
        let near = nearest(name, names.iter().map(String::as_str));
        let hint = near.map_or_else(|| names.join(", "), |near| format!("did you mean `{near}`?"));
        document.problem(&format!("expect.pipeline.{name}"), format!("unknown pipeline `{name}` ({hint})"))
    };
    Err(problems_error(&unknown.iter().map(problem).collect::<Vec<_>>()))
}

/// Reads and checks what a command line names.
pub fn load(registry: &Registry, input: &RunInput) -> anyhow::Result<(Config, Scenario)> {
    let sets: Result<Vec<_>, Problem> = input.set.iter().map(|s| parse_assignment(s)).collect();
    let mut sets = sets?;
    if let Some(seed) = input.seed {
        sets.push(("seed".into(), toml::Value::Integer(seed)));
    }
    let config = Kind::Config
        .config(registry, input.config.as_deref(), &sets)
        .map_err(|problems| problems_error(&problems))?;
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

/// Shows how far simulated time has come.
struct Shown {
    progress: Progress,
}

impl Observer for Shown {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(publication) = event
            && publication.payload.is_some_and(|payload| payload.as_any().is::<EgoState>())
        {
            self.progress.simulated_to(publication.visible_at.as_secs());
        }
    }
}

/// Runs `swerve run`.
pub fn run(args: &RunArgs, registry: &Registry) -> anyhow::Result<()> {
    let mut input = args.input.clone();
    anyhow::ensure!(
        args.ros2.is_none() || args.clock != Some(Clock::Virtual),
        "--ros2 and --clock virtual: who reads a topic lives by the real clock"
    );
    let clock = if args.ros2.is_some() { Some(Clock::Wall) } else { args.clock };
    input.set.extend(clock.map(|clock| format!("clock.source={}", clock.name())));
    if args.ros2 == Some(Ros2Role::Drive) {
        input.set.extend(["gate.enabled=true".into(), "ego.driver=ros2".into()]);
    }
    let (config, scenario) = load(registry, &input)?;
    let mut pipeline = Pipeline::build(&config, &scenario)?;
    // The log is read before any file is made: it may be the one of this very folder.
    if let Some(log) = &args.runtimes {
        record_run_times(&mut pipeline, &Log::read(log)?);
    }
    let out = args.out.clone().unwrap_or_else(|| Path::new("out").join(stem(&args.input.scenario)));
    std::fs::create_dir_all(&out).with_context(|| format!("making {}", out.display()))?;
    let mut shown = Shown { progress: Progress::simulated(scenario.end.timeout_s) };
    // Under names of their own until they are whole: a run that is cut off leaves an earlier one's results alone.
    let (log_part, trace_part) = (out.join("log.partial.mcap"), out.join("trace.partial.json"));
    let mut realtime = Realtime::begin(&config.clock);
    let mut recorder = Recorder::create(&log_part, &run_start(&config, &args.input.scenario)?)?;
    set_up(&mut recorder, &config, &pipeline);
    let mut recording = Recording::new(recorder, pipeline.clock, pipeline.graph.stop_handle());
    let mut trace = TraceWriter::create(&trace_part, &["controller"])?;
    let mut story = story(&config, &scenario, &pipeline);
    let mut frames = frames(args, &config, &pipeline)?;
    let mut observers: Vec<&mut dyn Observer> = vec![&mut shown, &mut recording, &mut trace, &mut story];
    observers.extend(realtime.as_mut().map(|realtime| realtime as &mut dyn Observer));
    observers.extend(frames.as_mut().map(|frames| frames as &mut dyn Observer));
    let on_ros2 = args.ros2.is_some() || config.is_driven_over_ros2();
    let mut car = on_ros2.then(|| Ros2Car::start(&config, &mut pipeline)).transpose()?;
    observers.extend(car.as_mut().map(Ros2Car::observer));
    let processes = start_processes(&config, &args.input.scenario, &mut pipeline)?;
    stop_on_interrupt(pipeline.graph.stop_handle());
    let threads = threads(args.threads, &config);
    let driven = drive_pipeline(pipeline, config.seed, threads, &mut observers);
    let traffic = processes.as_ref().map(Processes::traffic);
    drop(processes);
    let ros2 = car.map(Ros2Car::finish);
    shown.progress.finish();
    let ends = Ends { clock: config.clock.source, out: &out };
    let realtime = realtime.map(|realtime| realtime.obtained());
    // What was recorded until a failure is kept, readable.
    let recorded = recording.finish().and(trace.finish()).map_err(anyhow::Error::from);
    let driven = driven.with_context(|| format!("what was recorded until then is in {}", log_part.display()));
    let outcome = ends.in_order(driven, &recorded, &log_part)?;
    if recorded.is_ok() {
        for (part, whole) in [(log_part, "log.mcap"), (trace_part, "trace.json")] {
            std::fs::rename(part, out.join(whole)).with_context(|| format!("writing {whole}"))?;
        }
    }
    let mut summary = Summary::of(&config, &scenario, &outcome);
    (summary.traffic, summary.ros2, summary.realtime) = (traffic, ros2, realtime);
    story.conclude(&outcome.metrics);
    let drawn = frames.as_mut().map_or(Ok(0), Frames::finish);
    let left = ends.leave(&summary, &story).and(drawn.map(drop));
    let json = serde_json::to_string_pretty(&summary)? + "\n";
    crate::output::print(&if args.json { json } else { summary.text(&out) })?;
    // The drive itself is over and told by now.
    recorded.and(left)
}

/// The end of a run.
struct Ends<'a> {
    clock: Clock,
    out: &'a Path,
}

impl Ends<'_> {
    /// What a run came to, if there is something to sum up: in virtual time one that was cut off has no result.
    fn in_order(
        &self,
        driven: anyhow::Result<Outcome>,
        recorded: &anyhow::Result<()>,
        log: &Path,
    ) -> anyhow::Result<Outcome> {
        let outcome = driven?;
        if self.clock == Clock::Wall {
            return Ok(outcome);
        }
        if let Err(error) = recorded {
            anyhow::bail!("{error:#}");
        }
        if outcome.report.end == EndReason::Interrupted {
            let at = outcome.report.at.as_secs();
            anyhow::bail!("interrupted at {at:.2} s; what was recorded until then is in {}", log.display());
        }
        Ok(outcome)
    }

    /// Writes what is left of a run beside its log.
    fn leave(&self, summary: &Summary, story: &Story) -> anyhow::Result<()> {
        write_whole(&self.out.join("story.svg"), draw(story).as_bytes())?;
        let json = serde_json::to_string_pretty(summary)? + "\n";
        write_whole(&self.out.join("metrics.json"), json.as_bytes())
    }
}

/// Starts the processes of the configuration, if it has any.
fn start_processes(
    config: &Config,
    scenario: &Path,
    pipeline: &mut Pipeline,
) -> anyhow::Result<Option<Processes>> {
    if config.process.is_empty() {
        return Ok(None);
    }
    let text = Kind::Scenario.text(scenario)?;
    Ok(Some(Processes::start(&Program::this()?, config, &text, pipeline)?))
}

/// Against the real clock each process needs a thread that waits for it, beside those that were asked for.
fn threads(asked: usize, config: &Config) -> usize {
    match config.clock.source {
        Clock::Virtual => asked,
        Clock::Wall => asked + config.process.len(),
    }
}

/// Ends a run in good order when it is interrupted.
fn stop_on_interrupt(stop: StopHandle) {
    // There is a handler already where a program has run before in this process: that one stays.
    let _first = ctrlc::set_handler(move || stop.stop());
}

/// Gives every operator the run times that it had in an earlier run.
pub fn record_run_times(pipeline: &mut Pipeline, log: &Log) {
    for (operator, times) in log.run_times() {
        if let Ok(node) = pipeline.graph.operator(&operator) {
            let times = Arc::new(times.into_iter().collect());
            let _configured = node.runtime(RuntimeModel::Recorded(times));
        }
    }
}

/// The pictures of the run, if they are asked for.
fn frames(args: &RunArgs, config: &Config, pipeline: &Pipeline) -> anyhow::Result<Option<Frames>> {
    let Some(folder) = &args.frames else { return Ok(None) };
    let title = title(config, &pipeline.scenario);
    Ok(Some(Frames::create(folder, title, &pipeline.scenario, config)?))
}

/// What a picture is headed with.
fn title(config: &Config, scenario: &Scenario) -> String {
    format!(
        "{}: {} at {:.0} m/s, seed {}",
        scenario.name.replace('_', " "),
        config.pipeline_name(),
        config.ego.speed_mps.unwrap_or(scenario.ego.target_speed_mps),
        config.seed
    )
}

/// The picture of the run, to be filled in while it drives.
pub fn story(config: &Config, scenario: &Scenario, pipeline: &Pipeline) -> Story {
    let lane_width_m = Some(scenario.road.lane_width_m);
    Story::new(
        title(config, scenario),
        pipeline.route.clone(),
        lane_width_m,
        outline(&pipeline.vehicle.shape),
    )
}

/// The payloads of which a log holds the digest alone.
pub fn left_out_of_logs(images: Images) -> Option<LeavesOut> {
    match images {
        Images::None | Images::Jpeg => Some(|payload| {
            payload.is::<Image>() || payload.is::<PointCloud>() || payload.is::<PointInstances>()
        }),
        Images::Lossless => None,
    }
}

/// Has a log hold of a run what its configuration says.
pub fn set_up(recorder: &mut Recorder, config: &Config, pipeline: &Pipeline) {
    if let Some(images) = left_out_of_logs(config.log.images) {
        recorder.leave_out(images);
    }
    if config.log.foxglove {
        let own = Foxglove::new(views_of(config, pipeline));
        recorder.show(Box::new(config.registry.with_views_of(own)));
    }
}

/// The head of a log: all that it takes to run again without the files.
pub fn run_start(config: &Config, scenario: &Path) -> anyhow::Result<RunStart> {
    let text = Kind::Scenario.text(scenario)?.into_owned();
    Ok(RunStart {
        version: env!("CARGO_PKG_VERSION").into(),
        seed: config.seed,
        config: config.to_text(),
        extra: [("scenario".to_owned(), text), ("scenario_file".to_owned(), scenario.display().to_string())]
            .into(),
    })
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "run".into(), |s| s.to_string_lossy().into_owned())
}

impl Outcome {
    /// In what way the run differs from what is expected.
    pub fn broken(&self, expected: &Expectation) -> Vec<String> {
        if self.metrics.verdict == Verdict::Unfinished {
            return vec!["the run was ended before the scenario was".into()];
        }
        expected.broken_by(self.metrics.verdict, |metric| self.figure(metric))
    }

    /// A figure that a scenario can put bounds on.
    fn figure(&self, metric: Metric) -> Option<f64> {
        let metrics = &self.metrics;
        match metric {
            Metric::MinDistanceM => metrics.min_distance_m,
            Metric::ImpactSpeedMps => Some(metrics.impact_speed_mps),
            Metric::ClosingSpeedMps => Some(metrics.impact.map_or(0.0, |i| i.closing_speed_mps)),
            Metric::EndSpeedMps => Some(metrics.drive.speed_end_mps),
            Metric::DurationS => Some(metrics.drive.duration_s),
            Metric::LateralAccelMaxMps2 => Some(metrics.drive.lateral_accel_max_mps2),
            Metric::LateralJerkMaxMps3 => metrics.lateral_jerk.raw_max_mps3,
            Metric::RoadMarginM => Some(self.road_margin_m),
        }
    }
}
