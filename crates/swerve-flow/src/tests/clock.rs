//! Section 8: wall clock, record, replay. Section 4: the result does not depend on the number of threads.

use std::thread;

use swerve_core::Time;

use super::net::*;
use crate::*;

#[test]
fn s8_wall_clock_reports_how_timers_kept_time() {
    struct Slow;
    impl Operator for Slow {
        type In = Every;
        type Out = ();
        fn step(&mut self, cx: &mut Context<'_>, _: &Every, _: &mut ()) {
            // The third tick delays the operator by five periods.
            let until = Time::from_ms(70);
            if cx.stamp() == Time::from_ms(20) {
                let begin = crate::host::now();
                while Time::from_ns(crate::host::ns_since(begin) as i64) < until {}
            }
        }
    }
    let mut graph = Graph::new();
    graph.add("slow", Slow, every(ms(10))).out();
    let report = run_wall(graph, &RunOptions::until(Time::from_ms(150)), vec![]).unwrap();
    let ticks = report.operator("slow").unwrap().ticks.unwrap();
    assert_eq!(ticks.ticks, 16, "late ones are taken all the same");
    assert!(ticks.missed >= 5 && ticks.max_ns >= 60_000_000, "{ticks:?}");
    let mut graph = Graph::new();
    graph.add("slow", Slow, every(ms(10))).out();
    let report = run_virtual(graph, &RunOptions::until(Time::from_ms(10)), vec![]).unwrap();
    assert_eq!(report.operator("slow").unwrap().ticks, None);
}

/// Records the data needed to repeat a run.
#[derive(Default)]
struct Recorder {
    decisions: Vec<Decision>,
    published: Vec<(String, PlaybackRecord)>,
    steps: Vec<(String, Time, Time)>,
}

impl Observer for Recorder {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Publication(p) => self.published.push((p.operator.into(), PlaybackRecord::of(p))),
            Event::StepEnd(s) => self.steps.push((s.operator.into(), s.start, s.end)),
            Event::Decision(decision) => self.decisions.push((*decision).clone()),
            _ => {}
        }
    }
}

impl Recorder {
    fn of(&self, operator: &str) -> Vec<PlaybackRecord> {
        let of = self.published.iter().filter(|(name, _)| name == operator);
        of.map(|(_, record)| record.clone()).collect()
    }
}

/// Spins until its deadline, or for the number of rounds in its input.
struct Spin;

impl Operator for Spin {
    type In = At<u64>;
    type Out = Port<u64>;

    fn step(&mut self, cx: &mut Context<'_>, input: &At<u64>, out: &mut Port<u64>) {
        let rounds = input.get().map_or(0, |rounds| **rounds);
        let mut value = rounds;
        for n in 0..rounds {
            value =
                (0..50).fold(value, |value, _| value.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(n));
            if n % 100 == 0 {
                cx.offer(out, value);
                if cx.spend(1) == Progress::Stop {
                    // Half of the steps leave the answer to the reaction.
                    if rounds.is_multiple_of(2) {
                        out.send(n);
                    }
                    return;
                }
            }
        }
        out.send(value);
    }

    fn on_deadline(miss: &Miss<Port<u64>>, out: &mut Port<u64>) {
        out.send(miss.offered.as_deref().or(miss.last.as_deref()).copied().unwrap_or(0));
    }
}

fn wall_graph(threads_worth: bool) -> (Graph, SourceHandle<u64>) {
    let mut graph = Graph::new();
    let (source, handle) = graph.source::<u64>("source");
    let deadline = Deadline::after(swerve_core::Span::from_us(1500)).reaction(Reaction::OnDeadline);
    let mut spin = graph.add("spin", Spin, source).policy(Policy::pipelined(2)).deadline(deadline);
    if threads_worth {
        spin = spin.heavy();
    } else {
        spin = spin.runtime(RuntimeModel::Measured { scale: 1.0 });
    }
    let spun = spin.out();
    let quick = graph.add("quick", Half, spun).out();
    graph.add("join", Join, (quick, spun)).policy(Policy::queue(100)).out();
    (graph, handle)
}

struct Half;

impl Operator for Half {
    type In = At<u64>;
    type Out = Port<u64>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<u64>, out: &mut Port<u64>) {
        if let Some(value) = input.get() {
            out.send(**value / 2);
        }
    }
}

struct Join;

impl Operator for Join {
    type In = (At<u64>, At<u64>);
    type Out = Port<u64>;
    fn step(&mut self, _: &mut Context<'_>, (a, b): &Self::In, out: &mut Port<u64>) {
        out.send(a.get().map_or(1, |a| **a).wrapping_add(b.get().map_or(2, |b| **b)));
    }
}

