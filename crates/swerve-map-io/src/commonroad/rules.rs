//! Stop lines, traffic lights with their cycles, traffic signs, intersections.

use std::collections::BTreeMap;

use swerve_geom::Point2;
use swerve_map::{LaneId, Map};

use crate::content::{all, child, content};
use crate::problem::quoted;
use crate::xml::{Element, Reader};

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

/// Colours of a light.
const COLORS: [&str; 5] = ["red", "yellow", "redYellow", "green", "inactive"];

/// A line at which vehicles stop.
#[derive(Clone, PartialEq, Debug)]
pub struct StopLine {
    /// The lane that it crosses.
    pub lane: LaneId,
    /// Position along the lane, metres.
    pub at_m: f64,
    /// Identities of the traffic lights of the line and of its lanelet, in order.
    pub lights: Vec<u32>,
    /// Identities of the traffic signs of the line, in order.
    pub signs: Vec<u32>,
}

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
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Phase {
    /// Colour: `red`, `yellow`, `redYellow`, `green` or `inactive`.
    pub color: String,
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
    /// Position, metres; `None` if the file has none.
    pub position_m: Option<[f64; 3]>,
}

/// An intersection.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Intersection {
    /// Identity in the file.
    pub id: u32,
    /// Its incoming roads.
    pub incomings: Vec<Incoming>,
    /// Lanes of its crossings.
    pub crossings: Vec<LaneId>,
}

/// Lanes that enter an intersection side by side.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Incoming {
    /// Lanes before the intersection.
    pub lanes: Vec<LaneId>,
    /// Lanes within it that continue them.
    pub successors: Vec<LaneId>,
}

/// Rules of a file.
pub(super) struct Rules {
    pub(super) lights: Vec<Light>,
    pub(super) signs: Vec<Sign>,
    pub(super) intersections: Vec<Intersection>,
    sign_of: BTreeMap<u32, usize>,
}

impl Rules {
    pub(super) fn read(xml: &mut Reader, root: Element<'_>) -> Self {
        let signs: Vec<Sign> = all(root, "trafficSign").filter_map(|at| sign(xml, at)).collect();
        Self {
            lights: all(root, "trafficLight").filter_map(|at| light(xml, at)).collect(),
            intersections: all(root, "intersection").filter_map(|at| intersection(xml, at)).collect(),
            sign_of: signs.iter().enumerate().map(|(k, sign)| (sign.id, k)).collect(),
            signs,
        }
    }

    /// The sign of an identity.
    pub(super) fn sign(&self, id: u32) -> Option<&Sign> {
        self.sign_of.get(&id).map(|k| &self.signs[*k])
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
    let (mut kinds, mut speed_limit_mps) = (Vec::new(), None);
    for part in all(at, "trafficSignElement") {
        let name = child(part, "trafficSignID").map(content).unwrap_or_default();
        kinds.push(name.to_owned());
        if LIMITS.contains(&name) {
            speed_limit_mps =
                xml.lenient_measure(part, "additionalValue").filter(|limit_mps| *limit_mps > 0.0);
            if speed_limit_mps.is_none() {
                xml.defect(part, || "expected a speed limit in m/s in `additionalValue`".to_owned());
            }
        }
    }
    Some(Sign { id, kinds, speed_limit_mps, position_m: position(xml, at) })
}

fn light(xml: &mut Reader, at: Element<'_>) -> Option<Light> {
    let id = xml.identity(at, "id")?;
    let cycle = child(at, "cycle").map(|cycle| {
        let phases = all(cycle, "cycleElement")
            .map(|phase| Phase { color: color(xml, phase), steps: steps(xml, phase, "duration") });
        Cycle { phases: phases.collect(), offset_steps: steps(xml, cycle, "timeOffset") }
    });
    Some(Light {
        id,
        position_m: position(xml, at),
        direction: child(at, "direction").map(content).unwrap_or_default().to_owned(),
        active: child(at, "active").is_none_or(|active| content(active) != "false"),
        cycle,
    })
}

fn color(xml: &mut Reader, phase: Element<'_>) -> String {
    let name = child(phase, "color").map(content).unwrap_or_default();
    if !COLORS.contains(&name) {
        xml.defect(phase, || {
            format!("`color`: expected one of {}, found {}", COLORS.join(", "), quoted(name))
        });
    }
    name.chars().take(16).collect()
}

/// A number of time steps; 0 where it is missing.
fn steps(xml: &mut Reader, of: Element<'_>, name: &str) -> u32 {
    let Some(at) = child(of, name) else { return 0 };
    content(at).parse().unwrap_or_else(|_| {
        xml.defect(at, || format!("expected a number of time steps, found {}", quoted(content(at))));
        0
    })
}

fn intersection(xml: &mut Reader, at: Element<'_>) -> Option<Intersection> {
    let id = xml.identity(at, "id")?;
    let mut lanes = |of: Element<'_>, names: &[&str]| -> Vec<LaneId> {
        let all = of.children().filter(|child| names.contains(&child.tag_name().name()));
        all.filter_map(|lane| xml.identity(lane, "ref").map(LaneId)).collect()
    };
    let incomings = all(at, "incoming").map(|incoming| Incoming {
        lanes: lanes(incoming, &["incomingLanelet"]),
        successors: lanes(incoming, &["successorsRight", "successorsStraight", "successorsLeft"]),
    });
    let incomings = incomings.collect();
    let crossings = all(at, "crossing").flat_map(|crossing| lanes(crossing, &["crossingLanelet"])).collect();
    Some(Intersection { id, incomings, crossings })
}

/// Stop line of a lanelet as in the file.
pub(super) struct Line {
    lane: LaneId,
    /// No point, or its ends.
    points: Vec<Point2>,
    lights: Vec<u32>,
    signs: Vec<u32>,
}

impl Line {
    pub(super) fn read(xml: &mut Reader, lanelet: Element<'_>, lane: LaneId) -> Option<Self> {
        let at = child(lanelet, "stopLine")?;
        let points: Vec<Point2> = all(at, "point")
            .map(|point| Point2::new(xml.measure(point, "x"), xml.measure(point, "y")))
            .collect();
        let mut named = |of: Element<'_>, name| -> Vec<u32> {
            all(of, name).filter_map(|one| xml.identity(one, "ref")).collect()
        };
        let mut lights = named(lanelet, "trafficLightRef");
        lights.extend(named(at, "trafficLightRef"));
        let mut signs = named(at, "trafficSignRef");
        for ids in [&mut lights, &mut signs] {
            ids.sort_unstable();
            ids.dedup();
        }
        Some(Self { lane, points, lights, signs })
    }
}

/// Places of stop lines on the lanes of a map. Without a position, a line is at the end of its lane.
pub(super) fn stops(map: &Map, lines: &[Line]) -> Vec<StopLine> {
    let place = |line: &Line| {
        let lane = map.lane(line.lane)?;
        let length_m = lane.line.length();
        let at_m = match line.points[..] {
            [] => length_m,
            [at] => lane.line.project(at).s_m,
            [from, to, ..] => lane.line.project(from + (to - from) * 0.5).s_m,
        };
        let (lights, signs) = (line.lights.clone(), line.signs.clone());
        Some(StopLine { lane: line.lane, at_m: at_m.clamp(0.0, length_m), lights, signs })
    };
    let mut stops: Vec<StopLine> = lines.iter().filter_map(place).collect();
    stops.sort_by(|a, b| a.lane.cmp(&b.lane).then(a.at_m.total_cmp(&b.at_m)));
    stops
}
