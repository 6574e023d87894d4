#![no_main]
//! Files of a predictor's weights.

use swerve_prediction::learned::Weights;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _either_way = Weights::read(bytes).is_ok();
});
