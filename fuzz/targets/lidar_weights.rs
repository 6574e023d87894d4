#![no_main]
//! Files of a lidar detector's weights.

use swerve_perception::lidar::score::Model;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _either_way = Model::parse(text).is_ok();
});
