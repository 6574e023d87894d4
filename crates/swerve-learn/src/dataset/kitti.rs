//! Samples in the layout of the KITTI object benchmark (Geiger, Lenz, Urtasun: "Are we ready for autonomous driving?",
//! CVPR 2012), with depth, classes and instances as in its depth and semantics benchmarks.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use swerve_geom::{Ego, Lidar, Point, Transform, Vector, math};
use swerve_msg::{ActorKind, Image, Pixels};
use swerve_report::files::{write_png, write_whole};
use swerve_scene::SemanticClass;
use swerve_stack::config::camera::CameraConfig;

use super::sample::{Object, Sample};

/// Minimum number of pixels of a labelled object.
pub(super) const PIXELS_MIN: usize = 10;
/// Visible shares of an object: at least the first is not occluded, below the second is largely occluded.
const OCCLUSION: [f64; 2] = [0.8, 0.4];

/// Writes `image_2`, `label_2`, `calib`, `velodyne`, `depth`, `semantic` and `instance`; points as x, y, z, intensity.
///
/// The folders are created with the first sample: a call that ends earlier leaves an empty folder, which the next call
/// accepts.
pub(super) struct Kitti {
    folder: PathBuf,
    folders: Vec<&'static str>,
    calibration: String,
}

impl Kitti {
    pub(super) fn new(
        folder: &Path,
        camera: &CameraConfig,
        ego_from_lidar: Option<Transform<Ego, Lidar>>,
    ) -> anyhow::Result<Self> {
        let mut folders = vec!["image_2", "label_2", "calib", "depth", "semantic", "instance"];
        folders.extend(ego_from_lidar.is_some().then_some("velodyne"));
        let calibration = calibration(camera, ego_from_lidar)?;
        Ok(Self { folder: folder.to_owned(), folders, calibration })
    }

    pub(super) fn add(&mut self, name: &str, sample: &Sample<'_>) -> anyhow::Result<()> {
        for name in self.folders.drain(..) {
            let path = self.folder.join(name);
            std::fs::create_dir_all(&path).with_context(|| format!("making {}", path.display()))?;
        }
        let file = |folder: &str, ending: &str| self.folder.join(folder).join(format!("{name}.{ending}"));
        let rgb = sample.rgb;
        let colour = (png::ColorType::Rgb, png::BitDepth::Eight);
        write_png(&file("image_2", "png"), (rgb.width_px, rgb.height_px), colour, rgb.pixels.bytes())?;
        grey(&file("depth", "png"), sample.depth, &depth(sample.depth))?;
        grey(&file("semantic", "png"), sample.semantic, sample.semantic.pixels.bytes())?;
        let instances = instances(sample.semantic, sample.instance);
        grey(&file("instance", "png"), sample.instance, &instances)?;
        let seen = sample.objects.iter().filter(|object| object.pixels >= PIXELS_MIN);
        let labels: String = seen.map(|object| label(object, sample.rgb)).collect();
        write_whole(&file("label_2", "txt"), labels.as_bytes())?;
        write_whole(&file("calib", "txt"), self.calibration.as_bytes())?;
        if sample.cloud.is_none() {
            return Ok(());
        }
        let bytes: Vec<u8> = sample.points.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
        write_whole(&file("velodyne", "bin"), &bytes)
    }
}

