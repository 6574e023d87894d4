//! Room in front of vehicles beside the ego: it does not change into their lane right before them.

use std::borrow::Cow;

use swerve_geom::{FrenetPoint, angle_between};
use swerve_msg::{Prediction, Route};
use swerve_vehicle::Shape;

/// Gap before a vehicle of the other lane, metres, and per speed of that vehicle, seconds.
const GAP_M: f64 = 1.0;
const GAP_S: f64 = 0.3;
/// Time in which a difference of speeds uses it, seconds, and the largest gap, metres.
const CLOSES_S: f64 = 1.0;
const GAP_MAX_M: f64 = 30.0;
/// Speed below which vehicles queue, m/s: the ego goes where there is room.
const QUEUE_MPS: f64 = 4.0;
/// Largest distances of such a vehicle behind and beside the ego, metres.
const BEHIND_M: f64 = 60.0;
const BESIDE_M: f64 = 8.0;
/// Largest angle to the road of a motion along it, radians.
const ALONG_RAD: f64 = 0.1;
/// Every n-th pose of a prediction is compared with the ego's path, and the distance up to which it is searched along the
/// route, metres.
const EVERY: usize = 4;
const SEARCH_M: f64 = 20.0;

/// Predictions in which vehicles that drive in the ego's direction beside it, and not ahead, are longer to the front by
/// the gap that they need if it changes into their lane. It is smaller the faster the ego is. Vehicles that are predicted to
/// come into the ego's path from there keep their distance themselves: they stay as long as they are.
pub(crate) fn with_gaps<'a>(
    predictions: Cow<'a, [Prediction]>,
    (route, place, shape): (&Route, FrenetPoint, &Shape),
    speed_mps: f64,
) -> Cow<'a, [Prediction]> {
    let gap_m = |one: &Prediction| gap_m(one, route, (place, speed_mps), shape);
    let gaps_m: Vec<Option<f64>> = predictions.iter().map(gap_m).collect();
    if gaps_m.iter().all(Option::is_none) {
        return predictions;
    }
    let with_gap = |(one, gap_m): (&Prediction, Option<f64>)| match gap_m {
        Some(by_m) => longer(one, by_m),
        None => one.clone(),
    };
    Cow::Owned(predictions.iter().zip(gaps_m).map(with_gap).collect())
}

/// Gap that a vehicle beside the ego needs, metres; `None` for all others.
fn gap_m(
    one: &Prediction,
    route: &Route,
    (place, ego_mps): (FrenetPoint, f64),
    shape: &Shape,
) -> Option<f64> {
    let [first, next, ..] = &one.path[..] else { return None };
    let ego = route.line().at(place.s_m).pose;
    let is_near = first.pose.point().distance(ego.point()) < BEHIND_M + BESIDE_M;
    if one.kind.is_person() || !is_near {
        return None;
    }
    let velocity_mps = (next.pose.point() - first.pose.point()) * (1.0 / (next.at - first.at).as_secs());
    let speed_mps = velocity_mps.norm();
    let at = route.project_near(first.pose.point(), place.s_m, BEHIND_M + BESIDE_M);
    let turn_rad = angle_between(route.line().at(at.s_m).pose.heading_rad, velocity_mps.heading());
    let aside_m = (at.d_m - place.d_m).abs();
    let ego_front_m = place.s_m + shape.length_m - shape.rear_overhang_m;
    let is_beside = aside_m > 0.5 * (shape.width_m + one.extent.width_m) && aside_m < BESIDE_M;
    let is_ahead = at.s_m + 0.5 * one.extent.length_m > ego_front_m;
    if speed_mps < QUEUE_MPS || turn_rad.abs() > ALONG_RAD || !is_beside || is_ahead {
        return None;
    }
    let gap_m = GAP_M + GAP_S * speed_mps + CLOSES_S * (speed_mps - ego_mps);
    let comes_over = || {
        one.path.iter().step_by(EVERY).any(|pose| {
            let s_m = at.s_m + speed_mps * (pose.at - first.at).as_secs();
            let then = route.project_near(pose.pose.point(), s_m, SEARCH_M);
            (then.d_m - place.d_m).abs() < 0.5 * (shape.width_m + one.extent.width_m)
        })
    };
    (gap_m > 0.0 && !comes_over()).then_some(gap_m.min(GAP_MAX_M))
}

/// A road user that is longer to the front.
fn longer(one: &Prediction, by_m: f64) -> Prediction {
    let mut longer = one.clone();
    longer.extent.length_m += by_m;
    for point in &mut longer.path {
        let at = point.pose.point() + point.pose.direction() * (0.5 * by_m);
        (point.pose.x_m, point.pose.y_m) = (at.x_m, at.y_m);
    }
    longer
}

#[cfg(test)]
mod tests {
    use swerve_msg::ActorKind;

    use super::*;
    use crate::testing::World;

    /// Front of a car before and after the change, relative to the ego; places and speeds are along the road.
    fn fronts_m(ego_mps: f64, (x_m, y_m): (f64, f64), velocity_mps: (f64, f64)) -> [f64; 2] {
        let world = World::straight(ego_mps).with(ActorKind::Car, (4.0, 1.8), (x_m, y_m), velocity_mps);
        let request = world.request();
        let ego = (request.route, request.place(), request.shape);
        let front_m = |all: &[Prediction]| all[0].path[0].pose.x_m + 0.5 * all[0].extent.length_m;
        let after = with_gaps(Cow::Borrowed(request.predictions), ego, ego_mps);
        let rear_m = |all: &[Prediction]| front_m(all) - all[0].extent.length_m;
        assert!((rear_m(&after) - rear_m(request.predictions)).abs() < 1e-9);
        [front_m(request.predictions), front_m(&after)]
    }

    #[test]
    fn vehicle_beside_and_behind_is_longer_to_the_front() {
        for (ego_mps, place, speed_mps, longer_m) in [
            (20.0, (-6.0, 3.5), 20.0, 7.0),
            (20.0, (-6.0, -3.5), 20.0, 7.0),
            // It gains on the ego, or falls back.
            (20.0, (-20.0, 3.5), 25.0, 13.5),
            (20.0, (-6.0, 3.5), 10.0, 0.0),
            (5.0, (-50.0, 3.5), 30.0, 30.0),
            // Ahead, behind in the same lane, far beside, in a queue, oncoming.
            (20.0, (8.0, 3.5), 20.0, 0.0),
            (20.0, (-10.0, 0.0), 20.0, 0.0),
            (20.0, (-6.0, 12.0), 20.0, 0.0),
            (1.0, (-6.0, 3.5), 2.0, 0.0),
            (20.0, (-6.0, 3.5), -20.0, 0.0),
        ] {
            let [before_m, after_m] = fronts_m(ego_mps, place, (speed_mps, 0.0));
            assert!((after_m - before_m - longer_m).abs() < 1e-9, "{place:?} {speed_mps}: {after_m}");
        }
    }

    #[test]
    fn vehicle_that_comes_into_the_path_of_the_ego_from_behind_keeps_its_distance_itself() {
        // Sideways, it moves 0.6 m, 3 m or -3 m in 5 s.
        for (across_mps, is_longer) in [(-0.12, true), (-0.6, false), (0.6, true)] {
            let [before_m, after_m] = fronts_m(20.0, (-6.0, 3.5), (20.0, across_mps));
            assert_eq!(after_m > before_m + 1.0, is_longer, "{across_mps}");
        }
    }
}
