//! Section 4: run times and resources.

use swerve_core::Span;

use super::net::*;
use crate::*;

fn ends(model: RuntimeModel, seed: u64) -> Vec<i64> {
    let mut net = Net::new();
    net.stage("work", tick(1000)).runtime(model).out();
    let log = Log::default();
    let mut recorder = log.clone();
    run_virtual(net.graph, &RunOptions::until(at(200_000)).seed(seed), vec![&mut recorder]).unwrap();
    log.published("work").iter().filter_map(|p| p.stamp.map(|stamp| p.visible_at - stamp)).collect()
}

#[test]
fn s4_fixed_and_cycle_models_give_their_times() {
    assert!(ends(fixed(7), 1).iter().all(|ns| *ns == 7_000_000));
    let cycle = RuntimeModel::Cycle(vec![ms(300), ms(100), ms(200)]);
    assert_eq!(ends(cycle, 1)[..4], [300_000_000, 100_000_000, 200_000_000, 300_000_000]);
}

#[test]
fn s4_a_cycle_counts_the_steps_that_started() {
    let mut net = Net::new();
    let source = net.instant_messages("source", 10, 60);
    net.stage("work", join(&[source])).runtime(RuntimeModel::Cycle(vec![ms(25), ms(5)])).out();
    let log = net.run(100);
    assert_eq!(log.messages("work"), [(0, 25), (20, 30), (30, 55), (50, 60), (60, 85)]);
}

#[test]
fn s4_distributions_have_their_shape() {
    let mean = |ns: &[i64]| ns.iter().sum::<i64>() as f64 / ns.len() as f64 / 1e6;
    let normal = ends(RuntimeModel::Normal { mean: ms(80), deviation: ms(10) }, 1);
    assert!((mean(&normal) - 80.0).abs() < 3.0, "{}", mean(&normal));
    let mut log_normal = ends(RuntimeModel::LogNormal { median: ms(80), sigma: 0.5 }, 1);
    log_normal.sort_unstable();
    let median = log_normal[log_normal.len() / 2] as f64 / 1e6;
    assert!((median - 80.0).abs() < 12.0, "{median}");
    let mut percentiles = ends(RuntimeModel::Percentiles(vec![(50.0, ms(70)), (99.0, ms(120))]), 1);
    percentiles.sort_unstable();
    assert_eq!(percentiles[0], 70_000_000);
    let above = percentiles.iter().filter(|ns| **ns > 70_000_000).count() as f64 / percentiles.len() as f64;
    assert!((above - 0.5).abs() < 0.12, "{above}");
    assert!(percentiles.iter().all(|ns| *ns <= 120_000_000));
}

#[test]
fn s4_random_run_times_are_keyed_by_seed_operator_and_stamp() {
    let model = || RuntimeModel::Normal { mean: ms(80), deviation: ms(10) };
    assert_eq!(ends(model(), 1), ends(model(), 1));
    assert_ne!(ends(model(), 1), ends(model(), 2));
    // Other operators and their order have no effect.
    let beside = |others: usize| {
        let mut net = Net::new();
        for i in 0..others {
            net.stage(&format!("other{i}"), tick(7)).runtime(model()).out();
        }
        net.stage("work", tick(1000)).runtime(model()).out();
        net.run(9000).messages("work")
    };
    assert_eq!(beside(0), beside(3));
}

#[test]
fn s4_work_counts_units() {
    struct Units;
    impl Operator for Units {
        type In = Every;
        type Out = Port<i64>;
        fn step(&mut self, cx: &mut Context<'_>, _: &Every, out: &mut Port<i64>) {
            assert_eq!(cx.spend(2), Progress::Continue);
            assert_eq!(cx.spend(cx.stamp().ns() as u64 / 100_000_000), Progress::Continue);
            out.send(0);
        }
    }
    let mut net = Net::new();
    let model = RuntimeModel::Work { base: ms(1), per_unit_ns: 2.5e6 };
    net.graph.add("work", Units, every(ms(100))).runtime(model).out();
    let log = net.run(300);
    let ends: Vec<_> =
        log.published("work").iter().filter_map(|p| p.stamp.map(|stamp| p.visible_at - stamp)).collect();
    assert_eq!(ends, [6_000_000, 8_500_000, 11_000_000]);
}

