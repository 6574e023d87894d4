//! Ground truth of one instant: objects and traffic lights.

use swerve_core::Time;
use swerve_geom::{Ego, Point, Pose2, Vector, angle_between, wrap_angle};
use swerve_map::Aspect;
use swerve_msg::truth::{Actor, EgoTruth, WorldState};
use swerve_msg::{ActorId, ActorKind};

use crate::lane;
use crate::message::{
    BaseMoving, BaseStationary, Dimension3d, GroundTruth, Identifier, InterfaceVersion, MovingObject,
    Orientation3d, StationaryClassification, StationaryObject, Timestamp, TrafficLight,
    TrafficLightClassification, Vector3d, VehicleAttributes, VehicleClassification,
};
use crate::views::{Light, Setup};

/// Version of OSI that the messages follow: major, minor, patch.
pub(crate) const VERSION: [u32; 3] = [3, 8, 0];

/// First identities of traffic lights, lanes and boundaries; those of objects are below: identities are unique in a
/// message.
const LIGHTS: u64 = 1 << 40;
pub(crate) const LANES: u64 = 2 << 40;
pub(crate) const BOUNDARIES: u64 = 3 << 40;

// Values of enumerations of OSI.
const TYPE_OTHER: i32 = 1;
const TYPE_VEHICLE: i32 = 2;
const TYPE_PEDESTRIAN: i32 = 3;
const CAR: i32 = 4;
const HEAVY_TRUCK: i32 = 7;
const MOTORCYCLE: i32 = 10;
const BICYCLE: i32 = 11;
const COLOURS: [(i32, &[Aspect]); 3] = [
    (2, &[Aspect::Red, Aspect::RedYellow]),
    (3, &[Aspect::Yellow, Aspect::RedYellow]),
    (4, &[Aspect::Green]),
];
const ICON_NONE: i32 = 2;
const MODE_OFF: i32 = 2;
const MODE_CONSTANT: i32 = 3;

/// Depth and diameter of a lamp, its distance from the next one, and that of the top of the head from the first one,
/// metres: those of the traffic light of rendered scenes.
const LAMP_M: [f64; 2] = [0.16, 0.28];
const LAMP_STEP_M: f64 = 0.323;
const LAMP_TOP_M: f64 = 0.03 + 0.5 * LAMP_STEP_M;
/// Height of a traffic light whose height is unknown, metres: as in rendered scenes.
const LIGHT_HEIGHT_M: f64 = 3.4;

/// Motion of the centre of an object's box.
struct Motion {
    orientation: [f64; 3],
    velocity_mps: [f64; 3],
}

/// Ground truth of a state of the world. Accelerations and turn rates are differences to the state before, and missing
/// without one, or for an object that was not in it. The lanes are included if `with_lanes`.
pub(crate) fn ground_truth(
    setup: &Setup,
    now: &WorldState,
    before: Option<&WorldState>,
    with_lanes: bool,
) -> GroundTruth {
    let [major, minor, patch] = VERSION.map(Some);
    let before = before.map(|before| (before, (now.stamp - before.stamp).as_secs()));
    let before = before.filter(|(_, passed_s)| *passed_s > 0.0);
    let was = |id: ActorId| {
        let (before, passed_s) = before?;
        Some((actor_motion(before.actor(id)?), passed_s))
    };
    let ego_was = before.filter(|(before, _)| before.ego.id == now.ego.id);
    let ego_was = ego_was.map(|(before, passed_s)| (ego_motion(setup, &before.ego), passed_s));
    let is_static = |actor: &&Actor| actor.kind == ActorKind::Static;
    let moving = now.actors.iter().filter(|actor| !is_static(actor));
    let moving = moving.map(|actor| moving_object(actor, was(actor.id)));
    let (lanes, boundaries) = if with_lanes { lane::lanes(&setup.map) } else { Default::default() };
    GroundTruth {
        version: Some(InterfaceVersion { version_major: major, version_minor: minor, version_patch: patch }),
        timestamp: Some(timestamp(now.stamp)),
        host_vehicle_id: Identifier::new(now.ego.id.0.into()),
        stationary_object: now.actors.iter().filter(is_static).map(stationary_object).collect(),
        moving_object: core::iter::once(host(setup, &now.ego, ego_was)).chain(moving).collect(),
        traffic_light: lamps(&setup.lights, now.stamp),
        lane_boundary: boundaries,
        lane: lanes,
    }
}

/// Converts an instant of the run, which starts at zero.
fn timestamp(at: Time) -> Timestamp {
    const SECOND: i64 = 1_000_000_000;
    let (seconds, nanos) = (at.ns().div_euclid(SECOND), at.ns().rem_euclid(SECOND));
    Timestamp { seconds: Some(seconds), nanos: Some(nanos as u32) }
}

fn base(dimension: [f64; 3], position: [f64; 3], motion: &Motion, was: Option<(Motion, f64)>) -> BaseMoving {
    let rates = was.map(|(was, passed_s)| {
        let per_s = |k: usize| (motion.velocity_mps[k] - was.velocity_mps[k]) / passed_s;
        let turn = |k: usize| angle_between(was.orientation[k], motion.orientation[k]) / passed_s;
        (Vector3d::new([0, 1, 2].map(per_s)), Orientation3d::new([0, 1, 2].map(turn)))
    });
    BaseMoving {
        dimension: Some(Dimension3d::new(dimension)),
        position: Some(Vector3d::new(position)),
        orientation: Some(Orientation3d::new(motion.orientation)),
        velocity: Some(Vector3d::new(motion.velocity_mps)),
        acceleration: rates.map(|(acceleration, _)| acceleration),
        orientation_rate: rates.map(|(_, rate)| rate),
    }
}

