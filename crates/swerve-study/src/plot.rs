//! `[plot]` of a study: the mean of a metric over a numeric axis, with its 95 % interval.

use std::fmt::Write as _;

use swerve_draw::color::{Look, looks_repeat, series as look_of};
use swerve_draw::{Axes, Canvas, Picture, Style, Text, names_beside, number};
use swerve_report::output::align;

use crate::chance::{student_95, wilson};
use crate::csv::field;
use crate::grid::Study;
use crate::result::CellResult;
use crate::table::Columns;
use crate::tables::Plot;

/// Means of a study's plot.
pub(crate) struct Means<'a> {
    title: &'a str,
    plot: &'a Plot,
    lines: Vec<Line>,
}

/// Points of one combination of the axes in `lines`.
struct Line {
    name: String,
    points: Vec<Point>,
}

/// All drives at one value of the axis.
struct Point {
    x: f64,
    values: Vec<f64>,
    /// True if the values are booleans.
    is_share: bool,
}

impl Point {
    fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len() as f64
    }

    /// Interval of 95 %: of a mean by Student's t (1908), of a share by Wilson (1927). Of a single number, the number.
    fn interval(&self) -> [f64; 2] {
        let (n, mean) = (self.values.len(), self.mean());
        if self.is_share {
            let (low, high) = wilson(self.values.iter().sum::<f64>() as usize, n);
            return [low, high];
        }
        let squares: f64 = self.values.iter().map(|value| (value - mean) * (value - mean)).sum();
        let half = if n > 1 { student_95(n - 1) * (squares / (n - 1) as f64 / n as f64).sqrt() } else { 0.0 };
        [mean - half, mean + half]
    }

    /// The mean, its interval, and the number of drives, as a cell of a table.
    fn text(&self) -> String {
        let ([low, high], mean, n) = (self.interval(), self.mean(), self.values.len());
        match (self.is_share, n) {
            (true, _) => format!("{mean:.2} ({low:.2}-{high:.2}, {n})"),
            (false, 1) => format!("{mean:.1} (1)"),
            (false, _) => format!("{mean:.1} \u{b1}{:.1} ({n})", high - mean),
        }
    }
}

impl<'a> Means<'a> {
    /// Collects the finished drives that have the metric; all axes but that of the plot and those of its lines are
    /// pooled.
    pub(crate) fn of(study: &'a Study, plot: &'a Plot, results: &[Option<CellResult>]) -> Self {
        let columns = Columns::of(study, results);
        let column = columns.names().iter().position(|name| *name == plot.y);
        let axis = |name: &String| study.axes.iter().position(|axis| axis == name);
        let (over, named) = (axis(&plot.x), plot.lines.iter().filter_map(axis).collect::<Vec<_>>());
        let mut lines: Vec<Line> = Vec::new();
        for result in results.iter().flatten() {
            let value = column.and_then(|column| numeric(&columns.row(study, result)[column]));
            let x = over.and_then(|axis| result.labels[axis].parse().ok());
            let (Some(x), Some(value)) = (x, value) else { continue };
            let name = named.iter().map(|&axis| result.labels[axis].as_str()).collect::<Vec<_>>().join(", ");
            let new = || Line { name: name.clone(), points: Vec::new() };
            let line = found_or(&mut lines, |line| line.name == name, new);
            let new = || Point { x, values: Vec::new(), is_share: value.1 };
            found_or(&mut line.points, |point| point.x == x, new).values.push(value.0);
        }
        for line in &mut lines {
            line.points.sort_by(|a, b| a.x.total_cmp(&b.x));
        }
        let title = if study.description.is_empty() { &study.name } else { &study.description };
        Self { title, plot, lines }
    }

