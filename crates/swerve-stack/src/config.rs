//! Configuration: text, then typed, then resolved and checked, once, at start.
//!
//! Every key has a default; a file and `--set` change single keys. Durations in files are milliseconds and angles
//! degrees (their names have the unit); resolving converts them.

mod any_table;
pub mod camera;
pub mod camera_detectors;
pub mod car;
mod check;
pub mod clock;
mod control;
pub mod detectors;
pub mod domain;
pub mod execution;
pub mod gate;
pub mod injection;
pub mod live;
pub mod localization;
pub mod model;
pub mod monitor;
pub(crate) mod near_keys;
pub(crate) mod old_names;
mod operator;
pub mod perception;
mod planning;
mod prediction;
mod predictor_weights;
pub mod process;
pub mod programs;
pub mod resolved;
pub mod ros2;
mod sensing;
pub mod sensors;
pub mod source;

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_control::safety_gate::GateParams;
use swerve_core::{Ranges, Span};
use swerve_perception::detector::Sensing;
use swerve_pylot::Preset;
use swerve_ros2::env::Network;
use swerve_ros2::mapping::{Mapping, Role, Vehicle};
use swerve_sim::sense::SensorTiming;
use swerve_text::{KeyProblem, overridden};
use swerve_vehicle::VehicleParams;

pub use crate::planners::Fineness;
pub(crate) use any_table::AnyTable;
use camera::{CameraConfig, RenderConfig};
pub use car::Car;
use clock::ClockConfig;
pub use control::{BuiltInController, ControlConfig, ControllerName};
use gate::GateConfig;
use injection::FaultConfig;
pub use live::LiveConfig;
use localization::LocalizationConfig;
use model::ExecutionConfig;
use monitor::MonitorConfig;
pub(crate) use operator::is_plain_name;
pub use operator::{EdgeConfig, OperatorConfig, Reads, ResourceConfig, RungConfig};
use perception::PerceptionConfig;
pub use planning::{BuiltInPlanner, PlannerName, PlanningConfig, StartState};
pub use prediction::{PredictionConfig, PredictorName};
use process::{ProcessConfig, SharedMemoryConfig};
use ros2::EgoDriver;
pub use sensing::{SensingConfig, Source};
use sensors::{LidarConfig, RadarConfig};
use source::SourceConfig;

use crate::controllers::{NamedController as _, Pid, Stanley};
use crate::problems::problems_of_ranges;

/// A whole configuration: operators, their run times, and recording.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Clock of the run.
    #[ranges(nested)]
    pub clock: ClockConfig,
    /// The ego vehicle.
    #[ranges(nested)]
    pub ego: EgoConfig,
    /// The simulator.
    #[ranges(nested)]
    pub sim: SimConfig,
    /// Sensors of the stack.
    pub sensing: SensingConfig,
    /// Localization of the ego.
    pub localization: LocalizationConfig,
    /// Rendering of the world.
    pub render: RenderConfig,
    /// Cameras on the ego, by name. Each runs where an operator reads it or `log.sensors` names it.
    pub camera: BTreeMap<String, CameraConfig>,
    /// Radars on the ego, by name; they run as cameras do.
    pub radar: BTreeMap<String, RadarConfig>,
    /// Lidars on the ego, by name; they run as cameras do.
    pub lidar: BTreeMap<String, LidarConfig>,
    /// Perception, between the sensors and the predictor.
    pub perception: PerceptionConfig,
    /// Monitors of single cameras and lidars, by name.
    pub monitor: BTreeMap<String, MonitorConfig>,
    /// The predictor.
    pub prediction: PredictionConfig,
    /// The motion planner.
    pub planning: PlanningConfig,
    /// The controller.
    pub control: ControlConfig,
    /// The safety gate between the controller and the vehicle.
    pub gate: GateConfig,
    /// Execution of detector and planner: periods and deadlines.
    pub execution: ExecutionConfig,
    /// Recording.
    #[ranges(nested)]
    pub log: LogConfig,
    /// Settings of single operators, by name.
    #[ranges(nested)]
    pub operator: BTreeMap<String, OperatorConfig>,
    /// Shared resources, by name.
    #[ranges(nested)]
    pub resource: BTreeMap<String, ResourceConfig>,
    /// Faults on streams, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    #[ranges(nested)]
    pub fault: BTreeMap<String, FaultConfig>,
    /// Processes that take the steps of operators, by name.
    #[ranges(nested)]
    pub process: BTreeMap<String, ProcessConfig>,
    /// Shared memory of these processes.
    pub shared_memory: SharedMemoryConfig,
    /// Mapping of streams to ROS 2 topics, for `swerve live` and `run --ros2`.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "crate::config::AnyTable")]
    pub ros2: toml::Table,
    /// A recorded drive in place of a vehicle, for `swerve live`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<SourceConfig>,
    /// A vehicle that `swerve live` drives.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[ranges(nested)]
    pub live: Option<LiveConfig>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            seed: 1,
            clock: ClockConfig::default(),
            ego: EgoConfig::default(),
            sim: SimConfig::default(),
            sensing: SensingConfig::default(),
            localization: LocalizationConfig::default(),
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
        }
    }
}

