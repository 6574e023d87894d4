//! What belongs to one frame, gathered from a drive.

use std::collections::{BTreeMap, VecDeque};

use swerve_core::Span;
use swerve_flow::{Event, Observer};
use swerve_geom::{Ego, Lidar, Map, Point, Transform};
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{Image, Pixels, PointCloud};
use swerve_sim::sense::fixed_points;

/// World states that are kept: more than an image can take to be published.
const WORLDS: usize = 400;

/// One frame with all that is known of it.
pub(super) struct Sample<'a> {
    pub(super) rgb: &'a Image,
    pub(super) depth: &'a Image,
    pub(super) semantic: &'a Image,
    pub(super) instance: &'a Image,
    /// The newest turn of the lidar, if there is one.
    pub(super) cloud: Option<&'a PointCloud>,
    /// Its points, x, y, z and intensity, in the lidar's frame at the image's instant: the car's way since each was
    /// measured is taken out, by true poses.
    pub(super) points: Vec<[f32; 4]>,
    /// The actors that have pixels in the image, by identity.
    pub(super) objects: Vec<Object<'a>>,
}

/// An actor in an image.
pub(super) struct Object<'a> {
    pub(super) actor: &'a Actor,
    /// Left, top, right, bottom edge of its pixels; right and bottom are behind the last.
    pub(super) visible_px: [f64; 4],
    pub(super) pixels: usize,
    /// The same of its box, as far as it is in front of the camera, not cut by the image's edges.
    pub(super) whole_px: [f64; 4],
    /// Share of its fixed points within the image that nothing hides.
    pub(super) visible_share: f64,
    pub(super) camera_from_map: Transform<swerve_geom::Camera, Map>,
}

impl Object<'_> {
    /// `whole_px` within the image.
    pub(super) fn clipped_px(&self, image: &Image) -> [f64; 4] {
        let [left, top, right, bottom] = self.whole_px;
        let (width, height) = (f64::from(image.width_px), f64::from(image.height_px));
        [left.clamp(0.0, width), top.clamp(0.0, height), right.clamp(0.0, width), bottom.clamp(0.0, height)]
    }

    /// Share of its box that lies outside the image.
    pub(super) fn truncated(&self, image: &Image) -> f64 {
        let area = |[left, top, right, bottom]: [f64; 4]| (right - left) * (bottom - top);
        let whole = area(self.whole_px);
        if whole > 0.0 { (1.0 - area(self.clipped_px(image)) / whole).clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// Gathers samples as a drive goes on and hands each over as soon as it is whole.
pub(super) struct Collector<'a> {
    camera: String,
    lidar: Option<(String, Transform<Ego, Lidar>)>,
    worlds: VecDeque<WorldState>,
    images: BTreeMap<&'static str, Image>,
    cloud: Option<PointCloud>,
    write: &'a mut (dyn FnMut(&Sample<'_>) -> anyhow::Result<()> + Send),
    failure: Option<anyhow::Error>,
}

impl<'a> Collector<'a> {
    pub(super) fn new(
        camera: &str,
        lidar: Option<(String, Transform<Ego, Lidar>)>,
        write: &'a mut (dyn FnMut(&Sample<'_>) -> anyhow::Result<()> + Send),
    ) -> Self {
        Self {
            camera: camera.to_owned(),
            lidar,
            worlds: VecDeque::new(),
            images: BTreeMap::new(),
            cloud: None,
            write,
            failure: None,
        }
    }

    /// # Errors
    /// The first sample that could not be written.
    pub(super) fn finish(self) -> anyhow::Result<()> {
        self.failure.map_or(Ok(()), Err)
    }

    fn image(&mut self, image: &Image) {
        let name = match image.pixels {
            Pixels::Rgb8(_) => "rgb",
            Pixels::DepthF32M(_) => "depth",
            Pixels::ClassU8(_) => "semantic",
            Pixels::InstanceU32(_) => "instance",
        };
        self.images.insert(name, image.clone());
        let all = ["rgb", "depth", "semantic", "instance"].map(|name| self.images.get(name));
        let [Some(rgb), Some(depth), Some(semantic), Some(instance)] = all else { return };
        if [depth, semantic, instance].iter().any(|other| other.stamp != rgb.stamp) {
            return;
        }
        let Some(world) = self.worlds.iter().rev().find(|world| world.stamp <= rgb.stamp) else { return };
        let objects = objects(instance, depth, world);
        let cloud = self.cloud.as_ref();
        let points = match (cloud, &self.lidar) {
            (Some(cloud), Some((_, ego_from_lidar))) => still(cloud, ego_from_lidar, &self.worlds, world),
            _ => Vec::new(),
        };
        let sample = Sample { rgb, depth, semantic, instance, cloud, points, objects };
        self.failure = (self.write)(&sample).err();
        self.images.clear();
    }
}

impl Observer for Collector<'_> {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload.map(|p| p.as_any()) else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.worlds.push_back(world.clone());
            if self.worlds.len() > WORLDS {
                self.worlds.pop_front();
            }
        } else if let Some(cloud) = payload.downcast_ref::<PointCloud>() {
            if self.lidar.as_ref().is_some_and(|(name, _)| name == publication.operator) {
                self.cloud = Some(cloud.clone());
            }
        } else if let Some(image) = payload.downcast_ref::<Image>()
            && publication.operator == self.camera
            && self.failure.is_none()
        {
            self.image(image);
        }
    }
}

