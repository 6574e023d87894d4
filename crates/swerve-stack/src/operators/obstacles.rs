//! Obstacle sensor: simulator state limited by what the sensor can see.

use swerve_flow::{
    Context, Every, Inputs, Latest, Message, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port,
    PortInfo, Window,
};
use swerve_geom::Pose2;
use swerve_msg::truth::{Surroundings, WorldState};
use swerve_msg::{LocalPose, ObstacleList};
use swerve_sim::sense::{SensorMount, SensorParams, visible_obstacles};
use swerve_vehicle::Shape;

use super::relative::{Motion, pose_at};
use crate::config::camera::CameraConfig;
use crate::config::execution::span_of_ms;
use crate::config::perception::PerceptionConfig;
use crate::config::{Config, SensingConfig, Source};
use crate::kind::{Node, OperatorKind, Settings};
use crate::site::Site;
use crate::unseen::Unseen;

/// Visibility of the simulated world from one mount.
pub struct ObstacleSight {
    mount: SensorMount,
    params: SensorParams,
}

impl ObstacleSight {
    /// Visibility for the obstacle sensor or, if given, for `camera`.
    pub fn new(config: &Config, camera: Option<&CameraConfig>) -> Self {
        let (mut mount, mut params) = sight(&config.sensing, &config.sim.vehicle.shape);
        if let Some(camera) = camera {
            let ([x_m, y_m, z_m], yaw_rad) = (camera.at_m, camera.yaw_deg.to_radians());
            mount = SensorMount { x_m, y_m, z_m, yaw_rad };
            params.fov_rad = camera.fov_across_deg().to_radians();
        }
        Self { mount, params }
    }

    fn obstacles(&self, world: &WorldState) -> ObstacleList {
        visible_obstacles(world, &self.mount, &self.params)
    }

    /// Visible objects, with the pose of the ego.
    pub fn surroundings(&self, world: &WorldState) -> Surroundings {
        let ObstacleList { stamp, obstacles } = self.obstacles(world);
        Surroundings { stamp, ego: world.ego.state.pose, obstacles }
    }
}

/// Mount of the obstacle sensor, and its limits.
pub(super) fn sight(sensing: &SensingConfig, shape: &Shape) -> (SensorMount, SensorParams) {
    let mount = sensing.mount.unwrap_or_else(|| SensorMount::roof(shape));
    let params = SensorParams {
        range_m: sensing.range_m,
        range_person_m: sensing.range_person_m,
        fov_rad: sensing.fov_deg.to_radians(),
        occlusion: sensing.source == Source::Truth,
    };
    (mount, params)
}

/// Newest state of the world, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the sensor.
    tick: Every,
    /// State of the world to measure.
    world: Latest<WorldState>,
}

/// Poses kept to find those before an observation.
const POSES: usize = 8;

/// The same for a tracker, with localized poses.
#[derive(Inputs)]
pub(super) struct PlacedIn {
    /// Period of the sensor.
    tick: Every,
    /// State of the world to measure.
    world: Latest<WorldState>,
    /// Localized poses of the ego, by which objects are placed.
    local: Option<Window<LocalPose, POSES>>,
}

/// Visible objects for an emulated detector, also with the pose of the ego.
#[derive(Outputs)]
pub(super) struct SightOut {
    /// Visible objects.
    seen: Port<ObstacleList>,
    /// Visible objects and the pose of the ego.
    surroundings: Port<Surroundings>,
}

/// The obstacle sensor, for a tracker or for the emulated detector before it.
pub(super) struct ObstacleSensor;

/// Obstacle sensor for a tracker.
struct ForTracker(ObstacleSight, Unseen);

/// Obstacle sensor for an emulated detector.
struct ForDetector(ObstacleSight, Unseen);

/// Returns true if a detector is emulated, under checked settings.
fn has_detector(settings: &Settings<'_>) -> bool {
    settings.setup.perception.emulates()
}

impl OperatorKind for ObstacleSensor {
    fn node(&self) -> Node {
        Node::sensor("obstacle_sensor", "simulator state cut by range, field of view and occlusion")
            .section(&SensingConfig::SECTION)
            .section(&PerceptionConfig::SECTION)
            .origin()
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        if has_detector(settings) { SightOut::ports() } else { <Port<ObstacleList> as NamedOutputs>::ports() }
    }

    fn is_silent(&self, settings: &Settings<'_>, output: &str) -> bool {
        // Trackers read the detector's boxes instead.
        has_detector(settings) && output == "seen"
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if has_detector(settings) { In::ports() } else { PlacedIn::ports() }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let settings = site.settings();
        let timer = settings.drawn_timer(span_of_ms(settings.setup.sensing.period_ms));
        let unseen = Unseen::new(&settings.setup.sensing, &site.surroundings().scenario)?;
        let Some(emulated) = &site.resolved().detector else {
            let sensor = ForTracker(ObstacleSight::new(settings.setup, None), unseen);
            return site.add(sensor, Some(timer));
        };
        let camera = settings.setup.detector_camera(emulated.sensing);
        let sensor = ForDetector(ObstacleSight::new(settings.setup, camera.as_ref()), unseen);
        site.add(sensor, Some(timer))
    }
}

impl Operator for ForTracker {
    type In = PlacedIn;
    type Out = Port<ObstacleList>;

    fn step(&mut self, _: &mut Context<'_>, input: &PlacedIn, out: &mut Self::Out) {
        let Some(world) = input.world.get() else { return };
        let world = &*self.1.seen(world);
        let Some(local) = &input.local else { return out.loan().send(self.0.obstacles(world)) };
        // Objects have no position in the map before the ego is localized.
        if let Some(believed) = believed(local.get(), world) {
            let motion = Motion::of_sight(world.ego.state.pose, believed);
            out.loan().send(motion.obstacles(self.0.obstacles(world)));
        }
    }
}

/// Localized pose of the ego at a state of the world.
fn believed(local: &[Message<LocalPose>], world: &WorldState) -> Option<Pose2> {
    let mut before = local.iter().rev().filter(|local| local.stamp < world.stamp);
    let newest = **before.next()?;
    Some(pose_at(world.stamp, before.next().map_or(newest, |local| **local), newest))
}

impl Operator for ForDetector {
    type In = In;
    type Out = SightOut;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut SightOut) {
        if let Some(world) = input.world.get() {
            let surroundings = self.0.surroundings(&self.1.seen(world));
            let Surroundings { stamp, ref obstacles, .. } = surroundings;
            out.seen.loan().send(ObstacleList { stamp, obstacles: obstacles.clone() });
            out.surroundings.loan().send(surroundings);
        }
    }
}
