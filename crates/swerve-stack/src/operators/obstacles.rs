//! The obstacle sensor: simulator state cut by what the sensor can see.

use swerve_flow::{
    Context, Every, Inputs, Latest, Message, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port,
    PortInfo, Window,
};
use swerve_geom::Pose2;
use swerve_msg::truth::{Surroundings, WorldState};
use swerve_msg::{LocalPose, ObstacleList};
use swerve_sim::sense::{SensorMount, SensorParams, visible_obstacles};

use super::relative::{Motion, pose_at};
use crate::config::camera::CameraConfig;
use crate::config::{Config, Source};
use crate::kind::{Node, OperatorKind, Settings, span_of_ms};
use crate::site::Site;

/// What can be seen of the simulated world from one place.
pub struct ObstacleSight {
    mount: SensorMount,
    params: SensorParams,
}

impl ObstacleSight {
    /// What the obstacle sensor can see or, where `camera` is given, what that camera can.
    pub fn new(config: &Config, camera: Option<&CameraConfig>) -> Self {
        let (mut mount, mut params) = sight(config);
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

    /// What is seen, and from where.
    pub fn surroundings(&self, world: &WorldState) -> Surroundings {
        let ObstacleList { stamp, obstacles } = self.obstacles(world);
        Surroundings { stamp, ego: world.ego.state.pose, obstacles }
    }
}

/// Where the obstacle sensor sits, and the limits of its sight.
pub(super) fn sight(config: &Config) -> (SensorMount, SensorParams) {
    let sensing = &config.sensing;
    let mount = sensing.mount.unwrap_or_else(|| SensorMount::roof(&config.sim.vehicle.shape));
    let params = SensorParams {
        range_m: sensing.range_m,
        range_person_m: sensing.range_person_m,
        fov_rad: sensing.fov_deg.to_radians(),
        occlusion: sensing.source == Source::Truth,
    };
    (mount, params)
}

/// The newest state of the world, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// The sensor's period.
    tick: Every,
    /// What there is to be seen.
    world: Latest<WorldState>,
}

/// Poses kept to find those before the instant of a sighting.
const POSES: usize = 8;

/// The same for a tracker, and where the ego is by localization.
#[derive(Inputs)]
pub(super) struct PlacedIn {
    /// The sensor's period.
    tick: Every,
    /// What there is to be seen.
    world: Latest<WorldState>,
    /// Where the ego is; what is seen is placed by it.
    local: Option<Window<LocalPose, POSES>>,
}

/// What is seen, for an emulated detector: also from where.
#[derive(Outputs)]
pub(super) struct SightOut {
    /// What is seen.
    seen: Port<ObstacleList>,
    /// The same and the place of the ego.
    surroundings: Port<Surroundings>,
}

/// The obstacle sensor, for a tracker or for the emulated detector before it.
pub(super) struct ObstacleSensor;

/// For a tracker.
struct ForTracker(ObstacleSight);

/// For an emulated detector.
struct ForDetector(ObstacleSight);

/// Whether a detector is emulated, under settings that were checked.
fn has_detector(settings: &Settings<'_>) -> bool {
    settings.config.perception.emulates()
}

impl OperatorKind for ObstacleSensor {
    fn node(&self) -> Node {
        Node::sensor("obstacle_sensor", "simulator state cut by range, field of view and occlusion")
            .sections(&["sensing", "perception"])
            .origin()
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        if has_detector(settings) { SightOut::ports() } else { <Port<ObstacleList> as NamedOutputs>::ports() }
    }

    fn is_silent(&self, settings: &Settings<'_>, output: &str) -> bool {
        // Who tracks is given what the detector finds.
        has_detector(settings) && output == "seen"
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if has_detector(settings) { In::ports() } else { PlacedIn::ports() }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let settings = site.settings();
        let timer = settings.drawn_timer(span_of_ms(settings.config.sensing.period_ms));
        let Some(emulated) = &site.resolved().detector else {
            let sensor = ForTracker(ObstacleSight::new(settings.config, None));
            return site.add(sensor, Some(timer));
        };
        let camera = settings.config.detector_camera(emulated.sensing);
        let sensor = ForDetector(ObstacleSight::new(settings.config, camera.as_ref()));
        site.add(sensor, Some(timer))
    }
}

impl Operator for ForTracker {
    type In = PlacedIn;
    type Out = Port<ObstacleList>;

    fn step(&mut self, _: &mut Context<'_>, input: &PlacedIn, out: &mut Self::Out) {
        let Some(world) = input.world.get() else { return };
        let Some(local) = &input.local else { return out.loan().send(self.0.obstacles(world)) };
        // Nothing has a place in the map before localization has found the ego's.
        if let Some(believed) = believed(local.get(), world) {
            let motion = Motion::of_sight(world.ego.state.pose, believed);
            out.loan().send(motion.obstacles(self.0.obstacles(world)));
        }
    }
}

/// The ego's pose by localization at a state of the world.
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
            let surroundings = self.0.surroundings(world);
            let Surroundings { stamp, ref obstacles, .. } = surroundings;
            out.seen.loan().send(ObstacleList { stamp, obstacles: obstacles.clone() });
            out.surroundings.loan().send(surroundings);
        }
    }
}
