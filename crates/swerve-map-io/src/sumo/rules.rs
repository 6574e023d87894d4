//! Traffic lights, their programs, and stop lines.

use core::f64::consts::PI;
use std::collections::{BTreeMap, BTreeSet};

use swerve_geom::{Point2, math, wrap_angle};
use swerve_map::{Aspect, LaneId, Signal, SignalId, SignalPhase, SignalProgram, StopLine, StopSign};

use super::connections::Connection;
use super::edges::{Edges, Slot};
use super::{Phase, Program};
use crate::problem::quoted;
use crate::xml::{Element, Reader, optional};

/// Letters of states, with their aspects. A right arrow beside red needs a stop and a look: traffic stays.
const STATES: [(char, Aspect); 9] = [
    ('r', Aspect::Red),
    ('y', Aspect::Yellow),
    ('Y', Aspect::Yellow),
    ('g', Aspect::Green),
    ('G', Aspect::Green),
    ('s', Aspect::Red),
    ('u', Aspect::RedYellow),
    ('o', Aspect::Off),
    ('O', Aspect::Off),
];

/// Most phases of all signals together.
const PHASES_MAX: usize = 2_000_000;

/// Signals by traffic light and link.
pub(super) struct Lights<'a>(BTreeMap<(&'a str, u32), Signal>);

impl Lights<'_> {
    /// Gives each signal the phases of its link in the last program of its light, which is the one that SUMO starts
    /// with. Lights whose phases depend on traffic have none.
    pub(super) fn set_programs(&mut self, xml: &mut Reader, programs: &[(Element<'_>, Program)]) {
        let last: BTreeMap<&str, &(Element<'_>, Program)> =
            programs.iter().map(|program| (&*program.1.light, program)).collect();
        let mut phases = 0;
        for ((light, link), signal) in &mut self.0 {
            let Some((at, program)) = last.get(light).filter(|(_, program)| program.is_fixed) else {
                continue;
            };
            phases += program.phases.len();
            if phases > PHASES_MAX {
                xml.fault(*at, || format!("expected at most {PHASES_MAX} phases of all signals"));
                return;
            }
            signal.program = program.of_link(*link as usize);
        }
    }

    pub(super) fn into_signals(self) -> Vec<Signal> {
        self.0.into_values().collect()
    }
}

impl Program {
    /// Phases of a link; `None` if the program has none for it.
    fn of_link(&self, link: usize) -> Option<SignalProgram> {
        let mut program = SignalProgram { phases: Vec::new(), offset_s: 0.0 - self.offset_s };
        for Phase { duration_s, states } in &self.phases {
            let letter = char::from(*states.as_bytes().get(link)?);
            let (_, aspect) = STATES.iter().find(|(known, _)| *known == letter)?;
            program.push(*aspect, *duration_s);
        }
        Some(program)
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
                program: None,
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

/// Reads a program; its signals are set by [`set_signals`].
pub(super) fn program(xml: &mut Reader, at: Element<'_>) -> Program {
    let kind = optional(at, "type");
    let mut program = Program {
        light: xml.text(at, "id"),
        program: optional(at, "programID"),
        offset_s: match at.attribute("offset") {
            // The start of the simulation.
            Some("begin") => 0.0,
            _ => xml.number_or(at, "offset", 0.0),
        },
        phases: Vec::new(),
        is_fixed: matches!(&*kind, "" | "static"),
        kind,
        signals: Vec::new(),
    };
    for child in xml.children(at, &["phase", "param", "condition", "assignment", "function"]) {
        if child.has_tag_name("phase") {
            let phase = phase(xml, child, program.phases.first());
            program.phases.push(phase);
            program.is_fixed &= !child.has_attribute("next");
        }
    }
    if program.is_fixed {
        let cycle = program.phases.iter().map(|phase| (Aspect::Red, phase.duration_s));
        let cycle = cycle.map(|(aspect, duration_s)| SignalPhase { aspect, duration_s }).collect();
        let checked = SignalProgram { phases: cycle, offset_s: program.offset_s }.check();
        checked.unwrap_or_else(|error| xml.fault(at, || error.to_string()));
    }
    program
}

fn phase(xml: &mut Reader, at: Element<'_>, first: Option<&Phase>) -> Phase {
    let duration_s = xml.distance(at, "duration");
    let states = xml.text(at, "state");
    if let Some(other) = states.chars().find(|letter| !STATES.iter().any(|(known, _)| known == letter)) {
        xml.fault_in(at, "state", || {
            let known: String = STATES.iter().map(|(letter, _)| letter).collect();
            format!("expected letters of {known}, found {}", quoted(&other.to_string()))
        });
    }
    if let Some(first) = first.filter(|first| first.states.len() != states.len()) {
        let expected = first.states.len();
        xml.fault_in(at, "state", || {
            format!("expected {expected} letters as in the first phase, found {}", states.len())
        });
    }
    Phase { duration_s, states }
}

/// Sets the signals of the links of all programs.
pub(super) fn set_signals(xml: &mut Reader, programs: &mut [(Element<'_>, Program)], lights: &Lights<'_>) {
    let mut known = BTreeSet::new();
    for (at, program) in programs {
        let links = program.phases.first().map_or(0, |phase| phase.states.len());
        program.signals = vec![None; links];
        for ((_, link), signal) in lights.0.range((&*program.light, 0)..=(&*program.light, u32::MAX)) {
            match program.signals.get_mut(*link as usize) {
                Some(slot) => *slot = Some(signal.id),
                None => {
                    let message = || format!("expected a state for link {link}, found {links} states");
                    // Railways have programs without phases.
                    if program.is_fixed { xml.fault(*at, message) } else { xml.defect(*at, message) }
                }
            }
        }
        if !known.insert((&*program.light, &*program.program)) {
            let name = quoted(&program.program);
            xml.defect(*at, || format!("program {name} of this traffic light is there twice"));
        }
    }
}
