//! Tests of the observers on small graphs.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;
use swerve_core::{Span, Time};
use swerve_flow::{
    At, Context, Deadline, Every, Graph, Latest, Operator, Port, RunOptions, RunReport, RuntimeModel, every,
    run_virtual,
};

use super::*;
use crate::{Log, Record, RunStart};

struct Camera;
impl Operator for Camera {
    type In = Every;
    type Out = Port<u64>;
    fn step(&mut self, cx: &mut Context, _: &Every, image: &mut Port<u64>) {
        image.send(cx.rng().bits());
    }
}

struct Planner;
impl Operator for Planner {
    type In = At<u64>;
    type Out = Port<Vec<f64>>;
    fn step(&mut self, cx: &mut Context, image: &At<u64>, plan: &mut Port<Vec<f64>>) {
        cx.spend(3);
        if let Some(image) = image.get() {
            plan.send(vec![**image as f64 / 7.0; 3]);
        }
    }
}

struct Control;
impl Operator for Control {
    type In = (Every, Latest<Vec<f64>>);
    type Out = Port<f64>;
    fn step(&mut self, _: &mut Context, (_, plan): &Self::In, command: &mut Port<f64>) {
        command.send(plan.get().map_or(0.0, |plan| plan[0]));
    }
}

fn run(observers: Vec<&mut dyn Observer>) -> RunReport {
    run_virtual(graph(250), &options(), observers).unwrap()
}

fn options() -> RunOptions {
    RunOptions::until(Time::from_ms(2000)).seed(3)
}

/// A graph of camera, planner (slowest step: `slow_ms`) and control.
fn graph(slow_ms: i64) -> Graph {
    let ms = Span::from_ms;
    let mut graph = Graph::new();
    let image = graph.add("camera", Camera, every(ms(50))).runtime(RuntimeModel::Fixed(ms(5))).origin().out();
    let cycle = RuntimeModel::Cycle([30, 80, 30, slow_ms].map(ms).to_vec());
    let plan = graph.add("planner", Planner, image).runtime(cycle).deadline(Deadline::after(ms(100))).out();
    graph.add("control", Control, (every(ms(10)), plan)).out();
    graph
}

/// Runs a graph; returns its log and report.
fn logged(graph: Graph) -> (Log, RunReport) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.mcap");
    let mut recorder = Recorder::create(&path, &RunStart::default()).unwrap();
    let report = run_virtual(graph, &options(), vec![&mut recorder]).unwrap();
    recorder.finish().unwrap();
    (Log::read(&path).unwrap(), report)
}

/// The same graph with the camera played back from a log.
fn on_camera_of(log: &Log) -> Graph {
    let mut graph = graph(250);
    graph.playback("camera", log.playback("camera")).unwrap();
    graph.playback_steps("camera", log.held("camera")).unwrap();
    graph
}

#[test]
fn replay_on_logged_sensors_is_byte_identical() {
    let (log, report) = logged(graph(250));
    let (again, repeated) = logged(on_camera_of(&log));
    assert_eq!(repeated.digest, report.digest);
    let messages = |log: &Log| log.all_publications().cloned().collect::<Vec<_>>();
    assert_eq!(messages(&log), messages(&again));
    assert!(messages(&log).len() > 200);
}

#[test]
fn replay_diverges_after_one_flipped_bit_of_an_input() {
    let (mut log, report) = logged(graph(250));
    let camera = |r: &&mut Record| matches!(r, Record::Publication(p) if p.stream.stream == "camera");
    let Some(Record::Publication(first)) = log.records.iter_mut().find(camera) else { panic!("a message") };
    let mut bytes = first.payload_cbor.to_vec();
    bytes[1] ^= 1; // the most significant byte of the number, after the CBOR type
    first.payload_cbor = bytes.into();
    let (again, repeated) = logged(on_camera_of(&log));
    assert_ne!(repeated.digest, report.digest);
    let plan = |log: &Log| log.publications("planner").next().unwrap().payload_cbor.clone();
    assert_ne!(plan(&log), plan(&again));
}

