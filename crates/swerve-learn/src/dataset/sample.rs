//! One labelled frame, gathered from a drive.

use std::collections::BTreeMap;

use swerve_core::Span;
use swerve_flow::{Event, Observer};
use swerve_geom::{Ego, Lidar, Map, Point, Transform};
use swerve_measure::worlds::Worlds;
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{Image, Pixels, PointCloud};

/// Frame with its labels.
pub(super) struct Sample<'a> {
    pub(super) rgb: &'a Image,
    pub(super) depth: &'a Image,
    pub(super) semantic: &'a Image,
    pub(super) instance: &'a Image,
    /// Newest turn of the lidar, if there is one.
    pub(super) cloud: Option<&'a PointCloud>,
    /// Points of that turn, x, y, z and intensity, in the lidar's frame at the image's instant: the ego motion since
    /// each measurement is compensated, by true poses.
    pub(super) points: Vec<[f32; 4]>,
    /// Actors with pixels in the image, ordered by identity.
    pub(super) objects: Vec<Object<'a>>,
}

/// An actor in an image.
pub(super) struct Object<'a> {
    pub(super) actor: &'a Actor,
    /// Left, top, right and bottom edge of its pixels; right and bottom are exclusive.
    pub(super) visible_px: [f64; 4],
    pub(super) pixels: usize,
    /// Edges of its projected box, not clipped to the image; those of its pixels if part of the box is behind the
    /// camera.
    pub(super) whole_px: [f64; 4],
    /// Share of the pixels of its box within the image that nothing nearer covers.
    pub(super) visible_share: f64,
    pub(super) camera_from_map: Transform<swerve_geom::Camera, Map>,
}

impl Object<'_> {
    /// `whole_px` clipped to the image.
    pub(super) fn clipped_px(&self, image: &Image) -> [f64; 4] {
        let [left, top, right, bottom] = self.whole_px;
        let (width, height) = (f64::from(image.width_px), f64::from(image.height_px));
        [left.clamp(0.0, width), top.clamp(0.0, height), right.clamp(0.0, width), bottom.clamp(0.0, height)]
    }

    /// Share of its box outside the image.
    pub(super) fn truncated(&self, image: &Image) -> f64 {
        let area = |[left, top, right, bottom]: [f64; 4]| (right - left) * (bottom - top);
        let whole = area(self.whole_px);
        if whole > 0.0 { (1.0 - area(self.clipped_px(image)) / whole).clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// Gathers samples during a drive and writes each as soon as it is complete.
pub(super) struct Collector<'a> {
    camera: String,
    lidar: Option<(String, Transform<Ego, Lidar>)>,
    worlds: Worlds,
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
            worlds: Worlds::default(),
            images: BTreeMap::new(),
            cloud: None,
            write,
            failure: None,
        }
    }

    /// Ends the collection.
    ///
    /// # Errors
    /// If a sample could not be written; the first error is returned.
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
        let Some(world) = self.worlds.until(rgb.stamp) else { return };
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
        let Some(payload) = publication.payload else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.worlds.take(world);
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

/// Points of a turn in the lidar's frame at the instant of `now`.
fn still(
    cloud: &PointCloud,
    ego_from_lidar: &Transform<Ego, Lidar>,
    worlds: &Worlds,
    now: &WorldState,
) -> Vec<[f32; 4]> {
    let lidar_from_map = (now.ego.map_from_ego * *ego_from_lidar).inverse();
    let place = |k: usize| {
        let at = cloud.stamp + Span::from_secs(f64::from(cloud.time_offset_s[k]));
        let world = worlds.near(at).unwrap_or(now);
        let measured = [cloud.x_m[k], cloud.y_m[k], cloud.z_m[k]].map(f64::from);
        let in_ego = *ego_from_lidar * Point::new(measured[0], measured[1], measured[2]);
        let since_s = (at - world.stamp).as_secs();
        let in_map = (world.ego.map_from_ego * in_ego).coords + world.ego.velocity_mps.coords * since_s;
        let p = (lidar_from_map * Point::new(in_map.x, in_map.y, in_map.z)).coords;
        [p.x as f32, p.y as f32, p.z as f32, cloud.intensity[k]]
    };
    (0..cloud.len()).map(place).collect()
}

