//! Algorithms that a configuration names, built with its parameters from those of the registry.

mod detector;
mod planner;

use swerve_control::Controller;
use swerve_perception::{GroundTracker, Tracker, detector as boxes};
use swerve_prediction::Predictor;
use swerve_prediction::learned::Weights;
use swerve_pylot::Preset;
use swerve_text::{KeyProblem, list};

use crate::config::localization::{LidarPoses, LocalizationConfig, LocalizerOperators};
use crate::config::perception::PerceptionConfig;
use crate::config::{OperatorConfig, PredictionConfig};
use crate::controllers::ControllerSetup;
use crate::predictors::{AnyPredictor, PredictorSetup};
use crate::problems::within;
use crate::registry::Registry;
use crate::setup::Setup;
use crate::trackers::{NamedTracker as _, TrackerSetup};

pub(crate) use detector::Chosen;

impl LocalizationConfig {
    /// Operators that estimate the pose, by name.
    pub(crate) fn operators(&self, registry: &Registry) -> Vec<(String, OperatorConfig)> {
        let named = self.named(registry).filter(|_| self.estimates());
        let of = |named: &LocalizerOperators| {
            let lidar = named.lidar.map(LidarPoses::operator);
            lidar.into_iter().chain([("localizer".to_owned(), named.operator.clone())])
        };
        named.into_iter().flat_map(of).collect()
    }

    /// Returns true if a lidar is read.
    pub fn reads_lidar(&self, registry: &Registry) -> bool {
        self.named(registry).and_then(|named| named.lidar).is_some()
    }

    /// Returns true if sweeps are matched with a map.
    pub(crate) fn reads_map(&self, registry: &Registry) -> bool {
        self.named(registry).and_then(|named| named.lidar) == Some(LidarPoses::Matches)
    }

    /// The localizer, if its name is known.
    pub(crate) fn named<'a>(&self, registry: &'a Registry) -> Option<&'a LocalizerOperators> {
        registry.localizers.get(self.localizer.as_str())
    }
}

impl PerceptionConfig {
    /// Builds the tracker behind a detector.
    ///
    /// # Errors
    /// Problems by their keys in `perception`.
    pub(crate) fn built_tracker(
        &self,
        registry: &Registry,
        of: TrackerSetup<'_>,
    ) -> Result<Box<dyn GroundTracker>, Vec<KeyProblem>> {
        let mut own = self.tracker.clone();
        let name = own.remove("algorithm").unwrap_or_else(|| Tracker::NAME.into());
        let Some(name) = name.as_str() else {
            let names: Vec<&str> = registry.trackers().collect();
            let message = format!("expected one of {}, found {name}", list(&names));
            return Err(vec![("tracker.algorithm".into(), message)]);
        };
        let named = registry.trackers.named("tracker.algorithm", name)?;
        named.build(of, &own).map_err(|found| within("tracker", found))
    }
}

impl PredictionConfig {
    /// Returns true if road users that drive along the road are predicted along it.
    pub(crate) fn follows_road(&self, registry: &Registry) -> bool {
        let always = registry.predictors.get(self.predictor.as_str()).is_some_and(AnyPredictor::is_on_road);
        always || self.along_road.unwrap_or(self.preset == Preset::Best)
    }

    /// Builds the predictor, with weights from a file in place of the shipped ones.
    ///
    /// # Errors
    /// Problems by their keys in `prediction`.
    pub fn built(
        &self,
        registry: &Registry,
        weights: Option<&Weights>,
    ) -> Result<Box<dyn Predictor>, Vec<KeyProblem>> {
        let named = registry.predictors.named("predictor", self.predictor.as_str())?;
        named.build(PredictorSetup { config: self, weights }).map_err(|found| within("params", found))
    }
}

impl Setup {
    /// Errors of the detector in front of the tracker: without an emulated one, those of the emulation's defaults.
    pub(crate) fn noise_behind_detector(&self) -> boxes::Params {
        let emulated = self.perception.emulated().unwrap_or_default();
        emulated.map_or_else(Default::default, |emulated| emulated.params)
    }

    /// Builds the tracker behind a detector with these errors.
    ///
    /// # Errors
    /// Problems by their keys in `perception`.
    pub(crate) fn tracker_behind(
        &self,
        behind: &boxes::Params,
    ) -> Result<Box<dyn GroundTracker>, Vec<KeyProblem>> {
        let of = TrackerSetup { behind, sightings_max: self.prediction.sightings() };
        self.perception.built_tracker(&self.registry, of)
    }

    /// Builds the controller, for the configured vehicle.
    ///
    /// # Errors
    /// Problems by their keys in `control`.
    pub(crate) fn built_controller(&self) -> Result<Box<dyn Controller>, Vec<KeyProblem>> {
        let named = self.registry.controllers.named("controller", self.controller())?;
        let following = self.control.following.unwrap_or_else(|| self.planning.preset.following());
        let setup = ControllerSetup { vehicle: &self.sim.vehicle, following };
        named.build(setup, &self.control.params).map_err(|found| within("params", found))
    }
}
