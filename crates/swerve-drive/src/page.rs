//! `report.html` of a run, from the run itself or from its log.

use std::path::Path;

mod log;

pub use log::{LogSoFar, given_log, log_of, page_of_log, pair_of_logs};

use anyhow::Context as _;
use serde::Deserialize as _;
use swerve_eval::BehaviourMetrics;
use swerve_flow::{Event, Observer};
use swerve_geom::{FrenetPoint, Point2};
use swerve_msg::Route;
use swerve_report::files::write_whole;
use swerve_report::output::quoted;
use swerve_report::page::{Behaviour, Changed, Collector, Have, Input, Light, Page, Rows, RunPage};
use swerve_scenario::{Aspect, Road, Scenario, TrafficLight};
use swerve_stack::Assembly;
use swerve_stack::Setup;
use swerve_stack::config::{Config, Images};
use swerve_stack::pipeline::Pipeline;
use swerve_text::Document;

use crate::load::RunInput;
use crate::measured::outline;
use crate::story::title;
use crate::trust;

/// Name of the page within a run's folder.
pub const REPORT: &str = "report.html";

/// Key of the run's command line in the head of a log.
pub const COMMAND: &str = "command";

/// Page of a run, filled during the run.
#[derive(Clone)]
pub struct RunReport {
    collector: Collector,
    page: RunPage,
    title: String,
}

impl RunReport {
    /// Creates the page of a run that is about to start.
    pub fn new(config: &Setup, pipeline: &Pipeline, command: String) -> Self {
        let mut report = Self::of_config(config, &pipeline.scenario, command);
        report.set_up(config, pipeline);
        report
    }

    /// Creates the page of a drive with a vehicle that is about to start.
    ///
    /// # Errors
    /// If the configuration does not make a pipeline.
    pub fn live(config: &Setup, scenario: &Scenario, command: String) -> anyhow::Result<Self> {
        let mut report = Self::of_config(config, scenario, command);
        report.set_up_live(config, scenario)?;
        Ok(report)
    }

    /// Replaces the command line by the reason why no command repeats the run.
    #[must_use]
    pub fn without_command(mut self, why: &str) -> Self {
        self.page.command.clear();
        why.clone_into(&mut self.page.no_command);
        self
    }

    fn of_config(config: &Setup, scenario: &Scenario, command: String) -> Self {
        let page = RunPage {
            notes: trust::programs(config)
                .iter()
                .chain(&scenario.warnings())
                .map(|line| format!("{line}."))
                .collect(),
            scenario: scenario.name.clone(),
            pipeline: config.pipeline_name(),
            seed: config.seed,
            command,
            config: config.to_text(),
            changed: changed(config),
            ..RunPage::default()
        };
        Self { collector: Collector::new(), page, title: title(config, scenario) }
    }

    fn set_up(&mut self, config: &Setup, pipeline: &Pipeline) {
        let shape = outline(&pipeline.vehicle.shape);
        let scenario = &pipeline.scenario;
        self.collector.set_ground(&pipeline.route, lane_width_m(scenario), shape);
        self.collector.set_lights(lights(&scenario.road, &pipeline.route));
        self.collector.keep_photos(config.log.images != Images::None);
        self.collector.set_names(scenario.names());
        set_inputs(&mut self.collector, &pipeline.assembly);
    }

    /// Sets up a live drive. The graph needs the vehicle; the inputs do not.
    fn set_up_live(&mut self, config: &Setup, scenario: &Scenario) -> anyhow::Result<()> {
        let shape = outline(&config.sim.vehicle.shape);
        self.collector.set_ground(&scenario.road.route(), lane_width_m(scenario), shape);
        set_inputs(&mut self.collector, &Assembly::new(config)?);
        Ok(())
    }

    /// Title and page before any measurement.
    pub fn head(&self) -> (String, RunPage) {
        self.clone().into_head()
    }

    fn into_head(self) -> (String, RunPage) {
        let left_out = self.collector.notes();
        let RunPage { scenario, pipeline, seed, command, no_command, config, changed, mut notes, .. } =
            self.page;
        notes.extend(left_out);
        let so_far = self.collector.finish();
        let page =
            RunPage { scenario, pipeline, seed, command, no_command, config, changed, notes, ..so_far };
        (self.title, page)
    }

    /// The drive up to now.
    pub fn so_far(&self) -> &RunPage {
        self.collector.so_far()
    }

    /// Rows added since those a page already has.
    pub fn rows(&self, have: &Have) -> Rows {
        self.collector.rows(have)
    }

    /// Completes the page of a finished run; `metrics` is the content of `metrics.json`.
    ///
    /// # Errors
    /// If the metrics are not JSON.
    pub fn finish(self, digest: &str, metrics: &str) -> anyhow::Result<Page<RunPage>> {
        let metrics: serde_json::Value =
            serde_json::from_str(metrics).context("reading the metrics of the run")?;
        let states = metrics.get("behaviour").map(BehaviourMetrics::deserialize).transpose();
        let states = states.context("reading `behaviour` in the metrics of the run")?;
        let behaviour = states.as_ref().map(Behaviour::from);
        let (title, head) = self.into_head();
        let page = RunPage { metrics, behaviour, digest: digest.to_owned(), ..head };
        Ok(Page::new("run", title, page))
    }

