//! What a study comes to: `cells.csv`, a table for the terminal, a heat map.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use swerve_report::output::align;

use super::cells::CellResult;
use super::grid::Study;

/// `cells.csv`: one line a finished cell, in the order of the study.
pub fn csv(study: &Study, results: &[Option<CellResult>]) -> String {
    let mut text = String::new();
    for axis in &study.axes {
        let _ = write!(text, "{},", field(axis));
    }
    let budget = study.budget.is_some();
    text += if budget {
        "budget_ms,verdict\n"
    } else {
        "verdict,min_distance_m,impact_speed_mps,lateral_jerk_max,digest,response_p50_ms,response_p99_ms,misses\n"
    };
    for result in results.iter().flatten() {
        for label in &result.labels {
            let _ = write!(text, "{},", field(label));
        }
        if budget {
            let _ = writeln!(text, "{},{}", number(result.budget_ms), result.verdict);
            continue;
        }
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{}",
            result.verdict,
            number(result.min_distance_m),
            number(result.impact_speed_mps),
            number(result.lateral_jerk_max),
            result.digest.map_or_else(String::new, |d| d.to_string()),
            number(result.response_p50_ms),
            number(result.response_p99_ms),
            if result.error.is_none() { result.misses.to_string() } else { String::new() },
        );
    }
    text
}

fn number(x: Option<f64>) -> String {
    x.map_or_else(String::new, |x| format!("{x:.4}"))
}

pub(super) fn field(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
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
    /// Finished runs.
    pub runs: usize,
    /// Of these, avoided.
    pub avoided: usize,
    /// Of these, good: avoided, or out of time where that counts.
    pub good: usize,
    /// Of these, what neither avoided nor hit, by verdict: `left_road`, `timeout`, `failed`.
    pub others: BTreeMap<String, usize>,
    /// Impact speeds of the others, m/s, sorted.
    pub impact_mps: Vec<f64>,
    /// Latency budgets, ms, sorted.
    pub budget_ms: Vec<f64>,
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
            good: if study.timeout_is_good { "avoided or ran out of time" } else { "avoided" },
        };
        grid.squares = vec![Square::default(); grid.rows.len() * grid.columns.len()];
        for result in results.iter().flatten() {
            let row = grid.rows.iter().position(|r| *r == row_of(&result.labels));
            let column = grid.columns.iter().position(|c| *c == column_of(&result.labels));
            if let (Some(row), Some(column)) = (row, column) {
                let at = row * grid.columns.len() + column;
                grid.squares[at].add(result, study.timeout_is_good);
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
        text
    }
}

impl Square {
    fn add(&mut self, result: &CellResult, timeout_is_good: bool) {
        self.runs += 1;
        self.avoided += usize::from(result.avoided());
        self.good += usize::from(result.avoided() || (timeout_is_good && result.verdict == "timeout"));
        if !matches!(result.verdict.as_str(), "avoided" | "collision") {
            *self.others.entry(result.verdict.clone()).or_default() += 1;
        }
        self.impact_mps.extend(result.impact_speed_mps.filter(|_| result.verdict == "collision"));
        self.budget_ms.extend(result.budget_ms);
    }

    /// Share of good runs, 0 to 1; `None` before any finished.
    pub fn share(&self) -> Option<f64> {
        (self.runs > 0).then(|| self.good as f64 / self.runs as f64)
    }

    /// Median impact speed of the runs that hit, m/s.
    pub fn impact_median_mps(&self) -> Option<f64> {
        self.impact_mps.get(self.impact_mps.len() / 2).copied()
    }

    /// Median latency budget, ms.
    pub fn budget_median_ms(&self) -> Option<f64> {
        self.budget_ms.get(self.budget_ms.len() / 2).copied()
    }

    /// What stands in the terminal's table.
    pub fn text(&self) -> String {
        if self.runs == 0 {
            return "-".into();
        }
        if let (Some(low), Some(median), Some(high)) =
            (self.budget_ms.first(), self.budget_median_ms(), self.budget_ms.last())
        {
            return format!("{median:.0} ms ({low:.0}-{high:.0}, {}/{})", self.avoided, self.runs);
        }
        let mut text = format!("{}/{}", self.avoided, self.runs);
        if let Some(impact) = self.impact_median_mps() {
            let _ = write!(text, " hit {impact:.1} m/s");
        }
        for (verdict, n) in &self.others {
            let _ = write!(text, " {n} {}", verdict.replace('_', " "));
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
    use crate::grid::Cell;

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
            name: "s".into(),
            description: String::new(),
            scenario: "a".into(),
            config: None,
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
            leave_out: vec![],
            ranking: None,
        }
    }

    fn result(cell: &Cell, verdict: &str, impact: Option<f64>) -> Option<CellResult> {
        Some(CellResult {
            labels: cell.labels.clone(),
            verdict: verdict.into(),
            min_distance_m: Some(0.5),
            impact_speed_mps: impact,
            lateral_jerk_max: None,
            digest: None,
            response_p50_ms: None,
            response_p99_ms: None,
            misses: 0,
            budget_ms: None,
            error: None,
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
        assert_eq!(lines[2], "fot      1/2 hit 12.0 m/s  1/1");
        assert_eq!(grid.squares[0].share(), Some(0.5));
        let stood =
            [result(&study.cells[0], "timeout", None), result(&study.cells[1], "collision", Some(9.0))];
        let of = |study: &Study| Grid::of(study, &stood).squares[0].clone();
        assert_eq!(
            (of(&study).share(), of(&study).text().as_str()),
            (Some(0.0), "0/2 hit 9.0 m/s 1 timeout")
        );
        assert_eq!(of(&Study { timeout_is_good: true, ..study.clone() }).share(), Some(0.5));
        assert_eq!(csv(&study, &results).lines().nth(1).unwrap(), "fot,16,1,avoided,0.5000,,,,,,0");
    }
}
