#![no_main]
//! Files of the weights that label pixels.

use swerve_vision::segmentation::Weights;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _either_way = Weights::read(bytes).is_ok();
});
