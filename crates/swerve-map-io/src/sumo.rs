//! Reader of SUMO's road networks (`.net.xml`), as netconvert and netedit write them.
//!
//! **Read.** Lanes of edges with shape, width, speed and permissions; lanes inside junctions; connections; junctions with
//! their rights of way; traffic lights with their programs; crossings and walking areas. Heights are grades
//! beside the flat map. Railways and waterways are left out.
//!
//! **Frame.** The coordinates of the file less its `netOffset`: those of the projection. SUMO itself, and TraCI, use the
//! coordinates of the file. [`read_near`] reads a network whose projection is far from the origin, such as UTM, in
//! coordinates near it.
//!
//! **Lanes.** The shape of a lane is its centre line; vertices at most [`STEP_M`](crate::import::STEP_M) apart are added.
//! The width is 3.2 m unless the file has another. Lanes of an edge are neighbours. Those of an edge inside a junction
//! are neighbours if they are beside each other at both ends.
//!
//! **Marks.** The format has none. Between lanes of an edge is a broken line, as SUMO draws it, and a solid one for a lane
//! that cars must not leave by `changeLeft` or `changeRight`. Other marks are unknown.
//!
//! **Rules.** A traffic light is a signal for each of its links, at the end of the lane that leads into the junction,
//! because the file has no positions. It has the phases of its link in the last program of the light, if that is static.
//! Its stop line is at the start of the lane inside the junction, so that the lanes of a route have exactly the lines
//! that hold for it. So are the lines of links that stop or give way. Rights of way are the `response` bits of a
//! junction's requests.
//!
//! **Source.** SUMO's documentation, "SUMO Road Networks", and its readers `NLHandler` and `NIImporter_SUMO`.

mod connections;
mod edges;
mod junctions;
mod permissions;
mod rules;
mod shapes;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use swerve_map::{Features, Map, SignalId};

use crate::lane_map::LaneMap;
use crate::problem::Problems;
use crate::xml::{Element, Reader, optional, parse};

pub use edges::NetLane;

use edges::Edges;

/// A road network of SUMO.
#[derive(Clone, PartialEq, Debug)]
pub struct Net {
    /// Lanes and the elements on them, with their names in the file.
    pub lanes: LaneMap,
    /// Offset of the file's coordinates: a place of the map is a place of the file less this, metres.
    pub net_offset_m: [f64; 2],
    /// Projection as a PROJ text; may be empty. Not interpreted.
    pub projection: String,
    /// The lane of the file for each [`LaneId`](swerve_map::LaneId), by its number.
    pub sources: Vec<NetLane>,
    /// Programs of traffic lights, in the order of the file.
    pub programs: Vec<Program>,
}

/// Program of a traffic light.
#[derive(Clone, PartialEq, Debug)]
pub struct Program {
    /// Identity of the traffic light: the controller of its signals.
    pub light: String,
    /// Identity of the program.
    pub program: String,
    /// Type, such as `static` or `actuated`.
    pub kind: String,
    /// Start of the first phase, seconds.
    pub offset_s: f64,
    /// True if the phases take their durations one after the other: type `static`, and no phase with `next`.
    pub is_fixed: bool,
    /// Phases in order; the cycle repeats.
    pub phases: Vec<Phase>,
    /// Signal in the map of each link; `None` for links that the file does not use.
    pub signals: Vec<Option<SignalId>>,
}

/// Phase of a program.
#[derive(Clone, PartialEq, Debug)]
pub struct Phase {
    /// Duration, seconds; of an actuated light, without vehicles that extend it.
    pub duration_s: f64,
    /// State of each link: `r` red, `y` `Y` yellow, `g` green that gives way, `G` green with priority, `s` green right
    /// arrow after a stop, `u` red and yellow, `o` off blinking, `O` off.
    pub states: String,
}

/// Elements of the root.
const KNOWN: [&str; 9] =
    ["location", "type", "edge", "tlLogic", "junction", "connection", "prohibition", "roundabout", "param"];

/// Reads a network; `file` is its name in messages.
///
/// # Errors
/// All faults and defects of the file, if it has at least one fault.
pub fn read(file: &str, text: &str) -> Result<Net, Problems> {
    read_with(file, text, |offset_m, _| offset_m)
}

