//! Axes of plots: ranges, round ticks, grids, frames and labels.

use crate::canvas::{At, Canvas};
use crate::color;
use crate::style::{Anchor, Style, Text};

/// Two axes over a rectangle, the second one upwards.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Axes {
    /// Top left corner.
    pub corner: At,
    /// Width and height.
    pub size: (f64, f64),
    /// Range of the first axis.
    pub x: (f64, f64),
    /// Range of the second axis.
    pub y: (f64, f64),
}

impl Axes {
    /// Position of two values.
    pub fn at(&self, x: f64, y: f64) -> At {
        let share = |(low, high): (f64, f64), value: f64| (value - low) / (high - low);
        (
            self.corner.0 + self.size.0 * share(self.x, x),
            self.corner.1 + self.size.1 * (1.0 - share(self.y, y)),
        )
    }

    /// Round values on the first axis, approximately `about`.
    pub fn across(&self, about: f64) -> impl Iterator<Item = f64> + use<> {
        multiples(self.x.0, self.x.1, round_step(self.x.1 - self.x.0, about))
    }

    /// Round values on the second axis, approximately `about`.
    pub fn upwards(&self, about: f64) -> impl Iterator<Item = f64> + use<> {
        multiples(self.y.0, self.y.1, round_step(self.y.1 - self.y.0, about))
    }

    /// Draws the background of the plot.
    pub fn ground(&self, canvas: &mut Canvas) {
        canvas.rect(self.corner, self.size, Style::fill(color::PANEL));
    }

    /// Draws grid lines at round values of both axes, approximately as many as given; stronger at zero.
    pub fn grid(&self, canvas: &mut Canvas, (across, upwards): (f64, f64)) {
        self.grid_in(canvas, (across, upwards), Style::line(color::GRID, 0.7));
    }

    /// Same as [`grid`](Self::grid), in another style.
    pub fn grid_in(&self, canvas: &mut Canvas, (across, upwards): (f64, f64), style: Style) {
        for x in self.across(across) {
            canvas.line(self.at(x, self.y.0), self.at(x, self.y.1), style);
        }
        for y in self.upwards(upwards) {
            let crosses = y == 0.0 && self.y.0 < 0.0;
            let style = if crosses { Style::line(color::SOFT, 0.9) } else { style };
            canvas.line(self.at(self.x.0, y), self.at(self.x.1, y), style);
        }
    }

    /// Draws tick labels below, with ticks, approximately `about`.
    pub fn numbers_below(&self, canvas: &mut Canvas, about: f64) {
        for x in self.across(about) {
            let (px, py) = self.at(x, self.y.0);
            canvas.line((px, py), (px, py + 4.0), Style::line(color::SOFT, 1.0));
            canvas.text((px, py + 16.0), &number(x), Text::TICK);
        }
    }

    /// Draws tick labels to the left, with ticks, approximately `about`.
    pub fn numbers_left(&self, canvas: &mut Canvas, about: f64) {
        for y in self.upwards(about) {
            let (px, py) = self.at(self.x.0, y);
            canvas.line((px - 4.0, py), (px, py), Style::line(color::SOFT, 1.0));
            canvas.text((px - 7.0, py + 4.0), &number(y), Text { anchor: Anchor::End, ..Text::TICK });
        }
    }

    /// Draws a panel without its lines: background, grid and tick labels at approximately `about` round values, frame,
    /// heading, and the label of the first axis.
    pub fn panel(&self, canvas: &mut Canvas, about: (f64, f64), (heading, below): (&str, &str)) {
        self.heading(canvas, heading);
        self.ground(canvas);
        self.grid(canvas, about);
        self.numbers_below(canvas, about.0);
        self.numbers_left(canvas, about.1);
        self.frame(canvas);
        self.name_below(canvas, below);
    }

    /// Draws the frame.
    pub fn frame(&self, canvas: &mut Canvas) {
        canvas.rect(self.corner, self.size, Style::line(color::SOFT, 1.0));
    }

    /// Draws the heading above the plot.
    pub fn heading(&self, canvas: &mut Canvas, text: &str) {
        canvas.text((self.corner.0, self.corner.1 - 8.0), text, Text::SOFT);
    }

    /// Draws the label of the first axis below its tick labels.
    pub fn name_below(&self, canvas: &mut Canvas, text: &str) {
        let at = (self.corner.0 + self.size.0, self.corner.1 + self.size.1 + 30.0);
        canvas.text(at, text, Text { anchor: Anchor::End, ..Text::SOFT });
    }

    /// Draws the label and unit of the second axis, vertical, to the left of its tick labels.
    pub fn name_left(&self, canvas: &mut Canvas, text: &str, unit: &str) {
        let (x, middle) = (self.corner.0, self.corner.1 + 0.5 * self.size.1);
        let how = Text { color: color::INK, anchor: Anchor::Middle, ..Text::SOFT };
        canvas.turned_text((x - 50.0, middle), -90.0, text, how);
        if !unit.is_empty() {
            canvas.turned_text((x - 37.0, middle), -90.0, &format!("({unit})"), Text::TICK);
        }
    }
}

/// Formats a number with at most two decimals, without trailing zeros.
pub fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}

/// Round step (1, 2 or 5 times a power of ten) that divides `range` into approximately `parts`.
pub fn round_step(range: f64, parts: f64) -> f64 {
    let raw = (range / parts).max(1e-9);
    let mut step = 1e-9;
    while step * 10.0 <= raw {
        step *= 10.0;
    }
    [1.0, 2.0, 5.0, 10.0].map(|m| m * step).into_iter().find(|s| *s >= raw * 0.999).unwrap_or(10.0 * step)
}

/// Multiples of `step` within a range.
pub fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last).map(move |k| k as f64 * step)
}
