//! Dataflow engine: cost of a hop, of a wake-up, of a large payload; steps per second, threads, memory.
//!
//! Every run has an observer, as in production. Peers run alternately with Swerve, round by round, so that host noise
//! affects both.

use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize, Serializer};
use swerve_benches::{Goal, Rows, Sample, is_asked, is_asked_to_measure, now, resident_kib, sleep_ms};
use swerve_core::{Span, Time};
use swerve_flow::{
    Anchor, At, Context, Deadline, Event, Every, Graph, Latest, Observer, Operator, Policy, Port, Reaction,
    RunOptions, RuntimeModel, every, run_virtual, run_wall,
};

const ROUNDS: usize = 7;

/// 64 bytes, as in the peers' measurements.
type Small = [u64; 8];

struct Ticker;
impl Operator for Ticker {
    type In = Every;
    type Out = Port<Small>;
    fn step(&mut self, cx: &mut Context<'_>, _: &Every, out: &mut Port<Small>) {
        out.send([cx.stamp().ns() as u64; 8]);
    }
}

/// Makes 64 bytes from its 64 bytes of input.
struct Copy;
impl Operator for Copy {
    type In = At<Small>;
    type Out = Port<Small>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<Small>, out: &mut Port<Small>) {
        if let Some(message) = input.get() {
            let mut value = **message;
            value[0] = value[0].wrapping_add(1);
            out.send(value);
        }
    }
}

/// Passes its input on.
struct Through;
impl Operator for Through {
    type In = At<Small>;
    type Out = Port<Small>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<Small>, out: &mut Port<Small>) {
        if let Some(message) = input.get() {
            out.pass_on(message);
        }
    }
}

struct Sink;
impl Operator for Sink {
    type In = At<Small>;
    type Out = ();
    fn step(&mut self, _: &mut Context<'_>, input: &At<Small>, (): &mut ()) {
        black_box(input.get().map(|message| message[0]));
    }
}

/// Counts messages; represents the observers of every run (log, metrics) without their run time.
#[derive(Default)]
struct Watcher {
    messages: u64,
}

impl Observer for Watcher {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(publication) = event {
            self.messages += u64::from(publication.payload.is_some());
        }
    }
}

/// Nanoseconds per frame of a ticker, `hops` operators and a sink.
fn frame_ns<O: Operator<In = At<Small>, Out = Port<Small>>>(hop: impl Fn() -> O, hops: usize) -> f64 {
    const FRAMES: i64 = 200_000;
    let mut graph = Graph::new();
    let mut stream = graph.add("ticker", Ticker, every(Span::from_us(1))).out();
    for k in 0..hops {
        stream = graph.add(format!("hop{k}"), hop(), stream).out();
    }
    graph.add("sink", Sink, stream).out();
    let began = now();
    let until = Time::from_ns(1000 * (FRAMES - 1));
    let mut watcher = Watcher::default();
    let report = run_virtual(graph, &RunOptions::until(until), vec![&mut watcher]).expect("a sound graph");
    let ns = began.elapsed().as_nanos() as f64;
    assert_eq!(watcher.messages, FRAMES as u64 * (1 + hops as u64));
    assert_eq!(report.operator("sink").map(|sink| sink.steps), Some(FRAMES as u64));
    ns / FRAMES as f64
}

/// Nanoseconds of one send and receive of a bounded channel, both ends in one thread that never sleeps.
fn channel_ns(messages: u64) -> f64 {
    let (sender, receiver) = crossbeam_channel::bounded::<Small>(16);
    let began = now();
    for k in 0..messages {
        let _ = sender.send(black_box([k; 8]));
        black_box(receiver.recv().ok());
    }
    began.elapsed().as_nanos() as f64 / messages as f64
}

fn hops(rows: &mut Rows) {
    const HOPS: usize = 8;
    let (mut passed, mut made, mut channel) = (vec![], vec![], vec![]);
    for _ in 0..ROUNDS {
        passed.push((frame_ns(|| Through, 1 + HOPS) - frame_ns(|| Through, 1)) / HOPS as f64);
        made.push((frame_ns(|| Copy, 1 + HOPS) - frame_ns(|| Copy, 1)) / HOPS as f64);
        channel.push(channel_ns(1_000_000));
    }
    let (passed, made, channel) = (Sample::new(passed), Sample::new(made), Sample::new(channel));
    rows.row("added inline hop, 64 B passed on", passed.median(), &passed.text(1, "ns"), Goal::Most(150.0));
    let what = "added inline hop, 64 B made anew, allocated and digested";
    rows.row(what, made.median(), &made.text(1, "ns"), Goal::Most(150.0));
    let what = "crossbeam bounded, send and receive of 64 B, one thread";
    rows.row(what, channel.median(), &channel.text(1, "ns"), Goal::None);
}

