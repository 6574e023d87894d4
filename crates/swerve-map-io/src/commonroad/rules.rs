//! Traffic lights with their cycles, traffic signs, intersections.

use std::collections::{BTreeMap, BTreeSet};

use swerve_map::{Aspect, LaneId, SignalProgram, StopSign};

use crate::content::{all, child, content};
use crate::problem::quoted;
use crate::xml::{Element, Reader, number};

/// Identities of signs with a speed limit, by country; their value is in m/s.
const LIMITS: [&str; 12] = [
    "274",    // Germany, China, Zamunda
    "274.1",  // Germany, a zone
    "R2-1",   // United States, Puerto Rico
    "R301",   // Spain
    "B14",    // France
    "R15",    // Argentina
    "C43",    // Belgium
    "R-32",   // Greece
    "B31",    // Croatia
    "FIG_50", // Italy
    "3.24",   // Russia
    "C14",    // Australia
];

/// Identities of signs that stop traffic or make it give way, in Germany and the United States.
const STOPS: [(&str, StopSign); 4] =
    [("206", StopSign::Stop), ("205", StopSign::Yield), ("R1-1", StopSign::Stop), ("R1-2", StopSign::Yield)];

/// Colours of a light, with their aspects.
const COLORS: [(&str, Aspect); 5] = [
    ("red", Aspect::Red),
    ("yellow", Aspect::Yellow),
    ("redYellow", Aspect::RedYellow),
    ("green", Aspect::Green),
    ("inactive", Aspect::Off),
];

/// A traffic light.
#[derive(Clone, PartialEq, Debug)]
pub struct Light {
    /// Identity in the file.
    pub id: u32,
    /// Position, metres; `None` if the file has none.
    pub position_m: Option<[f64; 3]>,
    /// Directions that it is for, such as `straightRight`; empty for all.
    pub direction: String,
    /// False if it is out of order.
    pub active: bool,
    /// Its cycle; `None` if the file has none.
    pub cycle: Option<Cycle>,
}

/// Repeated phases of a light.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Cycle {
    /// Start of the first phase, time steps.
    pub offset_steps: u32,
    /// Phases in order.
    pub phases: Vec<Phase>,
}

/// A phase of a light.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Phase {
    /// Its colour; `inactive` is off.
    pub aspect: Aspect,
    /// Duration, time steps.
    pub steps: u32,
}

/// A traffic sign, or several at one post.
#[derive(Clone, PartialEq, Debug)]
pub struct Sign {
    /// Identity in the file.
    pub id: u32,
    /// Identities of the signs in their country's catalogue.
    pub kinds: Vec<String>,
    /// Speed limit, m/s.
    pub speed_limit_mps: Option<f64>,
    /// Rule for a stop line.
    pub stop: Option<StopSign>,
    /// Position, metres; `None` if the file has none.
    pub position_m: Option<[f64; 3]>,
}

/// An intersection.
pub(super) struct Intersection {
    pub(super) id: u32,
    /// Lanes before it.
    pub(super) incoming: Vec<LaneId>,
    /// Lanes within it that continue them.
    pub(super) inside: Vec<LaneId>,
    /// Lanes of its crossings.
    pub(super) crossings: Vec<LaneId>,
}

/// Rules of a file.
pub(super) struct Rules {
    /// Duration of a time step, seconds.
    pub(super) step_s: Option<f64>,
    pub(super) lights: Vec<Light>,
    pub(super) signs: Vec<Sign>,
    pub(super) intersections: Vec<Intersection>,
    sign_of: BTreeMap<u32, usize>,
    light_ids: BTreeSet<u32>,
}

impl Rules {
    pub(super) fn read(xml: &mut Reader, root: Element<'_>) -> Self {
        let has_cycles = all(root, "trafficLight").any(|light| child(light, "cycle").is_some());
        let step_s = match root.attribute("timeStepSize").map(number) {
            Some(Ok(step_s)) => Some(step_s),
            Some(Err(message)) if has_cycles => {
                xml.fault_in(root, "timeStepSize", || message);
                None
            }
            None if has_cycles => {
                xml.missing(root, "timeStepSize");
                None
            }
            _ => xml.lenient(root, "timeStepSize"),
        };
        let signs: Vec<Sign> = all(root, "trafficSign").filter_map(|at| sign(xml, at)).collect();
        let lights: Vec<Light> = all(root, "trafficLight").filter_map(|at| light(xml, at, step_s)).collect();
        Self {
            step_s,
            light_ids: lights.iter().map(|light| light.id).collect(),
            lights,
            intersections: all(root, "intersection").filter_map(|at| intersection(xml, at)).collect(),
            sign_of: signs.iter().enumerate().map(|(k, sign)| (sign.id, k)).collect(),
            signs,
        }
    }

    /// The sign that an element names; its absence is a defect.
    pub(super) fn named_sign(&self, xml: &mut Reader, at: Element<'_>) -> Option<&Sign> {
        let id = xml.identity(at, "ref")?;
        let found = self.sign_of.get(&id).map(|k| &self.signs[*k]);
        if found.is_none() {
            xml.defect(at, || format!("expected the identity of a traffic sign, found {id}"));
        }
        found
    }

    /// The light that an element names; its absence is a defect.
    pub(super) fn named_light(&self, xml: &mut Reader, at: Element<'_>) -> Option<u32> {
        let id = xml.identity(at, "ref")?;
        if !self.light_ids.contains(&id) {
            xml.defect(at, || format!("expected the identity of a traffic light, found {id}"));
            return None;
        }
        Some(id)
    }

