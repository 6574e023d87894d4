//! The study as a picture: one square a combination, coloured by the share of good runs.

use std::fmt::Write as _;

use swerve_report::canvas::escape;

use super::table::{Grid, Square};

const SQUARE_W: f64 = 200.0;
const SQUARE_H: f64 = 46.0;
const TOP: f64 = 86.0;
const MARGIN: f64 = 24.0;

/// Draws the grid as an SVG.
pub fn draw(grid: &Grid, title: &str) -> String {
    let longest = grid.rows.iter().map(|r| r.chars().count()).max().unwrap_or(0);
    let left = MARGIN + 16.0 + 7.6 * longest as f64;
    let width = (left + SQUARE_W * grid.columns.len() as f64 + MARGIN)
        .max(MARGIN * 2.0 + 9.4 * title.chars().count() as f64);
    let height = TOP + SQUARE_H * grid.rows.len() as f64 + 58.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
    );
    let _ = writeln!(
        svg,
        "<text x=\"{MARGIN}\" y=\"30\" font-size=\"16\" font-weight=\"bold\" fill=\"#222222\">{}</text>",
        escape(title)
    );
    let middle = left + 0.5 * SQUARE_W * grid.columns.len() as f64;
    let _ = writeln!(
        svg,
        "<text x=\"{middle:.1}\" y=\"56\" text-anchor=\"middle\" fill=\"#555555\">{}</text>",
        escape(&grid.column_axis)
    );
    for (c, name) in grid.columns.iter().enumerate() {
        let x = left + SQUARE_W * (c as f64 + 0.5);
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#222222\">{}</text>",
            TOP - 10.0,
            escape(name)
        );
    }
    for (r, name) in grid.rows.iter().enumerate() {
        let y = TOP + SQUARE_H * r as f64;
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#222222\">{}</text>",
            left - 10.0,
            y + 0.5 * SQUARE_H + 5.0,
            escape(name)
        );
        for (c, square) in grid.row(r).iter().enumerate() {
            draw_square(&mut svg, square, left + SQUARE_W * c as f64, y, budget_max(grid));
        }
    }
    legend(&mut svg, (left, height - 34.0), budget_max(grid), grid.good);
    svg += "</svg>\n";
    svg
}

fn budget_max(grid: &Grid) -> Option<f64> {
    grid.squares.iter().filter_map(Square::budget_median_ms).max_by(f64::total_cmp).map(|ms| ms.max(1.0))
}

fn draw_square(svg: &mut String, square: &Square, x: f64, y: f64, budget_max: Option<f64>) {
    let level = match budget_max {
        Some(max) => square.budget_median_ms().map(|ms| (ms / max).clamp(0.0, 1.0)),
        None => square.share(),
    };
    let fill = level.map_or_else(|| "#eeeeee".to_owned(), colour);
    let ink = if level.is_some_and(|l| (0.2..=0.8).contains(&l)) || level.is_none() {
        "#222222"
    } else {
        "#ffffff"
    };
    let (w, h) = (SQUARE_W - 4.0, SQUARE_H - 4.0);
    let _ = writeln!(
        svg,
        "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{w}\" height=\"{h}\" rx=\"4\" fill=\"{fill}\"/>",
        x + 2.0,
        y + 2.0
    );
    let middle = x + 0.5 * SQUARE_W;
    let (first, second) = match (square.budget_median_ms(), square.runs) {
        (_, 0) => ("not run".to_owned(), String::new()),
        (Some(ms), _) => (
            format!("{ms:.0} ms"),
            format!("{:.0}-{:.0} ms", square.budget_ms[0], square.budget_ms[square.budget_ms.len() - 1]),
        ),
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
    let _ = writeln!(
        svg,
        "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-weight=\"bold\" fill=\"{ink}\">{first}</text>",
        y + 0.5 * SQUARE_H + up
    );
    if !second.is_empty() {
        let _ = writeln!(
            svg,
            "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"11\" fill=\"{ink}\">{second}</text>",
            y + 0.5 * SQUARE_H + 13.0
        );
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

fn legend(svg: &mut String, (x, y): (f64, f64), budget_max: Option<f64>, good: &str) {
    for i in 0..=10 {
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{y:.1}\" width=\"16\" height=\"12\" fill=\"{}\"/>",
            x + 16.0 * f64::from(i),
            colour(0.1 * f64::from(i))
        );
    }
    let text = match budget_max {
        Some(max) => format!("largest added latency that still avoids, 0 to {max:.0} ms"),
        None => format!("share of runs that {good}, 0 to 1"),
    };
    let _ = writeln!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\" fill=\"#555555\">{text}</text>",
        x + 16.0 * 11.0 + 8.0,
        y + 10.0
    );
}
