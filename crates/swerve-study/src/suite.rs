//! `swerve suite`: scenarios driven with several seeds, each drive compared with its scenario's expectations.
//!
//! A suite is a study with the axes scenario and seed: its cells are stored and its table and page are made by the same
//! code.

mod leaderboard;
mod nhtsa;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::Context as _;
use swerve_drive::pictures::PictureArgs;
use swerve_drive::problems_error;
use swerve_drive::shipped::Kind;
use swerve_drive::trust::CodeArgs;
use swerve_measure::evaluate::VersionName;
use swerve_report::files::toml_files;
use swerve_report::output::print;
use swerve_stack::Registry;
use swerve_text::{Document, Problem};

use crate::chance::interval;
use crate::folder::OutArgs;
use crate::grid::{CELLS_MAX, SCENARIO, Step, Study, overridden};
use crate::result::CellResult;
use crate::{Bench, Driven, How, finish};

/// `swerve suite`.
#[derive(clap::Args, Debug)]
pub struct SuiteArgs {
    /// Scenario files (TOML, CommonRoad), folders of them, or names of built-in ones, such as lane or the folder everyday [default:
    /// all built-in ones without routes; with --rules those in routes or nhtsa]
    #[arg(value_name = "SCENARIO|DIR")]
    scenarios: Vec<PathBuf>,
    /// Configuration file (TOML), or the name of a built-in one, such as paper; several: the later over the earlier
    #[arg(short, long)]
    config: Vec<PathBuf>,
    /// Set a key of the configuration or the scenarios in every drive. A table, KEY={...}, changes the keys that it names
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    code: CodeArgs,
    /// Rules of a benchmark
    #[arg(long, value_enum, conflicts_with = "strict")]
    rules: Option<Rules>,
    /// Version of the Leaderboard whose score is printed [default: 2.1]
    #[arg(long, value_enum, requires = "rules")]
    version: Option<VersionName>,
    /// Print one JSON object and nothing else
    #[arg(long, requires = "rules")]
    json: bool,
    /// Seeds for every scenario: 1..20 including both ends, or 1,5,7 [default: 1..3]; with --rules also their number: 5 is
    /// 0..4 [default: 0; for nhtsa 0..9]
    #[arg(long)]
    seeds: Option<Seeds>,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    pictures: PictureArgs,
    /// Number of drives at the same time [default: one per core]
    #[arg(long, value_parser = swerve_drive::threads::parser())]
    threads: Option<usize>,
    /// Keep the page of every drive in cells/, about 0.5 MB each, linked from the suite's page
    #[arg(long)]
    reports: bool,
    /// Fail if a drive does not meet its scenario's expectations
    #[arg(long)]
    strict: bool,
}

/// Rules of benchmarks.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
enum Rules {
    /// CARLA Leaderboard: routes in traffic; a drive goes on after a collision and ends after 182 s at rest, blocked after 180 s
    Leaderboard,
    /// NHTSA's pre-crash types: each drive is compared with its scenario's expectations
    Nhtsa,
}

/// Seeds from the command line.
#[derive(Clone, Debug, PartialEq)]
struct Seeds {
    /// Sorted and without duplicates.
    each: BTreeSet<i64>,
    /// The number, if the text is a single one.
    only: Option<i64>,
}

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || format!("expected seeds such as 1..20 or 1,5,7, found `{text}`");
        let mut each = BTreeSet::new();
        for part in text.split(',') {
            let (from, to) = part.split_once("..").unwrap_or((part, part));
            let [from, to] = [from, to].map(|seed| seed.trim().parse::<u32>().ok());
            let (Some(from), Some(to)) = (from, to) else { return Err(expected()) };
            if from > to {
                return Err(expected());
            }
            if (to - from) as usize >= CELLS_MAX {
                return Err(format!("expected at most {CELLS_MAX} seeds"));
            }
            each.extend((from..=to).map(i64::from));
        }
        Ok(Self { each, only: text.trim().parse::<u32>().ok().map(i64::from) })
    }
}

