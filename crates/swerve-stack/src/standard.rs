//! The standard registry: Swerve's own kinds and algorithms.

use std::sync::{Arc, LazyLock};

use swerve_perception::{Ab3dMot, Tracker};
use swerve_planning::aeb::Aeb;
use swerve_planning::fot::Fot;
use swerve_planning::hybrid_astar::HybridAstar;
use swerve_planning::rrt_star::RrtStar;
use swerve_planning::waypoint::Waypoint;
use swerve_prediction::PredictorName;
use swerve_pylot::Preset;
use swerve_vision::shipped;

use crate::config::Config;
use crate::controllers::{Mpc, Pid, PurePursuit, Stanley};
use crate::detectors::ByWeights;
use crate::localizers::{self, Eskf, EskfNdt, Ndt, Odometry};
use crate::operators;
use crate::predictors::{BuiltIn, Linear, Truth};
use crate::registry::Registry;
use crate::setup::Setup;

impl Registry {
    /// Registry of Swerve's own kinds.
    pub fn standard() -> Self {
        static STANDARD: LazyLock<Registry> = LazyLock::new(|| {
            operators::all(Registry::empty())
                .with_shipped_detectors()
                .with_planner::<Fot>()
                .with_planner::<RrtStar>()
                .with_planner::<HybridAstar>()
                .with_planner::<Waypoint>()
                .with_planner::<Aeb>()
                .with_controller::<Pid>()
                .with_controller::<PurePursuit>()
                .with_controller::<Stanley>()
                .with_controller::<Mpc>()
                .with_predictor::<Linear>()
                .with_predictor::<BuiltIn<{ PredictorName::ConstantVelocity as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::Kalman as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::Ctra as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::Imm as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::SocialForce as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::Orca as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::LaneIdm as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::Multipath as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::Mfp as usize }>>()
                .with_predictor::<BuiltIn<{ PredictorName::R2p2 as usize }>>()
                .with_predictor::<Truth>()
                .with_tracker::<Tracker>()
                .with_tracker::<Ab3dMot>()
                .with_localizer::<localizers::Truth>()
                .with_localizer::<Eskf>()
                .with_localizer::<Ndt>()
                .with_localizer::<EskfNdt>()
                .with_localizer::<Odometry>()
        });
        STANDARD.clone()
    }

    /// Adds the detectors whose weights are in the program.
    fn with_shipped_detectors(mut self) -> Self {
        for name in shipped::names() {
            self.detectors.insert(name, Arc::new(ByWeights(name.into())));
        }
        self
    }
}

impl Default for Registry {
    fn default() -> Self {
        Self::standard()
    }
}

/// Setup with Swerve's own kinds.
impl From<Config> for Setup {
    fn from(config: Config) -> Self {
        Self { config, ..Self::default() }
    }
}

impl Config {
    /// All values of [`pipeline_name`](Self::pipeline_name) for the built-in planners.
    pub fn pipeline_names() -> impl Iterator<Item = String> {
        let planners: Vec<&str> = Registry::standard().planners().collect();
        let of = |preset| planners.iter().map(|planner| Self::name_of(planner, preset)).collect::<Vec<_>>();
        [of(Preset::Best), of(Preset::Paper)].concat().into_iter()
    }
}
