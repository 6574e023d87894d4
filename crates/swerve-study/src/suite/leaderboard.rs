//! `swerve suite --rules leaderboard`: routes in traffic, scored by the rules of the CARLA Leaderboard.
//!
//! A drive goes on after a collision. It ends at the goal, when the ego has stood for longer than the Leaderboard
//! allows, or when the route has taken longer.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value};
use swerve_drive::problems_error;
use swerve_drive::shipped::Kind;
use swerve_eval::score::DrivingScores;
use swerve_eval::score::leaderboard::{RouteRecord, Version, total};
use swerve_measure::evaluate::VersionName;
use swerve_report::output::{align, print};
use swerve_scenario::Scenario;
use swerve_stack::Registry;
use swerve_text::Problem;

use super::{ROUTES, SuiteArgs, drive, left_out_text, named_scenarios};
use crate::finish;
use crate::grid::{Step, Study};
use crate::result::CellResult;

/// Time at rest after which a drive ends, seconds: just above the 180 s that are a block.
const STANDS_S: f64 = 182.0;
/// Time that a drive goes on after a collision, seconds: longer than a route takes.
const AFTER_COLLISION_S: f64 = 3_600.0;

/// Scores of all routes.
#[derive(Serialize, Debug)]
struct Scores {
    /// Mean driving score.
    score_mean: f64,
    /// Standard deviation of the driving score over n - 1; null for one route in 1.0.
    score_sd: Option<f64>,
    routes: Vec<Route>,
}

/// Score of one drive over a route.
#[derive(Serialize, Debug)]
struct Route {
    route: String,
    seed: i64,
    route_completion: f64,
    penalty: f64,
    score: f64,
    infractions: Map<String, Value>,
    comfort_share: Option<f64>,
    /// Number of road users of the traffic for which there was no place; absent without traffic.
    #[serde(skip_serializing_if = "Option::is_none")]
    road_users_left_out: Option<usize>,
}

/// Runs `swerve suite --rules leaderboard`.
pub(super) fn run(args: &SuiteArgs, registry: &Registry) -> anyhow::Result<()> {
    let version = args.version.unwrap_or(VersionName::V2_1).version();
    let given = match args.scenarios.is_empty() {
        true => vec![PathBuf::from(ROUTES)],
        false => args.scenarios.clone(),
    };
    let seeds = args.seeds.as_ref().map_or_else(|| Ok(BTreeSet::from([0])), super::Seeds::counted)?;
    let steps = named_scenarios(&given)?.into_iter().map(|(label, path)| step(label, path, version));
    let steps = steps.collect::<anyhow::Result<Vec<Step>>>()?;
    let (study, driven) = drive(args, registry, steps, &seeds)?;
    finish(&study, &driven, None)?;
    let scores = Scores::of(&study, &driven.0, version)?;
    print(&match args.json {
        true => serde_json::to_string_pretty(&scores)? + "\n",
        false => scores.text(version) + &left_out_text(&study, &driven.0),
    })
}

/// Step of a route, with the ends of drives by the rules of a version.
fn step(label: String, path: PathBuf, version: Version) -> anyhow::Result<Step> {
    let scenario = swerve_drive::read_scenario(&path)?;
    let Some(timeout_s) = timeout_s(&scenario, version) else {
        return Err(problems_error(&[not_a_route(&path)?]));
    };
    let stands: toml::Table = [("for_s".to_owned(), STANDS_S.into())].into_iter().collect();
    let sets = vec![
        ("end.after_collision_s".to_owned(), AFTER_COLLISION_S.into()),
        ("end.standstill".to_owned(), stands.into()),
        ("end.timeout_s".to_owned(), timeout_s.into()),
    ];
    Ok(Step { label, scenario: Some(path), sets, ..Step::default() })
}

fn not_a_route(path: &Path) -> anyhow::Result<Problem> {
    let message = "expected a route over a map ([map], and [ego] with start and goal), found a road";
    Ok(Kind::Scenario.document(path)?.problem("road", message))
}