/// Send time, nanoseconds on the benchmark's clock.
#[derive(Serialize, Deserialize, Clone)]
struct Sent {
    at_ns: u64,
}

/// The benchmark's clock and the receivers' measurements.
#[derive(Clone)]
struct Stopwatch {
    begin: std::time::Instant,
    us: Arc<Mutex<Vec<f64>>>,
}

impl Stopwatch {
    fn new() -> Self {
        Self { begin: now(), us: Arc::default() }
    }

    fn ns(&self) -> u64 {
        self.begin.elapsed().as_nanos() as u64
    }

    fn take(&self, sent: &Sent) {
        let us = (self.ns() - sent.at_ns) as f64 * 1e-3;
        self.us.lock().unwrap_or_else(PoisonError::into_inner).push(us);
    }

    fn sample(&self) -> Sample {
        Sample::new(self.us.lock().unwrap_or_else(PoisonError::into_inner).clone())
    }
}

struct Pass;
impl Operator for Pass {
    type In = At<Sent>;
    type Out = Port<Sent>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<Sent>, out: &mut Port<Sent>) {
        if let Some(message) = input.get() {
            out.send((**message).clone());
        }
    }
}

struct Arrived(Stopwatch);
impl Operator for Arrived {
    type In = At<Sent>;
    type Out = ();
    fn step(&mut self, _: &mut Context<'_>, input: &At<Sent>, (): &mut ()) {
        if let Some(message) = input.get() {
            self.0.take(message);
        }
    }
}

const PACED: u64 = 400;

/// A sensor thread at 1 kHz, the engine asleep, six operators, the sixth of which takes the time.
fn engine_wake_us() -> Sample {
    let watch = Stopwatch::new();
    let mut graph = Graph::new();
    let (mut stream, handle) = graph.source::<Sent>("sensor");
    for k in 0..5 {
        stream = graph.add(format!("op{k}"), Pass, stream).out();
    }
    graph.add("sink", Arrived(watch.clone()), stream).out();
    let sender = watch.clone();
    let sensor = std::thread::spawn(move || {
        for _ in 0..PACED {
            sleep_ms(1);
            let _ = handle.send_now(Sent { at_ns: sender.ns() });
        }
    });
    run_wall(graph, &RunOptions::default(), vec![&mut Watcher::default()]).expect("a sound graph");
    sensor.join().expect("the sensor does not panic");
    watch.sample()
}

/// The same rate through a bounded channel to one sleeping receiver.
fn channel_wake_us() -> Sample {
    let watch = Stopwatch::new();
    let (sender, receiver) = crossbeam_channel::bounded::<Arc<Sent>>(16);
    let clock = watch.clone();
    let sensor = std::thread::spawn(move || {
        for _ in 0..PACED {
            sleep_ms(1);
            let _ = sender.send(Arc::new(Sent { at_ns: clock.ns() }));
        }
    });
    while let Ok(sent) = receiver.recv() {
        watch.take(&sent);
    }
    sensor.join().expect("the sensor does not panic");
    watch.sample()
}

fn wakes(rows: &mut Rows) {
    let (mut ours, mut channel, mut ratios) = (vec![], vec![], vec![]);
    for _ in 0..ROUNDS {
        let (engine, bare) = (engine_wake_us(), channel_wake_us());
        ratios.push(engine.median() / bare.median());
        ours.push(engine.median());
        channel.push(bare.median());
    }
    let (ours, channel, ratios) = (Sample::new(ours), Sample::new(channel), Sample::new(ratios));
    rows.row(
        "sensor thread -> engine asleep -> 6 operators, 1 kHz",
        ours.median(),
        &ours.text(1, "us"),
        Goal::None,
    );
    rows.row(
        "crossbeam bounded, receiver asleep, 1 kHz",
        channel.median(),
        &channel.text(1, "us"),
        Goal::None,
    );
    rows.row("  the former over the latter", ratios.median(), &ratios.text(2, "x"), Goal::Most(1.5));
}

/// 6 MiB, the size of an image.
#[derive(Serialize, Deserialize)]
struct Image(#[serde(serialize_with = "as_bytes")] Vec<u8>);

fn as_bytes<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}

const IMAGE_BYTES: usize = 6 << 20;
static SENT_FROM: AtomicU64 = AtomicU64::new(0);
static SEEN_AT: AtomicU64 = AtomicU64::new(0);

