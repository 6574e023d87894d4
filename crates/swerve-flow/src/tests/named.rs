//! Ports by name: the port descriptions derived from a struct, and graphs wired with them.

use swerve_core::Digest;

use super::net::{at, fixed, ms};
use crate::*;

/// All kinds of input ports.
#[derive(Inputs)]
struct Everything {
    /// Fires it,
    /// with others.
    frame: At<i64>,
    /// The newest result.
    #[port(feedback)]
    result: Latest<f64>,
    history: Window<i64, 3>,
    tick: Every,
    #[port(raw)]
    others: Vec<Latest<i64>>,
    #[port(raw, feedback)]
    r#extra: Option<Latest<f64>>,
    absent: Option<Window<String, 2>>,
}

/// Two outputs of one type and one of another.
#[derive(Outputs)]
struct Results {
    /// A sum.
    sum: Port<f64>,
    count: Port<f64>,
    text: Port<String>,
}

type Tuple = (
    At<i64>,
    Latest<f64>,
    Window<i64, 3>,
    Every,
    Vec<Latest<i64>>,
    Option<Latest<f64>>,
    Option<Window<String, 2>>,
);

/// Outputs of both operators below.
fn results(
    frame: &At<i64>,
    result: &Latest<f64>,
    history: &Window<i64, 3>,
    tick: Every,
    others: &[Latest<i64>],
) -> (f64, f64, String) {
    let sum = frame.get().map_or(0, |frame| **frame) as f64 + result.get().map_or(0.5, |result| **result);
    let count = history.get().len() as f64 + others.iter().filter_map(Latest::get).count() as f64;
    (sum, count, format!("{sum} {count} {}", tick.ticked()))
}

struct Named;

impl Operator for Named {
    type In = Everything;
    type Out = Results;

    fn step(&mut self, _: &mut Context<'_>, input: &Everything, out: &mut Results) {
        let Everything { frame, result, history, tick, others, extra, absent } = input;
        assert!(extra.is_some() && absent.is_none());
        let (sum, count, text) = results(frame, result, history, *tick, others);
        out.sum.send(sum);
        out.count.send(count);
        out.text.send(text);
    }
}

struct Positional;

impl Operator for Positional {
    type In = Tuple;
    type Out = (Port<f64>, Port<f64>, Port<String>);

    fn step(&mut self, _: &mut Context<'_>, input: &Tuple, out: &mut Self::Out) {
        let (frame, result, history, tick, others, _, _) = input;
        let (sum, count, text) = results(frame, result, history, *tick, others);
        out.0.send(sum);
        out.1.send(count);
        out.2.send(text);
    }
}

struct Counter;

impl Operator for Counter {
    type In = Every;
    type Out = Port<i64>;

    fn step(&mut self, cx: &mut Context<'_>, _: &Every, out: &mut Port<i64>) {
        out.send(cx.stamp().ns() / 1_000_000);
    }
}

/// Two counters; the second is slower.
fn counters(graph: &mut Graph) -> [Stream<i64>; 2] {
    let fast = graph.add("fast", Counter, every(ms(10))).out();
    [fast, graph.add("slow", Counter, every(ms(35))).runtime(fixed(3)).out()]
}

fn digest(graph: Graph) -> Digest {
    let report = run_virtual(graph, &RunOptions::until(at(500)), vec![]).unwrap();
    assert!(report.operator("work").unwrap().messages > 100);
    report.digest
}

/// Returns the source of each port of [`Everything`].
fn wire(graph: &mut Graph, port: &PortInfo) -> Result<Wire, GraphError> {
    let stream = |name| Wire::from(graph.stream(name));
    Ok(match &*port.name {
        "frame" => stream("fast"),
        "history" => stream("slow"),
        "others" => vec![stream("slow"), stream("fast")].into(),
        "tick" => every(ms(20)).into(),
        "result" | "extra" => graph.feedback_any(&*port.name, port.payload.unwrap()).into(),
        "absent" => Wire::None,
        name => unreachable!("no port is called {name}"),
    })
}

#[test]
fn derived_ports_match_the_fields() {
    let (int, float) = (PayloadType::of::<i64>(), PayloadType::of::<f64>());
    let port = |name, doc, mode, payload| PortInfo { doc, ..PortInfo::declared(name, mode, payload) };
    let expected = [
        port("frame", "Fires it, with others.", PortMode::At, Some(int)),
        PortInfo { feedback: true, ..port("result", "The newest result.", PortMode::Latest, Some(float)) },
        port("history", "", PortMode::Window(3), Some(int)),
        port("tick", "", PortMode::Every, None),
        PortInfo { many: true, raw: true, ..port("others", "", PortMode::Latest, Some(int)) },
        PortInfo {
            optional: true,
            feedback: true,
            raw: true,
            ..port("extra", "", PortMode::Latest, Some(float))
        },
        PortInfo {
            optional: true,
            ..port("absent", "", PortMode::Window(2), Some(PayloadType::of::<String>()))
        },
    ];
    assert_eq!(Everything::ports(), expected);
    let outputs: Vec<_> = Results::ports().into_iter().map(|o| (o.name, o.doc, o.payload.name())).collect();
    let expected = [("sum", "A sum.", "f64"), ("count", "", "f64"), ("text", "", "String")];
    assert_eq!(outputs, expected.map(|(name, doc, payload)| (name.into(), doc, payload.to_owned())));
    assert_eq!(<Port<i64> as NamedOutputs>::ports(), [OutputInfo::declared("out", int)]);
    assert_eq!(<() as NamedOutputs>::ports(), []);
}

