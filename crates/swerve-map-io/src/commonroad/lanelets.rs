//! Lanelets of a file.

use std::collections::{BTreeMap, BTreeSet};

use swerve_geom::Point2;
use swerve_map::{LaneId, LaneKind, MARK_WIDTH_M, Mark, MarkKind, Neighbour};

use crate::content::{all, child, content};
use crate::draft::{Center, Draft, Drafts, WIDE_MARK_M};
use crate::problem::quoted;
use crate::slope::raised_borders;
use crate::xml::{Element, Reader, number};

use super::features::{Statements, Stop};
use super::rules::Rules;

/// Centre lines of lanes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Centers {
    /// Through the middles of pairs of points of the bounds, as the format defines them.
    Middles,
    /// The same with vertices at most 5 m apart and corners that are rounded by at most 2 cm, so that borders are exact
    /// beside corners, too.
    Rounded,
}

/// Elements of a lanelet.
const KNOWN: [&str; 15] = [
    "leftBound",
    "rightBound",
    "predecessor",
    "successor",
    "adjacentLeft",
    "adjacentRight",
    "stopLine",
    "laneletType",
    "userOneWay",
    "userBidirectional",
    "trafficSignRef",
    "trafficLightRef",
    "speedLimit",
    "lineMarking",
    "crossing",
];

/// Elements of intersections that name lanelets.
const LANES: [&str; 5] =
    ["incomingLanelet", "successorsRight", "successorsStraight", "successorsLeft", "crossingLanelet"];

/// A reference of a lanelet to another.
struct Reference<'a> {
    at: Element<'a>,
    from: LaneId,
    to: LaneId,
    /// True if the traffic runs from `to` to `from`.
    backwards: bool,
}

/// Lanelets, before their references are resolved.
#[derive(Default)]
pub(super) struct Lanelets<'a> {
    drafts: Drafts<'a>,
    statements: Statements,
    links: Vec<Reference<'a>>,
    beside: Vec<(Reference<'a>, usize, bool)>,
    /// Lanelets by type.
    pub(super) types: BTreeMap<String, usize>,
    /// Lowest and highest z, metres.
    pub(super) heights_m: Option<[f64; 2]>,
}

impl<'a> Lanelets<'a> {
    /// Reads all lanelets.
    pub(super) fn read(xml: &mut Reader, root: Element<'a>, rules: &Rules, centers: Centers) -> Self {
        let mut lanelets = Self::default();
        for at in all(root, "lanelet") {
            let center = match centers {
                Centers::Middles => Center::Middles,
                Centers::Rounded => Center::RoundedMiddles,
            };
            lanelets.lanelet(xml, at, rules, center);
        }
        lanelets
    }

    fn lanelet(&mut self, xml: &mut Reader, at: Element<'a>, rules: &Rules, center: Center) {
        let Some(id) = xml.identity(at, "id").map(LaneId) else { return };
        let _elements = xml.children(at, &KNOWN);
        let faults = xml.faults();
        let bounds = ["leftBound", "rightBound"].map(|name| self.bound(xml, at, name));
        let [(left, left_m), (right, right_m)] = bounds;
        if xml.faults() == faults && left.len() != right.len() {
            xml.fault(at, || {
                let [left, right] = [left.len(), right.len()];
                format!("expected as many points to the left as to the right, found {left} and {right}")
            });
        }
        for (name, backwards) in [("successor", false), ("predecessor", true)] {
            for link in all(at, name) {
                let Some(to) = xml.identity(link, "ref").map(LaneId) else { continue };
                self.links.push(Reference { at: link, from: id, to, backwards });
            }
        }
        for (side, name) in ["adjacentLeft", "adjacentRight"].into_iter().enumerate() {
            let Some(beside) = child(at, name) else { continue };
            let opposite = xml.name(beside, "drivingDir", &["same", "opposite"]) == Some("opposite");
            let Some(to) = xml.identity(beside, "ref").map(LaneId) else { continue };
            self.beside.push((Reference { at: beside, from: id, to, backwards: opposite }, side, opposite));
        }
        for light in all(at, "trafficLightRef") {
            let lights = self.statements.obeys.entry(id).or_default();
            lights.extend(rules.named_light(xml, light));
        }
        self.statements.stops.extend(Stop::read(xml, at, id, rules));
        let speed_limit_mps = self.speed(xml, at, rules);
        if all(at, "laneletType").any(|kind| content(kind) == "crosswalk") {
            self.statements.crosswalks.insert(id);
        }
        let marks = ["leftBound", "rightBound"].map(|name| mark(xml, child(at, name)?));
        let draft = Draft {
            element: at,
            name: id.0.to_string(),
            kind: self.kind(xml, at),
            speed_limit_mps,
            raised: raised_borders([(&left, &left_m), (&right, &right_m)]),
            left,
            right,
            center,
            marks,
            beside: [None; 2],
            successors: BTreeSet::new(),
        };
        self.drafts.entry(id).or_insert(draft);
    }

    /// Points of a bound, and their heights.
    fn bound(&mut self, xml: &mut Reader, at: Element<'a>, name: &str) -> (Vec<Point2>, Vec<Option<f64>>) {
        let Some(bound) = xml.child(at, name) else { return Default::default() };
        let (points, heights_m): (Vec<_>, Vec<_>) =
            all(bound, "point").map(|point| self.point(xml, point)).unzip();
        if points.len() < 2 {
            xml.fault(bound, || format!("expected at least 2 points, found {}", points.len()));
        }
        (points, heights_m)
    }

