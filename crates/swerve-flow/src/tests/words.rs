//! Section 1: watermarks and ranks.

use super::net::*;
use crate::*;

const MS: i64 = 1_000_000;

#[test]
fn s1_a_timer_has_a_watermark_from_the_first_sweep_on() {
    let mut net = Net::new();
    net.stage("early", tick(50)).runtime(fixed(5)).out();
    net.stage("late", tick(50).phase(20)).runtime(fixed(5)).out();
    let log = net.run(60);
    let early = [(None, -1, 0), (Some(0), 50 * MS - 1, 5 * MS), (Some(50 * MS), 100 * MS - 1, 55 * MS)];
    assert_eq!(log.watermarks("early"), early);
    let late = [(None, 20 * MS - 1, 0), (Some(20 * MS), 70 * MS - 1, 25 * MS)];
    assert_eq!(log.watermarks("late"), late);
}

#[test]
fn s1_a_publication_carries_the_watermark_of_that_moment() {
    let mut net = Net::new();
    // At 10 the stream's watermark rises to 30; the frame of 0 is open until 40.
    let source = net.script("source", &[(0, Some(0), 0), (10, None, 30), (35, Some(35), 35)]);
    net.stage("work", join(&[source])).runtime(fixed(40)).out();
    let log = net.run(100);
    let expected = [(None, -1, 0), (Some(0), 35 * MS - 1, 40 * MS), (Some(35 * MS), 35 * MS, 80 * MS)];
    assert_eq!(log.watermarks("work"), expected);
}

#[test]
fn s1_a_fast_port_joined_with_a_slow_timer_does_not_wait_for_its_next_tick() {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(50)).out();
    let lidar = net.stage("lidar", tick(100)).out();
    net.stage("fusion", join(&[camera, lidar])).out();
    let log = net.run(200);
    assert_eq!(log.messages("fusion"), [(0, 0), (50, 50), (100, 100), (150, 150), (200, 200)]);
    assert_eq!(log.reads("fusion", 50), [("camera".into(), Some(50)), ("lidar".into(), None)]);
}

#[test]
fn s1_a_stamp_whose_step_publishes_nothing_is_resolved_at_its_end() {
    struct Silent;
    impl Operator for Silent {
        type In = At<i64>;
        type Out = Port<i64>;
        fn step(&mut self, _: &mut Context<'_>, _: &At<i64>, _: &mut Port<i64>) {}
    }
    let mut net = Net::new();
    let source = net.instant_messages("source", 100, 100);
    let quiet = net.graph.add("quiet", Silent, source).runtime(fixed(30)).out();
    net.stage("after", join(&[source, quiet])).out();
    let log = net.run(200);
    assert_eq!(
        log.watermarks("quiet"),
        [(None, -1, 0), (None, 0, 30 * MS), (None, 100 * MS - 1, 100 * MS), (None, 100 * MS, 130 * MS)]
    );
    assert_eq!(log.messages("after"), [(0, 30), (100, 130)]);
}

#[test]
fn s1_ranks_follow_the_order_of_addition_among_ready_operators() {
    let mut net = Net::new();
    let feedback = net.graph.feedback("loop");
    let a = net.stage("a", tick(10).latest(feedback)).out();
    let b = net.stage("b", join(&[a])).out();
    net.stage("c", tick(10)).out();
    net.stage("d", tick(10).latest(b)).out();
    net.graph.connect(feedback, b);
    let names: Vec<_> = net.graph.describe().unwrap().operators.into_iter().map(|o| o.name).collect();
    assert_eq!(names, ["a", "b", "c", "d"]);
}

#[test]
fn s1_a_closed_stream_has_the_last_watermark() {
    let mut net = Net::new();
    let records = vec![
        PlaybackRecord::message(at(10), at(10), 1_i64),
        PlaybackRecord::bare(at(20), swerve_core::Time::MAX),
    ];
    let source = net.graph.script("source", records);
    net.stage("work", join(&[source])).runtime(fixed(30)).out();
    let log = net.run(100);
    assert_eq!(log.watermarks("work").last(), Some(&(Some(10 * MS), i64::MAX, 40 * MS)));
    assert_eq!(log.report().end, EndReason::Idle);
}
