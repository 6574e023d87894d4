#![no_main]
//! Scenarios: any text is one, or is refused.

use swerve_scenario::Scenario;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _either_way = Scenario::parse("fuzzed.toml", text).is_ok();
});
