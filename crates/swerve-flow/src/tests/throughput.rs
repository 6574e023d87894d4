//! Section 5: busy policies.

use super::net::*;
use crate::*;

/// Stamps 0, 50, 100, ... ms without delay, run time 550 ms.
fn worked_example(policy: Policy, until: i64) -> Log {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(50)).out();
    net.stage("work", join(&[camera])).runtime(fixed(550)).policy(policy).out();
    net.run(until)
}

#[test]
fn s5_worked_example_skip_to_latest() {
    let log = worked_example(Policy::SkipToLatest, 2199);
    assert_eq!(log.messages("work"), [(0, 550), (550, 1100), (1100, 1650)]);
    // Of the eleven stamps between two starts, all but the newest are skipped; one waits at the end.
    assert_eq!(log.tally("work").drops.skipped, 10 * 3 + 9);
}

#[test]
fn s5_worked_example_queue() {
    let log = worked_example(Policy::queue(2), 2200);
    assert_eq!(log.messages("work"), [(0, 550), (450, 1100), (1000, 1650), (1550, 2200)]);
}

#[test]
fn s5_worked_example_pipelined() {
    let log = worked_example(Policy::pipelined(64), 2000);
    let expected: Vec<_> = (0..30).map(|k| (50 * k, 550 + 50 * k)).collect();
    assert_eq!(log.messages("work"), expected);
    assert_eq!(log.tally("work").drops.total(), 0);
}

#[test]
fn s5_worked_example_pipelined_with_few_places() {
    let log = worked_example(Policy::pipelined(4), 1650);
    let expected = [
        (0, 550),
        (50, 600),
        (100, 650),
        (150, 700),
        (550, 1100),
        (600, 1150),
        (650, 1200),
        (700, 1250),
        (1100, 1650),
    ];
    assert_eq!(log.messages("work"), expected);
}

#[test]
fn s5_skip_to_latest_is_pipelined_with_one_place() {
    let (skip, one) =
        (worked_example(Policy::SkipToLatest, 5000), worked_example(Policy::pipelined(1), 5000));
    assert_eq!(skip.all(), one.all());
}

#[test]
fn s5_a_full_queue_may_drop_its_newest_or_fail() {
    let newest = Policy::Queue { capacity: 2, full: Full::DropNewest };
    let log = worked_example(newest, 2200);
    assert_eq!(log.messages("work"), [(0, 550), (50, 1100), (100, 1650), (550, 2200)]);
    assert!(log.all().contains(&"work drops 150@150 QueueFull".to_string()));

    let mut net = Net::new();
    let camera = net.stage("camera", tick(50)).out();
    let fail = Policy::Queue { capacity: 2, full: Full::Fail };
    net.stage("work", join(&[camera])).runtime(fixed(550)).policy(fail).out();
    let mut ends = Vec::new();
    let mut observer = |event: &Event<'_>| {
        if let Event::End(report) = event {
            ends.push(report.end.clone());
        }
    };
    let error = run_virtual(net.graph, &RunOptions::until(at(1000)), vec![&mut observer]).unwrap_err();
    assert_eq!(error.to_string(), "the queue of operator `work` is full at stamp 0.150 s");
    assert!(matches!(&ends[..], [EndReason::Failed(_)]));
}

#[test]
fn s5_results_of_a_pipeline_are_published_in_order_and_wait_for_older_ones() {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(100)).out();
    let cycle = RuntimeModel::Cycle(vec![ms(300), ms(100)]);
    net.stage("work", join(&[camera])).runtime(cycle).policy(Policy::pipelined(2)).out();
    let log = net.run(900);
    // The step for 100 ends at 200 and holds its place until 0 is published at 300. Then both places are free.
    assert_eq!(log.messages("work"), [(0, 300), (100, 300), (200, 600), (300, 600), (500, 900), (600, 900)]);
    assert!(log.all().contains(&"work drops 400@500 Skipped".to_string()));
}

#[test]
fn s5_with_overtaking_a_result_after_a_newer_one_is_dropped() {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(100)).out();
    let cycle = RuntimeModel::Cycle(vec![ms(300), ms(100)]);
    let policy = Policy::Pipelined { places: 2, late: Late::Overtaken };
    net.stage("work", join(&[camera])).runtime(cycle).policy(policy).out();
    let log = net.run(900);
    // 0 holds its place until its own end at 300, though 100 was published at 200.
    assert_eq!(log.messages("work"), [(100, 200), (300, 400), (500, 600), (700, 800)]);
    assert_eq!(log.tally("work").drops.overtaken, 4);
    assert_eq!(log.tally("work").drops.skipped, 0);
}

#[test]
fn s5_a_result_that_is_put_off_comes_a_while_after_the_one_before() {
    let net = |times: [i64; 4]| {
        let mut net = Net::new();
        let camera = net.stage("camera", tick(50)).out();
        let cycle = RuntimeModel::Cycle(times.map(ms).to_vec());
        let policy = Policy::Pipelined { places: 8, late: Late::PutOff(ms(30)) };
        net.stage("work", join(&[camera])).runtime(cycle).policy(policy).out();
        net.run(400).messages("work")
    };
    // 50 and 100 are finished by 200, when 0 is published; 150 is finished at 270, after 100 was published at 260.
    assert_eq!(net([200, 20, 60, 120])[..4], [(0, 200), (50, 230), (100, 260), (150, 270)]);
    // Results in order are published when finished; one that is finished when the one before is published is put off
    // too.
    assert_eq!(net([60, 60, 60, 60])[..4], [(0, 60), (50, 110), (100, 160), (150, 210)]);
    assert_eq!(net([60, 10, 60, 60])[..4], [(0, 60), (50, 90), (100, 160), (150, 210)]);
}

#[test]
fn s5_readers_that_join_on_a_dropped_stamp_see_none() {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(50)).out();
    let slow = net.stage("slow", join(&[camera])).runtime(fixed(120)).out();
    net.stage("join", join(&[camera, slow])).policy(Policy::queue(9)).out();
    let log = net.run(300);
    // 50 waits from 50 on and is dropped for 100 at 100; the watermark published with 0 at 120 shows it.
    assert_eq!(log.messages("slow"), [(0, 120), (100, 240)]);
    assert_eq!(log.reads("join", 0), [("camera".into(), Some(0)), ("slow".into(), Some(0))]);
    assert_eq!(log.reads("join", 50), [("camera".into(), Some(50)), ("slow".into(), None)]);
    let frames = log.messages("join");
    assert_eq!(frames, [(0, 120), (50, 120), (100, 240), (150, 240)]);
}