/// One label line: type, truncated, occluded, alpha, image box, height, width, length, position, rotation.
fn label(object: &Object<'_>, image: &Image) -> String {
    let actor = object.actor;
    let kind = match actor.kind {
        ActorKind::Car if actor.extent.height_m > 2.0 => "Van",
        ActorKind::Car => "Car",
        ActorKind::Truck => "Truck",
        ActorKind::Pedestrian => "Pedestrian",
        ActorKind::Cyclist => "Cyclist",
        ActorKind::Motorcycle | ActorKind::Static => "Misc",
    };
    let occluded = OCCLUSION.iter().filter(|share| object.visible_share < **share).count();
    let place = (object.camera_from_map * Point::new(actor.pose.x_m, actor.pose.y_m, actor.z_m)).coords;
    let (sin, cos) = math::sin_cos(actor.pose.heading_rad);
    let ahead = (object.camera_from_map * Vector::new(cos, sin, 0.0)).coords;
    // Rotation about the camera's y axis, which points down; 0 is along x, to the right.
    let turn_rad = math::atan2(-ahead.z, ahead.x);
    let alpha_rad = swerve_geom::wrap_angle(turn_rad - math::atan2(place.x, place.z));
    let [left, top, right, bottom] = object.clipped_px(image);
    let extent = actor.extent;
    format!(
        "{kind} {:.2} {occluded} {alpha_rad:.2} {left:.2} {top:.2} {right:.2} {bottom:.2} {:.2} {:.2} {:.2} {:.2} {:.2} {:.2} {turn_rad:.2}\n",
        object.truncated(image),
        extent.height_m,
        extent.width_m,
        extent.length_m,
        place.x,
        place.y,
        place.z,
    )
}

/// Projection and frames in the format of the benchmark's `calib` files.
fn calibration(
    camera: &CameraConfig,
    ego_from_lidar: Option<Transform<Ego, Lidar>>,
) -> anyhow::Result<String> {
    let (fx, fy, cx, cy) = camera.camera(0)?.focal_px();
    let projection = format!("{fx:e} 0 {cx:e} 0 0 {fy:e} {cy:e} 0 0 0 1 0");
    let mut text: String = (0..4).map(|k| format!("P{k}: {projection}\n")).collect();
    text += "R0_rect: 1 0 0 0 1 0 0 0 1\n";
    let camera_from_ego = camera.ego_from_camera().inverse();
    let camera_from_lidar = match ego_from_lidar {
        Some(ego_from_lidar) => rows(|p| camera_from_ego * (ego_from_lidar * p)),
        None => rows(|p: Point<Ego>| camera_from_ego * p),
    };
    text += &format!("Tr_velo_to_cam: {camera_from_lidar}\n");
    Ok(text + "Tr_imu_to_velo: 1 0 0 0 0 1 0 0 0 0 1 0\n")
}

/// A transform as three rows of four numbers.
fn rows<From>(to_camera: impl Fn(Point<From>) -> Point<swerve_geom::Camera>) -> String {
    let origin = to_camera(Point::new(0.0, 0.0, 0.0)).coords;
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let columns = axes.map(|[x, y, z]| to_camera(Point::new(x, y, z)).coords - origin);
    let row = |k: usize| {
        let [a, b, c] = [&columns[0], &columns[1], &columns[2]].map(|column| column[k]);
        format!("{a:e} {b:e} {c:e} {:e}", origin[k])
    };
    [row(0), row(1), row(2)].join(" ")
}

/// Depth in units of 1/256 m, 0 if missing or at least 255.99 m; big-endian as in PNG.
fn depth(image: &Image) -> Vec<u8> {
    let Pixels::DepthF32M(depths) = &image.pixels else { return Vec::new() };
    let code = |depth_m: &f32| if *depth_m < 255.99 { (depth_m * 256.0).round() as u16 } else { 0 };
    depths.iter().flat_map(|depth_m| code(depth_m).to_be_bytes()).collect()
}

/// 256 times the class, plus the lowest eight bits of the instance.
fn instances(semantic: &Image, instance: &Image) -> Vec<u8> {
    let (Pixels::ClassU8(classes), Pixels::InstanceU32(ids)) = (&semantic.pixels, &instance.pixels) else {
        return Vec::new();
    };
    let sky = SemanticClass::Sky as u8;
    let code = |(class, id): (&u8, &u32)| if *class == sky { [*class, 0] } else { [*class, *id as u8] };
    classes.iter().zip(ids.iter()).flat_map(code).collect()
}

/// Writes a grey image of 8 bits, or of 16 bits if there are two bytes per pixel.
fn grey(path: &Path, image: &Image, bytes: &[u8]) -> anyhow::Result<()> {
    let pixels = image.width_px as usize * image.height_px as usize;
    let depth = if bytes.len() == 2 * pixels { png::BitDepth::Sixteen } else { png::BitDepth::Eight };
    write_png(path, (image.width_px, image.height_px), (png::ColorType::Grayscale, depth), bytes)
}