fn repeats_in_virtual_time(threads_worth: bool) {
    let (graph, handle) = wall_graph(threads_worth);
    let feeder = thread::spawn(move || {
        for rounds in [1_u64, 500, 1_000_000, 20, 1_000_001, 3, 200, 5_001, 7_000] {
            handle.send_now(rounds).unwrap();
            // Delay the next message while the engine works; its progress depends on the real clock.
            std::hint::black_box((0..rounds * 10).fold(0_u64, |a, b| a.wrapping_add(b)));
        }
    });
    let mut recorder = Recorder::default();
    let wall = run_wall(graph, &RunOptions::default().threads(2), vec![&mut recorder]).unwrap();
    feeder.join().unwrap();
    assert_eq!(wall.end, EndReason::Idle);
    assert!(wall.operator("source").unwrap().messages == 9);
    assert!(recorder.decisions.iter().any(|decision| matches!(decision, Decision::RunTime { .. })));

    let json = serde_json::to_string(&recorder.decisions).unwrap();
    let decisions: Vec<Decision> = serde_json::from_str(&json).unwrap();
    for threads in [1, 3] {
        let (mut graph, _handle) = wall_graph(threads_worth);
        graph.playback("source", recorder.of("source")).unwrap();
        let replay = decisions.iter().cloned().collect();
        let mut again = Recorder::default();
        let report =
            run_replay(graph, &RunOptions::default().threads(threads), replay, vec![&mut again]).unwrap();
        assert_eq!(report.digest, wall.digest);
        let lines = |recorder: &Recorder| format!("{:?}", recorder.published);
        assert_eq!(lines(&again), lines(&recorder));
    }
}

#[test]
fn s8_a_wall_clock_run_replays_bit_for_bit_with_workers() {
    repeats_in_virtual_time(true);
}

#[test]
fn s8_a_wall_clock_run_replays_bit_for_bit_on_one_thread() {
    repeats_in_virtual_time(false);
}

#[test]
fn s8_a_wall_clock_run_ends_when_asked_or_when_its_time_is_over() {
    let mut net = Net::new();
    net.stage("work", tick(1)).out();
    let report = run_wall(net.graph, &RunOptions::until(at(3)), vec![]).unwrap();
    assert_eq!((report.end, report.operators[0].messages), (EndReason::Until, 4));

    let (graph, handle) = wall_graph(false);
    let stop = graph.stop_handle();
    stop.stop();
    assert_eq!(run_wall(graph, &RunOptions::default(), vec![]).unwrap().end, EndReason::Interrupted);
    assert_eq!(handle.send_now(1), Err(SendError::Over));
}

#[test]
fn s8_a_source_cannot_go_back() {
    let mut graph = Graph::new();
    let (source, handle) = graph.source::<i64>("source");
    graph.add("work", Keep, source).policy(Policy::queue(9)).out();
    handle.send(at(10), 1).unwrap();
    handle.send(at(10), 2).unwrap();
    handle.advance(at(30)).unwrap();
    handle.send(at(20), 3).unwrap();
    handle.send(at(40), 4).unwrap();
    drop(handle);
    let report = run_wall(graph, &RunOptions::default(), vec![]).unwrap();
    let source = report.operator("source").unwrap();
    assert_eq!((source.messages, source.drops.too_late), (2, 2));
    assert_eq!(report.operator("work").unwrap().messages, 2);
}

struct Keep;

impl Operator for Keep {
    type In = At<i64>;
    type Out = Port<i64>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<i64>, out: &mut Port<i64>) {
        if let Some(message) = input.get() {
            out.forward(message.shared());
        }
    }
}

#[test]
fn s8_operators_upstream_of_a_cut_can_be_played_back() {
    let build = || {
        let mut net = Net::new();
        let gpu = net.graph.resource("gpu", 1);
        let camera = net.stage("camera", tick(50)).runtime(fixed(5)).origin().out();
        let model = RuntimeModel::Normal { mean: ms(60), deviation: ms(30) };
        let deadline = Deadline::after(ms(70)).reaction(Reaction::ReuseLast);
        let detector =
            net.stage("detector", join(&[camera])).runtime(model.clone()).uses(gpu).deadline(deadline).out();
        let lanes = net.stage("lanes", join(&[camera])).runtime(fixed(20)).uses(gpu).out();
        let tracker =
            net.stage("tracker", join(&[detector, lanes])).runtime(fixed(3)).policy(Policy::queue(4)).out();
        net.stage("planner", join(&[tracker]).latest(lanes))
            .runtime(model)
            .policy(Policy::pipelined(2))
            .out();
        net.graph
    };
    let run = |graph| {
        let mut recorder = Recorder::default();
        run_virtual(graph, &RunOptions::until(at(3000)).seed(5), vec![&mut recorder]).unwrap();
        recorder
    };
    let all = run(build());
    for cut in [
        &["camera"][..],
        &["camera", "detector"],
        &["detector", "lanes"],
        &["camera", "detector", "lanes"],
        &["tracker", "lanes"],
    ] {
        let mut graph = build();
        for operator in cut {
            graph.playback(operator, all.of(operator)).unwrap();
            // `detector` and `lanes` share the GPU: the one that is recomputed has to wait for the other.
            let steps = all.steps.iter().filter(|(name, ..)| name == operator);
            graph.playback_steps(operator, steps.map(|&(_, start, end)| (start, end)).collect()).unwrap();
        }
        let again = run(graph);
        for operator in ["camera", "detector", "lanes", "tracker", "planner"] {
            assert_eq!(
                format!("{:?}", again.of(operator)),
                format!("{:?}", all.of(operator)),
                "{operator} after {cut:?}"
            );
        }
    }
}