    fn point(&mut self, xml: &mut Reader, at: Element<'a>) -> (Point2, Option<f64>) {
        let z_m = xml.lenient_measure(at, "z");
        if let Some(z) = z_m {
            let [low, high] = self.heights_m.unwrap_or([z, z]);
            self.heights_m = Some([low.min(z), high.max(z)]);
        }
        (Point2::new(xml.measure(at, "x"), xml.measure(at, "y")), z_m)
    }

    /// Kind of a lanelet by its first type that has one; driving without.
    fn kind(&mut self, xml: &mut Reader, at: Element<'a>) -> LaneKind {
        let mut found = None;
        for kind in all(at, "laneletType") {
            let name = content(kind);
            match kind_of(name) {
                Some(kind) => found = found.or(Some(kind)),
                None => xml.defect(kind, || format!("expected a type of lanelets, found {}", quoted(name))),
            }
            *self.types.entry(name.to_owned()).or_default() += 1;
        }
        found.unwrap_or_default()
    }

    /// Speed limit of a lanelet (2018b), else the first one of its signs, m/s.
    fn speed(&mut self, xml: &mut Reader, at: Element<'a>, rules: &Rules) -> Option<f64> {
        let own = child(at, "speedLimit").filter(|limit| !content(*limit).eq_ignore_ascii_case("inf"));
        if let Some(limit) = own {
            let limit_mps = number(content(limit)).map_err(|message| xml.defect(limit, || message)).ok();
            return limit_mps.filter(|limit_mps| *limit_mps > 0.0);
        }
        let mut limit_mps = None;
        for sign in all(at, "trafficSignRef") {
            limit_mps = limit_mps.or(rules.named_sign(xml, sign).and_then(|sign| sign.speed_limit_mps));
        }
        limit_mps
    }

    /// Resolves references; those to lanelets that are missing are defects.
    pub(super) fn resolved(self, xml: &mut Reader, root: Element<'a>) -> (Drafts<'a>, Statements) {
        let Self { mut drafts, statements, links, beside, .. } = self;
        let is_there = |xml: &mut Reader, drafts: &Drafts<'a>, one: &Reference<'a>| {
            let found = drafts.contains_key(&one.to);
            if !found {
                xml.defect(one.at, || format!("expected the identity of a lanelet, found {}", one.to.0));
            }
            found
        };
        for link in &links {
            if !is_there(xml, &drafts, link) {
                continue;
            }
            let (from, to) = if link.backwards { (link.to, link.from) } else { (link.from, link.to) };
            drafts.entry(from).and_modify(|draft| draft.successors.extend([to]));
        }
        for (one, side, opposite) in &beside {
            if is_there(xml, &drafts, one) {
                let neighbour = Neighbour { lane: one.to, opposite: *opposite };
                drafts.entry(one.from).and_modify(|draft| draft.beside[*side] = Some(neighbour));
            }
        }
        let parts = all(root, "intersection").flat_map(|one| one.children());
        for at in parts.flat_map(|part| part.children()).filter(|at| LANES.contains(&at.tag_name().name())) {
            let id = at.attribute("ref").and_then(|id| id.trim().parse().ok());
            if let Some(id) = id.filter(|id| !drafts.contains_key(&LaneId(*id))) {
                xml.defect(at, || format!("expected the identity of a lanelet, found {id}"));
            }
        }
        (drafts, statements)
    }
}

/// Mark of a bound; `None` if it has none or an unknown one.
fn mark(xml: &mut Reader, bound: Element<'_>) -> Option<Mark> {
    let at = child(bound, "lineMarking")?;
    let (kind, width_m) = match content(at) {
        "solid" => (MarkKind::Solid, MARK_WIDTH_M),
        "dashed" => (MarkKind::Broken, MARK_WIDTH_M),
        "broad_solid" => (MarkKind::Solid, WIDE_MARK_M),
        "broad_dashed" => (MarkKind::Broken, WIDE_MARK_M),
        "curb" | "lowered_curb" => (MarkKind::Kerb, MARK_WIDTH_M),
        "no_marking" => (MarkKind::None, MARK_WIDTH_M),
        "unknown" => return None,
        name => {
            xml.defect(at, || format!("expected a type of line marking, found {}", quoted(name)));
            return None;
        }
    };
    Some(Mark { width_m, ..Mark::new(0.0, kind) })
}

/// Kind of a lane for a type of lanelets; `None` for names that the format does not have.
fn kind_of(name: &str) -> Option<LaneKind> {
    Some(match name {
        "urban" | "country" | "highway" | "driveWay" | "mainCarriageWay" | "accessRamp" | "exitRamp" => {
            LaneKind::Driving
        }
        "busLane" | "busStop" | "interstate" | "intersection" | "unknown" | "border" => LaneKind::Driving,
        "shoulder" => LaneKind::Shoulder,
        "bicycleLane" => LaneKind::Cycling,
        "sidewalk" | "crosswalk" => LaneKind::Walking,
        "parking" => LaneKind::Parking,
        _ => return None,
    })
}
