//! Predictor from the future ground truth, for experiments.

use swerve_core::{Rng, Span, Time};
use swerve_geom::{Point2, Vector2};
use swerve_msg::{PredictionList, Track, TrackList};

use super::drawn::{Spot, direction, mode};
use super::{Horizon, Modes, Tracked, seen, straight};
use crate::wander::wander;

/// Standard deviation of a noise-free position, metres: covariances must be positive definite.
const SIGMA_M: f64 = 0.03;

/// Extent and noise of the provided ground truth.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Telling {
    /// Horizon of the ground truth, after which all actors move straight ahead. `None`: as far as requested.
    pub horizon: Option<Span>,
    /// Standard deviation of the error along each axis, metres per second ahead. Errors are drawn per actor and
    /// stamp.
    pub noise_mps: f64,
    /// Seed of these draws.
    pub seed: u64,
}

/// Source of ground truth: positions of a track's actor at instants from the list's stamp on, or `None` if unknown.
pub type Told<'a> = &'a dyn Fn(&Track, &[Time]) -> Option<Vec<Point2>>;

/// Predicts every track from the ground truth; actors without one keep the velocity of the last half second.
pub fn foretold(tracks: &TrackList, horizon: &Horizon, telling: &Telling, told: Told<'_>) -> PredictionList {
    let stamp = tracks.stamp;
    let instants: Vec<Time> = horizon.instants(stamp).collect();
    let within = |at: &Time| telling.horizon.is_none_or(|most| *at - stamp <= most);
    let known = instants.partition_point(within).max(1);
    let of_one = |seen: &Tracked| -> Option<Modes> {
        let places = told(seen.track, &instants[..known]);
        match places.filter(|places| places.len() == known && places.iter().all(|at| at.is_finite())) {
            Some(places) => Some(one(seen, (stamp, horizon), telling, &places)),
            None => straight::constant_velocity(core::slice::from_ref(seen), stamp, horizon).pop(),
        }
    };
    let predictions = seen(tracks).iter().filter_map(of_one).flatten().collect();
    PredictionList { stamp, predictions, joint: false }
}

/// Prediction through the provided positions, with their errors, and straight ahead after them.
fn one(seen: &Tracked, (stamp, horizon): (Time, &Horizon), telling: &Telling, places: &[Point2]) -> Modes {
    let mut rng = Rng::keyed(telling.seed, "truth", &[stamp.ns(), i64::from(seen.track.id.0)]);
    let off_mps: Vector2 = Vector2::new(rng.normal(), rng.normal()) * telling.noise_mps;
    let (step_s, last) = (horizon.step.as_secs(), places.len() - 1);
    let on_mps = match places {
        [.., before, end] => (*end - *before) * (1.0 / step_s),
        _ => seen.past.velocity_mps(straight::VELOCITY_WINDOW_S),
    };
    let wander = wander(seen.past.kind);
    let spot = |k: usize| -> Spot {
        let (after_s, beyond_s) = (step_s * k as f64, step_s * k.saturating_sub(last) as f64);
        let place = places[k.min(last)] + on_mps * beyond_s + off_mps * after_s;
        let variance = SIGMA_M * SIGMA_M + (telling.noise_mps * after_s) * (telling.noise_mps * after_s);
        let [xx, xy, yy] = match beyond_s > 0.0 {
            true => wander.covariance_m2(direction(on_mps, seen.track.pose.heading_rad), beyond_s),
            false => [0.0; 3],
        };
        (place, [xx + variance, xy, yy + variance])
    };
    let spots: Vec<Spot> = (0..=horizon.steps).map(spot).collect();
    vec![mode(1.0, seen, stamp, (horizon, &spots))]
}

#[cfg(test)]
mod tests {
    use swerve_geom::Pose2;
    use swerve_msg::{ActorId, ActorKind, Extent, Sighting};

    use super::*;
    use crate::{PredictorName, predict};

    const HORIZON: Horizon = Horizon { steps: 20, step: Span::from_ms(100) };

    fn tracks() -> TrackList {
        let track = |id: u32| {
            let extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
            let at = |k: i64| Point2::new(0.1 * k as f64, f64::from(id));
            let history: Vec<Sighting> =
                (0..=10).map(|k| Sighting { at: Time::from_ms(100 * k), point: at(k) }).collect();
            let pose = Pose2::new(1.0, f64::from(id), 0.0);
            let (id, kind, velocity_mps) = (ActorId(id), ActorKind::Pedestrian, Vector2::new(1.0, 0.0));
            Track { id, kind, pose, extent, velocity_mps, history }
        };
        TrackList { stamp: Time::from_ms(1000), tracks: vec![track(1), track(2)] }
    }

    /// The first actor moves on a circle; the second is unknown.
    fn told(track: &Track, at: &[Time]) -> Option<Vec<Point2>> {
        (track.id.0 == 1).then(|| at.iter().map(|at| on_circle((*at - Time::ZERO).as_secs())).collect())
    }

    fn on_circle(s: f64) -> Point2 {
        Point2::new(1.0 + libm::sin(s - 1.0), 2.0 - libm::cos(s - 1.0))
    }

    fn points(list: &PredictionList, k: usize) -> Vec<Point2> {
        list.predictions[k].path.iter().map(|at| at.pose.point()).collect()
    }

    #[test]
    fn known_actors_follow_the_truth_and_others_move_straight() {
        let list = foretold(&tracks(), &HORIZON, &Telling::default(), &told);
        for (k, point) in points(&list, 0).into_iter().enumerate() {
            assert!(point.distance(on_circle(1.0 + 0.1 * k as f64)) < 1e-12);
        }
        assert!(points(&list, 1)[20].distance(Point2::new(3.0, 2.0)) < 1e-9);
        // Without a source, no ground truth is used.
        let alone = predict(PredictorName::Truth, &tracks(), &HORIZON, crate::Ground::Open);
        assert_eq!(alone, predict(PredictorName::ConstantVelocity, &tracks(), &HORIZON, crate::Ground::Open));
    }

    #[test]
    fn motion_beyond_the_horizon_of_the_truth_is_straight() {
        let short = Telling { horizon: Some(Span::from_ms(500)), ..Telling::default() };
        let at = points(&foretold(&tracks(), &HORIZON, &short, &told), 0);
        assert!(at[5].distance(on_circle(1.5)) < 1e-12);
        let step = at[5] - at[4];
        for k in 6..=20 {
            assert!(((at[k] - at[k - 1]) - step).norm() < 1e-12, "{k}");
        }
        let nothing = Telling { horizon: Some(Span::ZERO), ..Telling::default() };
        assert_eq!(points(&foretold(&tracks(), &HORIZON, &nothing, &told), 0)[0], on_circle(1.0));
    }

    #[test]
    fn errors_grow_with_time_and_are_reproducible() {
        let mut squares = 0.0;
        for seed in 0..400 {
            let noisy = Telling { noise_mps: 0.3, seed, ..Telling::default() };
            let list = foretold(&tracks(), &HORIZON, &noisy, &told);
            assert_eq!(list, foretold(&tracks(), &HORIZON, &noisy, &told));
            let [half, whole] = [10, 20].map(|k| points(&list, 0)[k] - on_circle(1.0 + 0.1 * k as f64));
            assert!((whole - half * 2.0).norm() < 1e-9);
            squares += whole.norm_squared();
        }
        // Two axes, 0.6 m each after 2 s.
        assert!((squares / 400.0 - 2.0 * 0.36).abs() < 0.1, "{}", squares / 400.0);
    }
}
