//! Presets of the paper's and our side, and parameters that differ only in values.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_control::Following;
use swerve_planning::waypoint;
use swerve_prediction::linear::{self, SingleSighting};

/// Side of a comparison: the paper's or ours.
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
    /// Time reference when following plans: the original trims passed points and ignores times.
    pub fn following(self) -> Following {
        match self {
            Self::Paper => Following::Projection,
            Self::Best => Following::Time,
        }
    }

    /// Parameters of the linear predictor: the original assumes that objects seen once stand still, and that all others
    /// keep their speed.
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

    /// Parameters of the waypoint planner: the original uses only its stop factors.
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
    fn original_waypoint_planner_conforms() {
        for preset in [Preset::Paper, Preset::Best] {
            conformance(&|| Waypoint::new(preset.waypoint()).unwrap(), false);
        }
    }

    #[test]
    fn predictor_of_the_paper_treats_new_objects_as_static() {
        assert_eq!(Preset::Paper.linear().single_sighting, SingleSighting::Static);
        assert_eq!(Preset::Best.linear().single_sighting, SingleSighting::Velocity);
    }
}
