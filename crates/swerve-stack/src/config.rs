//! Configuration: text, then typed, then resolved and checked, once, at start.
//!
//! Every key has a default; a file and `--set` change single keys. Durations in files are milliseconds and angles
//! degrees (their names have the unit); resolving converts them.

pub mod camera;
pub mod camera_detectors;
pub mod car;
mod check;
pub mod clock;
pub mod detectors;
pub mod execution;
pub mod gate;
pub mod injection;
pub mod live;
pub mod localization;
pub mod model;
pub mod monitor;
pub(crate) mod old_names;
mod operator;
pub mod perception;
pub(crate) mod planner;
mod planning;
mod prediction;
mod predictor_weights;
pub mod process;
pub mod programs;
mod read;
pub mod resolved;
pub mod ros2;
pub mod sensors;
pub mod source;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_control::{Controller, Following};
use swerve_core::Ranges;
use swerve_localization::flat::Origin;
use swerve_pylot::Preset;
use swerve_sim::sense::{GnssParams, ImuParams, PoseParams, SensorMount, WheelOdometryParams};
use swerve_text::KeyProblem;
use swerve_vehicle::VehicleParams;

use camera::{CameraConfig, RenderConfig};
pub use car::Car;
use clock::ClockConfig;
use gate::GateConfig;
use injection::FaultConfig;
pub use live::LiveConfig;
use localization::LocalizationConfig;
use model::ExecutionConfig;
use monitor::MonitorConfig;
pub(crate) use operator::is_plain_name;
pub use operator::{EdgeConfig, OperatorConfig, Reads, ResourceConfig, RungConfig};
use perception::PerceptionConfig;
use planner::{problems_of_ranges, within};
pub use planning::{BuiltInPlanner, Fineness, PlannerName, PlanningConfig, StartState};
pub use prediction::{PredictionConfig, PredictorName};
use process::{ProcessConfig, SharedMemoryConfig};
use ros2::EgoDriver;
use sensors::{LidarConfig, RadarConfig};
use source::SourceConfig;

use crate::controllers::{ControllerSetup, NamedController as _, Pid, Stanley};
use crate::kind::KeyProblems;
use crate::named::Name;
use crate::registry::Registry;
use crate::section::{AnySection, Section, of_config};
use crate::setup::Setup;

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

/// Tables of the configuration that belong to kinds of operators.
pub(crate) const SECTIONS: [&dyn AnySection; 11] = [
    &SensingConfig::SECTION,
    &CameraConfig::SECTION,
    &RadarConfig::SECTION,
    &LidarConfig::SECTION,
    &MonitorConfig::SECTION,
    &PerceptionConfig::SECTION,
    &PredictionConfig::SECTION,
    &PlanningConfig::SECTION,
    &ControlConfig::SECTION,
    &GateConfig::SECTION,
    &ExecutionConfig::SECTION,
];

/// A table whose keys depend on other keys, in schemas.
pub(crate) type AnyTable = BTreeMap<String, AnyValue>;

/// Any value, in schemas.
pub(crate) struct AnyValue;

impl JsonSchema for AnyValue {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "AnyValue".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        true.into()
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
    /// Car of the ego; keys of `vehicle` override its values.
    pub car: Car,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self { dt_ms: 5.0, draws: true, car: Car::default(), vehicle: VehicleParams::default() }
    }
}

/// Source of the obstacle sensor's objects.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Simulator state limited by range, field of view and occlusion.
    Truth,
    /// Simulator state limited by range and field of view only.
    TruthUnoccluded,
}

/// The sensors.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct SensingConfig {
    /// Source of the obstacle sensor's objects.
    pub source: Source,
    /// Period of the obstacle sensor, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub period_ms: f64,
    /// Range of the obstacle sensor from the ego's centre, m.
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub range_m: f64,
    /// Field of view of the obstacle sensor, degrees, symmetric around straight ahead.
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov_deg: f64,
    /// Range of the obstacle sensor for people, m; `range_m` when absent.
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub range_person_m: Option<f64>,
    /// Mount of the obstacle sensor; the middle of the roof, 1.9 m up, when absent.
    #[ranges(nested)]
    pub mount: Option<SensorMount>,
    /// Detects traffic lights of the scenario as the obstacle sensor detects actors, and stops at red ones; an operator
    /// of the kind `traffic_lights` replaces the sensor, one of the kind `stop_lines` turns both off. When absent with
    /// the planning preset `best`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traffic_lights: Option<bool>,
    /// Period of the pose sensor, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub pose_period_ms: f64,
    /// Period of the inertial sensor, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub imu_period_ms: f64,
    /// Period of the satellite receiver, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub gnss_period_ms: f64,
    /// Period of the wheel odometry, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub odometry_period_ms: f64,
    /// Errors of the pose sensor.
    #[ranges(nested)]
    pub pose: PoseParams,
    /// Errors of the inertial sensor.
    #[ranges(nested)]
    pub imu: ImuParams,
    /// Errors of the satellite receiver.
    #[ranges(nested)]
    pub gnss: GnssParams,
    /// Wheel encoders and their errors.
    #[ranges(nested)]
    pub odometry: WheelOdometryParams,
}

