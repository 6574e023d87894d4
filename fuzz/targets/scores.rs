#![no_main]
//! `swerve eval score` on any records of routes.

libfuzzer_sys::fuzz_target!(|text: &str| swerve_fuzz::evaluate_one(&["score"], "json", text));
