//! Heat map of a study: one square per combination, coloured by the share of good runs.

use swerve_draw::{Anchor, At, Canvas, Color, Picture, Style, Text, color, width_of};

use super::chance::interval;
use super::table::{Grid, Square};

/// Space between a text and the edge of its square, pixels.
const INSIDE: f64 = 8.0;
/// Line spacing within a square, and space above and below all lines, pixels.
const LINE_H: f64 = 15.0;
const AROUND: f64 = 16.0;
const TOP: f64 = 86.0;
const MARGIN: f64 = 24.0;
/// Preferred width of the picture, that of a page, pixels.
const PAGE_W: f64 = 900.0;
/// Line spacing of the legend, and size of its signs, pixels.
const LEGEND_H: f64 = 18.0;
const SIGN: (f64, f64) = (16.0, 12.0);
/// Height of the strip of safe stops below the lines of a square, pixels.
const STRIP_H: f64 = 5.0;

/// Name beside the squares.
const NAME: Text = Text { size: 13.0, color: color::INK, anchor: Anchor::Middle, bold: false, rim: false };

/// Texts of a square: the first line, and further ones.
const FIRST: Text = Text { bold: true, ..NAME };
const MORE: Text = Text { size: 11.0, ..NAME };
/// Line of the legend.
const SMALL: Text = Text { size: 11.0, color: color::SOFT, anchor: Anchor::Start, ..NAME };
const TITLE: Text = Text { size: 16.0, anchor: Anchor::Start, bold: true, ..NAME };

const COUNTS: &str = "in a square: runs without a collision, runs that stayed on the road, median impact (of how many), other ends; 95 % intervals";
const STOPS: &str = "strip below, of the square's width: share of runs that stopped safely";
const LAYER: &str = "comfortable: plans that the comfortable layer made; the planner itself made the others";
const BEYOND: &str =
    "more than the row or column `limit`: what one swerve or braking from first sight can do";

fn widest<'a>(texts: impl IntoIterator<Item = &'a String>, how: Text) -> f64 {
    texts.into_iter().map(|text| width_of(text, how)).fold(0.0, f64::max)
}

/// Draws the heat map.
pub fn draw(grid: &Grid, title: &str) -> Picture {
    let left = MARGIN + 16.0 + widest(grid.rows.iter().chain([&grid.row_axes]), NAME);
    let columns = grid.columns.len() as f64;
    let room = room(grid, (PAGE_W - MARGIN - left) / columns - 2.0 * INSIDE - 4.0);
    let told: Vec<Vec<String>> = grid.squares.iter().map(|square| lines(square, room)).collect();
    let square_h = AROUND + LINE_H * told.iter().map(Vec::len).fold(2, usize::max) as f64;
    let size = (room + 2.0 * INSIDE + 4.0, square_h);
    let bottom = TOP + square_h * grid.rows.len() as f64;
    let legend = legend(grid);
    let width = legend
        .iter()
        .map(|(_, sign, text)| left + sign + width_of(text, SMALL) + MARGIN)
        .chain([left + size.0 * columns + MARGIN, 2.0 * MARGIN + width_of(title, TITLE)])
        .fold(0.0, f64::max);
    let mut canvas = Canvas::default();
    canvas.text((MARGIN, 30.0), title, TITLE);
    let axis = Text { color: color::SOFT, ..NAME };
    canvas.text((left + 0.5 * size.0 * columns, 56.0), &grid.column_axis, axis);
    canvas.text((left - 10.0, TOP - 10.0), &grid.row_axes, Text { anchor: Anchor::End, ..axis });
    for (c, name) in grid.columns.iter().enumerate() {
        canvas.text((left + size.0 * (c as f64 + 0.5), TOP - 10.0), name, NAME);
    }
    for (r, name) in grid.rows.iter().enumerate() {
        let y = TOP + square_h * r as f64;
        canvas.text((left - 10.0, y + 0.5 * square_h + 5.0), name, Text { anchor: Anchor::End, ..NAME });
        for (c, square) in grid.row(r).iter().enumerate() {
            let paint = Paint::of(square, budget_max(grid));
            let at = (left + size.0 * c as f64, y);
            paint.square(&mut canvas, &told[r * grid.columns.len() + c], at, size);
            if square.beyond_limit {
                canvas.rect((at.0 + 4.0, y + 4.0), (size.0 - 8.0, square_h - 8.0), beyond_rim(paint.ink));
            }
        }
    }
    for (line, (sign, sign_w, text)) in legend.iter().enumerate() {
        let at = (left, bottom + 24.0 + LEGEND_H * line as f64);
        sign(&mut canvas, at);
        canvas.text((at.0 + sign_w, at.1 + 10.0), text, SMALL);
    }
    canvas.finish(width, bottom + 22.0 + LEGEND_H * legend.len() as f64, title)
}

