//! Results of a timely study as text, rows and a picture, with quartiles over all comparisons of all seeds.

use std::fmt::Write as _;

use swerve_draw::color::{Look, looks_repeat, series};
use swerve_draw::{At, Axes, Canvas, Picture, Style, Text, names_beside, number};
use swerve_report::output::align;

use crate::csv::quoted;
use crate::curve::quartiles;
use crate::grid::Study;
use crate::result::CellResult;
use crate::tables::Timely;

/// Line in the picture: one combination of the axes, under one measure.
struct Line {
    panel: String,
    name: String,
    points: Vec<Point>,
}

struct Point {
    x: f64,
    values: Vec<f64>,
}

/// All results as lines.
pub(crate) struct Chart<'a> {
    title: &'a str,
    /// Quantity on the x axis.
    over: String,
    /// True if the lines are alternatives: over an axis, each is another choice at the same run time.
    is_contest: bool,
    lines: Vec<Line>,
}

impl<'a> Chart<'a> {
    /// Collects the finished cells; seeds are pooled.
    pub(crate) fn of(study: &'a Study, timely: &Timely, results: &[Option<CellResult>]) -> Self {
        let by_time =
            if timely.run_times_ms.is_empty() { "share of published run time" } else { "run time, ms" };
        let over = study.axes.iter().position(|axis| timely.over.as_ref() == Some(axis));
        let mut lines: Vec<Line> = Vec::new();
        for result in results.iter().flatten() {
            let named = (0..study.axes.len()).filter(|&a| study.axes[a] != "seed" && Some(a) != over);
            let name = named
                .map(|a| format!("{} {}", study.axes[a], result.labels[a]))
                .collect::<Vec<_>>()
                .join(", ");
            for reading in &result.timely {
                let label = over.and_then(|axis| result.labels[axis].parse().ok());
                let (panel, x) = match label {
                    Some(x) => (format!("{}, {by_time} {}", reading.series, number(reading.at)), x),
                    None => (reading.series.clone(), reading.at),
                };
                let found = lines.iter().position(|line| line.panel == panel && line.name == name);
                let line = found.unwrap_or_else(|| {
                    lines.push(Line { panel, name: name.clone(), points: Vec::new() });
                    lines.len() - 1
                });
                let points = &mut lines[line].points;
                match points.iter_mut().find(|point| point.x == x) {
                    Some(point) => point.values.extend(&reading.values),
                    None => points.push(Point { x, values: reading.values.clone() }),
                }
            }
        }
        let title = if study.description.is_empty() { &study.name } else { &study.description };
        let is_contest = over.is_some();
        Self { title, over: over.map_or(by_time.into(), |axis| study.axes[axis].clone()), is_contest, lines }
    }

    /// Panels, in the order of the cells.
    fn panels(&self) -> Vec<&str> {
        let mut panels: Vec<&str> = Vec::new();
        for line in &self.lines {
            if !panels.contains(&line.panel.as_str()) {
                panels.push(&line.panel);
            }
        }
        panels
    }

    fn lines_of<'b>(&'b self, panel: &'b str) -> impl Iterator<Item = &'b Line> {
        self.lines.iter().filter(move |line| line.panel == panel)
    }

