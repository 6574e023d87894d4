#![no_main]
//! Lanelet2 maps: read, described and drawn.

libfuzzer_sys::fuzz_target!(|text: &str| match swerve_map_io::lanelet2::read("fuzz.osm", text) {
    Ok(map) => swerve_fuzz::shown(&map.lanes, text.len()),
    Err(problems) => assert!(!problems.is_empty() && problems.iter().all(|problem| problem.line > 0)),
});
