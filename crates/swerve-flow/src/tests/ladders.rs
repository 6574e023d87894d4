//! Sections 2 and 6: operators on a timer and on a ladder.

use swerve_core::Span;

use super::net::{Net, at, ms};
use crate::*;

/// A variant of an operator, with the number of steps as its state.
struct Variant {
    name: &'static str,
    steps: usize,
    /// Units that a step counts itself.
    spends: u64,
    /// Steps that publish nothing.
    silent: bool,
}

#[derive(Inputs)]
struct In {
    frame: At<i64>,
}

#[derive(Outputs)]
struct Out {
    /// Name of the variant and number of steps so far.
    answer: Port<String>,
}

impl Operator for Variant {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(frame) = input.frame.get() else { return };
        self.steps += 1;
        assert_eq!(cx.spend(self.spends), Progress::Continue, "a rung is not cut short");
        if !self.silent {
            out.answer.send(format!(
                "{} {} {}",
                self.name,
                self.steps,
                frame.header().stamp.ns() / 1_000_000
            ));
        }
    }
}

impl Variant {
    fn new(name: &'static str) -> Self {
        Self { name, steps: 0, spends: 100_000, silent: false }
    }

    fn carry(from: &mut Self, to: &mut Self) {
        to.steps = from.steps;
    }
}

/// Ladder of variants with their run times, ms.
fn ladder<const N: usize>(rungs: [(i64, Variant); N]) -> Ladder<Variant, i64> {
    Ladder {
        rungs: rungs.into_iter().map(|(run_time, variant)| (ms(run_time), variant)).collect(),
        sets_run_time: true,
        carry: Variant::carry,
        output: "rung",
        report: Box::new(|taken| Some(taken.rung as i64)),
    }
}

/// Answers of the operator `work` with the instants of their publication, ms, and the reports of its rungs.
fn answers(mut net: Net, until_ms: i64) -> (Vec<(String, i64)>, Vec<i64>) {
    #[derive(Default)]
    struct Seen(Vec<(String, i64)>, Vec<i64>);
    impl Observer for Seen {
        fn event(&mut self, event: &Event<'_>) {
            let Event::Publication(publication) = event else { return };
            let Some(payload) = publication.payload.filter(|_| publication.operator == "work") else {
                return;
            };
            match payload.downcast_ref::<String>() {
                Some(answer) => self.0.push((answer.clone(), publication.visible_at.ns() / 1_000_000)),
                None => self.1.extend(payload.downcast_ref::<i64>()),
            }
        }
    }
    let mut seen = Seen::default();
    let graph = core::mem::take(&mut net.graph);
    run_virtual(graph, &RunOptions::until(at(until_ms)), vec![&mut seen]).expect("the graph runs");
    (seen.0, seen.1)
}

/// Answers and reports of a ladder that reads frames every 100 ms, under a deadline.
fn on_ladder<const N: usize>(rungs: [(i64, Variant); N], deadline_ms: i64) -> (Vec<(String, i64)>, Vec<i64>) {
    let mut net = Net::new();
    let frames = net.instant_messages("frames", 100, 200);
    let wire = |_: &mut Graph, _: &PortInfo| Ok::<_, GraphError>(Wire::from(frames));
    let work = net.graph.add_ladder("work", ladder(rungs), wire).unwrap();
    let _work = work.runtime(RuntimeModel::LADDER).deadline(Deadline::after(ms(deadline_ms)));
    assert_eq!(
        net.graph.streams().map(|(name, _)| name).collect::<Vec<_>>(),
        ["frames", "work.answer", "work.rung"]
    );
    answers(net, 300)
}

#[test]
fn s6_5_a_step_takes_the_finest_rung_that_meets_the_deadline() {
    let rungs = || [(10, Variant::new("coarse")), (40, Variant::new("fine"))];
    let (fine, taken) = on_ladder(rungs(), 40);
    assert_eq!(fine, [("fine 1 0".into(), 40), ("fine 2 100".into(), 140), ("fine 3 200".into(), 240)]);
    assert_eq!(taken, [1, 1, 1]);
    let (coarse, taken) = on_ladder(rungs(), 39);
    assert_eq!(
        coarse,
        [("coarse 1 0".into(), 10), ("coarse 2 100".into(), 110), ("coarse 3 200".into(), 210)]
    );
    assert_eq!(taken, [0, 0, 0]);
    assert_eq!(on_ladder(rungs(), 9), (vec![], vec![]), "the fastest is late rather than cut");
}

