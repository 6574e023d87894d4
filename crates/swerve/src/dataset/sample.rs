//! What belongs to one frame, gathered from a drive.

use std::collections::{BTreeMap, VecDeque};

use swerve_flow::{Event, Observer};
use swerve_geom::{Map, Point, Transform};
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
    /// Share of its fixed points that are pixels of its own, of those within the image.
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
    lidar: Option<String>,
    worlds: VecDeque<WorldState>,
    images: BTreeMap<&'static str, Image>,
    cloud: Option<PointCloud>,
    write: &'a mut dyn FnMut(&Sample<'_>) -> anyhow::Result<()>,
    failure: Option<anyhow::Error>,
}

impl<'a> Collector<'a> {
    pub(super) fn new(
        camera: &str,
        lidar: Option<&str>,
        write: &'a mut dyn FnMut(&Sample<'_>) -> anyhow::Result<()>,
    ) -> Self {
        Self {
            camera: camera.to_owned(),
            lidar: lidar.map(str::to_owned),
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
        let objects = objects(instance, world);
        let sample = Sample { rgb, depth, semantic, instance, cloud: self.cloud.as_ref(), objects };
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
            if self.lidar.as_deref() == Some(publication.operator) {
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

/// The actors with at least one pixel.
fn objects<'a>(image: &Image, world: &'a WorldState) -> Vec<Object<'a>> {
    let Pixels::InstanceU32(ids) = &image.pixels else { return Vec::new() };
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
        let visible_share = share(actor, image, ids, &camera_from_map);
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
pub(super) fn corners(actor: &Actor) -> [Point<Map>; 8] {
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

/// Of the fixed points of truth sensing that fall into the image, the share around which the actor has pixels.
fn share(
    actor: &Actor,
    image: &Image,
    ids: &[u32],
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
) -> f64 {
    /// The points are of the box, the pixels of the shape within it: this far from a point is looked, pixels.
    const REACH_PX: i64 = 3;
    let (width, height) = (i64::from(image.width_px), i64::from(image.height_px));
    let (mut inside, mut own) = (0, 0);
    for point in fixed_points(actor) {
        let Some([x, y]) = project(image, camera_from_map, point) else { continue };
        let (column, row) = (x.floor() as i64, y.floor() as i64);
        if !(0..width).contains(&column) || !(0..height).contains(&row) {
            continue;
        }
        inside += 1;
        let is_own = |dx: i64, dy: i64| {
            let (column, row) = ((column + dx).clamp(0, width - 1), (row + dy).clamp(0, height - 1));
            ids.get((row * width + column) as usize) == Some(&actor.id.0)
        };
        own += i32::from((-REACH_PX..=REACH_PX).any(|dy| (-REACH_PX..=REACH_PX).any(|dx| is_own(dx, dy))));
    }
    if inside == 0 { 1.0 } else { f64::from(own) / f64::from(inside) }
}
