//! Picture of an operator graph.

use std::collections::BTreeMap;

use swerve_draw::{Anchor, At, Canvas, Color, Picture, Sign, Step, Style, Text, color, legend, width_of};
use swerve_flow::{GraphInfo, OperatorInfo};

use super::{EdgeInfo, edges, facts, input_text};

/// Box width, line height, gaps and margin, pixels.
const WIDTH: f64 = 210.0;
const LINE: f64 = 15.0;
const GAP_X: f64 = 110.0;
const GAP_Y: f64 = 26.0;
const MARGIN: f64 = 24.0;
/// Space between a box and its text, pixels.
const INSET: f64 = 10.0;
/// Distance between feedback lines below the boxes, pixels.
const LANE: f64 = 18.0;
/// Distance between the line ends at a box, each labelled with its stream, pixels.
const ENTRY: f64 = 12.0;
/// Distance between lines that pass a column through the same gap, pixels.
const BESIDE: f64 = 5.0;
/// Maximum number of lines per fact.
const WRAPPED_MAX: usize = 3;

const NAME: Text = Text { size: 13.0, bold: true, ..Text::PLAIN };
const FACT: Text = Text { size: 11.0, ..Text::SOFT };

const STREAM: Text = Text { size: 9.0, anchor: Anchor::End, rim: true, ..Text::SOFT };

const SYNCHRONISED: Style = Style::line(color::INK, 1.4);
const LATEST: Style = Style::line(color::ROAD_EDGE, 1.4);
const FEEDBACK: Style = Style::line(color::LEFT_ROAD, 1.4).dashed(5.0, 4.0);

/// Draws operators as boxes, from the sources on the left to the sinks on the right. Synchronised inputs are dark
/// lines, latest ones grey lines, feedback dashed lines below.
pub fn draw(graph: &GraphInfo) -> Picture {
    let boxes = layout(graph);
    let mut canvas = Canvas::default();
    let edges = edges(graph);
    let ways = ways(&edges, &boxes);
    let passed = ways.iter().flatten().map(|(_, y)| *y);
    let below = boxes.iter().map(|b| b.y + b.height).chain(passed).fold(0.0, f64::max);
    let mut lane = below + 12.0;
    for (edge, way) in edges.iter().zip(&ways) {
        edge_line(&mut canvas, edge, &boxes, (lane, way));
        lane += if edge.feedback { LANE } else { 0.0 };
    }
    for (operator, place) in graph.operators.iter().zip(&boxes) {
        operator_box(&mut canvas, operator, place);
    }
    // Drawn last, so that no line crosses a name.
    for edge in edges.iter().filter(|edge| !edge.feedback) {
        let (x, y) = entry(edge, &boxes[edge.to]);
        canvas.text((x - 10.0, y - 2.0), &cut(edge.stream, GAP_X - 24.0, STREAM), STREAM);
    }
    let right = boxes.iter().map(|b| b.x + WIDTH).fold(0.0, f64::max);
    let entries = [
        (Sign::Line(SYNCHRONISED), "the message of this very stamp"),
        (Sign::Line(LATEST), "the latest message"),
        (Sign::Line(FEEDBACK), "feedback"),
        (Sign::Block(Style::fill(fill(true)).outlined(color::SOFT, 1.0)), "source or sensor"),
    ];
    let entries = entries.map(|(sign, text)| (sign, text.to_owned()));
    let last = legend(&mut canvas, (MARGIN, lane + LANE), right.max(600.0), &entries);
    canvas.finish(right.max(600.0) + MARGIN, last + MARGIN, "dataflow")
}

/// Columns by the longest path from a source, rows in rank order.
fn layout(graph: &GraphInfo) -> Vec<NodeBox> {
    let mut column = vec![0; graph.operators.len()];
    for edge in edges(graph).iter().filter(|edge| !edge.feedback) {
        // Edges are sorted by the rank of the reader, so the writer's column is final.
        column[edge.to] = column[edge.to].max(column[edge.from] + 1);
    }
    let mut next_y = vec![MARGIN; column.iter().max().map_or(0, |last| last + 1)];
    let place = |(operator, column): (&OperatorInfo, usize)| {
        let entries = operator.inputs.iter().filter(|input| input.stream.is_some()).count();
        let height = LINE * (box_lines(operator).len() + 1) as f64 + 14.0;
        let height = height.max(ENTRY * entries as f64 + 14.0);
        let y = next_y[column];
        next_y[column] += height + GAP_Y;
        NodeBox { x: MARGIN + column as f64 * (WIDTH + GAP_X), y, height, column }
    };
    graph.operators.iter().zip(column).map(place).collect()
}

