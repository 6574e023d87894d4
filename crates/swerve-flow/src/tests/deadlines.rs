//! Section 6: deadlines.

use swerve_core::Span;

use super::net::*;
use crate::*;

fn reuse(length_ms: i64) -> Deadline {
    Deadline::after(ms(length_ms)).reaction(Reaction::ReuseLast)
}

fn cycle(times_ms: &[i64]) -> RuntimeModel {
    RuntimeModel::Cycle(times_ms.iter().copied().map(Span::from_ms).collect())
}

#[test]
fn s6_1_a_deadline_runs_while_the_frame_is_incomplete() {
    let mut net = Net::new();
    let a = net.instant_messages("a", 100, 100);
    let late = net.script("late", &[(70, Some(0), 0), (110, Some(100), 100)]);
    net.stage("work", join(&[a, late])).deadline(Deadline::after(ms(40))).out();
    let log = net.run(300);
    assert_eq!(log.messages("work"), [(100, 110)]);
    assert_eq!(
        log.watermarks("work")[0],
        (None, 0, 40_000_000),
        "the watermark rises to the stamp on a skip"
    );
    assert_eq!(log.tally("work").drops.too_late, 1, "the late message of 0 opens no frame");
}

#[test]
fn s6_1_the_anchor_is_arrival_stamp_or_start() {
    let missed = |anchor| {
        let mut net = Net::new();
        let source = net.script("source", &[(20, Some(5), 5), (30, Some(10), 10)]);
        let work = net.stage("work", join(&[source])).runtime(fixed(500)).policy(Policy::queue(2));
        work.deadline(Deadline::after(ms(100)).anchor(anchor)).out();
        let log = net.run(900);
        log.lines("work").into_iter().filter(|line| line.contains("misses")).collect::<Vec<_>>()
    };
    assert_eq!(missed(Anchor::Arrival), ["work misses 5@120", "work misses 10@130"]);
    assert_eq!(missed(Anchor::Stamp), ["work misses 5@105", "work misses 10@110"]);
    assert_eq!(missed(Anchor::Start), ["work misses 5@120", "work misses 10@620"]);
}

#[test]
fn s6_1_each_stamp_has_its_own_deadline() {
    let mut net = Net::new();
    let source = net.instant_messages("source", 10, 30);
    net.stage("work", join(&[source]))
        .runtime(cycle(&[15, 100, 5, 5]))
        .policy(Policy::pipelined(4))
        .deadline(reuse(40))
        .out();
    let log = net.run(300);
    // The step for 10 is late at 50; the steps for 20 and 30 wait for it until then and are in time.
    assert_eq!(log.messages("work"), [(0, 15), (10, 50), (20, 50), (30, 50)]);
    let reused: Vec<_> = log.published("work").iter().filter_map(|p| p.reused_from).collect();
    assert_eq!(reused, [30_000_000], "the newest finished result, published or not");
}

#[test]
fn s6_1_a_deadline_past_when_the_frame_opens_is_missed_at_once() {
    let mut net = Net::new();
    let source = net.script("source", &[(80, Some(5), 5)]);
    net.stage("work", join(&[source])).deadline(Deadline::after(ms(50)).anchor(Anchor::Stamp)).out();
    let log = net.run(300);
    assert_eq!(log.lines("work"), ["work misses 5@80", "work -@80"]);
}

#[test]
fn s6_2_a_policy_stream_decides_the_length_at_the_anchor_instant() {
    struct Lengths;
    impl Operator for Lengths {
        type In = Every;
        type Out = Port<Span>;
        fn step(&mut self, cx: &mut Context<'_>, _: &Every, out: &mut Port<Span>) {
            out.send(if cx.stamp() < at(100) { ms(10) } else { ms(90) });
        }
    }
    let mut net = Net::new();
    let source = net.instant_messages("source", 50, 150);
    let lengths = net.graph.add("lengths", Lengths, every(ms(20)).phase(ms(40))).out();
    let deadline = Deadline::from_policy(lengths, ms(30));
    net.stage("work", join(&[source])).runtime(fixed(40)).deadline(deadline).out();
    let log = net.run(300);
    let misses: Vec<_> = log.lines("work").into_iter().filter(|line| line.contains("misses")).collect();
    // 30 ms until there is a policy, 10 ms at 50, 90 ms from 100 on.
    assert_eq!(misses, ["work misses 0@30", "work misses 50@60"]);
    assert_eq!(log.messages("work"), [(100, 140), (150, 190)]);
}

#[test]
fn s6_3_skip_publishes_no_message_and_raises_the_watermark() {
    let mut net = Net::new();
    net.stage("work", tick(100)).runtime(cycle(&[60, 10])).deadline(Deadline::after(ms(50))).out();
    let log = net.run(150);
    let expected =
        [(None, -1, 0), (None, 99_999_999, 50_000_000), (Some(100_000_000), 199_999_999, 110_000_000)];
    assert_eq!(log.watermarks("work"), expected);
}

