#![no_main]
//! A recorded drive as NumPy's arrays, and a filter over what is in it.

use swerve_localization::npz;
use swerve_localization::recorded::{Preset, Recorded};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(arrays) = npz::read(bytes) else { return };
    let Ok(drive) = Recorded::new(&arrays) else { return };
    for preset in [Preset::Best, Preset::Paper] {
        let _either_way = drive.run(drive.params(preset), preset).is_ok();
    }
});