#[test]
fn s4_work_without_end_takes_the_longest_time() {
    let model = RuntimeModel::Work { base: ms(1), per_unit_ns: 1e3 };
    assert_eq!(model.worked(3), Span::from_ns(1_003_000));
    assert_eq!(model.worked(u64::MAX), Span::MAX);
}

#[test]
fn s4_recorded_times_are_keyed_by_stamp_and_drawn_where_missing() {
    let times = [(at(0), ms(3)), (at(1000), ms(9)), (at(2000), ms(5))].into_iter().collect();
    let mut net = Net::new();
    net.stage("work", tick(1000)).runtime(RuntimeModel::Recorded(std::sync::Arc::new(times))).out();
    let log = net.run(6500);
    let messages = log.messages("work");
    assert_eq!(messages[..3], [(0, 3), (1000, 1009), (2000, 2005)]);
    assert!(messages[3..].iter().all(|(stamp, end)| [3, 5, 9].contains(&(end - stamp))), "{messages:?}");
    assert_eq!(log.tally("work").unrecorded, 4);
}

#[test]
fn s4_a_delayed_stream_reaches_its_readers_later() {
    let mut net = Net::new();
    let feedback = net.graph.feedback("loop");
    let source = net.stage("source", tick(100).latest(feedback)).delay(ms(30)).out();
    net.stage("join", join(&[source])).out();
    net.stage("poll", tick(10).latest(source)).out();
    net.graph.connect(feedback, source);
    let log = net.run(140);
    assert_eq!(log.messages("source"), [(0, 0), (100, 100)]);
    assert_eq!(log.messages("join"), [(0, 30), (100, 130)]);
    assert_eq!(log.reads("poll", 20), [("source".into(), None)]);
    assert_eq!(log.reads("poll", 30), [("source".into(), Some(0))]);
    assert_eq!(log.reads("source", 100), [("source".into(), Some(0))]);
}

#[test]
fn s4_steps_that_share_a_resource_start_after_the_last_turn_in_order_of_waiting_then_rank() {
    let mut net = Net::new();
    let gpu = net.graph.resource("gpu", 1);
    let trigger = net.instant_messages("trigger", 100, 100);
    let late = net.script("late", &[(5, Some(0), 0)]);
    net.stage("a", join(&[trigger])).runtime(fixed(10)).uses(gpu).out();
    net.stage("b", join(&[late])).runtime(fixed(10)).uses(gpu).out();
    net.stage("c", join(&[trigger])).runtime(fixed(10)).uses(gpu).out();
    net.stage("last", join(&[trigger])).out();
    let log = net.run(200);
    // At 0 `a` and `c` can start, and `a` ranks first; at 10 `c` has waited since 0, `b` since 5.
    let starts: Vec<_> = log.all().into_iter().filter(|line| line.contains("starts")).collect();
    assert_eq!(
        starts,
        [
            "last starts 0@0",
            "a starts 0@0",
            "c starts 0@10",
            "b starts 0@20",
            "last starts 100@100",
            "a starts 100@100",
            "c starts 100@110"
        ]
    );
    assert_eq!(log.messages("b"), [(0, 30)]);
}

#[test]
fn s4_no_user_of_a_resource_starves() {
    let mut net = Net::new();
    let gpu = net.graph.resource("gpu", 1);
    // `greedy` alone would keep the slot busy forever: its next frame is complete whenever its step ends.
    net.stage("greedy", tick(10)).runtime(fixed(10)).uses(gpu).out();
    net.stage("modest", tick(50)).runtime(fixed(10)).uses(gpu).out();
    let log = net.run(500);
    assert_eq!(log.messages("modest").len(), 10);
    assert!(log.messages("modest").iter().all(|(stamp, end)| end - stamp == 20));
}

