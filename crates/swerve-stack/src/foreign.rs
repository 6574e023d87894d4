//! Algorithms that a process brings along: written in another language, they run in place of those that the
//! configuration names.

use std::sync::Arc;

use swerve_perception::GroundTracker;
use swerve_planning::Planner;
use swerve_planning::comfort::Manner;
use swerve_prediction::Predictor;
use swerve_text::KeyProblem;

use crate::planners::{AnyPlanner, Built, PlannerDefaults};
use crate::predictors::{AnyPredictor, PredictorSetup};
use crate::registry::Registry;
use crate::trackers::{AnyTracker, TrackerSetup};

/// Constructors of algorithms; the registry's own remain where there is none.
#[derive(Clone, Default)]
pub struct Foreign {
    /// Motion planner.
    pub planner: Option<Arc<dyn Fn() -> Box<dyn Planner> + Send + Sync>>,
    /// Predictor.
    pub predictor: Option<Arc<dyn Fn() -> Box<dyn Predictor> + Send + Sync>>,
    /// Tracker of boxes.
    pub tracker: Option<Arc<dyn Fn() -> Box<dyn GroundTracker> + Send + Sync>>,
}

impl Registry {
    /// Replaces the algorithms of every name. Their parameters are still those of the named ones.
    #[must_use]
    pub fn with_foreign(mut self, foreign: &Foreign) -> Self {
        if let Some(make) = &foreign.planner {
            self.planners.replace(|named| Arc::new(Instead { place_of: named, make: make.clone() }));
        }
        if let Some(make) = &foreign.predictor {
            self.predictors.replace(|named| Arc::new(Instead { place_of: named, make: make.clone() }));
        }
        if let Some(make) = &foreign.tracker {
            self.trackers.replace(|named| Arc::new(Instead { place_of: named, make: make.clone() }));
        }
        self
    }
}

/// An algorithm in place of a named one.
struct Instead<T: ?Sized, M: ?Sized> {
    place_of: Arc<T>,
    make: Arc<M>,
}

impl AnyPlanner for Instead<dyn AnyPlanner, dyn Fn() -> Box<dyn Planner> + Send + Sync> {
    fn has_comfort(&self) -> bool {
        self.place_of.has_comfort()
    }

    fn is_foreign(&self) -> bool {
        true
    }

    fn build(&self, of: PlannerDefaults, params: &toml::Table) -> Result<Built, Vec<KeyProblem>> {
        self.place_of.build(of, params)?;
        Ok(((self.make)(), Manner::GoesRound))
    }
}

impl AnyPredictor for Instead<dyn AnyPredictor, dyn Fn() -> Box<dyn Predictor> + Send + Sync> {
    fn is_on_road(&self) -> bool {
        self.place_of.is_on_road()
    }

    fn build(&self, of: PredictorSetup<'_>) -> Result<Box<dyn Predictor>, Vec<KeyProblem>> {
        self.place_of.build(of)?;
        Ok((self.make)())
    }
}

impl AnyTracker for Instead<dyn AnyTracker, dyn Fn() -> Box<dyn GroundTracker> + Send + Sync> {
    fn build(
        &self,
        of: TrackerSetup<'_>,
        params: &toml::Table,
    ) -> Result<Box<dyn GroundTracker>, Vec<KeyProblem>> {
        self.place_of.build(of, params)?;
        Ok((self.make)())
    }
}
