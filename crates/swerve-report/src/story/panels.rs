//! Speed, steering, accelerations and time to collision over one time axis.

use swerve_core::{Span, Time};
use swerve_eval::Milestone;
use swerve_msg::EgoState;

use super::birds_eye;
use super::collision_time::{HORIZON_S, series};
use super::marks::{closest_at, first_sight};
use super::record::Story;
use super::view::View;
use crate::canvas::{At, Canvas, Text, color, multiples, number, round_step};

const HEIGHT: f64 = 84.0;
const GAP: f64 = 14.0;

/// One quantity over time.
struct Panel {
    label: &'static str,
    unit: &'static str,
    of: Quantity,
    /// What is shown at least.
    range: (f64, f64),
    /// Limits of comfort, as the nuPlan benchmark has them (`ego_is_comfortable`).
    comfort: &'static [f64],
}

/// Where the values come from.
enum Quantity {
    Ego(fn(&EgoState) -> f64),
    CollisionTime,
}

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

/// Where one panel lies and which ranges it shows.
struct Frame {
    corner: At,
    width: f64,
    /// Seconds.
    time: (f64, f64),
    value: (f64, f64),
}

impl Frame {
    fn at(&self, time_s: f64, value: f64) -> At {
        let x = (time_s - self.time.0) / (self.time.1 - self.time.0);
        let y = (self.value.1 - value) / (self.value.1 - self.value.0);
        (self.corner.0 + x * self.width, self.corner.1 + y * HEIGHT)
    }
}

