#![no_main]
//! Study files: any text is one, or is refused. What it names is looked for in the program.

use swerve_fuzz::Scratch;
use swerve_study::grid::Study;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let file = Scratch::file("study.toml", text.as_bytes());
    let _either_way = Study::read(file.path(), &[]).is_ok();
});
