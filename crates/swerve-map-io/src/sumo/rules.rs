//! Traffic lights, their programs, and stop lines.

use core::f64::consts::PI;
use std::collections::BTreeMap;

use swerve_geom::{Point2, math, wrap_angle};
use swerve_map::{LaneId, Signal, SignalId, StopLine, StopSign};

use super::connections::Connection;
use super::edges::{Edges, Slot};
use super::{Phase, Program};
use crate::problem::quoted;
use crate::xml::{Element, Reader, optional};

/// Letters of states.
const STATES: &str = "rygGsuoO";

/// Signals by traffic light and link.
pub(super) struct Lights<'a>(BTreeMap<(&'a str, u32), Signal>);

impl Lights<'_> {
    pub(super) fn into_signals(self) -> Vec<Signal> {
        self.0.into_values().collect()
    }
}

/// A signal for each link of each traffic light: at the end of the lane before it, facing its traffic.
pub(super) fn lights<'a>(edges: &Edges<'_>, connections: &[Connection<'a>]) -> Lights<'a> {
    let mut links: BTreeMap<(&str, u32), Signal> = BTreeMap::new();
    for connection in connections {
        let Some((light, link)) = connection.light else { continue };
        let signal = links.entry((light, link)).or_insert_with(|| {
            let (position, heading_rad) = end_of(edges, connection.from);
            Signal {
                id: SignalId(0),
                name: format!("{light}:{link}"),
                position,
                heading_rad,
                height_m: None,
                lanes: Vec::new(),
                controller: Some(light.to_owned()),
            }
        });
        let held = connection.via.and_then(|via| edges.lane(via)).or_else(|| edges.lane(connection.from));
        signal.lanes.extend(held);
    }
    links.values_mut().enumerate().for_each(|(k, signal)| signal.id = SignalId(k as u32));
    Lights(links)
}

/// End of a lane of the file, and the heading against its direction.
fn end_of(edges: &Edges<'_>, number: usize) -> (Point2, f64) {
    if let Slot::Lane(id) = edges.files[number].slot {
        let line = &edges.lanes[id.0 as usize].line;
        let pose = line.at(line.length()).pose;
        return (pose.point(), wrap_angle(pose.heading_rad + PI));
    }
    let [from, to] = edges.files[number].ends;
    (to, math::atan2(from.y_m - to.y_m, from.x_m - to.x_m))
}

/// Stop lines of traffic lights and of links that stop or give way.
pub(super) fn stop_lines(
    edges: &Edges<'_>,
    connections: &[Connection<'_>],
    lights: &Lights<'_>,
) -> Vec<StopLine> {
    // By lane; true at its end.
    let mut lines: BTreeMap<(LaneId, bool), StopLine> = BTreeMap::new();
    for connection in connections {
        let sign = match connection.state {
            "s" | "w" => Some(StopSign::Stop),
            "m" => Some(StopSign::Yield),
            _ => None,
        };
        let signal = connection.light.and_then(|link| lights.0.get(&link));
        if sign.is_none() && signal.is_none() {
            continue;
        }
        let inside = connection.via.and_then(|via| edges.lane(via)).map(|lane| (lane, false));
        let Some((lane, at_end)) = inside.or_else(|| edges.lane(connection.from).map(|lane| (lane, true)))
        else {
            continue;
        };
        let s_m = if at_end { edges.lanes[lane.0 as usize].line.length() } else { 0.0 };
        let line = lines.entry((lane, at_end)).or_insert_with(|| StopLine::new(lane, s_m));
        line.signals.extend(signal.map(|signal| signal.id));
        // Of two rules, the stricter.
        line.sign = line.sign.into_iter().chain(sign).min();
    }
    lines.into_values().collect()
}

/// Reads a program; its signals are set by [`with_signals`].
pub(super) fn program(xml: &mut Reader, at: Element<'_>) -> Program {
    let mut program = Program {
        light: xml.text(at, "id"),
        program: optional(at, "programID"),
        kind: optional(at, "type"),
        offset_s: xml.lenient(at, "offset").unwrap_or_default(),
        phases: Vec::new(),
        signals: Vec::new(),
    };
    for child in xml.children(at, &["phase", "param", "condition", "assignment", "function"]) {
        if !child.has_tag_name("phase") {
            continue;
        }
        let duration_s = xml.distance(child, "duration");
        let states = xml.text(child, "state");
        if let Some(other) = states.chars().find(|letter| !STATES.contains(*letter)) {
            xml.fault_in(child, "state", || {
                format!("expected letters of {STATES}, found {}", quoted(&other.to_string()))
            });
        }
        if let Some(first) =
            program.phases.first().filter(|first: &&Phase| first.states.len() != states.len())
        {
            let expected = first.states.len();
            xml.fault_in(child, "state", || {
                format!("expected {expected} letters as in the first phase, found {}", states.len())
            });
        }
        program.phases.push(Phase { duration_s, states });
    }
    program
}

/// Programs with the signals of their links.
pub(super) fn with_signals(
    xml: &mut Reader,
    programs: Vec<(Element<'_>, Program)>,
    lights: &Lights<'_>,
) -> Vec<Program> {
    let mut known = BTreeMap::new();
    let mut done = Vec::with_capacity(programs.len());
    for (at, mut program) in programs {
        let links = program.phases.first().map_or(0, |phase| phase.states.len());
        program.signals = vec![None; links];
        for ((_, link), signal) in lights.0.range((&*program.light, 0)..=(&*program.light, u32::MAX)) {
            match program.signals.get_mut(*link as usize) {
                Some(slot) => *slot = Some(signal.id),
                None => xml.defect(at, || format!("expected a state for link {link}, found {links} states")),
            }
        }
        if known.insert((program.light.clone(), program.program.clone()), ()).is_some() {
            let name = quoted(&program.program);
            xml.defect(at, || format!("program {name} of this traffic light is there twice"));
        }
        done.push(program);
    }
    done
}