    /// Medians with quartiles, one table per panel; over an axis with several lines, also the best line at each point.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        for panel in self.panels() {
            let lines: Vec<&Line> = self.lines_of(panel).collect();
            let mut head = vec![format!("{panel} over {}", self.over)];
            head.extend(lines[0].points.iter().map(|point| number(point.x)));
            let mut rows = vec![head];
            rows.extend(lines.iter().map(|line| {
                let cells = line.points.iter().map(|point| match point.quartiles() {
                    Some([low, mid, high]) if low < high => format!("{mid:.2} ({low:.2}-{high:.2})"),
                    Some([_, mid, _]) => format!("{mid:.2}"),
                    None => "-".into(),
                });
                std::iter::once(line.name.clone()).chain(cells).collect()
            }));
            if self.is_contest && lines.len() > 1 {
                let best = |k: usize| best(&lines, k).map_or("-".into(), |line| line.name.clone());
                let cells = (0..lines[0].points.len()).map(best);
                rows.push(std::iter::once("best".to_owned()).chain(cells).collect());
            }
            text += &align(&rows);
            text.push('\n');
        }
        text
    }

    /// CSV with one row per point.
    pub(crate) fn csv(&self) -> String {
        let mut csv = "panel,line,x,lower_quartile,median,upper_quartile,values\n".to_owned();
        for line in &self.lines {
            for point in &line.points {
                let quartiles = point
                    .quartiles()
                    .map_or([String::new(), String::new(), String::new()], |q| q.map(|x| format!("{x:.6}")));
                let _infallible = writeln!(
                    csv,
                    "{},{},{},{},{}",
                    quoted(&line.panel),
                    quoted(&line.name),
                    point.x,
                    quartiles.join(","),
                    point.values.len()
                );
            }
        }
        csv
    }

    /// Draws one panel per measure, with one line and its quartiles per combination.
    pub(crate) fn draw(&self) -> Picture {
        let mut canvas = Canvas::default();
        canvas.text((LEFT, 28.0), self.title, Text::TITLE);
        let rows = self.rows();
        let most = rows.iter().flatten().map(|panel| self.lines_of(panel).count()).max().unwrap_or(0);
        let note = looks_repeat(most).map_or_else(String::new, |note| format!(" ({note})"));
        canvas.text((LEFT, 46.0), &format!("medians, and between the quartiles{note}"), Text::SOFT);
        let columns = rows.iter().map(Vec::len).max().unwrap_or(1);
        let panel_w = (WIDTH - GAP_X * (columns - 1) as f64) / columns as f64;
        let mut names_w = 0.0_f64;
        for (row, panels) in rows.iter().enumerate() {
            let top = TOP + row as f64 * (PANEL_H + GAP_Y);
            for (column, panel) in panels.iter().enumerate() {
                let lines: Vec<&Line> = self.lines_of(panel).collect();
                let scale = axes_of(&lines, (LEFT + column as f64 * (panel_w + GAP_X), top), panel_w);
                scale.panel(&mut canvas, (ACROSS / columns as f64, UPWARDS), (panel, &self.over));
                for (k, line) in lines.iter().enumerate() {
                    draw_line(&scale, &mut canvas, line, series(k));
                }
            }
            let of_row = panels.first().into_iter().flat_map(|panel| self.lines_of(panel)).enumerate();
            let names: Vec<(Style, String)> =
                of_row.map(|(k, line)| (series(k).line(LINE_W), line.name.clone())).collect();
            names_w = names_w.max(names_beside(&mut canvas, (LEFT + WIDTH + 12.0, top), &names));
        }
        let height = TOP + rows.len() as f64 * (PANEL_H + GAP_Y) - 10.0;
        canvas.finish(LEFT + WIDTH + 12.0 + names_w + 16.0, height, self.title)
    }

    /// Panels in rows: the `start` and `end` anchors of a measure are side by side.
    fn rows(&self) -> Vec<Vec<&str>> {
        let panels = self.panels();
        let (ends, starts): (Vec<&str>, Vec<&str>) = panels.iter().partition(|panel| panel.contains(" end"));
        if starts.len() == ends.len() {
            return starts.into_iter().zip(ends).map(|(start, end)| vec![start, end]).collect();
        }
        panels.into_iter().map(|panel| vec![panel]).collect()
    }
}

impl Point {
    fn quartiles(&self) -> Option<[f64; 3]> {
        (!self.values.is_empty()).then(|| quartiles(self.values.clone()))
    }
}

/// Line with the largest median at a point; the first of equal ones.
fn best<'a>(lines: &[&'a Line], point: usize) -> Option<&'a Line> {
    let median = |line: &Line| line.points.get(point)?.quartiles().map(|quartiles| quartiles[1]);
    let known = lines.iter().filter_map(|line| Some((median(line)?, *line)));
    let largest = known.reduce(|best, next| if next.0 > best.0 { next } else { best });
    largest.map(|(_, line)| line)
}

const LEFT: f64 = 64.0;
const TOP: f64 = 80.0;
/// Width of all panels in a row, pixels.
const WIDTH: f64 = 760.0;
const PANEL_H: f64 = 200.0;
const GAP_X: f64 = 52.0;
const GAP_Y: f64 = 64.0;
/// Approximate number of ticks: over all panels in a row, and upwards.
const ACROSS: f64 = 10.0;
const UPWARDS: f64 = 5.0;

/// Width of a line.
const LINE_W: f64 = 1.6;

/// Axes of a panel; the y axis covers at least 0 to 1.
fn axes_of(lines: &[&Line], corner: At, width: f64) -> Axes {
    let points = || lines.iter().flat_map(|line| &line.points);
    let least = points().filter_map(Point::quartiles).fold(0.0_f64, |least, q| least.min(q[0]));
    let [from, to] = points().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], p| [a.min(p.x), b.max(p.x)]);
    let x = (from, if to > from { to } else { from + 1.0 });
    Axes { corner, size: (width, PANEL_H), x, y: (least, 1.0) }
}

fn draw_line(axes: &Axes, canvas: &mut Canvas, line: &Line, look: Look) {
    let known: Vec<(f64, [f64; 3])> =
        line.points.iter().filter_map(|point| Some((point.x, point.quartiles()?))).collect();
    let low = known.iter().map(|(x, q)| axes.at(*x, q[0]));
    let high = known.iter().rev().map(|(x, q)| axes.at(*x, q[2]));
    canvas.path(low.chain(high), true, Style::fill(look.color).filled_by(0.12));
    canvas.path(known.iter().map(|(x, q)| axes.at(*x, q[1])), false, look.line(LINE_W));
}
