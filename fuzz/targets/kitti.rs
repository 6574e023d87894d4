#![no_main]
//! `swerve eval detection --format kitti` on any files, a frame each side, parted by a line of `---`.

libfuzzer_sys::fuzz_target!(|text: &str| swerve_fuzz::evaluate_folders(
    &["detection", "--format", "kitti"],
    text
));