/// The ego vehicle in the scenario.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct EgoConfig {
    /// Target and start speed, m/s; the scenario's when absent.
    #[schemars(range(min = 0.0, max = 70.0))]
    pub speed_mps: Option<f64>,
    /// Driver of the ego.
    pub driver: EgoDriver,
}

/// The simulator.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct SimConfig {
    /// Step, ms: 1 to 20.
    #[schemars(range(min = 1.0, max = 20.0))]
    pub dt_ms: f64,
    /// Draws start, speed, phases and triggers from the seed; if false, all are exactly as in the scenario.
    pub draws: bool,
    /// True in the logs of a stack in a foreign world (`swerve.Stack`): the world and its sensors are fed, not simulated.
    #[serde(skip_serializing_if = "core::ops::Not::not")]
    pub guest: bool,
    /// Car of the ego; keys of `vehicle` override its values.
    pub car: Car,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self { dt_ms: 5.0, draws: true, guest: false, car: Car::default(), vehicle: VehicleParams::default() }
    }
}

/// Recording.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct LogConfig {
    /// Sensors that run even without a reader: `gnss`, `odometry`, `collisions`, `lane_invasions`, `red_lights`, and
    /// cameras, radars and lidars by name.
    pub sensors: Vec<String>,
    /// Recording of images and point clouds; it does not change the digest of a run.
    pub images: Images,
    /// Quality of JPEG images, 1 to 100.
    #[schemars(range(min = 1, max = 100))]
    pub jpeg_quality: u8,
    /// Also records the run in the forms that Foxglove shows, under `/view`.
    pub foxglove: bool,
    /// Also records each state of the simulated world as `osi3.GroundTruth` of ASAM OSI, under `/osi/ground_truth`.
    pub osi: bool,
}

impl Default for LogConfig {
    fn default() -> Self {
        Self { sensors: Vec::new(), images: Images::default(), jpeg_quality: 85, foxglove: true, osi: false }
    }
}

/// Recording of images and point clouds.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Images {
    /// Fingerprints only: a replay computes images and points again and compares.
    #[default]
    None,
    /// Fingerprints, and under `/view` colour images as JPEG and point clouds, for viewing.
    Jpeg,
    /// All their bytes.
    Lossless,
}

impl Config {
    /// Returns true if the simulated stack detects the traffic lights of a road and stops at red ones.
    pub(crate) fn stops_at_lights(&self) -> bool {
        self.sensing.traffic_lights.unwrap_or(self.planning.preset == Preset::Best)
    }

    /// Name of the controller that follows the plans.
    pub fn controller(&self) -> &str {
        let usual = match self.planning.preset {
            Preset::Paper => Pid::NAME,
            Preset::Best => Stanley::NAME,
        };
        self.control.controller.as_ref().map_or(usual, ControllerName::as_str)
    }

    /// Returns true if another stack drives, over ROS 2.
    pub fn is_driven_over_ros2(&self) -> bool {
        self.ego.driver == EgoDriver::Ros2
    }

    /// Returns true if the stack only observes a vehicle: an interface without a topic for commands.
    fn is_observed(&self) -> bool {
        let mapping = self.live.as_ref().and_then(|_| self.ros2_mapping().ok());
        mapping.is_some_and(|mapping| {
            mapping.vehicle == Vehicle::Plain && mapping.with_role(Role::Command).next().is_none()
        })
    }

    /// Topics of `[ros2]`, on the network that the environment names where the table does not.
    ///
    /// # Errors
    /// An environment variable of ROS has an invalid value.
    pub fn ros2_mapping(&self) -> anyhow::Result<Mapping> {
        let network = Network::from_variables(|name| std::env::var(name).ok())?;
        Ok(Mapping::from_table(&self.ros2, network)?)
    }

    /// Names of all monitors.
    pub fn monitors(&self) -> impl Iterator<Item = &str> {
        self.monitor.keys().map(String::as_str)
    }

