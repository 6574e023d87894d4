//! Selection of the predicted modes that a plan must keep clear of.

use std::borrow::Cow;

use swerve_core::Time;
use swerve_geom::Pose2;
use swerve_msg::{Plan, PlanStatus, Prediction};

use super::{CollisionMode, Obstacles};
use crate::request::{Budget, Planner, Request};

/// Plans among the modes that are [`within_risk`], with any planner.
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
    let plan = planner.plan(&Request { predictions: &kept, ..*request }, budget);
    if plan.status != PlanStatus::Brake {
        return plan;
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

/// Likeliest mode of each actor, the first of equals. Modes of one actor are adjacent.
fn likeliest(predictions: &[Prediction]) -> Vec<Prediction> {
    let of_one = |modes: &[Prediction]| {
        let likelier = |best: &Prediction, mode: &Prediction| mode.probability > best.probability;
        modes.iter().reduce(|best, mode| if likelier(best, mode) { mode } else { best }).cloned()
    };
    predictions.chunk_by(|a, b| a.id == b.id).filter_map(of_one).collect()
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
    use swerve_msg::ActorKind;

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
