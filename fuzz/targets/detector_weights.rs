#![no_main]
//! Files of a camera detector's weights.

use swerve_vision::acf::Weights;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _either_way = Weights::read(bytes).is_ok();
});
