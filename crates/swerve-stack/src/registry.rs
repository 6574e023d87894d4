//! Registry of operator kinds, of algorithms, of messages that faults can affect, and of views of messages.

use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_core::Span;
use swerve_flow::PayloadType;
use swerve_foxglove::Foxglove;
use swerve_msg::{Detections, RungTaken};

use crate::config::Config;
use crate::config::localization::LocalizerOperators;
use crate::config::perception::CUSTOM;
use crate::controllers::{AnyController, NamedController};
use crate::detectors::{AnyDetector, NamedDetector};
use crate::faults::{Corruptible, CorruptibleType};
use crate::kind::{Kind, OperatorKind, Registered, Settings};
use crate::named::{Named, Of};
use crate::planners::{AnyPlanner, NamedPlanner};
use crate::predictors::{AnyPredictor, NamedPredictor};
use crate::setup::Setup;
use crate::trackers::{AnyTracker, NamedTracker};

/// Operator kinds, algorithms, message types for faults, and views that configurations can use.
#[derive(Clone)]
pub struct Registry {
    kinds: BTreeMap<&'static str, Arc<dyn OperatorKind>>,
    pub(crate) planners: Named<dyn AnyPlanner>,
    pub(crate) controllers: Named<dyn AnyController>,
    pub(crate) predictors: Named<dyn AnyPredictor>,
    pub(crate) detectors: Named<dyn AnyDetector>,
    pub(crate) trackers: Named<dyn AnyTracker>,
    pub(crate) localizers: Named<LocalizerOperators>,
    corruptible: Vec<CorruptibleType>,
    views: Vec<AddView>,
}

/// Adds views to the Foxglove part of a log.
type AddView = Arc<dyn Fn(Foxglove) -> Foxglove + Send + Sync>;

impl Registry {
    /// Registry without kinds and algorithms.
    pub(crate) fn empty() -> Self {
        Self {
            kinds: BTreeMap::new(),
            planners: Named::default(),
            controllers: Named::default(),
            predictors: Named::default(),
            detectors: Named::default(),
            trackers: Named::default(),
            localizers: Named::default(),
            corruptible: Vec::new(),
            views: Vec::new(),
        }
    }

    /// Adds an operator, in place of an existing one of the same name.
    #[must_use]
    pub fn with<K: Kind>(self) -> Self {
        self.with_kind(Registered::<K>::new())
    }

    /// As [`with`](Self::with), for a kind whose ports depend on its settings.
    #[must_use]
    pub fn with_kind(mut self, kind: impl OperatorKind + 'static) -> Self {
        self.kinds.insert(kind.node().kind, Arc::new(kind));
        self
    }

    /// Adds a motion planner, or replaces the one of the same name.
    #[must_use]
    pub fn with_planner<P: NamedPlanner>(mut self) -> Self {
        self.planners.insert(P::NAME, Arc::new(Of::<P>::new()));
        self
    }

    /// Names of all motion planners.
    pub fn planners(&self) -> impl Iterator<Item = &'static str> {
        self.planners.names()
    }

    /// Adds a controller, or replaces the one of the same name.
    #[must_use]
    pub fn with_controller<C: NamedController>(mut self) -> Self {
        self.controllers.insert(C::NAME, Arc::new(Of::<C>::new()));
        self
    }

    /// Names of all controllers.
    pub fn controllers(&self) -> impl Iterator<Item = &'static str> {
        self.controllers.names()
    }

    /// Adds a predictor, or replaces the one of the same name.
    #[must_use]
    pub fn with_predictor<P: NamedPredictor>(mut self) -> Self {
        self.predictors.insert(P::NAME, Arc::new(Of::<P>::new()));
        self
    }

    /// Names of all predictors.
    pub fn predictors(&self) -> impl Iterator<Item = &'static str> {
        self.predictors.names()
    }

    /// Adds a camera detector, or replaces the one of the same name.
    #[must_use]
    pub fn with_detector<D: NamedDetector>(mut self) -> Self {
        self.detectors.insert(D::NAME, Arc::new(Of::<D>::new()));
        self
    }

    /// Names of all camera detectors, besides files of weights.
    pub fn detectors(&self) -> impl Iterator<Item = &'static str> {
        self.detectors.names()
    }

    /// Adds a tracker, or replaces the one of the same name.
    #[must_use]
    pub fn with_tracker<T: NamedTracker>(mut self) -> Self {
        self.trackers.insert(T::NAME, Arc::new(Of::<T>::new()));
        self
    }

    /// Names of all trackers of boxes.
    pub fn trackers(&self) -> impl Iterator<Item = &'static str> {
        self.trackers.names()
    }

    /// Names of all localizers.
    pub fn localizers(&self) -> impl Iterator<Item = &'static str> {
        self.localizers.names()
    }

    /// Adds a message type that faults can affect.
    #[must_use]
    pub fn with_corruptible<T: Corruptible>(mut self) -> Self {
        self.corruptible.push(CorruptibleType::new::<T>());
        self
    }

    /// Adds a message type that a log also has in a form for Foxglove: [`Foxglove::with_json`] for its fields,
    /// [`with_drawing`](Foxglove::with_drawing) for the map, [`with`](Foxglove::with) for a custom schema.
    #[must_use]
    pub fn with_view(mut self, add: impl Fn(Foxglove) -> Foxglove + Send + Sync + 'static) -> Self {
        self.views.push(Arc::new(add));
        self
    }

    /// Swerve's views, and those of [`with_view`](Self::with_view).
    pub fn with_views_of(&self, own: Foxglove) -> Foxglove {
        self.views.iter().fold(own, |foxglove, add| add(foxglove))
    }

    /// Kind of this name.
    pub fn kind(&self, name: &str) -> Option<&Arc<dyn OperatorKind>> {
        self.kinds.get(name)
    }

    /// All kinds, by name.
    pub fn kinds(&self) -> impl Iterator<Item = &Arc<dyn OperatorKind>> {
        self.kinds.values()
    }

    /// Message types that its kinds read and publish, by name.
    pub(crate) fn messages(&self) -> Vec<PayloadType> {
        let usual = Setup::new(Config::default(), self);
        let mut detecting = usual.clone();
        // Some ports exist only under certain settings.
        detecting.perception.detector = CUSTOM.to_owned();
        let boxes = [PayloadType::of::<Detections>()];
        let mut messages = vec![PayloadType::of::<RungTaken>()];
        for kind in self.kinds() {
            for (setup, offered) in [(&usual, &[][..]), (&detecting, &boxes[..])] {
                let settings = Settings { name: kind.node().kind, setup, offered };
                messages.extend(kind.outputs(&settings).into_iter().map(|port| port.payload));
                messages.extend(kind.inputs(&settings).into_iter().filter_map(|port| port.payload));
            }
        }
        // Spans are deadlines, which operators do not read.
        messages.retain(|message| *message != PayloadType::of::<Span>());
        messages.sort_by_key(PayloadType::name);
        messages.dedup();
        messages
    }

    /// Fault injection for messages of this type, if supported.
    pub(crate) fn corruptible(&self, payload: PayloadType) -> Option<&CorruptibleType> {
        self.corruptible.iter().find(|one| one.payload == payload)
    }
}

impl core::fmt::Debug for Registry {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.kinds.keys()).finish()
    }
}