#[test]
fn names_of_payload_types_have_no_paths() {
    assert_eq!(PayloadType::of::<Vec<Option<Header>>>().name(), "Vec<Option<Header>>");
    assert_eq!(PayloadType::of::<(i64, [EndReason; 2])>().name(), "(i64, [EndReason; 2])");
}

#[test]
fn wiring_by_name_and_by_position_gives_the_same_run() {
    let mut by_name = Graph::new();
    counters(&mut by_name);
    let streams = by_name.add_wired("work", Named, wire).unwrap().runtime(fixed(2)).out();
    let names: Vec<_> = by_name.streams().map(|(name, _)| name.to_owned()).collect();
    assert_eq!(names, ["fast", "slow", "work.sum", "work.count", "work.text"]);
    let [sum, count, text] = by_name.streams_of("work").unwrap()[..] else { panic!("three outputs") };
    assert_eq!(
        (sum.typed(), count.typed(), text.typed()),
        (Some(streams.0), Some(streams.1), Some(streams.2))
    );
    assert_eq!(sum.typed::<String>(), None);
    let mut connect = |name, stream| {
        let index = by_name.feedbacks.iter().position(|edge| edge.name == name).unwrap();
        by_name.connect_any(Feedback::<f64>::new(index).into(), stream).unwrap();
    };
    connect("result", sum);
    connect("extra", count);

    let by_position = |named: bool| {
        let mut graph = Graph::new();
        let [fast, slow] = counters(&mut graph);
        let (result, extra) = (graph.feedback("result"), graph.feedback("extra"));
        let others: Vec<Source<i64>> = vec![slow.into(), fast.into()];
        let absent: Option<Stream<String>> = None;
        let inputs = (fast, result, slow, every(ms(20)), others, Some(extra), absent);
        let (sum, count, _) = if named {
            graph.add("work", Named, inputs).runtime(fixed(2)).out()
        } else {
            let work = graph.add("work", Positional, inputs).runtime(fixed(2));
            work.outputs(&["sum", "count", "text"]).out()
        };
        graph.connect(result, sum);
        graph.connect(extra, count);
        graph
    };
    let (named, positional) = (by_position(true), by_position(false));
    assert_eq!(by_name.describe(), positional.describe());
    assert_eq!(named.describe(), positional.describe());
    let digest_by_name = digest(by_name);
    assert_eq!(digest_by_name, digest(named));
    assert_eq!(digest_by_name, digest(positional));
}

#[test]
fn a_wire_that_does_not_fit_is_refused() {
    let refused = |port: &'static str, give: &dyn Fn(&mut Graph) -> Wire| {
        let mut graph = Graph::new();
        counters(&mut graph);
        graph.script::<String>("words", Vec::new());
        let wired = |graph: &mut Graph, info: &PortInfo| {
            if info.name == port { Ok(give(graph)) } else { wire(graph, info) }
        };
        graph.add_wired("work", Named, wired).map(OperatorRef::out).unwrap_err().to_string()
    };
    let stream = |name: &'static str| move |graph: &mut Graph| Wire::from(graph.stream(name));
    let many = |name: &'static str| move |graph: &mut Graph| Wire::from(vec![graph.stream(name)]);
    let edge = |graph: &mut Graph| Wire::from(graph.feedback::<i64>("loop"));
    let tick = |_: &mut Graph| Wire::from(every(ms(1)));
    let nothing = |_: &mut Graph| Wire::None;
    let text = |port: &str, expected: &str, found: &str| {
        format!("operator `work`, port `{port}`: expected {expected}, found {found}")
    };

    let (words, either) = ("stream `words` of `String`", "a stream or feedback edge of");
    assert_eq!(refused("frame", &stream("words")), text("frame", "a stream of `i64`", words));
    assert_eq!(refused("frame", &edge), text("frame", "a stream of `i64`", "feedback edge `loop` of `i64`"));
    assert_eq!(refused("frame", &tick), text("frame", "a stream of `i64`", "a timer"));
    assert_eq!(refused("frame", &many("fast")), text("frame", "a stream of `i64`", "a list"));
    assert_eq!(refused("result", &nothing), text("result", &format!("{either} `f64`"), "nothing"));
    assert_eq!(refused("history", &stream("words")), text("history", &format!("{either} `i64`"), words));
    assert_eq!(refused("tick", &stream("fast")), text("tick", "a timer", "stream `fast` of `i64`"));
    assert_eq!(
        refused("others", &many("words")),
        text("others", &format!("any number of {either} `i64`"), words)
    );
    assert_eq!(
        refused("absent", &edge),
        text("absent", &format!("{either} `String`"), "feedback edge `loop` of `i64`")
    );
    // In this graph, the index of `b` belongs to a stream of another type, and that of `far` to none.
    let foreign = |id| {
        let mut other = Graph::new();
        let streams = [other.script::<i64>("a", vec![]).into(), other.script::<f64>("b", vec![]).into()];
        let far: AnyStream = counters(&mut other)[1].into();
        move |_: &mut Graph| Wire::Stream([streams[0], streams[1], far][id])
    };
    for id in [1, 2] {
        let text = "operator `work` was given a handle of another graph";
        assert_eq!(refused("frame", &foreign(id)), text);
    }
}

