#![no_main]
//! Files of a predictor's weights, as they are and with their digest put right; what is read foretells.

use swerve_core::Span;
use swerve_fuzz::weights_with_digest;
use swerve_prediction::learned::Weights;
use swerve_prediction::recorded::{Protocol, commonroad_csv};
use swerve_prediction::{Ground, Horizon, predict_by};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _either_way = Weights::read(bytes).is_ok();
    let Ok(weights) = Weights::read(&weights_with_digest(bytes.to_vec())) else { return };
    let recordings = commonroad_csv(&swerve_fuzz::recording()).expect("it is one");
    let horizon = Horizon { steps: 20, step: Span::from_ms(100) };
    for scene in recordings.values().flat_map(|recording| recording.scenes(&Protocol::whole(8, 2))) {
        let _foretold = predict_by(&weights, &scene.tracks, &horizon, Ground::Open);
    }
});