/// Time after which a route has taken too long by the rules of a version, and a second, rounded up; `None` if the
/// scenario has no map.
fn timeout_s(scenario: &Scenario, version: Version) -> Option<f64> {
    scenario.road.network()?;
    let length_m = scenario.ego.end_m - scenario.ego.s_m;
    let limit_s = match version.is_second() {
        true => {
            let limits = scenario.road.route();
            let limits = limits.stretches().iter().filter_map(|stretch| stretch.speed_limit_mps);
            let slowest_mps = limits.fold(scenario.ego.target_speed_mps, f64::min);
            300.0 + length_m / (0.1 * slowest_mps)
        }
        false => 0.8 * length_m + 5.0,
    };
    Some(limit_s.ceil() + 1.0)
}

impl Scores {
    fn of(study: &Study, results: &[Option<CellResult>], version: Version) -> anyhow::Result<Self> {
        let found = study.cells.iter().zip(results);
        let scored: Vec<(&[String], &CellResult, &DrivingScores)> = found
            .filter_map(|(cell, result)| {
                let result = result.as_ref()?;
                Some((cell.labels.as_slice(), result, result.scores.as_ref()?))
            })
            .collect();
        anyhow::ensure!(scored.len() == results.len(), "a drive without driving scores");
        let records: Vec<RouteRecord> = scored.iter().map(|(_, _, scores)| scores.record(version)).collect();
        let total = total(&records, version);
        let of = |((labels, result, scores), record): (
            &(&[String], &CellResult, &DrivingScores),
            &RouteRecord,
        )| {
            let score = record.score(version);
            Ok(Route {
                route: labels[0].clone(),
                seed: labels[1].parse()?,
                route_completion: score.route_completion,
                penalty: score.penalty,
                score: score.driving_score,
                infractions: infractions(record),
                comfort_share: scores.comfort_share,
                road_users_left_out: result.road_users_left_out(),
            })
        };
        Ok(Self {
            score_mean: total.as_ref().map_or(0.0, |total| total.driving_score),
            score_sd: total.and_then(|total| total.std_dev),
            routes: scored.iter().zip(&records).map(of).collect::<anyhow::Result<_>>()?,
        })
    }

    fn text(&self, version: Version) -> String {
        let head = ["route", "seed", "completion", "penalty", "score", "comfort", "infractions"];
        let rows = self.routes.iter().map(|route| {
            let comfort =
                route.comfort_share.map_or_else(|| "-".into(), |share| format!("{:.1} %", 100.0 * share));
            vec![
                route.route.clone(),
                route.seed.to_string(),
                format!("{:.1} %", route.route_completion),
                format!("{:.3}", route.penalty),
                format!("{:.1}", route.score),
                comfort,
                words(&route.infractions),
            ]
        });
        let mut text =
            align(&std::iter::once(head.map(str::to_owned).to_vec()).chain(rows).collect::<Vec<_>>());
        let sd = self.score_sd.map_or_else(String::new, |sd| format!(", standard deviation {sd:.1}"));
        let (name, mean, n) = (version.name(), self.score_mean, self.routes.len());
        let _written = writeln!(text, "driving score by Leaderboard {name}: {mean:.2}{sd}, {n} drives");
        text
    }
}

/// Infractions of a route: counts of each kind, and the shares in percent.
fn infractions(record: &RouteRecord) -> Map<String, Value> {
    let counts = record.counts.each().map(|(kind, count)| (kind.to_owned(), Value::from(count)));
    let slow = record.min_speed_checkpoints_percent.clone();
    let shares = [
        ("outside_route_lanes_percent".to_owned(), Value::from(record.outside_route_lanes_percent)),
        ("min_speed_checkpoints_percent".to_owned(), Value::from(slow)),
    ];
    counts.into_iter().chain(shares).collect()
}

