//! `swerve eval commonroad`: checks solutions of CommonRoad's scenarios and computes their costs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use swerve_commonroad::{Costs, Scenario, Solution, check, costs};

/// Most problems of a file that are shown.
const SHOWN: usize = 20;

/// Endings of scenario files.
const ENDINGS: [&str; 5] = [".xml", ".xml.gz", ".cr.xml", ".cr.xml.gz", ".pb"];

/// Solutions, and the folder of their scenarios.
#[derive(clap::Args, Debug)]
pub(super) struct CommonroadArgs {
    /// Solutions (.xml, .xml.gz)
    #[arg(required = true)]
    solutions: Vec<PathBuf>,
    /// Folder with the scenarios that the solutions name, in it or in its subfolders; or one scenario file
    #[arg(long, value_name = "DIR")]
    scenarios: PathBuf,
    /// Print one JSON array and nothing else
    #[arg(long)]
    json: bool,
}

/// Result for one solution.
#[derive(Serialize)]
struct Row {
    solution: String,
    scenario: String,
    valid: bool,
    /// Verdict of the official checker: an exception, `infeasible`, or empty.
    official: &'static str,
    failures: Vec<String>,
    costs: Vec<CostRow>,
}

/// Costs of one trajectory.
#[derive(Serialize)]
struct CostRow {
    problem: u32,
    function: &'static str,
    /// `None` if a part is not computed.
    total: Option<f64>,
    /// Parts that are computed, unweighted.
    parts: BTreeMap<&'static str, f64>,
    not_computed: Vec<&'static str>,
    #[serde(skip)]
    line: String,
}

/// Text to print, and a problem if a solution is not valid.
pub(super) fn outcome(args: &CommonroadArgs) -> anyhow::Result<(String, Option<String>)> {
    let mut scenarios = BTreeMap::new();
    let mut rows = Vec::new();
    for path in &args.solutions {
        let solution = Solution::read(&path.display().to_string(), &text(path)?);
        let solution = solution.map_err(|problems| anyhow!(problems.first(SHOWN)))?;
        let file =
            scenario_of(&args.scenarios, &solution.benchmark).with_context(|| path.display().to_string())?;
        if !scenarios.contains_key(&file) {
            let scenario = Scenario::read(&file.display().to_string(), &text(&file)?);
            let scenario = scenario.map_err(|problems| anyhow!(problems.first(SHOWN)))?;
            scenarios.insert(file.clone(), scenario);
        }
        let Some(scenario) = scenarios.get(&file) else { continue };
        rows.push(row(path, &solution, scenario));
    }
    let invalid = rows.iter().filter(|row| !row.valid).count();
    let problem = (invalid > 0).then(|| format!("{invalid} of {} solutions are not valid", rows.len()));
    if args.json {
        return Ok((serde_json::to_string_pretty(&rows)? + "\n", problem));
    }
    Ok((rows.iter().map(Row::text).collect(), problem))
}

fn row(path: &Path, solution: &Solution, scenario: &Scenario) -> Row {
    let verdict = check(scenario, solution);
    let of = solution.driven.iter().filter_map(|driven| {
        let problem = scenario.problem(driven.problem)?;
        Some(CostRow::of(problem.id, &costs(driven.cost, problem, driven, scenario.step_s)))
    });
    Row {
        solution: path.display().to_string(),
        scenario: scenario.benchmark.clone(),
        valid: verdict.is_valid(),
        official: verdict.official(),
        failures: verdict.failures.iter().map(ToString::to_string).collect(),
        costs: of.collect(),
    }
}

impl CostRow {
    fn of(problem: u32, costs: &Costs) -> Self {
        let parts = costs.parts.iter().filter_map(|(part, _, value)| Some((part.name(), (*value)?)));
        let missing = costs.parts.iter().filter(|(.., value)| value.is_none());
        Self {
            problem,
            function: costs.function.name(),
            total: costs.total(),
            parts: parts.collect(),
            not_computed: missing.map(|(part, ..)| part.name()).collect(),
            line: costs.to_string(),
        }
    }
}

impl Row {
    fn text(&self) -> String {
        let verdict = if self.valid { "valid" } else { "not valid" };
        let mut text = format!("{}: {verdict} ({})\n", self.solution, self.scenario);
        self.failures.iter().for_each(|failure| text += &format!("  {failure}\n"));
        self.costs.iter().for_each(|cost| text += &format!("  problem {}: {}\n", cost.problem, cost.line));
        text
    }
}

/// Text of a file, in XML.
fn text(path: &Path) -> anyhow::Result<String> {
    swerve_drive::commonroad::read_text(path).with_context(|| path.display().to_string())
}

/// The file of a scenario in a folder or one of its subfolders, or the file itself.
fn scenario_of(folder: &Path, name: &str) -> anyhow::Result<PathBuf> {
    if folder.is_file() {
        return Ok(folder.to_owned());
    }
    anyhow::ensure!(
        !name.is_empty() && !name.contains(['/', '\\']),
        "expected the name of a scenario in `benchmark_id`, found `{name}`"
    );
    let mut folders = vec![folder.to_owned()];
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut inner: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    inner.retain(|path| path.is_dir());
    inner.sort();
    folders.extend(inner);
    let files = folders.iter().flat_map(|folder| ENDINGS.map(|end| folder.join(format!("{name}{end}"))));
    files.into_iter().find(|file| file.is_file()).with_context(|| {
        format!(
            "{}: no scenario `{name}` in this folder and its subfolders (expected {name}.xml, .xml.gz or .pb)",
            folder.display()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenario_is_found_in_a_subfolder_and_never_outside() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("inner");
        std::fs::create_dir(&inner).unwrap();
        std::fs::write(inner.join("A-1.cr.xml"), "").unwrap();
        assert_eq!(scenario_of(folder.path(), "A-1").unwrap(), inner.join("A-1.cr.xml"));
        assert!(scenario_of(folder.path(), "B").unwrap_err().to_string().contains("no scenario `B`"));
        assert!(scenario_of(folder.path(), "../A-1").is_err());
    }
}
