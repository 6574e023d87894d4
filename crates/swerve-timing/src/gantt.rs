//! Chart of `swerve timing --picture`: a row per operator, a bar per step, marks for publications, misses and drops,
//! and the chain of the slowest response. Bars or marks that are too close together are merged into a band; a band of
//! steps shows its count.

use std::collections::BTreeSet;
use std::ops::Range;

use swerve_core::{Span, Time};
use swerve_draw::color::{self, SERIES};
use swerve_draw::{
    Anchor, At, Canvas, Color, Entry, Picture, Sign, Step as Outline, Style, Text, legend, multiples,
    round_step, width_of,
};

use super::chain::Chain;
use super::pipeline::Pipeline;
use super::table::ms;
use super::trace::{Step, Trace};

const LANE_PX: f64 = 22.0;
const BAR_PX: f64 = 15.0;
/// Space below the bars of a row: a line of publications, and one of misses and drops.
const FOOT_PX: f64 = 18.0;
const TOP_PX: f64 = 58.0;
const PLOT_PX_MIN: f64 = 1000.0;
const PLOT_PX_MAX: f64 = 12_000.0;
const LEFT_PX_MIN: f64 = 110.0;
/// Width per step of the busiest operator, within the limits of the plot's width.
const STEP_PX: f64 = 40.0;
/// Maximum number of steps in a chart; for longer runs it shows the first part.
const STEPS_MAX: usize = 3000;
/// Approximate distance between the ticks of the axis.
const TICK_PX: f64 = 80.0;
/// Minimum distance at which bars or marks of a row are drawn one by one, start to start.
const APART_PX: f64 = 14.0;
/// Minimum number of consecutive closer ones that are merged into a band.
const BAND_MIN: usize = 4;
/// Tint of an operator's palette colour on which dark text is readable.
fn fill_of(operator: usize) -> Color {
    SERIES[operator % 4].color.mixed(color::PAPER, 0.6)
}

/// Text of bars, marks and the axis.
const LABEL: Text = Text { size: 11.0, ..Text::PLAIN };
const NOTE: Text = Text { size: 9.0, ..Text::SOFT };

/// Draws the chart of a run.
pub(crate) fn draw(pipeline: &Pipeline, trace: &Trace) -> Picture {
    let chart = Chart::new(pipeline, trace);
    let mut canvas = Canvas::default();
    chart.axis(&mut canvas);
    chart.rows(&mut canvas);
    chart.bars(&mut canvas);
    chart.marks(&mut canvas);
    let chain = Chain::slowest(pipeline, trace, chart.until);
    if let Some(chain) = &chain {
        chart.chain(&mut canvas, chain);
    }
    let below = chart.legend(&mut canvas, chain.as_ref());
    chart.finish(canvas, below)
}

