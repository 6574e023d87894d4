//! A session has the result of a run, and data given to it is published at once.

use std::sync::{Arc, Mutex};

use swerve_core::{Span, Time};

use super::net::*;
use crate::*;

/// A camera, two operators that share a resource, and a controller without synchronised streams.
fn net() -> Net {
    let mut net = Net::new();
    let gpu = net.graph.resource("gpu", 1);
    let camera = net.stage("camera", tick(20)).origin().out();
    let planner = net.stage("planner", join(&[camera])).runtime(fixed(30)).uses(gpu).out();
    let other = net.stage("other", join(&[camera])).runtime(fixed(5)).uses(gpu).out();
    net.stage("controller", tick(10).latest(planner).latest(other)).out();
    net
}

#[test]
fn a_session_has_the_result_of_a_run_however_it_is_stepped() {
    let whole = net().run(1000);
    let stepped = |step: &mut dyn FnMut(&mut Session<'_>)| {
        let log = Log::default();
        let mut recorder = log.clone();
        let options = RunOptions::until(at(1000));
        let mut session = Session::new(net().graph, &options, vec![&mut recorder]).unwrap();
        step(&mut session);
        session.finish().unwrap();
        log
    };
    let at_once = stepped(&mut |session| assert_eq!(session.advance(), Reached::End));
    let by_instants = stepped(&mut |session| {
        let mut reached = Vec::new();
        for ms in (0..=1000).step_by(7) {
            reached.push(session.advance_to(at(ms)));
            assert!(session.now() <= at(ms));
        }
        assert!(reached.iter().all(|reached| *reached == Reached::Instant), "{reached:?}");
        assert_eq!(session.advance(), Reached::End);
    });
    let mut held = 0;
    let by_turns = stepped(&mut |session| {
        session.hold_before("controller").unwrap();
        session.watch("camera", 1).unwrap();
        while session.advance() == Reached::Held {
            assert_eq!(session.now(), at(10 * held));
            held += 1;
        }
    });
    assert_eq!(held, 101);
    for other in [at_once, by_instants, by_turns] {
        assert_eq!(other.all(), whole.all());
        assert_eq!(other.report(), whole.report());
    }
}

#[test]
fn data_given_while_a_session_holds_is_read_in_the_same_turn() {
    struct Asks(Arc<Mutex<i64>>);
    impl Operator for Asks {
        type In = Every;
        type Out = Port<i64>;
        fn step(&mut self, _: &mut Context<'_>, _: &Every, out: &mut Port<i64>) {
            out.send(*self.0.lock().unwrap());
        }
    }
    let mut net = Net::new();
    let said = Arc::new(Mutex::new(0));
    let (wishes, handle) = net.graph.source::<i64>("wishes");
    let asked = net.graph.add("agent", Asks(said.clone()), every(ms(10))).out();
    net.stage("late", join(&[asked]).latest(wishes)).out();
    let log = Log::default();
    let mut recorder = log.clone();
    let mut session = Session::new(net.graph, &RunOptions::until(at(50)), vec![&mut recorder]).unwrap();
    session.hold_before("agent").unwrap();
    assert!(session.hold_before("nobody").is_err());
    let (agent, none) = (session.watch("agent", 2).unwrap(), session.watch("nobody", 1));
    assert!(none.is_none());
    for k in 0..=5 {
        assert_eq!(session.advance(), Reached::Held);
        *said.lock().unwrap() = 100 + k;
        handle.send_now(k).unwrap();
        let newest = session
            .newest(agent)
            .map(|(header, payload)| (header.stamp, *(**payload).as_any().downcast_ref::<i64>().unwrap()));
        assert_eq!(newest, (k > 0).then(|| (at(10 * (k - 1)), 99 + k)), "the answer to the one before");
    }
    assert_eq!(session.advance(), Reached::End);
    assert!(session.recent(agent).count() >= 2, "at least as many as are watched");
    session.finish().unwrap();
    assert_eq!(handle.send_now(1), Err(SendError::Over));
    assert_eq!(log.messages("wishes"), (0..=5).map(|k| (10 * k, 10 * k)).collect::<Vec<_>>());
    assert_eq!(
        log.reads("late", 30)[1],
        ("wishes".into(), Some(30)),
        "taken in before the turns that follow"
    );
}

#[test]
fn data_given_between_two_instants_is_published_just_after_the_last() {
    let mut net = Net::new();
    let (wishes, handle) = net.graph.source::<i64>("wishes");
    net.stage("reader", join(&[wishes])).out();
    net.stage("clock", tick(10)).out();
    let log = Log::default();
    let mut recorder = log.clone();
    let mut session = Session::new(net.graph, &RunOptions::until(at(100)), vec![&mut recorder]).unwrap();
    assert_eq!(session.advance_to(at(20)), Reached::Instant);
    handle.send_now(7).unwrap();
    assert_eq!(session.advance_to(at(20) + swerve_core::Span::from_ns(1)), Reached::Instant);
    session.finish().unwrap();
    let published = log.published("reader");
    assert_eq!(published.iter().find_map(|p| p.stamp), Some(20_000_001));
}

