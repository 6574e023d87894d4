//! `swerve eval score`: driving scores of the CARLA Leaderboard from the records of routes.

mod compare;
mod file;
mod table;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::anyhow;
use clap::ValueEnum;
use serde::Serialize;
use swerve_eval::score::leaderboard::{RouteRecord, RouteScore, TotalScore, Version, total};
use swerve_text::read_given;

use compare::{Comparison, Difference, compare, compare_counting};
use file::{Cases, read};

/// Maximum length of a file of records, bytes.
const BYTES_MAX: u64 = 4 << 20;

/// Records of routes, and the versions of the Leaderboard.
#[derive(clap::Args, Debug)]
pub(super) struct ScoreArgs {
    /// Records of routes (JSON): `cases` with length, completion and counts of infractions, and their scores if known
    /// (`expect`)
    cases: PathBuf,
    /// Version of the Leaderboard; all if omitted
    #[arg(long, value_enum)]
    version: Option<VersionName>,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
}

/// Version of the Leaderboard on a command line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum VersionName {
    /// Factors are multiplied; no minimum speed
    #[value(name = "1.0")]
    V1_0,
    /// Factors are multiplied, also those of minimum speed, scenarios and emergency vehicles
    #[value(name = "2.0")]
    V2_0,
    /// Coefficients are added
    #[value(name = "2.1")]
    V2_1,
}

impl VersionName {
    /// The version.
    pub fn version(self) -> Version {
        match self {
            Self::V1_0 => Version::V1_0,
            Self::V2_0 => Version::V2_0,
            Self::V2_1 => Version::V2_1,
        }
    }
}

/// Score of one route or of several.
#[derive(Serialize)]
#[serde(untagged)]
enum Score {
    Route(RouteScore),
    Total(TotalScore),
}

/// Scores of one case by version.
#[derive(Serialize)]
struct CaseReport {
    name: String,
    scores: BTreeMap<&'static str, Score>,
    /// Largest difference of these numbers to those in the file, by version.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    largest_difference: BTreeMap<&'static str, f64>,
}

/// Instants of the collisions that count, by version.
#[derive(Serialize)]
struct CountingReport {
    counted_at_s: BTreeMap<&'static str, Vec<f64>>,
}

#[derive(Serialize)]
struct Report {
    cases: Vec<CaseReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    counting: Option<CountingReport>,
    /// Number of values with which the file compares results.
    compared: usize,
    /// Those that differ by more than their rounding.
    differing: Vec<Difference>,
}

/// Evaluates the records. Returns the text to print, and a problem if a result differs from the file's.
///
/// # Errors
/// If the file cannot be read or has problems; the error names all of them with line and key.
pub(super) fn outcome(args: &ScoreArgs) -> anyhow::Result<(String, Option<String>)> {
    let path = args.cases.display().to_string();
    let bytes = read_given(&args.cases, BYTES_MAX);
    let bytes = bytes.map_err(|error| anyhow!("{path}: cannot be read: {error}"))?;
    let text = swerve_text::decoded(bytes).map_err(|error| anyhow!("{path}:{}: {error}", error.line))?;
    let cases = read(&path, &text)?;
    let versions: Vec<Version> =
        args.version.map_or_else(|| Version::ALL.to_vec(), |name| vec![name.version()]);
    let report = report(&cases, &versions);
    let text = if args.json { serde_json::to_string_pretty(&report)? + "\n" } else { table::text(&report) };
    let problem = match report.differing.len() {
        0 => None,
        differing => Some(format!("{path}: {differing} of {} values differ", report.compared)),
    };
    Ok((text, problem))
}

fn report(cases: &Cases, versions: &[Version]) -> Report {
    let (mut compared, mut differing) = (0, Vec::new());
    let mut take = |found: Comparison| {
        compared += found.compared;
        differing.extend(found.differing);
        found.largest
    };
    let mut reports = Vec::new();
    for case in &cases.cases {
        let (mut scores, mut largest_difference) = (BTreeMap::new(), BTreeMap::new());
        for version in versions {
            let score = score(&case.records(*version), case.is_total, *version);
            if let Some(largest) = take(compare(case, &score, *version)) {
                largest_difference.insert(version.name(), largest);
            }
            scores.insert(version.name(), score);
        }
        reports.push(CaseReport { name: case.name.clone(), scores, largest_difference });
    }
    let counting = cases.counting.as_ref().map(|counting| {
        let mut counted_at_s = BTreeMap::new();
        for version in versions {
            let instants = counting.counted_at_s(*version);
            take(compare_counting(counting, &instants, *version));
            counted_at_s.insert(version.name(), instants);
        }
        CountingReport { counted_at_s }
    });
    Report { cases: reports, counting, compared, differing }
}

fn score(records: &[RouteRecord], is_total: bool, version: Version) -> Score {
    match (records, is_total) {
        ([one], false) => Score::Route(one.score(version)),
        _ => Score::Total(total(records, version).expect("the file is refused if a case has no route")),
    }
}
