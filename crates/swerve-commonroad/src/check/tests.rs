//! The 180 solutions with their official verdicts and costs.

use std::collections::BTreeMap;

use serde_json::Value;
use swerve_tests::data_or_skip;

use crate::{CostFunction, Scenario, Solution, check, costs};

fn text(path: &std::path::Path) -> String {
    swerve_text::unpacked(std::fs::read(path).unwrap()).unwrap()
}

/// Largest relative difference of the costs.
const SAME: f64 = 1e-6;

#[test]
fn verdicts_and_costs_are_those_of_the_official_checker() {
    let Some(folder) = data_or_skip("worlds/commonroad") else { return };
    let rows: Vec<Value> =
        serde_json::from_str(&std::fs::read_to_string(folder.join("checked/verdicts.json")).unwrap())
            .unwrap();
    let mut scenarios = BTreeMap::new();
    let (mut wrong, mut parts) = (Vec::new(), BTreeMap::<&str, usize>::new());
    for row in &rows {
        let word = |key: &str| row[key].as_str().unwrap().to_owned();
        let name = word("scenario");
        let scenario = scenarios
            .entry(name.clone())
            .or_insert_with(|| Scenario::read(&name, &text(&folder.join("ngsim").join(&name))).unwrap());
        let file = word("solution");
        let solution = Solution::read(&file, &text(&folder.join("checked").join(&file))).unwrap();
        let verdict = check(scenario, &solution);
        if (verdict.official(), verdict.is_valid()) != (&*word("why"), row["valid"] == true) {
            wrong.push(format!("{file}: official `{}`, own:\n{verdict}", word("why")));
        }
        let driven = &solution.driven[0];
        let problem = scenario.problem(driven.problem).unwrap();
        // Where the official evaluation fails, it has the name of its exception.
        let functions = row["costs"].as_object().into_iter().flatten().filter(|(_, of)| of.is_object());
        for (function, of) in functions {
            let own = costs(CostFunction::named(function).unwrap(), problem, driven, scenario.step_s);
            for (part, _, value) in own.parts.iter() {
                let (Some(value), official) = (value, of["parts"][part.name()].as_f64().unwrap()) else {
                    continue;
                };
                *parts.entry(part.name()).or_default() += 1;
                if (value - official).abs() > SAME * official.abs() {
                    wrong.push(format!(
                        "{file}: {function} {}: official {official}, own {value}",
                        part.name()
                    ));
                }
            }
            if let Some(total) = own.total() {
                let official = of["total"].as_f64().unwrap();
                assert!((total - official).abs() <= SAME * official.abs(), "{file}: {function}");
            }
        }
    }
    assert_eq!(rows.len(), 180);
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
    let names: Vec<&str> = parts.keys().copied().collect();
    assert_eq!(names, ["A", "ID", "J", "L", "SA", "SR", "T", "V"]);
    assert!(parts.values().all(|count| *count >= 29), "{parts:?}");
}
