#![no_main]
//! Images in files.

use swerve_fuzz::Scratch;
use swerve_measure::picture::read_png;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = Scratch::file("image.png", bytes);
    let _either_way = read_png(file.path()).is_ok();
});
