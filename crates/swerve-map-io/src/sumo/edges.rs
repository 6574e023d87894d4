//! Edges and their lanes.

use std::collections::BTreeMap;

use swerve_geom::{Point2, Polyline, PolylineError};
use swerve_map::{
    Area, AreaId, AreaKind, Borders, Crossing, CrossingId, Lane, LaneId, Mark, MarkKind, Neighbour,
};

use super::permissions::{kind_of, may_change};
use super::shapes::{self, Vertices, dense, dense_count, shape};
use crate::draft::marks_along;
use crate::problem::quoted;
use crate::slope::{Profile, raised};
use crate::xml::{Element, Reader, optional};

/// A lane of the file.
#[derive(Clone, PartialEq, Debug)]
pub struct NetLane {
    /// Identity of its edge; that of the lane is its name in the map.
    pub edge: String,
    /// Length by the file, metres, which SUMO uses for positions in place of the length of the shape; `None` if missing.
    pub length_m: Option<f64>,
}

/// Width of lanes without one, metres: SUMO's.
const WIDTH_M: f64 = 3.2;

/// Largest width, metres.
const WIDTH_MAX_M: f64 = 1e3;

/// Most vertices of a map.
const VERTICES_MAX: usize = 3_000_000;

/// Lanes of an edge in a junction are beside each other if their ends are apart by their half widths, up to this.
const BESIDE_M: f64 = 0.5;

/// Functions of edges.
const FUNCTIONS: [&str; 5] = ["normal", "internal", "connector", "crossing", "walkingarea"];

/// Use of a lane of the file.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Slot {
    /// A lane of the map.
    Lane(LaneId),
    /// A lane without length.
    Short,
    /// A crossing or walking area.
    Foot,
    /// No lane of the map.
    LeftOut,
}

/// A lane of the file.
pub(super) struct FileLane<'a> {
    pub(super) id: &'a str,
    pub(super) slot: Slot,
    /// First vertex and last vertex.
    pub(super) ends: [Point2; 2],
    /// Number of the edge.
    pub(super) edge: usize,
    /// True if cars may change to the lane outside and to the lane inside.
    may_change: [bool; 2],
}

/// An edge of the file.
pub(super) struct Edge<'a> {
    pub(super) element: Element<'a>,
    pub(super) id: &'a str,
    pub(super) function: &'static str,
    /// Numbers of the lanes in `files`, by index from the outer side.
    pub(super) lanes: Vec<usize>,
}

/// Edges and lanes of the file, and what the map has of them.
pub(super) struct Edges<'a> {
    offset_m: [f64; 2],
    left_hand: bool,
    /// Lanes of the map, by number.
    pub(super) lanes: Vec<Lane>,
    pub(super) sources: Vec<NetLane>,
    pub(super) crossings: Vec<Crossing>,
    pub(super) areas: Vec<Area>,
    /// Lanes of the file.
    pub(super) files: Vec<FileLane<'a>>,
    pub(super) edges: Vec<Edge<'a>>,
    /// Numbers by identity.
    pub(super) lane_of: BTreeMap<&'a str, usize>,
    pub(super) edge_of: BTreeMap<&'a str, usize>,
    /// Names of the lanes of the map.
    pub(super) names: BTreeMap<LaneId, String>,
    /// Number of lanes by the function of their edge.
    pub(super) types: BTreeMap<String, usize>,
    /// Number of lanes without a kind.
    pub(super) left_out: usize,
    pub(super) heights_m: Option<[f64; 2]>,
    /// Slopes of the lanes of the map that are not level.
    pub(super) profiles: BTreeMap<LaneId, Profile>,
    /// Crossed edges of each crossing, as in the file.
    crossed: Vec<&'a str>,
    vertices: f64,
}

impl<'a> Edges<'a> {
    pub(super) fn new(offset_m: [f64; 2], left_hand: bool) -> Self {
        Self {
            offset_m,
            left_hand,
            lanes: Vec::new(),
            sources: Vec::new(),
            crossings: Vec::new(),
            areas: Vec::new(),
            files: Vec::new(),
            edges: Vec::new(),
            lane_of: BTreeMap::new(),
            edge_of: BTreeMap::new(),
            names: BTreeMap::new(),
            types: BTreeMap::new(),
            left_out: 0,
            heights_m: None,
            profiles: BTreeMap::new(),
            crossed: Vec::new(),
            vertices: 0.0,
        }
    }

    /// Lane of the map for a lane of the file.
    pub(super) fn lane(&self, number: usize) -> Option<LaneId> {
        match self.files[number].slot {
            Slot::Lane(id) => Some(id),
            _ => None,
        }
    }

