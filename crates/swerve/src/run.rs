//! `swerve run`: a scenario driven by a pipeline, measured, recorded, drawn.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use swerve_core::{Digest, Span};
use swerve_eval::{Evaluation, GateMetrics, Metrics, Outline, Verdict};
use swerve_flow::{
    EndReason, Event, Observer, RunOptions, RunReport, RuntimeModel, StopHandle, TickReport, run_virtual,
    run_wall,
};
use swerve_foxglove::Foxglove;
use swerve_ipc::Traffic;
use swerve_log::{LeavesOut, Log, Recorder, RunStart, TraceWriter};
use swerve_msg::truth::{PointInstances, WorldState};
use swerve_msg::{GateMode, GateOutput, Image, Imu, ObstacleList, Plan, PointCloud, Refusals, Route};
use swerve_scenario::{Expectation, Metric, Scenario};
use swerve_stack::{Registry, Rendered};
use swerve_text::{Document, Problem, nearest, parse_assignment};
use swerve_vehicle::Shape;

use crate::config::clock::Clock;
use crate::config::{Config, Images};
use crate::files::write_whole;
use crate::frames::Frames;
use crate::output::align;
use crate::pipeline::Pipeline;
use crate::process::Processes;
use crate::program::Program;
use crate::progress::Progress;
use crate::realtime::{Obtained, Realtime};
use crate::recording::Recording;
use crate::ros2::{Ros2Car, Ros2Report};
use crate::rungs::{Budgets, RungCount, Rungs};
use crate::shipped::Kind;
use crate::story::{Story, draw};
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
    let document = Document::parse(&file, text.into_owned())?;
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
    let mut measured = Measured::of(&pipeline)?;
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

/// Feeds the evaluation with what the engine tells.
struct Measured {
    evaluation: Evaluation,
    operators: Vec<String>,
    /// What reaches the vehicle is then what the gate lets through.
    has_gate: bool,
    route: Route,
    shape: Shape,
    road_margin_m: f64,
    rungs: Rungs,
}

fn outline(shape: &Shape) -> Outline {
    Outline { length_m: shape.length_m, width_m: shape.width_m, center_ahead_m: shape.center_ahead_m() }
}

impl Measured {
    fn of(pipeline: &Pipeline) -> anyhow::Result<Self> {
        let shape = pipeline.vehicle.shape;
        let ego = outline(&shape);
        let operators: Vec<String> =
            pipeline.graph.describe()?.operators.iter().map(|o| o.name.to_string()).collect();
        let dead_time = Span::from_secs(pipeline.vehicle.dead_time_s);
        let params = swerve_eval::Params { ego, dead_time, operators: operators.clone() };
        Ok(Self {
            evaluation: Evaluation::new(params),
            has_gate: operators.iter().any(|operator| operator == "gate"),
            operators,
            route: pipeline.route.clone(),
            shape,
            road_margin_m: f64::INFINITY,
            rungs: Rungs::default(),
        })
    }

    fn operator(&self, name: &str) -> Option<usize> {
        self.operators.iter().position(|o| o == name)
    }
}