struct Camera(Arc<Image>);
impl Operator for Camera {
    type In = Every;
    type Out = Port<Image>;
    fn step(&mut self, _: &mut Context<'_>, _: &Every, out: &mut Port<Image>) {
        SENT_FROM.store(self.0.0.as_ptr() as u64, Ordering::Relaxed);
        out.forward(self.0.clone());
    }
}

struct Crop;
impl Operator for Crop {
    type In = At<Image>;
    type Out = Port<Image>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<Image>, out: &mut Port<Image>) {
        if let Some(image) = input.get() {
            out.pass_on(image);
        }
    }
}

struct Screen;
impl Operator for Screen {
    type In = At<Image>;
    type Out = ();
    fn step(&mut self, _: &mut Context<'_>, input: &At<Image>, (): &mut ()) {
        if let Some(image) = input.get() {
            SEEN_AT.store(image.0.as_ptr() as u64, Ordering::Relaxed);
        }
    }
}

/// Microseconds per frame of 6 MiB through a camera, `hops` operators that pass it on, and a sink.
fn image_us(hops: usize, frames: i64) -> f64 {
    let mut graph = Graph::new();
    let mut image =
        graph.add("camera", Camera(Arc::new(Image(vec![7; IMAGE_BYTES]))), every(Span::from_ms(1))).out();
    for k in 0..hops {
        image = graph.add(format!("crop{k}"), Crop, image).out();
    }
    graph.add("screen", Screen, image).out();
    let began = now();
    let (options, mut watcher) = (RunOptions::until(Time::from_ms(frames - 1)), Watcher::default());
    run_virtual(graph, &options, vec![&mut watcher]).expect("a sound graph");
    began.elapsed().as_secs_f64() * 1e6 / frames as f64
}

fn images(rows: &mut Rows) {
    let (mut added, mut copies) = (vec![], vec![]);
    let source = vec![7_u8; IMAGE_BYTES];
    for _ in 0..ROUNDS {
        added.push((image_us(5, 40) - image_us(1, 40)) / 4.0);
        let began = now();
        (0..40).for_each(|_| drop(black_box(source.clone())));
        copies.push(began.elapsed().as_secs_f64() * 1e6 / 40.0);
    }
    let same = SENT_FROM.load(Ordering::Relaxed) == SEEN_AT.load(Ordering::Relaxed);
    let copied = if same { 0.0 } else { 1.0 };
    rows.row(
        "6 MiB through 6 operators: copies",
        copied,
        if same { "0, the same address" } else { "copied" },
        Goal::Most(0.0),
    );
    let (added, copies) = (Sample::new(added), Sample::new(copies));
    rows.row("  added hop of 6 MiB passed on", added.median(), &added.text(1, "us"), Goal::None);
    rows.row("  one copy of 6 MiB, for scale", copies.median(), &copies.text(1, "us"), Goal::None);
}

/// Four operators with fixed run times and deadlines, one of which is occasionally missed.
fn pipeline(period: Span) -> Graph {
    let us = Span::from_us;
    let mut graph = Graph::new();
    let fixed = |n| RuntimeModel::Fixed(us(n));
    let late = |n| Deadline::after(us(n)).reaction(Reaction::ReuseLast);
    let camera = graph.add("camera", Ticker, every(period)).runtime(fixed(5)).deadline(late(40)).out();
    let detector = graph.add("detector", Copy, camera).runtime(fixed(40)).deadline(late(60)).out();
    let tracker =
        graph.add("tracker", Copy, detector).runtime(fixed(5)).deadline(late(30)).policy(Policy::queue(2));
    let tracker = tracker.out();
    let planner = graph.add("planner", Copy, tracker).runtime(fixed(20));
    planner.deadline(late(100).anchor(Anchor::Stamp)).policy(Policy::pipelined(2)).out();
    graph
}

fn steps(rows: &mut Rows) {
    let mut rates = vec![];
    for _ in 0..ROUNDS {
        let graph = pipeline(Span::from_us(50));
        let began = now();
        let (options, mut watcher) = (RunOptions::until(Time::from_ms(10_000)), Watcher::default());
        let report = run_virtual(graph, &options, vec![&mut watcher]).expect("a sound graph");
        let steps: u64 = report.operators.iter().map(|operator| operator.steps).sum();
        rates.push(steps as f64 / began.elapsed().as_secs_f64() * 1e-6);
    }
    let rates = Sample::new(rates);
    let what = "operator steps per second, virtual time, one core, millions";
    rows.row(what, rates.median(), &rates.text(2, "M/s"), Goal::Least(3.0));
}

