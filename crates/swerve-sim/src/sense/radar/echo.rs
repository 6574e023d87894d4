//! Echoes of actors.

use swerve_geom::{Ego, Map, Point, Point2, Pose2, Transform, Vector, math};
use swerve_msg::ActorId;
use swerve_msg::truth::{Actor, WorldState};

use super::decibel::decibels;
use super::params::RadarParams;
use super::rcs_dbsm;
use crate::sense::SensorMount;
use crate::sense::occluders::Occluders;

/// Share of the cross-section at the closest point of a box, and at each of two adjacent corners.
const SHARES: [f64; 3] = [0.6, 0.2, 0.2];
/// Maximum height of scatterers above the body's bottom, metres; otherwise they are at half of its height.
const SCATTERER_MAX_M: f64 = 0.8;

/// A sensor in the world.
pub(super) struct Eye {
    pub(super) at: Point<Map>,
    pub(super) velocity_mps: Vector<Map>,
    map_from_ego: Transform<Map, Ego>,
    mount: SensorMount,
}

/// Power reflected from one position, before noise.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Echo {
    pub(super) range_m: f64,
    pub(super) range_rate_mps: f64,
    pub(super) azimuth_rad: f64,
    pub(super) elevation_rad: f64,
    /// Mean signal-to-noise ratio.
    pub(super) snr: f64,
    /// Actor and scatterer of the strongest part.
    pub(super) actor: ActorId,
    pub(super) part: i64,
}

/// A scatterer of an actor.
struct Scatterer {
    /// Index within the actor.
    part: i64,
    place: Point<Map>,
    /// Share of the actor's cross-section.
    share: f64,
}

impl Eye {
    pub(super) fn new(world: &WorldState, mount: &SensorMount, center_of_gravity: Point<Ego>) -> Self {
        let place = Point::<Ego>::new(mount.x_m, mount.y_m, mount.z_m);
        Self {
            at: world.ego.map_from_ego * place,
            velocity_mps: velocity_of(world, center_of_gravity, place),
            map_from_ego: world.ego.map_from_ego,
            mount: *mount,
        }
    }

    /// Azimuth and elevation of a map direction in the sensor's axes.
    fn angles(&self, towards: Vector<Map>) -> (f64, f64) {
        let v = (self.map_from_ego.inverse() * towards).coords;
        let (sin, cos) = math::sin_cos(self.mount.yaw_rad);
        let (x, y) = (v.x * cos + v.y * sin, v.y * cos - v.x * sin);
        (math::atan2(y, x), math::atan2(v.z, math::hypot(x, y)))
    }

    /// Unit vector in the map for these angles.
    pub(super) fn direction(&self, azimuth_rad: f64, elevation_rad: f64) -> Vector<Map> {
        let (sin, cos) = math::sin_cos(azimuth_rad + self.mount.yaw_rad);
        let (up, flat) = math::sin_cos(elevation_rad);
        self.map_from_ego * Vector::<Ego>::new(flat * cos, flat * sin, up)
    }
}

/// Echoes of all visible scatterers, before resolution.
pub(super) fn echoes(world: &WorldState, eye: &Eye, params: &RadarParams) -> Vec<Echo> {
    let mut found = Vec::new();
    let occluders = Occluders::new(world, eye.at);
    for (i, actor) in world.actors.iter().enumerate() {
        let eye_on_ground = Point2::<Map>::new(eye.at.coords.x, eye.at.coords.y);
        let to_eye = eye_on_ground - actor.pose.point();
        let rcs = rcs_dbsm(actor.kind, to_eye.heading() - actor.pose.heading_rad);
        for scatterer in scatterers(actor, eye_on_ground) {
            let hidden = || params.occlusion && occluders.hide(scatterer.place, Some(i));
            let Some(echo) = echo(eye, actor, &scatterer, rcs, params) else { continue };
            if !hidden() {
                found.push(echo);
            }
        }
    }
    found
}