    /// Values of the axis, rising.
    fn all_x(&self) -> Vec<f64> {
        let mut all: Vec<f64> =
            self.lines.iter().flat_map(|line| &line.points).map(|point| point.x).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// Means with their intervals and numbers of drives, one row per line.
    pub(crate) fn text(&self) -> String {
        if self.lines.is_empty() {
            return format!("plot: no drive has a number in the column `{}` of cells.csv\n", self.plot.y);
        }
        let all_x = self.all_x();
        let head = [format!("{} over {}", self.plot.y, self.plot.x)].into_iter();
        let mut rows = vec![head.chain(all_x.iter().map(|&x| number(x))).collect::<Vec<_>>()];
        for line in &self.lines {
            let cell = |x: &f64| match line.points.iter().find(|point| point.x == *x) {
                None => "-".to_owned(),
                Some(point) => point.text(),
            };
            rows.push([line.name.clone()].into_iter().chain(all_x.iter().map(cell)).collect());
        }
        align(&rows) + "means, their 95 % intervals, and numbers of drives\n"
    }

    /// CSV with one row per point.
    pub(crate) fn csv(&self) -> String {
        let mut csv = "line,x,mean,low,high,drives\n".to_owned();
        for line in &self.lines {
            for point in &line.points {
                let ([low, high], name) = (point.interval(), field(&line.name));
                let (mean, count) = (point.mean(), point.values.len());
                let _infallible = writeln!(csv, "{name},{},{mean:.6},{low:.6},{high:.6},{count}", point.x);
            }
        }
        csv
    }

    /// Draws the means with their intervals as bars.
    pub(crate) fn draw(&self) -> Picture {
        let mut canvas = Canvas::default();
        canvas.text((LEFT, 28.0), self.title, Text::TITLE);
        let note = looks_repeat(self.lines.len()).map_or_else(String::new, |note| format!(" ({note})"));
        canvas.text((LEFT, 46.0), &format!("means with their 95 % intervals{note}"), Text::SOFT);
        let axes = self.axes();
        let heading = self.plot.label.as_ref().unwrap_or(&self.plot.y);
        axes.panel(&mut canvas, (10.0, 6.0), (heading, &self.plot.x));
        let mut names = Vec::new();
        for (k, line) in self.lines.iter().enumerate() {
            draw_line(&axes, &mut canvas, line, look_of(k));
            names.push((look_of(k).line(LINE_W), line.name.clone()));
        }
        if self.plot.lines.is_empty() {
            names.clear();
        }
        let used = names_beside(&mut canvas, (LEFT + WIDTH + 12.0, TOP), &names);
        canvas.finish(LEFT + WIDTH + 12.0 + used + 16.0, TOP + HEIGHT + 44.0, self.title)
    }

    /// Axes with room around the first and the last value; the second one begins at zero unless values are negative.
    fn axes(&self) -> Axes {
        let all_x = self.all_x();
        let (from, to) = (all_x.first().copied().unwrap_or(0.0), all_x.last().copied().unwrap_or(1.0));
        let margin = if to > from { 0.03 * (to - from) } else { 0.5 };
        let ends = || self.lines.iter().flat_map(|line| &line.points).flat_map(Point::interval);
        let (least, most) = (ends().fold(0.0_f64, f64::min), ends().fold(f64::NEG_INFINITY, f64::max));
        let most = if most > least { most + 0.05 * (most - least) } else { least + 1.0 };
        Axes { corner: (LEFT, TOP), size: (WIDTH, HEIGHT), x: (from - margin, to + margin), y: (least, most) }
    }
}

/// A number, or a boolean as 0 or 1, so that its mean is a share; with true for booleans.
fn numeric(text: &str) -> Option<(f64, bool)> {
    match text {
        "true" => Some((1.0, true)),
        "false" => Some((0.0, true)),
        text => text.parse().ok().filter(|value: &f64| value.is_finite()).map(|value| (value, false)),
    }
}

/// The item that `is` true for, added if there is none.
fn found_or<T>(items: &mut Vec<T>, is: impl Fn(&T) -> bool, new: impl FnOnce() -> T) -> &mut T {
    let at = items.iter().position(is).unwrap_or_else(|| {
        items.push(new());
        items.len() - 1
    });
    &mut items[at]
}

const LEFT: f64 = 64.0;
const TOP: f64 = 80.0;
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 300.0;
/// Half widths of the ends of an interval's bar, and of the mark at its mean, pixels.
const CAP: f64 = 4.0;
const MARK: f64 = 2.5;

/// Width of a line.
const LINE_W: f64 = 1.8;

fn draw_line(axes: &Axes, canvas: &mut Canvas, line: &Line, look: Look) {
    canvas.path(line.points.iter().map(|point| axes.at(point.x, point.mean())), false, look.line(LINE_W));
    let bar = Style::line(look.color, 1.0);
    for point in &line.points {
        let [low, high] = point.interval().map(|end| axes.at(point.x, end));
        canvas.line(low, high, bar);
        for (x, y) in [low, high] {
            canvas.line((x - CAP, y), (x + CAP, y), bar);
        }
        let (x, y) = axes.at(point.x, point.mean());
        canvas.rect((x - MARK, y - MARK), (2.0 * MARK, 2.0 * MARK), Style::fill(look.color));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two lines over two seeds; the value of each drive is its seed.
    #[test]
    fn points_are_means_with_the_interval_of_student() {
        let study = crate::table::tests::study();
        let (speed, seed) = ("speed_mps".to_owned(), "seed".to_owned());
        assert!(study.axes.contains(&seed), "{:?}", study.axes);
        let of = |cell: &crate::grid::Cell| {
            let seed: f64 =
                cell.labels[study.axes.iter().position(|a| *a == "seed").unwrap()].parse().unwrap();
            Some(CellResult { impact_speed_mps: Some(seed), ..CellResult::blank(cell, "collision") })
        };
        let results: Vec<_> = study.cells.iter().map(of).collect();
        let plot = Plot { x: seed, y: "impact_speed_mps".into(), lines: vec![speed], label: None };
        let means = Means::of(&study, &plot, &results);
        assert_eq!(means.lines.iter().map(|line| line.name.as_str()).collect::<Vec<_>>(), ["16", "18"]);
        for line in &means.lines {
            assert!(line.points.iter().all(|point| point.mean() == point.x), "{}", line.name);
        }
        assert_eq!(means.csv().lines().count(), 1 + means.lines.len() * means.all_x().len());
        // A column that no drive has is told, and nothing fails.
        let plot = Plot { y: "impact_sped".into(), ..plot };
        let none = Means::of(&study, &plot, &results);
        assert!(none.text().contains("no drive has a number in the column `impact_sped`"));
        assert!(none.draw().svg().contains("impact_sped"));
    }

    /// Mean 2.5, standard deviation sqrt(5 / 3), t of 3 degrees of freedom 3.182: half of 1.291 * 3.182 = 2.054.
    #[test]
    fn intervals_of_means_and_shares() {
        let point = |values: &[f64], is_share| Point { x: 0.0, values: values.to_vec(), is_share };
        let four = point(&[1.0, 2.0, 3.0, 4.0], false);
        assert!((four.interval()[1] - 2.5 - 2.054).abs() < 1e-3);
        assert_eq!(four.text(), "2.5 \u{b1}2.1 (4)");
        assert_eq!(point(&[7.0], false).text(), "7.0 (1)");
        assert_eq!(point(&[0.0; 4], true).text(), "0.00 (0.00-0.49, 4)");
        let read = ["true", "false", "", "3"].map(numeric);
        assert_eq!(read, [Some((1.0, true)), Some((0.0, true)), None, Some((3.0, false))]);
    }
}
