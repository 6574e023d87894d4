//! Training is deterministic, and damaged weight files are rejected.

use swerve_core::{Hasher, Span};
use swerve_geom::Point2;
use swerve_msg::{ActorId, ActorKind, Extent, Prediction};

use super::train::loss;
use super::*;
use crate::net::drawn;
use crate::net::gradients::check;
use crate::recorded::{Protocol, RecordedTrack, Recording};
use crate::{Ground, Horizon, predict_by};

const MODELS: [Model; 3] = [Model::Multipath, Model::Mfp, Model::R2p2];

fn shape(model: Model) -> Shape {
    Shape { model, modes: 2, hidden: 8, steps: 5, step_ms: 400, beside: Beside::Straight }
}

fn learning() -> Learning {
    Learning {
        seed: 3,
        steps: 60,
        batch: 16,
        rate: 3e-3,
        stretch: 0.1,
        noise: 0.01,
        distance: 0.5,
        mixed: 0.0,
        noise_spread: 0.0,
        average: 0.0,
        shrink: 0.0,
    }
}

/// Pedestrians who turn left, in pairs.
fn turning(count: u32) -> Recording {
    let person = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
    let track = |id: u32| {
        let place = |step: i64| {
            let (sin, cos) = swerve_geom::math::sin_cos(0.12 * step as f64 + f64::from(id));
            (step, Point2::new(4.0 * sin + f64::from(id % 2), 3.0 * f64::from(id) - 4.0 * cos))
        };
        let samples = (0..20).map(place).collect();
        RecordedTrack { id: ActorId(id), kind: ActorKind::Pedestrian, extent: person, samples }
    };
    Recording { step: Span::from_ms(400), tracks: (0..count).map(track).collect(), lanes: None }
}

fn digest(bytes: &[u8]) -> String {
    let mut hasher = Hasher::new();
    hasher.bytes(bytes);
    hasher.digest().to_string()
}

fn learnt(model: Model) -> Weights {
    let shape = shape(model);
    let examples = examples(&[turning(6)], &shape, 1);
    train("a test".into(), shape, (&examples, &learning()), &mut |_, _| {}).unwrap()
}

#[test]
fn gradients_of_whole_nets_match_central_differences() {
    for model in [Model::Multipath, Model::R2p2, Model::Mfp] {
        // `mfp` does not differentiate through predicted positions, on which a roll-out of one step does not depend.
        let steps = if model == Model::Mfp { 1 } else { 3 };
        let shape = Shape { steps, ..shape(model) };
        let examples = examples(&[turning(3)], &shape, 4);
        let mut shapes = crate::net::Shapes::default();
        let net = Net::of(&shape, &mut shapes);
        let weights = drawn(&shapes.list(), 9);
        let anchors = vec![vec![0.0; 2 * steps], vec![9.0; 2 * steps]];
        check(&weights, &|weights| {
            let batch = &examples[..3];
            // The distance loss of `multipath` affects only the means, so it is disabled to compare gradients.
            loss(&net, (&shape, &anchors), weights, (batch, [0.0, 0.3]))
        });
    }
}

/// These digests fix the bytes on every machine.
#[test]
fn trained_weights_are_reproducible_byte_for_byte() {
    let found = MODELS.map(|model| digest(&learnt(model).write()));
    assert_eq!(found, ["5c247825e7213a36", "e29ad1fe00c06ad6", "90d3003a8b624e17"]);
}

#[test]
fn trained_nets_beat_straight_extrapolation_on_turns() {
    let recording = turning(8);
    let protocol = Protocol::whole(8, 5);
    let horizon = Horizon { steps: 5, step: Span::from_ms(400) };
    let off_m = |list: &dyn Fn(&swerve_msg::TrackList) -> swerve_msg::PredictionList| {
        let (mut sum, mut count) = (0.0, 0.0);
        for scene in recording.scenes(&protocol) {
            let list = list(&scene.tracks);
            for window in &scene.windows {
                let likeliest = Prediction::likeliest(list.modes_of(window.id)).unwrap();
                sum += likeliest.path[5].pose.point().distance(window.truth[4]);
                count += 1.0;
            }
        }
        sum / count
    };
    let straight = off_m(&|tracks| {
        crate::predict(crate::PredictorName::ConstantVelocity, tracks, &horizon, crate::Ground::Open)
    });
    for model in MODELS {
        let shape = Shape { hidden: 16, ..shape(model) };
        let examples = examples(&[turning(6)], &shape, 1);
        let learning = Learning { steps: 300, ..learning() };
        let weights = train(String::new(), shape, (&examples, &learning), &mut |_, _| {}).unwrap();
        let off = off_m(&|tracks| predict_by(&weights, tracks, &horizon, Ground::Open));
        assert!(off < 0.5 * straight, "{model:?}: {off} m, straight on {straight} m");
    }
}

