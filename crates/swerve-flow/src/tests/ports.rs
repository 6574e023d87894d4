//! Section 2: ports.

use super::net::*;
use crate::*;

#[test]
fn s2_1_frames_exist_for_the_union_of_stamps_in_stamp_order() {
    let mut net = Net::new();
    // `b` is late with 20 and has no 10; `a` has no 20.
    let a = net.script("a", &[(10, Some(10), 10), (30, Some(30), 30)]);
    let b = net.script("b", &[(25, Some(20), 20), (40, Some(30), 30)]);
    net.stage("join", join(&[a, b])).out();
    let log = net.run(100);
    assert_eq!(log.messages("join"), [(10, 25), (20, 30), (30, 40)]);
    assert_eq!(log.reads("join", 10), [("a".into(), Some(10)), ("b".into(), None)]);
    assert_eq!(log.reads("join", 20), [("a".into(), None), ("b".into(), Some(20))]);
    assert_eq!(log.reads("join", 30), [("a".into(), Some(30)), ("b".into(), Some(30))]);
}

#[test]
fn s2_1_a_missing_stream_holds_every_frame_back() {
    let mut net = Net::new();
    let a = net.instant_messages("a", 10, 50);
    let never = net.script("never", &[]);
    net.stage("join", join(&[a, never])).policy(Policy::queue(9)).out();
    let log = net.run(100);
    assert_eq!(log.published("join"), []);
    assert_eq!(log.tally("join").steps, 0);
}

#[test]
fn s2_1_an_operator_whose_ports_are_bare_does_not_fire_and_passes_the_watermark_on() {
    let mut net = Net::new();
    let a = net.script("a", &[(5, None, 20)]);
    let b = net.script("b", &[(7, None, 10)]);
    net.stage("join", join(&[a, b])).out();
    let log = net.run(100);
    assert_eq!(log.watermarks("join"), [(None, 10_000_000, 7_000_000)]);
    assert_eq!(log.tally("join").steps, 0);
}

#[test]
fn s2_2_a_timer_fires_an_operator_that_only_reads_the_latest() {
    let mut net = Net::new();
    let pose = net.stage("pose", tick(10)).out();
    net.stage("control", tick(20).phase(5).latest(pose)).out();
    let log = net.run(50);
    assert_eq!(log.messages("control"), [(5, 5), (25, 25), (45, 45)]);
    assert_eq!(log.reads("control", 25), [("pose".into(), Some(20))]);
}

#[test]
fn s2_2_a_timer_and_a_stream_are_joined_by_stamp() {
    let mut net = Net::new();
    let source =
        net.script("source", &[(12, Some(5), 5), (15, Some(10), 10), (18, None, 20), (30, None, 30)]);
    let inputs = join(&[source]).and_tick(10);
    net.stage("both", inputs).policy(Policy::queue(8)).out();
    let log = net.run(30);
    // Tick 0 waits for the stream to pass 0; 5 has no tick; 10 has both; 20 and 30 have only the tick.
    assert_eq!(log.messages("both"), [(0, 12), (5, 12), (10, 15), (20, 20), (30, 30)]);
    assert_eq!(log.reads("both", 5), [("source".into(), Some(5))]);
    assert_eq!(log.reads("both", 20), [("source".into(), None)]);
}

#[test]
fn s2_3_latest_may_be_newer_than_the_frame_and_never_delays_it() {
    let mut net = Net::new();
    let slow = net.script("slow", &[(40, Some(10), 10)]);
    let fast = net.script("fast", &[(35, Some(35), 35)]);
    let never = net.script("never", &[]);
    net.stage("work", join(&[slow]).latest(fast).latest(never)).out();
    let log = net.run(100);
    assert_eq!(log.messages("work"), [(10, 40)]);
    let reads = [("slow".into(), Some(10)), ("fast".into(), Some(35)), ("never".into(), None)];
    assert_eq!(log.reads("work", 10), reads);
}

#[test]
fn s2_3_latest_is_read_when_the_step_starts() {
    let mut net = Net::new();
    let frames = net.script("frames", &[(0, Some(0), 0), (10, Some(10), 10)]);
    let pose = net.instant_messages("pose", 5, 100);
    net.stage("work", join(&[frames]).latest(pose)).runtime(fixed(30)).out();
    let log = net.run(100);
    // The step for 10 starts at 30, and so reads the pose of 30.
    assert_eq!(log.reads("work", 10), [("frames".into(), Some(10)), ("pose".into(), Some(30))]);
}

struct Sum;
impl Operator for Sum {
    type In = (Every, Window<i64, 3>);
    type Out = Port<Vec<i64>>;
    fn step(&mut self, cx: &mut Context<'_>, (_, window): &Self::In, out: &mut Self::Out) {
        assert!(window.newest().is_none_or(|message| message.header().visible_at <= cx.now()));
        out.send(window.get().iter().map(|message| message.header().stamp.ns() / 1_000_000).collect());
    }
}

fn windows(graph: Graph) -> Vec<Vec<i64>> {
    let mut seen = Vec::new();
    let mut observer = |event: &Event<'_>| {
        if let Event::Publication(Publication { operator: "sum", payload: Some(payload), .. }) = event {
            seen.push(payload.downcast_ref::<Vec<i64>>().unwrap().clone());
        }
    };
    run_virtual(graph, &RunOptions::until(at(45)), vec![&mut observer]).unwrap();
    seen
}