#[test]
fn recorded_run_times_reproduce_the_run() {
    let (log, report) = logged(graph(250));
    let mut graph = graph(1);
    for (operator, times) in log.run_times() {
        let _unchanged_streams = graph
            .operator(&operator)
            .unwrap()
            .runtime(RuntimeModel::Recorded(Arc::new(times.into_iter().collect())));
    }
    assert_eq!(run_virtual(graph, &options(), vec![]).unwrap().digest, report.digest);
}

#[test]
fn log_contains_every_started_step() {
    let (log, report) = logged(graph(250));
    for operator in &report.operators {
        assert_eq!(log.held(&operator.name).len() as u64, operator.steps, "{}", operator.name);
    }
    assert!(log.unfinished().count() > 0, "the last planner step was cut off");
}

#[test]
fn log_contains_the_recorded_run() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.mcap");
    let mut recorder = Recorder::create(&path, &RunStart { seed: 3, ..RunStart::default() }).unwrap();
    let mut bare = 0;
    let mut count = |event: &Event<'_>| {
        bare += usize::from(matches!(event, Event::Publication(p) if p.payload.is_none()));
    };
    let report = run(vec![&mut recorder, &mut count]);
    recorder.finish().unwrap();
    let log = Log::read(&path).unwrap();
    let end = log.end.as_ref().unwrap();
    assert_eq!((end.digest, end.at, end.reason.as_str()), (report.digest, report.at, "until"));
    assert_eq!(serde_json::from_str::<RunReport>(&end.report).unwrap(), report);
    for name in ["camera", "planner", "control"] {
        let of = report.operator(name).unwrap();
        assert_eq!(log.publications(name).count() as u64, of.messages, "{name}");
        assert_eq!(log.steps().filter(|s| s.operator == name).count() as u64, of.ended, "{name}");
    }
    assert!(bare > 0 && log.records.iter().filter(|r| matches!(r, Record::Watermark(_))).count() == bare);
    let misses = log.records.iter().filter(|r| matches!(r, Record::Miss(m) if m.reaction == "skip")).count();
    assert!(misses > 0 && misses as u64 == report.operator("planner").unwrap().misses);
    let plan = log.publications("planner").next().unwrap();
    assert_eq!(plan.decode::<Vec<f64>>().unwrap().len(), 3);
    assert_eq!((plan.header.origin, plan.stream.operator.as_str()), (Some(Time::ZERO), "planner"));
    assert!(plan.stream.type_name.contains("f64"));
}

#[test]
fn recording_and_tracing_preserve_the_digest() {
    let dir = tempfile::tempdir().unwrap();
    let mut recorder = Recorder::create(&dir.path().join("l"), &RunStart::default()).unwrap();
    let mut trace = TraceWriter::create(&dir.path().join("t"), &["control"]).unwrap();
    assert_eq!(run(vec![&mut recorder, &mut trace]).digest, run(vec![]).digest);
}

/// Start, end, and name (operator and number) of the slices, by track.
fn slices(events: &[Value]) -> BTreeMap<i64, Vec<(f64, f64, String)>> {
    let mut tracks: BTreeMap<i64, Vec<_>> = BTreeMap::new();
    for e in events.iter().filter(|e| e["ph"] == "X") {
        let start = e["ts"].as_f64().unwrap();
        let slice = (start, start + e["dur"].as_f64().unwrap(), e["name"].as_str().unwrap().to_owned());
        tracks.entry(e["tid"].as_i64().unwrap()).or_default().push(slice);
    }
    tracks
}

