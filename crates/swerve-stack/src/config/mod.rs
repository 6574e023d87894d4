//! Configuration: text, then typed, then resolved and checked, once, at start.
//!
//! Every key has a default; a file and `--set` change single keys. Durations in files are milliseconds and
//! angles degrees (their names say so); resolving converts them.

pub mod camera;
pub mod clock;
pub mod detectors;
pub mod execution;
pub mod gate;
pub mod injection;
pub mod live;
pub mod model;
pub mod monitor;
pub mod perception;
mod planner;
pub mod process;
pub mod ros2;
pub mod sensors;
pub mod source;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};
use swerve_control::Following;
use swerve_planning::{CollisionMode, Planner};
use swerve_pylot::Preset;
use swerve_sim::sense::{GnssParams, ImuParams, PoseParams, SensorMount, WheelOdometryParams};
use swerve_text::{Document, Problem, Problems};
use swerve_vehicle::VehicleParams;

use camera::{CameraConfig, RenderConfig};
use clock::ClockConfig;
use execution::{Deadline, Runtime};
use gate::GateConfig;
use injection::FaultConfig;
pub use live::LiveConfig;
use model::ExecutionConfig;
use monitor::MonitorConfig;
use perception::PerceptionConfig;
use process::{ProcessConfig, SharedMemoryConfig};
use ros2::EgoDriver;
use sensors::{LidarConfig, RadarConfig};
use source::SourceConfig;

use crate::assembly::{Assembly, gather_named_sections};
use crate::registry::Registry;

/// A whole configuration: what runs, how long it takes, what is recorded.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Seed of everything random.
    pub seed: u64,
    /// What moves the run.
    pub clock: ClockConfig,
    /// The ego vehicle.
    pub ego: EgoConfig,
    /// The simulator.
    pub sim: SimConfig,
    /// What perception starts from.
    pub sensing: SensingConfig,
    /// How the world is rendered.
    pub render: RenderConfig,
    /// Cameras on the ego, by name. Each runs where an operator reads it or `log.sensors` names it.
    pub camera: BTreeMap<String, CameraConfig>,
    /// Radars on the ego, by name; they run as cameras do.
    pub radar: BTreeMap<String, RadarConfig>,
    /// Lidars on the ego, by name; they run as cameras do.
    pub lidar: BTreeMap<String, LidarConfig>,
    /// What stands between the sensors and the predictor.
    pub perception: PerceptionConfig,
    /// Watchers of single cameras and lidars, by name.
    pub monitor: BTreeMap<String, MonitorConfig>,
    /// The predictor.
    pub prediction: PredictionConfig,
    /// The motion planner.
    pub planning: PlanningConfig,
    /// The controller.
    pub control: ControlConfig,
    /// The safety gate between the controller and the vehicle.
    pub gate: GateConfig,
    /// When detector and planner run, and how long they may take.
    pub execution: ExecutionConfig,
    /// What is recorded.
    pub log: LogConfig,
    /// How single operators run, by name.
    pub operator: BTreeMap<String, OperatorConfig>,
    /// Shared resources, by name.
    pub resource: BTreeMap<String, ResourceConfig>,
    /// Faults on streams, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub fault: BTreeMap<String, FaultConfig>,
    /// Processes that take the steps of operators, by name.
    pub process: BTreeMap<String, ProcessConfig>,
    /// What they share.
    pub shared_memory: SharedMemoryConfig,
    /// Which stream is which ROS 2 topic, for `swerve live` and `run --ros2`; [`Config::ros2_mapping`] reads it.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    pub ros2: toml::Table,
    /// A recorded drive in the place of a vehicle, for `swerve live`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<SourceConfig>,
    /// A vehicle that `swerve live` drives.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub live: Option<LiveConfig>,
    /// The kinds of operators that it can name.
    #[serde(skip)]
    pub registry: Registry,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            seed: 1,
            clock: ClockConfig::default(),
            ego: EgoConfig::default(),
            sim: SimConfig::default(),
            sensing: SensingConfig::default(),
            render: RenderConfig::default(),
            camera: BTreeMap::new(),
            radar: BTreeMap::new(),
            lidar: BTreeMap::new(),
            perception: PerceptionConfig::default(),
            monitor: BTreeMap::new(),
            prediction: PredictionConfig::default(),
            planning: PlanningConfig::default(),
            control: ControlConfig::default(),
            gate: GateConfig::default(),
            execution: ExecutionConfig::default(),
            log: LogConfig::default(),
            operator: BTreeMap::new(),
            resource: BTreeMap::new(),
            fault: BTreeMap::new(),
            process: BTreeMap::new(),
            shared_memory: SharedMemoryConfig::default(),
            ros2: toml::Table::new(),
            source: None,
            live: None,
            registry: Registry::standard(),
        }
    }
}

