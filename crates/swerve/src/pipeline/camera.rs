use std::sync::Arc;

use swerve_camera::{Camera, FrameMut, Outputs, View};
use swerve_core::Rng;
use swerve_flow::{Context, Every, Latest, Operator, Port};
use swerve_geom::{Ego, Transform};
use swerve_msg::block::Memory;
use swerve_msg::truth::WorldState;
use swerve_msg::{CameraInfo, Encoding, Image, Intrinsics, Pixels};

use super::stage::{Pool, SharedStage, StreamMemory, hides_ego, with};
use crate::config::Config;
use crate::config::camera::CameraConfig;
use crate::street::{EGO_INSTANCE, motion_of};

/// Of each port what its images hold, in the order of the ports.
const ENCODINGS: [Encoding; 4] =
    [Encoding::Rgb8, Encoding::DepthF32M, Encoding::ClassU8, Encoding::InstanceU32];

/// A camera on the ego: colour, depth, classes and instances, a port each.
pub(super) struct CameraOperator {
    stage: SharedStage,
    camera: Camera,
    ego_from_camera: Transform<Ego, swerve_geom::Camera>,
    info: CameraInfo,
    outputs: Outputs,
    /// It sits so close that the body would fill the image with what is no obstacle.
    hides_ego: bool,
    pools: [Pool<Image>; 4],
}

impl CameraOperator {
    pub(super) fn new(
        (name, camera): (&str, &CameraConfig),
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
        let pools = memory.map(Pool::new);
        let hides_ego = hides_ego(config.at_m, shape);
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
        for (k, image) in images.iter_mut().enumerate().filter(|(k, _)| wanted[*k]) {
            let make =
                |memory: Option<&dyn Memory>| Image::in_memory(memory, width_px, height_px, ENCODINGS[k]);
            let mut taken = self.pools[k].take(make);
            let free = Arc::get_mut(&mut taken).expect("a pool gives what nobody else holds");
            (free.stamp, free.camera) = (cx.stamp(), self.info);
            *image = Some(taken);
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
            let ego = &world.ego;
            let mut view = View::new(&self.camera, ego.map_from_ego * self.ego_from_camera);
            view.motion = motion_of(ego);
            view.frame = cx.stamp().ns() as u64;
            view.hidden_instance = self.hides_ego.then_some(EGO_INSTANCE);
            let rendered = with(&self.stage, |stage| {
                let (scene, renderer) = stage.of(world);
                renderer.render(scene, &view, frame)
            });
            if let Err(error) = rendered {
                // Sizes are the camera's own; what is left is a world whose numbers are no longer finite.
                return cx.stop_run(format!("camera {}: {error}", cx.name()));
            }
        }
        let [rgb, depth, semantic, instance] = images;
        let ports = [(rgb, &mut out.0), (depth, &mut out.1), (semantic, &mut out.2), (instance, &mut out.3)];
        for ((image, port), pool) in ports.into_iter().zip(&mut self.pools) {
            if let Some(mut image) = image {
                if let Some(Err(error)) = Arc::get_mut(&mut image).map(Image::seal) {
                    return cx.stop_run(format!("camera {}: {error}", cx.name()));
                }
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