#[test]
fn s6_3_reuse_last_repeats_the_newest_finished_result_through_any_number_of_repeats() {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(100)).origin().out();
    net.stage("work", join(&[camera])).runtime(cycle(&[30, 250, 10])).deadline(reuse(50)).out();
    let log = net.run(460);
    // The step for 100 runs until 350: 100 and 200 repeat 0. Its result is then the newest, though never published, and
    // 300 repeats it.
    assert_eq!(log.messages("work"), [(0, 30), (100, 150), (200, 250), (300, 350), (400, 410)]);
    let reused: Vec<_> =
        log.published("work").iter().filter(|p| p.stamp.is_some()).map(|p| p.reused_from).collect();
    assert_eq!(reused, [None, Some(0), Some(0), Some(100_000_000), None]);
    let repeat = &log.published("work")[3];
    assert_eq!((repeat.origin, &repeat.reads[0]), (Some(0), &("camera".into(), Some(0))));
}

#[test]
fn s6_3_reuse_last_acts_as_skip_before_the_first_result() {
    let mut net = Net::new();
    net.stage("work", tick(100)).runtime(fixed(60)).deadline(reuse(50)).out();
    let log = net.run(160);
    assert_eq!(log.messages("work"), [(100, 150)]);
    assert_eq!(log.published("work").last().unwrap().reused_from, Some(0));
}

#[test]
fn s6_3_a_step_that_only_waits_for_an_older_one_gives_its_own_result() {
    let mut net = Net::new();
    let source = net.script("source", &[(0, Some(0), 0), (10, Some(10), 10), (20, Some(20), 20)]);
    let lengths = net.graph.script(
        "lengths",
        vec![PlaybackRecord::message(at(0), at(0), ms(300)), PlaybackRecord::message(at(10), at(10), ms(60))],
    );
    let deadline = Deadline::from_policy(lengths, ms(1)).reaction(Reaction::ReuseLast);
    net.stage("work", join(&[source]))
        .runtime(cycle(&[200, 20, 30]))
        .policy(Policy::pipelined(3))
        .deadline(deadline)
        .out();
    let log = net.run(300);
    // 10 (ended at 30) and 20 (ended at 50) wait for 0; at 70 the deadline of 10 passes and its own result answers.
    assert_eq!(log.messages("work"), [(10, 70), (20, 70)]);
    assert!(log.published("work").iter().all(|p| p.reused_from.is_none()), "nothing was repeated");
    assert_eq!((log.tally("work").repeats, log.tally("work").misses), (0, 1));
    assert_eq!(log.tally("work").drops.overtaken, 1);
    // The step for 0 keeps its place until its end.
    assert!(log.all().contains(&"work ends 0@200".to_string()));
}

#[test]
fn s6_3_the_reaction_wins_over_the_late_result_and_the_place_stays_taken() {
    let mut net = Net::new();
    let source = net.script("source", &[(0, Some(0), 0), (10, Some(10), 10), (60, Some(60), 60)]);
    net.stage("work", join(&[source])).runtime(cycle(&[5, 80])).deadline(reuse(30)).out();
    let log = net.run(300);
    // The step for 10 runs from 10 to 90: its stamp is answered by 0 at 40, and 60 waits until 90 in vain.
    assert_eq!(log.messages("work"), [(0, 5), (10, 40), (60, 90)]);
    assert_eq!(
        log.published("work").last().unwrap().reused_from,
        Some(10_000_000),
        "its late result is the newest"
    );
    assert_eq!(log.tally("work").steps, 2);
}

#[test]
fn s6_3_publishing_a_stamp_resolves_all_older_ones() {
    let mut net = Net::new();
    let a = net.instant_messages("a", 10, 20);
    let late = net.script("late", &[(100, Some(10), 10)]);
    let lengths = vec![PlaybackRecord::message(at(20), at(20), ms(5))];
    let lengths = net.graph.script("lengths", lengths);
    let deadline = Deadline::from_policy(lengths, ms(500));
    net.stage("work", join(&[a, late])).deadline(deadline).out();
    let log = net.run(300);
    // 0 and 10 would have time until 500, but 20 is answered at 25.
    let expected = [
        "work misses 20@25",
        "work drops 0@25 GivenUp",
        "work drops 10@25 GivenUp",
        "work -@25",
        "work drops 10@100 TooLate",
    ];
    assert_eq!(log.lines("work"), expected);
}

#[test]
fn s6_3_dropping_a_frame_ends_its_deadline_without_reaction() {
    let mut net = Net::new();
    let source = net.instant_messages("source", 10, 30);
    net.stage("work", join(&[source])).runtime(fixed(35)).deadline(Deadline::after(ms(40))).out();
    let log = net.run(300);
    assert_eq!(log.messages("work"), [(0, 35), (30, 70)]);
    assert_eq!(log.tally("work").misses, 0);
    assert_eq!(log.tally("work").drops.skipped, 2);
}

