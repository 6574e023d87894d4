#![no_main]
//! Maps of CommonRoad beside recorded tracks: read, tracks moved onto their lanes, and foretold along them.

use std::sync::Arc;

use swerve_core::Span;
use swerve_prediction::recorded::{Protocol, commonroad_csv, commonroad_lanelets};
use swerve_prediction::{Ground, Horizon, PredictorName, predict};

libfuzzer_sys::fuzz_target!(|text: &str| {
    let Ok(lanes) = commonroad_lanelets(text).map(Arc::new) else { return };
    let recordings = commonroad_csv(&swerve_fuzz::recording()).expect("it is one");
    let horizon = Horizon { steps: 20, step: Span::from_ms(100) };
    for recording in recordings.values() {
        let _either_way = recording.placed(&lanes);
        for scene in recording.scenes(&Protocol::whole(8, 2)) {
            let _foretold = predict(PredictorName::LaneIdm, &scene.tracks, &horizon, Ground::Lanes(&lanes));
        }
    }
});