#[test]
fn s2_3_a_window_holds_the_newest_messages_oldest_first() {
    let mut net = Net::new();
    let source = net.instant_messages("source", 10, 100);
    net.graph.add("sum", Sum, (every(ms(20)).phase(ms(5)), source)).out();
    assert_eq!(windows(net.graph), [vec![0], vec![0, 10, 20], vec![20, 30, 40]]);
}

#[test]
fn s2_4_feedback_contains_messages_visible_strictly_before() {
    let mut net = Net::new();
    let feedback = net.graph.feedback("loop");
    net.graph.add("sum", Sum, (every(ms(20)), feedback)).out();
    let source = net.stage("source", tick(10)).out();
    net.graph.connect(feedback, source);
    assert_eq!(windows(net.graph), [vec![], vec![0, 10], vec![10, 20, 30]]);
}

#[test]
fn s2_4_latest_over_feedback_is_strictly_before_too() {
    let mut net = Net::new();
    let feedback = net.graph.feedback("loop");
    let world = net.stage("world", tick(10).latest(feedback)).out();
    let control = net.stage("control", join(&[world])).out();
    net.graph.connect(feedback, control);
    let log = net.run(30);
    assert_eq!(log.reads("world", 0), [("control".into(), None)]);
    assert_eq!(log.reads("world", 20), [("control".into(), Some(10))]);
    assert_eq!(log.reads("control", 20), [("world".into(), Some(20))]);
}

#[test]
fn s2_4_a_cycle_without_feedback_is_refused_and_named() {
    let mut net = Net::new();
    let a = net.stage("a", tick(10)).out();
    // Handles are returned by `add`, so a cycle requires a stream that is added later.
    let later: Stream<i64> = Stream::new(a.id + 2);
    let b = net.stage("b", join(&[a, later])).out();
    net.stage("c", join(&[b])).out();
    let error = net.graph.check().unwrap_err();
    assert_eq!(error.to_string(), "cycle without a feedback edge: c -> b -> c");
}

#[test]
fn s2_4_unconnected_feedback_is_refused() {
    let mut net = Net::new();
    let feedback = net.graph.feedback("commands");
    net.stage("world", tick(10).latest(feedback)).out();
    let error = net.graph.check().unwrap_err();
    assert_eq!(error.to_string(), "feedback edge `commands`, read by world, is connected to no stream");
}

#[test]
fn graph_check_reports_every_kind_of_error() {
    let refused = |build: &dyn Fn(&mut Net)| {
        let mut net = Net::new();
        build(&mut net);
        net.graph.check().unwrap_err().to_string()
    };
    let twice = refused(&|net| {
        net.stage("a", tick(10)).out();
        net.stage("a", tick(10)).out();
    });
    assert_eq!(twice, "the name `a` is used twice");
    let silent = refused(&|net| {
        let a = net.stage("a", tick(10)).out();
        net.stage("b", super::net::Inputs::default().latest(a)).out();
    });
    assert_eq!(silent, "operator `b` has no synchronised input: give it an `At` or an `Every` port");
    let slots = refused(&|net| {
        let gpu = net.graph.resource("gpu", 0);
        net.stage("a", tick(10)).uses(gpu).out();
    });
    assert_eq!(slots, "resource `gpu` has no slot, so a would never start");
    let value = |reason: &str| format!("operator `a`: {reason}");
    let period = refused(&|net| _ = net.stage("a", tick(0)));
    assert_eq!(period, value("the period of a timer has to be above zero"));
    let deadline = refused(&|net| _ = net.stage("a", tick(10)).deadline(Deadline::after(ms(0))));
    assert_eq!(deadline, value("a deadline has to be above zero"));
    let queue = refused(&|net| _ = net.stage("a", tick(10)).policy(Policy::queue(0)));
    assert_eq!(queue, value("a queue has to hold at least one frame"));
    let runtime = refused(&|net| _ = net.stage("a", tick(10)).runtime(fixed(-1)));
    assert_eq!(runtime, value("a fixed run time is below zero"));
    let foreign = refused(&|net| _ = net.stage("a", join(&[Stream::new(7)])));
    assert_eq!(foreign, "operator `a` was given a handle of another graph");
}

/// Publishes its input, by `pass_on` or by `forward`.
struct Again {
    pass_on: bool,
}

impl Operator for Again {
    type In = At<i64>;
    type Out = Port<i64>;

    fn step(&mut self, _: &mut Context<'_>, input: &At<i64>, out: &mut Port<i64>) {
        let message = input.get().expect("only messages fire it");
        if self.pass_on {
            out.pass_on(message);
        } else {
            out.forward(message.shared());
        }
    }
}

#[test]
fn pass_on_publishes_the_same_payload_with_the_same_digest() {
    let run = |pass_on: bool| {
        let mut net = Net::new();
        let a = net.instant_messages("a", 10, 50);
        net.graph.add("again", Again { pass_on }, a).out();
        // Addresses, because a pointer is not `Send`.
        let mut payloads: Vec<(String, usize)> = Vec::new();
        let mut observer = |event: &Event<'_>| {
            if let Event::Publication(publication) = event
                && let Some(payload) = publication.payload.and_then(|p| p.downcast_ref::<i64>())
            {
                payloads.push((publication.operator.to_owned(), std::ptr::from_ref(payload).addr()));
            }
        };
        let report = run_virtual(net.graph, &RunOptions::until(at(100)), vec![&mut observer]).unwrap();
        let of = |name: &str| payloads.iter().filter(|p| p.0 == name).map(|p| p.1).collect::<Vec<_>>();
        assert!(!of("a").is_empty());
        assert_eq!(of("a"), of("again"));
        report.digest
    };
    assert_eq!(run(true), run(false));
}