/// Infractions that are there, in one line.
fn words(infractions: &Map<String, Value>) -> String {
    let word = |(kind, value): (&String, &Value)| match value {
        Value::Number(count) if count.as_f64() > Some(0.0) => match kind.strip_suffix("_percent") {
            Some(kind) => Some(format!("{kind} {:.1} %", count.as_f64()?)),
            None => Some(format!("{kind} {count}")),
        },
        Value::Array(percents) => {
            let slow = percents.iter().filter(|percent| percent.as_f64() < Some(100.0)).count();
            (slow > 0).then(|| format!("min_speed {slow}"))
        }
        _ => None,
    };
    let words: Vec<String> = infractions.iter().filter_map(word).collect();
    if words.is_empty() { "-".to_owned() } else { words.join(", ") }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use clap::Parser as _;

    use super::*;
    use crate::Bench;
    use crate::cells::{CellStore, Runner};
    use crate::grid::Cell;

    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        suite: SuiteArgs,
    }

    const ROUTE: &str = r#"
        name = "short"
        [map]
        file = "crossing.xodr"
        [ego]
        start = { road = "4", lane = -1, s_m = 50.0 }
        goal = { road = "2", lane = 1, s_m = 30.0 }
        [[actor]]
        name = "person"
        kind = "pedestrian"
        s_m = 90.0
        d_m = 0.0
    "#;

    /// Scores of two seeds, driven by a car that sees nobody.
    fn suite(route: &Path, threads: usize, out: &Path) -> Value {
        let file = route.display().to_string();
        let words = ["suite", &file, "--rules", "leaderboard", "--seeds", "2", "--set", "sensing.range_m=1"];
        let args = Line::try_parse_from(words).unwrap().suite;
        let version = args.version.unwrap_or(VersionName::V2_1).version();
        let steps = vec![step("short".into(), route.into(), version).unwrap()];
        let seeds = args.seeds.as_ref().unwrap().counted().unwrap();
        let study = crate::suite::study(&args, steps, &seeds).unwrap();
        let bench = Bench::of(&Registry::default(), study).unwrap();
        let (store, stop) = (CellStore::open(out).unwrap(), AtomicBool::new(false));
        let runner = Runner { store: &store, threads, shard: None, reports: false, stop: &stop };
        let run = |cell: &Cell, _| bench.run_cell(cell, None);
        let results = runner.run(&bench.study, |cell| bench.fingerprint(cell), run).unwrap();
        serde_json::to_value(Scores::of(&bench.study, &results, version).unwrap()).unwrap()
    }

    #[test]
    fn drives_go_on_after_a_collision_and_are_the_same_with_any_number_of_threads() {
        let folder = tempfile::tempdir().unwrap();
        let map = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps/crossing.xodr");
        std::fs::copy(map, folder.path().join("crossing.xodr")).unwrap();
        let route = folder.path().join("short.toml");
        std::fs::write(&route, ROUTE).unwrap();
        let [one, two] =
            [1, 2].map(|threads| suite(&route, threads, &folder.path().join(threads.to_string())));
        assert_eq!(one, two);
        // In the order of the alphabet.
        let keys = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(&one), ["routes", "score_mean", "score_sd"]);
        let wanted =
            ["comfort_share", "infractions", "penalty", "route", "route_completion", "score", "seed"];
        for (seed, route) in one["routes"].as_array().unwrap().iter().enumerate() {
            assert_eq!(keys(route), wanted);
            assert_eq!(route["seed"].as_u64(), Some(seed as u64));
            assert_eq!(route["infractions"]["collisions_pedestrian"].as_i64(), Some(1), "{route}");
            assert_eq!(
                (route["route_completion"].as_f64(), route["score"].as_f64()),
                (Some(100.0), Some(50.0))
            );
        }
    }

    #[test]
    fn road_is_not_a_route() {
        let error = step("lane".into(), "lane".into(), Version::V2_1).unwrap_err().to_string();
        assert!(error.contains("expected a route over a map"), "{error}");
    }
}