impl Observer for Measured {
    fn event(&mut self, event: &Event<'_>) {
        self.rungs.event(event);
        match event {
            Event::Publication(publication) => {
                let Some(payload) = publication.payload.map(|p| p.as_any()) else { return };
                let evaluation = &mut self.evaluation;
                // By operator too: what a fault makes of a message is no second one.
                let operator = publication.operator;
                if let Some(world) = payload.downcast_ref::<WorldState>() {
                    evaluation.world(world);
                    let footprint = self.shape.footprint(world.ego.state.pose);
                    self.road_margin_m = self.road_margin_m.min(self.route.margin_m(&footprint));
                } else if let (Some(imu), "imu") = (payload.downcast_ref::<Imu>(), operator) {
                    evaluation.imu(imu);
                } else if let (Some(list), "obstacles") = (payload.downcast_ref::<ObstacleList>(), operator) {
                    evaluation.seen(list);
                } else if let (Some(plan), "planner") = (payload.downcast_ref::<Plan>(), operator) {
                    evaluation.plan(plan);
                } else if let Some(gate) = payload.downcast_ref::<GateOutput>() {
                    evaluation.gate(publication.visible_at, gate);
                    if gate.mode == GateMode::Driving {
                        evaluation.command(publication.visible_at, publication.origin);
                    }
                } else if operator == "controller" && !self.has_gate {
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
    let summary = Summary { traffic, ros2, realtime, ..Summary::of(&config, &scenario, &outcome) };
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
        recorder.show(Box::new(Foxglove::new(views_of(config, pipeline))));
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

/// How an operator's timers kept time on the real clock.
#[derive(Serialize, Clone, Debug)]
struct Timer {
    operator: String,
    #[serde(flatten)]
    ticks: TickReport,
}

/// What a run came to, as `metrics.json` and `--json` say it.
#[derive(Serialize, Debug)]
pub struct Summary {
    scenario: String,
    pipeline: String,
    seed: u64,
    /// As everywhere else in hexadecimal digits: JSON readers keep no more than 53 bits of a number.
    digest: String,
    /// What computed images and point clouds: `cpu`, or an adapter; null without such sensors.
    images_by: Option<String>,
    /// Whether the digest holds on every machine, or for that adapter and driver alone.
    digest_is_portable: bool,
    /// Why the processor went on with the images, if an adapter failed.
    adapter_lost: Option<String>,
    /// Whether the scenario's `[expect]` for this pipeline holds; null when it has none.
    as_expected: Option<bool>,
    not_as_expected: Vec<String>,
    /// Run times drawn for want of a record, under recorded run times.
    unrecorded: u64,
    /// How timers kept time on the real clock, by operator.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    timers: Vec<Timer>,
    /// What of processors and priority was obtained, where they were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    realtime: Option<Obtained>,
    /// What went between the run's processes.
    #[serde(skip_serializing_if = "Option::is_none")]
    traffic: Option<Traffic>,
    /// What became of ROS 2's topics.
    #[serde(skip_serializing_if = "Option::is_none")]
    ros2: Option<Ros2Report>,
    /// The time that the deadline policy gave from a frame to its plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    response_budget: Option<Budgets>,
    /// Which rungs of their ladders detector and planner took.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    rungs: Vec<RungCount>,
    #[serde(skip)]
    rungs_text: String,
    #[serde(flatten)]
    metrics: Metrics,
}

impl Summary {
    /// Sums up a run.
    pub fn of(config: &Config, scenario: &Scenario, outcome: &Outcome) -> Self {
        let pipeline = config.pipeline_name();
        let expected = scenario.expectation(&pipeline);
        let broken = expected.map(|e| outcome.broken(e));
        Self {
            scenario: scenario.name.clone(),
            pipeline,
            seed: config.seed,
            digest: outcome.digest.to_string(),
            images_by: outcome.rendered.as_ref().map(|r| r.by.clone()),
            digest_is_portable: outcome.rendered.as_ref().is_none_or(|r| r.is_portable),
            adapter_lost: outcome.rendered.as_ref().and_then(|r| r.fell_back.clone()),
            as_expected: broken.as_ref().map(Vec::is_empty),
            not_as_expected: broken.unwrap_or_default(),
            unrecorded: outcome.report.operators.iter().map(|o| o.unrecorded).sum(),
            timers: timers(&outcome.report),
            realtime: None,
            traffic: None,
            ros2: None,
            response_budget: outcome.rungs.budgets(),
            rungs: outcome.rungs.counts(),
            rungs_text: outcome.rungs.text(),
            metrics: outcome.metrics.clone(),
        }
    }

    /// How time was kept, and what went between processes, where there is something to tell.
    fn clock_text(&self) -> String {
        let mut text = String::new();
        if !self.timers.is_empty() {
            let head = ["timer", "ticks", "missed", "late p50 ms", "p99 ms", "max ms"];
            let head = head.map(str::to_owned).to_vec();
            let lines = self.timers.iter().map(|Timer { operator, ticks }| {
                let ms = |ns: u64| format!("{:.2}", ns as f64 * 1e-6);
                let counts = [ticks.ticks.to_string(), ticks.missed.to_string()];
                let late = [ticks.p50_ns, ticks.p99_ns, ticks.max_ns].map(ms);
                std::iter::once(operator.clone()).chain(counts).chain(late).collect()
            });
            text += &align(&std::iter::once(head).chain(lines).collect::<Vec<_>>());
        }
        if let Some(realtime) = &self.realtime {
            text += &realtime.text();
        }
        if let Some(Traffic { calls, bytes, copied, in_place }) = self.traffic {
            text += &format!(
                "{calls} steps in other processes: {:.1} MB in messages, {in_place} big arrays read in place, \
                 {copied} bytes of them copied\n",
                bytes as f64 * 1e-6
            );
        }
        text
    }

    /// For the terminal.
    pub fn text(&self, out: &Path) -> String {
        use std::fmt::Write as _;
        let m = &self.metrics;
        let mut text = format!("{}, {}, seed {}\n", self.scenario, self.pipeline, self.seed);
        let verdict = m.verdict.name().to_uppercase();
        let _ = match m.impact {
            Some(i) => writeln!(
                text,
                "{verdict} at {:.2} s: ego at {:.1} m/s, closing at {:.1} m/s",
                i.at_s, i.ego_speed_mps, i.closing_speed_mps
            ),
            None => writeln!(text, "{verdict}"),
        };
        let mut row = |name: &str, value: String| {
            let _ = writeln!(text, "  {name:<18}{value}");
        };
        if let (Some(distance), Some(at)) = (m.min_distance_m, m.min_distance_at_s) {
            row("minimum distance", format!("{distance:.2} m at {at:.2} s"));
        }
        let jerk = |j: Option<f64>| j.map_or_else(|| "-".into(), |j| format!("{j:.1}"));
        let (raw, smooth) = (jerk(m.lateral_jerk.raw_max_mps3), jerk(m.lateral_jerk.smooth_max_mps3));
        row("lateral jerk", format!("{raw} m/s3 raw, {smooth} m/s3 low-passed"));
        if let Some(r) = &m.response {
            let (p50, p90, p99, max) = (r.p50_ms, r.p90_ms, r.p99_ms, r.max_ms);
            row("response time", format!("p50 {p50:.0}  p90 {p90:.0}  p99 {p99:.0}  max {max:.0} ms"));
        }
        if let Some(gate) = &m.gate {
            gate_rows(gate, &mut row);
        }
        row("digest", self.digest.clone());
        if let Some(by) = self.images_by.as_ref().filter(|_| !self.digest_is_portable) {
            row("images by", format!("{by}: the digest holds for this adapter and driver alone"));
        }
        if let Some(why) = &self.adapter_lost {
            row("adapter lost", format!("{why}; the processor went on: the digest is not to be had again"));
        }
        let head = ["operator", "steps", "p50 ms", "p99 ms", "misses", "drops"].map(str::to_owned).to_vec();
        let lines = m.operators.iter().map(|o| {
            let ms = |x: f64| format!("{x:.2}");
            vec![
                o.operator.clone(),
                o.steps.to_string(),
                ms(o.p50_ms),
                ms(o.p99_ms),
                o.misses.to_string(),
                o.drops.to_string(),
            ]
        });
        text += &align(&std::iter::once(head).chain(lines).collect::<Vec<_>>());
        text += &self.rungs_text;
        text += &self.clock_text();
        if let Some(ros2) = &self.ros2 {
            text += &ros2.text();
        }
        if self.unrecorded > 0 {
            let _ = writeln!(
                text,
                "{} steps had no record and drew their run time from the recorded ones",
                self.unrecorded
            );
        }
        match self.as_expected {
            Some(true) => text += "as the scenario expects\n",
            Some(false) => {
                let _ = writeln!(text, "not as the scenario expects: {}", self.not_as_expected.join("; "));
            }
            None => {}
        }
        let _ = writeln!(text, "in {}: story.svg, log.mcap, trace.json, metrics.json", out.display());
        text
    }
}

/// What the safety gate did.
fn gate_rows(gate: &GateMetrics, row: &mut impl FnMut(&str, String)) {
    let GateMetrics { manual_s, driving_s, stopping_s, holding_s, limited_s, refused, .. } = gate;
    let mut modes = format!("driving {driving_s:.2} s, limited for {limited_s:.2} s of it");
    for (mode, seconds) in [("manual", manual_s), ("stopping", stopping_s), ("holding", holding_s)] {
        if *seconds > 0.0 {
            modes += &format!(", {mode} {seconds:.2} s");
        }
    }
    row("gate", modes);
    for stop in &gate.stops {
        row("gate stops", format!("at {:.2} s: {}", stop.at_s, stop.cause.words()));
    }
    if refused.total() > 0 {
        let Refusals { not_finite, out_of_order, stale, ahead } = refused;
        row(
            "gate refused",
            format!("{not_finite} not finite, {out_of_order} out of order, {stale} too old, {ahead} ahead"),
        );
    }
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

/// How the timers of a run kept time, where that is known.
fn timers(report: &RunReport) -> Vec<Timer> {
    let of = report.operators.iter();
    of.filter_map(|o| Some(Timer { operator: o.name.clone(), ticks: o.ticks? })).collect()
}
