//! Actors visible to a sensor on the ego; the same visibility rule for all planners.
//!
//! An actor is listed if its centre is within range on the ground and at least one of its nine fixed points
//! ([`fixed_points`]) is within the field of view and on a free line of sight: the segment from the sensor to the point
//! intersects no other actor's body (boxes; upright cylinders for pedestrians). The ego's body and the target itself do
//! not occlude. Bodies that have been knocked over still count as upright.

use core::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_geom::{Ego, Map, Point, Point2, math, wrap_angle};
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{Obstacle, ObstacleList, Side};
use swerve_vehicle::Shape;

use super::occluders::Occluders;

/// Distance within which a sensor counts as on a face of the car's box, metres.
const FACE_M: f64 = 1e-3;

/// Mounting pose of a sensor on the ego.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct SensorMount {
    /// Forward of the ego origin (rear axle), metres.
    #[schemars(range(min = -30.0, max = 30.0))]
    pub x_m: f64,
    /// To the left of the ego origin, metres.
    #[schemars(range(min = -5.0, max = 5.0))]
    pub y_m: f64,
    /// Above the ground, metres.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub z_m: f64,
    /// Yaw relative to the ego's heading, radians; positive to the left.
    #[schemars(range(min = -TAU, max = TAU))]
    pub yaw_rad: f64,
}

impl SensorMount {
    /// Default mount: above the centre of the roof, 1.9 m up, or 0.1 m above the roof of a higher car; facing forward.
    pub fn roof(shape: &Shape) -> Self {
        let z_m = if shape.height_m > 1.9 { shape.height_m + 0.1 } else { 1.9 };
        Self { x_m: shape.center_ahead_m(), y_m: 0.0, z_m, yaw_rad: 0.0 }
    }

    /// True if it is inside the car's box, where nothing is visible; the faces count as outside.
    pub fn is_inside(&self, shape: &Shape) -> bool {
        let (front_m, rear_m) = (shape.length_m - shape.rear_overhang_m, -shape.rear_overhang_m);
        let within = |low: f64, x: f64, high: f64| low + FACE_M < x && x < high - FACE_M;
        within(rear_m, self.x_m, front_m)
            && within(-0.5 * shape.width_m, self.y_m, 0.5 * shape.width_m)
            && within(0.0, self.z_m, shape.height_m)
    }

    /// Mount for a long-range radar: centre of the front bumper, 0.5 m up, facing forward.
    pub fn front(shape: &Shape) -> Self {
        Self { x_m: shape.length_m - shape.rear_overhang_m, y_m: 0.0, z_m: 0.5, yaw_rad: 0.0 }
    }

    /// Mount at a corner of the car, 0.6 m up, facing outwards at 45 degrees from the front or, at the rear, from the
    /// back.
    pub fn corner(shape: &Shape, at_front: bool, side: Side) -> Self {
        let outwards = match side {
            Side::Left => 1.0,
            Side::Right => -1.0,
        };
        let eighth = core::f64::consts::FRAC_PI_4;
        let (x_m, yaw_rad) = if at_front {
            (shape.length_m - shape.rear_overhang_m, eighth)
        } else {
            (-shape.rear_overhang_m, 3.0 * eighth)
        };
        Self { x_m, y_m: 0.5 * outwards * shape.width_m, z_m: 0.6, yaw_rad: outwards * yaw_rad }
    }
}

/// Limits of a sensor's view.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorParams {
    /// Largest distance on the ground from the sensor to the centre of an actor, metres. Default 100.
    pub range_m: f64,
    /// Largest distance for people (on foot or on bicycles), metres. Default: `range_m`.
    pub range_person_m: Option<f64>,
    /// Full horizontal field of view around the sensor's axis, radians; 2 pi or more is all-round. Default 2 pi.
    pub fov_rad: f64,
    /// True if bodies occlude the view. Default true.
    pub occlusion: bool,
}