/// The ego vehicle in the scenario.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EgoConfig {
    /// Target and start speed, m/s; the scenario's when absent.
    pub speed_mps: Option<f64>,
    /// Who drives it.
    pub driver: EgoDriver,
}

/// The simulator.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimConfig {
    /// Step, ms: 1 to 20.
    pub dt_ms: f64,
    /// Draws start, speed, phases and triggers from the seed; off, all are exactly as the scenario says.
    pub draws: bool,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self { dt_ms: 5.0, draws: true, vehicle: VehicleParams::default() }
    }
}

/// What the obstacle sensor reports.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Simulator state cut by range, field of view and occlusion.
    Truth,
    /// Simulator state cut by range and field of view only.
    TruthUnoccluded,
}

/// The sensors.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensingConfig {
    /// What the obstacle sensor reports.
    pub source: Source,
    /// Period of the obstacle sensor, ms.
    pub period_ms: f64,
    /// Range of the obstacle sensor from the ego's centre, m.
    pub range_m: f64,
    /// Field of view of the obstacle sensor, degrees, symmetric around straight ahead.
    pub fov_deg: f64,
    /// Largest distance for people, m; that of the others when absent.
    pub range_person_m: Option<f64>,
    /// Where the obstacle sensor sits; the middle of the roof, 1.9 m up, when absent.
    pub mount: Option<SensorMount>,
    /// Period of the pose sensor, ms.
    pub pose_period_ms: f64,
    /// Period of the inertial sensor, ms.
    pub imu_period_ms: f64,
    /// Period of the satellite receiver, ms.
    pub gnss_period_ms: f64,
    /// Period of the wheel odometry, ms.
    pub odometry_period_ms: f64,
    /// Errors of the pose sensor.
    pub pose: PoseParams,
    /// Errors of the inertial sensor.
    pub imu: ImuParams,
    /// Errors of the satellite receiver.
    pub gnss: GnssParams,
    /// Encoders of the wheels and their errors.
    pub odometry: WheelOdometryParams,
}

impl Default for SensingConfig {
    fn default() -> Self {
        Self {
            source: Source::Truth,
            period_ms: 50.0,
            range_m: 100.0,
            fov_deg: 360.0,
            range_person_m: None,
            mount: None,
            pose_period_ms: 10.0,
            imu_period_ms: 10.0,
            gnss_period_ms: 100.0,
            odometry_period_ms: 20.0,
            pose: PoseParams::default(),
            imu: ImuParams::default(),
            gnss: GnssParams::default(),
            odometry: WheelOdometryParams::default(),
        }
    }
}

/// The predictor.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PredictionConfig {
    /// With one sighting: the reported velocity (`best`), or standing still (`paper`).
    pub preset: Preset,
    /// Sightings that the straight line is fitted to.
    pub past_steps: usize,
    /// How far ahead, ms.
    pub horizon_ms: f64,
    /// Between predicted poses, ms.
    pub step_ms: f64,
}

impl Default for PredictionConfig {
    fn default() -> Self {
        Self { preset: Preset::Best, past_steps: 5, horizon_ms: 5000.0, step_ms: 100.0 }
    }
}

/// Motion planners by name.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlannerName {
    /// Frenet optimal trajectories.
    Fot,
    /// RRT*.
    RrtStar,
    /// Hybrid A*.
    HybridAstar,
    /// Route following that slows and stops for what is ahead.
    Waypoint,
    /// Route following with emergency braking.
    Aeb,
}

