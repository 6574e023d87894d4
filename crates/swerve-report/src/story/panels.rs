//! Time series of speed, steering, accelerations and time to collision over one time axis.

use swerve_core::{Span, Time};
use swerve_eval::{Milestone, WhyStep};
use swerve_msg::EgoState;

use super::birds_eye;
use super::changes::changes;
use super::collision_time::{HORIZON_S, series};
use super::labels::badge;
use super::lights;
use super::moments::{closest_at, first_sight};
use super::record::Story;
use super::states;
use super::view::View;
use swerve_draw::{Anchor, At, Axes, Canvas, Style, Text, color, width_of};

const HEIGHT: f64 = 84.0;
const GAP: f64 = 14.0;

/// Plot of one quantity over time.
struct Panel {
    label: &'static str,
    unit: &'static str,
    of: Quantity,
    /// Minimum range of the axis.
    range: (f64, f64),
    /// Comfort limits of the nuPlan benchmark (`ego_is_comfortable`).
    comfort: &'static [f64],
}

/// Source of the values.
enum Quantity {
    Ego(fn(&EgoState) -> f64),
    CollisionTime,
}

/// Height of the row that names the steps of the chain, pixels.
const CHAIN_ROW: f64 = 20.0;

/// Maximum time before the view for a step of the chain to be shown, and the space before the first one, seconds.
const BEFORE_VIEW_S: f64 = 5.0;
const EDGE_S: f64 = 0.1;

const PANELS: [Panel; 5] = [
    Panel {
        label: "speed",
        unit: "m/s",
        of: Quantity::Ego(|e| e.speed_mps),
        range: (0.0, 5.0),
        comfort: &[],
    },
    Panel {
        label: "steering",
        unit: "deg",
        of: Quantity::Ego(|e| e.steering_rad.to_degrees()),
        range: (-3.0, 3.0),
        comfort: &[],
    },
    Panel {
        label: "long. acc.",
        unit: "m/s²",
        of: Quantity::Ego(|e| e.accel_mps2),
        range: (-5.0, 3.0),
        comfort: &[-4.05, 2.4],
    },
    Panel {
        label: "lateral acc.",
        unit: "m/s²",
        of: Quantity::Ego(|e| e.lateral_accel_mps2),
        range: (-5.2, 5.2),
        comfort: &[-4.89, 4.89],
    },
    Panel { label: "TTC", unit: "s", of: Quantity::CollisionTime, range: (0.0, HORIZON_S), comfort: &[] },
];

/// Draws the panels below each other from `corner` down. Returns the height used.
pub(super) fn draw(canvas: &mut Canvas, story: &Story, view: &View, corner: At, width: f64) -> f64 {
    let time = time_axis(story, view);
    let from = Time::ZERO + Span::from_secs(time.0);
    let samples: Vec<&EgoState> =
        story.ego.iter().filter(|e| e.stamp >= from && e.stamp <= view.span.1).collect();
    // The jolt of a collision would dwarf all values before it, so values from then on are clipped at the frame.
    let impact_s = story.metrics.as_ref().and_then(|m| m.impact).map_or(f64::INFINITY, |impact| impact.at_s);
    let without_comfort = story.without_comfort();
    let mut y = corner.1 + 6.0;
    let row = |y| Axes { corner: (corner.0, y), size: (width, HEIGHT), x: time, y: (0.0, 1.0) };
    y += lights::strips(canvas, story, view, &row(y), y);
    let chain_y = y + 9.0;
    let is_told = has_chain(story, view) || steps(story, (f64::NEG_INFINITY, time.0)).next().is_some();
    y += if is_told { CHAIN_ROW } else { 0.0 } + 16.0;
    chain(canvas, story, &row(y), chain_y);
    numbers(canvas, story, view, &row(y));
    for (k, panel) in PANELS.iter().enumerate() {
        let values: Vec<(f64, Option<f64>)> = match panel.of {
            Quantity::Ego(of) => samples.iter().map(|e| (e.stamp.as_secs(), Some(of(e)))).collect(),
            Quantity::CollisionTime => {
                series(story, (from, view.span.1)).into_iter().map(|(at, ttc)| (at.as_secs(), ttc)).collect()
            }
        };
        let before = values.iter().filter(|(at_s, _)| *at_s < impact_s);
        let value = range(before.filter_map(|(_, v)| *v), panel.range);
        let frame = Axes { corner: (corner.0, y), size: (width, HEIGHT), x: time, y: value };
        axes(canvas, panel, &frame, &without_comfort, k + 1 == PANELS.len());
        marks(canvas, story, view, &frame);
        canvas.begin_clip(frame.corner, (width, HEIGHT));
        for limit in panel.comfort {
            let style = Style::line(color::ALARM, 1.0).dashed(2.0, 3.0);
            canvas.line(frame.at(time.0, *limit), frame.at(time.1, *limit), style);
        }
        // No line where there is no value.
        for run in values.chunk_by(|a, b| a.1.is_some() == b.1.is_some()) {
            let points = run.iter().filter_map(|(at_s, v)| Some(frame.at(*at_s, (*v)?)));
            canvas.path(points, false, Style::line(color::EGO, 1.8));
        }
        canvas.end_clip();
        if matches!(panel.of, Quantity::CollisionTime) {
            horizon(canvas, &frame, values.iter().any(|(_, v)| v.is_some()));
        }
        y += HEIGHT + GAP;
        if k == 0 {
            y += states::strip(canvas, story, &row(y), y - 5.0);
        }
    }
    y - GAP + 36.0 - corner.1
}