    /// Numbers by kind, without zeros.
    pub(super) fn counts(&self) -> BTreeMap<String, usize> {
        let counts = [
            ("traffic lights", self.lights.len()),
            ("traffic signs", self.signs.len()),
            ("intersections", self.intersections.len()),
        ];
        counts
            .into_iter()
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| (name.to_owned(), count))
            .collect()
    }
}

fn position(xml: &mut Reader, at: Element<'_>) -> Option<[f64; 3]> {
    let point = child(child(at, "position")?, "point")?;
    let [x, y] = ["x", "y"].map(|name| xml.lenient_measure(point, name));
    Some([x?, y?, xml.lenient_measure(point, "z").unwrap_or_default()])
}

fn sign(xml: &mut Reader, at: Element<'_>) -> Option<Sign> {
    let id = xml.identity(at, "id")?;
    let (mut kinds, mut speed_limit_mps, mut stop) = (Vec::new(), None, None);
    for part in all(at, "trafficSignElement") {
        let name = child(part, "trafficSignID").map(content).unwrap_or_default();
        kinds.push(name.to_owned());
        stop = stop.or_else(|| STOPS.iter().find(|(id, _)| *id == name).map(|(_, rule)| *rule));
        if LIMITS.contains(&name) {
            speed_limit_mps =
                xml.lenient_measure(part, "additionalValue").filter(|limit_mps| *limit_mps > 0.0);
            if speed_limit_mps.is_none() {
                xml.defect(part, || "expected a speed limit in m/s in `additionalValue`".to_owned());
            }
        }
    }
    Some(Sign { id, kinds, speed_limit_mps, stop, position_m: position(xml, at) })
}

fn light(xml: &mut Reader, at: Element<'_>, step_s: Option<f64>) -> Option<Light> {
    let id = xml.identity(at, "id")?;
    let cycle_at = child(at, "cycle");
    let cycle = cycle_at.map(|cycle| {
        let phases = all(cycle, "cycleElement").filter_map(|phase| {
            Some(Phase { aspect: color(xml, phase)?, steps: steps(xml, phase, "duration")? })
        });
        let phases = phases.collect();
        let offset_steps = child(cycle, "timeOffset").and_then(|_| steps(xml, cycle, "timeOffset"));
        Cycle { phases, offset_steps: offset_steps.unwrap_or_default() }
    });
    let light = Light {
        id,
        position_m: position(xml, at),
        direction: child(at, "direction").map(content).unwrap_or_default().to_owned(),
        active: child(at, "active").is_none_or(|active| content(active) != "false"),
        cycle,
    };
    if let (Some(at), Some(cycle), Some(step_s)) =
        (cycle_at, &light.cycle, step_s.filter(|_| xml.faults() == 0))
    {
        let checked = cycle.program(step_s).check();
        checked.unwrap_or_else(|error| xml.fault(at, || error.to_string()));
    }
    Some(light)
}

impl Light {
    /// Its phases, given the duration of a time step; `None` without a cycle, and if it is out of order.
    pub fn program(&self, step_s: f64) -> Option<SignalProgram> {
        self.cycle.as_ref().filter(|_| self.active).map(|cycle| cycle.program(step_s))
    }
}

impl Cycle {
    fn program(&self, step_s: f64) -> SignalProgram {
        let mut program = SignalProgram::default();
        for Phase { aspect, steps } in &self.phases {
            program.push(*aspect, f64::from(*steps) * step_s);
        }
        SignalProgram { offset_s: 0.0 - f64::from(self.offset_steps) * step_s, ..program }
    }
}

fn color(xml: &mut Reader, phase: Element<'_>) -> Option<Aspect> {
    let name = child(phase, "color").map(content).unwrap_or_default();
    let found = COLORS.iter().find(|(known, _)| *known == name).map(|(_, aspect)| *aspect);
    if found.is_none() {
        let known = COLORS.map(|(known, _)| known).join(", ");
        xml.fault(phase, || format!("`color`: expected one of {known}, found {}", quoted(name)));
    }
    found
}

/// A number of time steps in a child element.
fn steps(xml: &mut Reader, of: Element<'_>, name: &str) -> Option<u32> {
    let at = xml.child(of, name)?;
    let steps = content(at).parse().ok();
    if steps.is_none() {
        xml.fault(at, || format!("expected a number of time steps, found {}", quoted(content(at))));
    }
    steps
}

fn intersection(xml: &mut Reader, at: Element<'_>) -> Option<Intersection> {
    let id = xml.identity(at, "id")?;
    let mut lanes = |of: Element<'_>, names: &[&str]| -> Vec<LaneId> {
        let all = of.children().filter(|child| names.contains(&child.tag_name().name()));
        all.filter_map(|lane| xml.identity(lane, "ref").map(LaneId)).collect()
    };
    let roads: Vec<_> = all(at, "incoming").collect();
    let mut of_roads = |names: &[&str]| roads.iter().flat_map(|road| lanes(*road, names)).collect();
    let incoming = of_roads(&["incomingLanelet"]);
    let inside = of_roads(&["successorsRight", "successorsStraight", "successorsLeft"]);
    let crossings = all(at, "crossing").flat_map(|crossing| lanes(crossing, &["crossingLanelet"])).collect();
    Some(Intersection { id, incoming, inside, crossings })
}
