//! Everything about a scenario that depends on the seed.
//!
//! | quantity | range | drawn by |
//! |---|---|---|
//! | start of each ego along the road | ±0.5 m | [`Scenario::drawn`] |
//! | speed of each ego (start and target) | ±0.2 m/s | [`Scenario::drawn`] |
//! | distance of each distance trigger | ±0.25 m | [`Scenario::drawn`] |
//! | start, direction and speed of an actor | its [`Vary`](crate::Vary) | [`Scenario::drawn`] |
//! | phase of each sensor | whole world steps within its period | [`sensor_phase`] |
//! | sensor noise and bias | per sensor | the sensor, keyed by (seed, sensor, stamp) |
//!
//! A scenario with `seeded = false` is not varied; sensors are.

use swerve_core::{Rng, Span};

use crate::model::{Draws, EGO_START_M};
use crate::{Scenario, Trigger};

const EGO_SPEED_MPS: f64 = 0.2;
const TRIGGER_M: f64 = 0.25;

impl Scenario {
    /// The scenario as varied by `seed`; the draws are in [`draws`](Self::draws). A scenario with draws is returned
    /// unchanged. Each number is keyed by (seed, quantity, index), so that adding an actor changes no other draw.
    /// Start and target speed are clamped at 0, and a start at standstill remains one.
    #[must_use]
    pub fn drawn(&self, seed: u64) -> Self {
        let mut drawn = self.clone();
        if self.draws.is_some() {
            return drawn;
        }
        let within = |name: &str, key: &[i64], half: f64| Rng::keyed(seed, name, key).uniform(-half, half);
        let mut draws = Draws {
            seed,
            ego_start_m: within("scenario ego start", &[], EGO_START_M),
            ego_speed_mps: within("scenario ego speed", &[], EGO_SPEED_MPS),
            trigger_m: vec![0.0; self.actors.len()],
        };
        let faster = |speed: f64| if speed > 0.0 { (speed + draws.ego_speed_mps).max(0.0) } else { speed };
        drawn.ego.s_m += draws.ego_start_m;
        drawn.ego.target_speed_mps = faster(self.ego.target_speed_mps);
        drawn.ego.start_speed_mps = self.ego.start_speed_mps.map(faster);
        for (k, other) in (1..).zip(&mut drawn.other_egos) {
            let by = within("scenario ego speed", &[k], EGO_SPEED_MPS);
            let faster = |speed: f64| if speed > 0.0 { (speed + by).max(0.0) } else { speed };
            other.start.s_m += within("scenario ego start", &[k], EGO_START_M);
            other.start.target_speed_mps = faster(other.start.target_speed_mps);
            other.start.start_speed_mps = other.start.start_speed_mps.map(faster);
        }
        for (i, actor) in drawn.actors.iter_mut().enumerate() {
            actor.varied(seed, i);
            if let Some(Trigger::Distance { within_m, .. }) = &mut actor.trigger {
                draws.trigger_m[i] = within("scenario trigger", &[i as i64], TRIGGER_M);
                *within_m = (*within_m + draws.trigger_m[i]).max(0.0);
            }
        }
        drawn.draws = Some(draws);
        drawn
    }
}