/// Width of a square's texts: its share of a page, but at least the longest single text and at most all texts in one
/// line.
fn room(grid: &Grid, share: f64) -> f64 {
    let told: Vec<(String, Vec<String>)> = grid.squares.iter().map(told).collect();
    let firsts = widest(told.iter().map(|(first, _)| first).chain(&grid.columns), FIRST);
    let least = firsts.max(widest(told.iter().flat_map(|(_, more)| more), MORE));
    let most = told.iter().map(|(_, more)| width_of(&more.join(", "), MORE)).fold(least, f64::max);
    share.clamp(least, most)
}

/// Lines of a square, filled up to a width.
fn lines(square: &Square, room: f64) -> Vec<String> {
    let (first, more) = told(square);
    let mut lines = vec![first];
    for (k, piece) in more.into_iter().enumerate() {
        let longer = format!("{}, {piece}", lines[lines.len() - 1]);
        if k > 0 && width_of(&longer, MORE) <= room {
            lines.pop();
            lines.push(longer);
        } else {
            lines.push(piece);
        }
    }
    lines
}

/// Rim of a square whose budget exceeds the vehicle's limit.
const fn beyond_rim(ink: Color) -> Style {
    Style::line(ink, 1.5).dashed(5.0, 3.0)
}

fn budget_max(grid: &Grid) -> Option<f64> {
    grid.squares.iter().filter_map(Square::budget_median_ms).max_by(f64::total_cmp).map(|ms| ms.max(1.0))
}

/// Texts of a square: the first line, and further facts.
fn told(square: &Square) -> (String, Vec<String>) {
    let rest = square.rest();
    match (square.budget_text(), square.runs) {
        (_, 0) if square.failed > 0 => (square.text(), Vec::new()),
        (_, 0) => ("not run".to_owned(), Vec::new()),
        (Some([median, range]), _) => (median, core::iter::once(format!("{range} ms")).chain(rest).collect()),
        (None, _) if square.seeks_budget => ("none".to_owned(), rest.collect()),
        (None, runs) => {
            let [hit_nothing, on_road] = [square.no_collision, square.on_road].map(|n| interval(n, runs));
            let more = core::iter::once(format!("{} on the road {on_road}", square.on_road))
                .chain(square.impact_text())
                .chain(rest);
            (format!("{} of {runs} {hit_nothing}", square.no_collision), more.collect())
        }
    }
}

/// Colours of a square.
struct Paint {
    fill: Color,
    ink: Color,
    /// Share of the width for safe stops, 0 to 1.
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
        Self { fill, ink: color::ink_on(fill), stopped }
    }

    fn square(&self, canvas: &mut Canvas, lines: &[String], (x, y): At, (width, height): (f64, f64)) {
        let (at, size) = ((x + 2.0, y + 2.0), (width - 4.0, height - 4.0));
        canvas.rect(at, size, Style::fill(self.fill).rounded(4.0));
        if self.stopped > 0.0 {
            let strip = (size.0 * self.stopped, STRIP_H);
            stopped_area(canvas, (at.0, at.1 + size.1 - STRIP_H), strip);
        }
        let first_y = y + 0.5 * height + 5.5 - 0.5 * LINE_H * (lines.len() - 1) as f64;
        for (k, line) in lines.iter().enumerate() {
            let how = Text { color: self.ink, ..if k == 0 { FIRST } else { MORE } };
            canvas.text((x + 0.5 * width, first_y + LINE_H * k as f64), line, how);
        }
    }
}

/// Area of safe stops, hatched so that it is recognisable without colour.
fn stopped_area(canvas: &mut Canvas, at: At, size: (f64, f64)) {
    canvas.rect(at, size, Style::fill(color::PAPER).outlined(color::STOPPED, 1.0));
    canvas.hatch(at, size, Style::line(color::STOPPED, 0.8).lined_by(0.5));
}

