//! Section 9: remote steps, here with a worker behind a lock.

use std::sync::{Arc, Mutex};

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};

use super::net::ms;
use crate::*;

#[derive(Clone, Serialize, Deserialize)]
struct Reading {
    x: f64,
    words: Vec<String>,
}

struct Sensor;

impl Operator for Sensor {
    type In = Every;
    type Out = (Port<Reading>, Port<u64>);

    fn step(&mut self, cx: &mut Context<'_>, _: &Every, out: &mut Self::Out) {
        let bits = cx.rng().bits();
        let x = f64::from_bits(bits >> 12);
        out.0.send(Reading { x, words: vec![cx.name().to_owned(); (bits % 3) as usize] });
        if !bits.is_multiple_of(5) {
            out.1.send(bits);
        }
    }
}

/// Has all kinds of ports, a state, random numbers and two outputs; passes one message on unchanged.
#[derive(Default)]
struct Mixer {
    sum: u64,
}

impl Operator for Mixer {
    type In = (At<Reading>, Latest<u64>, Window<u64, 3>, Every);
    type Out = (Port<u64>, Port<Reading>);

    fn step(&mut self, cx: &mut Context<'_>, (reading, bits, window, tick): &Self::In, out: &mut Self::Out) {
        let age = bits.age(cx.now()).map_or(-1, Span::ns);
        let newest = bits.get().map_or(0, |bits| **bits);
        self.sum = self.sum.wrapping_mul(31).wrapping_add(newest ^ age as u64 ^ cx.rng().bits());
        self.sum = window.get().iter().fold(self.sum, |sum, bits| sum.wrapping_add(**bits));
        self.sum += u64::from(tick.ticked());
        cx.spend(self.sum % 7);
        out.0.send(self.sum);
        if let Some(reading) = reading.get() {
            out.1.pass_on(reading);
        }
    }
}

/// Works until it is requested to stop, and makes offers on the way.
struct Anytime;

impl Operator for Anytime {
    type In = At<u64>;
    type Out = Port<u64>;

    fn step(&mut self, cx: &mut Context<'_>, goal: &At<u64>, out: &mut Port<u64>) {
        let goal = goal.get().map_or(0, |goal| **goal % 20);
        for n in 0..goal {
            cx.offer(out, 1000 + n);
            if cx.spend(1) == Progress::Stop {
                // Every other step leaves the answer to the reaction.
                if goal.is_multiple_of(2) {
                    out.send(n);
                }
                return;
            }
        }
        out.send(goal);
    }

    fn on_deadline(miss: &Miss<Port<u64>>, out: &mut Port<u64>) {
        if let Some(value) = miss.offered.clone().or(miss.last.clone()) {
            out.forward(value);
        }
    }
}

const NAMES: [&str; 3] = ["sensor", "mixer", "anytime"];

fn graph() -> Graph {
    let mut graph = Graph::new();
    let (readings, bits) = graph.add("sensor", Sensor, every(ms(10))).origin().out();
    let inputs = (readings, bits, bits, every(ms(25)).phase(ms(5)));
    let (sums, _) = graph.add("mixer", Mixer::default(), inputs).runtime(RuntimeModel::Fixed(ms(4))).out();
    let work = RuntimeModel::Work { base: ms(1), per_unit_ns: 1e6 };
    let deadline = Deadline::after(ms(12)).reaction(Reaction::OnDeadline);
    graph.add("anytime", Anytime, sums).runtime(work).policy(Policy::queue(2)).deadline(deadline).out();
    graph
}

/// A worker as in another process, which can be lost at a call.
struct There {
    make: fn() -> Graph,
    names: Vec<String>,
    worker: Option<Worker>,
    calls: u64,
    /// Calls during which it is gone.
    gone: std::ops::Range<u64>,
}

impl There {
    fn new(make: fn() -> Graph, names: &[&str], gone: std::ops::Range<u64>) -> Arc<Mutex<Self>> {
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        Arc::new(Mutex::new(Self { make, names, worker: None, calls: 0, gone }))
    }
}

struct Endpoint(Arc<Mutex<There>>);