#[test]
fn a_panic_ends_a_session_with_the_operators_name() {
    struct Bomb;
    impl Operator for Bomb {
        type In = Every;
        type Out = ();
        fn step(&mut self, cx: &mut Context<'_>, _: &Every, _: &mut ()) {
            assert!(cx.stamp() < at(30), "boom");
        }
    }
    let mut graph = Graph::new();
    graph.add("bomb", Bomb, every(ms(10))).out();
    let mut session = Session::new(graph, &RunOptions::until(at(100)), vec![]).unwrap();
    session.hold_before("bomb").unwrap();
    (0..4).for_each(|_| assert_eq!(session.advance(), Reached::Held));
    assert!(session.failure().is_none());
    assert_eq!(session.advance(), Reached::End);
    assert!(session.failure().unwrap().to_string().contains("boom"));
    assert!(session.finish().unwrap_err().to_string().contains("`bomb`"));
}

#[test]
fn a_session_can_move_to_another_thread() {
    let mut session = Session::new(net().graph, &RunOptions::until(at(1000)), vec![]).unwrap();
    session.advance_to(at(500));
    let there = std::thread::spawn(move || {
        session.advance();
        session.finish().unwrap()
    });
    assert_eq!(there.join().unwrap().digest, net().run(1000).report().digest);
}

/// Records of the messages of an operator in a run.
fn records(of: &str) -> Vec<PlaybackRecord> {
    let mut net = net();
    let records = Arc::new(Mutex::new(Vec::new()));
    let (kept, name) = (records.clone(), of.to_owned());
    let mut keeper = move |event: &Event<'_>| match event {
        Event::Publication(p) if p.operator == name => kept.lock().unwrap().push(PlaybackRecord::of(p)),
        _ => {}
    };
    run_virtual(core::mem::take(&mut net.graph), &RunOptions::until(at(1000)), vec![&mut keeper]).unwrap();
    let records = records.lock().unwrap().clone();
    records.into_iter().filter(|record| record.message.is_some()).collect()
}

#[test]
fn a_session_fed_with_the_messages_of_a_sensor_has_the_result_of_the_run() {
    let whole = net().run(1000);
    for ahead in [Span::ZERO, ms(200)] {
        let mut graph = net().graph;
        graph.feed_outside("camera").unwrap();
        assert!(graph.sources().eq(["camera"]));
        let log = Log::default();
        let mut session = Session::new(graph, &RunOptions::until(at(1000)), vec![]).unwrap();
        session.observe(Box::new(log.clone()));
        let camera = session.source("camera").unwrap();
        assert!(session.source("planner").is_none() && session.source("nobody").is_none());
        for record in records("camera") {
            let at = record.visible_at;
            session.feed(camera, record).unwrap();
            // The message of an instant is there before the instant is begun.
            let before = at + (Span::from_ns(-1) - ahead);
            if before >= Time::ZERO {
                assert_eq!(session.advance_to(before), Reached::Instant);
            }
        }
        assert_eq!(session.advance(), Reached::End);
        session.finish().unwrap();
        assert_eq!(log.report().digest, whole.report().digest);
        assert_eq!(log.messages("controller"), whole.messages("controller"));
    }
}

#[test]
fn a_session_refuses_records_that_are_late_out_of_order_or_of_another_type() {
    let mut net = Net::new();
    let (wishes, _handle) = net.graph.source::<i64>("wishes");
    net.stage("reader", join(&[wishes])).out();
    net.stage("clock", tick(10)).out();
    let mut session = Session::new(net.graph, &RunOptions::until(at(100)), vec![]).unwrap();
    let wishes = session.source("wishes").unwrap();
    let of = |ms: i64, stamp: i64| PlaybackRecord::message(at(ms), at(stamp), 1_i64);
    session.feed(wishes, of(0, 0)).unwrap();
    assert_eq!(session.feed(wishes, of(20, 0)), Err(FeedError::NotAfter { stamp: at(0), after: at(0) }));
    session.feed(wishes, of(20, 20)).unwrap();
    assert_eq!(session.feed(wishes, of(10, 30)), Err(FeedError::NotBefore { stamp: at(30), before: at(20) }));
    session.feed(wishes, of(10, 10)).unwrap();
    assert_eq!(session.advance_to(at(40)), Reached::Instant);
    assert_eq!(session.feed(wishes, of(40, 40)), Err(FeedError::Past { at: at(40), now: at(40) }));
    let wrong = session.feed(wishes, PlaybackRecord::message(at(50), at(50), 1.0_f64)).unwrap_err();
    assert!(wrong.to_string().contains("expected i64, found f64"), "{wrong}");
    let other = PlaybackRecord { port: 3, ..of(50, 50) };
    assert!(session.feed(wishes, other).unwrap_err().to_string().contains("`wishes` has no output 3"));
    session.feed(wishes, PlaybackRecord::bare(at(50), at(50))).unwrap();
    assert_eq!(session.feed(wishes, of(60, 50)), Err(FeedError::NotAfter { stamp: at(50), after: at(50) }));
}
