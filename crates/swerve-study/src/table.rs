//! What a study comes to: `cells.csv`, a table for the terminal, a heat map.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;
use swerve_eval::Metrics;
use swerve_report::output::align;

use super::cells::CellResult;
use super::chance::interval;
use super::grid::{LIMIT, SCENARIO, Study};
use super::layer::{self, Plans};

/// The first columns behind the labels of a cell, of a drive and of a search for a latency budget.
const DRIVE: [&str; 10] = [
    "verdict",
    "no_collision",
    "on_road",
    "min_distance_m",
    "impact_speed_mps",
    "lateral_jerk_max",
    "digest",
    "response_p50_ms",
    "response_p99_ms",
    "misses",
];
const BUDGET: [&str; 3] = ["budget_ms", "budget_is_at_least", "verdict"];

/// Metrics that have a column whether any drive has them or not, so that tables of several studies have the same ones.
const ALWAYS: [&str; 13] = [
    "end",
    "impact.actor",
    "impact.at_s",
    "impact.closing_speed_mps",
    "impact.ego_speed_mps",
    "impact.impulse_n_s",
    "impact_name",
    "left_road_at_s",
    "min_distance_actor",
    "min_distance_name",
    "stands_before",
    STANDS_BEFORE,
    "waits_at_light",
];

/// The name of the actor that `stands_before` tells by its number.
const STANDS_BEFORE: &str = "stands_before_name";

/// What is known of the cells of a study, in columns.
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

    /// What a cell has in them, empty where it has nothing.
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

/// `cells.csv`: one line a finished cell, in the order of the study.
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

/// What `metrics.json` of a run says in words or as yes and no, by its names there, but for the verdict, which has a
/// column anyway; and before whom the car stands.
pub(crate) fn texts(metrics: &Metrics) -> BTreeMap<String, String> {
    let Ok(Value::Object(all)) = serde_json::to_value(metrics) else { return BTreeMap::new() };
    let text = |(name, value)| match value {
        Value::String(text) => Some((name, text)),
        Value::Bool(holds) => Some((name, holds.to_string())),
        _ => None,
    };
    let stands = metrics.actors.iter().find(|actor| Some(actor.actor) == metrics.stands_before);
    let stands = stands.map(|actor| (STANDS_BEFORE.to_owned(), actor.name.clone()));
    all.into_iter().filter_map(text).filter(|(name, _)| name != "verdict").chain(stands).collect()
}

/// The metrics of a run that are numbers by their names in `metrics.json`, but for those that have columns anyway and
/// those of actors and instants in a list; those of operators by the operator's name.
pub(crate) fn figures(metrics: &Metrics) -> BTreeMap<String, f64> {
    fn gather(prefix: &str, value: &Value, into: &mut BTreeMap<String, f64>) {
        match value {
            Value::Number(x) => drop(into.insert(prefix.to_owned(), x.as_f64().unwrap_or(f64::NAN))),
            Value::Object(inner) => {
                for (key, value) in inner {
                    let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                    gather(&name, value, into);
                }
            }
            _ => {}
        }
    }
    let mut all = BTreeMap::new();
    gather("", &serde_json::to_value(metrics).unwrap_or_default(), &mut all);
    let told = [
        "min_distance_m",
        "impact_speed_mps",
        "lateral_jerk.raw_max_mps3",
        "response.p50_ms",
        "response.p99_ms",
    ];
    for operator in &metrics.operators {
        let counts = [("steps", operator.steps), ("misses", operator.misses), ("drops", operator.drops)];
        let took = [("p50_ms", operator.p50_ms), ("p99_ms", operator.p99_ms), ("max_ms", operator.max_ms)];
        // Without a step there is no run time.
        let took = took.into_iter().filter(|_| operator.steps > 0);
        for (what, x) in counts.map(|(what, n)| (what, n as f64)).into_iter().chain(took) {
            all.insert(format!("operator.{}.{what}", operator.operator), x);
        }
    }
    all.retain(|name, x| x.is_finite() && !told.contains(&name.as_str()));
    all
}

/// With four decimals; what is whole, as every count is, with none.
fn number(x: Option<f64>) -> String {
    let text = |x: f64| if x.fract() == 0.0 { format!("{:.0}", x + 0.0) } else { format!("{x:.4}") };
    x.map_or_else(String::new, text)
}

pub(super) fn field(text: &str) -> String {
    if text.contains([',', '"', '\n']) { quoted(text) } else { text.to_owned() }
}

