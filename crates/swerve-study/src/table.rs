//! What a study comes to: `cells.csv`, a table for the terminal, a heat map.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use serde_json::Value;
use swerve_eval::Metrics;
use swerve_report::output::align;

use super::cells::CellResult;
use super::chance::wilson;
use super::grid::Study;

/// `cells.csv`: one line a finished cell, in the order of the study.
pub fn csv(study: &Study, results: &[Option<CellResult>]) -> String {
    let mut text = String::new();
    for axis in &study.axes {
        let _ = write!(text, "{},", field(axis));
    }
    text += if study.budget.is_some() {
        "budget_ms,budget_is_at_least,verdict\n"
    } else {
        "verdict,no_collision,on_road,min_distance_m,impact_speed_mps,lateral_jerk_max,digest,response_p50_ms,response_p99_ms,misses"
    };
    let more: BTreeSet<&String> = results.iter().flatten().flat_map(|result| result.figures.keys()).collect();
    if study.budget.is_none() {
        for name in &more {
            let _ = write!(text, ",{name}");
        }
        text += "\n";
    }
    for result in results.iter().flatten() {
        for label in &result.labels {
            let _ = write!(text, "{},", field(label));
        }
        if let Some(budget) = &study.budget {
            let bound = result.budget_ms.map_or_else(String::new, |ms| budget.is_bound(ms).to_string());
            let _ = writeln!(text, "{},{bound},{}", number(result.budget_ms), result.verdict);
            continue;
        }
        let fact = |holds: bool| if result.error.is_none() { holds.to_string() } else { String::new() };
        let _ = write!(
            text,
            "{},{},{},{},{},{},{},{},{},{}",
            result.verdict,
            fact(result.no_collision),
            fact(result.on_road),
            number(result.min_distance_m),
            number(result.impact_speed_mps),
            number(result.lateral_jerk_max),
            result.digest.map_or_else(String::new, |d| d.to_string()),
            number(result.response_p50_ms),
            number(result.response_p99_ms),
            if result.error.is_none() { result.misses.to_string() } else { String::new() },
        );
        for name in &more {
            let _ = write!(text, ",{}", number(result.figures.get(*name).copied()));
        }
        text += "\n";
    }
    text
}

/// The figures of a run by their names in `metrics.json`, but for those that have columns anyway and those of actors,
/// operators and instants in a list.
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
    all.retain(|name, x| x.is_finite() && !told.contains(&name.as_str()) && !name.ends_with("actor"));
    all
}

fn number(x: Option<f64>) -> String {
    x.map_or_else(String::new, |x| format!("{x:.4}"))
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
    /// Of these, neither good nor bad: the car stood safely before what was in its way.
    pub stopped: usize,
    /// Of these, what neither avoided nor hit, by verdict: `left_road`, `stopped`, `timeout`.
    pub others: BTreeMap<String, usize>,
    /// Impact speeds of the others, m/s, sorted.
    pub impact_mps: Vec<f64>,
    /// Latency budgets, ms, sorted.
    pub budget_ms: Vec<f64>,
    /// How many of these, the last ones, are lower bounds.
    pub budget_bounds: usize,
}

impl Grid {
    /// Sums up the finished cells.
    pub fn of(study: &Study, results: &[Option<CellResult>]) -> Self {
        let shown: Vec<usize> = (0..study.axes.len()).filter(|&a| study.axes[a] != "seed").collect();
        let (down, across) = shown.split_at(shown.len().saturating_sub(1));
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
                (true, false) => "avoided or ran out of time",
                (false, true) => "avoided or left the road without a collision",
                (true, true) => "ended without a collision",
            },
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
        for square in &mut grid.squares {
            square.impact_mps.sort_by(f64::total_cmp);
            square.budget_ms.sort_by(f64::total_cmp);
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
            lines.push(std::iter::once(row.clone()).chain(self.row(i).iter().map(Square::text)).collect());
        }
        let mut text = align(&lines);
        if !self.column_axis.is_empty() {
            text = format!("{:>width$}\n{text}", self.column_axis, width = text.find('\n').unwrap_or(0));
        }
        if self.squares.iter().any(|square| square.budget_ms.is_empty() && square.runs > 0) {
            text +=
                "without a collision (95 % interval), on the road; median impact, and what else came of it\n";
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
        let good = match result.verdict.as_str() {
            "timeout" => study.timeout_is_good,
            "left_road" => study.off_road_is_good,
            _ => result.avoided(),
        };
        self.good += usize::from(good);
        self.stopped += usize::from(result.verdict == "stopped");
        if !result.avoided() && result.verdict != "collision" {
            *self.others.entry(result.verdict.clone()).or_default() += 1;
        }
        self.impact_mps.extend(result.impact_speed_mps.filter(|_| result.verdict == "collision"));
        self.budget_ms.extend(result.budget_ms);
        let is_bound = |ms| study.budget.as_ref().is_some_and(|budget| budget.is_bound(ms));
        self.budget_bounds += usize::from(result.budget_ms.is_some_and(is_bound));
    }

