//! `swerve suite --rules nhtsa`: NHTSA's pre-crash types, each a scenario with expectations.

use std::collections::BTreeSet;
use std::path::PathBuf;

use serde::Serialize;
use swerve_report::output::print;
use swerve_stack::Registry;

use super::{Count, SuiteArgs, drive, named_scenarios, of_scenario, text};
use crate::finish;
use crate::grid::Study;
use crate::result::CellResult;

/// Folder of the built-in scenarios.
const FOLDER: &str = "nhtsa";
/// Seeds of each scenario, unless they are given.
const SEEDS: i64 = 10;

/// Results of all scenarios.
#[derive(Serialize, Debug)]
struct Results {
    /// Number of drives as expected, and of all drives.
    as_expected: usize,
    drives: usize,
    scenarios: Vec<Scenario>,
}

/// Results of one scenario.
#[derive(Serialize, Debug)]
struct Scenario {
    scenario: String,
    /// Number of the pre-crash type, with which the name of the scenario begins.
    #[serde(rename = "type")]
    number: Option<u32>,
    drives: Vec<Drive>,
}

/// Result of one drive.
#[derive(Serialize, Debug)]
struct Drive {
    seed: i64,
    verdict: String,
    as_expected: Option<bool>,
    /// Reasons why it is not.
    not_as_expected: String,
    min_distance_m: Option<f64>,
    impact_speed_mps: Option<f64>,
    /// Number of road users of the traffic for which there was no place; absent without traffic.
    #[serde(skip_serializing_if = "Option::is_none")]
    road_users_left_out: Option<usize>,
}

/// Runs `swerve suite --rules nhtsa`.
pub(super) fn run(args: &SuiteArgs, registry: &Registry) -> anyhow::Result<()> {
    let given = match args.scenarios.is_empty() {
        true => vec![PathBuf::from(FOLDER)],
        false => args.scenarios.clone(),
    };
    let seeds: BTreeSet<i64> =
        args.seeds.as_ref().map_or_else(|| Ok((0..SEEDS).collect()), super::Seeds::counted)?;
    let steps = named_scenarios(&given)?.into_iter().map(of_scenario).collect();
    let (study, driven) = drive(args, registry, steps, &seeds)?;
    finish(&study, &driven, None)?;
    print(&match args.json {
        true => serde_json::to_string_pretty(&Results::of(&study, &driven.0)?)? + "\n",
        false => text(&study, &driven.0),
    })
}

impl Results {
    fn of(study: &Study, results: &[Option<CellResult>]) -> anyhow::Result<Self> {
        let count = Count::of(results);
        let seeds = study.steps[1].len();
        let named = study.steps[0].iter().zip(results.chunks(seeds));
        let scenarios = named.map(|(step, of_scenario)| {
            let digits = step.label.split('_').next().unwrap_or_default();
            let drives = of_scenario.iter().flatten().map(Drive::of).collect::<anyhow::Result<_>>()?;
            Ok(Scenario { scenario: step.label.clone(), number: digits.parse().ok(), drives })
        });
        let scenarios = scenarios.collect::<anyhow::Result<_>>()?;
        Ok(Self { as_expected: count.kept, drives: count.held() + count.free, scenarios })
    }
}

impl Drive {
    fn of(result: &CellResult) -> anyhow::Result<Self> {
        Ok(Self {
            seed: result.labels[1].parse()?,
            verdict: result.verdict.clone(),
            as_expected: result.as_expected(),
            not_as_expected: result.not_as_expected().to_owned(),
            min_distance_m: result.min_distance_m,
            impact_speed_mps: result.impact_speed_mps,
            road_users_left_out: result.road_users_left_out(),
        })
    }
}