    /// Reads an edge with its lanes.
    pub(super) fn read(&mut self, xml: &mut Reader, at: Element<'a>) {
        let children = xml.children(at, &["lane", "param", "stopOffset"]);
        let function = match at.attribute("function") {
            None | Some("") => "normal",
            Some(_) => xml.name(at, "function", &FUNCTIONS).unwrap_or("normal"),
        };
        let Some(id) = at.attribute("id") else { return xml.missing(at, "id") };
        let number = self.edges.len();
        if self.edge_of.contains_key(id) {
            return twice(xml, at, id);
        }
        self.edge_of.insert(id, number);
        self.edges.push(Edge { element: at, id, function, lanes: Vec::new() });
        for child in children.into_iter().filter(|child| child.has_tag_name("lane")) {
            // The order counts, as for SUMO; netconvert numbers some lanes inside junctions wrongly.
            let index = xml.lenient(child, "index");
            let expected = self.edges[number].lanes.len();
            if function != "internal" && index.is_some_and(|index| index != expected as f64) {
                xml.defect(child, || format!("`index`: expected {expected}, as lanes are in order"));
            }
            self.file_lane(xml, child, number);
        }
        if self.edges[number].lanes.is_empty() {
            xml.defect(at, || "it has no lanes".to_owned());
        }
    }

    fn file_lane(&mut self, xml: &mut Reader, at: Element<'a>, edge: usize) {
        let _children = xml.children(at, &["param", "neigh", "stopOffset"]);
        let Some(id) = at.attribute("id") else { return xml.missing(at, "id") };
        let width_m = width_m(xml, at);
        let Some(Vertices { points, heights_m }) = shape(xml, at, "shape", self.offset_m) else { return };
        for z_m in heights_m.iter().flatten().copied() {
            let [low, high] = self.heights_m.unwrap_or([z_m, z_m]);
            self.heights_m = Some([low.min(z_m), high.max(z_m)]);
        }
        let number = self.files.len();
        if self.lane_of.contains_key(id) {
            return twice(xml, at, id);
        }
        self.lane_of.insert(id, number);
        *self.types.entry(self.edges[edge].function.to_owned()).or_default() += 1;
        let raised = raised(&points, &heights_m);
        let ends = [points[0], points[points.len() - 1]];
        let slot = match self.edges[edge].function {
            "crossing" => self.crossing(edge, &points, width_m),
            "walkingarea" => self.walking_area(points, edge),
            _ => self.map_lane(xml, at, edge, &points, width_m),
        };
        if let (Slot::Lane(id), Some(profile)) = (&slot, raised.and_then(|line| Profile::along(&line))) {
            self.profiles.insert(*id, profile);
        }
        // The names are those of right-hand traffic, as netconvert makes left-hand traffic by mirroring.
        let may_change = ["changeRight", "changeLeft"].map(|name| may_change(at.attribute(name)));
        self.files.push(FileLane { id, slot, ends, edge, may_change });
        self.edges[edge].lanes.push(number);
    }

    fn map_lane(
        &mut self,
        xml: &mut Reader,
        at: Element<'a>,
        edge: usize,
        points: &[Point2],
        width_m: f64,
    ) -> Slot {
        let kind = kind_of(at.attribute("allow"), at.attribute("disallow"));
        let Some(kind) = kind else {
            self.left_out += 1;
            return Slot::LeftOut;
        };
        self.vertices += dense_count(points) + 1.0;
        if self.vertices > VERTICES_MAX as f64 {
            xml.fault(at, || format!("expected a map of at most {VERTICES_MAX} vertices"));
            return Slot::LeftOut;
        }
        let line = match Polyline::new(&dense(points)) {
            Ok(line) => line,
            Err(PolylineError::TooShort) => return Slot::Short,
            Err(error) => {
                xml.fault_in(at, "shape", || error.to_string());
                return Slot::LeftOut;
            }
        };
        let id = LaneId(self.lanes.len() as u32);
        let borders = Borders::constant(0.5 * width_m, 0.5 * width_m);
        let speed_limit_mps = xml.lenient(at, "speed").filter(|speed| *speed > 0.0);
        self.lanes.push(Lane { kind, speed_limit_mps, ..Lane::new(id, line, borders) });
        self.names.insert(id, optional(at, "id"));
        self.sources
            .push(NetLane { edge: self.edges[edge].id.to_owned(), length_m: xml.lenient(at, "length") });
        Slot::Lane(id)
    }

    /// A crossing: the strip around its line. `outlineShape` is not used: netconvert 1.28 writes outlines that touch
    /// themselves, and mirrored ones with left-hand traffic.
    fn crossing(&mut self, edge: usize, points: &[Point2], width_m: f64) -> Slot {
        if points.len() > 1 {
            let Edge { id, element, .. } = &self.edges[edge];
            let (number, name) = (CrossingId(self.crossings.len() as u32), (*id).to_owned());
            let outline = shapes::strip(points, width_m);
            self.crossings.push(Crossing { id: number, name, outline, lanes: Vec::new() });
            self.crossed.push(element.attribute("crossingEdges").unwrap_or_default());
        }
        Slot::Foot
    }