impl Seeds {
    /// Seeds of drives by the rules of a benchmark, where a single number is the number of seeds.
    fn counted(&self) -> anyhow::Result<BTreeSet<i64>> {
        let Some(count) = self.only else { return Ok(self.each.clone()) };
        let range = 1..=CELLS_MAX as i64;
        anyhow::ensure!(range.contains(&count), "--seeds: expected 1 to {CELLS_MAX} seeds, found {count}");
        Ok((0..count).collect())
    }
}

/// Runs `swerve suite`.
///
/// # Errors
/// If a scenario or the configuration is wrong, results cannot be written, or a drive failed; with `--strict`, also if
/// a drive does not meet its scenario's expectations.
pub fn run(args: &SuiteArgs, registry: &Registry) -> anyhow::Result<()> {
    match args.rules {
        Some(Rules::Leaderboard) => leaderboard::run(args, registry),
        Some(Rules::Nhtsa) => {
            anyhow::ensure!(args.version.is_none(), "--version: expected with `--rules leaderboard` only");
            nhtsa::run(args, registry)
        }
        None => run_expected(args, registry),
    }
}

/// Drives scenarios and compares the drives with their expectations.
fn run_expected(args: &SuiteArgs, registry: &Registry) -> anyhow::Result<()> {
    let given = match args.scenarios.is_empty() {
        true => built_in_without_routes(),
        false => args.scenarios.clone(),
    };
    let seeds = args.seeds.as_ref().map_or_else(|| (1..=3).collect(), |seeds| seeds.each.clone());
    let steps = named_scenarios(&given)?.into_iter().map(of_scenario).collect();
    let (study, driven) = drive(args, registry, steps, &seeds)?;
    let count = Count::of(&driven.0);
    print(&text(&study, &driven.0))?;
    finish(&study, &driven, None)?;
    anyhow::ensure!(
        !args.strict || count.broken == 0,
        "{} of {} drives not as their scenarios expect (--strict)",
        count.broken,
        count.held()
    );
    Ok(())
}

/// Step of a scenario as it is.
fn of_scenario((label, path): (String, PathBuf)) -> Step {
    Step { label, scenario: Some(path), ..Step::default() }
}

/// Drives the scenarios of these steps with these seeds; returns the study with its results.
fn drive(
    args: &SuiteArgs,
    registry: &Registry,
    scenarios: Vec<Step>,
    seeds: &BTreeSet<i64>,
) -> anyhow::Result<(Study, Driven)> {
    let bench = Bench::of(registry, study(args, scenarios, seeds)?)?.with_code(args.code);
    bench.refuse_programs()?;
    bench.note_domain()?;
    let (threads, reports) = (args.threads, args.reports);
    let out = &args.out.folder(&bench.study)?;
    let is_quiet = args.json;
    let how = How { out, threads, shard: None, reports, pictures: args.pictures, is_quiet };
    let driven = bench.drive_cells(&how)?;
    Ok((bench.study, driven))
}

/// Study of a suite.
fn study(args: &SuiteArgs, scenarios: Vec<Step>, seeds: &BTreeSet<i64>) -> anyhow::Result<Study> {
    anyhow::ensure!(
        scenarios.len().saturating_mul(seeds.len()) <= CELLS_MAX,
        "more than {CELLS_MAX} drives: expected fewer --seeds"
    );
    let sets = swerve_text::parse_assignments(&args.set);
    let (base, seed) = (sets?, "seed".to_owned());
    let of_seed =
        |n: &i64| Step { label: n.to_string(), sets: vec![(seed.clone(), (*n).into())], ..Step::default() };
    let seeds: Vec<Step> = seeds.iter().map(of_seed).collect();
    if let Some(problem) = overridden(&base, &seeds, &seed) {
        return Err(problems_error(&[Problem { message: "expected in --seeds".into(), ..problem }]));
    }
    let first = scenarios.iter().find_map(|step| step.scenario.clone()).context("expected a scenario")?;
    Ok(Study {
        file: "swerve suite".into(),
        doubt: None,
        lines: BTreeMap::new(),
        files: BTreeMap::new(),
        name: "suite".into(),
        description: String::new(),
        scenario: first,
        config: args.config.clone(),
        axes: vec![SCENARIO.into(), seed],
        base,
        steps: vec![scenarios, seeds],
        cells: Vec::new(),
        budget: None,
        timeout_is_good: false,
        off_road_is_good: false,
        curve: None,
        plot: None,
        leave_out: Vec::new(),
        ranking: None,
        timely: None,
        timely_prediction: None,
    })
}