impl PlannerName {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Fot, Self::RrtStar, Self::HybridAstar, Self::Waypoint, Self::Aeb];

    /// The name in files and tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fot => "fot",
            Self::RrtStar => "rrt_star",
            Self::HybridAstar => "hybrid_astar",
            Self::Waypoint => "waypoint",
            Self::Aeb => "aeb",
        }
    }
}

/// A planner's discretisation.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fineness {
    /// Coarse.
    Fast,
    /// Fine.
    Slow,
}

impl Fineness {
    /// The name in files and tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Slow => "slow",
        }
    }
}

/// Where a plan starts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartState {
    /// The pose measured at the stamp.
    Measured,
    /// Moved on by the expected run time.
    Predicted,
}

/// Run time by planner and discretisation.
pub type Cost = BTreeMap<PlannerName, BTreeMap<Fineness, Runtime>>;

/// Read once: every default configuration has it.
static BUILT_IN_COST: LazyLock<Cost> =
    LazyLock::new(|| toml::from_str(include_str!("cost.toml")).expect("a test reads the built-in costs"));

/// The motion planner.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlanningConfig {
    /// Which one.
    pub planner: PlannerName,
    /// Its discretisation.
    pub config: Fineness,
    /// The paper's behaviour, or ours; sets the defaults of the keys below.
    pub preset: Preset,
    /// What predictions mean for collision checks: `time_indexed`, `may_stop` (pedestrians, anywhere on their way), or
    /// the original's `swept_static`.
    pub collision: CollisionMode,
    /// Where a plan starts; the preset's when absent.
    pub start: Option<StartState>,
    /// Expected time from a sensor frame to its plan, ms, for the predicted start; the planner's typical cost when absent.
    pub expected_ms: Option<f64>,
    /// Parameters of the chosen planner that differ from its preset's and discretisation's.
    pub params: toml::Table,
    /// A ladder of discretisations (`fot@d3`): the planner takes the finest that fits the time left until its deadline,
    /// and as long as that takes.
    pub ladder: Option<String>,
    /// The ladder's highest rung that is taken, by its run time, ms; the finest of all when absent.
    pub rung_ms: Option<f64>,
    /// Run time by planner and discretisation; `[operator.planner] runtime` goes before it. A file that names one
    /// entry replaces the whole table. Default: `cost.toml`, measured by `swerve calibrate` for the `best` presets.
    pub cost: Cost,
    /// Latency added to every plan, ms.
    pub added_latency_ms: f64,
}

impl Default for PlanningConfig {
    fn default() -> Self {
        Self {
            planner: PlannerName::Fot,
            config: Fineness::Fast,
            preset: Preset::Best,
            collision: CollisionMode::TimeIndexed,
            start: None,
            expected_ms: None,
            params: toml::Table::new(),
            ladder: None,
            rung_ms: None,
            cost: BUILT_IN_COST.clone(),
            added_latency_ms: 0.0,
        }
    }
}

impl PlanningConfig {
    /// The planner that this names, with its parameters; what is wrong with them, if they make none.
    pub fn planner(&self) -> Result<Box<dyn Planner>, String> {
        self.planner_with(&self.params)
    }

    /// The same with other parameters.
    pub fn planner_with(&self, params: &toml::Table) -> Result<Box<dyn Planner>, String> {
        planner::planner(self, params)
    }

    /// Run time of the chosen planner and discretisation.
    pub fn cost_of_chosen(&self) -> Option<&Runtime> {
        self.cost.get(&self.planner)?.get(&self.config)
    }

    /// Where a plan starts.
    pub fn start_state(&self) -> StartState {
        self.start.unwrap_or(match self.preset {
            Preset::Paper => StartState::Measured,
            Preset::Best => StartState::Predicted,
        })
    }

    /// Expected time from a sensor frame to its plan's first effect, ms.
    pub fn expected_ms(&self) -> f64 {
        self.expected_ms
            .unwrap_or_else(|| self.cost_of_chosen().map_or(0.0, Runtime::typical_ms) + self.added_latency_ms)
    }
}

