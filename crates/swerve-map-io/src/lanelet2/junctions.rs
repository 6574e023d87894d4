//! Junctions: lanes with the same `intersection_area`, and those of a right of way.

use std::collections::{BTreeMap, BTreeSet};

use swerve_map::{Junction, JunctionId, LaneId, Map, RightOfWay};

use super::lanes::Lanes;
use super::osm::{Osm, tag};
use super::rules::{Rule, RuleKind, Rules};

/// Most rights of way of a rule.
const RIGHTS_MAX: usize = 2048;

/// Junctions of a map. A right of way is part of the first junction that has one of its lanes, else it is a junction.
pub(super) fn junctions(osm: &Osm<'_>, map: &Map, rules: &Rules<'_>, lanes: &Lanes) -> Vec<Junction> {
    let mut found: Vec<Inside> = Vec::new();
    let mut by_area: BTreeMap<&str, BTreeSet<LaneId>> = BTreeMap::new();
    for (relation, lanes) in &lanes.of_relation {
        let area = osm.relations.get(relation).and_then(|one| tag(one.element, "intersection_area"));
        if let Some(area) = area.filter(|area| !area.is_empty()) {
            by_area.entry(area).or_default().extend(lanes);
        }
    }
    let mut owner: BTreeMap<LaneId, usize> = BTreeMap::new();
    for (name, lanes) in by_area {
        owner.extend(lanes.iter().map(|lane| (*lane, found.len())));
        found.push(Inside { name: name.to_owned(), lanes, rights: Vec::new() });
    }
    for rule in rules.all.iter().filter(|rule| rule.kind == RuleKind::RightOfWay) {
        let rights = rights(lanes, rule);
        let named: BTreeSet<LaneId> = rights.iter().flat_map(|right| [right.lane, right.to]).collect();
        if named.is_empty() {
            continue;
        }
        let known = named.iter().find_map(|lane| owner.get(lane)).copied();
        let at = known.unwrap_or_else(|| {
            found.push(Inside { name: rule.id.to_string(), lanes: BTreeSet::new(), rights: Vec::new() });
            found.len() - 1
        });
        owner.extend(named.iter().map(|lane| (*lane, at)));
        found[at].lanes.extend(named);
        found[at].rights.extend(rights);
    }
    found.into_iter().enumerate().map(|(k, one)| one.junction(map, JunctionId(k as u32))).collect()
}

/// Lanes inside a junction.
struct Inside {
    name: String,
    lanes: BTreeSet<LaneId>,
    rights: Vec<RightOfWay>,
}

impl Inside {
    fn junction(self, map: &Map, id: JunctionId) -> Junction {
        let before = self.lanes.iter().flat_map(|lane| map.predecessors(*lane));
        let incoming = before.copied().filter(|lane| !self.lanes.contains(lane)).collect();
        Junction {
            id,
            name: self.name,
            incoming,
            lanes: self.lanes.into_iter().collect(),
            rights_of_way: self.rights,
        }
    }
}

/// Pairs of a lane that gives way and one with priority.
fn rights(lanes: &Lanes, rule: &Rule<'_>) -> Vec<RightOfWay> {
    let priority = lanes.with_role(rule, "right_of_way");
    let gives = lanes.with_role(rule, "yield");
    let pairs = gives.iter().flat_map(|lane| priority.iter().map(|to| RightOfWay { lane: *lane, to: *to }));
    pairs.filter(|right| right.lane != right.to).take(RIGHTS_MAX).collect()
}