/// Folder of the built-in routes.
const ROUTES: &str = "routes";

/// Built-in scenarios without the routes, which take minutes each.
fn built_in_without_routes() -> Vec<PathBuf> {
    let routes = Kind::Scenario.in_folder(Path::new(ROUTES));
    Kind::Scenario
        .all()
        .map(|(name, _)| name)
        .filter(|name| !routes.contains(name))
        .map(PathBuf::from)
        .collect()
}

/// Scenarios named on the command line, without duplicates, with their labels in tables: the stem of the file, or the
/// whole path if several have the same stem.
fn named_scenarios(given: &[PathBuf]) -> anyhow::Result<Vec<(String, PathBuf)>> {
    let mut paths: Vec<PathBuf> = Vec::new();
    for path in given {
        let shipped = || Kind::Scenario.in_folder(path).into_iter().map(PathBuf::from).collect::<Vec<_>>();
        match path.is_dir() {
            true => paths.extend(scenarios_in(path)?),
            false => match shipped() {
                in_folder if !path.exists() && !in_folder.is_empty() => paths.extend(in_folder),
                _ => paths.push(path.clone()),
            },
        }
    }
    let mut seen = BTreeSet::new();
    paths.retain(|path| seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())));
    let stem = |path: &Path| {
        let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        // Of a packed file.
        stem.strip_suffix(".xml").map_or_else(|| stem.clone(), str::to_owned)
    };
    let is_only = |path: &Path| paths.iter().filter(|other| stem(other) == stem(path)).count() == 1;
    let label = |path: &PathBuf| if is_only(path) { stem(path) } else { path.display().to_string() };
    Ok(paths.iter().map(|path| (label(path), path.clone())).collect())
}

/// Scenarios of a folder: files with a road or actors; other files are ignored.
fn scenarios_in(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = toml_files(folder)?;
    // An unreadable file is reported later, with its problem.
    let is_scenario =
        |document: Document| ["road", "map", "actor"].iter().any(|key| document.table.contains_key(*key));
    files.retain(|file| Document::read(file).map_or(true, is_scenario));
    files.extend(swerve_drive::commonroad::scenarios_in(folder)?);
    anyhow::ensure!(!files.is_empty(), "{}: no scenario (.toml, .xml) in this folder", folder.display());
    Ok(files)
}

/// Numbers of drives that meet or miss their expectations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Count {
    kept: usize,
    broken: usize,
    /// Drives without expectations.
    free: usize,
}

impl Count {
    fn of<'a>(results: impl IntoIterator<Item = &'a Option<CellResult>>) -> Self {
        let mut count = Self::default();
        for result in results.into_iter().flatten().filter(|result| result.error.is_none()) {
            match result.as_expected() {
                Some(true) => count.kept += 1,
                Some(false) => count.broken += 1,
                None => count.free += 1,
            }
        }
        count
    }

    /// Count and total, with the interval of the rate.
    fn text(self) -> String {
        format!("{} of {} {}", self.kept, self.held(), interval(self.kept, self.held()))
    }

    /// Number of drives with expectations.
    fn held(self) -> usize {
        self.kept + self.broken
    }
}

