//! All that a seed varies about a scenario: here and nowhere else.
//!
//! | what | range | where it is drawn |
//! |---|---|---|
//! | ego start along the road | ±0.5 m | [`Scenario::drawn`] |
//! | ego speed (start and target) | ±0.2 m/s | [`Scenario::drawn`] |
//! | distance of each distance trigger | ±0.25 m | [`Scenario::drawn`] |
//! | phase of each sensor | whole world steps within its period | [`sensor_phase`] |
//! | sensor noise and bias | each sensor's own | the sensor, keyed by (seed, sensor, stamp) |

use serde::{Deserialize, Serialize};
use swerve_core::{Rng, Span};

use crate::{Scenario, Trigger};

/// What a seed changed in a scenario.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Draws {
    /// The seed.
    pub seed: u64,
    /// Added to the ego's start along the road, metres.
    pub ego_start_m: f64,
    /// Added to the ego's start and target speed, m/s.
    pub ego_speed_mps: f64,
    /// Added to the distance of each actor's trigger, metres; zero for actors without a distance trigger.
    pub trigger_m: Vec<f64>,
}

const EGO_START_M: f64 = 0.5;
const EGO_SPEED_MPS: f64 = 0.2;
const TRIGGER_M: f64 = 0.25;

impl Scenario {
    /// This scenario as `seed` varies it; the draws are in [`draws`](Self::draws). A scenario that carries
    /// draws already is returned as it is. Each number is keyed by (seed, what, which), so that adding an
    /// actor changes no other draw. Start and target speed stay at least 0, and a standing start stays one.
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
        for (i, actor) in drawn.actors.iter_mut().enumerate() {
            if let Some(Trigger::Distance { within_m, .. }) = &mut actor.trigger {
                draws.trigger_m[i] = within("scenario trigger", &[i as i64], TRIGGER_M);
                *within_m = (*within_m + draws.trigger_m[i]).max(0.0);
            }
        }
        drawn.draws = Some(draws);
        drawn
    }
}

/// When a sensor first fires: a whole number of world steps in `[0, period)`, so that each of its stamps is
/// an instant at which the world has a state. Zero for a period below one step.
pub fn sensor_phase(seed: u64, sensor: &str, period: Span, world_step: Span) -> Span {
    if world_step.ns() <= 0 || period.ns() < world_step.ns() {
        return Span::ZERO;
    }
    let steps = usize::try_from((period.ns() - 1) / world_step.ns() + 1).unwrap_or(1);
    let mut rng = Rng::keyed(seed, &format!("sensor phase {sensor}"), &[]);
    world_step * rng.below(steps) as i64
}
