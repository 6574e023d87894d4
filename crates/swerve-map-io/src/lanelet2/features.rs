//! Signals, stop lines, junctions and crossings of a map.

use core::f64::consts::PI;
use std::collections::{BTreeMap, BTreeSet};

use swerve_geom::{Point2, wrap_angle};
use swerve_map::{Crossing, CrossingId, Features, LaneId, Map, Signal, SignalId, StopLine, StopSign};

use super::areas::areas;
use super::junctions::junctions;
use super::lanelets::points;
use super::lanes::Lanes;
use super::osm::{Osm, tag};
use super::rules::{Rule, RuleKind, Rules};
use super::stops::met;
use crate::draft::outline;
use crate::xml::Reader;

/// Most pairs of a lane and an element of a rule.
const PAIRS_MAX: usize = 2048;

/// Elements beside the lanes of a map.
pub(super) fn features(
    xml: &mut Reader,
    osm: &Osm<'_>,
    map: &Map,
    rules: &Rules<'_>,
    lanes: &Lanes,
) -> Features {
    let mut build = Build {
        osm,
        map,
        lanes,
        signals: BTreeMap::new(),
        lines: BTreeMap::new(),
        crossings: BTreeMap::new(),
    };
    for rule in &rules.all {
        match rule.kind {
            RuleKind::TrafficLight => build.light(xml, rule),
            RuleKind::Crosswalk => build.crosswalk(xml, rule),
            RuleKind::RightOfWay | RuleKind::AllWayStop => build.priority(xml, rule),
            RuleKind::TrafficSign => build.sign(xml, rule),
            RuleKind::RoadMarking => {
                for line in lines(xml, osm, rule, "refers") {
                    build.stop(&lanes.that_name(rule), &line, None);
                }
            }
        }
    }
    build.crosswalks_without_rule();
    let signals = build.signals.into_values().collect();
    let stop_lines = build.lines.into_values().collect();
    let crossings = build.crossings.into_values().enumerate();
    let crossings = crossings.map(|(k, one)| Crossing { id: CrossingId(k as u32), ..one }).collect();
    Features {
        junctions: junctions(osm, map, rules, lanes),
        signals,
        stop_lines,
        crossings,
        areas: areas(xml, osm),
    }
}

/// Lines of the ways that a rule names with a role.
fn lines(xml: &mut Reader, osm: &Osm<'_>, rule: &Rule<'_>, role: &str) -> Vec<Vec<Point2>> {
    let members: Vec<_> = rule.relation.members("way", role).collect();
    let lines = members.into_iter().filter_map(|way| points(xml, osm, way.element, way.id));
    lines.filter(|line| line.len() > 1).collect()
}

/// Reports a rule for more pairs of elements and lanes than there are at any junction.
fn is_too_large(xml: &mut Reader, rule: &Rule<'_>, elements: usize, lanes: usize) -> bool {
    let is_so = elements.saturating_mul(lanes) > PAIRS_MAX;
    if is_so {
        xml.defect(rule.relation.element, || {
            format!("expected at most {PAIRS_MAX} pairs of lanes and elements, found {lanes} and {elements}: left out")
        });
    }
    is_so
}

struct Build<'a> {
    osm: &'a Osm<'a>,
    map: &'a Map,
    lanes: &'a Lanes,
    /// By the identity of their way.
    signals: BTreeMap<i64, Signal>,
    /// By lane and arc length in tenths of a millimetre.
    lines: BTreeMap<(LaneId, i64), StopLine>,
    /// By the identity of their lanelet or polygon.
    crossings: BTreeMap<i64, Crossing>,
}