    /// Writes `report.html` into a folder.
    ///
    /// # Errors
    /// Same as [`finish`](Self::finish), or if it cannot be written.
    pub fn write(self, folder: &Path, digest: &str, metrics: &str) -> anyhow::Result<()> {
        write_whole(&folder.join(REPORT), self.finish(digest, metrics)?.html().as_bytes())
    }
}

impl Observer for RunReport {
    fn event(&mut self, event: &Event<'_>) {
        self.collector.event(event);
    }
}

/// Width of the ego's lane where it starts, metres.
fn lane_width_m(scenario: &Scenario) -> f64 {
    scenario.road.lane_width_m(scenario.ego.s_m)
}

/// Traffic lights that the ego obeys.
fn lights(road: &Road, route: &Route) -> Vec<Light> {
    let cm = |point: Point2| [point.x_m, point.y_m].map(|m| (m * 100.0).round() as i64);
    let us = |s: f64| (s * 1e6).round() as i64;
    let one = |light: &TrafficLight| {
        let s_m = light.stop_s_m?;
        let ends = [route.left_m(s_m), -route.right_m(s_m)];
        let [left, right] = ends.map(|d_m| cm(route.unproject(FrenetPoint { s_m, d_m })));
        let phases: Vec<_> =
            light.program.phases.iter().map(|phase| (name_of(phase.aspect), us(phase.duration_s))).collect();
        let cycle: i64 = phases.iter().map(|phase| phase.1).sum();
        Some(Light {
            name: light.name.clone(),
            at: cm(light.pose.point()),
            stop: [left[0], left[1], right[0], right[1]],
            offset: us(light.program.offset_s).rem_euclid(cycle.max(1)),
            phases,
        })
    };
    road.lights.iter().filter_map(one).collect()
}

fn name_of(aspect: Aspect) -> &'static str {
    match aspect {
        Aspect::Green => "green",
        Aspect::Yellow => "yellow",
        Aspect::Red => "red",
        Aspect::RedYellow => "red and yellow",
        Aspect::Off => "off",
    }
}

fn set_inputs(collector: &mut Collector, assembly: &Assembly) {
    for placed in assembly.operators() {
        let edges = placed.inputs.iter().flat_map(|input| &input.from);
        let input = |edge: &swerve_stack::assembly::Edge| Input {
            stream: edge.stream.clone(),
            feedback: edge.feedback,
        };
        collector.set_inputs(&placed.name, edges.map(input).collect());
    }
}

/// Command line that repeats a run.
pub fn command_line(input: &RunInput, run_times: Option<&Path>) -> String {
    let mut line = format!("swerve run {}", quoted(&input.scenario.display().to_string()));
    for config in &input.config {
        line += &format!(" -c {}", quoted(&config.display().to_string()));
    }
    for set in &input.set {
        line += &format!(" --set {}", quoted(set));
    }
    if let Some(seed) = input.seed {
        line += &format!(" --seed {seed}");
    }
    if let Some(log) = run_times {
        line += &format!(" --runtimes {}", quoted(&log.display().to_string()));
    }
    line += input.code().words();
    line
}

/// Keys of a configuration that are not at their defaults.
fn changed(config: &Setup) -> Vec<Changed> {
    let flat = |config: &Config| {
        let mut keys = Vec::new();
        let table = toml::Table::try_from(config).expect("a configuration is plain tables and values");
        flatten("", &table, &mut keys);
        keys
    };
    let of = |text: String| {
        let document = Document::parse("defaults", text).ok()?;
        Setup::from_document_with(&config.registry, &document, &[]).ok()
    };
    // The defaults include an empty table for each sensor; the presence of the sensor itself is reported too.
    let sensors = sensors(config);
    let tables: String = sensors.iter().map(|sensor| format!("[{sensor}]\n")).collect();
    let default = of(tables).or_else(|| of(String::new()));
    let (mut own, usual) = (flat(config), default.as_ref().map_or_else(Vec::new, |config| flat(config)));
    let value_of = |all: &[(String, String)], key: &str| {
        all.iter().find(|(k, _)| k == key).map_or_else(String::new, |(_, value)| value.clone())
    };
    let gone = usual.iter().filter(|(key, _)| own.iter().all(|(k, _)| k != key));
    let gone: Vec<_> = gone.map(|(key, _)| (key.clone(), String::new())).collect();
    own.extend(gone);
    let there =
        sensors.into_iter().map(|key| Changed { key, value: "set up".into(), default: String::new() });
    let changes = own.into_iter().map(|(key, value)| Changed { default: value_of(&usual, &key), key, value });
    let mut changed: Vec<_> = there.chain(changes.filter(|change| change.value != change.default)).collect();
    changed.sort_by(|a, b| a.key.cmp(&b.key));
    changed
}

/// Tables of a configuration's cameras, lidars and radars.
fn sensors(config: &Setup) -> Vec<String> {
    let table = |kind: &'static str| move |name: &String| format!("{kind}.{name}");
    let cameras = config.camera.keys().map(table("camera"));
    let lidars = config.lidar.keys().map(table("lidar"));
    cameras.chain(lidars).chain(config.radar.keys().map(table("radar"))).collect()
}

fn flatten(prefix: &str, table: &toml::Table, out: &mut Vec<(String, String)>) {
    for (name, value) in table {
        let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        match value {
            toml::Value::Table(inner) => flatten(&key, inner, out),
            _ => out.push((key, value.to_string())),
        }
    }
}