/// Line of the legend: sign, width of the sign, meaning.
type Meaning = (fn(&mut Canvas, At), f64, String);

fn legend(grid: &Grid) -> Vec<Meaning> {
    let any = |has: fn(&Square) -> bool| grid.squares.iter().any(has);
    let budget_max = budget_max(grid);
    let grades = match budget_max {
        Some(max) => format!("largest added latency that still avoids, 0 to {max:.0} ms"),
        None => format!("share of runs that {}, 0 to 1", grid.good),
    };
    let mut lines: Vec<Meaning> = vec![(draw_grades, SIGN.0 * 11.0 + 8.0, grades)];
    if budget_max.is_none() {
        lines.push((|_, _| {}, 0.0, COUNTS.to_owned()));
    }
    if budget_max.is_none() && any(|square| square.stopped > 0) {
        lines.push((|canvas, at| stopped_area(canvas, at, SIGN), SIGN.0 + 8.0, STOPS.to_owned()));
    }
    if any(|square| square.plans.all > 0) {
        lines.push((|_, _| {}, 0.0, LAYER.to_owned()));
    }
    lines.extend(grid.note.iter().map(|note| -> Meaning { (|_, _| {}, 0.0, note.clone()) }));
    if any(|square| square.beyond_limit) {
        let sign = |canvas: &mut Canvas, at: At| canvas.rect(at, SIGN, beyond_rim(color::INK));
        lines.push((sign, SIGN.0 + 8.0, BEYOND.to_owned()));
    }
    lines
}

fn draw_grades(canvas: &mut Canvas, (x, y): At) {
    for i in 0..=10 {
        let fill = Style::fill(color::graded(0.1 * f64::from(i)));
        canvas.rect((x + SIGN.0 * f64::from(i), y), SIGN, fill);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(line: &str, name: &str) -> f64 {
        let (_, rest) = line.split_once(&format!(" {name}=\"")).unwrap();
        rest.split_once('"').unwrap().0.parse().unwrap()
    }

    /// Left and right edge of each square in a picture.
    fn squares(svg: &str) -> Vec<[f64; 2]> {
        let squares = svg.lines().filter(|line| line.contains("rx=\"4\""));
        squares.map(|line| [number(line, "x"), number(line, "x") + number(line, "width")]).collect()
    }

    /// Texts in the squares: left edge, right edge, text.
    fn texts(svg: &str) -> Vec<(f64, f64, &str)> {
        let ends = ["on the road", "impact", "timeout", "stopped", "gave_up"];
        let told = |line: &&str| line.contains(" of 5 (") || ends.iter().any(|end| line.contains(end));
        let texts = svg.lines().filter(|line| line.contains("\"middle\"") && told(line));
        let places = texts.map(|line| {
            let text = line.split_once('>').unwrap().1.split_once('<').unwrap().0;
            let how = if line.contains("bold") { FIRST } else { MORE };
            let (middle, half) = (number(line, "x"), 0.5 * width_of(text, how));
            (middle - half, middle + half, text)
        });
        places.collect()
    }

    #[test]
    fn texts_stay_within_their_squares_and_axes_have_names() {
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
            note: None,
        };
        let svg = draw(&grid, "t").svg();
        let (squares, texts) = (squares(&svg), texts(&svg));
        assert!(texts.len() >= 4, "{svg}");
        for (left, right, text) in texts {
            assert!(squares.iter().any(|[from, to]| *from <= left && right <= *to), "{text} in {squares:?}");
        }
        for told in ["0 on the road (0.00-0.43)", "impact 12.5 m/s (of 1)", "5 stopped (0.57-1.00)"] {
            assert!(svg.contains(told), "{told}: {svg}");
        }
        assert!(svg.contains(">policy latency_ms<") && svg.contains(">speed_mps<"));
        assert!(
            svg.contains(">5 of 5 (0.57-1.00)<")
                && svg.contains(">0 of 5 (0.00-0.43)<")
                && svg.contains(COUNTS)
        );
        assert!(svg.contains(&format!("stroke=\"{}\"", color::STOPPED)), "safe stops are hatched");
        assert_eq!(
            svg.matches(&format!("rx=\"4\" fill=\"{}\"", color::graded(1.0))).count(),
            1,
            "the success alone"
        );
    }
}
