use std::sync::{Arc, Mutex, PoisonError};

use swerve_core::{Rng, Time};
use swerve_flow::{Context, Every, Latest, Operator, Port};
use swerve_geom::{Ego, Transform};
use swerve_msg::truth::WorldState;
use swerve_msg::{CameraInfo, Encoding, Image, Intrinsics, Pixels};
use swerve_render::{Camera, FrameMut, Motion, Outputs, RenderOptions, Renderer, View};
use swerve_scenario::Scenario;

use crate::config::Config;
use crate::config::camera::CameraConfig;
use crate::street::{EGO_INSTANCE, Street};

/// What all cameras of a run share: the world as it looks, and the renderer with all that it keeps.
///
/// It makes nothing depend on who asks first: images are a function of the world's state.
pub(super) struct Stage {
    street: Street,
    renderer: Renderer,
    /// The state that the street shows.
    shown: Option<Time>,
}

impl Stage {
    pub(super) fn new(config: &Config, scenario: &Scenario) -> anyhow::Result<Arc<Mutex<Self>>> {
        let render = &config.render;
        let street = Street::new(scenario, &config.sim.vehicle.shape, render.weather, config.seed);
        let options = RenderOptions { threads: render.threads, ..RenderOptions::default() };
        Ok(Arc::new(Mutex::new(Self { street, renderer: Renderer::new(options)?, shown: None })))
    }
}

/// A camera on the ego: colour, depth, classes and instances, a port each.
pub(super) struct CameraOperator {
    stage: Arc<Mutex<Stage>>,
    camera: Camera,
    ego_from_camera: Transform<Ego, swerve_geom::Camera>,
    info: CameraInfo,
    outputs: Outputs,
    /// It sits so close that the body would fill the image with what is no obstacle.
    hides_ego: bool,
    pools: [Pool; 4],
}

/// From farther off than this a camera sees the car that carries it, metres from its outline.
const CLOSE_M: f64 = 0.5;

impl CameraOperator {
    pub(super) fn new(
        (name, camera): (&str, &CameraConfig),
        config: &Config,
        stage: Arc<Mutex<Stage>>,
    ) -> anyhow::Result<Self> {
        let (seed, config, shape) = (config.seed, camera, &config.sim.vehicle.shape);
        let camera = config.camera(Rng::keyed(seed, name, &[]).bits())?;
        let ego_from_camera = config.ego_from_camera();
        let (fx_px, fy_px, cx_px, cy_px) = camera.focal_px();
        let distortion = config.distortion.coefficients();
        let intrinsics = Intrinsics { fx_px, fy_px, cx_px, cy_px, distortion };
        let info = CameraInfo { intrinsics, ego_from_camera };
        let pools =
            [Encoding::Rgb8, Encoding::DepthF32M, Encoding::ClassU8, Encoding::InstanceU32].map(Pool::new);
        let [x, y, z] = config.at_m;
        let along_m = (x - shape.center_ahead_m()).abs() - 0.5 * shape.length_m;
        let across_m = y.abs() - 0.5 * shape.width_m;
        let hides_ego = along_m.max(across_m).max(z - shape.height_m) < CLOSE_M;
        Ok(Self { stage, camera, ego_from_camera, info, outputs: config.wanted(), hides_ego, pools })
    }
}

impl Operator for CameraOperator {
    type In = (Every, Latest<WorldState>);
    type Out = (Port<Image>, Port<Image>, Port<Image>, Port<Image>);

    fn step(&mut self, cx: &mut Context<'_>, (_, world): &Self::In, out: &mut Self::Out) {
        let Some(world) = world.get() else { return };
        let (width_px, height_px) = (self.camera.width_px() as u32, self.camera.height_px() as u32);
        let wanted = [self.outputs.rgb, self.outputs.depth, self.outputs.semantic, self.outputs.instance];
        let mut images: [Option<Arc<Image>>; 4] = Default::default();
        for ((image, pool), wanted) in images.iter_mut().zip(&mut self.pools).zip(wanted) {
            *image = wanted.then(|| pool.take(width_px, height_px, cx.stamp(), self.info));
        }
        {
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
            let stage = &mut *self.stage.lock().unwrap_or_else(PoisonError::into_inner);
            if stage.shown != Some(world.stamp) {
                stage.street.show(world);
                stage.shown = Some(world.stamp);
            }
            let ego = &world.ego;
            let mut view = View::new(&self.camera, ego.map_from_ego * self.ego_from_camera);
            view.motion = Motion {
                linear_mps: ego.velocity_mps.coords.into(),
                angular_radps: (ego.map_from_ego * ego.angular_velocity_radps).coords.into(),
            };
            view.frame = cx.stamp().ns() as u64;
            view.hidden_instance = self.hides_ego.then_some(EGO_INSTANCE);
            if let Err(error) = stage.renderer.render(stage.street.scene(), &view, frame) {
                // Sizes are the camera's own; what is left is a world whose numbers are no longer finite.
                return cx.stop_run(format!("camera {}: {error}", cx.name()));
            }
        }
        let [rgb, depth, semantic, instance] = images;
        let ports = [(rgb, &mut out.0), (depth, &mut out.1), (semantic, &mut out.2), (instance, &mut out.3)];
        for ((image, port), pool) in ports.into_iter().zip(&mut self.pools) {
            if let Some(image) = image {
                pool.keep(&image);
                port.forward(image);
            }
        }
    }
}

fn bytes(image: &mut Image) -> Option<&mut [u8]> {
    match &mut image.pixels {
        Pixels::Rgb8(numbers) | Pixels::ClassU8(numbers) => Some(&mut numbers[..]),
        _ => None,
    }
}

/// Images that were published, to be used again once no reader holds them.
struct Pool {
    encoding: Encoding,
    lent: Vec<Arc<Image>>,
}

impl Pool {
    fn new(encoding: Encoding) -> Self {
        Self { encoding, lent: Vec::new() }
    }

    /// An image that nobody else holds.
    fn take(&mut self, width_px: u32, height_px: u32, stamp: Time, camera: CameraInfo) -> Arc<Image> {
        let free = self.lent.iter_mut().position(|image| Arc::get_mut(image).is_some());
        let mut image = match free {
            Some(index) => self.lent.swap_remove(index),
            None => Arc::new(Image::new(width_px, height_px, self.encoding)),
        };
        if let Some(image) = Arc::get_mut(&mut image) {
            (image.stamp, image.camera) = (stamp, camera);
        }
        image
    }

    fn keep(&mut self, image: &Arc<Image>) {
        self.lent.push(image.clone());
    }
}
