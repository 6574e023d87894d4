//! A graph as text, as a DOT file and as an SVG picture.

use core::fmt::Write as _;

use crate::canvas::escape;
use swerve_core::Span;
use swerve_flow::{GraphInfo, InputInfo, InputKind, OperatorInfo};

/// Box size, gaps and margin of the picture, in pixels.
const WIDTH: usize = 210;
const LINE: usize = 15;
const GAP_X: usize = 90;
const GAP_Y: usize = 26;
const MARGIN: usize = 24;
/// Between a box and its text.
const INSET: usize = 10;
/// Lines that one fact may take.
const WRAPPED_MAX: usize = 3;

/// One line per operator in rank order, and its inputs and streams below it.
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

/// A picture: operators as boxes, from the sources on the left to the sinks on the right; synchronised
/// inputs as full lines, latest ones as grey lines, feedback as dashed lines below.
pub fn svg(graph: &GraphInfo) -> String {
    let boxes = layout(graph);
    let width = boxes.iter().map(|b| b.x + WIDTH).max().unwrap_or(0) + MARGIN;
    let below = boxes.iter().map(|b| b.y + b.height).max().unwrap_or(0);
    let feedbacks = edges(graph).iter().filter(|edge| edge.feedback).count();
    let height = below + MARGIN + 18 * feedbacks;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <defs><marker id=\"tip\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"7\" markerHeight=\"7\" \
         orient=\"auto\"><path d=\"M0,0 L8,4 L0,8 z\" fill=\"context-stroke\"/></marker></defs>\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    let mut lane = below + 12;
    for edge in edges(graph) {
        out += &edge_path(&edge, &boxes, lane);
        lane += if edge.feedback { 18 } else { 0 };
    }
    for (operator, place) in graph.operators.iter().zip(&boxes) {
        out += &operator_box(operator, place);
    }
    out + "</svg>\n"
}

/// Every edge between operators, in rank order of its reader.
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

/// Columns by the longest way from a source, rows in rank order.
fn layout(graph: &GraphInfo) -> Vec<Place> {
    let mut column = vec![0; graph.operators.len()];
    for edge in edges(graph).iter().filter(|edge| !edge.feedback) {
        // Edges come in rank order of their readers, so the writer's column is final.
        column[edge.to] = column[edge.to].max(column[edge.from] + 1);
    }
    let mut next_y = vec![MARGIN; column.iter().max().map_or(0, |last| last + 1)];
    let place = |(operator, column): (&OperatorInfo, usize)| {
        let height = LINE * (box_lines(operator).len() + 1) + 14;
        let y = next_y[column];
        next_y[column] += height + GAP_Y;
        Place { x: MARGIN + column * (WIDTH + GAP_X), y, height }
    };
    graph.operators.iter().zip(column).map(place).collect()
}

struct EdgeInfo<'a> {
    from: usize,
    to: usize,
    stream: &'a str,
    feedback: bool,
    joined: bool,
    /// Which of its reader's inputs it is, feedback left out.
    nth: usize,
}

struct Place {
    x: usize,
    y: usize,
    height: usize,
}

/// What is worth saying of it beside its ports.
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
    facts.extend(operator.heavy.then(|| "heavy".into()));
    facts
}

/// What the picture says in its box, below its name: timers and facts, without what is the default.
fn box_lines(operator: &OperatorInfo) -> Vec<String> {
    box_facts(operator)
        .iter()
        .flat_map(|fact| wrapped(&in_short(fact), (WIDTH - 2 * INSET) as f64, 11.0))
        .collect()
}

fn box_facts(operator: &OperatorInfo) -> Vec<String> {
    let timers = operator.inputs.iter().filter(|input| input.stream.is_none()).map(input_text);
    let facts =
        facts(operator).into_iter().filter(|fact| fact != "skip_to_latest" && fact != "run time zero");
    timers.chain(facts).collect()
}

