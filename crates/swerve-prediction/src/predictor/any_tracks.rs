//! Property test: predictions are valid for arbitrary tracks.

use proptest::prelude::*;
use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline, Pose2, Vector2, math};
use swerve_msg::{ActorId, ActorKind, Extent, Prediction, Route, Sighting, Track, TrackList};

use super::{Ground, Horizon, PredictorName, predict};

/// A sighting relative to the one before: delay (possibly negative) and displacement, with rare jumps.
fn sighting() -> impl Strategy<Value = (i64, f64, f64)> {
    let later_ms = prop_oneof![8 => Just(50_i64), 2 => 0_i64..3000, 1 => -500_i64..0];
    let off_m = prop_oneof![12 => -2.0..2.0, 1 => -1e6..1e6, 1 => Just(0.0), 1 => Just(1e-300)];
    (later_ms, off_m.clone(), off_m).boxed()
}

fn track() -> impl Strategy<Value = Track> {
    let kind = prop_oneof![
        Just(ActorKind::Pedestrian),
        Just(ActorKind::Car),
        Just(ActorKind::Truck),
        Just(ActorKind::Cyclist),
        Just(ActorKind::Static),
    ];
    let number =
        prop_oneof![20 => -200.0..200.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(1e300)];
    let size = prop_oneof![20 => 0.1..20.0, 1 => Just(0.0), 1 => Just(f64::NAN)];
    let past = prop::collection::vec(sighting(), 0..40);
    (0_u32..6, kind, [number.clone(), number.clone(), number.clone(), number], [size.clone(), size], past)
        .prop_map(|(id, kind, [x_m, y_m, vx, vy], [length_m, width_m], past)| {
            let (mut at_ms, mut place) = (0_i64, Point2::new(x_m, y_m));
            let mut history: Vec<Sighting> = past
                .into_iter()
                .map(|(later_ms, x, y)| {
                    at_ms += later_ms;
                    place = place + Vector2::new(x, y);
                    Sighting { at: Time::from_ms(at_ms), point: place }
                })
                .collect();
            // The latest sighting is at the present.
            history.iter_mut().for_each(|one| one.at = one.at - Span::from_ms(at_ms));
            let extent = Extent { length_m, width_m, height_m: 1.5 };
            let pose = Pose2::new(place.x_m, place.y_m, 0.3);
            Track { id: ActorId(id), kind, pose, extent, velocity_mps: Vector2::new(vx, vy), history }
        })
}

/// A road through the middle of all tracks, with a bend of 60 m radius.
fn bend() -> Route {
    let at = |k: i32| {
        let (sin, cos) = math::sin_cos(f64::from(k) / 60.0);
        Point2::new(60.0 * sin, 60.0 * (1.0 - cos))
    };
    Route::uniform(Polyline::new(&(-60..=60).map(at).collect::<Vec<_>>()).unwrap(), 6.0, 2.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Gaps, jumps, decreasing stamps, NaNs, repeated identities: every plausible actor has modes whose probabilities
    /// sum to 1, at the requested instants, with finite positions and valid covariances.
    #[test]
    fn predictions_are_valid_for_arbitrary_tracks(tracks in prop::collection::vec(track(), 0..8)) {
        let list = TrackList { stamp: Time::ZERO, tracks };
        let horizon = Horizon { steps: 12, step: Span::from_ms(250) };
        let plausible: Vec<ActorId> =
            list.tracks.iter().filter(|track| track.is_plausible()).map(|track| track.id).collect();
        let road = bend();
        let named = PredictorName::ALL.into_iter().chain([PredictorName::Truth]);
        for (name, ground) in named.flat_map(|name| [Ground::Open, Ground::Road(&road)].map(|ground| (name, ground))) {
            let found = predict(name, &list, &horizon, ground);
            // Adjacent tracks of one identity have their modes together.
            let expected = plausible.chunk_by(|a, b| a == b);
            let modes: Vec<&[Prediction]> = Prediction::by_actor(&found.predictions).collect();
            prop_assert_eq!(modes.len(), expected.clone().count(), "{:?}", name);
            for (modes, ids) in modes.iter().zip(expected) {
                let sum: f64 = modes.iter().map(|mode| mode.probability).sum();
                prop_assert_eq!(modes[0].id, ids[0], "{:?}", name);
                prop_assert!((sum - ids.len() as f64).abs() < 1e-9, "{name:?}: {sum}");
            }
            for mode in &found.predictions {
                prop_assert_eq!((mode.path.len(), mode.covariances_m2.len()), (13, 13));
                for (k, (at, &[xx, xy, yy])) in mode.path.iter().zip(&mode.covariances_m2).enumerate() {
                    prop_assert_eq!(at.at, Time::ZERO + horizon.step * k as i64);
                    prop_assert!(at.pose.is_finite(), "{name:?}: {at:?}");
                    prop_assert!(xx > 0.0 && yy > 0.0 && xx * yy > xy * xy, "{name:?}: {at:?}");
                }
            }
        }
    }
}
