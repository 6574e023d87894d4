//! Lanes of the map by the relations of the file.

use std::collections::BTreeMap;

use swerve_map::{LaneId, Map};

use super::osm::Osm;
use super::rules::Rule;

/// Lanes of the map by the identity of their lanelet, and the lanes whose lanelets name a regulatory element.
#[derive(Default)]
pub(super) struct Lanes {
    pub(super) of_relation: BTreeMap<i64, Vec<LaneId>>,
    pub(super) of_rule: BTreeMap<i64, Vec<LaneId>>,
    pub(super) relation_of: BTreeMap<LaneId, i64>,
}

impl Lanes {
    /// Lanes of the map; `lanes` are the identities of lanelets and their lanes.
    pub(super) fn new(osm: &Osm<'_>, map: &Map, lanes: &[(i64, LaneId)]) -> Self {
        let mut found = Self::default();
        for (relation, lane) in lanes.iter().filter(|(_, lane)| map.lane(*lane).is_some()) {
            found.of_relation.entry(*relation).or_default().push(*lane);
            found.relation_of.insert(*lane, *relation);
            let members = osm.relations.get(relation).into_iter().flat_map(|one| &one.members);
            for rule in members.filter(|member| member.role == "regulatory_element") {
                found.of_rule.entry(rule.id).or_default().push(*lane);
            }
        }
        found
    }

    /// Lanes of the lanelets that a rule names with a role.
    pub(super) fn with_role(&self, rule: &Rule<'_>, role: &str) -> Vec<LaneId> {
        let named = rule.relation.members("relation", role);
        named.filter_map(|member| self.of_relation.get(&member.id)).flatten().copied().collect()
    }

    /// Lanes of the lanelets that name a rule.
    pub(super) fn that_name(&self, rule: &Rule<'_>) -> Vec<LaneId> {
        self.of_rule.get(&rule.id).cloned().unwrap_or_default()
    }
}
