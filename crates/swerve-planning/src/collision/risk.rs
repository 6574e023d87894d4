//! Which of the ways that others may go has to be kept clear of.

use swerve_msg::Prediction;

/// Where modes of motion are told with their probabilities: those that a plan must keep clear of, so that what it may
/// touch has a probability of at most `risk_max` in all.
///
/// Left out are the least likely modes of all actors together, as many as sum up to no more than that. By the union bound
/// a plan that is free of the rest then touches nobody with a probability of at least `1 - risk_max`, however the actors
/// depend on each other, as far as the probabilities and paths that were told are right. Of equals the later one is left
/// out first. What is surely so is never left out.
pub fn within_risk(predictions: &[Prediction], risk_max: f64) -> Vec<Prediction> {
    let mut order: Vec<usize> = (0..predictions.len()).collect();
    order.sort_by(|a, b| predictions[*a].probability.total_cmp(&predictions[*b].probability).then(b.cmp(a)));
    let (mut risk, mut kept) = (0.0, vec![true; predictions.len()]);
    for k in order {
        let probability = predictions[k].probability.max(0.0);
        // A sum of decimal shares is a little off.
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

    /// Beside the lane a car, ahead and slower, that keeps to its lane or cuts in.
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
    fn the_least_likely_are_left_out_up_to_the_bound() {
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
