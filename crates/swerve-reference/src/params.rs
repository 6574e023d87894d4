//! Tables whose keys depend on other keys: parameters of planners and trackers, keys of operator kinds.

use schemars::{JsonSchema, schema_for};
use serde::Serialize;
use serde_json::Value;
use swerve_perception::ab3dmot;
use swerve_planning::{aeb, fot, hybrid_astar, rrt_star, waypoint};
use swerve_pylot::{HybridAstarParams, RrtStarParams};
use swerve_stack::Registry;

use crate::key::Key;
use crate::schema::{self, Arrays};

/// Keys of all such tables.
pub(crate) fn keys(registry: &Registry) -> Vec<Key> {
    let planning = "planning.params";
    let mut all = Vec::new();
    all.extend(of(planning, "planner = \"fot\"", &fot::Params::default()));
    all.extend(of(planning, "planner = \"rrt_star\"", &rrt_star::Params::default()));
    all.extend(of(planning, "planner = \"hybrid_astar\"", &hybrid_astar::Params::default()));
    all.extend(of(planning, "planner = \"waypoint\"", &waypoint::Params::default()));
    all.extend(of(planning, "planner = \"aeb\"", &aeb::Params::default()));
    let paper = |planner: &str| format!("preset = \"paper\", planner = \"{planner}\"");
    all.extend(of(planning, &paper("rrt_star"), &RrtStarParams::fast()));
    all.extend(of(planning, &paper("hybrid_astar"), &HybridAstarParams::fast()));
    all.extend(of("perception.tracker", "algorithm = \"ab3dmot\"", &ab3dmot::Params::default()));
    for kind in registry.kinds() {
        let name = kind.node().kind;
        if let Some(schema) = kind.schema() {
            let found = schema::keys(&schema, "operator.NAME", None, Arrays::Whole);
            all.extend(only_with(found, &format!("kind = \"{name}\"")));
        }
    }
    all
}

fn of<T: JsonSchema + Serialize>(prefix: &str, with: &str, defaults: &T) -> Vec<Key> {
    let defaults: Option<Value> = serde_json::to_value(defaults).ok();
    only_with(schema::keys(&schema_for!(T), prefix, defaults.as_ref(), Arrays::Whole), with)
}

fn only_with(keys: Vec<Key>, with: &str) -> Vec<Key> {
    keys.into_iter().map(|key| Key { only_with: Some(with.to_owned()), ..key }).collect()
}
