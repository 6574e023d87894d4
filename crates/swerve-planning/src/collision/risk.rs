//! Selection of the predicted modes that a plan must keep clear of.

use std::borrow::Cow;

use swerve_core::Time;
use swerve_geom::{Pose2, math};
use swerve_msg::{Plan, PlanStatus, Prediction};

use super::{CollisionMode, Obstacles};
use crate::request::{Budget, Planner, Request};

/// Largest number of standard deviations that are kept clear of: beyond it, the probability is 4e-6.
const SIGMAS_MAX: f64 = 5.0;

/// Plans among the modes that are [`within_risk`], with any planner.
///
/// If modes have covariances, the plan keeps clear of the region in which each road user is with a probability of 1 less
/// its equal share of the risk that the removed modes leave: of `sqrt(-2 ln share)` standard deviations, as for a normal
/// distribution in the plane. A road user's deviations at different instants are taken as fully correlated. If the
/// regions leave only full brake, the plan is made as without covariances.
///
/// If that leaves only full brake (as with many samples that are each likelier than the bound), a second plan keeps
/// clear of each actor's likeliest mode, and the plan with less expected harm is used: the sum over all modes of
/// probability times the ego's speed at first contact.
pub fn plan_within_risk(
    planner: &mut dyn Planner,
    request: &Request<'_>,
    risk_max: f64,
    budget: &mut dyn Budget,
) -> Plan {
    let is_sure = request.predictions.iter().all(|mode| mode.probability > risk_max);
    let kept = if is_sure {
        Cow::Borrowed(request.predictions)
    } else {
        Cow::Owned(within_risk(request.predictions, risk_max))
    };
    let spread = spread(&kept, risk_max - (total(request.predictions) - total(&kept)));
    let predictions = spread.as_deref().unwrap_or(&kept);
    let plan = planner.plan(&Request { predictions, ..*request }, budget);
    if plan.status != PlanStatus::Brake {
        return plan;
    }
    if spread.is_some() {
        let predictions = &scaled(request.predictions, None);
        let other = plan_within_risk(planner, &Request { predictions, ..*request }, risk_max, budget);
        return Plan { work: plan.work + other.work, ..other };
    }
    let likeliest = likeliest(request.predictions);
    if likeliest.len() >= kept.len() {
        return plan;
    }
    let other = planner.plan(&Request { predictions: &likeliest, ..*request }, budget);
    let work = plan.work + other.work;
    let less =
        if expected_harm_mps(request, &other) < expected_harm_mps(request, &plan) { other } else { plan };
    Plan { work, ..less }
}

/// Sum of the probabilities.
fn total(predictions: &[Prediction]) -> f64 {
    predictions.iter().map(|mode| mode.probability).sum()
}

/// Modes with covariances scaled to the regions that together leave a probability of `risk`; `None` without
/// covariances.
fn spread(predictions: &[Prediction], risk: f64) -> Option<Vec<Prediction>> {
    let is_spread = |modes: &&[Prediction]| modes.iter().any(|mode| !mode.covariances_m2.is_empty());
    let users = Prediction::by_actor(predictions).filter(is_spread).count();
    let squared = -2.0 * math::ln(risk.max(0.0) / users as f64);
    (users > 0).then(|| scaled(predictions, Some(squared.clamp(0.0, SIGMAS_MAX * SIGMAS_MAX))))
}

/// Modes with covariances times a factor, or without them.
fn scaled(predictions: &[Prediction], factor: Option<f64>) -> Vec<Prediction> {
    let of_one = |mode: &Prediction| {
        let by = |factor: f64| mode.covariances_m2.iter().map(|one| one.map(|m2| m2 * factor)).collect();
        Prediction { covariances_m2: factor.map(by).unwrap_or_default(), ..mode.clone() }
    };
    predictions.iter().map(of_one).collect()
}

/// Likeliest mode of each actor.
fn likeliest(predictions: &[Prediction]) -> Vec<Prediction> {
    Prediction::by_actor(predictions).filter_map(Prediction::likeliest).cloned().collect()
}

/// Sum over all modes of their probability times the ego's speed at first contact on a plan, m/s.
fn expected_harm_mps(request: &Request<'_>, plan: &Plan) -> f64 {
    let harm = |mode: &Prediction| {
        let obstacles = Obstacles::new(core::slice::from_ref(mode), CollisionMode::TimeIndexed);
        mode.probability.max(0.0) * contact_mps(request, &obstacles, plan, 0.0).unwrap_or(0.0)
    };
    request.predictions.iter().map(harm).sum()
}