/// Controllers by name.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControllerName {
    /// The paper's speed PID and steering towards a waypoint.
    Pid,
    /// Speed PID and pure pursuit.
    PurePursuit,
    /// Speed PID and the Stanley law.
    Stanley,
    /// Linear time-varying model predictive control.
    Mpc,
}

/// The controller.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlConfig {
    /// Which one.
    pub controller: ControllerName,
    /// How a plan is followed; the planning preset's when absent.
    pub following: Option<Following>,
    /// Period, ms.
    pub period_ms: f64,
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self { controller: ControllerName::Pid, following: None, period_ms: 10.0 }
    }
}

/// What is recorded.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogConfig {
    /// Sensors that run although no operator reads them: `gnss`, `odometry`, `collisions`, `lane_invasions`,
    /// `red_lights`, and cameras, radars and lidars by name.
    pub sensors: Vec<String>,
    /// What the log holds of images and point clouds; the digest of a run is the same with any.
    pub images: Images,
    /// Quality of JPEG images, 1 to 100.
    pub jpeg_quality: u8,
    /// Whether the log also holds the run in the forms that Foxglove shows, under `/view`.
    pub foxglove: bool,
}

impl Default for LogConfig {
    fn default() -> Self {
        Self { sensors: Vec::new(), images: Images::default(), jpeg_quality: 85, foxglove: true }
    }
}

/// What a log holds of images and point clouds.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Images {
    /// Their fingerprints: a replay computes them again and compares.
    #[default]
    None,
    /// Their fingerprints, and under `/view` colour images as JPEG and point clouds, to be looked at.
    Jpeg,
    /// All their bytes.
    Lossless,
}

/// One operator: what it is, what it reads, how it runs.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct OperatorConfig {
    /// Its kind, of those that `swerve operators` lists; that of the pipeline's operator of this name when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// `enabled = false` takes it out of the pipeline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enabled: Option<bool>,
    /// The streams that it reads, by port; found by their type when absent.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub reads: BTreeMap<String, Reads>,
    /// Run time; `zero` when absent (the planner: its cost; an emulated detector: the published one).
    pub runtime: Option<Runtime>,
    /// Busy policy; `skip_to_latest` when absent.
    pub policy: Option<String>,
    /// Deadline.
    pub deadline: Option<Deadline>,
    /// Resource that its steps hold a slot of.
    pub uses: Option<String>,
    /// Communication delay of what it publishes, ms.
    #[serde(skip_serializing_if = "is_zero")]
    pub delay_ms: f64,
    /// The keys of its kind, or of that kind's tables for this operator alone.
    #[serde(flatten)]
    pub keys: toml::Table,
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// What a port reads.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Reads {
    /// A stream, or the first one of an operator.
    Stream(String),
    /// Several, for a port that takes any number.
    Streams(Vec<String>),
    /// A stream, and how it is read.
    Edge(EdgeConfig),
}

/// A stream, and how it is read.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EdgeConfig {
    /// The stream, or the operator whose first one it is.
    pub stream: String,
    /// Over a feedback edge, which closes a loop; as the port has it when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback: Option<bool>,
    /// Before faults befall it; as the port has it when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before_faults: Option<bool>,
}

impl Reads {
    /// The streams, with what is said of feedback and faults.
    pub(crate) fn each(&self) -> Vec<(&str, Option<bool>, Option<bool>)> {
        match self {
            Self::Stream(stream) => vec![(stream, None, None)],
            Self::Streams(streams) => streams.iter().map(|stream| (stream.as_str(), None, None)).collect(),
            Self::Edge(edge) => vec![(&edge.stream, edge.feedback, edge.before_faults)],
        }
    }
}

/// A shared resource.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResourceConfig {
    /// Steps that it can hold at once.
    pub slots: usize,
}

impl Config {
    /// Reads a file (or takes the defaults) and applies assignments in order; everything is checked.
    pub fn load(file: Option<&Path>, sets: &[(String, toml::Value)]) -> Result<Self, Problems> {
        Self::load_with(&Registry::standard(), file, sets)
    }

