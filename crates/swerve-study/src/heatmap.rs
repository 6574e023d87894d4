//! The study as a picture: one square a combination, coloured by the share of good runs.

use swerve_draw::{Anchor, At, Canvas, Color, Picture, Style, Text, color, width_of};

use super::chance::wilson;
use super::table::{Grid, Square};

/// Room between a text and the edge of its square.
const INSIDE: f64 = 8.0;
const SQUARE_H: f64 = 46.0;
/// Width of the legend's longest line.
const LEGEND_W: f64 = 520.0;
const TOP: f64 = 86.0;
const MARGIN: f64 = 24.0;

/// A name beside the squares.
const NAME: Text = Text { size: 13.0, color: color::INK, anchor: Anchor::Middle, bold: false, rim: false };

/// The texts of a square: what happened how often, and what else is known of it.
const FIRST: Text = Text { bold: true, ..NAME };
const SECOND: Text = Text { size: 11.0, ..NAME };
/// A line of the legend.
const SMALL: Text = Text { size: 11.0, color: color::SOFT, anchor: Anchor::Start, ..NAME };
const TITLE: Text = Text { size: 16.0, anchor: Anchor::Start, bold: true, ..NAME };

fn widest<'a>(texts: impl IntoIterator<Item = &'a String>, how: Text) -> f64 {
    texts.into_iter().map(|text| width_of(text, how)).fold(0.0, f64::max)
}

/// Draws the grid.
pub fn draw(grid: &Grid, title: &str) -> Picture {
    let left = MARGIN + 16.0 + widest(grid.rows.iter().chain([&grid.row_axes]), NAME);
    let told: Vec<[String; 2]> = grid.squares.iter().map(told).collect();
    let widths = [(0, FIRST), (1, SECOND)].map(|(line, how)| widest(told.iter().map(|t| &t[line]), how));
    let square_w = widths.into_iter().fold(widest(&grid.columns, NAME), f64::max) + 2.0 * INSIDE + 4.0;
    let width = (left + square_w * grid.columns.len() as f64 + MARGIN)
        .max(left + LEGEND_W + MARGIN)
        .max(MARGIN * 2.0 + width_of(title, TITLE));
    let height = TOP + SQUARE_H * grid.rows.len() as f64 + 58.0;
    let mut canvas = Canvas::default();
    canvas.text((MARGIN, 30.0), title, TITLE);
    let middle = left + 0.5 * square_w * grid.columns.len() as f64;
    let axis = Text { color: color::SOFT, ..NAME };
    canvas.text((middle, 56.0), &grid.column_axis, axis);
    canvas.text((left - 10.0, TOP - 10.0), &grid.row_axes, Text { anchor: Anchor::End, ..axis });
    for (c, name) in grid.columns.iter().enumerate() {
        canvas.text((left + square_w * (c as f64 + 0.5), TOP - 10.0), name, NAME);
    }
    for (r, name) in grid.rows.iter().enumerate() {
        let y = TOP + SQUARE_H * r as f64;
        canvas.text((left - 10.0, y + 0.5 * SQUARE_H + 5.0), name, Text { anchor: Anchor::End, ..NAME });
        for (c, square) in grid.row(r).iter().enumerate() {
            let paint = Paint::of(square, budget_max(grid));
            let told = &told[r * grid.columns.len() + c];
            let at = (left + square_w * c as f64, y);
            paint.square(&mut canvas, told, at, square_w);
            if square.beyond_limit {
                canvas.rect((at.0 + 4.0, y + 4.0), (square_w - 8.0, SQUARE_H - 8.0), beyond_rim(paint.ink));
            }
        }
    }
    legend(&mut canvas, (left, height - 34.0), budget_max(grid), grid.good);
    if budget_max(grid).is_none() && grid.squares.iter().any(|square| square.stopped > 0) {
        legend_of_stops(&mut canvas, (left, height - 16.0));
    }
    if grid.squares.iter().any(|square| square.beyond_limit) {
        canvas.rect((left, height - 16.0), (16.0, 12.0), beyond_rim(color::INK));
        let text = "more than the row or column `limit`: what one swerve or braking from first sight can do";
        canvas.text((left + 24.0, height - 6.0), text, SMALL);
    }
    canvas.finish(width, height, title)
}

/// The rim of a square whose budget is above the vehicle's limit.
const fn beyond_rim(ink: Color) -> Style {
    Style::line(ink, 1.5).dashed(5.0, 3.0)
}

fn budget_max(grid: &Grid) -> Option<f64> {
    grid.squares.iter().filter_map(Square::budget_median_ms).max_by(f64::total_cmp).map(|ms| ms.max(1.0))
}

/// What a square says: what happened how often, and what else is known of it.
fn told(square: &Square) -> [String; 2] {
    match (square.budget_text(), square.runs) {
        (_, 0) if square.failed > 0 => [square.text(), String::new()],
        (_, 0) => ["not run".to_owned(), String::new()],
        (Some([median, range]), _) => {
            let rest: String = square.rest().map(|(verdict, n)| format!(", {n} {verdict}")).collect();
            [median, format!("{range} ms{rest}")]
        }
        (None, runs) => {
            let (low, high) = wilson(square.no_collision, runs);
            let more = core::iter::once(format!("{} on the road", square.on_road))
                .chain(square.impact_median_mps().map(|v| format!("impact {v:.1} m/s")))
                .chain(square.rest().map(|(verdict, n)| format!("{n} {verdict}")));
            [
                format!("{} of {runs} collision-free ({low:.2}-{high:.2})", square.no_collision),
                more.collect::<Vec<_>>().join(", "),
            ]
        }
    }
}

