#![no_main]
//! A recorded drive as NumPy's arrays, as they are and with their checksums put right, and a filter over what is in it.

use swerve_fuzz::zip_with_checksums;
use swerve_localization::npz;
use swerve_localization::recorded::{Preset, Recorded};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _either_way = npz::read(bytes).is_ok();
    let Ok(arrays) = npz::read(&zip_with_checksums(bytes.to_vec())) else { return };
    let Ok(drive) = Recorded::new(&arrays) else { return };
    for preset in [Preset::Best, Preset::Paper] {
        let _either_way = drive.run(drive.params(preset), preset).is_ok();
    }
});
