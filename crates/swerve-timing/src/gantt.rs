//! The chart of `swerve timing --svg`: a row for each operator, a bar for each step, marks for what came of it.

use core::fmt::Write as _;

use swerve_core::{Span, Time};
use swerve_report::canvas::{escape, round_step};

use super::pipeline::Pipeline;
use super::table::ms;
use super::trace::{Step, Trace};

const LANE_PX: f64 = 22.0;
const BAR_PX: f64 = 15.0;
/// Below the bars of a row: a line of publications, and one of misses and drops.
const FOOT_PX: f64 = 18.0;
const TOP_PX: f64 = 58.0;
const PLOT_PX_MIN: f64 = 1000.0;
const PLOT_PX_MAX: f64 = 12_000.0;
const LEFT_PX_MIN: f64 = 110.0;
/// Bars are at least this wide on average, as far as the chart may grow.
const STEP_PX: f64 = 40.0;
/// More steps than this do not fit into one chart: it shows the first part of the run.
const STEPS_MAX: usize = 3000;
/// Ticks of the axis stand about this far apart.
const TICK_PX: f64 = 80.0;
/// An approximation for the sans-serif faces of browsers at 11 px; labels only need not to collide.
const GLYPH_PX: f64 = 6.4;

/// Fills that stay apart from each other, and dark text readable on them.
const FILLS: [&str; 8] =
    ["#8fbbe0", "#f5c078", "#a5d39a", "#e8a2a0", "#c3b1e0", "#9fd6d2", "#e6b8d6", "#d8cf8a"];

/// The chart of a run as SVG text.
pub(crate) fn svg(pipeline: &Pipeline, trace: &Trace) -> String {
    let chart = Chart::new(pipeline, trace);
    let mut svg = chart.head();
    chart.axis(&mut svg);
    chart.rows(&mut svg);
    for (step, lane) in trace.steps.iter().zip(&chart.lanes).filter(|(step, _)| step.start <= chart.until) {
        chart.bar(&mut svg, step, *lane);
    }
    chart.marks(&mut svg);
    chart.legend(&mut svg);
    svg.push_str("</svg>\n");
    svg
}

struct Chart<'a> {
    pipeline: &'a Pipeline,
    trace: &'a Trace,
    /// Per step, in the order of the trace, which of its operator's lanes it lies in.
    lanes: Vec<usize>,
    /// Per operator, the top of its row.
    tops: Vec<f64>,
    bottom_px: f64,
    left_px: f64,
    plot_px: f64,
    px_per_ms: f64,
    /// The end of what is shown.
    until: Time,
}

impl<'a> Chart<'a> {
    fn new(pipeline: &'a Pipeline, trace: &'a Trace) -> Self {
        let (lanes, depth) = lanes(pipeline, trace);
        let mut tops = Vec::new();
        let mut y = TOP_PX;
        for depth in depth {
            tops.push(y);
            y += LANE_PX * depth as f64 + FOOT_PX;
        }
        let longest = |text: usize| text as f64 * GLYPH_PX + 24.0;
        let left_px = pipeline
            .operators
            .iter()
            .map(|op| longest(op.name.chars().count().max(note(pipeline, op).chars().count())));
        let end = Time::ZERO + pipeline.span;
        let until = trace.steps.get(STEPS_MAX).map_or(end, |step| step.start.max(Time::from_ns(1)));
        let takes_time = |step: &&Step| step.end.is_none_or(|end| end > step.start);
        let shown = trace.steps.iter().filter(takes_time).filter(|step| step.start <= until);
        let busiest = (0..pipeline.operators.len())
            .map(|i| shown.clone().filter(|step| step.operator == i).count())
            .max()
            .unwrap_or(0);
        let plot_px = (busiest as f64 * STEP_PX).clamp(PLOT_PX_MIN, PLOT_PX_MAX);
        Self {
            pipeline,
            trace,
            lanes,
            tops,
            bottom_px: y,
            left_px: left_px.fold(LEFT_PX_MIN, f64::max),
            plot_px,
            px_per_ms: plot_px / (until - Time::ZERO).as_ms(),
            until,
        }
    }