#[test]
fn s8_records_of_another_type_or_port_are_refused() {
    let mut net = Net::new();
    net.stage("work", tick(10)).out();
    let wrong = PlaybackRecord::message(at(0), at(0), "text".to_string());
    let error = net.graph.playback("work", vec![wrong]).unwrap_err().to_string();
    assert_eq!(error, "operator `work`, record of stamp 0.000 s: expected i64, found alloc::string::String");
    let mut wrong = PlaybackRecord::message(at(0), at(0), 1_i64);
    wrong.message.as_mut().unwrap().payload = PlaybackPayload::cbor(vec![0x61, b'x']);
    assert!(matches!(net.graph.playback("work", vec![wrong]), Err(GraphError::PlaybackPayload { .. })));
    let mut wrong = PlaybackRecord::message(at(0), at(0), 1_i64);
    wrong.port = 1;
    assert!(matches!(net.graph.playback("work", vec![wrong]), Err(GraphError::PlaybackPort { port: 1, .. })));
    assert!(matches!(net.graph.playback("nobody", vec![]), Err(GraphError::UnknownOperator { .. })));
}

/// Computes long enough for steps on several workers to overlap.
struct Heavy;

impl Operator for Heavy {
    type In = At<i64>;
    type Out = Port<f64>;
    fn step(&mut self, cx: &mut Context<'_>, _: &At<i64>, out: &mut Port<f64>) {
        let mut x = cx.rng().unit();
        for _ in 0..20_000 {
            x = (x * 3.9 * (1.0 - x)).abs();
        }
        cx.spend(3);
        out.send(x);
    }
}

fn heavy_graph() -> Graph {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(50)).runtime(fixed(5)).out();
    let normal = RuntimeModel::Normal { mean: ms(40), deviation: ms(20) };
    let work = RuntimeModel::Work { base: ms(20), per_unit_ns: 9e6 };
    let models = [normal, work, fixed(60)];
    for (i, model) in models.into_iter().enumerate() {
        let deadline = Deadline::after(ms(48)).reaction(Reaction::ReuseLast);
        let heavy = net.graph.add(format!("heavy{i}"), Heavy, camera).runtime(model).heavy();
        let stream = heavy.deadline(deadline).policy(Policy::pipelined(1 + i)).out();
        net.graph.add(format!("after{i}"), After, (stream, camera)).runtime(fixed(i as i64)).out();
    }
    net.graph
}

struct After;

impl Operator for After {
    type In = (At<f64>, Latest<i64>);
    type Out = Port<f64>;
    fn step(&mut self, _: &mut Context<'_>, (heavy, camera): &Self::In, out: &mut Port<f64>) {
        out.send(heavy.get().map_or(0.0, |x| **x) + camera.get().map_or(0.0, |n| **n as f64));
    }
}

#[test]
fn s4_the_digest_is_the_same_on_any_number_of_threads() {
    let run =
        |threads| run_virtual(heavy_graph(), &RunOptions::until(at(2000)).threads(threads), vec![]).unwrap();
    let one = run(1);
    assert_eq!(one.overlapped_steps, 0);
    let mut overlapped = 0;
    for repeat in 0..20 {
        for threads in [2, 8] {
            let report = run(threads);
            overlapped += report.overlapped_steps;
            assert_eq!(report.digest, one.digest, "{threads} threads, repeat {repeat}");
            assert_eq!(report.operators, one.operators);
        }
    }
    assert!(overlapped > 0, "steps ran side by side");
}