#[test]
fn s4_a_frame_that_lacks_only_a_slot_waits_as_if_no_place_were_free() {
    let mut net = Net::new();
    let gpu = net.graph.resource("gpu", 1);
    net.stage("hog", tick(1000)).runtime(fixed(100)).uses(gpu).out();
    let source = net.instant_messages("source", 10, 90);
    net.stage("skip", join(&[source])).runtime(fixed(10)).uses(gpu).policy(Policy::pipelined(8)).out();
    let log = net.run(200);
    assert_eq!(log.messages("skip"), [(90, 110)]);
    assert_eq!(log.tally("skip").drops.skipped, 9);
    // The drop at 10 and its watermark are published in the sweep of 10.
    assert_eq!(log.watermarks("skip")[1], (None, 9_999_999, 10_000_000));
}

#[test]
fn s4_places_choose_the_frames_and_slots_only_delay_them() {
    let mut net = Net::new();
    let gpu = net.graph.resource("gpu", 1);
    // Two results at 50, because the second waited for the first.
    let times = RuntimeModel::Cycle(vec![ms(50), ms(30)]);
    let burst = net.stage("burst", tick(20)).runtime(times).policy(Policy::pipelined(4)).out();
    net.stage("work", join(&[burst])).runtime(fixed(10)).uses(gpu).policy(Policy::pipelined(2)).out();
    let log = net.run(70);
    assert_eq!(log.messages("work"), [(0, 60), (20, 70)]);
    assert_eq!(log.tally("work").drops.skipped, 0);
}

#[test]
fn s4_watermarks_after_the_starts_pass_from_user_to_user_in_rank_order() {
    let mut net = Net::new();
    let (gpu, npu) = (net.graph.resource("gpu", 1), net.graph.resource("npu", 1));
    net.stage("hog", tick(1000)).runtime(fixed(100)).uses(gpu).out();
    let source = net.instant_messages("source", 20, 40);
    let waits = net.stage("waits", join(&[source])).runtime(fixed(50)).uses(gpu).out();
    net.stage("plain", join(&[waits])).out();
    net.stage("user", join(&[waits])).runtime(fixed(5)).uses(npu).out();
    let log = net.run(20);
    // At 20 `waits` drops 0: `user` passes the watermark on at once, `plain` in the next sweep.
    let end: Vec<_> = log.all().into_iter().filter(|line| line.contains("@20")).rev().take(3).collect();
    assert_eq!(
        end.iter().map(|line| line.split(' ').next().unwrap_or("")).collect::<Vec<_>>(),
        ["plain", "user", "waits"]
    );
}

#[test]
fn s4_a_step_of_no_run_time_needs_no_slot() {
    let mut net = Net::new();
    let gpu = net.graph.resource("gpu", 1);
    net.stage("hog", tick(1000)).runtime(fixed(100)).uses(gpu).out();
    let source = net.instant_messages("source", 10, 30);
    net.stage("free", join(&[source])).uses(gpu).out();
    let log = net.run(200);
    assert_eq!(log.messages("free"), [(0, 0), (10, 10), (20, 20), (30, 30)]);
}

#[test]
fn s4_a_slot_is_free_again_at_the_modelled_end() {
    let mut net = Net::new();
    let gpu = net.graph.resource("gpu", 2);
    let source = net.instant_messages("source", 1000, 0);
    for name in ["a", "b", "c", "d"] {
        net.stage(name, join(&[source])).runtime(fixed(10)).uses(gpu).out();
    }
    let log = net.run(200);
    let ends: Vec<_> = ["a", "b", "c", "d"].iter().map(|name| log.messages(name)[0].1).collect();
    assert_eq!(ends, [10, 10, 20, 20]);
}

#[test]
fn s4_a_watermark_published_after_the_starts_has_the_instant_swept_once_more() {
    let mut net = Net::new();
    let gpu = net.graph.resource("gpu", 1);
    net.stage("hog", tick(1000)).runtime(fixed(100)).uses(gpu).out();
    let source = net.instant_messages("source", 10, 30);
    let skip = net.stage("skip", join(&[source])).runtime(fixed(10)).uses(gpu).out();
    let fast = net.stage("fast", join(&[source])).out();
    net.stage("join", join(&[fast, skip])).out();
    let log = net.run(30);
    // At 20, after the last turn, the frame of 10 is dropped for 20; the watermark reaches `join` at once.
    assert_eq!(log.messages("join"), [(0, 10), (10, 20), (20, 30)]);
    assert_eq!(log.reads("join", 10), [("fast".into(), Some(10)), ("skip".into(), None)]);
}
