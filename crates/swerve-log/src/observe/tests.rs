use std::collections::BTreeMap;
use std::path::Path;

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
    let ms = Span::from_ms;
    let mut graph = Graph::new();
    let image = graph.add("camera", Camera, every(ms(50))).runtime(RuntimeModel::Fixed(ms(5))).origin().out();
    let cycle = RuntimeModel::Cycle([30, 80, 30, 250].map(ms).to_vec());
    let plan = graph.add("planner", Planner, image).runtime(cycle).deadline(Deadline::after(ms(100))).out();
    graph.add("control", Control, (every(ms(10)), plan)).out();
    run_virtual(graph, &RunOptions::until(Time::from_ms(2000)).seed(3), observers).unwrap()
}

#[test]
fn a_recorded_run_is_in_its_log() {
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
fn recording_and_tracing_change_no_digest() {
    let dir = tempfile::tempdir().unwrap();
    let mut recorder = Recorder::create(&dir.path().join("l"), &RunStart::default()).unwrap();
    let mut trace = TraceWriter::create(&dir.path().join("t"), &["control"]).unwrap();
    assert_eq!(run(vec![&mut recorder, &mut trace]).digest, run(vec![]).digest);
}

/// Start, end, operator and number of the slices by track.
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
fn arrows_connect_each_frame_with_the_command_that_derives_from_it() {
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
fn events_come_in_order_of_time() {
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