/// A fact as the box has it: of percentiles the middle and the last one.
fn in_short(fact: &str) -> String {
    let Some(points) = fact.strip_prefix("run time percentiles p") else { return fact.to_owned() };
    let points: Vec<&str> = points.split(" p").collect();
    let is_middle = |point: &&&str| point.split(' ').next().and_then(|p| p.parse().ok()) >= Some(50.0);
    let mut shown: Vec<&str> =
        points.iter().find(is_middle).into_iter().chain(points.last()).copied().collect();
    shown.dedup();
    format!("run time p{}", shown.join(", p"))
}

/// How an input reads, and what.
fn input_text(input: &InputInfo) -> String {
    let stream = input.stream.as_deref().unwrap_or_default();
    match input.kind {
        InputKind::At => format!("at {stream}"),
        InputKind::Latest { depth, feedback } => {
            let kind = if depth > 1 { format!("newest {depth} of") } else { "latest".into() };
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

fn operator_box(operator: &OperatorInfo, place: &Place) -> String {
    let Place { x, y, height } = *place;
    let fill = if operator.feed || operator.origin { "#e8f3ec" } else { "#eef2f8" };
    // Bold letters are wider than others, by less than a fifth.
    let name = cut(&operator.name, (WIDTH - 2 * INSET) as f64, 13.0 * 1.2);
    let all = box_facts(operator).iter().fold(operator.name.clone(), |all, fact| format!("{all}\n{fact}"));
    let mut out = format!(
        "<g><title>{}</title>\n\
         <rect x=\"{x}\" y=\"{y}\" width=\"{WIDTH}\" height=\"{height}\" rx=\"5\" fill=\"{fill}\" stroke=\"#44546a\"/>\n\
         <text x=\"{}\" y=\"{}\" font-size=\"13\" font-weight=\"bold\">{}</text>\n",
        escape(&all),
        x + INSET,
        y + 18,
        escape(&name)
    );
    for (i, line) in box_lines(operator).iter().enumerate() {
        let _ = writeln!(
            out,
            "<text x=\"{}\" y=\"{}\" fill=\"#444\">{}</text>",
            x + INSET,
            y + 18 + LINE * (i + 1),
            escape(line)
        );
    }
    out + "</g>\n"
}

/// Width of a text in pixels, at least what any common sans-serif font makes of it.
fn text_width(text: &str, size: f64) -> f64 {
    let ems = text.chars().map(|c| match c {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' | ' ' | '\u{a0}' => 0.38,
        '(' | ')' | '[' | ']' | 'f' | 'r' | 't' | '-' => 0.45,
        'm' | 'w' | 'M' | 'W' | '@' | '%' | '…' | '&' => 1.02,
        'A'..='Z' => 0.8,
        c if c.is_ascii() => 0.66,
        _ => 1.1,
    });
    size * ems.sum::<f64>()
}

/// As much of a text as is that wide, with an ellipsis where it is not all of it.
fn cut(text: &str, width: f64, size: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_owned();
    }
    let mut short = String::new();
    for c in text.chars() {
        if text_width(&format!("{short}{c}…"), size) > width {
            break;
        }
        short.push(c);
    }
    short + "…"
}

/// A text in lines of that width, broken between words, the last one cut.
fn wrapped(text: &str, width: f64, size: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    // A number stays with its unit.
    for word in text.replace(" ms", "\u{a0}ms").split(' ') {
        let is_last = lines.len() == WRAPPED_MAX;
        match lines.last_mut() {
            Some(line) if is_last || text_width(&format!("{line} {word}"), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.iter().map(|line| cut(line, width, size)).collect()
}

fn edge_path(edge: &EdgeInfo<'_>, boxes: &[Place], lane: usize) -> String {
    let (from, to) = (&boxes[edge.from], &boxes[edge.to]);
    let title = escape(edge.stream);
    let (x0, y0) = (from.x + WIDTH, from.y + from.height / 2);
    if edge.feedback {
        let (y0, x1, y1) = (from.y + from.height, to.x + WIDTH / 2, to.y + to.height);
        let x0 = from.x + WIDTH / 2;
        return format!(
            "<path d=\"M{x0},{y0} V{lane} H{x1} V{y1}\" fill=\"none\" stroke=\"#b04a2f\" stroke-dasharray=\"5 4\" \
             marker-end=\"url(#tip)\"><title>{title}</title></path>\n\
             <text x=\"{}\" y=\"{}\" fill=\"#b04a2f\">{title}</text>\n",
            x0.min(x1) + 8,
            lane - 3,
        );
    }
    let (x1, y1) = (to.x, to.y + (14 + 9 * edge.nth).min(to.height - 6));
    let bend = (x1.saturating_sub(x0) / 2).clamp(30, 120);
    let colour = if edge.joined { "#2b3a55" } else { "#9aa3b2" };
    format!(
        "<path d=\"M{x0},{y0} C{},{y0} {},{y1} {x1},{y1}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.4\" \
         marker-end=\"url(#tip)\"><title>{title}</title></path>\n",
        x0 + bend,
        x1 - bend.min(x1),
    )
}

fn quoted(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"")
}

#[cfg(test)]
mod tests {
    use swerve_flow::{
        At, Context, Deadline, Every, Graph, Latest, Operator, Policy, Port, Reaction, RuntimeModel, Stream,
        Timer, every,
    };

    use super::*;

    struct Any;
    impl Operator for Any {
        type In = (Vec<Every>, Vec<At<Vec<f64>>>, Vec<Latest<Vec<f64>>>);
        type Out = Port<Vec<f64>>;
        fn step(&mut self, _: &mut Context<'_>, _: &Self::In, _: &mut Self::Out) {}
    }

    fn loop_of_three() -> GraphInfo {
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
      <- every 50.000 ms from 5.000 ms
      <- latest control (feedback)
      -> world: Vec<f64>
  1 detector \"a\" & <b>  [run time fixed 80.000 ms; queue(2); deadline 100.000 ms from arrival, then reuse_last; uses gpu0]
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

    #[test]
    fn svg_has_a_box_per_operator_and_a_path_per_edge() {
        let svg = svg(&loop_of_three());
        assert_eq!(svg.matches("<rect ").count(), 1 + 3);
        assert_eq!(svg.matches("marker-end").count(), 4);
        assert_eq!(svg.matches("stroke-dasharray").count(), 1);
        assert!(svg.contains("detector &quot;a&quot; &amp; &lt;b&gt;"));
    }

    #[test]
    fn texts_stay_within_their_boxes() {
        let mut graph = Graph::new();
        let times = (0..=10).map(|k| (f64::from(k) * 10.0, Span::from_us(1234 * i64::from(k)))).collect();
        let none: Vec<Stream<Vec<f64>>> = vec![];
        let name = "a_name_of_wwwwwwwwwwwwwwww_that_no_box_can_hold";
        let timer = vec![every(Span::from_ms(50))];
        let _ =
            graph.add(name, Any, (timer, none.clone(), none)).runtime(RuntimeModel::Percentiles(times)).out();
        let info = graph.describe().unwrap();
        let svg = svg(&info);
        let texts: Vec<(f64, &str)> = svg
            .lines()
            .filter(|line| line.starts_with("<text "))
            .map(|line| {
                let size = if line.contains("bold") { 13.0 } else { 11.0 };
                (size, line.split('>').nth(1).unwrap().split('<').next().unwrap())
            })
            .collect();
        for (size, line) in &texts {
            assert!(text_width(line, *size) <= (WIDTH - 2 * INSET) as f64, "{line}");
        }
        assert!(texts[0].1.ends_with('…'), "{texts:?}");
        let facts: String =
            texts[2..].iter().map(|(_, line)| format!("{line} ").replace('\u{a0}', " ")).collect();
        assert_eq!(facts, "run time p50 6.170 ms, p100 12.340 ms ");
        // What the box has no room for is told by pointing at it.
        assert!(
            svg.contains(&format!("<title>{name}\n")) && svg.contains("p90 11.106 ms p100 12.340 ms"),
            "{svg}"
        );
        let long = wrapped(&"word ".repeat(100), 100.0, 11.0);
        assert!(long.len() == WRAPPED_MAX && long[WRAPPED_MAX - 1].ends_with('…'), "{long:?}");
    }
}