    fn x(&self, at: Time) -> f64 {
        self.left_px + (at - Time::ZERO).as_ms() * self.px_per_ms
    }

    fn head(&self) -> String {
        let (width, height) = (self.left_px + self.plot_px + 30.0, self.bottom_px + 62.0);
        let all = Time::ZERO + self.pipeline.span;
        let part = if self.until < all {
            format!("the first {} of ", ms(self.until - Time::ZERO))
        } else {
            String::new()
        };
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"11\" fill=\"#222\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <text x=\"12\" y=\"20\" font-size=\"14\" font-weight=\"bold\">Timing over {part}{} ms</text>\n\
             <text x=\"12\" y=\"36\" fill=\"#666\">bars: steps, labelled by stamp in ms</text>\n",
            ms(self.pipeline.span)
        )
    }

    fn axis(&self, svg: &mut String) {
        let step = round_step(TICK_PX / self.px_per_ms, 1.0);
        let ticks = ((self.until - Time::ZERO).as_ms() / step).floor() as usize;
        for tick in 0..=ticks {
            let at_ms = tick as f64 * step;
            let x = self.left_px + at_ms * self.px_per_ms;
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {top:.1}V{bottom:.1}\" stroke=\"#ddd\"/>\
                 <text x=\"{x:.1}\" y=\"{label:.1}\" text-anchor=\"middle\" fill=\"#444\">{text}</text>",
                top = TOP_PX - 6.0,
                bottom = self.bottom_px,
                label = self.bottom_px + 14.0,
                text = ms(Span::from_ns((at_ms * 1e6).round() as i64)),
            );
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"#444\">ms</text>",
            self.left_px - 24.0,
            self.bottom_px + 14.0
        );
    }

    fn rows(&self, svg: &mut String) {
        for (i, op) in self.pipeline.operators.iter().enumerate() {
            let top = self.tops[i];
            let bottom = self.tops.get(i + 1).copied().unwrap_or(self.bottom_px) - 4.0;
            let _ = writeln!(
                svg,
                "<path d=\"M8 {line:.1}H{right:.1}\" stroke=\"#ccc\"/>\
                 <text x=\"12\" y=\"{name:.1}\" font-weight=\"bold\">{}</text>",
                escape(&op.name),
                line = bottom,
                right = self.left_px + self.plot_px,
                name = top + 9.0,
            );
            let note = note(self.pipeline, op);
            let _ = writeln!(
                svg,
                "<text x=\"12\" y=\"{:.1}\" font-size=\"9\" fill=\"#666\">{}</text>",
                top + 20.0,
                escape(&note)
            );
        }
    }

    fn bar(&self, svg: &mut String, step: &Step, lane: usize) {
        let end = step.end.map_or(self.until, |end| end.min(self.until));
        let (x, y) = (self.x(step.start), self.tops[step.operator] + LANE_PX * lane as f64);
        let width = (self.x(end) - x).max(1.5);
        let fill = FILLS[step.operator % FILLS.len()];
        let (opacity, dash) = match step {
            Step { late: true, .. } => ("0.35", " stroke-dasharray=\"3 2\""),
            Step { end: None, .. } => ("0.6", " stroke-dasharray=\"1 2\""),
            _ => ("1", ""),
        };
        let label = ms(step.stamp - Time::ZERO);
        let _ = write!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{BAR_PX}\" rx=\"2\" fill=\"{fill}\" \
             fill-opacity=\"{opacity}\" stroke=\"#555\" stroke-width=\"0.7\"{dash}>\
             <title>{} for {label} ms: {} to {} ms</title></rect>",
            escape(&self.pipeline.operators[step.operator].name),
            ms(step.start - Time::ZERO),
            step.end.map_or_else(|| "after the end".to_owned(), |end| ms(end - Time::ZERO)),
        );
        if width > label.chars().count() as f64 * GLYPH_PX + 4.0 {
            let _ = write!(svg, "<text x=\"{:.1}\" y=\"{:.1}\">{label}</text>", x + 3.0, y + 11.5);
        }
        svg.push('\n');
    }

    /// Publications, and below them misses and drops, stand on the lower edge of their row.
    fn marks(&self, svg: &mut String) {
        let foot = |operator: usize| self.tops.get(operator + 1).copied().unwrap_or(self.bottom_px) - 9.5;
        for p in self.trace.publications.iter().filter(|p| p.stamp.is_some() && p.visible_at <= self.until) {
            published(svg, self.x(p.visible_at), foot(p.operator) - 9.0, p.reused_from.is_some());
        }
        for mark in self.trace.drops.iter().filter(|mark| mark.at <= self.until) {
            dropped(svg, self.x(mark.at), foot(mark.operator));
        }
        for mark in self.trace.misses.iter().filter(|mark| mark.at <= self.until) {
            missed(svg, self.x(mark.at), foot(mark.operator));
        }
    }

    fn legend(&self, svg: &mut String) {
        let y = self.bottom_px + 42.0;
        let mut x = 18.0;
        type Draw = fn(&mut String, f64, f64);
        let entries: [(Draw, &str); 6] = [
            (|svg, x, y| published(svg, x, y, false), "published"),
            (|svg, x, y| published(svg, x, y, true), "published again (reuse_last)"),
            (missed, "deadline missed"),
            (dropped, "dropped"),
            (|svg, x, y| swatch(svg, x, y, "0.35", "3 2"), "ended too late, not published"),
            (|svg, x, y| swatch(svg, x, y, "0.6", "1 2"), "under way at the end"),
        ];
        for (draw, text) in entries {
            draw(svg, x, y);
            let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{:.1}\">{text}</text>", x + 12.0, y + 4.0);
            x += 40.0 + text.chars().count() as f64 * GLYPH_PX;
        }
    }
}

