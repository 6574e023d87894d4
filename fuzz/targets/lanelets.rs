#![no_main]
//! Maps of CommonRoad: read, described and drawn; beside recorded tracks: tracks moved onto their lanes, and predicted
//! along them.

use std::sync::Arc;

use swerve_core::Span;
use swerve_map_io::commonroad::{Centers, read};
use swerve_prediction::recorded::{Protocol, commonroad_csv};
use swerve_prediction::{Ground, Horizon, PredictorName, predict};

libfuzzer_sys::fuzz_target!(|text: &str| {
    let rounded = read("fuzz.xml", text, Centers::Rounded);
    match &rounded {
        Ok(roads) => swerve_fuzz::shown(&roads.lanes, text.len()),
        Err(problems) => assert!(!problems.is_empty() && problems.iter().all(|problem| problem.line > 0)),
    }
    let Ok(roads) = read("fuzz.xml", text, Centers::Middles) else { return };
    let lanes = Arc::new(roads.lanes.map);
    let recordings = commonroad_csv(&swerve_fuzz::recording()).expect("it is one");
    let horizon = Horizon { steps: 20, step: Span::from_ms(100) };
    for recording in recordings.values() {
        let _either_way = recording.placed(&lanes);
        for scene in recording.scenes(&Protocol::whole(8, 2)) {
            let _foretold = predict(PredictorName::LaneIdm, &scene.tracks, &horizon, Ground::Lanes(&lanes));
        }
    }
});
