//! Results of a study as `cells.csv`, as a table for the terminal and as a grid.

use std::collections::{BTreeMap, BTreeSet};

use swerve_report::output::align;

use super::chance::interval;
use super::columns::{ALWAYS, DRIVE};
use super::csv::field;
use super::grid::{LIMIT, SCENARIO, Study};
use super::layer::{self, Plans};
use super::result::CellResult;

/// First columns after a cell's labels for latency budgets; for drives, [`DRIVE`].
const BUDGET: [&str; 3] = ["budget_ms", "budget_is_at_least", "verdict"];

/// Columns of a study's cells.
pub(crate) struct Columns {
    fixed: &'static [&'static str],
    more: BTreeSet<String>,
}

impl Columns {
    pub(crate) fn of(study: &Study, results: &[Option<CellResult>]) -> Self {
        if study.budget.is_some() {
            return Self { fixed: &BUDGET, more: BTreeSet::new() };
        }
        let found =
            results.iter().flatten().flat_map(|result| result.figures.keys().chain(result.texts.keys()));
        let more = found.cloned().chain(ALWAYS.map(str::to_owned)).collect();
        Self { fixed: &DRIVE, more }
    }

    pub(crate) fn names(&self) -> Vec<String> {
        self.fixed.iter().map(|name| (*name).to_owned()).chain(self.more.iter().cloned()).collect()
    }

    /// Values of a cell in these columns; empty where missing.
    pub(crate) fn row(&self, study: &Study, result: &CellResult) -> Vec<String> {
        if let Some(budget) = &study.budget {
            let bound = result.budget_ms.map_or_else(String::new, |ms| budget.is_bound(ms).to_string());
            return vec![number(result.budget_ms), bound, result.verdict.clone()];
        }
        let of_drive = |text: String| if result.error.is_none() { text } else { String::new() };
        let mut row = vec![
            result.verdict.clone(),
            of_drive(result.no_collision.to_string()),
            of_drive(result.on_road.to_string()),
            number(result.min_distance_m),
            number(result.impact_speed_mps),
            number(result.lateral_jerk_max),
            result.digest.map_or_else(String::new, |d| d.to_string()),
            number(result.response_p50_ms),
            number(result.response_p99_ms),
            of_drive(result.misses.to_string()),
        ];
        row.extend(self.more.iter().map(|name| match result.texts.get(name) {
            Some(text) => text.clone(),
            None => number(result.figures.get(name).copied()),
        }));
        row
    }
}

/// `cells.csv`: one line per finished cell, in the order of the study.
pub fn csv(study: &Study, results: &[Option<CellResult>]) -> String {
    let columns = Columns::of(study, results);
    let head = study.axes.iter().cloned().chain(columns.names()).collect::<Vec<_>>();
    let rows = results
        .iter()
        .flatten()
        .map(|result| result.labels.iter().cloned().chain(columns.row(study, result)).collect::<Vec<_>>());
    let line = |cells: Vec<String>| cells.iter().map(|cell| field(cell)).collect::<Vec<_>>().join(",") + "\n";
    core::iter::once(head).chain(rows).map(line).collect()
}

/// Number with four decimals; integers without any.
fn number(x: Option<f64>) -> String {
    let text = |x: f64| if x.fract() == 0.0 { format!("{:.0}", x + 0.0) } else { format!("{x:.4}") };
    x.map_or_else(String::new, text)
}

/// Study in two dimensions: seeds are pooled, the last other axis is in columns, the rest in rows.
pub struct Grid {
    /// Names of the row axes.
    pub row_axes: String,
    /// Name of the column axis.
    pub column_axis: String,
    /// Row labels.
    pub rows: Vec<String>,
    /// Column labels.
    pub columns: Vec<String>,
    /// Squares, row by row.
    pub squares: Vec<Square>,
    /// Definition of a good drive, for the legend.
    pub good: &'static str,
    /// Note on the study as a whole.
    pub note: Option<String>,
}

/// Square of the grid: all seeds of one combination.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Square {
    /// Runs with a result.
    pub runs: usize,
    /// Failed cells, in addition to the runs.
    pub failed: usize,
    /// Number of runs that ended well.
    pub avoided: usize,
    /// Number of runs without a collision.
    pub no_collision: usize,
    /// Number of runs with the whole ego on the road.
    pub on_road: usize,
    /// Number of good runs: those that ended well, and others that the study counts as good.
    pub good: usize,
    /// Number of runs neither good nor bad: safe stops that do not count as good.
    pub stopped: usize,
    /// Numbers of runs that neither ended well nor hit, by verdict: `left_road`, `stopped`, `timeout`.
    pub others: BTreeMap<String, usize>,
    /// Impact speeds of the runs with a collision, m/s, sorted.
    pub impact_mps: Vec<f64>,
    /// True if the drives are searches for a latency budget.
    pub seeks_budget: bool,
    /// Latency budgets, ms, sorted; those without one fail without added latency.
    pub budget_ms: Vec<f64>,
    /// Number of these, at the end, that are lower bounds.
    pub budget_bounds: usize,
    /// True if the median budget exceeds that of the vehicle's own limit in the same row or column.
    pub beyond_limit: bool,
    /// Plans of the runs; zero if the comfortable layer made no plan in the whole study.
    pub plans: Plans,
}