    /// As [`load`](Self::load), with other kinds of operators than Swerve's own.
    pub fn load_with(
        registry: &Registry,
        file: Option<&Path>,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        let document = match file {
            Some(path) => Document::read(path)?,
            None => Document::parse("defaults", String::new())?,
        };
        Self::from_document_with(registry, &document, sets)
    }

    /// As [`load`](Self::load), from text that is already at hand.
    pub fn from_document(document: &Document, sets: &[(String, toml::Value)]) -> Result<Self, Problems> {
        Self::from_document_with(&Registry::standard(), document, sets)
    }

    /// As [`from_document`](Self::from_document), with other kinds of operators than Swerve's own.
    pub fn from_document_with(
        registry: &Registry,
        document: &Document,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        let plain = Self::formed_of_file(registry, document)?;
        // The file's own problems are told with their lines; what is left is one of an assignment.
        let plain = plain.checked(|key, message| document.problem(key, message))?;
        if sets.is_empty() { Ok(plain) } else { Self::with_sets(registry, document, sets) }
    }

    /// A file as it is written.
    fn formed_of_file(registry: &Registry, document: &Document) -> Result<Self, Problems> {
        let mut table = document.table.clone();
        gather_named_sections(&mut table, registry);
        let mut config: Self = match table == document.table {
            true => document.to()?,
            false => document.with_table(table).to()?,
        };
        config.registry = registry.clone();
        Ok(config)
    }

    /// A document that has no problems of its own, with assignments; the problems are theirs.
    pub fn with_sets(
        registry: &Registry,
        document: &Document,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        Self::formed(registry, document, sets)?.checked(|key, message| {
            let set = sets.iter().rev().find(|(k, _)| key.starts_with(k.as_str()) || k.starts_with(key));
            match set {
                Some((k, _)) => set_problem(k, message),
                None => document.problem(key, message),
            }
        })
    }

    /// As [`with_sets`](Self::with_sets), with no look at the values: the faults are those of their form.
    pub fn formed(
        registry: &Registry,
        document: &Document,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        let mut table = document.table.clone();
        for (key, value) in sets {
            swerve_text::set(&mut table, key, value.clone())
                .map_err(|(key, message)| set_problem(&key, message))?;
        }
        gather_named_sections(&mut table, registry);
        let config: Self = swerve_text::read(&table).map_err(|found| {
            found.into_iter().map(|(key, message)| set_problem(&key, message)).collect::<Problems>()
        })?;
        Ok(Self { registry: registry.clone(), ..config })
    }

    fn checked(self, problem: impl Fn(&str, String) -> Problem) -> Result<Self, Problems> {
        let mut faults = self.problems_of_values();
        self.check_pipeline(&mut faults);
        if faults.is_empty() {
            return Ok(self);
        }
        let mut problems: Vec<Problem> =
            faults.into_iter().map(|(key, message)| problem(&key, message)).collect();
        problems.sort_by_key(|problem| problem.line);
        Err(problems.into_iter().collect())
    }

