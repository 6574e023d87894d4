//! Section 3: one instant is one sweep.

use swerve_core::Time;

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
    // The step for 0, itself late, ends at 50, the deadline of the frame of 10: that frame never starts.
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
    // Steps without run time all end in the turn, before the bound of the queue applies.
    assert_eq!(log.messages("all"), [(0, 30), (10, 30), (20, 30), (30, 30)]);
    assert_eq!(log.messages("two"), [(20, 35), (30, 35)]);
    assert_eq!((log.tally("newest").drops.skipped, log.tally("two").drops.skipped), (3, 2));
}

/// A chain and a join with random policies, run times, deadlines and resources.
fn random_net(case: i64) -> Net {
    let mut rng = swerve_core::Rng::keyed(7, "net", &[case]);
    let mut net = Net::new();
    let n = 60;
    let mut now = 0;
    let records: Vec<_> = (0..n)
        .map(|k| {
            now += 5 + rng.below(20) as i64;
            (now + rng.below(4) as i64, Some(10 * k), 10 * k + rng.below(10) as i64)
        })
        .collect();
    let source = net.script("source", &records);
    let gpu = net.graph.resource("gpu", 1 + rng.below(2));
    let mut streams = vec![source];
    for i in 0..4 {
        let on = match rng.below(4) {
            0 => vec![source, streams[streams.len() - 1]],
            _ => vec![streams[rng.below(streams.len())]],
        };
        let mut on = on;
        on.dedup();
        let policy = match rng.below(5) {
            0 => Policy::SkipToLatest,
            1 => Policy::queue(1 + rng.below(3)),
            2 => Policy::Queue { capacity: 2, full: Full::DropNewest },
            3 => Policy::pipelined(1 + rng.below(4)),
            _ => Policy::Pipelined { places: 3, late: Late::Overtaken },
        };
        let plain = rng.below(2) == 0;
        let model = match rng.below(3) {
            _ if plain => RuntimeModel::Zero,
            0 => RuntimeModel::Zero,
            1 => RuntimeModel::Cycle(vec![ms(3), ms(40), ms(0), ms(17)]),
            _ => RuntimeModel::Normal { mean: ms(20), deviation: ms(15) },
        };
        let reaction = [Reaction::Skip, Reaction::ReuseLast, Reaction::OnDeadline][rng.below(3)];
        let anchor = [Anchor::Arrival, Anchor::Stamp, Anchor::Start][rng.below(3)];
        let deadline = Deadline::after(ms(1 + rng.below(60) as i64)).anchor(anchor).reaction(reaction);
        let (limited, shared) = (!plain && rng.below(2) == 0, !plain && rng.below(3) == 0);
        let mut stage = net.stage(&format!("stage{i}"), join(&on)).policy(policy).runtime(model);
        if limited {
            stage = stage.deadline(deadline);
        }
        streams.push(if shared { stage.uses(gpu).out() } else { stage.out() });
    }
    net
}

#[test]
fn s3_stamps_are_never_out_of_order_or_skipped_without_a_count() {
    for case in 0..300 {
        let net = random_net(case);
        let log = Log::default();
        let mut recorder = log.clone();
        let report = run_virtual(net.graph, &RunOptions::default(), vec![&mut recorder]).unwrap();
        assert_eq!(report.end, EndReason::Idle);
        for operator in &report.operators {
            let mut watermark = i64::MIN;
            for p in log.published(&operator.name) {
                assert!(p.stamp.is_none_or(|stamp| stamp > watermark), "{case}: {p:?} after {watermark}");
                assert!(p.stamp.is_none_or(|stamp| stamp <= p.watermark), "{case}: {p:?}");
                assert!(p.watermark >= watermark, "{case}: {p:?} after {watermark}");
                watermark = p.watermark;
            }
            let started = operator.messages - operator.repeats;
            assert!(operator.name == "source" || started <= operator.steps, "{case}: {operator:?}");
        }
        // An operator that reads only the source answers each stamp once: by its step, by a reaction, or by a drop.
        let alone = |name: &str| {
            let published = log.published(name);
            let reads = |p: &Published| p.reads.len() == 1 && p.reads[0].0 == "source";
            published.iter().any(|p| p.stamp.is_some())
                && published.iter().filter(|p| p.stamp.is_some()).all(reads)
        };
        for operator in report.operators.iter().filter(|operator| alone(&operator.name)) {
            let own = log.own_results_at_misses(&operator.name) as u64;
            let published = operator.messages - operator.repeats - own;
            let answered = published + operator.misses + operator.drops.total();
            assert_eq!(answered + operator.drops.too_late, 60, "{case}: {operator:?}");
        }
    }
}

#[test]
fn s8_observers_change_nothing() {
    for case in 0..300 {
        let log = Log::default();
        let mut recorder = log.clone();
        let observed =
            run_virtual(random_net(case).graph, &RunOptions::default(), vec![&mut recorder]).unwrap();
        let alone = run_virtual(random_net(case).graph, &RunOptions::default(), vec![]).unwrap();
        assert_eq!(observed, alone, "{case}");
    }
}

/// Events, publications and report of a run; with `by_records`, it replays an empty record, so that no turn takes the
/// short path.
fn told(net: Net, by_records: bool) -> (Vec<String>, Vec<Published>, Result<RunReport, String>) {
    let log = Log::default();
    let mut recorder = log.clone();
    let (options, observers) = (RunOptions::until(at(2000)), vec![&mut recorder as &mut dyn Observer]);
    let report = match by_records {
        true => run_replay(net.graph, &options, Replay::default(), observers),
        false => run_virtual(net.graph, &options, observers),
    };
    let published =
        ["source", "stage0", "stage1", "stage2", "stage3", "last"].map(|name| log.published(name));
    (log.all(), published.concat(), report.map_err(|error| error.to_string()))
}

/// Publishes on some steps only, and panics at a stamp.
struct Fitful {
    panics_at: Time,
    steps: u64,
}

impl Operator for Fitful {
    type In = (At<i64>, Latest<i64>);
    type Out = (Port<i64>, Port<i64>);

    fn step(&mut self, cx: &mut Context<'_>, _: &Self::In, (some, all): &mut Self::Out) {
        assert!(cx.stamp() < self.panics_at, "here it ends");
        self.steps += 1;
        if self.steps.is_multiple_of(2) {
            some.send(cx.stamp().ns());
        }
        if !self.steps.is_multiple_of(3) {
            all.send(cx.stamp().ns());
        }
        if self.steps == 50 {
            cx.stop_run("enough");
        }
    }
}

#[test]
fn s3_the_short_path_of_a_turn_has_the_result_of_a_full_turn() {
    for case in 0..300 {
        assert_eq!(told(random_net(case), false), told(random_net(case), true), "{case}");
    }
    for panics_ms in [0, 70, 300, 5000] {
        for delay_ms in [0, 3] {
            let net = || {
                let mut net = Net::new();
                let source = net.stage("source", tick(10)).delay(ms(delay_ms)).out();
                let fitful = Fitful { panics_at: at(panics_ms), steps: 0 };
                let (some, all) = net.graph.add("stage0", fitful, (source, source)).out();
                let slow = net.stage("stage1", join(&[some])).runtime(fixed(4)).out();
                net.stage("last", join(&[all]).latest(slow)).out();
                net
            };
            assert_eq!(told(net(), false), told(net(), true), "{panics_ms} {delay_ms}");
        }
    }
}