/// Computes for some milliseconds.
struct Heavy;
impl Operator for Heavy {
    type In = (Every, Latest<u64>);
    type Out = Port<u64>;
    fn step(&mut self, cx: &mut Context<'_>, _: &Self::In, out: &mut Port<u64>) {
        let mut x = cx.stamp().ns() as u64 | 1;
        for _ in 0..4_000_000 {
            x = black_box(x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
        }
        out.send(x);
    }
}

fn heavy_ms(threads: usize) -> (f64, u64) {
    let mut graph = Graph::new();
    for name in ["left", "right"] {
        let back = graph.feedback(format!("{name} again"));
        let out = graph
            .add(name, Heavy, (every(Span::from_ms(10)), back))
            .runtime(RuntimeModel::Fixed(Span::from_ms(8)));
        let out = out.heavy().out();
        graph.connect(back, out);
    }
    let began = now();
    let options = RunOptions::until(Time::from_ms(240)).threads(threads);
    let report = run_virtual(graph, &options, vec![&mut Watcher::default()]).expect("a sound graph");
    (began.elapsed().as_secs_f64() * 1e3, report.overlapped_steps)
}

/// Speed-up of two bare threads over one with the same work, on this host at this moment.
fn bare_ratio() -> f64 {
    let work = || {
        let mut x = 1_u64;
        for _ in 0..100_000_000_u64 {
            x = black_box(x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
        }
        x
    };
    let began = now();
    black_box((work(), work()));
    let one_s = began.elapsed().as_secs_f64();
    let began = now();
    std::thread::scope(|scope| {
        scope.spawn(work);
        black_box(work());
    });
    one_s / began.elapsed().as_secs_f64()
}

fn threads(rows: &mut Rows) {
    let (mut ratios, mut bare) = (vec![], vec![]);
    let mut overlapped = 0;
    for _ in 0..ROUNDS {
        let (one, _) = heavy_ms(1);
        let (two, both) = heavy_ms(2);
        overlapped = both;
        ratios.push(one / two);
        bare.push(bare_ratio());
    }
    let (ratios, bare) = (Sample::new(ratios), Sample::new(bare));
    let what = "two independent heavy operators, 2 threads over 1";
    rows.row(what, ratios.median(), &ratios.text(2, "x"), Goal::Least(1.6));
    rows.row("  steps that overlapped, of 50", overlapped as f64, &overlapped.to_string(), Goal::None);
    rows.row("  the same work in bare threads, 2 over 1", bare.median(), &bare.text(2, "x"), Goal::None);
}

static RESIDENT: [AtomicU64; 2] = [const { AtomicU64::new(0) }; 2];

/// Records the resident memory at message 100,000 and at message 1,000,000.
struct Probe(u64);
impl Operator for Probe {
    type In = At<Small>;
    type Out = ();
    fn step(&mut self, _: &mut Context<'_>, _: &At<Small>, (): &mut ()) {
        self.0 += 1;
        match self.0 {
            100_000 => RESIDENT[0].store(resident_kib(), Ordering::Relaxed),
            1_000_000 => RESIDENT[1].store(resident_kib(), Ordering::Relaxed),
            _ => {}
        }
    }
}

fn memory(rows: &mut Rows) {
    let mut graph = Graph::new();
    let ticker = graph
        .add("ticker", Ticker, every(Span::from_us(10)))
        .runtime(RuntimeModel::Fixed(Span::from_us(3)))
        .out();
    let late = Deadline::after(Span::from_us(30)).reaction(Reaction::ReuseLast);
    let copy = graph.add("copy", Copy, ticker).runtime(RuntimeModel::Fixed(Span::from_us(25)));
    let copy = copy.policy(Policy::pipelined(4)).deadline(late).out();
    graph.add("probe", Probe(0), copy).out();
    let options = RunOptions::until(Time::from_ms(11_000));
    run_virtual(graph, &options, vec![&mut Watcher::default()]).expect("a sound graph");
    let [early, late] = [&RESIDENT[0], &RESIDENT[1]].map(|r| r.load(Ordering::Relaxed) as f64);
    if early == 0.0 {
        return rows.skipped("resident memory, message 1e5 to 1e6", "the system does not report it");
    }
    let percent = (late / early - 1.0) * 100.0;
    let reads = format!("{percent:+.2} % of {:.1} MiB", early / 1024.0);
    rows.row("resident memory, message 1e5 to 1e6", percent.abs(), &reads, Goal::Most(1.0));
}

/// A part of the benchmark.
type Part = fn(&mut Rows);

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    // Memory first, while the process is small.
    let parts: [(&str, Part); 6] = [
        ("memory", memory),
        ("hops", hops),
        ("wakes", wakes),
        ("images", images),
        ("steps", steps),
        ("threads", threads),
    ];
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "engine");
    for (_, part) in parts.into_iter().filter(|(name, _)| is_asked(name)) {
        part(&mut rows);
    }
    rows.finish();
}