fn published(svg: &mut String, x: f64, y: f64, again: bool) {
    let fill = if again { "#fff" } else { "#1b6e2d" };
    let _ = writeln!(svg, "<path d=\"M{x:.1} {:.1}l4 7h-8z\" fill=\"{fill}\" stroke=\"#1b6e2d\"/>", y - 4.0);
}

fn missed(svg: &mut String, x: f64, y: f64) {
    let _ = writeln!(
        svg,
        "<path d=\"M{:.1} {:.1}l7 7m0 -7l-7 7\" stroke=\"#c01818\" stroke-width=\"2\" fill=\"none\"/>",
        x - 3.5,
        y - 3.5
    );
}

fn dropped(svg: &mut String, x: f64, y: f64) {
    let _ = writeln!(
        svg,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"#fff\" stroke=\"#777\" stroke-width=\"1.4\"/>"
    );
}

fn swatch(svg: &mut String, x: f64, y: f64, opacity: &str, dash: &str) {
    let _ = writeln!(
        svg,
        "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"16\" height=\"11\" rx=\"2\" fill=\"{}\" fill-opacity=\"{opacity}\" \
         stroke=\"#555\" stroke-width=\"0.7\" stroke-dasharray=\"{dash}\"/>",
        x - 8.0,
        y - 5.5,
        FILLS[0]
    );
}

/// Which lane of its operator's row each step lies in, the first that is free; and how many lanes each row has.
fn lanes(pipeline: &Pipeline, trace: &Trace) -> (Vec<usize>, Vec<usize>) {
    let mut ends: Vec<Vec<Time>> = vec![Vec::new(); pipeline.operators.len()];
    let mut place = |step: &Step| {
        let row = &mut ends[step.operator];
        let lane = row.iter().position(|end| *end <= step.start).unwrap_or(row.len());
        row.resize(row.len().max(lane + 1), Time::ZERO);
        row[lane] = step.end.unwrap_or(Time::MAX);
        lane
    };
    let lanes = trace.steps.iter().map(&mut place).collect();
    (lanes, ends.iter().map(|row| row.len().max(1)).collect())
}

/// What a row says below its name: policy, and resource if it has one.
fn note(pipeline: &Pipeline, op: &super::BlackBox) -> String {
    match op.uses {
        Some(r) => format!("{} on {}", op.policy, pipeline.resources[r].name),
        None => op.policy.to_string(),
    }
}