#[test]
fn add_wired_returns_the_errors_of_the_wiring() {
    #[derive(Debug)]
    struct Missing(String);
    impl From<GraphError> for Missing {
        fn from(_: GraphError) -> Self {
            Self("graph".into())
        }
    }
    let mut graph = Graph::new();
    let failed = graph
        .add_wired("work", Named, |_, port| Err(Missing(port.name.clone().into_owned())))
        .map(OperatorRef::out);
    assert_eq!(failed.unwrap_err().0, "frame");
    assert_eq!(graph.describe().unwrap().operators, []);
    let failed = graph.add_wired("work", Named, |_, _| Ok::<_, Missing>(Wire::None)).map(OperatorRef::out);
    assert_eq!(failed.unwrap_err().0, "graph");
    assert!(graph.streams_of("work").is_err());
    assert_eq!(graph.stream("work"), None);
}

#[test]
fn feedback_edge_accepts_one_stream_of_its_type() {
    let mut graph = Graph::new();
    let [fast, slow] = counters(&mut graph);
    let edge = graph.feedback_any("loop", PayloadType::of::<f64>());
    let error = graph.connect_any(edge, fast.into()).unwrap_err();
    let text = "feedback edge `loop`: expected a stream of `f64`, found stream `fast` of `i64`";
    assert_eq!(error.to_string(), text);
    let edge = graph.feedback::<i64>("again");
    graph.connect_any(edge.into(), slow.into()).unwrap();
    let error = graph.connect_any(edge.into(), slow.into()).unwrap_err();
    assert_eq!(error.to_string(), "feedback edge `again` is connected twice");
    assert_eq!(AnyFeedback::from(edge).typed(), Some(edge));
    assert_eq!(AnyFeedback::from(edge).typed::<f64>(), None);
    let foreign = AnyFeedback::from(Feedback::<i64>::new(7));
    assert!(matches!(graph.connect_any(foreign, fast.into()), Err(GraphError::ForeignHandle { .. })));
}

/// Structs of ports can be generic, and can have more outputs than any tuple.
#[derive(Inputs)]
struct One<T: Payload> {
    message: At<T>,
}

#[derive(Outputs)]
struct Many<T>
where
    T: Payload,
{
    a: Port<T>,
    b: Port<T>,
    c: Port<T>,
    d: Port<T>,
    e: Port<T>,
    f: Port<T>,
}

/// Publishes on every port in turn, the last ones first, and on all at every seventh message.
struct Spread<T>(usize, core::marker::PhantomData<T>);

impl<T: Payload> Operator for Spread<T> {
    type In = One<T>;
    type Out = Many<T>;

    fn step(&mut self, _: &mut Context<'_>, input: &One<T>, out: &mut Many<T>) {
        let Some(message) = input.message.get() else { return };
        let Many { a, b, c, d, e, f } = out;
        for (i, port) in [f, e, d, c, b, a].into_iter().enumerate() {
            if self.0 % 7 == i || self.0 % 7 == 6 {
                port.pass_on(message);
            }
        }
        self.0 += 1;
    }
}

#[test]
fn many_outputs_are_published_in_the_order_of_the_fields() {
    let mut graph = Graph::new();
    let [fast, _] = counters(&mut graph);
    let wire = |_: &mut Graph, _: &PortInfo| Ok::<_, GraphError>(fast.into());
    graph.add_wired("spread", Spread::<i64>(0, core::marker::PhantomData), wire).unwrap().out();
    let mut published = Vec::new();
    let mut observer = |event: &Event<'_>| {
        if let Event::Publication(Publication { operator: "spread", stream, stamp: Some(stamp), .. }) = event
        {
            published.push((stamp.ns() / 10_000_000, (*stream).to_owned()));
        }
    };
    run_virtual(graph, &RunOptions::until(at(60)), vec![&mut observer]).unwrap();
    let single = ["f", "e", "d", "c", "b", "a"].into_iter().zip(0..);
    let expected = single.chain(["a", "b", "c", "d", "e", "f"].map(|name| (name, 6)));
    assert_eq!(published, expected.map(|(name, at)| (at, format!("spread.{name}"))).collect::<Vec<_>>());
}