#[test]
fn trace_arrows_connect_each_frame_with_its_command() {
    let mut text = Vec::new();
    let mut trace = TraceWriter::to(Path::new("trace.json"), &mut text, &["control"]);
    run(vec![&mut trace]);
    trace.finish().unwrap();
    let parsed: Value = serde_json::from_slice(&text).unwrap();
    let events = parsed["traceEvents"].as_array().unwrap();
    let slices = slices(events);
    assert_eq!(slices.len(), 3, "each operator has one track");
    let mut chains: BTreeMap<i64, Vec<(String, String)>> = BTreeMap::new();
    for e in events.iter().filter(|e| ["s", "t", "f"].contains(&e["ph"].as_str().unwrap())) {
        let ts = e["ts"].as_f64().unwrap();
        let held =
            slices[&e["tid"].as_i64().unwrap()].iter().find(|(start, end, _)| *start <= ts && ts < *end);
        let (.., name) = held.expect("every arrow holds on to a slice");
        let point = (e["ph"].as_str().unwrap().to_owned(), name.clone());
        chains.entry(e["id"].as_i64().unwrap()).or_default().push(point);
    }
    let point = |phase: &str, name: &str| (phase.to_owned(), name.to_owned());
    let whole = [point("s", "camera"), point("t", "planner"), point("f", "control")];
    let complete = chains.values().filter(|chain| ***chain == whole).count();
    assert!(chains.values().all(|chain| whole.starts_with(chain)), "{chains:?}");
    assert_eq!(chains.len(), 40, "frames of 2 s published by its end");
    assert!(complete > 10, "{complete}");
    assert_eq!(events.iter().filter(|e| e["ph"] == "C").count(), complete);
}

#[test]
fn trace_events_are_ordered_by_time() {
    let mut text = Vec::new();
    let mut trace = TraceWriter::to(Path::new("trace.json"), &mut text, &["control"]);
    run(vec![&mut trace]);
    drop(trace);
    let parsed: Value = serde_json::from_slice(&text).unwrap();
    let times: Vec<f64> =
        parsed["traceEvents"].as_array().unwrap().iter().filter_map(|e| e["ts"].as_f64()).collect();
    assert!(times.len() > 350, "{}", times.len());
    let back = times.windows(2).find(|pair| pair[1] < pair[0]);
    assert_eq!(back, None);
}

/// Views that show every command, and a megabyte image every tenth time.
struct Shown(u64);

impl crate::Views for Shown {
    fn event(&mut self, event: &Event<'_>, out: &mut Vec<crate::View>) {
        let Event::Publication(p) = event else { return };
        if p.operator != "control" {
            return;
        }
        self.0 += 1;
        let is_image = self.0.is_multiple_of(10);
        let bytes = if is_image { 1 << 20 } else { 8 };
        out.push(crate::View {
            topic: std::sync::Arc::new(crate::ViewTopic {
                metadata: [("unit".to_owned(), "1".to_owned())].into(),
                file_metadata: is_image
                    .then(|| ("about".to_owned(), [("a".to_owned(), "b".to_owned())].into())),
                ..crate::ViewTopic::new(
                    if is_image { "/view/image" } else { "/view/command" }.into(),
                    crate::ViewSchema {
                        name: "Shown".into(),
                        message_encoding: "protobuf",
                        encoding: "protobuf",
                        data: vec![1].into(),
                    },
                )
            }),
            visible_at: p.visible_at,
            stamp: p.visible_at,
            bytes,
            encode: Box::new(move |out| out.resize(bytes, 7)),
        });
    }
}

#[test]
fn views_are_in_the_file_but_not_in_the_record() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.mcap");
    let mut recorder = Recorder::create(&path, &RunStart::default()).unwrap();
    recorder.show(Box::new(Shown(0)));
    let report = run_virtual(graph(250), &options(), vec![&mut recorder]).unwrap();
    let records = recorder.finish().unwrap();
    let (plain, plain_report) = logged(graph(250));
    let log = Log::read(&path).unwrap();
    assert_eq!(report.digest, plain_report.digest);
    assert_eq!(log.records.len() as u64, records);
    let messages = |log: &Log| log.all_publications().cloned().collect::<Vec<_>>();
    assert_eq!(messages(&log), messages(&plain));
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let count = |topic: &str| {
        let (id, channel) = summary.channels.iter().find(|(_, channel)| channel.topic == topic).unwrap();
        assert_eq!(
            (channel.message_encoding.as_str(), channel.metadata["kind"].as_str()),
            ("protobuf", "view")
        );
        assert_eq!(channel.metadata["unit"], "1");
        summary.stats.as_ref().unwrap().channel_message_counts[id]
    };
    let about = summary.metadata_indexes.iter().filter(|index| index.name == "about").count();
    assert_eq!(about, 1);
    let commands = log.publications("control").count() as u64;
    assert_eq!((count("/view/image"), count("/view/command")), (commands / 10, commands - commands / 10));
}