impl RemoteExecutor for Endpoint {
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<Answered, Lost> {
        let mut there = self.0.lock().unwrap();
        there.calls += 1;
        if there.gone.contains(&there.calls) {
            there.worker = None;
            return Err(Lost("gone".into()));
        }
        let (make, names) = (there.make, there.names.clone());
        let restarted = there.worker.is_none() && there.calls > 1;
        let worker = there.worker.get_or_insert_with(|| make().into_worker(&names).unwrap());
        let mut bytes = Vec::new();
        call.encode(&mut bytes);
        worker.answer(&bytes, answer).unwrap();
        Ok(if restarted { Answered::Restarted } else { Answered::InTurn })
    }
}

fn remote(graph: &mut Graph, there: &Arc<Mutex<There>>) {
    let names = there.lock().unwrap().names.clone();
    for name in names {
        let _there = graph.operator(&name).unwrap().remote(Box::new(Endpoint(there.clone())));
    }
}

#[test]
fn s9_the_result_does_not_depend_on_where_steps_are_executed() {
    let options = RunOptions::until(Time::from_ms(2000)).seed(3);
    let here = run_virtual(graph(), &options, vec![]).unwrap();
    assert!(here.operator("anytime").unwrap().misses > 20, "deadlines are missed");
    for split in 1..8_usize {
        let names: Vec<&str> = (0..3).filter(|i| split >> i & 1 == 1).map(|i| NAMES[i]).collect();
        for threads in [1, 3] {
            let mut moved = graph();
            let there = There::new(graph, &names, 0..0);
            remote(&mut moved, &there);
            let report = run_virtual(moved, &options.clone().threads(threads), vec![]).unwrap();
            assert_eq!(report.digest, here.digest, "{names:?}, {threads} threads");
            assert_eq!(report.operators, here.operators, "{names:?}, {threads} threads");
            assert!(there.lock().unwrap().calls >= 200);
        }
    }
}

#[test]
fn s9_a_virtual_run_ends_where_a_process_is_lost() {
    let mut moved = graph();
    remote(&mut moved, &There::new(graph, &["mixer"], 6..u64::MAX));
    let mut ends = Ends::default();
    let error = run_virtual(moved, &RunOptions::until(Time::from_ms(2000)), vec![&mut ends]).unwrap_err();
    assert_eq!(error.to_string(), "operator `mixer`: gone");
    assert_eq!(ends.0.as_deref(), Some("operator `mixer`: gone"), "observers are notified too");
}

#[derive(Default)]
struct Ends(Option<String>);

impl Observer for Ends {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::End(RunReport { end: EndReason::Failed(why), .. }) = event {
            self.0 = Some(why.clone());
        }
    }
}

#[test]
fn s9_a_panic_in_a_worker_ends_the_run() {
    struct Bomb;
    impl Operator for Bomb {
        type In = Every;
        type Out = ();
        fn step(&mut self, cx: &mut Context<'_>, _: &Every, _: &mut ()) {
            assert!(cx.stamp() < Time::from_ms(30), "boom");
        }
    }
    fn graph() -> Graph {
        let mut graph = Graph::new();
        graph.add("bomb", Bomb, every(ms(10))).out();
        graph
    }
    let mut moved = graph();
    remote(&mut moved, &There::new(graph, &["bomb"], 0..0));
    let error = run_virtual(moved, &RunOptions::until(Time::from_ms(2000)), vec![]).unwrap_err();
    assert_eq!(error.to_string(), "operator `bomb` panicked: boom");
}

#[test]
fn s9_invalid_calls_are_refused() {
    assert!(graph().into_worker(&["nobody".into()]).is_err());
    let mut worker = graph().into_worker(&["mixer".into()]).unwrap();
    let mut answer = Vec::new();
    for call in [&b""[..], &[0xff; 40], b"\x06nobody\0\0\0\0\0\0", b"\x05mixer\0\0\0\0\0\x09"] {
        assert!(worker.answer(call, &mut answer).is_err());
    }
    assert!(answer.is_empty());
}

#[derive(Default)]
struct Recorder {
    decisions: Vec<Decision>,
    sensor: Vec<PlaybackRecord>,
}

impl Observer for Recorder {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Publication(p) if p.operator == "sensor" => self.sensor.push(PlaybackRecord::of(p)),
            Event::Decision(decision) => self.decisions.push((*decision).clone()),
            _ => {}
        }
    }
}