    /// What is wrong with single values, by key.
    pub(crate) fn problems_of_values(&self) -> Vec<(String, String)> {
        let mut faults: Vec<(String, String)> = Vec::new();
        let mut range = |key: &str, value: f64, low: f64, high: f64| {
            if !(low..=high).contains(&value) {
                faults.push((
                    key.to_owned(),
                    format!("expected {low} to {high}, found {}", swerve_text::number(value)),
                ));
            }
        };
        let sensing = &self.sensing;
        range("ego.speed_mps", self.ego.speed_mps.unwrap_or(1.0), 0.0, 70.0);
        range("sim.dt_ms", self.sim.dt_ms, 1.0, 20.0);
        range("sensing.period_ms", sensing.period_ms, 1.0, 10_000.0);
        range("sensing.range_m", sensing.range_m, 0.1, 10_000.0);
        range("sensing.fov_deg", sensing.fov_deg, 1.0, 360.0);
        range("sensing.pose_period_ms", sensing.pose_period_ms, 1.0, 10_000.0);
        range("sensing.imu_period_ms", sensing.imu_period_ms, 1.0, 10_000.0);
        range("sensing.gnss_period_ms", sensing.gnss_period_ms, 1.0, 10_000.0);
        range("sensing.odometry_period_ms", sensing.odometry_period_ms, 1.0, 10_000.0);
        range("prediction.horizon_ms", self.prediction.horizon_ms, 50.0, 60_000.0);
        range("prediction.step_ms", self.prediction.step_ms, 1.0, 10_000.0);
        range("prediction.past_steps", self.prediction.past_steps as f64, 1.0, 1000.0);
        range("control.period_ms", self.control.period_ms, 1.0, 1000.0);
        range("planning.added_latency_ms", self.planning.added_latency_ms, 0.0, 100_000.0);
        range("planning.expected_ms", self.planning.expected_ms.unwrap_or(0.0), 0.0, 10_000.0);
        if let Err(error) = self.sim.vehicle.validate() {
            faults.push((
                format!("sim.vehicle.{}", error.key),
                format!("expected {}, found {}", error.expected, error.value),
            ));
        }
        if let Err(message) = self.planning.planner() {
            faults.push(("planning.params".into(), message));
        }
        self.check_gate(&mut faults);
        self.check_operators(&mut faults);
        self.check_sensors(&mut faults);
        self.check_perception(&mut faults);
        self.check_execution(&mut faults);
        self.check_log(&mut faults);
        self.check_monitors(&mut faults);
        self.check_clock(&mut faults);
        self.check_ros2(&mut faults);
        self.check_source(&mut faults);
        self.check_live(&mut faults);
        faults
    }

    /// What is wrong with the pipeline as a whole: its operators, what they read, and what is done to them.
    fn check_pipeline(&self, problems: &mut Vec<(String, String)>) {
        let (assembly, wrong) = Assembly::with_problems(self);
        // What nobody named may come of what is wrong already.
        let is_named = |(key, _): &(String, String)| {
            let Some((operator, port)) = key.split_once(".reads.") else { return true };
            let own = operator.strip_prefix("operator.").and_then(|name| self.operator.get(name));
            own.is_some_and(|own| own.reads.contains_key(port))
        };
        let is_first = problems.is_empty();
        problems.extend(wrong.into_iter().filter(|problem| is_first || is_named(problem)));
        self.check_faults(&assembly, problems);
        self.check_processes(&assembly, problems);
    }

    fn check_operators(&self, faults: &mut Vec<(String, String)>) {
        for (name, operator) in &self.operator {
            let key = |last: &str| format!("operator.{name}.{last}");
            if let Some(Err(message)) = operator.runtime.as_ref().map(Runtime::model) {
                faults.push((key("runtime"), message));
            }
            if let Some(Err(message)) = operator.policy.as_deref().map(execution::parse_policy) {
                faults.push((key("policy"), message));
            }
            if let Some(Err(message)) = operator.deadline.as_ref().map(Deadline::deadline) {
                faults.push((key("deadline"), message));
            }
            if let Err(message) = execution::span_ms(operator.delay_ms) {
                faults.push((key("delay_ms"), message));
            }
            if let Some(resource) = operator.uses.as_ref().filter(|r| !self.resource.contains_key(*r)) {
                let names: Vec<&str> = self.resource.keys().map(String::as_str).collect();
                let message =
                    format!("unknown resource `{resource}`, expected one of [{}]", names.join(", "));
                faults.push((key("uses"), message));
            }
        }
        for (name, _) in self.resource.iter().filter(|(_, r)| r.slots == 0) {
            faults.push((format!("resource.{name}.slots"), "expected at least 1".into()));
        }
        for (planner, by_fineness) in &self.planning.cost {
            for (fineness, cost) in by_fineness {
                if let Err(message) = cost.model() {
                    let key = format!("planning.cost.{}.{}", planner.as_str(), fineness.as_str());
                    faults.push((key, message));
                }
            }
        }
    }

    /// What scenarios call this pipeline: the planner, and `paper` before it where its preset is that; `ros2` where
    /// another stack drives, the kind of planner where it is none of ours.
    pub fn pipeline_name(&self) -> String {
        if self.is_driven_over_ros2() {
            return "ros2".into();
        }
        let planner = self.operator.get("planner").and_then(|own| own.kind.as_deref());
        if let Some(kind) = planner.filter(|kind| *kind != "planner") {
            return kind.to_owned();
        }
        Self::name_of(self.planning.planner, self.planning.preset)
    }

