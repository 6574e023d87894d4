//! Common parts of all messages: topics, stamps, poses, colours.

use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::messages::{Color, Point3, Pose, Quaternion, Timestamp, Vector3};
use foxglove::{Encode, Schema};
use swerve_core::Time;
use swerve_flow::Publication;
use swerve_geom::{Point, Pose2, Transform, math};
use swerve_log::{View, ViewSchema, ViewTopic};
use swerve_msg::ActorKind;

/// Frame of everything that is not fixed to the car.
pub(crate) const MAP: &str = "map";
/// Frame of the car: centre of the rear axle on the ground.
pub(crate) const EGO: &str = "ego";

/// Frame of a sensor.
pub(crate) fn frame_of(sensor: &str) -> String {
    format!("{EGO}/{sensor}")
}

/// Instant at which something becomes visible, and instant that it describes.
#[derive(Clone, Copy)]
pub(crate) struct When {
    pub(crate) visible_at: Time,
    pub(crate) stamp: Time,
}

impl When {
    pub(crate) fn new(publication: &Publication<'_>) -> Self {
        let visible_at = publication.visible_at;
        Self { visible_at, stamp: publication.stamp.unwrap_or(visible_at) }
    }
}

/// Messages to be logged, and the topics used so far.
#[derive(Default)]
pub(crate) struct Outbox {
    topics: BTreeMap<String, Arc<ViewTopic>>,
    pub(crate) views: Vec<View>,
}

impl Outbox {
    /// Logs a message of a Foxglove type, or similar, below `/view`. `make` runs on the writer thread; `bytes` is
    /// approximately the memory held until then.
    pub(crate) fn show<T: Encode>(
        &mut self,
        topic: &str,
        when: When,
        bytes: usize,
        make: impl FnOnce() -> Option<T> + Send + 'static,
    ) {
        let encode = move |out: &mut Vec<u8>| {
            if let Some(message) = make() {
                out.reserve(message.encoded_len().unwrap_or(0));
                message.encode(out).expect("messages are plain data, and memory takes all");
            }
        };
        self.post(topic, schema::<T>, when, bytes, Box::new(encode));
    }

    /// Logs a message of any type below `/view`; `schema` is called once per topic.
    pub(crate) fn post(
        &mut self,
        topic: &str,
        schema: impl FnOnce() -> ViewSchema,
        When { visible_at, stamp }: When,
        bytes: usize,
        encode: swerve_log::Encode,
    ) {
        let topic = match self.topics.get(topic) {
            Some(known) => known.clone(),
            None => {
                let new = Arc::new(ViewTopic::new(format!("/view/{topic}"), schema()));
                self.topics.insert(topic.into(), new.clone());
                new
            }
        };
        self.views.push(View { topic, visible_at, stamp, bytes, encode });
    }
}

fn schema<T: Encode>() -> ViewSchema {
    let Schema { name, data, .. } = T::get_schema().expect("every message of Foxglove's has a schema");
    ViewSchema { name: name.into(), message_encoding: "protobuf", encoding: "protobuf", data }
}

/// Converts an instant of the run, which starts at zero.
pub(crate) fn timestamp(at: Time) -> Timestamp {
    const SECOND: i64 = 1_000_000_000;
    let ns = at.ns().max(0);
    Timestamp::new(u32::try_from(ns / SECOND).unwrap_or(u32::MAX), (ns % SECOND) as u32)
}

pub(crate) fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

pub(crate) fn point([x, y, z]: [f64; 3]) -> Point3 {
    Point3 { x, y, z }
}

pub(crate) fn coords<F>(point: Point<F>) -> [f64; 3] {
    [point.coords.x, point.coords.y, point.coords.z]
}

pub(crate) fn rotation<A, B>(transform: &Transform<A, B>) -> Quaternion {
    let rotation = transform.rotation();
    let q = rotation.quaternion();
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

/// Pose of an upright body on the ground at height `z_m`.
pub(crate) fn upright(pose: Pose2, z_m: f64) -> Pose {
    let (sin, cos) = math::sin_cos(0.5 * pose.heading_rad);
    Pose {
        position: Some(vector([pose.x_m, pose.y_m, z_m])),
        orientation: Some(Quaternion { x: 0.0, y: 0.0, z: sin, w: cos }),
    }
}

/// Converts red, green, blue and opacity, 0 to 255 each.
pub(crate) fn colour([r, g, b, a]: [u8; 4]) -> Color {
    let share = |part: u8| f64::from(part) / 255.0;
    Color { r: share(r), g: share(g), b: share(b), a: share(a) }
}

/// Colour of a kind of road user with this opacity, 0 to 255.
pub(crate) fn colour_of(kind: ActorKind, opacity: u8) -> Color {
    let [r, g, b] = match kind {
        ActorKind::Car => [80, 160, 255],
        ActorKind::Truck => [60, 100, 220],
        ActorKind::Motorcycle => [140, 120, 255],
        ActorKind::Cyclist => [255, 190, 60],
        ActorKind::Pedestrian => [255, 90, 200],
        ActorKind::Static => [170, 170, 170],
    };
    colour([r, g, b, opacity])
}

/// Name of a kind of road user.
pub(crate) fn name_of(kind: ActorKind) -> &'static str {
    match kind {
        ActorKind::Car => "car",
        ActorKind::Truck => "truck",
        ActorKind::Motorcycle => "motorcycle",
        ActorKind::Cyclist => "cyclist",
        ActorKind::Pedestrian => "pedestrian",
        ActorKind::Static => "static",
    }
}