#[test]
fn s6_5_a_step_that_publishes_nothing_takes_no_time() {
    let silent = || Variant { silent: true, ..Variant::new("silent") };
    let mut net = Net::new();
    let frames = net.instant_messages("frames", 10, 30);
    let wire = |_: &mut Graph, _: &PortInfo| Ok::<_, GraphError>(Wire::from(frames));
    let _work =
        net.graph.add_ladder("work", ladder([(40, silent())]), wire).unwrap().runtime(RuntimeModel::LADDER);
    let report = run_virtual(net.graph, &RunOptions::until(at(100)), Vec::new()).unwrap();
    let work = report.operators.iter().find(|operator| operator.name == "work").unwrap();
    assert_eq!((work.steps, work.busy), (4, Span::ZERO));
}

#[test]
fn s6_5_state_is_carried_from_rung_to_rung() {
    let mut net = Net::new();
    let frames = net.instant_messages("frames", 100, 300);
    let lengths = [(0, Some(0), 0), (100, Some(100), 100), (200, Some(200), 200)];
    let records = lengths
        .iter()
        .zip([50, 20, 50])
        .map(|((at_ms, ..), length)| PlaybackRecord::message(at(*at_ms), at(*at_ms), ms(length)));
    let policy = net.graph.script::<Span>("policy", records.collect());
    let wire = |_: &mut Graph, _: &PortInfo| Ok::<_, GraphError>(Wire::from(frames));
    let rungs = [(10, Variant::new("coarse")), (40, Variant::new("fine"))];
    let work = net.graph.add_ladder("work", ladder(rungs), wire).unwrap();
    let _work = work.runtime(RuntimeModel::LADDER).deadline(Deadline::from_policy(policy, ms(50)));
    let (seen, _) = answers(net, 290);
    let names: Vec<&str> = seen.iter().map(|(answer, _)| answer.as_str()).collect();
    assert_eq!(names, ["fine 1 0", "coarse 2 100", "fine 3 200"]);
}

#[test]
fn s2_5_on_a_timer_a_step_reads_the_newest_frame_and_none_twice() {
    let mut net = Net::new();
    let frames = net.instant_messages("frames", 20, 80);
    let wire = |_: &mut Graph, _: &PortInfo| Ok::<_, GraphError>(Wire::from(frames));
    let work = net
        .graph
        .add_wired::<_, GraphError>("work", Variant { spends: 0, ..Variant::new("a") }, wire)
        .unwrap();
    let _work = work.on_timer(every(ms(30)));
    let (seen, _) = answers(net, 150);
    let at: Vec<_> = seen.iter().map(|(answer, at)| (answer.as_str(), *at)).collect();
    assert_eq!(
        at,
        [("a 1 0", 0), ("a 2 20", 30), ("a 3 60", 60), ("a 4 80", 90)],
        "nothing new at 120 and 150"
    );
}

#[test]
fn s2_5_an_operator_with_erased_types_runs_on_a_timer() {
    struct Copies;
    impl AnyOperator for Copies {
        fn step(&mut self, _: &mut Context<'_>, inputs: Vec<AnyInput>, out: &mut AnyOutputs<'_>) {
            let [AnyInput::Message(message), AnyInput::Tick] = &inputs[..] else { return };
            let mut bytes = Vec::new();
            message.payload.to_cbor(&mut bytes);
            out.send_cbor(0, &bytes).unwrap();
        }
    }
    let mut net = Net::new();
    let frames = net.instant_messages("frames", 20, 80);
    net.graph.add_any("work", Copies, &[AnySource::At(frames.into())], &[("out", PayloadType::of::<i64>())]);
    let _work = net.graph.operator("work").unwrap().on_timer(every(ms(30)));
    let log = net.run(150);
    assert_eq!(log.messages("work"), [(0, 0), (30, 30), (60, 60), (90, 90)]);
}
