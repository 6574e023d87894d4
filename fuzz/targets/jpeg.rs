#![no_main]
//! JPEG files, recognised by their first bytes.

use swerve_fuzz::Scratch;
use swerve_measure::picture::Picture;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = Scratch::file("image.jpg", &[&[0xff, 0xd8], bytes].concat());
    if let Ok(picture) = Picture::read(file.path(), 16) {
        assert!(picture.rgb().is_ok(), "what was read is whole");
    }
});