/// Width of a count with its interval, for hundreds of drives.
const COUNTED: usize = 22;

/// One line per scenario: the number of drives that meet its expectations, and the first one that does not.
fn text(study: &Study, results: &[Option<CellResult>]) -> String {
    let names: Vec<&str> = study.steps[0].iter().map(|step| step.label.as_str()).collect();
    let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(SCENARIO.len());
    let seeds = study.steps[1].len();
    let mut text = format!("\n{SCENARIO:width$}  {:>COUNTED$}\n", "as expected");
    for (name, of_scenario) in names.iter().zip(results.chunks(seeds)) {
        let count = Count::of(of_scenario);
        let told = if count.held() == 0 { "-".to_owned() } else { count.text() };
        let broken = |result: &&CellResult| result.as_expected() == Some(false);
        let first = of_scenario.iter().flatten().find(broken);
        let why = first.map_or_else(String::new, |result| {
            format!("  seed {}: {}", result.labels[1], result.not_as_expected())
        });
        let _written = writeln!(text, "{name:width$}  {told:>COUNTED$}{why}");
    }
    let all = Count::of(results);
    let _written = write!(text, "{} drives as their scenarios expect (95 % intervals)", all.text());
    if all.free > 0 {
        let _written = write!(text, "; of {} more nothing is expected", all.free);
    }
    text + "\n" + &collisions_text(results) + &left_out_text(study, results)
}

/// Numbers of drives with a collision, and of those in which the ego is not at fault; empty without collisions.
fn collisions_text(results: &[Option<CellResult>]) -> String {
    let faults: Vec<bool> = results.iter().flatten().filter_map(CellResult::at_fault).collect();
    match (faults.len(), faults.iter().filter(|at_fault| !**at_fault).count()) {
        (0, _) => String::new(),
        (all, 0) => format!("collisions: {all} drives, all at fault\n"),
        (all, free) => {
            format!("collisions: {all} drives, {free} of them not at fault: hit from behind, or at rest\n")
        }
    }
}