#[test]
fn damaged_weight_files_are_rejected() {
    for model in MODELS {
        let weights = learnt(model);
        let bytes = weights.write();
        assert_eq!(Weights::read(&bytes), Ok(weights.clone()));
        for cut in [0, 5, 8, 9, 12, 17, 40, bytes.len() - 1] {
            assert!(Weights::read(&bytes[..cut]).is_err(), "cut at {cut}");
        }
        for bit in (0..8 * bytes.len()).step_by(97) {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(Weights::read(&flipped).is_err(), "bit {bit}");
        }
        let other = Shape { hidden: 9, ..weights.shape };
        let said = |weights: Weights| Weights::read(&weights.write()).unwrap_err().to_string();
        assert!(said(Weights { shape: other, ..weights.clone() }).contains("expected matrices of [["));
        let none = Shape { hidden: 0, ..weights.shape };
        assert!(
            said(Weights { shape: none, ..weights.clone() }).contains("`hidden` is 0, expected 4 to 256")
        );
        let mut nan = weights.clone();
        nan.matrices[0].values[0] = f32::NAN;
        assert!(said(nan).contains("expected numbers below 10000, found NaN"));
        let mut short = weights.clone();
        short.matrices[1].values.pop();
        assert!(said(short).contains("numbers"));
    }
    let said = |bytes: &[u8]| Weights::read(bytes).unwrap_err().to_string();
    assert!(said(b"SWERVSEG\x01").contains("SWERVNET"));
    assert!(said(b"SWERVNET\x07").contains("version 7, expected 1 or 2"));
}

/// The file of a net relative to filters records that, and with all training shrunk away its paths are those of the
/// filters.
#[test]
fn net_relative_to_filters_is_stored_and_shrinks_to_them() {
    let shape = Shape { beside: Beside::Imm, modes: 1, ..shape(Model::Multipath) };
    let examples = examples(&[turning(6)], &shape, 1);
    let learning = Learning { mixed: 0.5, noise_spread: 0.5, average: 0.9, shrink: 1.0, ..learning() };
    let weights = train("a test".into(), shape, (&examples, &learning), &mut |_, _| {}).unwrap();
    let bytes = weights.write();
    assert_eq!((bytes[8], Weights::read(&bytes)), (2, Ok(weights.clone())));
    assert!(Weights::read(&bytes[..40]).is_err());
    let horizon = Horizon { steps: 5, step: Span::from_ms(400) };
    let scene = turning(3).scenes(&Protocol::whole(8, 5)).remove(0);
    let (found, filters) = (
        predict_by(&weights, &scene.tracks, &horizon, Ground::Open),
        crate::predict(crate::PredictorName::Imm, &scene.tracks, &horizon, crate::Ground::Open),
    );
    let filters = Prediction::by_actor(&filters.predictions);
    for (a, modes) in Prediction::by_actor(&found.predictions).zip(filters) {
        let path = Prediction::likeliest(modes).unwrap().path.iter();
        let off_m = a[0].path[1..].iter().zip(path.skip(1));
        let most = off_m.map(|(a, b)| a.pose.point().distance(b.pose.point())).fold(0.0, f64::max);
        assert!(most < 1e-5, "{most}");
    }
}

#[test]
fn training_parameters_are_checked() {
    let shape = shape(Model::Multipath);
    let all = examples(&[turning(2)], &shape, 1);
    let said = |learning: Learning, shape: Shape, all: &[Example]| {
        train(String::new(), shape, (all, &learning), &mut |_, _| {}).unwrap_err().to_string()
    };
    assert_eq!(said(Learning { batch: 0, ..learning() }, shape, &all), "`batch` is 0, expected 1 to 4096");
    assert!(said(learning(), Shape { modes: 0, ..shape }, &all).starts_with("`modes` is 0"));
    assert!(said(Learning { rate: f32::NAN, ..learning() }, shape, &all).starts_with("`rate` is NaN"));
    assert!(said(learning(), shape, &[]).contains("found none"));
    assert!(said(Learning { shrink: 1.5, ..learning() }, shape, &all).starts_with("`shrink` is 1.5"));
    let filtered = Shape { model: Model::R2p2, beside: Beside::Imm, ..shape };
    assert!(said(learning(), filtered, &all).contains("expected `straight`"));
}

/// Examples of a fine recording equal those of a coarse one.
#[test]
fn finer_recordings_are_sampled_at_the_steps_of_the_net() {
    let shape = shape(Model::R2p2);
    let walks = |step_ms: i64, count: i64| {
        let place = |k: i64| (k, Point2::new(1.4 * (k * step_ms) as f64 * 1e-3, 2.0));
        let person = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
        let track = RecordedTrack {
            id: ActorId(1),
            kind: ActorKind::Pedestrian,
            extent: person,
            samples: (0..count).map(place).collect(),
        };
        Recording { step: Span::from_ms(step_ms), tracks: vec![track], lanes: None }
    };
    let coarse = examples(&[walks(400, 13)], &shape, 1);
    let fine = examples(&[walks(100, 49)], &shape, 1);
    assert_eq!((coarse.len(), fine.len()), (1, 1));
    for (a, b) in [&coarse, &fine]
        .iter()
        .flat_map(|one| one[0].truth.iter())
        .zip(coarse[0].truth.iter().chain(&coarse[0].truth))
    {
        assert!((a[0] - b[0]).abs() < 1e-5 && (a[1] - b[1]).abs() < 1e-5);
    }
    assert!((coarse[0].truth[4][0] - 5.0 * 0.56).abs() < 1e-5);
}

#[test]
fn shipped_weights_match_their_recipes() {
    for name in crate::PredictorName::ALL {
        let Some(weights) = crate::shipped(name) else { continue };
        let path = format!("{}/weights/{}.toml", env!("CARGO_MANIFEST_DIR"), name.name());
        let recipe = std::fs::read_to_string(path).unwrap();
        let digest = swerve_core::digest_of(&recipe);
        let source = format!("swerve train prediction {}.toml (recipe {digest})", name.name());
        assert_eq!(weights.source, source);
        assert!((4_000..100_000).contains(&weights.count()), "{}", weights.count());
    }
}
