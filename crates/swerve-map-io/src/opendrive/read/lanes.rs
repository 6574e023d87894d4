//! Lane sections and lanes.

use super::references::{LinkedLane, Wanted};
use super::sections::{Begin, Plan};
use super::{Order, Reading, Reference, named};
use crate::opendrive::lane::LaneGeometry;
use crate::opendrive::{Contact, Lane, LaneSection, LaneType, Road, RoadMark};
use crate::problem::quoted;
use crate::xml::{Element, optional};
use swerve_text::did_you_mean;

/// Most lanes on one side of a lane section.
const LANES_MAX: usize = 200;

/// Place of a lane section in its road.
#[derive(Clone)]
struct At<'p> {
    road: usize,
    section: usize,
    s_m: f64,
    plan: &'p Plan,
}

/// Begin and sides of a lane section: a single-sided one holds for the side that has lanes, all others for both.
fn begin(at: Element<'_>) -> Begin {
    let has = |name| at.children().any(|child| child.has_tag_name(name));
    let sides = match at.attribute("singleSide") {
        Some("true") => [has("left"), has("right")],
        _ => [true; 2],
    };
    let s_m = at.attribute("s").and_then(|text| text.trim().parse().ok()).unwrap_or(0.0);
    Begin { s_m, sides }
}

impl<'a> Reading<'a> {
    pub(super) fn lanes(&mut self, at: Element<'a>, road_index: usize, road: &mut Road) {
        let children = self.xml.geometric(at, &["laneOffset", "laneSection"]);
        road.lane_offset = self.cubics(&named(&children, "laneOffset"), "s", 0.0);
        let sections = named(&children, "laneSection");
        if sections.is_empty() {
            self.xml.fault(at, || "expected a `laneSection` at least".to_owned());
        }
        let plan = Plan::new(&sections.iter().map(|section| begin(*section)).collect::<Vec<_>>());
        let mut order = Order::new("s");
        for (index, section) in sections.into_iter().enumerate() {
            let s_m = self.xml.number(section, "s");
            order.next(self, section, s_m);
            if index == 0 && s_m > 1e-6 {
                self.xml.defect(section, || format!("the first lane section begins at {s_m} m"));
            }
            if s_m > road.length_m {
                self.xml.defect(section, || {
                    format!("it begins beyond the end of the road at {} m", road.length_m)
                });
            }
            let place = At { road: road_index, section: index, s_m, plan: &plan };
            let section = self.section(section, &place);
            road.sections.push(section);
        }
        let sections = std::mem::take(&mut road.sections);
        road.sections = self.distributed(at, &plan, sections, road.length_m);
    }

    fn section(&mut self, at: Element<'a>, place: &At<'_>) -> LaneSection {
        let mut section =
            LaneSection { s_m: place.s_m, left: Vec::new(), right: Vec::new(), center_marks: Vec::new() };
        for side in self.xml.geometric(at, &["left", "center", "right"]) {
            let lanes = self.xml.geometric(side, &["lane"]);
            match side.tag_name().name() {
                "left" => section.left = self.side(side, &lanes, 1, place),
                "right" => section.right = self.side(side, &lanes, -1, place),
                _ => section.center_marks = lanes.iter().flat_map(|lane| self.center(*lane, place)).collect(),
            }
        }
        section
    }

    fn center(&mut self, at: Element<'a>, place: &At<'_>) -> Vec<RoadMark> {
        let known = ["link", "roadMark", "width", "border", "speed", "material", "height", "access", "rule"];
        let children = self.xml.children(at, &known);
        if let Some(id) = self.xml.integer(at, "id").filter(|id| *id != 0) {
            self.xml.fault_in(at, "id", || format!("expected 0 for the centre lane, found {id}"));
        }
        self.marks(&named(&children, "roadMark"), place.s_m)
    }

    /// Lanes of a side, ordered from inside to outside.
    fn side(&mut self, at: Element<'a>, lanes: &[Element<'a>], sign: i32, place: &At<'_>) -> Vec<Lane> {
        if lanes.len() > LANES_MAX {
            self.xml.fault(at, || format!("expected at most {LANES_MAX} lanes, found {}", lanes.len()));
            return Vec::new();
        }
        let mut found: Vec<(Element<'a>, Lane)> = Vec::new();
        for &lane in lanes {
            let Some(id) = self.xml.integer(lane, "id") else { continue };
            if id.signum() == sign {
                let read = self.lane(lane, id, place);
                found.push((lane, read));
            } else {
                let expected = if sign > 0 { "positive" } else { "negative" };
                self.xml.fault_in(lane, "id", || {
                    format!("expected a {expected} identity on this side, found {id}")
                });
            }
        }
        found.sort_by_key(|(_, lane)| lane.id.unsigned_abs());
        for (k, (element, lane)) in found.iter().enumerate() {
            let expected = sign * (k as i32 + 1);
            if k > 0 && found[k - 1].1.id == lane.id {
                self.xml.fault_in(*element, "id", || format!("lane {} is there twice", lane.id));
                break;
            }
            if lane.id != expected {
                self.xml.fault_in(*element, "id", || {
                    format!(
                        "expected identities without holes, found {} where {expected} is missing",
                        lane.id
                    )
                });
                break;
            }
        }
        found.into_iter().map(|(_, lane)| lane).collect()
    }

