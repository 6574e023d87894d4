//! The situations of `scenarios/maps` on published maps: crossings with lights and without, oncoming traffic, a bend,
//! places where lanes meet, a parked truck, a closed road.

mod lanelets;
mod town01;

use swerve_drive::drive;
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_tests::data_or_skip;

/// Expected of every drive; the keys of a situation follow. An ego that goes through a gap may steer firmly.
const EXPECTED: &str = "lateral_accel_max_mps2 = { max = 3.5 }\nred_lights_passed = { max = 0.0 }\n";

/// A drive on a map of the test data.
struct Situation {
    name: &'static str,
    /// Path among the test data.
    map: &'static str,
    /// Tables of the scenario between `[map]` and `[expect]`.
    drive: &'static str,
    /// Keys of `[expect]`, worked out by hand, beside those of [`EXPECTED`].
    expect: &'static str,
}

impl Situation {
    /// The scenario; `None`, and counted as skipped, without the map.
    fn scenario(&self) -> Option<Scenario> {
        let map = data_or_skip(self.map)?;
        let Self { name, drive, expect, .. } = self;
        let file = map.file_name().unwrap().to_str().unwrap();
        let text =
            format!("name = {name:?}\n[map]\nfile = {file:?}\n{drive}\n[expect]\n{EXPECTED}{expect}\n");
        let beside = map.with_file_name("situation.toml");
        Some(Scenario::parse(beside.to_str().unwrap(), &text).unwrap_or_else(|e| panic!("{name}: {e}")))
    }
}

/// Drives the situations whose maps are there.
fn all_are_as_expected(situations: &[Situation]) {
    let setup = Setup::default();
    let mut wrong = Vec::new();
    for scenario in situations.iter().filter_map(Situation::scenario) {
        let outcome = drive(&setup, &scenario).unwrap();
        let expected = scenario.expectation(&setup.pipeline_name()).unwrap();
        wrong.extend(outcome.broken(expected).iter().map(|what| format!("{}: {what}", scenario.name)));
    }
    assert!(wrong.is_empty(), "{} wrong\n{}", wrong.len(), wrong.join("\n"));
}