#[test]
#[ignore = "real clock"]
fn s9_under_wall_clock_a_loss_is_recorded_and_replays() {
    let mut moved = graph();
    remote(&mut moved, &There::new(graph, &["mixer"], 8..12));
    let mut recorder = Recorder::default();
    let options = RunOptions::until(Time::from_ms(300)).seed(5);
    let driven = run_wall(moved, &options, vec![&mut recorder]).unwrap();
    let lost = recorder.decisions.iter().filter(|d| matches!(d, Decision::Lost { .. })).count();
    let restarted = recorder.decisions.iter().filter(|d| matches!(d, Decision::Restarted { .. })).count();
    assert_eq!((lost, restarted), (4, 1));
    let replay = |spare: bool| {
        let mut again = graph();
        for name in NAMES {
            // Heavy as in the run, where remote operators are heavy.
            let node = again.operator(name).unwrap();
            let _marked = if name == "mixer" { node.heavy() } else { node };
        }
        again.playback("sensor", recorder.sensor.clone()).unwrap();
        if spare {
            again.spare(graph());
        }
        run_replay(again, &options, recorder.decisions.iter().cloned().collect(), vec![]).unwrap().digest
    };
    assert_eq!(replay(true), driven.digest);
    assert_ne!(replay(false), driven.digest, "its memory was lost with it");
}

/// Changes to the bytes of a call or an answer: position and value.
type Harm = Vec<(usize, u8)>;

fn harmed(bytes: &mut Vec<u8>, harm: &[(usize, u8)], keep: usize) {
    for (at, value) in harm {
        let len = bytes.len().max(1);
        if let Some(byte) = bytes.get_mut(at % len) {
            *byte = *value;
        }
    }
    if keep < 400 {
        bytes.truncate(keep);
    }
}

/// Corrupts one call or one answer.
struct Spoiled {
    worker: Worker,
    calls: u64,
    spoiled: u64,
    harm: (Harm, usize),
    answers: bool,
}

impl RemoteExecutor for Spoiled {
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<Answered, Lost> {
        self.calls += 1;
        let mut bytes = Vec::new();
        call.encode(&mut bytes);
        let now = self.calls == self.spoiled;
        if now && !self.answers {
            harmed(&mut bytes, &self.harm.0, self.harm.1);
        }
        self.worker.answer(&bytes, answer).map_err(|error| Lost(error.to_string()))?;
        if now && self.answers {
            harmed(answer, &self.harm.0, self.harm.1);
        }
        Ok(Answered::InTurn)
    }
}

fn spoiling() -> ProptestConfig {
    let cases = if std::env::var_os("SWERVE_FUZZ").is_some() { 20_000 } else { 150 };
    let rng_seed = RngSeed::Fixed(7);
    ProptestConfig { cases, failure_persistence: None, rng_seed, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(spoiling())]

    /// A corrupted call or answer ends the run with an error or changes its result, without a panic.
    #[test]
    fn s9_spoiled_calls_and_answers_never_panic(
        harm in prop::collection::vec(any::<(u16, u8)>(), 0..6),
        keep in 0..800_usize,
        spoiled in 1..8_u64,
        answers in any::<bool>(),
        which in 0..3_usize,
    ) {
        let harm = (harm.into_iter().map(|(at, value)| (usize::from(at), value)).collect(), keep);
        let worker = graph().into_worker(&[NAMES[which].to_owned()]).unwrap();
        let mut moved = graph();
        let spoiled = Spoiled { worker, calls: 0, spoiled, harm, answers };
        let _there = moved.operator(NAMES[which]).unwrap().remote(Box::new(spoiled));
        let driven = run_virtual(moved, &RunOptions::until(Time::from_ms(100)), vec![]);
        if let Err(error) = driven {
            let said = error.to_string();
            prop_assert!(said.contains(NAMES[which]), "{}", said);
        }
    }

    #[test]
    fn s9_random_calls_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), known in any::<bool>()) {
        let mut worker = graph().into_worker(&["mixer".into()]).unwrap();
        let call = if known { [b"\x05mixer", &bytes[..]].concat() } else { bytes };
        let _either_way = worker.answer(&call, &mut Vec::new()).is_ok();
    }
}

#[test]
fn s9_a_restart_in_an_older_log_is_read_as_restarted() {
    let read = |name: &str| {
        let json = format!(r#"{{"decision":"{name}","operator":"mixer","stamp":5}}"#);
        serde_json::from_str::<Decision>(&json).unwrap()
    };
    let restarted = Decision::Restarted { operator: "mixer".into(), stamp: Time::from_ns(5) };
    assert_eq!([read("restarted"), read("afresh")], [restarted.clone(), restarted]);
}