/// Draws the panels below each other from `corner` down; gives the height used.
pub(super) fn draw(canvas: &mut Canvas, story: &Story, view: &View, corner: At, width: f64) -> f64 {
    let time = (view.span.0.as_secs(), view.span.1.as_secs());
    let samples: Vec<&EgoState> =
        story.ego.iter().filter(|e| e.stamp >= view.span.0 && e.stamp <= view.span.1).collect();
    let mut y = corner.1 + 22.0;
    numbers(canvas, story, view, &Frame { corner: (corner.0, y), width, time, value: (0.0, 1.0) });
    for (k, panel) in PANELS.iter().enumerate() {
        let values: Vec<(f64, f64)> = match panel.of {
            Quantity::Ego(of) => samples.iter().map(|e| (e.stamp.as_secs(), of(e))).collect(),
            Quantity::CollisionTime => {
                series(story, view.span).into_iter().map(|(at, ttc)| (at.as_secs(), ttc)).collect()
            }
        };
        let value = range(values.iter().map(|(_, v)| *v), panel.range);
        let frame = Frame { corner: (corner.0, y), width, time, value };
        axes(canvas, panel, &frame, k + 1 == PANELS.len());
        marks(canvas, story, view, &frame);
        canvas.begin_clip(frame.corner, (width, HEIGHT));
        for limit in panel.comfort {
            let style = format!("stroke=\"{}\" stroke-width=\"1\" stroke-dasharray=\"2 3\"", color::ALARM);
            canvas.line(frame.at(time.0, *limit), frame.at(time.1, *limit), &style);
        }
        let points = values.iter().map(|(at_s, v)| frame.at(*at_s, *v));
        canvas.path(points, false, &format!("fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"", color::EGO));
        canvas.end_clip();
        y += HEIGHT + GAP;
    }
    y - GAP + 36.0 - corner.1
}

/// The values' range and what is shown at least, and a little more.
fn range(values: impl Iterator<Item = f64>, least: (f64, f64)) -> (f64, f64) {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) = finite.fold(least, |(l, h), v| (l.min(v), h.max(v)));
    let spare = 0.06 * (high - low);
    // A quantity that begins at nothing has its axis there.
    (if low == 0.0 { 0.0 } else { low - spare }, high + spare)
}

fn axes(canvas: &mut Canvas, panel: &Panel, frame: &Frame, is_last: bool) {
    let (x, y) = frame.corner;
    canvas.rect(frame.corner, (frame.width, HEIGHT), "fill=\"#FCFCFD\"");
    let how = Text { size: 11.0, color: color::SOFT, anchor: "middle", ..Text::default() };
    let grid = format!("stroke=\"{}\" stroke-width=\"0.7\"", color::GRID);
    for t in multiples(frame.time.0, frame.time.1, round_step(frame.time.1 - frame.time.0, 14.0)) {
        let (px, _) = frame.at(t, 0.0);
        canvas.line((px, y), (px, y + HEIGHT), &grid);
        if is_last {
            canvas.line((px, y + HEIGHT), (px, y + HEIGHT + 4.0), "stroke=\"#5B636D\"");
            canvas.text((px, y + HEIGHT + 16.0), &number(t), how);
        }
    }
    for v in multiples(frame.value.0, frame.value.1, round_step(frame.value.1 - frame.value.0, 5.0)) {
        let (_, py) = frame.at(frame.time.0, v);
        let zero = "stroke=\"#5B636D\" stroke-width=\"0.9\"";
        canvas.line((x, py), (x + frame.width, py), if v == 0.0 { zero } else { &grid });
        canvas.text((x - 7.0, py + 4.0), &number(v), Text { anchor: "end", ..how });
    }
    canvas.rect(frame.corner, (frame.width, HEIGHT), "fill=\"none\" stroke=\"#5B636D\" stroke-width=\"1\"");
    let middle = y + 0.5 * HEIGHT;
    canvas.turned_text((x - 50.0, middle), -90.0, panel.label, Text { size: 12.0, color: color::INK, ..how });
    canvas.turned_text((x - 37.0, middle), -90.0, &format!("({})", panel.unit), how);
    if is_last {
        let place = (x + frame.width, y + HEIGHT + 30.0);
        canvas.text(place, "time (s)", Text { size: 12.0, anchor: "end", ..how });
    }
}

/// First sight, closest approach or collision, and the changes of mind, as lines across a panel.
fn marks(canvas: &mut Canvas, story: &Story, view: &View, frame: &Frame) {
    let mut line = |at: Time, style: &str| {
        let t = at.as_secs();
        if t >= frame.time.0 && t <= frame.time.1 {
            let (x, _) = frame.at(t, 0.0);
            canvas.line((x, frame.corner.1), (x, frame.corner.1 + HEIGHT), style);
        }
    };
    for mark in birds_eye::changes(story, view).shown {
        let paint = birds_eye::plan_color(&mark.plan);
        line(mark.at, &format!("stroke=\"{paint}\" stroke-width=\"1\" stroke-opacity=\"0.55\""));
    }
    if let Some(at) = first_sight(story) {
        let style = format!("stroke=\"{}\" stroke-width=\"2\" stroke-dasharray=\"6 4\"", color::SIGHT);
        line(at, &style);
    }
    let chain = story.why.iter().flat_map(|why| &why.steps).filter(|step| step.what != Milestone::Visible);
    for step in chain {
        let style = format!("stroke=\"{}\" stroke-width=\"1.2\" stroke-dasharray=\"1 2\"", color::TRACK);
        line(Time::ZERO + Span::from_secs(step.at_s), &style);
    }
    if let Some(at) = closest_at(story) {
        line(at, &format!("stroke=\"{}\" stroke-width=\"1.8\"", color::ALARM));
    }
}

/// The numbers of the changes of mind above the first panel.
fn numbers(canvas: &mut Canvas, story: &Story, view: &View, frame: &Frame) {
    let mut last = f64::NEG_INFINITY;
    for (number, mark) in (1_usize..).zip(birds_eye::changes(story, view).shown) {
        let (x, _) = frame.at(mark.at.as_secs(), 0.0);
        let x = x.max(last + 17.0);
        last = x;
        birds_eye::badge(
            canvas,
            (x, frame.corner.1 - 11.0),
            &number.to_string(),
            birds_eye::plan_color(&mark.plan),
        );
    }
}