impl Grid {
    /// Aggregates the finished cells.
    pub fn of(study: &Study, results: &[Option<CellResult>]) -> Self {
        let shown: Vec<usize> = (0..study.axes.len()).filter(|&a| study.axes[a] != "seed").collect();
        // Scenarios alone are many with long names, so they are in rows.
        let is_down = matches!(shown[..], [axis] if study.axes[axis] == SCENARIO);
        let (down, across) = shown.split_at(if is_down { 1 } else { shown.len().saturating_sub(1) });
        let row_of =
            |labels: &[String]| down.iter().map(|&a| labels[a].as_str()).collect::<Vec<_>>().join(" ");
        let column_of =
            |labels: &[String]| across.first().map_or_else(|| "all".into(), |&a| labels[a].clone());
        let mut grid = Self {
            row_axes: down.iter().map(|&a| study.axes[a].as_str()).collect::<Vec<_>>().join(" "),
            column_axis: across.first().map_or_else(String::new, |&a| study.axes[a].clone()),
            rows: unique(study.cells.iter().map(|c| row_of(&c.labels))),
            columns: unique(study.cells.iter().map(|c| column_of(&c.labels))),
            squares: Vec::new(),
            good: match (study.timeout_is_good, study.off_road_is_good) {
                (false, false) => "avoided",
                (true, false) => "avoided, stopped or ran out of time",
                (false, true) => "avoided or left the road without a collision",
                (true, true) => "ended without a collision",
            },
            note: layer::note(study, results),
        };
        grid.squares = vec![Square::default(); grid.rows.len() * grid.columns.len()];
        for result in results.iter().flatten() {
            let row = grid.rows.iter().position(|r| *r == row_of(&result.labels));
            let column = grid.columns.iter().position(|c| *c == column_of(&result.labels));
            if let (Some(row), Some(column)) = (row, column) {
                let at = row * grid.columns.len() + column;
                grid.squares[at].add(result, study);
            }
        }
        let has_layer = grid.squares.iter().any(|square| square.plans.comfortable > 0);
        for square in &mut grid.squares {
            if !has_layer {
                square.plans = Plans::default();
            }
            square.impact_mps.sort_by(f64::total_cmp);
            square.budget_ms.sort_by(f64::total_cmp);
        }
        let limited = study.budget.as_ref().and_then(|budget| budget.limit.as_ref());
        if let Some(axis) = limited.and_then(|name| study.axes.iter().position(|axis| axis == name)) {
            let at = |labels: &[String]| {
                let row = grid.rows.iter().position(|r| *r == row_of(labels))?;
                Some(row * grid.columns.len() + grid.columns.iter().position(|c| *c == column_of(labels))?)
            };
            let median = |at: usize| grid.squares[at].budget_median_ms();
            let beyond = |result: &CellResult| {
                let mut labels = result.labels.clone();
                LIMIT.clone_into(&mut labels[axis]);
                let (square, limit) = (at(&result.labels)?, at(&labels)?);
                (median(square)? > median(limit)?).then_some(square)
            };
            let marked: Vec<usize> = results.iter().flatten().filter_map(beyond).collect();
            marked.into_iter().for_each(|square| grid.squares[square].beyond_limit = true);
        }
        grid
    }

    /// Squares of one row.
    pub fn row(&self, row: usize) -> &[Square] {
        &self.squares[row * self.columns.len()..(row + 1) * self.columns.len()]
    }

    /// Table for the terminal.
    pub fn text(&self) -> String {
        let mut lines =
            vec![std::iter::once(self.row_axes.clone()).chain(self.columns.clone()).collect::<Vec<_>>()];
        for (i, row) in self.rows.iter().enumerate() {
            // Lines are stacked, since side by side they would be too wide for a terminal.
            let said: Vec<Vec<String>> = self.row(i).iter().map(Square::lines).collect();
            for k in 0..said.iter().map(Vec::len).max().unwrap_or(0) {
                let name = if k == 0 { row.clone() } else { String::new() };
                let cells = said.iter().map(|lines| lines.get(k).cloned().unwrap_or_default());
                lines.push(std::iter::once(name).chain(cells).collect());
            }
        }
        let mut text = align(&lines);
        if !self.column_axis.is_empty() {
            text = format!("{:>width$}\n{text}", self.column_axis, width = text.find('\n').unwrap_or(0));
        }
        if self.squares.iter().any(|square| !square.seeks_budget && square.runs > 0) {
            text += "without a collision, on the road, median impact (of how many), other outcomes; 95 % intervals\n";
        }
        if let Some(note) = &self.note {
            text += &format!("{note}\n");
        }
        text
    }
}