#[test]
fn s3_steps_of_one_sweep_overlap_on_two_threads() {
    use std::sync::{Arc, Barrier};
    /// Returns only once the other operator has started too.
    struct Meet(Arc<Barrier>);
    impl Operator for Meet {
        type In = At<i64>;
        type Out = Port<i64>;
        fn step(&mut self, cx: &mut Context<'_>, _: &At<i64>, out: &mut Port<i64>) {
            self.0.wait();
            out.send(cx.stamp().ns());
        }
    }
    let mut net = Net::new();
    let source = net.instant_messages("source", 10, 50);
    let barrier = Arc::new(Barrier::new(2));
    for name in ["left", "right"] {
        net.graph.add(name, Meet(barrier.clone()), source).runtime(fixed(5)).heavy().out();
    }
    let report = run_virtual(net.graph, &RunOptions::until(at(100)).threads(2), vec![]).unwrap();
    assert_eq!(report.overlapped_steps, 6);
    assert_eq!(report.operator("right").unwrap().messages, 6);
}

#[test]
fn a_panicking_operator_is_reported_by_name_and_ends_the_run_cleanly() {
    struct Fragile;
    impl Operator for Fragile {
        type In = At<i64>;
        type Out = Port<i64>;
        fn step(&mut self, cx: &mut Context<'_>, _: &At<i64>, out: &mut Port<i64>) {
            assert!(cx.stamp() < at(20), "cannot stand {}", cx.stamp());
            out.send(1);
        }
    }
    for (threads, heavy) in [(1, false), (2, true)] {
        let mut net = Net::new();
        let source = net.instant_messages("source", 10, 50);
        let fragile = net.graph.add("fragile", Fragile, source).runtime(fixed(5));
        if heavy {
            fragile.heavy().out()
        } else {
            fragile.out()
        };
        let log = Log::default();
        let mut recorder = log.clone();
        let options = RunOptions::until(at(100)).threads(threads);
        let error = run_virtual(net.graph, &options, vec![&mut recorder]).unwrap_err();
        assert_eq!(error.to_string(), "operator `fragile` panicked: cannot stand 0.020 s");
        assert_eq!(log.messages("fragile"), [(0, 5), (10, 15)]);
        assert!(matches!(log.report().end, EndReason::Failed(_)));
    }
}

#[test]
fn a_virtual_run_ends_when_asked() {
    let mut net = Net::new();
    net.stage("work", tick(1)).out();
    net.graph.stop_handle().stop();
    let report = run_virtual(net.graph, &RunOptions::until(at(30)), vec![]).unwrap();
    assert_eq!((report.end, report.at), (EndReason::Interrupted, Time::ZERO));
}

/// Counts its steps.
struct Count(std::sync::Arc<std::sync::atomic::AtomicU64>);

impl Operator for Count {
    type In = (Every, Latest<u64>);
    type Out = Port<u64>;

    fn step(&mut self, _: &mut Context<'_>, (_, newest): &Self::In, out: &mut Port<u64>) {
        self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        out.send(newest.get().map_or(0, |newest| **newest));
    }
}

#[test]
#[ignore = "real clock"]
fn a_source_far_faster_than_its_readers_is_bounded_and_counted() {
    /// Forwards its input; its run time is much longer than the interval between messages.
    struct Slow;
    impl Operator for Slow {
        type In = At<u64>;
        type Out = Port<u64>;
        fn step(&mut self, _: &mut Context<'_>, input: &At<u64>, out: &mut Port<u64>) {
            out.send(input.get().map_or(0, |input| **input));
        }
    }
    let mut graph = Graph::new();
    let (source, handle) = graph.source::<u64>("fast");
    let ticks = std::sync::Arc::default();
    graph.add("slow reader", Count(std::sync::Arc::clone(&ticks)), (every(ms(100)), source)).out();
    let slow = graph.add("heavy", Slow, source).runtime(RuntimeModel::Fixed(ms(100)));
    slow.policy(Policy::queue(2)).out();
    let stop = graph.stop_handle();
    let feeding = thread::spawn(move || {
        let (_never, nothing) = std::sync::mpsc::channel::<()>();
        let mut refused = 0_u64;
        for n in 1..=1000 {
            refused += u64::from(handle.send(Time::from_ms(n), n as u64).is_err());
            let _waited = nothing.recv_timeout(core::time::Duration::from_millis(1));
        }
        stop.stop();
        refused
    });
    let report = run_wall(graph, &RunOptions::default(), vec![]).unwrap();
    let refused = feeding.join().unwrap();
    let heavy = report.operator("heavy").unwrap();
    let taken = heavy.messages;
    assert_eq!(refused, 0, "the engine keeps up");
    let dropped = heavy.drops.queue_full + heavy.drops.skipped;
    assert!(dropped > 5 * taken, "{taken} steps, {dropped} dropped");
    // One may be running, two may wait.
    assert!((997..=1000).contains(&(taken + dropped)), "{taken} and {dropped}: none is lost without a count");
    assert!(ticks.load(std::sync::atomic::Ordering::Relaxed) >= 10);
}
