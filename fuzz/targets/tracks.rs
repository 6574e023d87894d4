#![no_main]
//! Files of recorded tracks, plain or packed by gzip, as both formats have them; who is in them is foretold, and played at
//! another speed.

use swerve_prediction::recorded::{Protocol, RecordedTrack, Recording, commonroad_csv, eth_ucy};
use swerve_prediction::{Ground, Horizon, PredictorName, predict};
use swerve_text::unpacked;

/// By one of the predictors, which the size of the file draws.
fn foretold(recording: &Recording, size: usize) {
    let horizon = Horizon { steps: 4, step: recording.step };
    let predictor = PredictorName::ALL[size % PredictorName::ALL.len()];
    for scene in recording.scenes(&Protocol { predict_min: 1, ..Protocol::whole(3, 4) }) {
        let _foretold = predict(predictor, &scene.tracks, &horizon, Ground::Open);
    }
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = unpacked(bytes.to_vec()) else { return };
    let people = eth_ucy(&text).into_iter();
    for recording in people.chain(commonroad_csv(&text).into_iter().flatten().map(|(_, one)| one)) {
        foretold(&recording, bytes.len());
        // Steps far apart make long ones.
        let is_short = |track: &RecordedTrack| {
            track.samples.first().zip(track.samples.last()).is_none_or(|(a, b)| b.0 - a.0 < 10_000)
        };
        if recording.tracks.iter().all(is_short) {
            [-1.0, 0.3, 2.5].iter().for_each(|speed| foretold(&recording.played(*speed), bytes.len()));
        }
    }
});
