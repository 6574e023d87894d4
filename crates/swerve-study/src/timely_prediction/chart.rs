//! Picture of `[timely_prediction]`: error of each predictor relative to the first one at zero latency, over its own
//! latency.

use swerve_draw::color::{self, Color, Look, SERIES};
use swerve_draw::{At, Axes, Canvas, Picture, Style, Text};

use super::{Measured, OfSet};

const LEFT: f64 = 64.0;
const TOP: f64 = 74.0;
const PANEL_W: f64 = 250.0;
const PANEL_H: f64 = 190.0;
const GAP_X: f64 = 52.0;
const GAP_Y: f64 = 66.0;
const LEGEND_W: f64 = 210.0;
/// Approximate number of ticks on the axes.
const ABOUT: (f64, f64) = (5.0, 5.0);
/// Marks of run times, by their source.
const MARKS: [Mark; 2] = [Mark::Dot, Mark::Ring];

#[derive(Clone, Copy)]
enum Mark {
    Dot,
    Ring,
}

impl Measured<'_> {
    /// Draws one row of panels per set, with one panel for each of three horizons.
    pub(crate) fn draw(&self, title: &str) -> Picture {
        let mut canvas = Canvas::default();
        canvas.text((LEFT, 26.0), title, Text::TITLE);
        let first = self.asked.named(self.asked.predictors[0]);
        let below = format!("error over latency, metres more than {first} has at 0 ms: below 0 it is better");
        canvas.text((LEFT, 46.0), &below, Text::SOFT);
        let seconds = self.horizons();
        for (row, set) in self.sets.iter().enumerate() {
            for (column, ahead_s) in seconds.iter().enumerate() {
                let at =
                    (LEFT + column as f64 * (PANEL_W + GAP_X), TOP + 24.0 + row as f64 * (PANEL_H + GAP_Y));
                self.panel(&mut canvas, at, (set, *ahead_s));
            }
        }
        let right = LEFT + seconds.len() as f64 * (PANEL_W + GAP_X);
        self.legend(&mut canvas, right);
        let height = TOP + self.sets.len() as f64 * (PANEL_H + GAP_Y) + 30.0;
        canvas.finish(right + LEGEND_W, height.max(TOP + 320.0), title)
    }

    /// Short, medium and long horizon, seconds.
    fn horizons(&self) -> Vec<u32> {
        let most = self.asked.horizon_s;
        let mut seconds = vec![1, most.div_ceil(2), most];
        seconds.dedup();
        seconds
    }

    fn legend(&self, canvas: &mut Canvas, left: f64) {
        let mut y = TOP + 30.0;
        for (k, name) in self.asked.predictors.iter().enumerate() {
            canvas.line((left, y - 4.0), (left + 26.0, y - 4.0), line(k));
            canvas.text((left + 32.0, y), &self.asked.named(*name), Text::PLAIN);
            y += 17.0;
        }
        for (times, mark) in self.asked.run_time.iter().zip(MARKS) {
            y += 17.0;
            dot(canvas, (left + 13.0, y - 4.0), mark, color::INK);
            canvas.text((left + 32.0, y), &times.name, Text::SOFT);
        }
    }

    fn panel(&self, canvas: &mut Canvas, at: At, (set, ahead_s): (&OfSet<'_>, u32)) {
        let most_ms = f64::from(self.asked.latencies_ms.last().copied().unwrap_or(1).max(1));
        let Some(goal_m) = set.errors[0].mean_m(f64::from(ahead_s)) else { return };
        let lead_m = |k: usize, ms: f64| Some(set.errors[k].mean_m(f64::from(ahead_s) + ms * 1e-3)? - goal_m);
        let all = 0..self.asked.predictors.len();
        let ends = all.clone().flat_map(|k| [0.0, most_ms].map(|ms| lead_m(k, ms)));
        let [low, high] = ends.flatten().fold([0.0_f64; 2], |[low, high], m| [low.min(m), high.max(m)]);
        // Predictors with far larger errors are clipped.
        let far = lead_m(0, most_ms).unwrap_or(high) * 2.0;
        let high = high.min(far.max(1e-3));
        let low = low - 0.05 * (high - low);
        let axes =
            Axes { corner: at, size: (PANEL_W, PANEL_H), x: (0.0, most_ms), y: (low, high.max(low + 1e-9)) };
        axes.panel(canvas, ABOUT, (&format!("{}, {ahead_s} s ahead", set.name), "latency, ms"));
        canvas.begin_clip(at, (PANEL_W, PANEL_H));
        for k in all.rev() {
            let points = (0..=50).filter_map(|n| {
                let ms = most_ms * f64::from(n) / 50.0;
                Some(axes.at(ms, lead_m(k, ms)?))
            });
            canvas.path(points.collect::<Vec<_>>(), false, line(k));
        }
        for (times, mark) in self.asked.run_time.iter().zip(MARKS) {
            for (k, name) in self.asked.predictors.iter().enumerate() {
                if let Some((ms, m)) = times.of(*name, ahead_s).and_then(|ms| Some((ms, lead_m(k, ms)?))) {
                    dot(canvas, axes.at(ms, m), mark, look(k).color);
                }
            }
        }
        canvas.end_clip();
    }
}

/// Style of a line; lines beyond the distinguishable styles are all thin and grey.
fn look(k: usize) -> Look {
    SERIES.get(k).copied().unwrap_or(Look { color: color::ROAD_EDGE, dash: [0.0; 4] })
}

fn line(k: usize) -> Style {
    let width = if k < SERIES.len() { 1.8 } else { 0.9 };
    look(k).line(width)
}

fn dot(canvas: &mut Canvas, at: At, mark: Mark, paint: Color) {
    let inside = match mark {
        Mark::Dot => paint,
        Mark::Ring => color::LANE,
    };
    canvas.circle(at, 3.6, Style::fill(inside).outlined(paint, 1.6));
}
