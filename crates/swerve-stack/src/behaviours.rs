//! Behaviour planners that a configuration can name: built-in ones, and those of other crates.

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_behaviour::{
    BehaviourPlanner, FollowRoute, FollowRouteParams, PylotStates, PylotStatesParams, RuleBased,
    RuleBasedParams,
};
use swerve_core::Ranges;

/// A behaviour planner that `kind` of an operator can name.
///
/// [`Registry::with_behaviour`](crate::Registry::with_behaviour) adds one. `[operator.behaviour] kind = "NAME"` selects it.
pub trait NamedBehaviour: BehaviourPlanner + Sized + 'static {
    /// Name of the kind.
    const NAME: &'static str;

    /// Description in `swerve operators`.
    const DOC: &'static str;

    /// True if it reads the map and its conflict zones, which take time to find.
    const READS_MAP: bool = false;

    /// Parameters: the keys of the operator.
    type Params: Serialize + DeserializeOwned + Default + Ranges;

    /// Creates the planner, with parameters in their ranges.
    fn with_params(params: Self::Params) -> Self;
}

impl NamedBehaviour for FollowRoute {
    const NAME: &'static str = "follow_route";
    const DOC: &'static str = "keeps to the route and its speed limits, and stops at red lights";
    type Params = FollowRouteParams;

    fn with_params(params: FollowRouteParams) -> Self {
        Self::new(params)
    }
}

impl NamedBehaviour for PylotStates {
    const NAME: &'static str = "pylot_states";
    const DOC: &'static str = "Pylot's two states, which no motion planner reads; keeps to the route";
    type Params = PylotStatesParams;

    fn with_params(params: PylotStatesParams) -> Self {
        Self::new(params)
    }
}

impl NamedBehaviour for RuleBased {
    const NAME: &'static str = "rule_based";
    const DOC: &'static str = "also obeys rights of way, stop signs and crossings of the map";
    const READS_MAP: bool = true;
    type Params = RuleBasedParams;

    fn with_params(params: RuleBasedParams) -> Self {
        Self::new(params)
    }
}
