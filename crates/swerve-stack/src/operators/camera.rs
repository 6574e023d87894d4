//! Cameras on the ego.

use std::sync::{Arc, Mutex};

use swerve_camera::{Camera, FrameMut, Outputs, Renderer, View};
use swerve_core::{Rng, Span, Time};
use swerve_flow::{
    Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs as Ports, Port,
    PortInfo,
};
use swerve_geom::{Ego, Transform};
use swerve_msg::block::Memory;
use swerve_msg::truth::{EgoTruth, WorldState};
use swerve_msg::{CameraInfo, Encoding, Image, Intrinsics, Pixels};
use swerve_scene::Scene;

use crate::config::Config;
use crate::config::camera::{CameraConfig, Output};
use crate::kind::{Heavy, Node, OnItsWay, OperatorKind, Settings, span_of_ms};
use crate::site::Site;
use crate::stage::{Pool, SharedStage, Stage, StreamMemory, hides_ego, lock};
use crate::street::{EGO_INSTANCE, motion_of};

/// Cameras, `[camera.NAME]`: of the simulated world, or of a vehicle.
pub(super) struct Cameras;

/// The newest state of the world, at each frame.
#[derive(Inputs)]
struct In {
    /// The camera's period.
    tick: Every,
    /// What there is to be seen.
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
    /// Which actor is seen.
    instance: Port<Image>,
}

/// What lies between the stamp of what a camera, radar or lidar saw and its readers.
pub(super) fn on_its_way(settings: &Settings<'_>) -> Option<OnItsWay> {
    let (timing, period) = settings.config.sensor_timing(settings.name)?;
    let (after, frames) = (timing.visible_after(), timing.in_flight(period));
    (after > Span::ZERO).then_some(OnItsWay { after, frames })
}

impl OperatorKind for Cameras {
    fn node(&self) -> Node {
        Node::sensor("camera", "a camera on the ego: colour, depth, classes, identities")
            .named_section("camera")
            .heavy(Heavy::OnWallClock)
            .origin()
            .on_demand()
            .follows_from_world()
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        if settings.config.live.is_some() { <Port<Image> as NamedOutputs>::ports() } else { Out::ports() }
    }

    fn is_silent(&self, settings: &Settings<'_>, output: &str) -> bool {
        self.is_empty(settings, output).is_some()
    }

    fn is_empty(&self, settings: &Settings<'_>, output: &str) -> Option<String> {
        let camera = settings.config.camera.get(settings.name);
        let made: Vec<&str> =
            camera.map(|camera| camera.outputs.iter().map(|o| o.name()).collect()).unwrap_or_default();
        let is_made = settings.config.live.is_some() || made.contains(&output);
        (!is_made).then(|| format!("`camera.{}.outputs` has {} alone", settings.name, made.join(", ")))
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if settings.config.live.is_some() { Vec::new() } else { In::ports() }
    }

    fn on_its_way(&self, settings: &Settings<'_>) -> Option<OnItsWay> {
        if settings.config.live.is_some() { None } else { on_its_way(settings) }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        if site.config().live.is_some() {
            site.add_source::<Image>();
            return Ok(());
        }
        let memory = Output::ALL.map(|output| site.memory(output.name(), 1));
        let stage = site.stage();
        let settings = site.settings();
        let Some(camera) = settings.config.camera.get(settings.name) else {
            anyhow::bail!("camera.{}: there is no such table", settings.name);
        };
        let timer = settings.drawn_timer(span_of_ms(camera.period_ms));
        let operator = CameraOperator::new(settings.name, camera, settings.config, stage, memory)?;
        site.add(operator, Some(timer))
    }
}

/// Of each port what its images hold, in the order of the ports.
const ENCODINGS: [Encoding; 4] =
    [Encoding::Rgb8, Encoding::DepthF32M, Encoding::ClassU8, Encoding::InstanceU32];

/// The images of one instant, of those ports that have one.
type Images = [Option<Arc<Image>>; 4];

/// A camera on the ego: colour, depth, classes and instances, a port each.
struct CameraOperator {
    stage: SharedStage,
    eye: Arc<Eye>,
}

/// A camera, and the memory of its images.
struct Eye {
    camera: Camera,
    ego_from_camera: Transform<Ego, swerve_geom::Camera>,
    info: CameraInfo,
    outputs: Outputs,
    /// It sits so close that the body would fill the image with what is no obstacle.
    hides_ego: bool,
    pools: Mutex<[Pool<Image>; 4]>,
}

