//! Memory is bounded: an hour of virtual time takes no more than its first minutes.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, AtomicUsize, Ordering};

use swerve_core::{Span, Time};
use swerve_flow::{
    Anchor, At, Context, Deadline, Every, Graph, Latest, Operator, Policy, Port, Reaction, RunOptions,
    RuntimeModel, Window, every, run_virtual,
};

static LIVE: AtomicIsize = AtomicIsize::new(0);
static PROBES: [AtomicIsize; 61] = [const { AtomicIsize::new(0) }; 61];
static PROBED: AtomicUsize = AtomicUsize::new(0);

struct Counting;

#[expect(unsafe_code, reason = "an allocator that counts is the only way to see what lives")]
// SAFETY: every call is passed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LIVE.fetch_add(layout.size().cast_signed(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size().cast_signed(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(ptr, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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

struct Probe;
impl Operator for Probe {
    type In = (Every, Latest<f64>);
    type Out = ();
    fn step(&mut self, _: &mut Context<'_>, _: &Self::In, (): &mut ()) {
        let index = PROBED.fetch_add(1, Ordering::Relaxed);
        PROBES[index].store(LIVE.load(Ordering::Relaxed), Ordering::Relaxed);
    }
}

#[test]
fn an_hour_takes_no_more_memory_than_its_first_minutes() {
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
    graph.add("probe", Probe, (every(Span::from_ms(60_000)), joined[2])).out();

    let report = run_virtual(graph, &RunOptions::until(Time::from_ms(3_600_000)), vec![]).unwrap();
    assert!(report.operator("detector1").unwrap().misses > 1000, "the toy graph has late and dropped frames");
    let probes: Vec<isize> = PROBES.iter().map(|probe| probe.load(Ordering::Relaxed)).collect();
    let early = probes[1..11].iter().max().unwrap();
    let late = probes[51..].iter().max().unwrap();
    // Ring buffers may still find their size in the first minutes; one leaked message a second would be 3000.
    assert!(late - early < 4096, "{early} bytes in the first ten minutes, {late} in the last: {probes:?}");
}