/// As [`read`], but a network farther from the origin than [`NEAR_M`] is moved towards it: it has the coordinates of the
/// file if these are near, else they are moved by whole multiples of [`WHOLE_M`] so that its corner in the south-west is
/// near the origin. [`Net::net_offset_m`] is what the coordinates are moved by.
///
/// # Errors
/// As [`read`].
pub fn read_near(file: &str, text: &str) -> Result<Net, Problems> {
    read_with(file, text, shapes::near)
}

/// Distance from the origin up to which coordinates are near it, metres.
pub const NEAR_M: f64 = 9_000.0;

/// Coordinates are moved by multiples of this, metres.
pub const WHOLE_M: f64 = 100.0;

/// Reads a network in coordinates that are moved by an offset, given that of the file and its boundary.
fn read_with(
    file: &str,
    text: &str,
    moved: fn([f64; 2], Option<[f64; 4]>) -> [f64; 2],
) -> Result<Net, Problems> {
    let document = parse(file, text)?;
    let root = document.root_element();
    let mut xml = Reader::default();
    let made = net(&mut xml, root, moved);
    let (faults, defects, unknown) = xml.finish(file, text);
    match made {
        Some(net) if faults.count() == 0 => {
            Ok(Net { lanes: LaneMap { defects, unknown, ..net.lanes }, ..net })
        }
        _ => Err(faults.with(&defects)),
    }
}

/// `None` after faults.
fn net(
    xml: &mut Reader,
    root: Element<'_>,
    moved: fn([f64; 2], Option<[f64; 4]>) -> [f64; 2],
) -> Option<Net> {
    if root.tag_name().name() != "net" {
        xml.fault(root, || "expected the element `net`".to_owned());
        return None;
    }
    let children = xml.children(root, &KNOWN);
    let named = |name: &'static str| children.iter().copied().filter(move |child| child.has_tag_name(name));
    let location = named("location").next();
    let offset_m = location.map_or([0.0; 2], |at| shapes::offset_m(xml, at));
    let offset_m = moved(offset_m, location.and_then(shapes::boundary_m));
    let left_hand = matches!(root.attribute("lefthand"), Some("true" | "1" | "yes" | "on"));
    let mut edges = Edges::new(offset_m, left_hand);
    named("edge").for_each(|edge| edges.read(xml, edge));
    if edges.files.is_empty() {
        xml.fault(root, || "expected lanes, found none".to_owned());
    }
    let connections: Vec<_> =
        named("connection").filter_map(|at| connections::read(xml, at, &edges)).collect();
    let mut programs: Vec<_> = named("tlLogic").map(|at| (at, rules::program(xml, at))).collect();
    let junctions = junctions::junctions(xml, named("junction"), &edges);
    if xml.faults() > 0 {
        return None;
    }
    edges.neighbours(xml);
    let gaps = connections::join(&mut edges, &connections);
    let mut lights = rules::lights(&edges, &connections);
    rules::set_signals(xml, &mut programs, &lights);
    lights.set_programs(xml, &programs);
    if xml.faults() > 0 {
        return None;
    }
    let programs: Vec<Program> = programs.into_iter().map(|(_, program)| program).collect();
    let stop_lines = rules::stop_lines(&edges, &connections, &lights);
    let signals = lights.into_signals();
    let Edges {
        lanes, names, sources, crossings, areas, types, left_out, heights_m, profiles, edges, ..
    } = edges;
    let features = Features { junctions, signals, stop_lines, crossings, areas };
    let map = match Map::with_features(lanes, features) {
        Ok(map) => map,
        Err(error) => {
            xml.fault(root, || error.to_string());
            return None;
        }
    };
    let traffic = if left_hand { ", left-hand traffic" } else { "" };
    let contents = [
        ("edges", edges.len()),
        ("connections", connections.len()),
        ("programs of traffic lights", programs.len()),
        ("lanes left out", left_out),
    ];
    let lanes = LaneMap {
        format: format!("SUMO {}", optional(root, "version")).trim().to_owned() + traffic,
        left_hand,
        map,
        names,
        types,
        contents: contents
            .into_iter()
            .filter(|one| one.1 > 0)
            .map(|(name, count)| (name.to_owned(), count))
            .collect(),
        heights_m,
        profiles,
        gaps,
        defects: Problems::default(),
        unknown: BTreeMap::new(),
    };
    let projection =
        location.map(|at| optional(at, "projParameter")).filter(|text| text != "!").unwrap_or_default();
    Some(Net { lanes, net_offset_m: offset_m, projection, sources, programs })
}
