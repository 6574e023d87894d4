//! Regulatory elements and areas.

use std::collections::BTreeMap;

use super::osm::{Osm, tag};
use super::tags;
use crate::xml::Reader;

/// Most names that are counted; the rest is counted together.
const NAMES_MAX: usize = 100;

/// Rules of a file.
#[derive(Default)]
pub(super) struct Rules {
    /// Speed limits by the identity of their regulatory element, m/s.
    pub(super) speeds_mps: BTreeMap<i64, f64>,
    /// Relations by type and subtype, other than lanelets.
    pub(super) counts: BTreeMap<String, usize>,
}

impl Rules {
    pub(super) fn read(xml: &mut Reader, osm: &Osm<'_>) -> Self {
        let mut rules = Self::default();
        for (id, relation) in &osm.relations {
            let at = relation.element;
            let subtype = tag(at, "subtype").unwrap_or("without subtype");
            match tag(at, "type") {
                Some("lanelet") => {}
                Some("regulatory_element") => {
                    if matches!(subtype, "speed_limit" | "digital_speed_limit") {
                        let key = if tag(at, "sign_type").is_some() { "sign_type" } else { "limit" };
                        let speed_mps = tags::speed(xml, at, key);
                        rules.speeds_mps.extend(speed_mps.map(|speed_mps| (*id, speed_mps)));
                    }
                    rules.count("regulatory element", subtype);
                }
                Some("multipolygon") => rules.count("area", subtype),
                other => rules.count("relation", other.unwrap_or("without type")),
            }
        }
        rules
    }

    fn count(&mut self, what: &str, name: &str) {
        let name: String = name.chars().take(40).collect();
        let key = format!("{what} {name}");
        let is_new = !self.counts.contains_key(&key);
        let key = if is_new && self.counts.len() >= NAMES_MAX { "other relations".to_owned() } else { key };
        *self.counts.entry(key).or_default() += 1;
    }
}