impl CameraOperator {
    fn new(
        name: &str,
        camera: &CameraConfig,
        config: &Config,
        stage: SharedStage,
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
        Ok(Self { stage, eye: Arc::new(eye) })
    }
}

impl Operator for CameraOperator {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(world) = input.world.get() else { return };
        let (stamp, ego, scene) = (cx.stamp(), world.ego.clone(), self.stage.scene_of(world));
        if let Err(error) = Renderer::check(&scene, &self.eye.view(stamp, &ego)) {
            // A world whose numbers are no longer finite.
            return cx.stop_run(format!("camera {}: {error}", cx.name()));
        }
        let ports = [&mut out.rgb, &mut out.depth, &mut out.semantic, &mut out.instance];
        let Some(workers) = cx.workers().filter(|_| self.stage.draws_at_once()) else {
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
        let (stage, eye) = (self.stage.clone(), self.eye.clone());
        workers.spawn(move || {
            let shot = eye.shoot(&stage, &scene, stamp, &ego);
            for (k, promise) in promises.into_iter().enumerate() {
                let Some(promise) = promise else { continue };
                match &shot {
                    Ok(images) => images[k].clone().map_or((), |image| promise.keep(image)),
                    Err(error) => promise.fail(error.as_str()),
                }
            }
        });
    }
}

impl Eye {
    /// Of each port whether it has images.
    fn wanted(&self) -> [bool; 4] {
        let Outputs { rgb, depth, semantic, instance } = self.outputs;
        [rgb, depth, semantic, instance]
    }

    /// Where it looks from, at an instant.
    fn view(&self, stamp: Time, ego: &EgoTruth) -> View<'_> {
        let mut view = View::new(&self.camera, ego.map_from_ego * self.ego_from_camera);
        view.motion = motion_of(ego);
        view.frame = stamp.ns() as u64;
        view.hidden_instance = self.hides_ego.then_some(EGO_INSTANCE);
        view
    }

    /// Draws the images of one instant.
    fn shoot(&self, stage: &Stage, scene: &Scene, stamp: Time, ego: &EgoTruth) -> Result<Images, String> {
        let mut images = self.blank(stamp);
        let [rgb, depth, semantic, instance] =
            images.each_mut().map(|image| image.as_mut().and_then(Arc::get_mut));
        let frame = FrameMut {
            rgb: rgb.and_then(bytes),
            depth_m: depth.and_then(|image| match &mut image.pixels {
                Pixels::DepthF32M(numbers) => Some(&mut numbers[..]),
                _ => None,
            }),
            semantic: semantic.and_then(bytes),
            instance: instance.and_then(|image| match &mut image.pixels {
                Pixels::InstanceU32(numbers) => Some(&mut numbers[..]),
                _ => None,
            }),
        };
        let drawn = stage.draw(|renderer| renderer.render(scene, &self.view(stamp, ego), frame));
        drawn.map_err(|error| error.to_string())?;
        let sealed = images.iter_mut().flatten().filter_map(Arc::get_mut).try_for_each(Image::seal);
        sealed?;
        let mut pools = lock(&self.pools);
        for (image, pool) in images.iter().zip(&mut *pools) {
            image.iter().for_each(|image| pool.keep(image));
        }
        drop(pools);
        Ok(images)
    }

    /// Memory for the images of one instant, which nobody else holds.
    fn blank(&self, stamp: Time) -> Images {
        let (width_px, height_px) = (self.camera.width_px() as u32, self.camera.height_px() as u32);
        let mut images = Images::default();
        let mut pools = lock(&self.pools);
        for (k, image) in images.iter_mut().enumerate().filter(|(k, _)| self.wanted()[*k]) {
            let make =
                |memory: Option<&dyn Memory>| Image::in_memory(memory, width_px, height_px, ENCODINGS[k]);
            let mut taken = pools[k].take(make);
            let free = Arc::get_mut(&mut taken).expect("a pool gives what nobody else holds");
            (free.stamp, free.camera) = (stamp, self.info);
            *image = Some(taken);
        }
        images
    }
}

fn bytes(image: &mut Image) -> Option<&mut [u8]> {
    match &mut image.pixels {
        Pixels::Rgb8(numbers) | Pixels::ClassU8(numbers) => Some(&mut numbers[..]),
        _ => None,
    }
}
