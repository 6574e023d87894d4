//! Observes a run, and logs the states of its world.

use std::collections::BTreeMap;
use std::sync::Arc;

use prost::Message;
use swerve_flow::Event;
use swerve_geom::Pose2;
use swerve_log::{View, ViewSchema, ViewTopic, Views};
use swerve_map::{LaneId, Map, SignalProgram};
use swerve_msg::truth::{Actor, WorldState};
use swerve_vehicle::VehicleParams;

use crate::schema::descriptor;
use crate::truth::{VERSION, ground_truth};

/// Properties of a run that its states do not contain.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The ego.
    pub vehicle: VehicleParams,
    /// All lanes.
    pub map: Arc<Map>,
    /// Traffic lights.
    pub lights: Vec<Light>,
}

/// A traffic light.
#[derive(Clone, Debug)]
pub struct Light {
    /// Position, and the direction of the traffic that it is for, in the map.
    pub pose: Pose2,
    /// Height of its top, metres; `None` if unknown.
    pub height_m: Option<f64>,
    /// Lanes whose traffic obeys it, as far as they are known.
    pub lanes: Vec<LaneId>,
    /// Its phases, from the start of the run.
    pub program: SignalProgram,
}

/// Logs each state of the world as `osi3.GroundTruth` on the topic `/osi/ground_truth`.
pub struct GroundTruthViews {
    setup: Arc<Setup>,
    topic: Arc<ViewTopic>,
    /// Newest state so far.
    newest: Option<Arc<WorldState>>,
}

impl GroundTruthViews {
    /// Creates the views of a run.
    pub fn new(setup: Setup) -> Self {
        Self { setup: Arc::new(setup), topic: Arc::new(topic()), newest: None }
    }
}

/// Topic with the metadata that OSI requires of a multi-channel trace file and of its channels.
fn topic() -> ViewTopic {
    let (osi, protobuf) = (VERSION.map(|part| part.to_string()).join("."), PROTOBUF.to_owned());
    let channel = |key: &str| format!("net.asam.osi.trace.channel.{key}");
    let schema = ViewSchema {
        name: "osi3.GroundTruth".into(),
        message_encoding: "protobuf",
        encoding: "protobuf",
        data: descriptor().into(),
    };
    let versions = [("version", &osi), ("min_osi_version", &osi), ("max_osi_version", &osi)];
    let protobufs = [("min_protobuf_version", &protobuf), ("max_protobuf_version", &protobuf)];
    let file = versions.into_iter().chain(protobufs).map(|(key, value)| (key.to_owned(), value.clone()));
    let file_metadata = Some(("net.asam.osi.trace".to_owned(), file.collect()));
    let metadata = BTreeMap::from([
        (channel("osi_version"), osi.clone()),
        (channel("protobuf_version"), protobuf.clone()),
        (channel("description"), "ground truth of each step of the simulated world".into()),
    ]);
    ViewTopic { metadata, file_metadata, ..ViewTopic::new("/osi/ground_truth".into(), schema) }
}

/// Version of the protobuf format in the metadata, which asks for one of a library: the first with this encoding of
/// `proto2`.
const PROTOBUF: &str = "2.0.0";

impl Views for GroundTruthViews {
    fn event(&mut self, event: &Event<'_>, out: &mut Vec<View>) {
        let Event::Publication(publication) = event else { return };
        let state = publication.payload.and_then(|payload| payload.downcast_ref::<WorldState>());
        // A fault may repeat a state: each instant is logged once.
        let is_new =
            |state: &&WorldState| self.newest.as_ref().is_none_or(|newest| newest.stamp < state.stamp);
        let Some(state) = state.filter(is_new) else { return };
        let (now, setup) = (Arc::new(state.clone()), self.setup.clone());
        let before = self.newest.replace(now.clone());
        let is_first = before.is_none();
        out.push(View {
            topic: self.topic.clone(),
            visible_at: publication.visible_at,
            stamp: now.stamp,
            bytes: size_of::<WorldState>() + now.actors.len() * size_of::<Actor>(),
            encode: Box::new(move |out| {
                let truth = ground_truth(&setup, &now, before.as_deref(), is_first);
                truth.encode(out).expect("a vector takes all");
            }),
        });
    }
}
