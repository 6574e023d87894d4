//! Memory is bounded: an hour of virtual time takes no more memory than its first minutes.

use crate::{
    Anchor, At, Context, Deadline, Every, Graph, Latest, Operator, Policy, Port, Reaction, RunOptions,
    RuntimeModel, Window, every, run_virtual,
};
use swerve_core::{Span, Time};

struct Camera;
impl Operator for Camera {
    type In = (Every, Latest<f64>);
    type Out = Port<Vec<u64>>;
    fn step(&mut self, cx: &mut Context<'_>, _: &Self::In, out: &mut Self::Out) {
        let noise = (0..32).map(|_| cx.rng().bits()).collect();
        out.send(noise);
    }
}

struct Detector;
impl Operator for Detector {
    type In = At<Vec<u64>>;
    type Out = Port<f64>;
    fn step(&mut self, _: &mut Context<'_>, image: &Self::In, out: &mut Self::Out) {
        out.send(image.get().map_or(0.0, |image| image.iter().map(|x| *x as f64).sum()));
    }
}

struct Tracker;
impl Operator for Tracker {
    type In = (At<f64>, At<Vec<u64>>, Window<f64, 5>);
    type Out = Port<f64>;
    fn step(&mut self, _: &mut Context<'_>, (_, _, window): &Self::In, out: &mut Self::Out) {
        out.send(window.get().iter().map(|x| **x).sum());
    }
}

/// A graph with drops, deadlines, feedback and a shared resource.
fn busy() -> Graph {
    let ms = Span::from_ms;
    let normal = |mean, deviation| RuntimeModel::Normal { mean: ms(mean), deviation: ms(deviation) };
    let mut graph = Graph::new();
    let gpu = graph.resource("gpu", 1);
    let feedback = graph.feedback("feedback");
    let image =
        graph.add("camera", Camera, (every(ms(50)), feedback)).runtime(normal(5, 2)).delay(ms(7)).out();
    let mut joined = Vec::new();
    for (i, policy) in [Policy::SkipToLatest, Policy::queue(3), Policy::pipelined(3)].into_iter().enumerate()
    {
        let deadline = Deadline::after(ms(90)).reaction(Reaction::ReuseLast);
        let detector =
            graph.add(format!("detector{i}"), Detector, image).runtime(normal(40, 25)).policy(policy);
        let boxes = if i < 2 { detector.uses(gpu) } else { detector }.deadline(deadline).out();
        let late = Deadline::after(ms(30)).anchor(Anchor::Stamp);
        let tracker = graph.add(format!("tracker{i}"), Tracker, (boxes, image, boxes)).runtime(normal(10, 5));
        joined.push(tracker.deadline(late.reaction(Reaction::OnDeadline)).policy(Policy::queue(2)).out());
    }
    graph.connect(feedback, joined[0]);
    graph
}

/// Peak memory of a run of `minutes` minutes, bytes.
fn peak(minutes: i64) -> u64 {
    let mut graph = Some(busy());
    let options = RunOptions::until(Time::from_ms(60_000 * minutes));
    let used = allocation_counter::measure(|| {
        let report = run_virtual(graph.take().unwrap(), &options, vec![]).unwrap();
        let misses = report.operator("detector1").unwrap().misses;
        assert!(misses > 10 * minutes.unsigned_abs(), "the toy graph has late and dropped frames");
    });
    used.bytes_max
}

#[test]
fn an_hour_takes_no_more_memory_than_its_first_minutes() {
    let (early, hour) = (peak(10), peak(60));
    // Ring buffers may still grow in the first minutes; one leaked message per second would be 3000 messages.
    assert!(hour < early + 4096, "{early} bytes in the first ten minutes, {hour} in an hour");
}