/// The colours of a square.
struct Paint {
    fill: Color,
    ink: Color,
    /// The part that safe stops have for themselves, 0 to 1.
    stopped: f64,
}

impl Paint {
    fn of(square: &Square, budget_max: Option<f64>) -> Self {
        let level = match budget_max {
            Some(max) => square.budget_median_ms().map(|ms| (ms / max).clamp(0.0, 1.0)),
            None => square.share(),
        };
        let counts = budget_max.is_none() && square.runs > 0;
        let stopped = if counts { square.stopped as f64 / square.runs as f64 } else { 0.0 };
        let fill = level.map_or(color::NOTHING, color::graded);
        let ink = if stopped > 0.0 { color::INK } else { color::ink_on(fill) };
        Self { fill, ink, stopped }
    }

    fn square(&self, canvas: &mut Canvas, [first, second]: &[String; 2], (x, y): At, width: f64) {
        let (at, size) = ((x + 2.0, y + 2.0), (width - 4.0, SQUARE_H - 4.0));
        canvas.rect(at, size, Style::fill(self.fill).rounded(4.0));
        if self.stopped > 0.0 {
            let part = size.0 * self.stopped;
            stopped_area(canvas, (at.0 + size.0 - part, at.1), (part, size.1));
        }
        let rim = self.stopped > 0.0;
        let middle = (x + 0.5 * width, y + 0.5 * SQUARE_H);
        let up = if second.is_empty() { 5.0 } else { -2.0 };
        canvas.text((middle.0, middle.1 + up), first, Text { color: self.ink, rim, ..FIRST });
        if !second.is_empty() {
            canvas.text((middle.0, middle.1 + 13.0), second, Text { color: self.ink, rim, ..SECOND });
        }
    }
}

/// The part of a square that safe stops have: hatched, so that no colour is needed to see it.
fn stopped_area(canvas: &mut Canvas, at: At, size: (f64, f64)) {
    canvas.rect(at, size, Style::fill(color::PAPER).outlined(color::STOPPED, 1.0));
    canvas.hatch(at, size, Style::line(color::STOPPED, 0.8).lined_by(0.5));
}

fn legend_of_stops(canvas: &mut Canvas, (x, y): At) {
    stopped_area(canvas, (x, y), (16.0, 12.0));
    let text = "of the square's width: share of runs that stopped safely";
    canvas.text((x + 24.0, y + 10.0), text, SMALL);
}

fn legend(canvas: &mut Canvas, (x, y): At, budget_max: Option<f64>, good: &str) {
    for i in 0..=10 {
        let fill = Style::fill(color::graded(0.1 * f64::from(i)));
        canvas.rect((x + 16.0 * f64::from(i), y), (16.0, 12.0), fill);
    }
    let text = match budget_max {
        Some(max) => format!("largest added latency that still avoids, 0 to {max:.0} ms"),
        None => format!("share of runs that {good}, 0 to 1"),
    };
    canvas.text((x + 16.0 * 11.0 + 8.0, y + 10.0), &text, SMALL);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(line: &str, name: &str) -> f64 {
        let (_, rest) = line.split_once(&format!(" {name}=\"")).unwrap();
        rest.split_once('"').unwrap().0.parse().unwrap()
    }

    /// Left and right edge of each of a picture's squares.
    fn squares(svg: &str) -> Vec<[f64; 2]> {
        let squares = svg.lines().filter(|line| line.contains("rx=\"4\""));
        squares.map(|line| [number(line, "x"), number(line, "x") + number(line, "width")]).collect()
    }

    /// What stands in the squares: left edge, right edge, text.
    fn texts(svg: &str) -> Vec<(f64, f64, &str)> {
        let texts =
            svg.lines().filter(|line| line.contains("collision-free (") || line.contains("on the road"));
        let places = texts.map(|line| {
            let text = line.split_once('>').unwrap().1.split_once('<').unwrap().0;
            let how = if line.contains("bold") { FIRST } else { SECOND };
            let (middle, half) = (number(line, "x"), 0.5 * width_of(text, how));
            (middle - half, middle + half, text)
        });
        places.collect()
    }

    #[test]
    fn no_text_is_over_the_edge_of_its_square_and_axes_have_names() {
        let mut long =
            Square { runs: 5, no_collision: 0, stopped: 5, impact_mps: vec![12.5], ..Square::default() };
        long.others = ["gave_up", "stopped", "timeout"].map(|verdict| (verdict.to_owned(), 5)).into();
        let grid = Grid {
            row_axes: "policy latency_ms".into(),
            column_axis: "speed_mps".into(),
            rows: vec!["dynamic 150".into()],
            columns: vec!["12".into(), "14".into()],
            squares: vec![long, Square { runs: 5, no_collision: 5, good: 5, ..Square::default() }],
            good: "avoided",
        };
        let svg = draw(&grid, "t").svg();
        let (squares, texts) = (squares(&svg), texts(&svg));
        // Where squares have a rim around their ink, a text is there twice.
        assert!(texts.len() >= 4, "{svg}");
        for (left, right, text) in texts {
            assert!(squares.iter().any(|[from, to]| *from <= left && right <= *to), "{text} in {squares:?}");
        }
        assert!(svg.contains(">policy latency_ms<") && svg.contains(">speed_mps<"));
        assert!(
            svg.contains("5 of 5 collision-free (0.57-1.00)")
                && svg.contains("0 of 5 collision-free (0.00-0.43)")
        );
        assert!(svg.contains(&format!("stroke=\"{}\"", color::STOPPED)), "safe stops are hatched");
        assert_eq!(
            svg.matches(&format!("rx=\"4\" fill=\"{}\"", color::graded(1.0))).count(),
            1,
            "the success alone"
        );
    }
}