/// Actors with at least one pixel.
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
        let mut object = Object { actor, visible_px, pixels, whole_px, visible_share: 1.0, camera_from_map };
        object.visible_share = share(&object, (ids, depths), image);
        Some(object)
    };
    world.actors.iter().filter_map(object).collect()
}

/// Projects a map point to the image; `None` if it is not at least 0.1 m in front of the camera.
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

/// Edges of the projected box; `None` if part of it is behind the camera.
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

/// A pixel hides an actor if it is nearer than the nearest corner of its box by this much, metres.
const NEARER_M: f64 = 0.1;

/// Share of the pixels of an actor's box within the image that nothing nearer covers: neither a surface in front of the
/// box nor another actor in front of its centre.
fn share(object: &Object<'_>, (ids, depths): (&[u32], &[f32]), image: &Image) -> f64 {
    let (actor, camera_from_map) = (object.actor, &object.camera_from_map);
    let depth_m = |point: Point<Map>| (*camera_from_map * point).coords.z;
    let nearest_m = corners(actor).into_iter().map(depth_m).fold(f64::INFINITY, f64::min) - NEARER_M;
    let middle_m = depth_m(Point::new(actor.pose.x_m, actor.pose.y_m, actor.z_m));
    let [left, top, right, bottom] = object.clipped_px(image).map(|edge| edge.round() as usize);
    let width = image.width_px as usize;
    let is_hidden = |pixel: usize| {
        let (id, at_m) = (ids[pixel], f64::from(depths[pixel]));
        id != actor.id.0 && (at_m < nearest_m || id != 0 && at_m < middle_m)
    };
    let hidden = (top..bottom).flat_map(|row| (left..right).map(move |column| row * width + column));
    let hidden = hidden.filter(|pixel| is_hidden(*pixel)).count();
    let all = (right - left) * (bottom - top);
    if all == 0 { 1.0 } else { 1.0 - hidden as f64 / all as f64 }
}

#[cfg(test)]
mod tests {
    use swerve_geom::{Pose2, Vector2};
    use swerve_msg::{ActorId, ActorKind, CameraInfo, Extent, Intrinsics};

    use super::*;

    #[test]
    fn nearer_surfaces_hide_an_actor_by_the_pixel() {
        let intrinsics =
            Intrinsics { fx_px: 20.0, fy_px: 20.0, cx_px: 20.0, cy_px: 10.0, ..Intrinsics::default() };
        let camera = CameraInfo { intrinsics, ..CameraInfo::default() };
        let image = Image {
            stamp: Default::default(),
            width_px: 40,
            height_px: 20,
            camera,
            pixels: Pixels::default(),
        };
        let actor = |id, x_m| Actor {
            id: ActorId(id),
            kind: ActorKind::Car,
            pose: Pose2::new(x_m, 0.0, 0.0),
            z_m: -1.0,
            extent: Extent { length_m: 2.0, width_m: 4.0, height_m: 4.0 },
            velocity_mps: Vector2::default(),
        };
        let own = actor(7, 11.0);
        let camera_from_map =
            (Transform::<Map, Ego>::from_roll_pitch_yaw(Point::new(0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
                * camera.ego_from_camera)
                .inverse();
        let whole_px = whole(&own, &image, &camera_from_map).unwrap();
        // 4 m wide at a distance of 10 m, with a focal length of 20 px.
        assert_eq!(whole_px.map(f64::round), [16.0, 4.0, 24.0, 12.0]);
        let object = Object {
            actor: &own,
            visible_px: whole_px,
            pixels: 1,
            whole_px,
            visible_share: 1.0,
            camera_from_map,
        };
        // One of the eight pixel columns: identity, depth, and true if it hides the actor.
        for (id, depth_m, hides) in [
            (0, 3.0, true),
            (0, 9.8, true),
            (0, 10.5, false),
            (0, 40.0, false),
            (7, 3.0, false),
            (5, 10.8, true),
            (5, 30.0, false),
        ] {
            let at = |column: usize| if column == 17 { (id, depth_m) } else { (7, 10.0) };
            let (ids, depths): (Vec<u32>, Vec<f32>) = (0..800).map(|k| at(k % 40)).unzip();
            let wanted = if hides { 0.875 } else { 1.0 };
            assert_eq!(share(&object, (&ids, &depths), &image), wanted, "{id} at {depth_m} m");
        }
    }
}