/// The points of a turn in the lidar's frame at the instant of `now`.
fn still(
    cloud: &PointCloud,
    ego_from_lidar: &Transform<Ego, Lidar>,
    worlds: &VecDeque<WorldState>,
    now: &WorldState,
) -> Vec<[f32; 4]> {
    let lidar_from_map = (now.ego.map_from_ego * *ego_from_lidar).inverse();
    let place = |k: usize| {
        let at = cloud.stamp + Span::from_secs(f64::from(cloud.time_offset_s[k]));
        let after = worlds.partition_point(|world| world.stamp <= at);
        let world = worlds.get(after.saturating_sub(1)).unwrap_or(now);
        let measured = [cloud.x_m[k], cloud.y_m[k], cloud.z_m[k]].map(f64::from);
        let in_ego = *ego_from_lidar * Point::new(measured[0], measured[1], measured[2]);
        let since_s = (at - world.stamp).as_secs();
        let in_map = (world.ego.map_from_ego * in_ego).coords + world.ego.velocity_mps.coords * since_s;
        let p = (lidar_from_map * Point::new(in_map.x, in_map.y, in_map.z)).coords;
        [p.x as f32, p.y as f32, p.z as f32, cloud.intensity[k]]
    };
    (0..cloud.len()).map(place).collect()
}

/// The actors with at least one pixel.
fn objects<'a>(image: &Image, depth: &Image, world: &'a WorldState) -> Vec<Object<'a>> {
    let (Pixels::InstanceU32(ids), Pixels::DepthF32M(depths)) = (&image.pixels, &depth.pixels) else {
        return Vec::new();
    };
    let width = image.width_px as usize;
    let mut seen: BTreeMap<u32, ([usize; 4], usize)> = BTreeMap::new();
    for (row, ids) in ids.chunks_exact(width.max(1)).enumerate() {
        for (column, id) in ids.iter().enumerate().filter(|(_, id)| **id != 0) {
            let (edges, count) = seen.entry(*id).or_insert(([column, row, column, row], 0));
            *edges = [edges[0].min(column), edges[1], edges[2].max(column), row];
            *count += 1;
        }
    }
    let camera_from_map = (world.ego.map_from_ego * image.camera.ego_from_camera).inverse();
    let object = |actor: &'a Actor| {
        let &([left, top, right, bottom], pixels) = seen.get(&actor.id.0)?;
        let visible_px = [left as f64, top as f64, right as f64 + 1.0, bottom as f64 + 1.0];
        let whole_px = whole(actor, image, &camera_from_map).unwrap_or(visible_px);
        let visible_share = share(actor, (ids, depths), image, &camera_from_map);
        Some(Object { actor, visible_px, pixels, whole_px, visible_share, camera_from_map })
    };
    world.actors.iter().filter_map(object).collect()
}

/// Where a point of the map appears, and whether it is in front of the camera.
fn project(
    image: &Image,
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
    point: Point<Map>,
) -> Option<[f64; 2]> {
    let p = (*camera_from_map * point).coords;
    let k = &image.camera.intrinsics;
    (p.z > 0.1).then(|| [k.fx_px * p.x / p.z + k.cx_px, k.fy_px * p.y / p.z + k.cy_px])
}

/// The eight corners of an actor's box.
fn corners(actor: &Actor) -> [Point<Map>; 8] {
    let ground = actor.footprint().corners();
    core::array::from_fn(|k| {
        let up_m = if k < 4 { 0.0 } else { actor.extent.height_m };
        Point::new(ground[k % 4].x_m, ground[k % 4].y_m, actor.z_m + up_m)
    })
}

/// The edges of the box's picture; none if part of it is behind the camera.
fn whole(
    actor: &Actor,
    image: &Image,
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
) -> Option<[f64; 4]> {
    let nothing = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    corners(actor).into_iter().try_fold(nothing, |[left, top, right, bottom], corner| {
        let [x, y] = project(image, camera_from_map, corner)?;
        Some([left.min(x), top.min(y), right.max(x), bottom.max(y)])
    })
}

/// Of the fixed points of truth sensing that fall into the image, the share that nothing else hides: their pixel is
/// the actor's own, or no nearer than the actor.
fn share(
    actor: &Actor,
    (ids, depths): (&[u32], &[f32]),
    image: &Image,
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
) -> f64 {
    let reach_m = 0.5 * actor.extent.length_m.max(actor.extent.width_m);
    let (mut inside, mut free) = (0, 0);
    for point in fixed_points(actor) {
        let Some([x, y]) = project(image, camera_from_map, point) else { continue };
        if !(0.0..f64::from(image.width_px)).contains(&x) || !(0.0..f64::from(image.height_px)).contains(&y) {
            continue;
        }
        let pixel = y as usize * image.width_px as usize + x as usize;
        let depth_m = f64::from(depths.get(pixel).copied().unwrap_or(f32::INFINITY));
        let hidden = depth_m < (*camera_from_map * point).coords.z - reach_m;
        inside += 1;
        free += i32::from(!hidden || ids.get(pixel) == Some(&actor.id.0));
    }
    if inside == 0 { 1.0 } else { f64::from(free) / f64::from(inside) }
}
