//! The paper's side or ours, and the settings that differ in numbers alone.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_control::Following;
use swerve_planning::waypoint;
use swerve_prediction::linear::{self, SingleSighting};

/// The side of a comparison.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The original's behaviour and limits.
    Paper,
    /// Ours: drivable, on the road, from the predicted start.
    #[default]
    Best,
}

impl Preset {
    /// How plans are followed: the original trims passed points and ignores times.
    pub fn following(self) -> Following {
        match self {
            Self::Paper => Following::Projection,
            Self::Best => Following::Time,
        }
    }

    /// Parameters of the linear predictor: the original takes newcomers for standing still, and everything else for
    /// keeping its speed.
    pub fn linear(self) -> linear::Params {
        let best = linear::Params::default();
        match self {
            Self::Paper => linear::Params {
                single_sighting: SingleSighting::Static,
                brake_window_s: 0.0,
                rest_speed_mps: 0.0,
                ..best
            },
            Self::Best => best,
        }
    }

    /// Parameters of the waypoint planner: the original has its stop factors alone.
    pub fn waypoint(self) -> waypoint::Params {
        let best = waypoint::Params::default();
        match self {
            Self::Paper => waypoint::Params { standstill_gap_m: 0.0, ..best },
            Self::Best => best,
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_planning::testing::conformance;
    use swerve_planning::waypoint::Waypoint;

    use super::*;

    #[test]
    fn the_waypoint_planner_holds_what_every_planner_must() {
        for preset in [Preset::Paper, Preset::Best] {
            conformance(&|| Waypoint::new(preset.waypoint()).unwrap(), false);
        }
    }

    #[test]
    fn the_papers_predictor_lets_newcomers_stand() {
        assert_eq!(Preset::Paper.linear().single_sighting, SingleSighting::Static);
        assert_eq!(Preset::Best.linear().single_sighting, SingleSighting::Velocity);
    }
}