/// Range of the values, at least `least`, with a margin.
fn range(values: impl Iterator<Item = f64>, least: (f64, f64)) -> (f64, f64) {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) = finite.fold(least, |(l, h), v| (l.min(v), h.max(v)));
    let spare = 0.06 * (high - low);
    // A range that starts at zero gets no margin there.
    (if low == 0.0 { 0.0 } else { low - spare }, high + spare)
}

/// Shading of the times at which the planner itself led.
pub(super) fn without_comfort_style() -> Style {
    Style::fill(color::SIGHT).filled_by(0.16)
}

fn axes(canvas: &mut Canvas, panel: &Panel, frame: &Axes, without_comfort: &[(Time, Time)], is_last: bool) {
    const ABOUT: (f64, f64) = (14.0, 5.0);
    frame.ground(canvas);
    for (from, until) in without_comfort {
        let within = |at: &Time| frame.at(at.as_secs().clamp(frame.x.0, frame.x.1), 0.0).0;
        let (from, until) = (within(from), within(until));
        if until > from {
            canvas.rect((from, frame.corner.1), (until - from, HEIGHT), without_comfort_style());
        }
    }
    frame.grid(canvas, ABOUT);
    if is_last {
        frame.numbers_below(canvas, ABOUT.0);
        frame.name_below(canvas, "time (s)");
    }
    frame.numbers_left(canvas, ABOUT.1);
    frame.frame(canvas);
    frame.name_left(canvas, panel.label, panel.unit);
}

/// Marks the prediction horizon of the time to collision.
fn horizon(canvas: &mut Canvas, frame: &Axes, is_any: bool) {
    let style = Style::line(color::SOFT, 1.0).dashed(6.0, 4.0);
    canvas.line(frame.at(frame.x.0, HORIZON_S), frame.at(frame.x.1, HORIZON_S), style);
    let text = match is_any {
        true => format!("looked {HORIZON_S:.0} s ahead; no line: nothing would be hit by then"),
        false => format!("looked {HORIZON_S:.0} s ahead: at no time was anything about to be hit"),
    };
    let how = Text { size: 10.5, color: color::SOFT, anchor: Anchor::End, rim: true, ..Text::default() };
    canvas.text((frame.corner.0 + frame.size.0 - 6.0, frame.at(0.0, HORIZON_S).1 + 13.0), &text, how);
}

/// Steps of the chain within a time interval, seconds.
fn steps(story: &Story, (from, to): (f64, f64)) -> impl Iterator<Item = &WhyStep> {
    let steps = story.why.iter().flat_map(|why| &why.steps);
    steps.filter(move |step| step.at_s >= from && step.at_s <= to)
}

/// Time range of the curves, seconds: the span of the view, extended to the chain's first step if that is at most
/// [`BEFORE_VIEW_S`] earlier.
pub(super) fn time_axis(story: &Story, view: &View) -> (f64, f64) {
    let (from, to) = (view.span.0.as_secs(), view.span.1.as_secs());
    let Some(first) = steps(story, (from - BEFORE_VIEW_S, to)).next() else { return (from, to) };
    // A line on the very edge would be invisible.
    (from.min((first.at_s - EDGE_S).max(0.0)), to)
}

/// True if a step of the chain is on the time axis.
pub(super) fn has_chain(story: &Story, view: &View) -> bool {
    steps(story, time_axis(story, view)).next().is_some()
}

