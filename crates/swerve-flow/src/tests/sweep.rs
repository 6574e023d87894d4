//! Section 3: one instant is one sweep.

use super::net::*;
use crate::*;

#[test]
fn s3_operators_take_their_turn_in_rank_order_once() {
    let mut net = Net::new();
    let a = net.stage("a", tick(10)).out();
    let b = net.stage("b", join(&[a])).out();
    let c = net.stage("c", tick(10).latest(b)).out();
    net.stage("d", join(&[a, c])).out();
    let log = net.run(10);
    let published: Vec<_> =
        log.all().into_iter().filter(|line| !line.contains("starts") && !line.contains("ends")).collect();
    assert_eq!(published, ["a 0@0", "b 0@0", "c 0@0", "d 0@0", "a 10@10", "b 10@10", "c 10@10", "d 10@10"]);
    assert_eq!(log.reads("c", 10), [("b".into(), Some(10))]);
}

#[test]
fn s3_a_result_due_exactly_at_its_deadline_is_in_time() {
    let mut net = Net::new();
    let deadline = Deadline::after(ms(30));
    net.stage("work", tick(100)).runtime(fixed(30)).deadline(deadline).out();
    let log = net.run(150);
    assert_eq!(log.messages("work"), [(0, 30), (100, 130)]);
    assert_eq!(log.tally("work").misses, 0);
}

#[test]
fn s3_a_frame_not_started_at_its_deadline_is_missed() {
    let mut net = Net::new();
    let source = net.script("source", &[(0, Some(0), 0), (10, Some(10), 10)]);
    let deadline = Deadline::after(ms(40)).anchor(Anchor::Stamp);
    net.stage("work", join(&[source])).runtime(fixed(50)).policy(Policy::queue(4)).deadline(deadline).out();
    let log = net.run(200);
    // The step for 0, late itself, ends at 50, just when the frame of 10 has to be answered: that never starts.
    let expected = ["work starts 0@0", "work misses 0@40", "work ends 0@50", "work misses 10@50"];
    let lines: Vec<_> = log.lines("work").into_iter().filter(|line| !line.starts_with("work -")).collect();
    assert_eq!(lines, expected);
}

#[test]
fn s3_deadlines_of_one_turn_are_handled_in_stamp_order() {
    let mut net = Net::new();
    let source = net.script("source", &[(0, Some(0), 0), (5, Some(1), 1), (5, Some(2), 2), (5, Some(3), 3)]);
    let deadline = Deadline::after(ms(60)).reaction(Reaction::ReuseLast);
    net.stage("work", join(&[source]))
        .runtime(RuntimeModel::Cycle(vec![ms(10), ms(900)]))
        .policy(Policy::queue(4))
        .deadline(deadline)
        .out();
    let log = net.run(100);
    assert_eq!(log.messages("work"), [(0, 10), (1, 65), (2, 65), (3, 65)]);
    assert_eq!(log.tally("work").drops.total(), 0);
}

#[test]
fn s3_a_policy_sees_all_frames_that_became_complete_at_once() {
    let mut net = Net::new();
    let a = net.instant_messages("a", 10, 30);
    let late = net.script("late", &[(30, None, 30)]);
    net.stage("newest", join(&[a, late])).out();
    net.stage("all", join(&[a, late])).policy(Policy::queue(1)).out();
    net.stage("two", join(&[a, late])).policy(Policy::pipelined(2)).runtime(fixed(5)).out();
    let log = net.run(100);
    assert_eq!(log.messages("newest"), [(30, 30)]);
    // Steps of no run time are all done in the turn, before the queue's bound applies.
    assert_eq!(log.messages("all"), [(0, 30), (10, 30), (20, 30), (30, 30)]);
    assert_eq!(log.messages("two"), [(20, 35), (30, 35)]);
    assert_eq!((log.tally("newest").drops.skipped, log.tally("two").drops.skipped), (3, 2));
}
