//! Cameras on the ego.

use std::sync::{Arc, Mutex};

use swerve_camera::Renderer;
use swerve_core::{Rng, Span};
use swerve_flow::{
    Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs as Ports, Port,
    PortInfo,
};
use swerve_msg::truth::WorldState;
use swerve_msg::{CameraInfo, Image, Intrinsics};

use crate::config::Config;
use crate::config::camera::{CameraConfig, Output};
use crate::config::execution::span_of_ms;
use crate::kind::{Heavy, Node, OnItsWay, OperatorKind, Settings};
use crate::shot::{Eye, Shot, Shots};
use crate::site::Site;
use crate::stage::{Pool, SharedStage, StreamMemory, hides_ego};

/// Cameras, `[camera.NAME]`: of the simulated world, or of a vehicle.
pub(super) struct Cameras;

/// The newest state of the world, at each frame.
#[derive(Inputs)]
struct In {
    /// Period of the camera.
    tick: Every,
    /// State of the world to render.
    world: Latest<WorldState>,
}

/// The images of one instant.
#[derive(Ports)]
struct Out {
    /// Colour.
    rgb: Port<Image>,
    /// Distance along the optical axis, metres.
    depth: Port<Image>,
    /// Cityscapes ids.
    semantic: Port<Image>,
    /// Identity of the actor at each pixel.
    instance: Port<Image>,
}

/// Latency from the stamp of a camera, radar or lidar to its readers.
pub(super) fn on_its_way(settings: &Settings<'_>) -> Option<OnItsWay> {
    let (timing, period) = settings.setup.sensor_timing(settings.name)?;
    let (after, frames) = (timing.visible_after(), timing.in_flight(period));
    (after > Span::ZERO).then_some(OnItsWay { after, frames })
}

impl OperatorKind for Cameras {
    fn node(&self) -> Node {
        Node::sensor("camera", "a camera on the ego: colour, depth, classes, identities")
            .section(&CameraConfig::SECTION)
            .heavy(Heavy::OnWallClock)
            .origin()
            .on_demand()
            .follows_from_world()
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        if settings.setup.live.is_some() { <Port<Image> as NamedOutputs>::ports() } else { Out::ports() }
    }

    fn is_silent(&self, settings: &Settings<'_>, output: &str) -> bool {
        self.is_empty(settings, output).is_some()
    }

    fn is_empty(&self, settings: &Settings<'_>, output: &str) -> Option<String> {
        let camera = settings.setup.camera.get(settings.name);
        let made: Vec<&str> =
            camera.map(|camera| camera.outputs.iter().map(|o| o.name()).collect()).unwrap_or_default();
        let is_made = settings.setup.live.is_some() || made.contains(&output);
        (!is_made).then(|| format!("`camera.{}.outputs` has {} alone", settings.name, made.join(", ")))
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if settings.setup.live.is_some() { Vec::new() } else { In::ports() }
    }

    fn on_its_way(&self, settings: &Settings<'_>) -> Option<OnItsWay> {
        if settings.setup.live.is_some() { None } else { on_its_way(settings) }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        if site.config().live.is_some() {
            site.add_source::<Image>();
            return Ok(());
        }
        let memory = Output::ALL.map(|output| site.memory(output.name(), 1));
        let shared = (site.stage(), site.shots());
        let settings = site.settings();
        let Some(camera) = settings.setup.camera.get(settings.name) else {
            anyhow::bail!("camera.{}: there is no such table", settings.name);
        };
        let timer = settings.drawn_timer(span_of_ms(camera.period_ms));
        let operator = CameraOperator::new(settings.name, camera, settings.setup, shared, memory)?;
        site.add(operator, Some(timer))
    }
}

/// A camera on the ego: colour, depth, classes and instances, a port each.
struct CameraOperator {
    stage: SharedStage,
    shots: Arc<Shots>,
    eye: Arc<Eye>,
}

impl CameraOperator {
    fn new(
        name: &str,
        camera: &CameraConfig,
        config: &Config,
        (stage, shots): (SharedStage, Arc<Shots>),
        memory: [StreamMemory; 4],
    ) -> anyhow::Result<Self> {
        let (seed, config, shape) = (config.seed, camera, &config.sim.vehicle.shape);
        let camera = config.camera(Rng::keyed(seed, name, &[]).bits())?;
        let ego_from_camera = config.ego_from_camera();
        let (fx_px, fy_px, cx_px, cy_px) = camera.focal_px();
        let distortion = config.distortion.coefficients();
        let is_parallel = camera.is_orthographic();
        let intrinsics = Intrinsics { fx_px, fy_px, cx_px, cy_px, distortion, is_parallel };
        let info = CameraInfo { intrinsics, ego_from_camera };
        let pools = Mutex::new(memory.map(Pool::new));
        let hides_ego = hides_ego(config.at_m, shape);
        let eye = Eye { camera, ego_from_camera, info, outputs: config.wanted(), hides_ego, pools };
        Ok(Self { stage, shots, eye: Arc::new(eye) })
    }
}

impl Operator for CameraOperator {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(world) = input.world.get() else { return };
        let (stamp, ego, scene) = (cx.stamp(), world.ego.clone(), self.stage.scene_of(world));
        if let Err(error) = Renderer::check(&scene, &self.eye.view(stamp, &ego)) {
            // A world with non-finite numbers.
            return cx.stop_run(format!("camera {}: {error}", cx.name()));
        }
        let ports = [&mut out.rgb, &mut out.depth, &mut out.semantic, &mut out.instance];
        let Some(workers) = cx.workers() else {
            match self.eye.shoot(&self.stage, &scene, stamp, &ego) {
                Ok(images) => {
                    for (image, port) in images.into_iter().zip(ports) {
                        image.into_iter().for_each(|image| port.forward(image));
                    }
                }
                Err(error) => cx.stop_run(format!("camera {}: {error}", cx.name())),
            }
            return;
        };
        let mut wanted = self.eye.wanted().into_iter();
        let promises = ports.map(|port| (wanted.next() == Some(true)).then(|| workers.promise(port)));
        Shot { eye: self.eye.clone(), scene, stamp, ego, promises }.leave(&self.stage, &self.shots, workers);
    }
}
