//! Tests with a custom message type.

use foxglove::messages::SceneUpdate;
use prost::Message;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use swerve_core::{Span, Time};
use swerve_flow::{Context, Event, Every, Graph, Observer, Operator, Port, RunOptions, every, run_virtual};
use swerve_geom::{Point2, Polyline};
use swerve_log::{View, Views};
use swerve_msg::Route;
use swerve_vehicle::VehicleParams;

use super::*;
use crate::Setup;

/// Message of a third-party operator.
#[derive(Clone, Serialize, Deserialize)]
struct Parking {
    free: u32,
    spots_m: Vec<[f64; 2]>,
}

const SCHEMA: &str = r#"{
    "title": "Parking", "type": "object",
    "properties": { "free": { "type": "integer" }, "spots_m": { "type": "array" } }
}"#;

struct Searcher;

impl Operator for Searcher {
    type In = Every;
    type Out = Port<Parking>;

    fn step(&mut self, cx: &mut Context<'_>, _: &Every, out: &mut Self::Out) {
        let second = cx.stamp().as_secs();
        out.send(Parking { free: 2, spots_m: vec![[second, 3.0], [second, 6.0]] });
    }
}

/// An observed run of the operator, with its views.
struct Shown {
    foxglove: Foxglove,
    views: Vec<View>,
}

impl Observer for Shown {
    fn event(&mut self, event: &Event<'_>) {
        self.foxglove.event(event, &mut self.views);
    }
}

fn foxglove() -> Foxglove {
    let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(100.0, 0.0)]).unwrap();
    Foxglove::new(Setup {
        route: Route::uniform(line, 2.0, 2.0),
        lines_m: vec![],
        map: None,
        shape: VehicleParams::default().shape,
        dead_time: Span::ZERO,
        detectors: Vec::new(),
        mounts: vec![],
        images: None,
        raw_images: false,
        actors: Default::default(),
        tracks: Default::default(),
        ego_from_pose: false,
    })
}

/// Views of a run of two ticks, at 0 and 1 s, with their encoded bytes.
fn shown(foxglove: Foxglove) -> Vec<(View, Vec<u8>)> {
    let mut graph = Graph::new();
    graph.add("searcher", Searcher, every(Span::from_ms(1000))).out();
    let mut shown = Shown { foxglove, views: Vec::new() };
    run_virtual(graph, &RunOptions::until(Time::from_ms(1000)), vec![&mut shown]).unwrap();
    let encoded = |mut view: View| {
        let mut bytes = Vec::new();
        let encode = std::mem::replace(&mut view.encode, Box::new(|_| ()));
        encode(&mut bytes);
        (view, bytes)
    };
    shown.views.into_iter().map(encoded).collect()
}

#[test]
fn custom_message_is_shown_as_json() {
    let shown = shown(foxglove().with_json::<Parking>("parking", SCHEMA));
    assert_eq!(shown.len(), 2);
    let (view, bytes) = &shown[1];
    let schema = &view.topic.schema;
    assert_eq!((view.topic.name.as_str(), view.stamp), ("/view/parking", Time::from_ms(1000)));
    assert_eq!((&*schema.name, schema.encoding, schema.message_encoding), ("Parking", "jsonschema", "json"));
    let said: Value = serde_json::from_slice(bytes).unwrap();
    assert_eq!(said, json!({ "free": 2, "spots_m": [[1.0, 3.0], [1.0, 6.0]] }));
    // Foxglove lists the fields of the schema, which are those of the message.
    let described: Value = serde_json::from_slice(&schema.data).unwrap();
    let fields = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(fields(&described["properties"]), fields(&said));
}

#[test]
fn custom_message_is_drawn_in_the_map() {
    let extent = Extent { length_m: 5.0, width_m: 2.0, height_m: 0.1 };
    let shown = shown(foxglove().with_drawing::<Parking>("parking/spots", move |parking, drawing| {
        for [x_m, y_m] in &parking.spots_m {
            drawing.cuboid(Pose2::new(*x_m, *y_m, 0.0), 0.0, extent, [0, 255, 0, 128]);
        }
        drawing.line(parking.spots_m.iter().map(|[x_m, y_m]| [*x_m, *y_m, 0.0]), [255, 0, 0, 255], 0.1);
        drawing.text([0.0, 0.0, 2.0], format!("{} free", parking.free));
    }));
    let (view, bytes) = &shown[1];
    assert_eq!(
        (view.topic.name.as_str(), &*view.topic.schema.name),
        ("/view/parking/spots", "foxglove.SceneUpdate")
    );
    let update = SceneUpdate::decode(&**bytes).unwrap();
    assert_eq!((update.deletions.len(), update.entities.len()), (1, 1));
    let entity = &update.entities[0];
    let places: Vec<[f64; 3]> = entity
        .cubes
        .iter()
        .map(|cube| cube.pose.as_ref().unwrap().position.unwrap())
        .map(|at| [at.x, at.y, at.z])
        .collect();
    assert_eq!(places, [[1.0, 3.0, 0.05], [1.0, 6.0, 0.05]]);
    assert_eq!((entity.frame_id.as_str(), entity.lines[0].points.len()), ("map", 2));
    assert_eq!(entity.texts[0].text, "2 free");
}

/// Two views of one message are two topics; unregistered types are not shown.
#[test]
fn custom_message_may_have_several_views_or_none() {
    assert!(shown(foxglove()).is_empty());
    let raw =
        ViewSchema { name: "count".into(), message_encoding: "text", encoding: "", data: [][..].into() };
    let both =
        foxglove()
            .with_json::<Parking>("parking", SCHEMA)
            .with::<Parking>("free", raw, |parking, out| out.extend(parking.free.to_string().into_bytes()));
    let topics: Vec<_> =
        shown(both).into_iter().map(|(view, bytes)| (view.topic.name.clone(), bytes.len())).collect();
    let names: Vec<&str> = topics.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["/view/parking", "/view/free", "/view/parking", "/view/free"]);
    assert_eq!(topics[1].1, 1);
}
