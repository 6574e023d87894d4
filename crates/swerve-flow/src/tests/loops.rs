//! Section 7: the closed loop.

use super::net::*;
use crate::*;

/// Publishes the latched command, then latches the newest one; ends the run at 40 ms.
#[derive(Default)]
struct World {
    latched: i64,
}

impl Operator for World {
    type In = (Every, Latest<i64>);
    type Out = Port<i64>;
    fn step(&mut self, cx: &mut Context<'_>, (_, command): &Self::In, out: &mut Self::Out) {
        out.send(self.latched);
        self.latched = command.get().map_or(0, |command| **command);
        if cx.now() == at(40) {
            cx.stop_run("far enough");
        }
    }
}

#[test]
fn s7_a_command_acts_from_the_first_tick_strictly_after_it_is_visible() {
    let mut net = Net::new();
    let commands = net.graph.feedback("commands");
    net.graph.add("world", World::default(), (every(ms(10)), commands)).out();
    let records = vec![PlaybackRecord::message(at(10), at(10), 7_i64)];
    let stream = net.graph.script("controller", records);
    net.graph.connect(commands, stream);
    let mut states = Vec::new();
    let mut observer = |event: &Event<'_>| {
        if let Event::Publication(Publication {
            operator: "world", payload: Some(payload), visible_at, ..
        }) = event
        {
            states.push((visible_at.ns() / 1_000_000, *payload.downcast_ref::<i64>().unwrap()));
        }
    };
    let report = run_virtual(net.graph, &RunOptions::default(), vec![&mut observer]).unwrap();
    // Visible at 10: latched at 20 (strictly after), so the interval that ends at 30 is the first with it.
    assert_eq!(states, [(0, 0), (10, 0), (20, 0), (30, 7), (40, 7)]);
    assert_eq!((report.end, report.at), (EndReason::Stopped("far enough".into()), at(40)));
}

#[test]
fn s7_steps_in_flight_at_the_end_are_not_published() {
    let mut net = Net::new();
    net.stage("work", tick(100)).runtime(fixed(30)).out();
    let log = net.run(129);
    assert_eq!(log.messages("work"), [(0, 30)]);
    assert_eq!(log.report().end, EndReason::Until);
}

#[test]
fn s7_the_spans_end_is_included() {
    let mut net = Net::new();
    net.stage("work", tick(100)).runtime(fixed(30)).out();
    assert_eq!(net.run(130).messages("work"), [(0, 30), (100, 130)]);
}

#[test]
fn s7_the_origin_is_the_newest_sensor_frame_that_a_message_derives_from() {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(50)).runtime(fixed(5)).origin().out();
    let detector = net.stage("detector", join(&[camera])).runtime(fixed(30)).out();
    let pose = net.stage("pose", tick(20)).origin().out();
    net.stage("planner", tick(100).phase(90).latest(detector).latest(pose)).runtime(fixed(1)).out();
    let clock = net.stage("clock", tick(30)).out();
    net.stage("idle", join(&[clock])).out();
    let log = net.run(100);
    let origins = |name: &str| {
        log.published(name).iter().filter_map(|p| p.origin).map(|o| o / 1_000_000).collect::<Vec<_>>()
    };
    assert_eq!(origins("detector"), [0, 50]);
    assert_eq!(origins("planner"), [80]);
    assert!(origins("idle").is_empty());
}

#[test]
fn s7_equal_runs_have_equal_digests_and_different_runs_do_not() {
    let digest = |until, runtime| {
        let mut net = Net::new();
        let a = net.stage("a", tick(10)).runtime(fixed(runtime)).out();
        net.stage("b", join(&[a])).out();
        net.run(until).report().digest
    };
    assert_eq!(digest(100, 3), digest(100, 3));
    assert_ne!(digest(100, 3), digest(110, 3));
    assert_ne!(digest(100, 3), digest(100, 4));
}