/// Echo of one scatterer of an actor of this cross-section, if within the limits.
fn echo(
    eye: &Eye,
    actor: &Actor,
    scatterer: &Scatterer,
    rcs_dbsm: f64,
    params: &RadarParams,
) -> Option<Echo> {
    let to = scatterer.place - eye.at;
    let range_m = to.norm();
    if !(params.range_min_m..=params.range_max_m).contains(&range_m) {
        return None;
    }
    let (azimuth_rad, elevation_rad) = eye.angles(to);
    let seen =
        azimuth_rad.abs() <= 0.5 * params.fov_rad && elevation_rad.abs() <= 0.5 * params.elevation_fov_rad;
    let moves = Vector::<Map>::new(actor.velocity_mps.x, actor.velocity_mps.y, 0.0);
    let range_rate_mps = (moves - eye.velocity_mps).dot(to) / range_m;
    let snr = params.mean_snr(rcs_dbsm + decibels(scatterer.share), range_m, azimuth_rad);
    (seen && range_rate_mps.abs() <= params.range_rate_max_mps).then_some(Echo {
        range_m,
        range_rate_mps,
        azimuth_rad,
        elevation_rad,
        snr,
        actor: actor.id,
        part: scatterer.part,
    })
}

/// Scatterers of an actor towards a sensor; empty for a sensor inside it.
fn scatterers(actor: &Actor, eye: Point2) -> Vec<Scatterer> {
    let z_m = actor.z_m + (0.5 * actor.extent.height_m).min(SCATTERER_MAX_M);
    let lifted = |p: Point2| Point::new(p.x_m, p.y_m, z_m);
    if actor.is_round() {
        let center = actor.pose.point();
        let (apart, radius_m) = (eye.distance(center), 0.5 * actor.extent.width_m);
        if apart <= radius_m {
            return Vec::new();
        }
        let place = lifted(center + (eye - center) * (radius_m / apart));
        return vec![Scatterer { part: 0, place, share: 1.0 }];
    }
    let (l, w) = (0.5 * actor.extent.length_m, 0.5 * actor.extent.width_m);
    let local: Point2<Map> = actor.pose.to_local(eye);
    let (beyond_end, beyond_side) = (local.x_m.abs() > l, local.y_m.abs() > w);
    if !beyond_end && !beyond_side {
        return Vec::new();
    }
    let (end, side) = (l.copysign(local.x_m), w.copysign(local.y_m));
    let nearest = (local.x_m.clamp(-l, l), local.y_m.clamp(-w, w));
    let corners = match (beyond_end, beyond_side) {
        (true, true) => [(-end, side), (end, -side)],
        (true, false) => [(end, w), (end, -w)],
        _ => [(l, side), (-l, side)],
    };
    let pose: Pose2 = actor.pose;
    let place = |(x, y): (f64, f64)| lifted(pose.from_local(Point2::<Map>::new(x, y)));
    let places = [nearest, corners[0], corners[1]].map(place).into_iter();
    (0..).zip(places.zip(SHARES)).map(|(part, (place, share))| Scatterer { part, place, share }).collect()
}

/// Merges echoes that the sensor cannot resolve: those too close to a stronger one add to its power.
pub(super) fn resolved(mut echoes: Vec<Echo>, params: &RadarParams) -> Vec<Echo> {
    echoes.sort_by(|a, b| b.snr.total_cmp(&a.snr).then((a.actor, a.part).cmp(&(b.actor, b.part))));
    let mut kept: Vec<Echo> = Vec::with_capacity(echoes.len());
    for echo in echoes {
        let one = |other: &&mut Echo| {
            (other.range_m - echo.range_m).abs() < params.range_resolution_m
                && (other.range_rate_mps - echo.range_rate_mps).abs() < params.range_rate_resolution_mps
                && (other.azimuth_rad - echo.azimuth_rad).abs() < params.azimuth_resolution_rad
        };
        match kept.iter_mut().find(one) {
            Some(stronger) => stronger.snr += echo.snr,
            None => kept.push(echo),
        }
    }
    kept
}

/// Velocity in the map of a point fixed to the ego.
pub(super) fn velocity_of(
    world: &WorldState,
    center_of_gravity: Point<Ego>,
    point: Point<Ego>,
) -> Vector<Map> {
    let lever = (point - center_of_gravity).coords;
    let turning = world.ego.angular_velocity_radps.coords.cross(&lever);
    world.ego.velocity_mps + world.ego.map_from_ego * Vector::<Ego>::new(turning.x, turning.y, turning.z)
}