/// Centre of the ego's box in the ego frame.
fn center(setup: &Setup) -> Vector<Ego> {
    let shape = &setup.vehicle.shape;
    Vector::new(shape.center_ahead_m(), 0.0, 0.5 * shape.height_m)
}

/// The velocity of the centre of gravity is known; that of the centre of the box follows from the rotation.
fn ego_motion(setup: &Setup, ego: &EgoTruth) -> Motion {
    let vehicle = &setup.vehicle;
    let gravity = Vector::<Ego>::new(vehicle.cg_to_rear_m(), 0.0, vehicle.body.cg_height_m);
    let arm = center(setup).coords - gravity.coords;
    let turning = ego.map_from_ego.rotation() * ego.angular_velocity_radps.coords.cross(&arm);
    let (roll, pitch, yaw) = ego.map_from_ego.roll_pitch_yaw();
    Motion { orientation: [roll, pitch, yaw], velocity_mps: (ego.velocity_mps.coords + turning).into() }
}

/// The ego, with its axles and wheels.
fn host(setup: &Setup, ego: &EgoTruth, was: Option<(Motion, f64)>) -> MovingObject {
    let (vehicle, center) = (&setup.vehicle, center(setup).coords);
    let (shape, radius_m) = (&vehicle.shape, vehicle.wheel.radius_m);
    let at = ego.map_from_ego * Point::new(center.x, center.y, center.z);
    let axle = |x_m: f64| Some(Vector3d::new([x_m - center.x, 0.0, radius_m - center.z]));
    MovingObject {
        id: Identifier::new(ego.id.0.into()),
        base: Some(base(
            [shape.length_m, shape.width_m, shape.height_m],
            at.coords.into(),
            &ego_motion(setup, ego),
            was,
        )),
        r#type: Some(TYPE_VEHICLE),
        vehicle_attributes: Some(VehicleAttributes {
            radius_wheel: Some(radius_m),
            number_wheels: Some(4),
            bbcenter_to_rear: axle(0.0),
            bbcenter_to_front: axle(shape.wheelbase_m),
        }),
        vehicle_classification: Some(VehicleClassification { r#type: Some(CAR) }),
    }
}

fn actor_motion(actor: &Actor) -> Motion {
    let velocity = actor.velocity_mps;
    Motion { orientation: [0.0, 0.0, actor.pose.heading_rad], velocity_mps: [velocity.x, velocity.y, 0.0] }
}

fn dimension(actor: &Actor) -> [f64; 3] {
    [actor.extent.length_m, actor.extent.width_m, actor.extent.height_m]
}

fn position(actor: &Actor) -> [f64; 3] {
    [actor.pose.x_m, actor.pose.y_m, actor.z_m + 0.5 * actor.extent.height_m]
}

fn moving_object(actor: &Actor, was: Option<(Motion, f64)>) -> MovingObject {
    let vehicle = match actor.kind {
        ActorKind::Car => Some(CAR),
        ActorKind::Truck => Some(HEAVY_TRUCK),
        ActorKind::Motorcycle => Some(MOTORCYCLE),
        ActorKind::Cyclist => Some(BICYCLE),
        ActorKind::Pedestrian | ActorKind::Static => None,
    };
    MovingObject {
        id: Identifier::new(actor.id.0.into()),
        base: Some(base(dimension(actor), position(actor), &actor_motion(actor), was)),
        r#type: Some(if vehicle.is_some() { TYPE_VEHICLE } else { TYPE_PEDESTRIAN }),
        vehicle_attributes: None,
        vehicle_classification: vehicle.map(|of| VehicleClassification { r#type: Some(of) }),
    }
}

fn stationary_object(actor: &Actor) -> StationaryObject {
    StationaryObject {
        id: Identifier::new(actor.id.0.into()),
        base: Some(BaseStationary {
            dimension: Some(Dimension3d::new(dimension(actor))),
            position: Some(Vector3d::new(position(actor))),
            orientation: Some(Orientation3d::new([0.0, 0.0, actor.pose.heading_rad])),
        }),
        classification: Some(StationaryClassification { r#type: Some(TYPE_OTHER) }),
    }
}

/// A `TrafficLight` of OSI is one lamp: red, yellow and green of each light, from the top down.
fn lamps(lights: &[Light], at: Time) -> Vec<TrafficLight> {
    let lamp = |(k, light): (usize, &Light)| {
        let aspect = light.program.aspect_at(at.ns());
        let top_m = light.height_m.unwrap_or(LIGHT_HEIGHT_M) - LAMP_TOP_M;
        let lanes: Vec<_> = light.lanes.iter().filter_map(|id| lane::identity(*id)).collect();
        let Pose2 { x_m, y_m, heading_rad, .. } = light.pose;
        let base = move |j: usize| BaseStationary {
            dimension: Some(Dimension3d::new([LAMP_M[0], LAMP_M[1], LAMP_M[1]])),
            position: Some(Vector3d::new([x_m, y_m, top_m - LAMP_STEP_M * j as f64])),
            orientation: Some(Orientation3d::new([
                0.0,
                0.0,
                wrap_angle(heading_rad + core::f64::consts::PI),
            ])),
        };
        COLOURS.into_iter().enumerate().map(move |(j, (color, lit))| TrafficLight {
            id: Identifier::new(LIGHTS + (3 * k + j) as u64),
            base: Some(base(j)),
            classification: Some(TrafficLightClassification {
                color: Some(color),
                icon: Some(ICON_NONE),
                mode: Some(if lit.contains(&aspect) { MODE_CONSTANT } else { MODE_OFF }),
                assigned_lane_id: lanes.clone(),
            }),
        })
    };
    lights.iter().enumerate().flat_map(lamp).collect()
}

#[cfg(test)]
pub(crate) mod tests;