    fn walking_area(&mut self, mut outline: Vec<Point2>, edge: usize) -> Slot {
        if outline.len() > 1 && outline[0] == outline[outline.len() - 1] {
            outline.pop();
        }
        if outline.len() > 2 {
            let id = AreaId(self.areas.len() as u32);
            let name = self.edges[edge].id.to_owned();
            self.areas.push(Area { id, name, kind: AreaKind::Walking, outline });
        }
        Slot::Foot
    }

    /// Sets the neighbours and marks of all lanes, and the lanes of crossings.
    pub(super) fn neighbours(&mut self, xml: &mut Reader) {
        let mut marks = vec![[None; 2]; self.lanes.len()];
        for edge in &self.edges {
            for two in edge.lanes.windows(2) {
                let (Some(outer), Some(inner)) = (self.lane(two[0]), self.lane(two[1])) else { continue };
                if edge.function == "internal" && !self.are_beside(outer, inner) {
                    continue;
                }
                let beside = |lane| Some(Neighbour { lane, opposite: false });
                let [a, b] = [outer, inner].map(|id| id.0 as usize);
                if edge.function == "normal" && self.lanes[a].kind == self.lanes[b].kind {
                    let (kind, to_inner) = (self.line_between(two), usize::from(self.left_hand));
                    marks[a][to_inner] = Some(Mark::new(0.0, kind));
                    marks[b][1 - to_inner] = Some(Mark::new(0.0, kind.mirrored()));
                }
                if self.left_hand {
                    (self.lanes[a].right, self.lanes[b].left) = (beside(inner), beside(outer));
                } else {
                    (self.lanes[a].left, self.lanes[b].right) = (beside(inner), beside(outer));
                }
            }
        }
        for (lane, marks) in self.lanes.iter_mut().zip(marks) {
            lane.marks = marks_along(marks);
        }
        for (k, names) in self.crossed.iter().enumerate() {
            for name in names.split_whitespace() {
                let Some(&edge) = self.edge_of.get(name) else {
                    let at = self.edge_of.get(&*self.crossings[k].name).map(|edge| self.edges[*edge].element);
                    if let Some(at) = at {
                        xml.defect(at, || format!("`crossingEdges`: no edge is named {}", quoted(name)));
                    }
                    continue;
                };
                let lanes = self.edges[edge].lanes.iter().filter_map(|lane| self.lane(*lane));
                let lanes: Vec<LaneId> = lanes.collect();
                self.crossings[k].lanes.extend(lanes);
            }
        }
    }

    /// Line between an outer and an inner lane of the file, for the outer one: solid for a lane that must not be left.
    fn line_between(&self, two: &[usize]) -> MarkKind {
        match (self.files[two[0]].may_change[1], self.files[two[1]].may_change[0]) {
            (true, true) => MarkKind::Broken,
            (false, true) => MarkKind::SolidBroken,
            (true, false) => MarkKind::BrokenSolid,
            (false, false) => MarkKind::Solid,
        }
    }

    /// True if the inner lane is beside the outer one at both ends, on the side of the median. Converters make short
    /// lanes that run backwards where edges overlap.
    fn are_beside(&self, outer: LaneId, inner: LaneId) -> bool {
        let [outer, inner] = [outer, inner].map(|id| &self.lanes[id.0 as usize]);
        let apart_m = 0.5 * (outer.width_m(0.0) + inner.width_m(0.0));
        let is_beside = |share: f64| {
            let [a, b] = [outer, inner].map(|lane| lane.line.at(share * lane.line.length()).pose);
            let off = b.point() - a.point();
            let to_left = a.direction().cross(off);
            (off.norm() - apart_m).abs() <= BESIDE_M && (to_left > 0.0) != self.left_hand
        };
        is_beside(0.0) && is_beside(1.0)
    }
}

/// Width of a lane, metres; the default where there is none.
fn width_m(xml: &mut Reader, at: Element<'_>) -> f64 {
    match xml.number_if(at, "width") {
        // SUMO writes -1 for its default.
        None | Some(-1.0) => WIDTH_M,
        Some(width_m) if width_m > 0.0 && width_m <= WIDTH_MAX_M => width_m,
        Some(width_m) => {
            xml.fault_in(at, "width", || {
                format!("expected more than 0 and at most {WIDTH_MAX_M} m, found {width_m}")
            });
            WIDTH_M
        }
    }
}

fn twice(xml: &mut Reader, at: Element<'_>, id: &str) {
    xml.fault_in(at, "id", || format!("expected an identity that no other has, found {} again", quoted(id)));
}