impl Default for SensorParams {
    fn default() -> Self {
        Self { range_m: 100.0, range_person_m: None, fov_rad: TAU, occlusion: true }
    }
}

/// Actors visible to the sensor in this state, with the visible share of their fixed points.
pub fn visible_obstacles(world: &WorldState, mount: &SensorMount, params: &SensorParams) -> ObstacleList {
    let mut list = ObstacleList { stamp: world.stamp, obstacles: Vec::with_capacity(world.actors.len()) };
    let view = View::new(world, mount, params);
    let occluders = params.occlusion.then(|| Occluders::new(world, view.eye));
    for (i, actor) in world.actors.iter().enumerate() {
        let visible_share = view.share(world, i, params, occluders.as_ref());
        if visible_share > 0.0 {
            list.obstacles.push(Obstacle {
                id: actor.id,
                kind: actor.kind,
                pose: actor.pose,
                extent: actor.extent,
                velocity_mps: actor.velocity_mps,
                visible_share,
            });
        }
    }
    list
}

/// Nine sample points of an actor for visibility: the centre of its body, then four around its bottom and four around
/// its top. For a box these are the corners (front left, rear left, rear right, front right); for a pedestrian, an
/// upright cylinder, the points of the rims ahead, left, behind and right.
pub fn fixed_points(actor: &Actor) -> [Point<Map>; 9] {
    let (bottom, top) = (actor.z_m, actor.z_m + actor.extent.height_m);
    let ring = if actor.is_round() {
        let radius_m = 0.5 * actor.extent.width_m;
        let (c, ahead) = (actor.pose.point(), actor.pose.direction() * radius_m);
        [c + ahead, c + ahead.left(), c - ahead, c - ahead.left()]
    } else {
        actor.footprint().corners()
    };
    let at = |p: Point2, z: f64| Point::new(p.x_m, p.y_m, z);
    let [a, b, c, d] = ring;
    [
        at(actor.pose.point(), 0.5 * (bottom + top)),
        at(a, bottom),
        at(b, bottom),
        at(c, bottom),
        at(d, bottom),
        at(a, top),
        at(b, top),
        at(c, top),
        at(d, top),
    ]
}

/// A sensor in the world.
pub(super) struct View {
    pub(super) eye: Point<Map>,
    axis_rad: f64,
    half_fov_rad: f64,
    all_round: bool,
}

impl View {
    pub(super) fn new(world: &WorldState, mount: &SensorMount, params: &SensorParams) -> Self {
        let eye = world.ego.map_from_ego * Point::<Ego>::new(mount.x_m, mount.y_m, mount.z_m);
        Self {
            eye,
            axis_rad: world.ego.state.pose.heading_rad + mount.yaw_rad,
            half_fov_rad: 0.5 * params.fov_rad,
            all_round: params.fov_rad >= core::f64::consts::TAU,
        }
    }

    fn share(
        &self,
        world: &WorldState,
        target: usize,
        params: &SensorParams,
        occluders: Option<&Occluders<'_>>,
    ) -> f64 {
        let actor = &world.actors[target];
        let range_m = params.range_person_m.filter(|_| actor.kind.is_person()).unwrap_or(params.range_m);
        let eye = Point2::new(self.eye.coords.x, self.eye.coords.y);
        if eye.distance(actor.pose.point()) > range_m {
            return 0.0;
        }
        let points = fixed_points(actor);
        let seen = |point: &&Point<Map>| {
            self.in_field(**point) && !occluders.is_some_and(|all| all.hide(**point, Some(target)))
        };
        points.iter().filter(seen).count() as f64 / points.len() as f64
    }

    pub(super) fn in_field(&self, point: Point<Map>) -> bool {
        if self.all_round {
            return true;
        }
        let to = point - self.eye;
        let bearing = math::atan2(to.coords.y, to.coords.x);
        wrap_angle(bearing - self.axis_rad).abs() <= self.half_fov_rad
    }
}