    fn lane(&mut self, at: Element<'a>, id: i32, place: &At<'_>) -> Lane {
        const KNOWN: [&str; 10] = [
            "link",
            "width",
            "border",
            "roadMark",
            "material",
            "visibility",
            "speed",
            "access",
            "height",
            "rule",
        ];
        let children = self.xml.children(at, &KNOWN);
        let (widths, borders) = (named(&children, "width"), named(&children, "border"));
        let geometry = if widths.is_empty() && !borders.is_empty() {
            LaneGeometry::Border(self.cubics(&borders, "sOffset", place.s_m))
        } else {
            LaneGeometry::Width(self.cubics(&widths, "sOffset", place.s_m))
        };
        if widths.is_empty() && borders.is_empty() {
            self.xml.defect(at, || "neither `width` nor `border`: the lane has no width".to_owned());
        }
        let kind = LaneType::of(&self.xml.text(at, "type"));
        if let LaneType::Other(name) = &kind {
            self.xml.defect(at, || {
                let hint = did_you_mean(name, LaneType::NAMES.iter().copied());
                format!("`type`: expected a lane type of the standard, found {}{hint}", quoted(name))
            });
        }
        let (mut predecessors, mut successors) = (Vec::new(), Vec::new());
        for link in named(&children, "link") {
            for child in self.xml.children(link, &["predecessor", "successor"]) {
                let is_before = child.tag_name().name() == "predecessor";
                let Some(other) = self.xml.integer(child, "id") else { continue };
                (if is_before { &mut predecessors } else { &mut successors }).push(other);
                let end = if is_before { Contact::Start } else { Contact::End };
                let span = place.plan.span(place.section, id);
                let section = if is_before { span.start } else { span.end.saturating_sub(1) };
                let linked = LinkedLane { road: place.road, section, end, other };
                self.references.push(Reference {
                    at: child,
                    attribute: "id",
                    wanted: Wanted::LaneBeyond(linked),
                });
            }
        }
        Lane {
            id,
            kind,
            predecessors,
            successors,
            marks: self.marks(&named(&children, "roadMark"), place.s_m),
            speeds: self.lane_speeds(&named(&children, "speed"), place.s_m),
            heights: self.heights(&named(&children, "height"), place.s_m),
            geometry,
        }
    }

    fn lane_speeds(&mut self, records: &[Element<'a>], from_m: f64) -> Vec<(f64, crate::opendrive::Speed)> {
        let mut order = Order::lenient("sOffset");
        let mut speeds: Vec<(f64, crate::opendrive::Speed)> = Vec::new();
        for &record in records {
            let s_m = self.xml.number(record, "sOffset");
            order.next(self, record, s_m);
            speeds.extend(self.speed(record).map(|speed| (from_m + s_m, speed)));
        }
        speeds.sort_by(|a, b| a.0.total_cmp(&b.0));
        speeds
    }

    fn heights(&mut self, records: &[Element<'a>], from_m: f64) -> Vec<(f64, [f64; 2])> {
        let mut order = Order::lenient("sOffset");
        let mut heights: Vec<(f64, [f64; 2])> = Vec::new();
        for &record in records {
            let s_m = self.xml.number(record, "sOffset");
            order.next(self, record, s_m);
            heights.push((from_m + s_m, ["inner", "outer"].map(|name| self.xml.number(record, name))));
        }
        heights.sort_by(|a, b| a.0.total_cmp(&b.0));
        heights
    }

    fn marks(&mut self, records: &[Element<'a>], from_m: f64) -> Vec<RoadMark> {
        let mut order = Order::lenient("sOffset");
        let mut marks: Vec<RoadMark> = Vec::new();
        for &record in records {
            let s_m = self.xml.number(record, "sOffset");
            order.next(self, record, s_m);
            self.xml.children(record, &["type", "sway", "explicit"]);
            marks.push(RoadMark {
                s_m: from_m + s_m,
                kind: optional(record, "type"),
                color: optional(record, "color"),
                width_m: self.xml.lenient(record, "width"),
                lane_change: optional(record, "laneChange"),
            });
        }
        marks.sort_by(|a, b| a.s_m.total_cmp(&b.s_m));
        marks
    }
}