struct NodeBox {
    x: f64,
    y: f64,
    height: f64,
    column: usize,
}

/// End point of a line at its reader.
fn entry(edge: &EdgeInfo<'_>, to: &NodeBox) -> At {
    (to.x, to.y + (14.0 + ENTRY * edge.nth as f64).min(to.height - 6.0))
}

/// Points at which each edge passes the columns between its ends: through the gap between boxes nearest to the straight
/// line, so that it is never hidden behind a box.
fn ways(edges: &[EdgeInfo<'_>], boxes: &[NodeBox]) -> Vec<Vec<At>> {
    // Number of lines through each gap so far, by column and centre height of the gap.
    let mut passing: BTreeMap<(usize, i64), usize> = BTreeMap::new();
    let mut way = |edge: &EdgeInfo<'_>| {
        let (from, to) = (&boxes[edge.from], &boxes[edge.to]);
        let (start, end) = (from.y + 0.5 * from.height, entry(edge, to).1);
        let columns = if edge.feedback { 0..0 } else { from.column + 1..to.column };
        let pass = |column: usize| {
            let share = (column - from.column) as f64 / (to.column - from.column) as f64;
            let middle = nearest_gap(boxes, column, start + share * (end - start));
            let before = passing.entry((column, middle.round() as i64)).or_default();
            let aside =
                BESIDE * before.div_ceil(2) as f64 * if before.is_multiple_of(2) { 1.0 } else { -1.0 };
            *before += 1;
            (MARGIN + column as f64 * (WIDTH + GAP_X), middle + aside)
        };
        columns.map(pass).collect()
    };
    edges.iter().map(&mut way).collect()
}

/// Centre of the column gap nearest to a height: above, between or below the boxes.
fn nearest_gap(boxes: &[NodeBox], column: usize, wanted: f64) -> f64 {
    let own: Vec<&NodeBox> = boxes.iter().filter(|place| place.column == column).collect();
    let above = own.first().map(|first| wanted.min(first.y - 0.5 * MARGIN));
    let between = own.windows(2).map(|pair| 0.5 * (pair[0].y + pair[0].height + pair[1].y));
    let below = own.last().map(|last| wanted.max(last.y + last.height + 0.5 * GAP_Y));
    let gaps = above.into_iter().chain(between).chain(below);
    gaps.min_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs())).unwrap_or(wanted)
}

/// Lines in an operator's box below its name: timers and non-default facts.
fn box_lines(operator: &OperatorInfo) -> Vec<String> {
    box_facts(operator).iter().flat_map(|fact| wrapped(&in_short(fact), WIDTH - 2.0 * INSET, FACT)).collect()
}

fn box_facts(operator: &OperatorInfo) -> Vec<String> {
    let timers = operator.inputs.iter().filter(|input| input.stream.is_none()).map(input_text);
    let facts =
        facts(operator).into_iter().filter(|fact| fact != "skip_to_latest" && fact != "run time zero");
    timers.chain(facts).collect()
}

/// Shortens a fact for the box: of percentiles only the middle and the last one are kept.
fn in_short(fact: &str) -> String {
    let Some(points) = fact.strip_prefix("run time percentiles p") else { return fact.to_owned() };
    let points: Vec<&str> = points.split(" p").collect();
    let is_middle = |point: &&&str| point.split(' ').next().and_then(|p| p.parse().ok()) >= Some(50.0);
    let mut shown: Vec<&str> =
        points.iter().find(is_middle).into_iter().chain(points.last()).copied().collect();
    shown.dedup();
    format!("run time p{}", shown.join(", p"))
}

/// Fill colour: sources and sensors differ from other operators.
fn fill(is_source: bool) -> Color {
    color::PAPER.mixed(if is_source { color::PLAN } else { color::EGO }, 0.1)
}

fn operator_box(canvas: &mut Canvas, operator: &OperatorInfo, place: &NodeBox) {
    let NodeBox { x, y, height, .. } = *place;
    let all = box_facts(operator).iter().fold(operator.name.clone(), |all, fact| format!("{all}\n{fact}"));
    canvas.begin_titled(&all);
    let style = Style::fill(fill(operator.feed || operator.origin)).outlined(color::SOFT, 1.0).rounded(5.0);
    canvas.rect((x, y), (WIDTH, height), style);
    canvas.text((x + INSET, y + 18.0), &cut(&operator.name, WIDTH - 2.0 * INSET, NAME), NAME);
    for (i, line) in box_lines(operator).iter().enumerate() {
        canvas.text((x + INSET, y + 18.0 + LINE * (i + 1) as f64), line, FACT);
    }
    canvas.end_titled();
}