/// A text in quotes, as CSV has it.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// The study over two dimensions: seeds summed up, the last other axis across, the rest down.
pub struct Grid {
    /// Names of the axes that go down.
    pub row_axes: String,
    /// Name of the axis that goes across.
    pub column_axis: String,
    /// Row labels.
    pub rows: Vec<String>,
    /// Column labels.
    pub columns: Vec<String>,
    /// Row by row.
    pub squares: Vec<Square>,
    /// What is a good drive, for the legend.
    pub good: &'static str,
    /// What is to be known of the study as a whole; none where nothing is.
    pub note: Option<String>,
}

/// One square of the grid: all seeds of one combination.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Square {
    /// Runs with a result.
    pub runs: usize,
    /// Beside these, cells that failed: they have no result.
    pub failed: usize,
    /// Of the runs, avoided.
    pub avoided: usize,
    /// Of these, without a collision.
    pub no_collision: usize,
    /// Of these, with all of the ego on the road.
    pub on_road: usize,
    /// Of these, good: avoided, or what else counts as that.
    pub good: usize,
    /// Of these, neither good nor bad: the car stopped safely, where that does not count as good.
    pub stopped: usize,
    /// Of these, what neither avoided nor hit, by verdict: `left_road`, `stopped`, `timeout`.
    pub others: BTreeMap<String, usize>,
    /// Impact speeds of the others, m/s, sorted.
    pub impact_mps: Vec<f64>,
    /// Latency budgets, ms, sorted.
    pub budget_ms: Vec<f64>,
    /// How many of these, the last ones, are lower bounds.
    pub budget_bounds: usize,
    /// Whether the median budget is above that of the vehicle's own limit beside it.
    pub beyond_limit: bool,
    /// Plans of the runs; none where the comfortable layer made no plan of the whole study.
    pub plans: Plans,
}

impl Grid {
    /// Sums up the finished cells.
    pub fn of(study: &Study, results: &[Option<CellResult>]) -> Self {
        let shown: Vec<usize> = (0..study.axes.len()).filter(|&a| study.axes[a] != "seed").collect();
        // Scenarios alone are many, and their names long: they go down.
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

    /// The squares of one row.
    pub fn row(&self, row: usize) -> &[Square] {
        &self.squares[row * self.columns.len()..(row + 1) * self.columns.len()]
    }

    /// The table for the terminal.
    pub fn text(&self) -> String {
        let mut lines =
            vec![std::iter::once(self.row_axes.clone()).chain(self.columns.clone()).collect::<Vec<_>>()];
        for (i, row) in self.rows.iter().enumerate() {
            // What a square says stands line by line: beside each other the columns would be too wide for a terminal.
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
        if self.squares.iter().any(|square| square.budget_ms.is_empty() && square.runs > 0) {
            text += "without a collision, on the road, median impact (of how many), what else came of it; 95 % intervals\n";
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
        self.budget_ms.extend(result.budget_ms);
        let is_bound = |ms| study.budget.as_ref().is_some_and(|budget| budget.is_bound(ms));
        self.budget_bounds += usize::from(result.budget_ms.is_some_and(is_bound));
    }

    /// What the two counts do not tell: verdicts other than `left_road` with their intervals, failures, which are no runs,
    /// and the share of the comfortable layer.
    pub(super) fn rest(&self) -> impl Iterator<Item = String> {
        let rest = self.others.iter().filter(|(verdict, _)| *verdict != "left_road");
        let failed = (self.failed > 0).then(|| format!("{} failed", self.failed));
        rest.map(|(verdict, n)| format!("{n} {verdict} {}", interval(*n, self.runs)))
            .chain(failed)
            .chain(self.plans.text())
    }

    /// The median impact speed, and of how many.
    pub(super) fn impact_text(&self) -> Option<String> {
        let impact = self.impact_median_mps()?;
        Some(format!("impact {impact:.1} m/s (of {})", self.impact_mps.len()))
    }

    /// Share of good runs among those that are good or bad, 0 to 1; `None` where there are none.
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

    /// Median latency budget with its unit, and the range; where nothing failed, that it is a lower bound.
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

    /// What it says, in one line.
    pub fn text(&self) -> String {
        self.lines().join(", ")
    }

    /// What stands in the terminal's table, line by line.
    fn lines(&self) -> Vec<String> {
        let failed = (self.failed > 0).then(|| format!("{} failed", self.failed));
        if self.runs == 0 {
            return vec![failed.unwrap_or_else(|| "-".into())];
        }
        if let Some([median, range]) = self.budget_text() {
            let budget = format!("{median} ({range}, {}/{})", self.avoided, self.runs);
            return core::iter::once(budget).chain(failed).collect();
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