/// Numbers of road users of the traffic for which there was no place, by scenario; empty if all had one.
fn left_out_text(study: &Study, results: &[Option<CellResult>]) -> String {
    let of_scenario = |(step, results): (&Step, &[Option<CellResult>])| {
        let counts = results.iter().flatten().filter_map(CellResult::road_users_left_out);
        let [least, most] = counts.fold([usize::MAX, 0], |[a, b], count| [a.min(count), b.max(count)]);
        let range = if least < most { format!("{least} to {most}") } else { most.to_string() };
        (most > 0).then(|| format!("{} {range}", step.label))
    };
    let named = study.steps[0].iter().zip(results.chunks(study.steps[1].len()));
    let all: Vec<String> = named.filter_map(of_scenario).collect();
    match all.is_empty() {
        true => String::new(),
        false => format!("road users of the traffic without a place, per drive: {}\n", all.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::ROAD_USERS_LEFT_OUT;
    use crate::grid::Cell;

    fn seeds(text: &str) -> Result<Vec<i64>, String> {
        text.parse().map(|seeds: Seeds| seeds.each.into_iter().collect())
    }

    #[test]
    fn seeds_can_be_ranges_and_lists() {
        assert_eq!(seeds("1..3"), Ok(vec![1, 2, 3]));
        assert_eq!(seeds("7,1..2,2"), Ok(vec![1, 2, 7]));
        for wrong in ["", "3..1", "a", "1..", "-1", "1;2", "0..4294967295"] {
            assert!(seeds(wrong).unwrap_err().starts_with("expected "), "{wrong}");
        }
    }

    #[test]
    fn single_number_counts_seeds_under_the_rules_of_a_benchmark() {
        let counted = |text: &str| {
            let counted = text.parse::<Seeds>().unwrap().counted();
            counted.map(|seeds| seeds.into_iter().collect::<Vec<_>>()).map_err(|error| error.to_string())
        };
        assert_eq!(counted("3"), Ok(vec![0, 1, 2]));
        assert_eq!(counted("3..3"), Ok(vec![3]));
        assert_eq!(counted("1,5"), Ok(vec![1, 5]));
        assert!(counted("0").unwrap_err().contains("expected 1 to"));
    }

    #[test]
    fn road_users_without_a_place_are_counted_by_scenario() {
        let step = |label: &str| Step { label: label.to_owned(), ..Step::default() };
        let steps = vec![["lane", "town", "crossing"].map(step).into(), ["1", "2"].map(step).into()];
        let study = Study { steps, ..crate::table::tests::study() };
        let result = |count: Option<f64>| {
            let cell = Cell { labels: vec!["a".into(), "1".into()], ..study.cells[0].clone() };
            let figures = count.map(|count| (ROAD_USERS_LEFT_OUT.to_owned(), count));
            Some(CellResult { figures: figures.into_iter().collect(), ..CellResult::blank(&cell, "avoided") })
        };
        let drives = |counts: [Option<f64>; 6]| left_out_text(&study, &counts.map(result));
        let found = drives([None, None, Some(0.0), Some(3.0), Some(175.0), Some(175.0)]);
        let wanted = "road users of the traffic without a place, per drive: town 0 to 3, crossing 175\n";
        assert_eq!(found, wanted);
        assert_eq!(drives([None, None, Some(0.0), Some(0.0), None, None]), "");
    }

    #[test]
    fn collisions_that_are_not_at_fault_are_counted_apart() {
        let result = |at_fault: Option<bool>| {
            let cell = crate::table::tests::study().cells[0].clone();
            let mut result = CellResult::blank(&cell, "collision");
            result
                .texts
                .extend(at_fault.map(|at_fault| (crate::columns::AT_FAULT.to_owned(), at_fault.to_string())));
            Some(result)
        };
        let text = |faults: &[Option<bool>]| {
            collisions_text(&faults.iter().copied().map(result).collect::<Vec<_>>())
        };
        assert_eq!(text(&[None, None]), "");
        assert_eq!(text(&[Some(true), None]), "collisions: 1 drives, all at fault\n");
        let wanted = "collisions: 3 drives, 2 of them not at fault: hit from behind, or at rest\n";
        assert_eq!(text(&[Some(true), Some(false), None, Some(false)]), wanted);
    }

    #[test]
    fn scenarios_of_the_same_name_get_paths_and_other_files_are_ignored() {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in [
            ("a/lane.toml", "road = {}\n"),
            ("b/lane.toml", "[[actor]]\n"),
            ("b/config.toml", "seed = 1\n"),
            ("b/street.toml", "road = {}\n"),
        ] {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        let labels = |given: &[PathBuf]| {
            let named = named_scenarios(given).unwrap().into_iter();
            named.map(|(label, _)| label).collect::<Vec<_>>()
        };
        assert_eq!(labels(std::slice::from_ref(&b)), ["lane", "street"]);
        let path = |folder: &Path| folder.join("lane.toml").display().to_string();
        assert_eq!(
            labels(&[a.clone(), b.clone(), a.join("lane.toml")]),
            [path(&a), path(&b), "street".into()]
        );
        let routes = labels(&[ROUTES.into()]);
        assert_eq!(routes.len(), 10);
        assert_eq!(labels(&built_in_without_routes()).len() + 10, Kind::Scenario.all().count());
        let everyday = labels(&["everyday".into()]);
        assert!(everyday.len() >= 24 && everyday.contains(&"start_in_jam".into()), "{everyday:?}");
        assert_eq!(labels(&["scenarios/everyday/".into()]), everyday);
        let empty = tempfile::tempdir().unwrap();
        let said = named_scenarios(&[empty.path().into()]).unwrap_err().to_string();
        assert!(said.contains("no scenario"), "{said}");
    }
}