/// Text cut to a width, with an ellipsis if shortened.
fn cut(text: &str, width: f64, how: Text) -> String {
    if width_of(text, how) <= width {
        return text.to_owned();
    }
    let mut short = String::new();
    for c in text.chars() {
        if width_of(&format!("{short}{c}…"), how) > width {
            break;
        }
        short.push(c);
    }
    short + "…"
}

/// Text wrapped between words to a width; the last line is cut.
fn wrapped(text: &str, width: f64, how: Text) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    // A number stays on the same line as its unit.
    for word in text.replace(" ms", "\u{a0}ms").split(' ') {
        let is_last = lines.len() == WRAPPED_MAX;
        match lines.last_mut() {
            Some(line) if is_last || width_of(&format!("{line} {word}"), how) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.iter().map(|line| cut(line, width, how)).collect()
}

fn edge_line(canvas: &mut Canvas, edge: &EdgeInfo<'_>, boxes: &[NodeBox], (lane, way): (f64, &[At])) {
    let (from, to) = (&boxes[edge.from], &boxes[edge.to]);
    let tip = |style: Style| Style::fill(style.color().unwrap_or(color::INK));
    canvas.begin_titled(edge.stream);
    if edge.feedback {
        let ((x0, y0), (x1, y1)) =
            ((from.x + 0.5 * WIDTH, from.y + from.height), (to.x + 0.5 * WIDTH, to.y + to.height));
        canvas.path([(x0, y0), (x0, lane), (x1, lane), (x1, y1)], false, FEEDBACK);
        canvas.arrow_head((x1, y1), -core::f64::consts::FRAC_PI_2, tip(FEEDBACK));
        let how = Text { color: color::LEFT_ROAD, ..FACT };
        canvas.text((x0.min(x1) + 8.0, lane - 3.0), edge.stream, how);
    } else {
        let style = if edge.joined { SYNCHRONISED } else { LATEST };
        let mut at = (from.x + WIDTH, from.y + 0.5 * from.height);
        let end = entry(edge, to);
        let curve = |(x0, y0): At, (x1, y1): At| {
            let bend = (0.5 * (x1 - x0)).clamp(30.0, 120.0);
            Step::Curve((x0 + bend, y0), (x1 - bend, y1), (x1, y1))
        };
        let mut steps = vec![Step::Move(at)];
        for &(x, y) in way {
            steps.extend([curve(at, (x, y)), Step::Line((x + WIDTH, y))]);
            at = (x + WIDTH, y);
        }
        steps.push(curve(at, end));
        canvas.outline(steps, style);
        canvas.arrow_head(end, 0.0, tip(style));
    }
    canvas.end_titled();
}

#[cfg(test)]
mod tests {
    use swerve_core::Span;
    use swerve_flow::{Graph, RuntimeModel, Stream, every};

    use super::super::tests::{Any, loop_of_three};
    use super::*;

    #[test]
    fn svg_has_a_box_per_operator_and_a_path_per_edge() {
        let svg = draw(&loop_of_three()).svg();
        assert_eq!(svg.matches("<rect ").count(), 1 + 3 + 1, "the sheet, and one in the legend");
        assert_eq!(svg.matches("Z\"").count(), 4, "a head for each arrow");
        assert_eq!(svg.matches("stroke-dasharray").count(), 1 + 1);
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
        let picture = draw(&info);
        let texts: Vec<&str> = picture.texts().collect();
        for (k, line) in texts[..4].iter().enumerate() {
            let how = if k == 0 { NAME } else { FACT };
            assert!(width_of(line, how) <= WIDTH - 2.0 * INSET, "{line}");
        }
        assert!(texts[0].ends_with('…'), "{texts:?}");
        let facts: String =
            texts[2..4].iter().map(|line| format!("{line} ").replace('\u{a0}', " ")).collect();
        assert_eq!(facts, "run time p50 6.17 ms, p100 12.34 ms ");
        let svg = picture.svg();
        // A tooltip holds the text for which the box has no room.
        assert!(
            svg.contains(&format!("<title>{name}\n")) && svg.contains("p90 11.106 ms p100 12.34 ms"),
            "{svg}"
        );
        let long = wrapped(&"word ".repeat(100), 100.0, FACT);
        assert!(long.len() == WRAPPED_MAX && long[WRAPPED_MAX - 1].ends_with('…'), "{long:?}");
    }
}