impl Build<'_> {
    /// Adds a stop line, or a rule to one that is there; returns its keys.
    fn stop(&mut self, lanes: &[LaneId], line: &[Point2], sign: Option<StopSign>) -> Vec<(LaneId, i64)> {
        let mut keys = Vec::new();
        for (lane, s_m) in met(self.map, lanes, line) {
            let key = (lane, (1e4 * s_m).round() as i64);
            let found = self.lines.entry(key).or_insert_with(|| StopLine::new(lane, s_m));
            // Of two rules, the stricter.
            found.sign = found.sign.into_iter().chain(sign).min();
            keys.push(key);
        }
        keys
    }

    /// Lights of a rule; without a stop line in the file, lanes stop at their ends.
    fn light(&mut self, xml: &mut Reader, rule: &Rule<'_>) {
        let lanes = self.lanes.that_name(rule);
        let ways: Vec<_> = rule.relation.members("way", "refers").copied().collect();
        if is_too_large(xml, rule, ways.len(), lanes.len()) {
            return;
        }
        let mut ids = Vec::new();
        for way in ways {
            let Some(line) = points(xml, self.osm, way.element, way.id).filter(|line| !line.is_empty())
            else {
                continue;
            };
            let next = SignalId(self.signals.len() as u32);
            let end = lanes
                .first()
                .and_then(|lane| self.map.lane(*lane))
                .map(|lane| lane.line.at(lane.line.length()).pose);
            let height_m = self.height_m(way.id, &lanes);
            let signal = self.signals.entry(way.id).or_insert_with(|| Signal {
                id: next,
                name: way.id.to_string(),
                position: line[0] + (line[line.len() - 1] - line[0]) * 0.5,
                heading_rad: end.map_or(0.0, |pose| wrap_angle(pose.heading_rad + PI)),
                height_m,
                lanes: Vec::new(),
                controller: Some(rule.id.to_string()),
                program: None,
            });
            signal.lanes.extend(&lanes);
            ids.push(signal.id);
        }
        let stop_lines = lines(xml, self.osm, rule, "ref_line");
        let mut keys = Vec::new();
        for line in &stop_lines {
            keys.extend(self.stop(&lanes, line, None));
        }
        for lane in lanes.iter().filter(|_| stop_lines.is_empty()).filter_map(|lane| self.map.lane(*lane)) {
            let s_m = lane.line.length();
            let key = (lane.id, (1e4 * s_m).round() as i64);
            self.lines.entry(key).or_insert_with(|| StopLine::new(lane.id, s_m));
            keys.push(key);
        }
        for key in keys {
            self.lines.entry(key).and_modify(|line| line.signals.extend(&ids));
        }
    }

    /// Height of a light over the end of the first lane that obeys it, metres.
    fn height_m(&self, way: i64, lanes: &[LaneId]) -> Option<f64> {
        let mean_m = |way: i64, take: usize| {
            let nodes = &self.osm.ways.get(&way)?.nodes;
            let heights: Vec<f64> =
                nodes.iter().rev().take(take).filter_map(|(_, node)| self.osm.nodes.get(node)?.z_m).collect();
            (!heights.is_empty()).then(|| heights.iter().sum::<f64>() / heights.len() as f64)
        };
        let lanelet = self.lanes.relation_of.get(lanes.first()?)?;
        let border = self.osm.relations.get(lanelet)?.members("way", "left").next()?.id;
        Some(mean_m(way, usize::MAX)? - mean_m(border, usize::MAX)?)
    }

    /// A stop or yield sign at a stop line.
    fn sign(&mut self, xml: &mut Reader, rule: &Rule<'_>) {
        let ways = rule.relation.members("way", "refers").filter_map(|member| self.osm.ways.get(&member.id));
        let signs =
            ways.filter_map(|way| tag(way.element, "subtype")).chain(tag(rule.relation.element, "sign_type"));
        let Some(sign) = signs.filter_map(sign_of).min() else { return };
        for line in lines(xml, self.osm, rule, "ref_line") {
            self.stop(&self.lanes.that_name(rule), &line, Some(sign));
        }
    }

    /// Stop lines of lanes that give way: those of the rule, the lanes before them, and others that name it.
    fn priority(&mut self, xml: &mut Reader, rule: &Rule<'_>) {
        let sign = if rule.kind == RuleKind::AllWayStop { StopSign::Stop } else { StopSign::Yield };
        let mut lanes = self.lanes.with_role(rule, "yield");
        let before: Vec<LaneId> =
            lanes.iter().flat_map(|lane| self.map.predecessors(*lane)).copied().collect();
        let first: BTreeSet<LaneId> = self.lanes.with_role(rule, "right_of_way").into_iter().collect();
        lanes.extend(before);
        lanes.extend(self.lanes.that_name(rule));
        lanes.retain(|lane| !first.contains(lane));
        lanes.sort_unstable();
        lanes.dedup();
        for line in lines(xml, self.osm, rule, "ref_line") {
            self.stop(&lanes, &line, Some(sign));
        }
    }

    /// A crossing with the lanes that name its rule, and their stop lines.
    fn crosswalk(&mut self, xml: &mut Reader, rule: &Rule<'_>) {
        let lanes = self.lanes.that_name(rule);
        if is_too_large(xml, rule, rule.relation.members.len(), lanes.len()) {
            return;
        }
        let polygon = lines(xml, self.osm, rule, "crosswalk_polygon").into_iter().find(|line| line.len() > 2);
        for member in rule.relation.members("relation", "refers") {
            let Some(lane) =
                self.lanes.of_relation.get(&member.id).and_then(|of| self.map.lane(*of.first()?))
            else {
                xml.defect(member.element, || {
                    format!("expected the identity of a lanelet, found {}", member.id)
                });
                continue;
            };
            let crossing = self.crossings.entry(member.id).or_insert_with(|| Crossing {
                id: CrossingId(0),
                name: member.id.to_string(),
                outline: polygon.clone().unwrap_or_else(|| outline(lane)),
                lanes: Vec::new(),
            });
            crossing.lanes.extend(&lanes);
        }
        for line in lines(xml, self.osm, rule, "ref_line") {
            self.stop(&lanes, &line, Some(StopSign::Yield));
        }
    }

    fn crosswalks_without_rule(&mut self) {
        for (relation, lanes) in &self.lanes.of_relation {
            let is_crosswalk = self.osm.relations.get(relation).and_then(|one| tag(one.element, "subtype"))
                == Some("crosswalk");
            let Some(lane) = lanes.first().and_then(|lane| self.map.lane(*lane)).filter(|_| is_crosswalk)
            else {
                continue;
            };
            self.crossings.entry(*relation).or_insert_with(|| Crossing {
                id: CrossingId(0),
                name: relation.to_string(),
                outline: outline(lane),
                lanes: Vec::new(),
            });
        }
    }
}

/// Rule of a traffic sign: Lanelet2's identities of Germany and the United States, or Autoware's names.
fn sign_of(name: &str) -> Option<StopSign> {
    match name {
        "stop_sign" | "stop" | "de206" | "usR1-1" => Some(StopSign::Stop),
        "yield_sign" | "yield" | "de205" | "usR1-2" => Some(StopSign::Yield),
        _ => None,
    }
}
