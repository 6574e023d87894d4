//! An operator graph as text, as a DOT file and as a picture.

use core::fmt::Write as _;

use swerve_core::Span;
use swerve_flow::{GraphInfo, InputInfo, InputKind, OperatorInfo};

mod picture;

pub use picture::draw;

/// One line per operator in rank order, followed by its inputs and streams.
pub fn text(graph: &GraphInfo) -> String {
    let mut out = String::new();
    for operator in &graph.operators {
        let _ = writeln!(out, "{:>3} {}  [{}]", operator.rank, operator.name, facts(operator).join("; "));
        for input in &operator.inputs {
            let _ = writeln!(out, "      <- {}", input_text(input));
        }
        for (stream, payload) in &operator.outputs {
            let _ = writeln!(out, "      -> {stream}: {payload}");
        }
    }
    for (resource, slots) in &graph.resources {
        let users = graph.operators.iter().filter(|operator| operator.uses.as_ref() == Some(resource));
        let users: Vec<_> = users.map(|operator| operator.name.as_str()).collect();
        let _ = writeln!(out, "resource {resource}, slots {slots}: {}", users.join(", "));
    }
    out
}

/// The graph in the DOT language of Graphviz.
pub fn dot(graph: &GraphInfo) -> String {
    let mut out =
        String::from("digraph swerve {\n  rankdir=LR;\n  node [shape=box, fontname=\"sans-serif\"];\n");
    for operator in &graph.operators {
        let mut lines = vec![operator.name.clone()];
        lines.extend(facts(operator));
        let label: Vec<String> = lines.iter().map(|line| quoted(line)).collect();
        let _ = writeln!(out, "  \"{}\" [label=\"{}\"];", quoted(&operator.name), label.join("\\n"));
    }
    for edge in edges(graph) {
        let mut attributes = format!("label=\"{}\"", quoted(edge.stream));
        if edge.feedback {
            attributes += ", style=dashed, constraint=false";
        } else if !edge.joined {
            attributes += ", color=gray50";
        }
        let from = quoted(&graph.operators[edge.from].name);
        let _ =
            writeln!(out, "  \"{from}\" -> \"{}\" [{attributes}];", quoted(&graph.operators[edge.to].name));
    }
    out + "}\n"
}

/// All edges between operators, ordered by the rank of the reader.
fn edges(graph: &GraphInfo) -> Vec<EdgeInfo<'_>> {
    let mut edges = Vec::new();
    for (to, operator) in graph.operators.iter().enumerate() {
        for input in &operator.inputs {
            let from = graph.operators.iter().position(|o| Some(&o.name) == input.from.as_ref());
            let (Some(from), Some(stream)) = (from, &input.stream) else { continue };
            let feedback = matches!(input.kind, InputKind::Latest { feedback: true, .. });
            let nth = edges.iter().filter(|edge: &&EdgeInfo<'_>| edge.to == to && !edge.feedback).count();
            edges.push(EdgeInfo { from, to, stream, feedback, joined: input.kind == InputKind::At, nth });
        }
    }
    edges
}

struct EdgeInfo<'a> {
    from: usize,
    to: usize,
    stream: &'a str,
    feedback: bool,
    joined: bool,
    /// Index among the reader's inputs, feedback excluded.
    nth: usize,
}

/// Properties of an operator beside its ports.
fn facts(operator: &OperatorInfo) -> Vec<String> {
    if operator.feed {
        return vec!["source".into()];
    }
    let mut facts = vec![format!("run time {}", operator.runtime), operator.policy.clone()];
    facts.extend(operator.deadline.iter().map(|deadline| format!("deadline {deadline}")));
    facts.extend(operator.uses.iter().map(|resource| format!("uses {resource}")));
    if operator.delay_ns > 0 {
        facts.push(format!("delay {}", Span::from_ns(operator.delay_ns)));
    }
    facts.extend(operator.origin.then(|| "origin".into()));
    facts.extend(operator.heavy.then(|| "on a worker thread".into()));
    facts
}

/// Read mode and stream of an input.
fn input_text(input: &InputInfo) -> String {
    let stream = input.stream.as_deref().unwrap_or_default();
    match input.kind {
        InputKind::At => format!("at {stream}"),
        InputKind::Latest { depth, feedback } => {
            let kind = if depth > 1 { format!("last {depth} of") } else { "latest".into() };
            format!("{kind} {stream}{}", if feedback { " (feedback)" } else { "" })
        }
        InputKind::Every { period_ns, phase_ns } => {
            let period = Span::from_ns(period_ns);
            match phase_ns {
                0 => format!("every {period}"),
                _ => format!("every {period} from {}", Span::from_ns(phase_ns)),
            }
        }
    }
}

fn quoted(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"")
}

#[cfg(test)]
pub(super) mod tests {
    use swerve_flow::{
        At, Context, Deadline, Every, Graph, Latest, Operator, Policy, Port, Reaction, RuntimeModel, Stream,
        Timer, every,
    };

    use super::*;

    pub(super) struct Any;
    impl Operator for Any {
        type In = (Vec<Every>, Vec<At<Vec<f64>>>, Vec<Latest<Vec<f64>>>);
        type Out = Port<Vec<f64>>;
        fn step(&mut self, _: &mut Context<'_>, _: &Self::In, _: &mut Self::Out) {}
    }

    pub(super) fn loop_of_three() -> GraphInfo {
        let mut graph = Graph::new();
        let commands = graph.feedback("commands");
        let gpu = graph.resource("gpu0", 1);
        let ms = Span::from_ms;
        let timer = vec![every(ms(50)).phase(ms(5))];
        let none: Vec<Stream<Vec<f64>>> = vec![];
        let world = graph.add("world", Any, (timer, none.clone(), vec![commands])).origin().out();
        let untimed: Vec<Timer> = vec![];
        let detector = graph.add("detector \"a\" & <b>", Any, (untimed.clone(), vec![world], none));
        let detector = detector.runtime(RuntimeModel::Fixed(ms(80))).policy(Policy::queue(2)).uses(gpu);
        let boxes = detector.deadline(Deadline::after(ms(100)).reaction(Reaction::ReuseLast)).out();
        let control = graph.add("control", Any, (untimed, vec![boxes], vec![world])).out();
        graph.connect(commands, control);
        graph.describe().unwrap()
    }

    #[test]
    fn text_names_ranks_ports_models_policies_and_deadlines() {
        let expected = "  0 world  [run time zero; skip_to_latest; origin]
      <- every 50 ms from 5 ms
      <- latest control (feedback)
      -> world: Vec<f64>
  1 detector \"a\" & <b>  [run time fixed 80 ms; queue(2); deadline 100 ms from arrival, then reuse_last; uses gpu0]
      <- at world
      -> detector \"a\" & <b>: Vec<f64>
  2 control  [run time zero; skip_to_latest]
      <- at detector \"a\" & <b>
      <- latest world
      -> control: Vec<f64>
resource gpu0, slots 1: detector \"a\" & <b>
";
        assert_eq!(text(&loop_of_three()), expected);
    }

    #[test]
    fn dot_has_every_edge_and_dashes_feedback() {
        let dot = dot(&loop_of_three());
        assert!(dot.contains(r#""world" -> "detector \"a\" & <b>" [label="world"];"#), "{dot}");
        assert!(
            dot.contains(r#""control" -> "world" [label="control", style=dashed, constraint=false];"#),
            "{dot}"
        );
        assert_eq!(dot.matches(" -> ").count(), 4);
    }
}
