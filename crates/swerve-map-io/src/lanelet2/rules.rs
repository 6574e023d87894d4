//! Regulatory elements, and the number of relations of each type.

use std::collections::BTreeMap;

use super::osm::{Osm, Relation, tag};
use super::tags;
use crate::xml::{Element, Reader};

/// Most names that are counted; the rest is counted together.
const NAMES_MAX: usize = 100;

/// A regulatory element that a reader knows.
pub(super) struct Rule<'a> {
    pub(super) id: i64,
    pub(super) kind: RuleKind,
    pub(super) relation: Relation<'a>,
}

/// Kind of a regulatory element.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum RuleKind {
    TrafficLight,
    TrafficSign,
    RightOfWay,
    AllWayStop,
    Crosswalk,
    /// A stop line on the road.
    RoadMarking,
}

impl RuleKind {
    fn of(subtype: &str) -> Option<Self> {
        Some(match subtype {
            "traffic_light" => Self::TrafficLight,
            "traffic_sign" => Self::TrafficSign,
            "right_of_way" => Self::RightOfWay,
            "all_way_stop" => Self::AllWayStop,
            "crosswalk" => Self::Crosswalk,
            "road_marking" => Self::RoadMarking,
            _ => return None,
        })
    }
}

/// Rules of a file.
#[derive(Default)]
pub(super) struct Rules<'a> {
    /// In the order of their identities.
    pub(super) all: Vec<Rule<'a>>,
    /// Speed limits by the identity of their regulatory element, m/s.
    pub(super) speeds_mps: BTreeMap<i64, f64>,
    /// Relations by type and subtype, other than lanelets.
    pub(super) counts: BTreeMap<String, usize>,
}

impl<'a> Rules<'a> {
    pub(super) fn read(xml: &mut Reader, osm: &Osm<'a>) -> Self {
        let mut rules = Self::default();
        for (id, relation) in &osm.relations {
            let at = relation.element;
            let subtype = tag(at, "subtype").unwrap_or("without subtype");
            match tag(at, "type") {
                Some("lanelet") => rules.check_lanelet(xml, osm, relation),
                Some("regulatory_element") => {
                    if matches!(subtype, "speed_limit" | "digital_speed_limit") {
                        rules.speeds_mps.extend(speed(xml, at).map(|speed_mps| (*id, speed_mps)));
                    }
                    if let Some(kind) = RuleKind::of(subtype) {
                        rules.all.push(Rule { id: *id, kind, relation: relation.clone() });
                    }
                    rules.count("regulatory element", subtype);
                }
                Some("multipolygon") => rules.count("area", subtype),
                other => rules.count("relation", other.unwrap_or("without type")),
            }
        }
        rules
    }

    /// Reports regulatory elements that a lanelet names and that are missing.
    fn check_lanelet(&self, xml: &mut Reader, osm: &Osm<'_>, relation: &Relation<'_>) {
        for member in relation.members.iter().filter(|member| member.role == "regulatory_element") {
            let rule = osm.relations.get(&member.id).filter(|_| member.kind == "relation");
            if rule.and_then(|rule| tag(rule.element, "type")) != Some("regulatory_element") {
                xml.defect(member.element, || {
                    format!("expected the identity of a regulatory element, found {}", member.id)
                });
            }
        }
    }

    fn count(&mut self, what: &str, name: &str) {
        let name: String = name.chars().take(40).collect();
        let key = format!("{what} {name}");
        let is_new = !self.counts.contains_key(&key);
        let key = if is_new && self.counts.len() >= NAMES_MAX { "other relations".to_owned() } else { key };
        *self.counts.entry(key).or_default() += 1;
    }
}

/// Speed limit of a regulatory element: `30 km/h`, or a sign of Germany such as `de274-30`.
fn speed(xml: &mut Reader, at: Element<'_>) -> Option<f64> {
    let sign = tag(at, "sign_type").unwrap_or_default();
    if let Some(limit) = sign.strip_prefix("de274-").and_then(tags::speed_of) {
        return Some(limit);
    }
    ["sign_type", "limit", "speed_limit"]
        .into_iter()
        .find(|key| tag(at, key).is_some())
        .and_then(|key| tags::speed(xml, at, key))
}
