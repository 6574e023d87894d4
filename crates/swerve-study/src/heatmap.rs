//! The study as a picture: one square a combination, coloured by the share of good runs.

use swerve_report::canvas::{At, Canvas, Text, color};

use super::table::{Grid, Square};

const SQUARE_W: f64 = 200.0;
const SQUARE_H: f64 = 46.0;
const TOP: f64 = 86.0;
const MARGIN: f64 = 24.0;

/// A name beside the squares.
const NAME: Text<'_> = Text { size: 13.0, color: color::INK, anchor: "middle", bold: false, rim: false };

/// Draws the grid as an SVG.
pub fn draw(grid: &Grid, title: &str) -> String {
    let longest = grid.rows.iter().map(|r| r.chars().count()).max().unwrap_or(0);
    let left = MARGIN + 16.0 + 7.6 * longest as f64;
    let width = (left + SQUARE_W * grid.columns.len() as f64 + MARGIN)
        .max(MARGIN * 2.0 + 9.4 * title.chars().count() as f64);
    let height = TOP + SQUARE_H * grid.rows.len() as f64 + 58.0;
    let mut canvas = Canvas::default();
    canvas.text((MARGIN, 30.0), title, Text { size: 16.0, anchor: "start", bold: true, ..NAME });
    let middle = left + 0.5 * SQUARE_W * grid.columns.len() as f64;
    canvas.text((middle, 56.0), &grid.column_axis, Text { color: color::SOFT, ..NAME });
    for (c, name) in grid.columns.iter().enumerate() {
        canvas.text((left + SQUARE_W * (c as f64 + 0.5), TOP - 10.0), name, NAME);
    }
    for (r, name) in grid.rows.iter().enumerate() {
        let y = TOP + SQUARE_H * r as f64;
        canvas.text((left - 10.0, y + 0.5 * SQUARE_H + 5.0), name, Text { anchor: "end", ..NAME });
        for (c, square) in grid.row(r).iter().enumerate() {
            draw_square(&mut canvas, square, (left + SQUARE_W * c as f64, y), budget_max(grid));
        }
    }
    legend(&mut canvas, (left, height - 34.0), budget_max(grid), grid.good);
    if budget_max(grid).is_none() && grid.squares.iter().any(|square| square.stopped > 0) {
        legend_of_stops(&mut canvas, (left, height - 16.0));
    }
    canvas.finish(width, height, title)
}

fn budget_max(grid: &Grid) -> Option<f64> {
    grid.squares.iter().filter_map(Square::budget_median_ms).max_by(f64::total_cmp).map(|ms| ms.max(1.0))
}

fn draw_square(canvas: &mut Canvas, square: &Square, (x, y): At, budget_max: Option<f64>) {
    let level = match budget_max {
        Some(max) => square.budget_median_ms().map(|ms| (ms / max).clamp(0.0, 1.0)),
        None => square.share(),
    };
    let fill = level.map_or_else(|| "#eeeeee".to_owned(), colour);
    let ink = if level.is_some_and(|l| (0.2..=0.8).contains(&l)) || level.is_none() {
        color::INK
    } else {
        "#ffffff"
    };
    let size = (SQUARE_W - 4.0, SQUARE_H - 4.0);
    canvas.rect((x + 2.0, y + 2.0), size, &format!("rx=\"4\" fill=\"{fill}\""));
    // Safe stops have the right part for themselves.
    let stopped = if budget_max.is_none() && square.runs > 0 {
        square.stopped as f64 / square.runs as f64
    } else {
        0.0
    };
    if stopped > 0.0 {
        let width = size.0 * stopped;
        let style = format!("rx=\"4\" fill=\"{}\"", color::STOPPED_LIGHT);
        canvas.rect((x + 2.0 + size.0 - width, y + 2.0), (width, size.1), &style);
    }
    let ink = if stopped > 0.0 { color::INK } else { ink };
    let rim = stopped > 0.0 && stopped < 1.0;
    let middle = x + 0.5 * SQUARE_W;
    let (first, second) = match (square.budget_text(), square.runs) {
        (_, 0) if square.failed > 0 => (square.text(), String::new()),
        (_, 0) => ("not run".to_owned(), String::new()),
        (Some([median, range]), _) => {
            let rest: String = square.rest().map(|(verdict, n)| format!(", {n} {verdict}")).collect();
            (median, format!("{range} ms{rest}"))
        }
        (None, runs) => (
            format!("{} of {runs} hit nothing", square.no_collision),
            core::iter::once(format!("{} on the road", square.on_road))
                .chain(square.impact_median_mps().map(|v| format!("hit {v:.1} m/s")))
                .chain(square.rest().map(|(verdict, n)| format!("{n} {verdict}")))
                .collect::<Vec<_>>()
                .join(", "),
        ),
    };
    let up = if second.is_empty() { 5.0 } else { -2.0 };
    canvas.text((middle, y + 0.5 * SQUARE_H + up), &first, Text { color: ink, bold: true, rim, ..NAME });
    if !second.is_empty() {
        let below = Text { color: ink, size: 11.0, rim, ..NAME };
        canvas.text((middle, y + 0.5 * SQUARE_H + 13.0), &second, below);
    }
}

/// From orange (0) over a light middle to blue (1): told apart by the colour-blind too.
fn colour(level: f64) -> String {
    let (low, middle, high) = ([213.0, 94.0, 0.0], [245.0, 240.0, 230.0], [0.0, 90.0, 160.0]);
    let (from, to, t) =
        if level < 0.5 { (low, middle, 2.0 * level) } else { (middle, high, 2.0 * level - 1.0) };
    let mix = |i: usize| (from[i] + (to[i] - from[i]) * t).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

fn legend_of_stops(canvas: &mut Canvas, (x, y): At) {
    canvas.rect((x, y), (16.0, 12.0), &format!("fill=\"{}\"", color::STOPPED_LIGHT));
    let small = Text { size: 11.0, color: color::SOFT, anchor: "start", ..NAME };
    let text = "of the square's width: share of runs that stopped safely before what was in the way";
    canvas.text((x + 24.0, y + 10.0), text, small);
}

fn legend(canvas: &mut Canvas, (x, y): At, budget_max: Option<f64>, good: &str) {
    for i in 0..=10 {
        let fill = format!("fill=\"{}\"", colour(0.1 * f64::from(i)));
        canvas.rect((x + 16.0 * f64::from(i), y), (16.0, 12.0), &fill);
    }
    let text = match budget_max {
        Some(max) => format!("largest added latency that still avoids, 0 to {max:.0} ms"),
        None => format!("share of runs that {good}, 0 to 1"),
    };
    let small = Text { size: 11.0, color: color::SOFT, anchor: "start", ..NAME };
    canvas.text((x + 16.0 * 11.0 + 8.0, y + 10.0), &text, small);
}