/// Speed of the ego where a plan first violates the clearance, m/s; `None` if it never does.
pub(crate) fn contact_mps(
    request: &Request<'_>,
    obstacles: &Obstacles,
    plan: &Plan,
    clearance_m: f64,
) -> Option<f64> {
    let near = plan.points.windows(2).find(|pair| {
        let path: [(Pose2, Time); 2] = [(pair[0].pose, pair[0].at), (pair[1].pose, pair[1].at)];
        !obstacles.path_free(|pose| request.shape.footprint(pose), &path, clearance_m)
    });
    near.map(|pair| pair[0].speed_mps)
}

/// Modes that a plan must keep clear of, so that the modes it may touch have a total probability of at most `risk_max`.
///
/// Removes the least likely modes of all actors together, as many as sum up to at most `risk_max`; of equals the later
/// one first. By the union bound, a plan that is free of the rest touches nobody with a probability of at least `1 -
/// risk_max`, however the actors depend on each other, provided that the predicted probabilities and paths are right.
/// Certain modes are never removed.
pub fn within_risk(predictions: &[Prediction], risk_max: f64) -> Vec<Prediction> {
    let mut order: Vec<usize> = (0..predictions.len()).collect();
    order.sort_by(|a, b| predictions[*a].probability.total_cmp(&predictions[*b].probability).then(b.cmp(a)));
    let (mut risk, mut kept) = (0.0, vec![true; predictions.len()]);
    for k in order {
        let probability = predictions[k].probability.max(0.0);
        // A sum of decimal fractions is slightly off.
        if probability.is_nan() || risk + probability > risk_max + 1e-12 {
            break;
        }
        risk += probability;
        kept[k] = false;
    }
    predictions.iter().zip(kept).filter(|(_, kept)| *kept).map(|(prediction, _)| prediction.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::CollisionMode;
    use crate::fot::{Fot, Params};
    use crate::testing::World;
    use crate::{Planner, Unlimited};
    use swerve_core::Span;
    use swerve_msg::{ActorKind, Route};

    fn shares(predictions: &[Prediction], risk_max: f64) -> Vec<f64> {
        within_risk(predictions, risk_max).iter().map(|one| one.probability).collect()
    }

    /// A slower car ahead in the adjacent lane that keeps its lane or cuts in.
    fn cut_in(probability: f64) -> World {
        let car = |world: World, to: (f64, f64)| world.with(ActorKind::Car, (4.5, 1.8), (16.0, 3.5), to);
        let mut world = car(car(World::straight(12.0), (7.0, 0.0)), (7.0, 0.0));
        world.predictions[0].probability = 1.0 - probability;
        let into_lane = &mut world.predictions[1];
        into_lane.probability = probability;
        let now = into_lane.path[0].at;
        for at in &mut into_lane.path {
            at.pose.y_m = (3.5 - 2.0 * (at.at - now).as_secs()).max(0.0);
        }
        world
    }

    #[test]
    fn least_likely_modes_are_removed_up_to_the_bound() {
        let mut world = World::straight(10.0);
        for _ in 0..5 {
            world = world.with_person((20.0, 0.0), (0.0, 0.0));
        }
        let mut predictions = world.predictions;
        for (one, probability) in predictions.iter_mut().zip([0.7, 0.02, 0.3, 0.03, f64::NAN]) {
            one.probability = probability;
        }
        assert_eq!(shares(&predictions, 0.05)[..2], [0.7, 0.3]);
        assert_eq!(shares(&predictions, 0.049)[..3], [0.7, 0.3, 0.03]);
        assert_eq!(shares(&predictions, 0.0).len(), 5);
        predictions.truncate(1);
        predictions[0].probability = 1.0;
        assert_eq!(shares(&predictions, 0.99), [1.0]);
    }

    /// A pedestrian who crosses 22 m ahead, or stands at one of twelve samples across the road. Full brake from 18 m/s
    /// takes 20 m, and the front has 18 m: it hits her in the middle of the lane at √(18² - 2 * 8 * 18.1) = 5.9 m/s
    /// with probability 0.7, and three samples. Passing before her touches at most four samples: 4 * 0.025 * 18 m/s.
    #[test]
    fn samples_that_block_every_way_do_not_force_full_brake() {
        let mut world = World::straight(18.0).with_person((22.0, 3.0), (0.0, -2.0));
        world.predictions[0].probability = 0.7;
        for k in 0..12 {
            let y_m = -1.9 + 0.65 * f64::from(k);
            world = world.with_person((22.0, y_m), (0.0, 0.0));
            world.predictions[k as usize + 1].probability = 0.025;
            world.predictions[k as usize + 1].id = world.predictions[0].id;
        }
        let request = world.request();
        let mut fot = Fot::new(Params { collision: CollisionMode::Risk, ..Params::default() }).unwrap();
        let all = fot.plan(&request, &mut Unlimited::default());
        assert_eq!(all.status, PlanStatus::Brake);
        let mut budget = Unlimited::default();
        let weighed = plan_within_risk(&mut fot, &request, 0.02, &mut budget);
        assert_eq!((weighed.status, weighed.work), (PlanStatus::Found, budget.spent));
        assert!(expected_harm_mps(&request, &weighed) < expected_harm_mps(&request, &all));
        assert!(
            world.predictions[0].path.len() > 1 && likeliest(&world.predictions) == world.predictions[..1]
        );
    }

    /// Speed after a second, m/s, and smallest distance to the predicted car, metres, of a plan behind a slower car with
    /// this standard deviation of its positions, on a road too narrow to pass it.
    fn behind(sigma_m: f64, risk_max: f64) -> [f64; 2] {
        let mut world = World::straight(12.0).with(ActorKind::Car, (4.5, 1.8), (25.0, 0.0), (6.0, 0.0));
        world.route = Route::uniform(world.route.line().clone(), 1.5, 1.5);
        let car = &mut world.predictions[0];
        car.covariances_m2 = vec![[sigma_m * sigma_m, 0.0, sigma_m * sigma_m]; car.path.len()];
        let mut fot = Fot::new(Params { collision: CollisionMode::Risk, ..Params::default() }).unwrap();
        let plan = plan_within_risk(&mut fot, &world.request(), risk_max, &mut Unlimited::default());
        let speed_mps = plan.at(plan.points[0].at + Span::from_secs(1.0)).unwrap().speed_mps;
        world.predictions[0].covariances_m2.clear();
        [speed_mps, world.clearance_m(&plan, CollisionMode::TimeIndexed)]
    }

    #[test]
    fn wider_covariance_brakes_earlier_and_keeps_more_distance() {
        let plans = [0.0, 0.5, 1.0, 2.0].map(|sigma_m| behind(sigma_m, 0.05));
        for pair in plans.windows(2) {
            assert!(pair[1][0] < pair[0][0] && pair[1][1] > pair[0][1] + 0.5, "{plans:?}");
        }
        // A smaller bound keeps clear of more standard deviations.
        assert!(behind(0.5, 0.001)[1] > plans[1][1] + 0.3, "{plans:?}");
        // Regions that leave only full brake are not kept clear of.
        assert_eq!(behind(50.0, 0.05), plans[0]);
    }

    #[test]
    fn risk_is_divided_among_the_road_users_with_covariances() {
        let mut world =
            World::straight(10.0).with_person((20.0, 3.0), (0.0, 0.0)).with_person((30.0, 3.0), (0.0, 0.0));
        assert_eq!(spread(&world.predictions, 0.05), None);
        world.predictions[0].covariances_m2 = vec![[0.25, 0.0, 0.25]];
        let factor = |world: &World, risk: f64| {
            spread(&world.predictions, risk).unwrap()[0].covariances_m2[0][0] / 0.25
        };
        // Outside of this many standard deviations with a probability of exp(-r² / 2).
        assert!((factor(&world, 0.05) - 5.991).abs() < 1e-3);
        world.predictions[1].covariances_m2 = vec![[0.25, 0.0, 0.25]];
        assert!((factor(&world, 0.1) - 5.991).abs() < 1e-3);
        assert_eq!((factor(&world, 0.0), factor(&world, f64::NAN)), (25.0, 25.0));
    }

    #[test]
    fn a_planner_yields_to_a_likely_cut_in_and_passes_an_unlikely_one() {
        let speeds = |probability: f64, risk_max: f64| {
            let mut world = cut_in(probability);
            world.predictions = within_risk(&world.predictions, risk_max);
            let mut planner =
                Fot::new(Params { collision: CollisionMode::Risk, ..Params::default() }).unwrap();
            let plan = planner.plan(&world.request(), &mut Unlimited::default());
            let whole = cut_in(probability).clearance_m(&plan, CollisionMode::TimeIndexed);
            (plan.points.iter().map(|point| point.speed_mps).fold(f64::INFINITY, f64::min), whole)
        };
        let ((yields_mps, keeps_m), (passes_mps, touches_m)) = (speeds(0.3, 0.05), speeds(0.01, 0.05));
        assert!(yields_mps < 9.0 && keeps_m > 0.2, "30 %: {yields_mps} {keeps_m}");
        assert!(passes_mps > 11.0, "1 %: {passes_mps}");
        assert_eq!(touches_m, 0.0, "it would have hit who cuts in all the same");
        assert!(speeds(0.01, 0.001).0 < 9.0, "a bound below 1 % has it yield to that too");
    }
}
