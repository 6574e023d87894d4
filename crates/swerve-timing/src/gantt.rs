//! The chart of `swerve timing --picture`: a row for each operator, a bar for each step, marks for what came of it.

use swerve_core::{Span, Time};
use swerve_draw::color::{self, SERIES};
use swerve_draw::{
    Anchor, At, Canvas, Color, Entry, Picture, Sign, Style, Text, legend, multiples, round_step, width_of,
};

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
/// Tints of the palette that dark text can be read on.
fn fill_of(operator: usize) -> Color {
    SERIES[operator % 4].color.mixed(color::PAPER, 0.6)
}

/// What stands at a bar, at a mark and at the axis.
const LABEL: Text = Text { size: 11.0, ..Text::PLAIN };
const NOTE: Text = Text { size: 9.0, ..Text::SOFT };

/// The chart of a run.
pub(crate) fn draw(pipeline: &Pipeline, trace: &Trace) -> Picture {
    let chart = Chart::new(pipeline, trace);
    let mut canvas = Canvas::default();
    chart.axis(&mut canvas);
    chart.rows(&mut canvas);
    for (step, lane) in trace.steps.iter().zip(&chart.lanes).filter(|(step, _)| step.start <= chart.until) {
        chart.bar(&mut canvas, step, *lane);
    }
    chart.marks(&mut canvas);
    chart.legend(&mut canvas);
    chart.finish(canvas)
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
        let widest = |op: &super::BlackBox| {
            let note = width_of(&note(pipeline, op), NOTE);
            width_of(&op.name, Text { bold: true, ..LABEL }).max(note) + 24.0
        };
        let left_px = pipeline.operators.iter().map(widest);
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

    fn finish(&self, mut canvas: Canvas) -> Picture {
        let all = Time::ZERO + self.pipeline.span;
        let part = if self.until < all {
            format!("the first {} of ", ms(self.until - Time::ZERO))
        } else {
            String::new()
        };
        let title = format!("Timing over {part}{} ms", ms(self.pipeline.span));
        canvas.text((12.0, 20.0), &title, Text { size: 14.0, bold: true, ..LABEL });
        let soft = Text { color: color::SOFT, ..LABEL };
        canvas.text((12.0, 36.0), "bars: steps, labelled by stamp in ms where they are long enough; pointed at, each says its stamp, start and end", soft);
        canvas.finish(self.left_px + self.plot_px + 30.0, self.bottom_px + 62.0, &title)
    }

    fn axis(&self, canvas: &mut Canvas) {
        let step = round_step(TICK_PX / self.px_per_ms, 1.0);
        let (label_y, soft) = (self.bottom_px + 14.0, Text { color: color::SOFT, ..LABEL });
        for at_ms in multiples(0.0, (self.until - Time::ZERO).as_ms(), step) {
            let x = self.left_px + at_ms * self.px_per_ms;
            canvas.line((x, TOP_PX - 6.0), (x, self.bottom_px), GRID);
            let text = ms(Span::from_ns((at_ms * 1e6).round() as i64));
            canvas.text((x, label_y), &text, Text { anchor: Anchor::Middle, ..soft });
        }
        canvas.text((self.left_px - 24.0, label_y), "ms", soft);
    }

    fn rows(&self, canvas: &mut Canvas) {
        for (i, op) in self.pipeline.operators.iter().enumerate() {
            let top = self.tops[i];
            let bottom = self.tops.get(i + 1).copied().unwrap_or(self.bottom_px) - 4.0;
            canvas.line((8.0, bottom), (self.left_px + self.plot_px, bottom), GRID);
            canvas.text((12.0, top + 9.0), &op.name, Text { bold: true, ..LABEL });
            let note = note(self.pipeline, op);
            canvas.text((12.0, top + 20.0), &note, NOTE);
        }
    }

    fn bar(&self, canvas: &mut Canvas, step: &Step, lane: usize) {
        let end = step.end.map_or(self.until, |end| end.min(self.until));
        let (x, y) = (self.x(step.start), self.tops[step.operator] + LANE_PX * lane as f64);
        let width = (self.x(end) - x).max(1.5);
        let style = bar_style(
            fill_of(step.operator),
            match step {
                Step { late: true, .. } => LATE,
                Step { end: None, .. } => UNDER_WAY,
                _ => DONE,
            },
        );
        let label = ms(step.stamp - Time::ZERO);
        let title = format!(
            "{} for {label} ms: {} to {} ms",
            self.pipeline.operators[step.operator].name,
            ms(step.start - Time::ZERO),
            step.end.map_or_else(|| "after the end".to_owned(), |end| ms(end - Time::ZERO)),
        );
        canvas.begin_titled(&title);
        canvas.rect((x, y), (width, BAR_PX), style);
        canvas.end_titled();
        if width > width_of(&label, LABEL) + 4.0 {
            canvas.text((x + 3.0, y + 11.5), &label, LABEL);
        }
    }

    /// Publications, and below them misses and drops, stand on the lower edge of their row.
    fn marks(&self, canvas: &mut Canvas) {
        let foot = |operator: usize| self.tops.get(operator + 1).copied().unwrap_or(self.bottom_px) - 9.5;
        for p in self.trace.publications.iter().filter(|p| p.stamp.is_some() && p.visible_at <= self.until) {
            let draw = if p.reused_from.is_some() { published_again } else { published };
            draw(canvas, (self.x(p.visible_at), foot(p.operator) - 9.0));
        }
        for mark in self.trace.drops.iter().filter(|mark| mark.at <= self.until) {
            dropped(canvas, (self.x(mark.at), foot(mark.operator)));
        }
        for mark in self.trace.misses.iter().filter(|mark| mark.at <= self.until) {
            missed(canvas, (self.x(mark.at), foot(mark.operator)));
        }
    }

    fn legend(&self, canvas: &mut Canvas) {
        let entries: [(Sign, &str); 6] = [
            (Sign::Mark(published), "published"),
            (Sign::Mark(published_again), "published again (reuse_last)"),
            (Sign::Mark(missed), "deadline missed"),
            (Sign::Mark(dropped), "dropped"),
            (Sign::Block(bar_style(fill_of(0), LATE)), "ended too late, not published"),
            (Sign::Block(bar_style(fill_of(0), UNDER_WAY)), "under way at the end"),
        ];
        let entries: Vec<Entry> = entries.into_iter().map(|(sign, text)| (sign, text.to_owned())).collect();
        let right = self.left_px + self.plot_px;
        legend(canvas, (12.0, self.bottom_px + 42.0), right, &entries);
    }
}