impl SensingConfig {
    /// `[sensing]`.
    pub const SECTION: Section<Self> = of_config!(sensing, Self::problems);

    fn problems(&self, _: &Setup) -> KeyProblems {
        problems_of_ranges(self)
    }

    /// Origin of the map, for satellite fixes.
    pub fn map_origin(&self) -> Origin {
        Origin {
            latitude_deg: self.gnss.origin_latitude_deg,
            longitude_deg: self.gnss.origin_longitude_deg,
            altitude_m: self.gnss.origin_altitude_m,
        }
    }
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
            traffic_lights: None,
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

/// Name of a controller: a built-in one, or one that [`Registry::with_controller`] adds.
pub type ControllerName = Name<BuiltInController>;

/// Built-in controllers.
#[derive(Clone, PartialEq, Debug, JsonSchema)]
#[schemars(rename = "ControllerName", rename_all = "snake_case")]
pub enum BuiltInController {
    /// The paper's speed PID and steering towards a waypoint.
    Pid,
    /// Speed PID and pure pursuit.
    PurePursuit,
    /// Speed PID and the Stanley law.
    Stanley,
    /// Linear time-varying model predictive control.
    Mpc,
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
}

impl Setup {
    /// Builds the controller, for the configured vehicle.
    ///
    /// # Errors
    /// Problems by their keys in `control`.
    pub(crate) fn built_controller(&self) -> Result<Box<dyn Controller>, Vec<KeyProblem>> {
        let named = self.registry.controllers.named("controller", self.controller())?;
        let following = self.control.following.unwrap_or_else(|| self.planning.preset.following());
        let setup = ControllerSetup { vehicle: &self.sim.vehicle, following };
        named.build(setup, &self.control.params).map_err(|found| within("params", found))
    }
}

/// The controller.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct ControlConfig {
    /// Controller: `stanley` when absent, `pid` of the paper under the planning preset `paper`.
    pub controller: Option<ControllerName>,
    /// Parameters of a custom controller that differ from its defaults.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "crate::config::AnyTable")]
    pub params: toml::Table,
    /// Way to follow a plan; the planning preset's when absent.
    pub following: Option<Following>,
    /// Period of the controller, ms.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub period_ms: f64,
}

impl ControlConfig {
    /// `[control]`.
    pub const SECTION: Section<Self> = of_config!(control, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut found = problems_of_ranges(self);
        found.extend(setup.built_controller().err().unwrap_or_default());
        found.extend(setup.problem_of_pedals());
        found
    }
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self { controller: None, params: toml::Table::new(), following: None, period_ms: 10.0 }
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
}

impl Default for LogConfig {
    fn default() -> Self {
        Self { sensors: Vec::new(), images: Images::default(), jpeg_quality: 85, foxglove: true }
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
    /// Name of this pipeline in scenarios: the planner, prefixed by `paper_` under that preset; `ros2` where another
    /// stack drives; the planner's kind for a custom one.
    pub fn pipeline_name(&self) -> String {
        if self.is_driven_over_ros2() {
            return "ros2".into();
        }
        let planner = self.operator.get("planner").and_then(|own| own.kind.as_deref());
        if let Some(kind) = planner.filter(|kind| *kind != "planner") {
            return kind.to_owned();
        }
        Self::name_of(self.planning.planner.as_str(), self.planning.preset)
    }

    fn name_of(planner: &str, preset: Preset) -> String {
        match preset {
            Preset::Paper => format!("paper_{planner}"),
            Preset::Best => planner.to_owned(),
        }
    }

    /// All values of [`pipeline_name`](Self::pipeline_name) for the built-in planners.
    pub fn pipeline_names() -> impl Iterator<Item = String> {
        let planners: Vec<&str> = Registry::standard().planners().collect();
        let of = |preset| planners.iter().map(|planner| Self::name_of(planner, preset)).collect::<Vec<_>>();
        [of(Preset::Best), of(Preset::Paper)].concat().into_iter()
    }

    /// The whole configuration including all defaults, as TOML.
    pub fn to_text(&self) -> String {
        toml::to_string(self).expect("a configuration is plain tables and values")
    }
}

#[cfg(test)]
mod tests;
