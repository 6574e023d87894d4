//! Reader of the lanes in CommonRoad's scenario files.
//!
//! Source: "CommonRoad: documentation of the XML format", version 2020a. Supported are lanelets (bounds,
//! predecessors, successors, adjacent lanelets, type), their stop lines with the referenced lights, and speed limit
//! signs; light cycles are ignored.

use core::f64::consts::PI;
use std::collections::BTreeMap;

use roxmltree::{Document, Node};
use swerve_geom::{Point2, Polyline, wrap_angle};
use swerve_map::{Border, Borders, Features, Lane, LaneId, LaneKind, Map, MapError, Neighbour, Station};
use swerve_map::{Signal, SignalId, StopLine};

use super::{PLACE_MAX_M, RecordedError, number, whole, wrong};
use crate::lanes::LaneGraph;

/// Ids of speed limit signs in the United States and in Germany; their value is in m/s.
const LIMITS: [&str; 2] = ["R2-1", "274"];

/// Reads a lane graph from CommonRoad XML.
///
/// # Errors
/// The first invalid element, or lanes that are inconsistent: line, and expected content.
pub fn commonroad_lanelets(text: &str) -> Result<LaneGraph, RecordedError> {
    let document = Document::parse(text).map_err(|error| wrong(error.pos().row as usize, error))?;
    let root = document.root_element();
    if root.tag_name().name() != "commonRoad" {
        return Err(told(root, format!("expected `<commonRoad>`, found `<{}>`", root.tag_name().name())));
    }
    let limits = limits(root)?;
    let (mut lanes, mut stops, mut lines) = (Vec::new(), Vec::new(), BTreeMap::new());
    for node in children(root, "lanelet") {
        let lane = lane(node, &limits)?;
        if let Some(line) = child(node, "stopLine") {
            stops.push(stop(node, line, &lane)?);
        }
        lines.insert(lane.id, line_of(node));
        lanes.push(lane);
    }
    if lanes.is_empty() {
        return Err(told(root, "expected lanelets, found none"));
    }
    let signals = signals(&lanes, &stops);
    let features = Features { signals, stop_lines: stops, ..Features::default() };
    let line = |error: &MapError| accused(error).map_or(1, |lane| lines[&lane]);
    let map = Map::with_features(lanes, features).map_err(|error| wrong(line(&error), error))?;
    Ok(LaneGraph::new(map))
}

/// The lane that an error refers to.
fn accused(error: &MapError) -> Option<LaneId> {
    match *error {
        MapError::Twice(lane)
        | MapError::Missing { lane, .. }
        | MapError::OneSided { lane, .. }
        | MapError::Gap { lane, .. }
        | MapError::Width { lane, .. } => Some(lane),
        MapError::Feature(_) => None,
    }
}

/// Lights of stop lines, each at the first of its stop lines: those of the file need not have a position.
fn signals(lanes: &[Lane], stops: &[StopLine]) -> Vec<Signal> {
    let mut signals: BTreeMap<SignalId, Signal> = BTreeMap::new();
    for stop in stops {
        let Some(lane) = lanes.iter().find(|lane| lane.id == stop.lane) else { continue };
        let pose = lane.line.at(stop.s_m).pose;
        for id in &stop.signals {
            let at_line = || Signal {
                id: *id,
                name: id.0.to_string(),
                position: pose.point(),
                heading_rad: wrap_angle(pose.heading_rad + PI),
                height_m: None,
                lanes: Vec::new(),
                controller: None,
            };
            signals.entry(*id).or_insert_with(at_line).lanes.push(stop.lane);
        }
    }
    signals.into_values().collect()
}

fn children<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |one| one.has_tag_name(name))
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

fn line_of(node: Node<'_, '_>) -> usize {
    node.document().text_pos_at(node.range().start).row as usize
}

fn told(node: Node<'_, '_>, what: impl core::fmt::Display) -> RecordedError {
    wrong(line_of(node), what)
}

fn attribute<'a>(node: Node<'a, '_>, name: &str) -> Result<&'a str, RecordedError> {
    let tag = node.tag_name().name();
    node.attribute(name).ok_or_else(|| told(node, format!("<{tag}>: expected an attribute `{name}`")))
}

/// Identity of an element, or one that it refers to.
fn identity(node: Node<'_, '_>, name: &str) -> Result<u32, RecordedError> {
    let id = whole(line_of(node), name, attribute(node, name)?, f64::from(u32::MAX))?;
    u32::try_from(id).map_err(|_| told(node, format!("{name}: expected no negative number, found `{id}`")))
}

/// Number in a child element of this name.
fn measure(node: Node<'_, '_>, name: &'static str) -> Result<f64, RecordedError> {
    let tag = node.tag_name().name();
    let inner = child(node, name).ok_or_else(|| told(node, format!("<{tag}>: expected <{name}>")))?;
    number(line_of(inner), name, inner.text().unwrap_or_default(), PLACE_MAX_M)
}