    /// Names of the sensors with named tables, each with the name of the table.
    pub(crate) fn named_sensors(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let cameras = self.camera.keys().map(|name| ("camera", name.as_str()));
        let radars = self.radar.keys().map(|name| ("radar", name.as_str()));
        let lidars = self.lidar.keys().map(|name| ("lidar", name.as_str()));
        cameras.chain(radars).chain(lidars)
    }

    /// Names of all cameras, radars and lidars.
    pub fn sensors(&self) -> impl Iterator<Item = &str> {
        self.named_sensors().map(|(_, name)| name)
    }

    /// Times from exposure to the reader of a camera, radar or lidar, and the time between two steps of its operator.
    pub fn sensor_timing(&self, name: &str) -> Option<(SensorTiming, Span)> {
        let with = |timing, ms: f64| (timing, Span::from_secs(ms * 1e-3));
        let camera = self.camera.get(name).map(|camera| with(camera.timing(), camera.period_ms));
        let radar = || self.radar.get(name).map(|radar| with(radar.timing(), radar.period_ms()));
        let lidar = || self.lidar.get(name).map(|lidar| with(lidar.timing(), self.sim.dt_ms));
        camera.or_else(radar).or_else(lidar)
    }

    /// Camera of the emulated detector, if it has one.
    pub fn detector_camera(&self, sensing: Sensing) -> Option<CameraConfig> {
        match (&self.perception.camera, sensing) {
            (Some(name), _) => self.camera.get(name).cloned(),
            (None, Sensing::Camera) => Some(CameraConfig::default()),
            (None, Sensing::Lidar) => None,
        }
    }

    /// Limits and times of the gate: the vehicle's, overridden by the configuration.
    ///
    /// # Errors
    /// Problems of the parameters, each by its key in `gate.params`.
    pub(crate) fn gate_params(&self) -> Result<GateParams, Vec<KeyProblem>> {
        let mut params = GateParams::new(&self.sim.vehicle);
        if self.is_driven_over_ros2() {
            // Another stack may repeat a command for as long as the road is straight.
            params.repeat_max_s = 0.0;
        }
        if self.source.is_some() || self.is_observed() {
            // A recorded vehicle, or one without drive-by-wire, does not follow the commands.
            params.ignored_after_s = 0.0;
        }
        let params: GateParams = overridden(&params, &self.gate.params)?;
        // A limit that the vehicle gives is a problem of the vehicle.
        let is_of_vehicle =
            |key: &str| !self.gate.params.contains_key(key) && self.sim.vehicle.validate().is_err();
        let problems = problems_of_ranges(&params);
        match problems.is_empty() {
            true => Ok(params),
            false => Err(problems.into_iter().filter(|(key, _)| !is_of_vehicle(key)).collect()),
        }
    }

    /// Process that takes the steps of an operator; `None` for this one.
    pub fn process_of(&self, operator: &str) -> Option<&str> {
        let has = |process: &ProcessConfig| process.operators.iter().any(|name| name == operator);
        self.process.iter().find(|(_, process)| has(process)).map(|(name, _)| name.as_str())
    }

    /// Files of programs and of a map, on which a result depends as on the configuration.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let programs = self.process.values().filter_map(|process| Some(process.python_class()?.ok()?.0));
        programs.chain(self.localization.map.as_deref())
    }

    /// Faults on a stream, by name, in order.
    pub fn faults_of(&self, stream: &str) -> impl Iterator<Item = (&str, &FaultConfig)> {
        let named = self.fault.iter().map(|(name, fault)| (name.as_str(), fault));
        named.filter(move |(_, fault)| fault.stream == stream)
    }

    /// Name of this pipeline in scenarios: the planner, prefixed by `paper_` under that preset; `ros2` where another
    /// stack drives; the class of a planner in Python; the planner's kind for a custom one.
    pub fn pipeline_name(&self) -> String {
        if self.is_driven_over_ros2() {
            return "ros2".into();
        }
        let process = self.process_of("planner").and_then(|process| self.process.get(process));
        if let Some(Ok((_, class))) = process.and_then(ProcessConfig::python_class) {
            return class.to_owned();
        }
        let planner = self.operator.get("planner").and_then(|own| own.kind.as_deref());
        if let Some(kind) = planner.filter(|kind| *kind != "planner") {
            return kind.to_owned();
        }
        Self::name_of(self.planning.planner.as_str(), self.planning.preset)
    }

    pub(crate) fn name_of(planner: &str, preset: Preset) -> String {
        match preset {
            Preset::Paper => format!("paper_{planner}"),
            Preset::Best => planner.to_owned(),
        }
    }

    /// The whole configuration including all defaults, as TOML.
    pub fn to_text(&self) -> String {
        toml::to_string(self).expect("a configuration is plain tables and values")
    }
}

#[cfg(test)]
mod tests;