/// Steps of the chain before a time axis: listed if there is room, otherwise counted.
fn earlier(story: &Story, from_s: f64, how: Text, room: f64) -> Option<String> {
    // A step on the edge is named on the axis.
    let before = steps(story, (f64::NEG_INFINITY, from_s)).filter(|step| step.at_s < from_s);
    let named: Vec<String> = before.map(named).collect();
    let listed = format!("before this: {}", named.join(", "));
    match named.len() {
        0 => None,
        1 if width_of(&listed, how) > room => Some("1 step before this".into()),
        n if width_of(&listed, how) > room => Some(format!("{n} steps before this")),
        _ => Some(listed),
    }
}

fn named(step: &WhyStep) -> String {
    format!("{} {:.3} s", step.what.name().replace('_', " "), step.at_s)
}

/// Names the steps of the chain in a row, each with a line down to its instant, after those from before the time axis.
fn chain(canvas: &mut Canvas, story: &Story, frame: &Axes, y: f64) {
    const GAP: f64 = 10.0;
    let how = Text { size: 10.5, anchor: Anchor::Middle, ..Text::default() };
    let left = frame.corner.0;
    let early = earlier(story, frame.x.0, how, 0.35 * frame.size.0);
    let early = early.map(|text| (left, width_of(&text, how), text, color::SOFT));
    let steps = steps(story, frame.x).map(|step| {
        let text = named(step);
        let paint = if step.what == Milestone::Visible { color::SIGHT_TEXT } else { color::TRACK };
        (frame.at(step.at_s, 0.0).0, width_of(&text, how), text, paint)
    });
    let is_early = early.is_some();
    let named: Vec<(f64, f64, String, swerve_draw::Color)> = early.into_iter().chain(steps).collect();
    // Each name as near to its instant as the previous ones allow, then shifted back from the right edge.
    let mut left = left;
    let mut lefts: Vec<f64> = Vec::new();
    for (x, width, ..) in &named {
        left = (x - 0.5 * width).max(left);
        lefts.push(left);
        left += width + GAP;
    }
    let mut right = frame.corner.0 + frame.size.0;
    for ((_, width, ..), left) in named.iter().zip(&mut lefts).rev() {
        *left = left.min(right - width);
        right = *left - GAP;
    }
    for (k, ((x, width, text, paint), left)) in named.into_iter().zip(lefts).enumerate() {
        let middle = left + 0.5 * width;
        canvas.text((middle, y), &text, Text { color: paint, ..how });
        if k == 0 && is_early {
            continue;
        }
        canvas.line((middle, y + 3.0), (x, frame.corner.1), Style::line(paint, 0.8).lined_by(0.7));
    }
}

/// Draws first sight, steps of the chain, closest approach or collision, and plan changes as lines across a panel.
fn marks(canvas: &mut Canvas, story: &Story, view: &View, frame: &Axes) {
    let mut line = |at: Time, style: Style| {
        let t = at.as_secs();
        if t >= frame.x.0 && t <= frame.x.1 {
            let (x, _) = frame.at(t, 0.0);
            canvas.line((x, frame.corner.1), (x, frame.corner.1 + HEIGHT), style);
        }
    };
    for mark in changes(story, view).shown {
        let paint = birds_eye::plan_color(&mark.plan);
        line(mark.at, Style::line(paint, 1.0).lined_by(0.55));
    }
    if let Some(at) = first_sight(story) {
        let style = Style::line(color::SIGHT, 2.0).dashed(6.0, 4.0);
        line(at, style);
    }
    let chain = story.why.iter().flat_map(|why| &why.steps).filter(|step| step.what != Milestone::Visible);
    for step in chain {
        let style = Style::line(color::TRACK, 1.2).dashed(1.0, 2.0);
        line(Time::ZERO + Span::from_secs(step.at_s), style);
    }
    if let Some(at) = closest_at(story) {
        line(at, Style::line(color::ALARM, 1.8));
    }
}

/// Draws the numbers of the plan changes above the first panel.
fn numbers(canvas: &mut Canvas, story: &Story, view: &View, frame: &Axes) {
    let mut last = f64::NEG_INFINITY;
    for (number, mark) in (1_usize..).zip(changes(story, view).shown) {
        let (x, _) = frame.at(mark.at.as_secs(), 0.0);
        let x = x.max(last + 17.0);
        last = x;
        badge(canvas, (x, frame.corner.1 - 11.0), &number.to_string(), birds_eye::plan_color(&mark.plan));
    }
}
