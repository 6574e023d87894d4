#![no_main]
//! Maps of CommonRoad beside recorded tracks.

use swerve_prediction::recorded::commonroad_lanelets;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _either_way = commonroad_lanelets(text).is_ok();
});