/// Phase of a sensor: a whole number of world steps in `[0, period)`, so that each of its stamps is an instant at
/// which the world has a state. Zero for a period below one step.
pub fn sensor_phase(seed: u64, sensor: &str, period: Span, world_step: Span) -> Span {
    if world_step.ns() <= 0 || period.ns() < world_step.ns() {
        return Span::ZERO;
    }
    let steps = usize::try_from((period.ns() - 1) / world_step.ns() + 1).unwrap_or(1);
    let mut rng = Rng::keyed(seed, &format!("sensor phase {sensor}"), &[]);
    world_step * rng.below(steps) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario() -> Scenario {
        let text = include_str!("../../../scenarios/person_behind_truck.toml");
        Scenario::parse("person.toml", text).unwrap()
    }

    fn within(scenario: &Scenario) -> f64 {
        match scenario.actors[1].trigger {
            Some(Trigger::Distance { within_m, .. }) => within_m,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn draws_fill_their_ranges_and_are_applied() {
        let nominal = scenario();
        let mut spans = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        for seed in 0..2000 {
            let drawn = nominal.drawn(seed);
            let draws = drawn.draws.clone().unwrap();
            assert_eq!(drawn.ego.s_m, nominal.ego.s_m + draws.ego_start_m);
            assert_eq!(drawn.ego.target_speed_mps, nominal.ego.target_speed_mps + draws.ego_speed_mps);
            assert_eq!(within(&drawn), 26.0 + draws.trigger_m[1]);
            assert_eq!(draws.trigger_m[0], 0.0, "the truck has no trigger");
            for (span, x) in
                spans.iter_mut().zip([draws.ego_start_m, draws.ego_speed_mps, draws.trigger_m[1]])
            {
                *span = [span[0].min(x), span[1].max(x)];
            }
        }
        for (span, half) in spans.iter().zip([0.5, 0.2, 0.25]) {
            assert!(span[0] >= -half && span[0] < -0.98 * half, "{span:?}");
            assert!(span[1] <= half && span[1] > 0.98 * half, "{span:?}");
        }
    }

    #[test]
    fn draws_depend_on_the_seed_but_not_on_other_actors() {
        let nominal = scenario();
        assert_eq!(nominal.drawn(7), nominal.drawn(7));
        assert_ne!(nominal.drawn(7), nominal.drawn(8));
        let mut more = nominal.clone();
        more.actors.push(nominal.actors[1].clone());
        let (a, b) = (nominal.drawn(7).draws.unwrap(), more.drawn(7).draws.unwrap());
        assert_eq!((a.ego_start_m, a.ego_speed_mps), (b.ego_start_m, b.ego_speed_mps));
        assert_eq!(a.trigger_m[..], b.trigger_m[..2]);
        assert_ne!(b.trigger_m[1], b.trigger_m[2]);
        assert_eq!(nominal.drawn(7).drawn(8), nominal.drawn(7), "drawn once, drawn for good");
    }

    #[test]
    fn draws_of_different_things_are_independent() {
        let nominal = scenario();
        let n = 2000.0;
        let (mut ab, mut ac) = (0.0, 0.0);
        for seed in 0..2000 {
            let draws = nominal.drawn(seed).draws.unwrap();
            ab += (draws.ego_start_m / 0.5) * (draws.ego_speed_mps / 0.2) / n;
            ac += (draws.ego_start_m / 0.5) * (draws.trigger_m[1] / 0.25) / n;
        }
        // Products of independent uniforms on ±1 have standard deviation 1/3: the mean of n stays within 4 sigma.
        let bound = 4.0 / 3.0 / f64::sqrt(n);
        assert!(ab.abs() < bound && ac.abs() < bound, "{ab} {ac}");
    }

    #[test]
    fn standing_start_remains_a_standing_start() {
        let mut nominal = scenario();
        nominal.ego.start_speed_mps = Some(0.0);
        assert!((0..50).all(|seed| nominal.drawn(seed).ego.start_speed() == 0.0));
    }

    #[test]
    fn sensor_phases_are_whole_steps_within_the_period() {
        let (period, step) = (Span::from_ms(50), Span::from_ms(5));
        let mut seen = [false; 10];
        for seed in 0..200 {
            let phase = sensor_phase(seed, "camera", period, step);
            assert!(phase.ns() % step.ns() == 0 && phase < period && phase >= Span::ZERO);
            seen[(phase.ns() / step.ns()) as usize] = true;
        }
        assert_eq!(seen, [true; 10]);
        let differs =
            |a, b| (0..20).any(|s| sensor_phase(s, a, period, step) != sensor_phase(s, b, period, step));
        assert!(differs("camera", "lidar"));
        assert_eq!(sensor_phase(1, "fast", Span::from_ms(1), step), Span::ZERO);
    }
}