const GRID: Style = Style::line(color::GRID, 1.0);

/// Opacity and dashes of the bars of steps that came to nothing.
const LATE: (f64, [f64; 2]) = (0.35, [3.0, 2.0]);
const UNDER_WAY: (f64, [f64; 2]) = (0.6, [1.0, 2.0]);
const DONE: (f64, [f64; 2]) = (1.0, [0.0, 0.0]);

fn bar_style(fill: Color, (opacity, [dash, gap]): (f64, [f64; 2])) -> Style {
    Style::fill(fill).filled_by(opacity).outlined(color::SOFT, 0.7).dashed(dash, gap).rounded(2.0)
}

fn triangle(canvas: &mut Canvas, (x, y): At, fill: Color) {
    let points = [(x, y - 4.0), (x + 4.0, y + 3.0), (x - 4.0, y + 3.0)];
    canvas.path(points, true, Style::fill(fill).outlined(color::GOOD, 1.0));
}

fn published(canvas: &mut Canvas, at: At) {
    triangle(canvas, at, color::GOOD);
}

fn published_again(canvas: &mut Canvas, at: At) {
    triangle(canvas, at, color::PAPER);
}

fn missed(canvas: &mut Canvas, (x, y): At) {
    for side in [-3.5, 3.5] {
        canvas.line((x - side, y - 3.5), (x + side, y + 3.5), Style::line(color::ALARM, 2.0));
    }
}

fn dropped(canvas: &mut Canvas, at: At) {
    canvas.circle(at, 3.0, Style::fill(color::PAPER).outlined(color::SOFT, 1.4));
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