struct Chart<'a> {
    pipeline: &'a Pipeline,
    trace: &'a Trace,
    /// Lane of each step within its operator's row, in the order of the trace.
    lanes: Vec<usize>,
    /// Top of each operator's row.
    tops: Vec<f64>,
    bottom_px: f64,
    left_px: f64,
    plot_px: f64,
    px_per_ms: f64,
    /// End of the displayed part of the run.
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

    fn finish(&self, mut canvas: Canvas, below: f64) -> Picture {
        let all = Time::ZERO + self.pipeline.span;
        let part = if self.until < all {
            format!("the first {} of ", ms(self.until - Time::ZERO))
        } else {
            String::new()
        };
        let title = format!("Timing over {part}{} ms", ms(self.pipeline.span));
        canvas.text((12.0, 20.0), &title, Text { size: 14.0, ..Text::TITLE });
        let soft = Text { color: color::SOFT, ..LABEL };
        let bars = "bars: steps, labelled by stamp in ms where they are long enough, or many of them by their count; pointed \
                    at, each says its stamp, start and end";
        canvas.text((12.0, 36.0), bars, soft);
        canvas.finish(self.left_px + self.plot_px + 30.0, below + 20.0, &title)
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

    fn bars(&self, canvas: &mut Canvas) {
        for operator in 0..self.pipeline.operators.len() {
            let is_of = |k: &usize| self.trace.steps[*k].operator == operator;
            let shown = (0..self.trace.steps.len()).filter(is_of);
            let shown: Vec<usize> = shown.filter(|k| self.trace.steps[*k].start <= self.until).collect();
            let lanes: BTreeSet<usize> = shown.iter().map(|k| self.lanes[*k]).collect();
            for lane in lanes {
                let steps = shown.iter().filter(|k| self.lanes[**k] == lane);
                self.lane(canvas, lane, &steps.map(|k| &self.trace.steps[*k]).collect::<Vec<_>>());
            }
        }
    }

    /// Draws the bars of a lane, with a band in place of bars that are too close together.
    fn lane(&self, canvas: &mut Canvas, lane: usize, steps: &[&Step]) {
        let at: Vec<f64> = steps.iter().map(|step| self.x(step.start)).collect();
        let mut next = 0;
        let is_done = |k: usize| !steps[k].late && steps[k].end.is_some();
        for band in bands(&at, is_done) {
            steps[next..band.start].iter().for_each(|step| self.bar(canvas, step, lane));
            next = band.end;
            self.band(canvas, lane, &steps[band]);
        }
        steps[next..].iter().for_each(|step| self.bar(canvas, step, lane));
    }

    /// Returns the top left corner and the width of a bar.
    fn place(&self, step: &Step, lane: usize) -> (At, f64) {
        let (x, y) = (self.x(step.start), self.tops[step.operator] + LANE_PX * lane as f64);
        ((x, y), (self.x(self.end(step)) - x).max(1.5))
    }

    /// End of a step, clipped to the displayed part.
    fn end(&self, step: &Step) -> Time {
        step.end.map_or(self.until, |end| end.min(self.until))
    }

    fn band(&self, canvas: &mut Canvas, lane: usize, steps: &[&Step]) {
        let (first, last) = (steps[0], steps[steps.len() - 1]);
        let (at, _) = self.place(first, lane);
        let width = self.x(self.end(last)).max(self.x(last.start) + 1.5) - at.0;
        let (from, to) = (ms(first.start - Time::ZERO), ms(self.end(last) - Time::ZERO));
        let count = format!("{} steps", steps.len());
        let name = &self.pipeline.operators[first.operator].name;
        canvas.begin_titled(&format!("{name}: {count} from {from} to {to} ms"));
        canvas.rect(at, (width, BAR_PX), band_style(fill_of(first.operator)));
        canvas.end_titled();
        if width > width_of(&count, LABEL) + 4.0 {
            canvas.text((at.0 + 3.0, at.1 + 11.5), &count, LABEL);
        }
    }

    fn bar(&self, canvas: &mut Canvas, step: &Step, lane: usize) {
        let ((x, y), width) = self.place(step, lane);
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

    /// Heights of an operator's publications, and of its misses and drops below them.
    fn feet(&self, operator: usize) -> (f64, f64) {
        let foot = self.tops.get(operator + 1).copied().unwrap_or(self.bottom_px) - 9.5;
        (foot - 9.0, foot)
    }

    /// Horizontal positions of an operator's publications, either new ones or repeats.
    fn published(&self, operator: usize, again: bool) -> Vec<f64> {
        let all = self.trace.publications.iter().filter(|p| p.operator == operator && p.stamp.is_some());
        let shown = all.filter(|p| p.reused_from.is_some() == again && p.visible_at <= self.until);
        shown.map(|p| self.x(p.visible_at)).collect()
    }

    /// Outlines the steps of the chain and draws an arrow from each publication to the step that read it.
    fn chain(&self, canvas: &mut Canvas, chain: &Chain<'_>) {
        for pair in chain.links.windows(2) {
            let ((read, _), (_, by)) = (pair[0], pair[1]);
            let from = (self.x(read.visible_at), self.feet(read.operator).0);
            let top = self.tops[by.operator];
            // Feedback is read from below.
            let edge = if top > from.1 { top - 1.0 } else { top + BAR_PX + 1.0 };
            arrow(canvas, from, (self.x(by.start), edge));
        }
        for (publication, step) in &chain.links {
            let lane = self.trace.steps.iter().position(|other| core::ptr::eq(other, *step));
            let (at, width) = self.place(step, lane.map_or(0, |k| self.lanes[k]));
            canvas.rect(at, (width, BAR_PX), CHAIN.rounded(2.0));
            // A repeat is published later than it was computed.
            if publication.reused_from.is_some() {
                let to = (self.x(publication.visible_at), self.feet(publication.operator).0);
                canvas.path(
                    [(at.0 + width, at.1 + BAR_PX), (at.0 + width, to.1), to],
                    false,
                    CHAIN.dashed(4.0, 3.0),
                );
            }
        }
    }

    /// Draws publications, and below them misses and drops, at the lower edge of each row.
    fn marks(&self, canvas: &mut Canvas) {
        for operator in 0..self.pipeline.operators.len() {
            let (y, foot) = self.feet(operator);
            for (again, draw) in [(false, published as Mark), (true, published_again)] {
                let at = self.published(operator, again);
                let mut next = 0;
                for band in bands(&at, |_| true) {
                    at[next..band.start].iter().for_each(|x| draw(canvas, (*x, y)));
                    next = band.end;
                    let style = if again { MANY_AGAIN } else { MANY };
                    canvas.line((at[band.start], y), (at[band.end - 1], y), style);
                }
                at[next..].iter().for_each(|x| draw(canvas, (*x, y)));
            }
            let of = |marks: &[super::trace::Mark]| -> Vec<f64> {
                let shown = marks.iter().filter(|mark| mark.operator == operator && mark.at <= self.until);
                shown.map(|mark| self.x(mark.at)).collect()
            };
            of(&self.trace.drops).into_iter().for_each(|x| dropped(canvas, (x, foot)));
            of(&self.trace.misses).into_iter().for_each(|x| missed(canvas, (x, foot)));
        }
    }

    /// Draws a legend of the signs in the chart; returns the height of its last line.
    fn legend(&self, canvas: &mut Canvas, chain: Option<&Chain<'_>>) -> f64 {
        let (trace, until) = (self.trace, self.until);
        let steps = || trace.steps.iter().filter(|step| step.start <= until);
        let operators = 0..self.pipeline.operators.len();
        let has = |again| operators.clone().any(|operator| !self.published(operator, again).is_empty());
        let has_many =
            |again| operators.clone().any(|k| !bands(&self.published(k, again), |_| true).is_empty());
        let shown = |marks: &[super::trace::Mark]| marks.iter().any(|mark| mark.at <= until);
        let mut entries: Vec<Entry> = Vec::new();
        let mut add = |is_there: bool, sign: Sign, text: &str| {
            entries.extend(is_there.then(|| (sign, text.to_owned())));
        };
        add(has(false), Sign::Mark(published), "published");
        add(has(true), Sign::Mark(published_again), "published again (reuse_last)");
        add(has_many(false) || has_many(true), Sign::Line(MANY), "published, too often to be drawn singly");
        add(shown(&trace.misses), Sign::Mark(missed), "deadline missed");
        add(shown(&trace.drops), Sign::Mark(dropped), "dropped");
        let late = Sign::Block(bar_style(fill_of(0), LATE));
        add(steps().any(|step| step.late), late, "ended too late, not published");
        let under_way = Sign::Block(bar_style(fill_of(0), UNDER_WAY));
        add(steps().any(|step| step.end.is_none()), under_way, "under way at the end");
        if let Some((chain, (result, _))) = chain.and_then(|chain| Some((chain, chain.links.last()?))) {
            let name = &self.pipeline.operators[result.operator].name;
            let at = ms(result.visible_at - Time::ZERO);
            let text = format!("slowest response: {name} at {at} ms, {} ms after its frame", ms(chain.took));
            add(true, Sign::Line(CHAIN), &text);
        }
        let right = self.left_px + self.plot_px;
        legend(canvas, (12.0, self.bottom_px + 42.0), right, &entries)
    }
}

/// Draws a mark at a position.
type Mark = fn(&mut Canvas, At);

/// Merges at least [`BAND_MIN`] neighbours closer than [`APART_PX`] into bands; `at` is ascending, and `may` is true
/// for the indices that a band may contain.
fn bands(at: &[f64], may: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let joins = |k: usize| at[k] - at[k - 1] < APART_PX && may(k - 1) && may(k);
    let mut bands = Vec::new();
    let mut start = 0;
    for end in 1..=at.len() {
        if end == at.len() || !joins(end) {
            bands.extend((end - start >= BAND_MIN).then_some(start..end));
            start = end;
        }
    }
    bands
}

/// Draws an arrow that bends into the step, downwards or upwards.
fn arrow(canvas: &mut Canvas, from: At, to: At) {
    let down = (to.1 - from.1).signum();
    let bend = (0.5 * (to.1 - from.1).abs()).max(8.0) * down;
    let pull = ((from.0, from.1 + bend), (to.0, to.1 - bend));
    canvas.outline(vec![Outline::Move(from), Outline::Curve(pull.0, pull.1, to)], CHAIN);
    canvas.arrow_head(to, down * core::f64::consts::FRAC_PI_2, Style::fill(color::INK));
}

const GRID: Style = Style::line(color::GRID, 1.0);

/// Opacity and dashes of the bars of late, unfinished and finished steps.
const LATE: (f64, [f64; 2]) = (0.35, [3.0, 2.0]);
const UNDER_WAY: (f64, [f64; 2]) = (0.6, [1.0, 2.0]);
const DONE: (f64, [f64; 2]) = (1.0, [0.0, 0.0]);

fn bar_style(fill: Color, (opacity, [dash, gap]): (f64, [f64; 2])) -> Style {
    Style::fill(fill).filled_by(opacity).outlined(color::SOFT, 0.7).dashed(dash, gap).rounded(2.0)
}

/// Style of the chain of the slowest response.
const CHAIN: Style = Style::line(color::INK, 1.6);

/// Style of publications that are too close together to be drawn one by one.
const MANY: Style = Style::line(color::GOOD, 4.0);
const MANY_AGAIN: Style = MANY.lined_by(0.4);

fn band_style(fill: Color) -> Style {
    Style::fill(fill).outlined(color::SOFT, 0.7).rounded(2.0)
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

/// Assigns each step the first free lane of its operator's row; also returns the number of lanes of each row.
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

/// Text below the name of a row: policy, and resource if it has one.
fn note(pipeline: &Pipeline, op: &super::BlackBox) -> String {
    match op.uses {
        Some(r) => format!("{} on {}", op.policy, pipeline.resources[r].name),
        None => op.policy.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_contain_enough_close_neighbours() {
        let at = [0.0, 5.0, 10.0, 15.0, 40.0, 45.0, 50.0, 80.0, 85.0, 90.0, 95.0, 100.0];
        assert_eq!(bands(&at, |_| true), [0..4, 7..12]);
        assert_eq!(bands(&at, |k| k != 11), [0..4, 7..11]);
        assert_eq!(bands(&at[..3], |_| true), []);
        assert_eq!(bands(&[], |_| true), []);
    }
}
