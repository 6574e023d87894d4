#![no_main]
//! `swerve eval` on any files: both sides of the comparison are of the fuzzed text, parted by a line of `---`.

libfuzzer_sys::fuzz_target!(|text: &str| swerve_fuzz::evaluate(
    &["detection", "--format", "coco"],
    "json",
    text
));