impl Square {
    fn add(&mut self, result: &CellResult, study: &Study) {
        if result.error.is_some() {
            self.failed += 1;
            return;
        }
        self.runs += 1;
        self.avoided += usize::from(result.avoided());
        self.no_collision += usize::from(result.no_collision);
        self.on_road += usize::from(result.on_road);
        self.plans.add(Plans::of(result));
        let good = match result.verdict.as_str() {
            "stopped" | "timeout" => study.timeout_is_good,
            "left_road" => study.off_road_is_good,
            _ => result.avoided(),
        };
        self.good += usize::from(good);
        self.stopped += usize::from(result.verdict == "stopped" && !good);
        if !result.avoided() && result.verdict != "collision" {
            *self.others.entry(result.verdict.clone()).or_default() += 1;
        }
        self.impact_mps.extend(result.impact_speed_mps.filter(|_| result.verdict == "collision"));
        self.seeks_budget = study.budget.is_some();
        self.budget_ms.extend(result.budget_ms);
        let is_bound = |ms| study.budget.as_ref().is_some_and(|budget| budget.is_bound(ms));
        self.budget_bounds += usize::from(result.budget_ms.is_some_and(is_bound));
    }

    /// Facts beyond the two counts: verdicts other than `left_road` with their intervals, failed cells, and the share
    /// of the comfortable layer.
    pub(super) fn rest(&self) -> impl Iterator<Item = String> {
        let rest = self.others.iter().filter(|(verdict, _)| *verdict != "left_road");
        let failed = (self.failed > 0).then(|| format!("{} failed", self.failed));
        rest.map(|(verdict, n)| format!("{n} {verdict} {}", interval(*n, self.runs)))
            .chain(failed)
            .chain(self.plans.text())
    }

    /// Median impact speed and the number of impacts.
    pub(super) fn impact_text(&self) -> Option<String> {
        let impact = self.impact_median_mps()?;
        Some(format!("impact {impact:.1} m/s (of {})", self.impact_mps.len()))
    }

    /// Share of good runs among those that are good or bad, 0 to 1; `None` if there are none.
    pub fn share(&self) -> Option<f64> {
        let decided = self.runs - self.stopped;
        (decided > 0).then(|| self.good as f64 / decided as f64)
    }

    /// Median impact speed of the runs that hit, m/s.
    pub fn impact_median_mps(&self) -> Option<f64> {
        let (low, high) = (self.impact_mps.len().checked_sub(1)? / 2, self.impact_mps.len() / 2);
        Some(0.5 * (self.impact_mps[low] + self.impact_mps[high]))
    }

    /// Median latency budget, ms.
    pub fn budget_median_ms(&self) -> Option<f64> {
        self.budget_ms.get(self.budget_ms.len() / 2).copied()
    }

    /// Median latency budget with its unit, and the range; marked as lower bounds where no latency failed.
    pub(super) fn budget_text(&self) -> Option<[String; 2]> {
        let (low, median, high) = (self.budget_ms.first()?, self.budget_median_ms()?, self.budget_ms.last()?);
        let (n, exact) = (self.budget_ms.len(), self.budget_ms.len() - self.budget_bounds);
        let at_least = if n / 2 >= exact { "at least " } else { "" };
        let range = match exact {
            0 => format!("{low:.0} or more"),
            _ if exact < n => format!("{low:.0}-{high:.0} or more"),
            _ => format!("{low:.0}-{high:.0}"),
        };
        Some([format!("{at_least}{median:.0} ms"), range])
    }

    /// Content of the square in one line.
    pub fn text(&self) -> String {
        self.lines().join(", ")
    }

    /// Content of the square in the terminal's table, line by line.
    fn lines(&self) -> Vec<String> {
        let failed = (self.failed > 0).then(|| format!("{} failed", self.failed));
        if self.runs == 0 {
            return vec![failed.unwrap_or_else(|| "-".into())];
        }
        if let Some([median, range]) = self.budget_text() {
            let budget = format!("{median} ({range}, {}/{})", self.budget_ms.len(), self.runs);
            return core::iter::once(budget).chain(failed).collect();
        }
        if self.seeks_budget {
            return core::iter::once(format!("none (0/{})", self.runs)).chain(failed).collect();
        }
        let [hit_nothing, on_road] = [self.no_collision, self.on_road].map(|n| interval(n, self.runs));
        let mut lines = vec![
            format!("{}/{} {hit_nothing}", self.no_collision, self.runs),
            format!("{} on road {on_road}", self.on_road),
        ];
        lines.extend(self.impact_text());
        lines.extend(self.rest());
        lines
    }
}

fn unique(items: impl Iterator<Item = String>) -> Vec<String> {
    let mut seen = Vec::new();
    for item in items {
        if !seen.contains(&item) {
            seen.push(item);
        }
    }
    seen
}

#[cfg(test)]
pub(crate) mod tests;
