//! Predictions by learned predictors.

use std::sync::LazyLock;

use swerve_core::{Span, Time};
use swerve_geom::Point2;

use super::drawn::{Spot, mode};
use super::{Horizon, Modes, PredictorName, Tracked};
use crate::learned::{Frame, Way, Weights, sights};

/// Standard deviation of the present position, in scaled units.
const NOW_SIGMA: f32 = 0.03;

macro_rules! shipped {
    ($file:literal) => {
        LazyLock::new(|| {
            Weights::read(include_bytes!(concat!("../../weights/", $file))).expect("what is shipped is whole")
        })
    };
}

static MULTIPATH: LazyLock<Weights> = shipped!("multipath.weights");
static MFP: LazyLock<Weights> = shipped!("mfp.weights");
static R2P2: LazyLock<Weights> = shipped!("r2p2.weights");

/// Shipped weights of a learned predictor; `None` for others.
pub(super) fn shipped(name: PredictorName) -> Option<&'static Weights> {
    match name {
        PredictorName::Multipath => Some(&MULTIPATH),
        PredictorName::Mfp => Some(&MFP),
        PredictorName::R2p2 => Some(&R2P2),
        _ => None,
    }
}

/// Predictions with one mode per path of the net.
pub(super) fn predictions(seen: &[Tracked], stamp: Time, horizon: &Horizon, weights: &Weights) -> Vec<Modes> {
    let step = Span::from_ms(i64::from(weights.shape.step_ms));
    let sights = sights(seen, stamp, &weights.shape);
    let all = weights.ways(&sights);
    let of_one = |((seen, sight), ways): ((&Tracked, &crate::learned::Sight), Vec<Way>)| {
        let total: f64 = ways.iter().map(|way| f64::from(way.probability)).sum();
        let modes = ways.iter().map(|way| {
            let spots = spots(way, &sight.frame, horizon, step);
            mode(f64::from(way.probability) / total, seen, stamp, (horizon, &spots))
        });
        modes.collect()
    };
    seen.iter().zip(&sights).zip(all).map(of_one).collect()
}

/// Positions at the horizon's instants: interpolated between the net's steps, extrapolated after the last.
fn spots(way: &Way, frame: &Frame, horizon: &Horizon, step: Span) -> Vec<Spot> {
    let now = NOW_SIGMA * NOW_SIGMA;
    let first = (frame.origin, frame.covariance_m2([now, 0.0, now]));
    let others = way.places.iter().map(|(at, of)| (frame.point(*at), frame.covariance_m2(*of)));
    let knots: Vec<Spot> = core::iter::once(first).chain(others).collect();
    let last = knots.len() - 1;
    let spot = |k: usize| {
        let after = k as f64 * horizon.step.as_secs() / step.as_secs();
        let from = (after.floor() as usize).min(last - 1);
        let share = after - from as f64;
        let ((a, a_m2), (b, b_m2)) = (knots[from], knots[from + 1]);
        let point: Point2 = a + (b - a) * share;
        let covariance_m2 = match from + 1 == last && share > 1.0 {
            true => b_m2.map(|one| one * (after / last as f64) * (after / last as f64)),
            false => [0, 1, 2].map(|i| a_m2[i] * (1.0 - share) + b_m2[i] * share),
        };
        (point, covariance_m2)
    };
    (0..=horizon.steps).map(spot).collect()
}