/// Counts up to `goal` and offers every count; publishes when done or requested to stop.
struct Anytime {
    goal: i64,
    /// Publishes nothing when requested to stop, so that the reaction has to answer.
    leave: bool,
    /// Continues when requested to stop.
    stubborn: bool,
}

impl Operator for Anytime {
    type In = At<i64>;
    type Out = Port<i64>;

    fn step(&mut self, cx: &mut Context<'_>, _: &At<i64>, out: &mut Port<i64>) {
        for n in 1..=self.goal {
            cx.offer(out, n);
            if cx.spend(1) == Progress::Stop && !self.stubborn {
                if !self.leave {
                    out.send(1000 + n);
                }
                return;
            }
        }
        out.send(self.goal);
    }

    fn on_deadline(miss: &Miss<Port<i64>>, out: &mut Port<i64>) {
        if let Some(best) = miss.offered.clone().or(miss.last.clone()) {
            out.forward(best);
        }
    }
}

fn anytime(operator: Anytime, runtime: RuntimeModel) -> (Vec<(i64, i64, i64)>, Log) {
    let mut net = Net::new();
    let source = net.instant_messages("source", 100, 100);
    let deadline = Deadline::after(ms(50)).reaction(Reaction::OnDeadline);
    net.graph.add("work", operator, source).runtime(runtime).deadline(deadline).out();
    let log = Log::default();
    let (mut recorder, mut values) = (log.clone(), Vec::new());
    let mut observer = |event: &Event<'_>| {
        if let Event::Publication(Publication {
            operator: "work",
            stamp: Some(stamp),
            visible_at,
            payload: Some(payload),
            ..
        }) = event
        {
            let value = *payload.downcast_ref::<i64>().unwrap();
            values.push((stamp.ns() / 1_000_000, visible_at.ns() / 1_000_000, value));
        }
    };
    run_virtual(net.graph, &RunOptions::until(at(400)), vec![&mut recorder, &mut observer]).unwrap();
    (values, log)
}

fn work(base_ms: i64) -> RuntimeModel {
    RuntimeModel::Work { base: ms(base_ms), per_unit_ns: 4e6 }
}

#[test]
fn s6_4_a_step_is_stopped_at_a_definite_unit_and_publishes_in_time() {
    let anytime_step = Anytime { goal: 99, leave: false, stubborn: false };
    // (50 - 10) / 4 = 10 units: requested to stop at the tenth, done at the deadline.
    assert_eq!(anytime(anytime_step, work(10)).0, [(0, 50, 1010), (100, 150, 1010)]);
    let anytime_step = Anytime { goal: 99, leave: false, stubborn: false };
    // (50 - 11) / 4 = 9.75 units: requested to stop at the ninth, done at 47.
    assert_eq!(anytime(anytime_step, work(11)).0, [(0, 47, 1009), (100, 147, 1009)]);
    let short = Anytime { goal: 5, leave: false, stubborn: false };
    assert_eq!(anytime(short, work(10)).0, [(0, 30, 5), (100, 130, 5)]);
}

#[test]
fn s6_4_a_step_whose_base_alone_is_late_still_ends_at_its_deadline_when_it_stops() {
    let anytime_step = Anytime { goal: 99, leave: false, stubborn: false };
    assert_eq!(anytime(anytime_step, work(70)).0, [(0, 50, 1001), (100, 150, 1001)]);
}

#[test]
fn s6_4_the_reaction_receives_the_offers_made_by_the_deadline() {
    let stubborn = Anytime { goal: 20, leave: false, stubborn: true };
    let (values, log) = anytime(stubborn, work(10));
    // It counts on to 20 and ends at 90; only the offers made before the eleventh unit count.
    assert_eq!(values, [(0, 50, 11), (100, 150, 11)]);
    assert!(log.all().contains(&"work ends 0@90".to_string()), "it keeps its place until its modelled end");
}

#[test]
fn s6_4_a_step_that_stops_and_sends_nothing_leaves_the_stamp_to_the_reaction() {
    let leaving = Anytime { goal: 99, leave: true, stubborn: false };
    let (values, log) = anytime(leaving, work(11));
    assert_eq!(values, [(0, 50, 9), (100, 150, 9)]);
    assert_eq!((log.tally("work").misses, log.tally("work").drops.total()), (2, 0));
    assert!(log.all().contains(&"work ends 0@50".to_string()), "its place is free at its deadline");
}

#[test]
fn s6_4_under_other_models_a_step_cannot_be_cut() {
    let step = Anytime { goal: 20, leave: false, stubborn: false };
    let (values, log) = anytime(step, cycle(&[20, 80]));
    // `spend` only counts; at the miss of 100 nothing was offered, so the newest result is used.
    assert_eq!(values, [(0, 20, 20), (100, 150, 20)]);
    assert_eq!(log.tally("work").units, 40);
}
