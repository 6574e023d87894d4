//! Signals, stop lines, junctions and crossings of a map.

use core::f64::consts::PI;
use std::collections::{BTreeMap, BTreeSet};

use swerve_geom::{Point2, wrap_angle};
use swerve_map::{
    Crossing, CrossingId, Features, Junction, JunctionId, Lane, LaneId, Map, Signal, SignalId, StopLine,
    StopSign,
};

use super::rules::{Light, Rules};
use crate::content::{all, child};
use crate::draft::outline;
use crate::xml::{Element, Reader};

/// Lights that each lane obeys.
pub(super) type Obeys = BTreeMap<LaneId, BTreeSet<u32>>;

/// Stop line of a lanelet as in the file.
pub(super) struct Stop {
    lane: LaneId,
    /// No point, or its ends.
    points: Vec<Point2>,
    lights: BTreeSet<u32>,
    sign: Option<StopSign>,
}

impl Stop {
    /// Stop line of a lanelet, if it has one. Lights of the lanelet apply to it.
    pub(super) fn read(xml: &mut Reader, lanelet: Element<'_>, lane: LaneId, rules: &Rules) -> Option<Self> {
        let at = child(lanelet, "stopLine")?;
        let points =
            all(at, "point").map(|point| Point2::new(xml.measure(point, "x"), xml.measure(point, "y")));
        let points = points.collect();
        let of_line = all(at, "trafficLightRef").chain(all(lanelet, "trafficLightRef"));
        let lights = of_line.filter_map(|light| rules.named_light(xml, light)).collect();
        let signs = all(at, "trafficSignRef").chain(all(lanelet, "trafficSignRef"));
        let sign = signs.filter_map(|sign| rules.named_sign(xml, sign)?.stop).min();
        Some(Self { lane, points, lights, sign })
    }
}

/// Statements of lanelets about elements beside them.
#[derive(Default)]
pub(super) struct Statements {
    pub(super) stops: Vec<Stop>,
    pub(super) obeys: Obeys,
    /// Lanelets of type `crosswalk`.
    pub(super) crosswalks: BTreeSet<LaneId>,
}

/// Elements beside the lanes of a map.
pub(super) fn features(map: &Map, rules: &Rules, statements: &Statements) -> Features {
    let Statements { stops, obeys, crosswalks } = statements;
    let mut stop_lines: Vec<StopLine> = stops.iter().filter_map(|stop| stop_line(map, stop)).collect();
    // A light holds for the lanelets that name it, and for those whose stop line does.
    let mut lanes: BTreeMap<u32, BTreeSet<LaneId>> = BTreeMap::new();
    let of_lanes = obeys.iter().flat_map(|(lane, lights)| lights.iter().map(|light| (*light, *lane)));
    let of_lines = stops.iter().flat_map(|stop| stop.lights.iter().map(|light| (*light, stop.lane)));
    for (light, lane) in of_lanes.chain(of_lines).filter(|(_, lane)| map.lane(*lane).is_some()) {
        lanes.entry(light).or_default().insert(lane);
    }
    let signals = rules.lights.iter().filter_map(|light| {
        let lanes: Vec<LaneId> = lanes.get(&light.id).into_iter().flatten().copied().collect();
        signal(map, light, (lanes, rules.step_s))
    });
    let signals: Vec<Signal> = signals.collect();
    let known: BTreeSet<SignalId> = signals.iter().map(|signal| signal.id).collect();
    stop_lines.iter_mut().for_each(|line| line.signals.retain(|signal| known.contains(signal)));
    let there = |lanes: &[LaneId]| lanes.iter().copied().filter(|lane| map.lane(*lane).is_some()).collect();
    let junctions = rules.intersections.iter().map(|one| Junction {
        id: JunctionId(one.id),
        name: one.id.to_string(),
        lanes: there(&one.inside),
        incoming: there(&one.incoming),
        rights_of_way: Vec::new(),
    });
    let junctions = junctions.collect();
    Features {
        junctions,
        signals,
        stop_lines,
        crossings: crossings(map, rules, crosswalks),
        areas: Vec::new(),
    }
}

/// Place of a stop line. Without a position in the file, it is at the end of its lane.
fn stop_line(map: &Map, stop: &Stop) -> Option<StopLine> {
    let lane = map.lane(stop.lane)?;
    let length_m = lane.line.length();
    let s_m = match stop.points[..] {
        [] => length_m,
        [at] => lane.line.project(at).s_m,
        [from, to, ..] => lane.line.project(from + (to - from) * 0.5).s_m,
    };
    let signals = stop.lights.iter().copied().map(SignalId).collect();
    Some(StopLine { lane: stop.lane, s_m: s_m.clamp(0.0, length_m), signals, sign: stop.sign })
}

/// A light at its position in the file, or at the end of the first lane that obeys it; it shines against the traffic of
/// that lane. `None` if it has neither.
fn signal(map: &Map, light: &Light, (lanes, step_s): (Vec<LaneId>, Option<f64>)) -> Option<Signal> {
    let first = lanes.first().and_then(|lane| map.lane(*lane));
    let end = first.map(|Lane { line, .. }| line.at(line.length()).pose);
    let of_file = light.position_m.map(|[x, y, _]| Point2::new(x, y));
    Some(Signal {
        id: SignalId(light.id),
        name: light.id.to_string(),
        position: of_file.or(end.map(|pose| pose.point()))?,
        heading_rad: end.map_or(0.0, |pose| wrap_angle(pose.heading_rad + PI)),
        height_m: light.position_m.map(|[_, _, z]| z).filter(|z| *z != 0.0),
        lanes,
        controller: None,
        program: step_s.and_then(|step_s| light.program(step_s)),
    })
}

/// Crosswalks, and lanes that intersections name as crossings.
fn crossings(map: &Map, rules: &Rules, crosswalks: &BTreeSet<LaneId>) -> Vec<Crossing> {
    let mut lanes = crosswalks.clone();
    lanes.extend(rules.intersections.iter().flat_map(|one| one.crossings.iter().copied()));
    let crossing = |lane: &Lane| Crossing {
        id: CrossingId(lane.id.0),
        name: lane.id.0.to_string(),
        outline: outline(lane),
        lanes: Vec::new(),
    };
    lanes.iter().filter_map(|lane| map.lane(*lane)).map(crossing).collect()
}