    /// What the two counts do not tell: verdicts other than `left_road`, and failures, with how many there are.
    pub(super) fn rest(&self) -> impl Iterator<Item = (&str, usize)> {
        let rest = self.others.iter().filter(|(verdict, _)| *verdict != "left_road");
        let failed = (self.failed > 0).then_some(("failed", self.failed));
        rest.map(|(verdict, n)| (verdict.as_str(), *n)).chain(failed)
    }

    /// Share of good runs among those that did not stop safely, 0 to 1; `None` where there are none.
    pub fn share(&self) -> Option<f64> {
        let decided = self.runs - self.stopped;
        (decided > 0).then(|| self.good as f64 / decided as f64)
    }

    /// Median impact speed of the runs that hit, m/s.
    pub fn impact_median_mps(&self) -> Option<f64> {
        self.impact_mps.get(self.impact_mps.len() / 2).copied()
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

    /// What stands in the terminal's table.
    pub fn text(&self) -> String {
        let failed = match self.failed {
            0 => String::new(),
            n => format!(", {n} failed"),
        };
        if self.runs == 0 {
            return if self.failed > 0 { failed[2..].to_owned() } else { "-".into() };
        }
        if let Some([median, range]) = self.budget_text() {
            return format!("{median} ({range}, {}/{}){failed}", self.avoided, self.runs);
        }
        let (low, high) = wilson(self.no_collision, self.runs);
        let mut text =
            format!("{}/{} ({low:.2}-{high:.2}), {} on road", self.no_collision, self.runs, self.on_road);
        if let Some(impact) = self.impact_median_mps() {
            let _ = write!(text, ", impact {impact:.1} m/s");
        }
        for (verdict, n) in self.rest() {
            let _ = write!(text, ", {n} {verdict}");
        }
        text
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
mod tests {
    use super::*;
    use crate::grid::{Budget, Cell};

    fn study() -> Study {
        let label = |p: &str, v: &str, s: &str| vec![p.to_owned(), v.to_owned(), s.to_owned()];
        let cells = [
            label("fot", "16", "1"),
            label("fot", "16", "2"),
            label("fot", "18", "1"),
            label("fot", "18", "2"),
        ];
        Study {
            file: "s.toml".into(),
            lines: std::collections::BTreeMap::new(),
            files: BTreeMap::new(),
            name: "s".into(),
            description: String::new(),
            scenario: "a".into(),
            config: Vec::new(),
            axes: vec!["planner".into(), "speed_mps".into(), "seed".into()],
            base: vec![],
            steps: vec![],
            cells: cells
                .into_iter()
                .enumerate()
                .map(|(index, labels)| Cell { index, labels, scenario: None, sets: vec![] })
                .collect(),
            budget: None,
            timeout_is_good: false,
            off_road_is_good: false,
            curve: None,
            leave_out: vec![],
            ranking: None,
            timely: None,
            timely_prediction: None,
        }
    }

    fn result(cell: &Cell, verdict: &str, impact: Option<f64>) -> Option<CellResult> {
        Some(CellResult {
            no_collision: verdict != "collision",
            on_road: verdict != "left_road",
            min_distance_m: Some(0.5),
            impact_speed_mps: impact,
            ..CellResult::blank(cell, verdict)
        })
    }

    #[test]
    fn seeds_are_summed_up() {
        let study = study();
        let results = [
            result(&study.cells[0], "avoided", None),
            result(&study.cells[1], "collision", Some(12.0)),
            result(&study.cells[2], "avoided", None),
            None,
        ];
        let grid = Grid::of(&study, &results);
        let lines: Vec<String> = grid.text().lines().map(str::to_owned).collect();
        assert_eq!(lines[0].trim(), "speed_mps");
        assert_eq!(lines[1].split_whitespace().collect::<Vec<_>>(), ["planner", "16", "18"]);
        let (one, two) = ("1/1 (0.21-1.00), 1 on road", "1/2 (0.09-0.91), 2 on road, impact 12.0 m/s");
        assert_eq!(lines[2], format!("fot      {two}  {one}"));
        assert_eq!(grid.squares[0].share(), Some(0.5));
        let stood =
            [result(&study.cells[0], "timeout", None), result(&study.cells[1], "collision", Some(9.0))];
        let of = |study: &Study| Grid::of(study, &stood).squares[0].clone();
        assert_eq!(
            (of(&study).share(), of(&study).text().as_str()),
            (Some(0.0), "1/2 (0.09-0.91), 2 on road, impact 9.0 m/s, 1 timeout")
        );
        assert_eq!(of(&Study { timeout_is_good: true, ..study.clone() }).share(), Some(0.5));
        let safe =
            [result(&study.cells[0], "stopped", None), result(&study.cells[1], "collision", Some(9.0))];
        let safe = Grid::of(&study, &safe).squares[0].clone();
        assert_eq!((safe.share(), safe.stopped), (Some(0.0), 1), "a safe stop is neither good nor bad");
        assert!(safe.text().ends_with("1 stopped"), "{}", safe.text());
        assert_eq!(csv(&study, &results).lines().nth(1).unwrap(), "fot,16,1,avoided,true,true,0.5000,,,,,,0");
        let off = [result(&study.cells[0], "left_road", None), result(&study.cells[1], "avoided", None)];
        let of = |study: &Study| Grid::of(study, &off).squares[0].clone();
        assert_eq!(of(&study).share(), Some(0.5));
        assert_eq!(of(&study).text(), "2/2 (0.34-1.00), 1 on road");
        assert_eq!(of(&Study { off_road_is_good: true, ..study }).share(), Some(1.0));
    }

    #[test]
    fn a_cell_that_failed_is_told_and_counts_nowhere() {
        let study = study();
        let failed = |k: usize| {
            let blank = CellResult::blank(&study.cells[k], "failed");
            Some(CellResult { error: Some("no such file".into()), ..blank })
        };
        let results = [failed(0), result(&study.cells[1], "avoided", None), failed(2), failed(3)];
        let grid = Grid::of(&study, &results);
        assert_eq!(grid.squares[0].text(), "1/1 (0.21-1.00), 1 on road, 1 failed");
        assert_eq!((grid.squares[0].share(), grid.squares[1].share()), (Some(1.0), None));
        assert_eq!(grid.squares[1].text(), "2 failed");
        let picture = crate::heatmap::draw(&grid, "t").svg();
        assert!(picture.contains(">2 failed<") && picture.contains("1 of 1 collision-free"), "{picture}");
    }

    #[test]
    fn a_budget_up_to_which_nothing_failed_is_a_lower_bound() {
        let budget = Budget { max_ms: 300.0, scan_ms: 50.0, resolution_ms: 5.0, limit: None };
        let study = Study { budget: Some(budget), ..study() };
        for (first, second, told) in [
            (Some(300.0), Some(300.0), "at least 300 ms (300 or more, 2/2)"),
            (Some(300.0), Some(120.0), "at least 300 ms (120-300 or more, 2/2)"),
            (Some(295.0), Some(120.0), "295 ms (120-295, 2/2)"),
        ] {
            let one = |k: usize, ms| {
                Some(CellResult { budget_ms: ms, ..CellResult::blank(&study.cells[k], "avoided") })
            };
            let results = [one(0, first), one(1, second), None, None];
            let grid = Grid::of(&study, &results);
            assert_eq!(grid.squares[0].text(), told);
            let picture = crate::heatmap::draw(&grid, "t").svg();
            assert!(picture.contains(&format!(">{}<", told.split_once(" (").unwrap().0)), "{picture}");
            let csv = csv(&study, &results);
            let wanted = format!("fot,16,1,{:.4},{},avoided", first.unwrap(), first == Some(300.0));
            assert_eq!(csv.lines().nth(1), Some(wanted.as_str()));
        }
    }
}