fn points(node: Node<'_, '_>) -> Result<Vec<Point2>, RecordedError> {
    children(node, "point").map(|one| Ok(Point2::new(measure(one, "x")?, measure(one, "y")?))).collect()
}

fn lane(node: Node<'_, '_>, limits: &BTreeMap<u32, f64>) -> Result<Lane, RecordedError> {
    let id = LaneId(identity(node, "id")?);
    let bound = |name| match child(node, name) {
        Some(bound) => points(bound),
        None => Err(told(node, format!("lanelet {}: expected <{name}>", id.0))),
    };
    let (left, right) = (bound("leftBound")?, bound("rightBound")?);
    if left.len() != right.len() {
        let [left, right] = [left.len(), right.len()];
        let what = format!("expected as many points to the left as to the right, found {left} and {right}");
        return Err(told(node, format!("lanelet {}: {what}", id.0)));
    }
    let middle = |(left, right): (&Point2, &Point2)| *left + (*right - *left) * 0.5;
    let middles: Vec<Point2> = left.iter().zip(&right).map(middle).collect();
    let line = Polyline::new(&middles).map_err(|error| told(node, format!("lanelet {}: {error}", id.0)))?;
    let half = |k: usize| 0.5 * left[k].distance(right[k]);
    let border = border(&middles, half).map_err(|error| told(node, format!("lanelet {}: {error}", id.0)))?;
    let mut lane = Lane::new(id, line, Borders::new(border.clone(), border));
    lane.kind = kind(child(node, "laneletType").and_then(|kind| kind.text()).unwrap_or_default());
    for next in children(node, "successor") {
        lane.successors.push(LaneId(identity(next, "ref")?));
    }
    let beside = |name| child(node, name).map(neighbour).transpose();
    (lane.left, lane.right) = (beside("adjacentLeft")?, beside("adjacentRight")?);
    for sign in children(node, "trafficSignRef") {
        let limit = limits.get(&identity(sign, "ref")?).copied();
        lane.speed_limit_mps = lane.speed_limit_mps.or(limit);
    }
    Ok(lane)
}

/// Border of a lane from its centre points and half widths.
fn border(middles: &[Point2], half_m: impl Fn(usize) -> f64) -> Result<Border, swerve_map::BorderError> {
    let mut stations = vec![Station { s_m: 0.0, distance_m: half_m(0) }];
    let (mut s_m, mut last) = (0.0, middles[0]);
    for (k, at) in middles.iter().enumerate().skip(1) {
        let on_m = at.distance(last);
        // Lines omit repeated points, and so must their borders.
        if on_m > 1e-6 {
            (s_m, last) = (s_m + on_m, *at);
            stations.push(Station { s_m, distance_m: half_m(k) });
        }
    }
    Border::linear(&stations)
}

fn kind(word: &str) -> LaneKind {
    match word.trim() {
        "sidewalk" | "crosswalk" => LaneKind::Walking,
        "bicycleLane" => LaneKind::Cycling,
        "shoulder" => LaneKind::Shoulder,
        "parking" => LaneKind::Parking,
        _ => LaneKind::Driving,
    }
}

fn neighbour(node: Node<'_, '_>) -> Result<Neighbour, RecordedError> {
    let opposite = match attribute(node, "drivingDir")? {
        "same" => false,
        "opposite" => true,
        other => {
            return Err(told(node, format!("drivingDir: expected same or opposite, found `{other}`")));
        }
    };
    Ok(Neighbour { lane: LaneId(identity(node, "ref")?), opposite })
}

/// Reads a stop line; without a position, it is at the end of its lane.
fn stop(lanelet: Node<'_, '_>, node: Node<'_, '_>, lane: &Lane) -> Result<StopLine, RecordedError> {
    let length_m = lane.line.length();
    let at_m = match points(node)?[..] {
        [] => length_m,
        [at] => lane.line.project(at).s_m,
        [from, to, ..] => lane.line.project(from + (to - from) * 0.5).s_m,
    };
    let named = children(lanelet, "trafficLightRef").chain(children(node, "trafficLightRef"));
    let signals = named.map(|light| identity(light, "ref").map(SignalId)).collect::<Result<_, _>>()?;
    Ok(StopLine { signals, ..StopLine::new(lane.id, at_m.clamp(0.0, length_m)) })
}

/// Speed limits by sign id, m/s.
fn limits(root: Node<'_, '_>) -> Result<BTreeMap<u32, f64>, RecordedError> {
    let mut limits = BTreeMap::new();
    for sign in children(root, "trafficSign") {
        for part in children(sign, "trafficSignElement") {
            let name = child(part, "trafficSignID").and_then(|id| id.text()).unwrap_or_default();
            if LIMITS.contains(&name.trim()) {
                limits.insert(identity(sign, "id")?, measure(part, "additionalValue")?);
            }
        }
    }
    Ok(limits)
}

#[cfg(test)]
mod tests;
