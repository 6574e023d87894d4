//! Text output of `swerve timing`: response times, activity of every operator, and utilisation.

use core::fmt::Write as _;

use swerve_core::Span;

use super::pipeline::Pipeline;
use super::tally::Tally;

/// Formats the report of a run as aligned text.
pub(crate) fn table(pipeline: &Pipeline, tally: &Tally<'_>) -> String {
    let mut text = format!("span {} ms, {} operators\n", ms(pipeline.span), pipeline.operators.len());
    for (title, rows) in tables(pipeline, tally) {
        let _ = write!(text, "\n{title}\n{}", aligned(&rows));
    }
    text
}

/// Tables that have rows, each with its title and header.
pub(crate) fn tables(pipeline: &Pipeline, tally: &Tally<'_>) -> Vec<(&'static str, Vec<Row>)> {
    let all = [
        (
            "Response times: result minus the stamp of the newest sensor frame it derives from",
            responses(pipeline, tally),
        ),
        ("Operators", operators(pipeline, tally)),
        ("Resources", resources(pipeline, tally)),
    ];
    all.into_iter().filter(|(_, rows)| rows.len() > 1).collect()
}

pub(crate) type Row = Vec<String>;

fn row<const N: usize>(cells: [&str; N]) -> Row {
    cells.map(str::to_owned).to_vec()
}

fn responses(pipeline: &Pipeline, tally: &Tally<'_>) -> Vec<Row> {
    let mut rows = vec![row(["result", "messages", "p50 ms", "p99 ms", "max ms"])];
    for (i, op) in pipeline.operators.iter().enumerate().filter(|(i, _)| pipeline.is_sink(*i)) {
        let times = sorted(&tally.operators[i].responses);
        rows.push(vec![
            op.name.clone(),
            times.len().to_string(),
            percentile(&times, 50),
            percentile(&times, 99),
            percentile(&times, 100),
        ]);
    }
    rows
}

fn operators(pipeline: &Pipeline, tally: &Tally<'_>) -> Vec<Row> {
    let head =
        ["operator", "steps", "messages", "repeats", "misses", "drops", "run p50 ms", "p99 ms", "busy"];
    let mut rows = vec![row(head)];
    for (op, did) in pipeline.operators.iter().zip(&tally.operators) {
        let times = sorted(&did.run_times);
        let mut row = vec![op.name.clone()];
        row.extend([did.steps, did.messages, did.repeats, did.misses, did.drops].map(|n| n.to_string()));
        row.extend([percentile(&times, 50), percentile(&times, 99)]);
        row.push(share(did.busy, pipeline.span, op.policy.places()));
        rows.push(row);
    }
    rows
}

fn resources(pipeline: &Pipeline, tally: &Tally<'_>) -> Vec<Row> {
    let mut rows = vec![row(["resource", "slots", "busy", "used by"])];
    for (r, resource) in pipeline.resources.iter().enumerate() {
        let users: Vec<usize> =
            (0..pipeline.operators.len()).filter(|&i| pipeline.operators[i].uses == Some(r)).collect();
        let busy = users.iter().fold(Span::ZERO, |sum, &i| sum + tally.operators[i].busy);
        let names: Vec<&str> = users.iter().map(|&i| pipeline.operators[i].name.as_str()).collect();
        rows.push(vec![
            resource.name.clone(),
            resource.slots.to_string(),
            share(busy, pipeline.span, resource.slots),
            names.join(", "),
        ]);
    }
    rows
}

fn sorted(spans: &[Span]) -> Vec<Span> {
    let mut spans = spans.to_vec();
    spans.sort_unstable();
    spans
}

/// Percentile of `sorted` by nearest rank, in ms; `-` if there are no values.
fn percentile(sorted: &[Span], percent: usize) -> String {
    let rank = (sorted.len() * percent).div_ceil(100);
    sorted.get(rank.saturating_sub(1)).map_or_else(|| "-".to_owned(), |span| ms(*span))
}

pub(crate) fn ms(span: Span) -> String {
    let text = format!("{:.3}", span.as_ms());
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn share(busy: Span, span: Span, places: usize) -> String {
    format!("{:.1} %", 100.0 * busy.as_secs() / (span.as_secs() * places as f64))
}

/// Pads columns to their widest cell: text (the first column and `used by`) to the left, numbers to the right.
fn aligned(rows: &[Row]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| {
        rows.iter().filter_map(|row| row.get(c)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let is_text = |c: usize| c == 0 || rows[0][c] == "used by";
    let mut text = String::new();
    for row in rows {
        let cells: Vec<String> = (row.iter().enumerate())
            .map(|(c, cell)| {
                let fill = " ".repeat(widths[c] - cell.chars().count());
                if is_text(c) { format!("{cell}{fill}") } else { format!("{fill}{cell}") }
            })
            .collect();
        let _ = writeln!(text, "  {}", cells.join("  ").trim_end());
    }
    text
}