    fn name_of(planner: PlannerName, preset: Preset) -> String {
        match preset {
            Preset::Paper => format!("paper_{}", planner.as_str()),
            Preset::Best => planner.as_str().to_owned(),
        }
    }

    /// All that [`pipeline_name`](Self::pipeline_name) may be.
    pub fn pipeline_names() -> impl Iterator<Item = String> {
        let of = |preset| PlannerName::ALL.into_iter().map(move |planner| Self::name_of(planner, preset));
        of(Preset::Best).chain(of(Preset::Paper))
    }

    /// The whole configuration with every default spelled out, as TOML.
    pub fn to_text(&self) -> String {
        toml::to_string(self).expect("a configuration is plain tables and values")
    }
}

fn set_problem(key: &str, message: impl Into<String>) -> Problem {
    Problem { file: "--set".into(), line: None, key: key.to_owned(), message: message.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(text: &str, sets: &[&str]) -> Vec<String> {
        let sets: Vec<_> = sets.iter().map(|s| swerve_text::parse_assignment(s).unwrap()).collect();
        let document = Document::parse("c.toml", text).unwrap();
        let problems = Config::from_document(&document, &sets).expect_err("wrong on purpose");
        problems.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn every_fault_is_told_with_file_line_and_key() {
        let text = "[sim]\ndt_ms = nan\n[sensing]\nrange_m = -1\n[operator.planer]\npolicy = \"queue(0)\"\n[operator.planner]\nuses = \"gpu0\"\n";
        let found = problems(text, &[]);
        assert_eq!(found[0], "c.toml:2: sim.dt_ms: expected 1 to 20, found NaN");
        assert_eq!(found[1], "c.toml:4: sensing.range_m: expected 0.1 to 10000, found -1");
        assert!(found[2].starts_with("c.toml:5: operator.planer: unknown operator"), "{}", found[2]);
        assert!(found[2].ends_with("(did you mean `planner`?)"), "{}", found[2]);
        assert!(found[3].starts_with("c.toml:6: operator.planer.policy: unknown policy `queue(0)`"));
        assert!(found[4].starts_with("c.toml:8: operator.planner.uses: unknown resource `gpu0`"));
    }

    #[test]
    fn unknown_names_offer_the_nearest() {
        let unknown = &problems("[planning]\nplanner = \"rrtstar\"\n", &[])[0];
        assert!(unknown.starts_with("c.toml:2: planning.planner: expected one of \"fot\", "), "{unknown}");
        assert!(unknown.ends_with("found \"rrtstar\"; did you mean \"rrt_star\"?"), "{unknown}");
        assert_eq!(
            problems("", &["planning.planer=fot"]),
            ["--set: planning.planer: unknown key; did you mean \"planner\"?"]
        );
        assert_eq!(problems("", &["sim.dt_ms=100"]), ["--set: sim.dt_ms: expected 1 to 20, found 100"]);
    }

    #[test]
    fn every_planner_has_a_built_in_cost() {
        let cost = PlanningConfig::default().cost;
        for planner in PlannerName::ALL {
            for fineness in [Fineness::Fast, Fineness::Slow] {
                assert!(
                    cost[&planner][&fineness].model().is_ok(),
                    "{} {}",
                    planner.as_str(),
                    fineness.as_str()
                );
            }
        }
    }

    #[test]
    fn the_resolved_text_reads_back_as_itself() {
        let mut config = Config::default();
        config.operator.insert(
            "planner".into(),
            OperatorConfig { runtime: Some(Runtime::fixed(30.0)), ..OperatorConfig::default() },
        );
        config.planning.cost.insert(PlannerName::Fot, [(Fineness::Fast, Runtime::fixed(2.0))].into());
        let document = Document::parse("resolved", config.to_text()).unwrap();
        assert_eq!(Config::from_document(&document, &[]).unwrap(), config);
    }
}
