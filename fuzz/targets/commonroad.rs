#![no_main]
//! Scenarios of CommonRoad in XML and in the protobuf format, made to scenarios of Swerve; texts of solutions, checked.

use swerve_commonroad::{Scenario, Solution, check, xml_of_protobuf};

/// A scenario to check solutions by.
const SMALL: &str = include_str!("../../crates/swerve-commonroad/src/read/tests/small.xml");

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => match xml_of_protobuf(bytes) {
            Ok(text) => text,
            Err(error) => {
                assert!(error.at <= bytes.len() && !error.message.is_empty());
                return;
            }
        },
    };
    match Scenario::read("fuzz.xml", &text) {
        Ok(scenario) => {
            if let Ok(toml) = scenario.to_toml("fuzz.xml") {
                let map = text.as_str().into();
                let _either_way = swerve_scenario::Scenario::parse_on("fuzz.toml", &toml, Some(&map), &[]);
            }
        }
        Err(problems) => assert!(!problems.is_empty() && problems.iter().all(|problem| problem.line > 0)),
    }
    if let Ok(solution) = Solution::read("fuzz.xml", &text) {
        let scenario = Scenario::read("small.xml", SMALL).expect("it is one");
        let _verdict = check(&scenario, &solution).to_string();
    }
});
