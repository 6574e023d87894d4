//! Roads: links, types, reference line, profiles.

use swerve_geom::math;
use swerve_text::did_you_mean;

use super::references::Wanted;
use super::{Order, Reading, Reference, named};
use crate::cubic::Cubics;
use crate::curve::{Parametric, Piece, ReferenceLine, Shape, Spiral, TURN_MAX_RAD};
use crate::opendrive::road::LateralShape;
use crate::opendrive::{Contact, LENGTH_MAX_M, Road, RoadLink, RoadType, Speed, Target};
use crate::problem::quoted;
use crate::xml::{Element, optional};

/// Differences of lengths and positions that are noted, metres.
const NOTED_M: f64 = 0.01;

/// Units of speed limits.
const UNITS: [&str; 3] = ["m/s", "km/h", "mph"];

/// Largest curvature of an arc, 1/m.
const CURVATURE_MAX_1PM: f64 = 1e3;

impl<'a> Reading<'a> {
    pub(super) fn road(&mut self, at: Element<'a>, index: usize) -> Road {
        const KNOWN: [&str; 10] = [
            "link",
            "type",
            "planView",
            "elevationProfile",
            "lateralProfile",
            "lanes",
            "objects",
            "signals",
            "surface",
            "railroad",
        ];
        let children = self.xml.children(at, &KNOWN);
        let length_m = self.xml.distance(at, "length");
        if at.has_attribute("length") && !(length_m > 0.0 && length_m <= LENGTH_MAX_M) {
            self.xml.fault_in(at, "length", || format!("expected more than 0 and at most {LENGTH_MAX_M}"));
        }
        let mut road = Road {
            id: self.xml.text(at, "id"),
            name: optional(at, "name"),
            length_m,
            junction: at.attribute("junction").filter(|id| *id != "-1").map(str::to_owned),
            left_hand: self.left_hand(at),
            predecessor: None,
            successor: None,
            types: Vec::new(),
            sections: Vec::new(),
            signals: Vec::new(),
            signal_references: Vec::new(),
            objects: Vec::new(),
            line: ReferenceLine::default(),
            elevation: Cubics::default(),
            superelevation: Cubics::default(),
            lateral: LateralShape::default(),
            lane_offset: Cubics::default(),
        };
        if let Some(id) = road.junction.as_ref() {
            self.references.push(Reference {
                at,
                attribute: "junction",
                wanted: Wanted::Junction(id.clone()),
            });
        }
        road.types = self.road_types(&named(&children, "type"));
        for child in children {
            match child.tag_name().name() {
                "link" => self.road_link(child, &mut road),
                "planView" => road.line = self.plan_view(child, length_m),
                "elevationProfile" => {
                    let records = self.xml.geometric(child, &["elevation"]);
                    road.elevation = self.cubics(&records, "s", 0.0);
                }
                "lateralProfile" => self.lateral_profile(child, &mut road),
                "lanes" => self.lanes(child, index, &mut road),
                "objects" => self.objects(child, &mut road),
                "signals" => self.signals(child, &mut road),
                _ => {}
            }
        }
        for (name, is_missing) in [("planView", road.line.0.is_empty()), ("lanes", road.sections.is_empty())]
        {
            if is_missing && !at.children().any(|child| child.has_tag_name(name)) {
                self.xml.fault(at, || format!("element `{name}` is missing"));
            }
        }
        road
    }

    fn left_hand(&mut self, at: Element<'_>) -> bool {
        at.has_attribute("rule") && self.xml.name(at, "rule", &["RHT", "LHT"]) == Some("LHT")
    }

    fn road_types(&mut self, records: &[Element<'a>]) -> Vec<RoadType> {
        let mut order = Order::lenient("s");
        let mut types: Vec<RoadType> = Vec::new();
        for &record in records {
            let s_m = self.xml.number(record, "s");
            order.next(self, record, s_m);
            let speed = self.xml.children(record, &["speed"]).first().and_then(|&speed| self.speed(speed));
            types.push(RoadType { s_m, name: optional(record, "type"), speed });
        }
        types.sort_by(|a, b| a.s_m.total_cmp(&b.s_m));
        types
    }

    /// A speed limit: `max` with `unit`, metres per second where there is none.
    pub(super) fn speed(&mut self, at: Element<'_>) -> Option<Speed> {
        if matches!(at.attribute("max"), Some("no limit" | "undefined")) {
            return Some(Speed { limit_mps: None });
        }
        let max = self.xml.lenient(at, "max")?;
        let unit = at.attribute("unit").filter(|unit| !unit.is_empty()).unwrap_or("m/s");
        if !UNITS.contains(&unit) {
            self.xml.defect(at, || {
                let hint = did_you_mean(unit, UNITS);
                format!("`unit`: expected one of {}, found {}{hint}", UNITS.join(", "), quoted(unit))
            });
            return None;
        }
        let mps = match unit {
            "km/h" => max / 3.6,
            "mph" => max * 0.447_04,
            _ => max,
        };
        // Exporters write 0 or -1 for an unknown limit.
        Some(Speed { limit_mps: (mps > 0.0).then_some(mps) })
    }

    fn road_link(&mut self, at: Element<'a>, road: &mut Road) {
        for child in self.xml.children(at, &["predecessor", "successor", "neighbor"]) {
            let link = match child.tag_name().name() {
                "predecessor" => &mut road.predecessor,
                "successor" => &mut road.successor,
                _ => continue,
            };
            *link = self.link_end(child);
        }
    }

    fn link_end(&mut self, at: Element<'a>) -> Option<RoadLink> {
        let kind = self.xml.name(at, "elementType", &["road", "junction"])?;
        let id = self.xml.text(at, "elementId");
        let (target, wanted) = match kind {
            "junction" => (Target::Junction, Wanted::Junction(id.clone())),
            _ if at.has_attribute("elementS") => {
                (Target::Within { s_m: self.xml.number(at, "elementS") }, Wanted::Road(id.clone()))
            }
            _ => (Target::Road(self.contact(at)?), Wanted::Road(id.clone())),
        };
        self.references.push(Reference { at, attribute: "elementId", wanted });
        Some(RoadLink { target, id })
    }

    pub(super) fn contact(&mut self, at: Element<'_>) -> Option<Contact> {
        let name = self.xml.name(at, "contactPoint", &["start", "end"])?;
        Some(if name == "start" { Contact::Start } else { Contact::End })
    }

    fn plan_view(&mut self, at: Element<'a>, length_m: f64) -> ReferenceLine {
        let mut pieces: Vec<Piece> = Vec::new();
        let mut order = Order::new("s");
        let faults = self.xml.faults();
        for child in self.xml.geometric(at, &["geometry"]) {
            let s_m = self.xml.number(child, "s");
            order.next(self, child, s_m);
            if let Some(piece) = self.geometry(child, s_m) {
                if let Some(last) = pieces.last().filter(|_| faults == self.xml.faults()) {
                    self.joined(child, last, &piece);
                }
                pieces.push(piece);
            }
        }
        match (pieces.first(), pieces.last()) {
            _ if faults != self.xml.faults() => {}
            (Some(first), Some(last)) => {
                let off_m = first.s_m.abs().max((last.s_m + last.length_m - length_m).abs());
                if off_m > NOTED_M {
                    let (from, to) = (first.s_m, last.s_m + last.length_m);
                    self.xml
                        .defect(at, || format!("geometry from {from} to {to} m on a road of {length_m} m"));
                }
            }
            _ => self.xml.fault(at, || "expected a `geometry` at least".to_owned()),
        }
        ReferenceLine(pieces)
    }

    /// Notes a step of the reference line, or a begin that is not the end of the piece before.
    fn joined(&mut self, at: Element<'_>, last: &Piece, next: &Piece) {
        let (end, begin) = (last.at(next.s_m - last.s_m), next.at(0.0));
        let gap_m = math::hypot(end.x_m - begin.x_m, end.y_m - begin.y_m);
        let overlap_m = (last.s_m + last.length_m - next.s_m).abs();
        if gap_m > NOTED_M {
            self.xml.defect(at, || {
                format!("the reference line begins {gap_m:.3} m from the end of the geometry before")
            });
        } else if overlap_m > NOTED_M {
            self.xml
                .defect(at, || format!("its `s` is {overlap_m:.3} m from the end of the geometry before"));
        }
    }

    fn geometry(&mut self, at: Element<'a>, s_m: f64) -> Option<Piece> {
        const KNOWN: [&str; 5] = ["line", "arc", "spiral", "poly3", "paramPoly3"];
        let faults = self.xml.faults();
        let length_m = self.xml.distance(at, "length").min(LENGTH_MAX_M);
        let begin = ["x", "y", "hdg"].map(|name| self.xml.number(at, name));
        let shapes = self.xml.geometric(at, &KNOWN);
        let &[shape] = &*shapes else {
            self.xml.fault(at, || {
                format!("expected one of {}, found {} of them", KNOWN.join(", "), shapes.len())
            });
            return None;
        };
        if length_m == 0.0 {
            if faults != self.xml.faults() {
                return None;
            }
            self.xml.defect(at, || "a geometry without length is left out".to_owned());
            return None;
        }
        let shape = self.shape(shape, length_m)?;
        Some(Piece::new(s_m, length_m, begin, shape))
    }

    fn shape(&mut self, at: Element<'a>, length_m: f64) -> Option<Shape> {
        Some(match at.tag_name().name() {
            "arc" => {
                let curvature_1pm = self.xml.number(at, "curvature");
                if curvature_1pm.abs() > CURVATURE_MAX_1PM {
                    self.xml
                        .fault_in(at, "curvature", || format!("expected at most {CURVATURE_MAX_1PM} 1/m"));
                }
                Shape::Arc { curvature_1pm }
            }
            "spiral" => {
                let [begin, end] = ["curvStart", "curvEnd"].map(|name| self.xml.number(at, name));
                let Some(spiral) = Spiral::new(begin, end, length_m) else {
                    self.xml
                        .fault(at, || format!("expected a spiral that turns by at most {TURN_MAX_RAD} rad"));
                    return None;
                };
                Shape::Spiral(spiral)
            }
            "poly3" => {
                let v = ["a", "b", "c", "d"].map(|name| self.xml.number(at, name));
                self.parametric(at, [0.0, 1.0, 0.0, 0.0], v, length_m, true)?
            }
            "paramPoly3" => {
                let u = ["aU", "bU", "cU", "dU"].map(|name| self.xml.number(at, name));
                let v = ["aV", "bV", "cV", "dV"].map(|name| self.xml.number(at, name));
                let is_normalized = !at.has_attribute("pRange")
                    || self.xml.name(at, "pRange", &["normalized", "arcLength"]) == Some("normalized");
                let curve = self.parametric(at, u, v, if is_normalized { 1.0 } else { length_m }, false)?;
                if let Shape::Parametric(curve) = &curve
                    && (curve.length_m() - length_m).abs() > NOTED_M.max(1e-3 * length_m)
                {
                    let found = curve.length_m();
                    self.xml.defect(at, || {
                        format!("the curve is {found:.3} m long, the `length` {length_m:.3} m")
                    });
                }
                curve
            }
            _ => Shape::Line,
        })
    }

    fn parametric(
        &mut self,
        at: Element<'_>,
        u: [f64; 4],
        v: [f64; 4],
        p_max: f64,
        poly3: bool,
    ) -> Option<Shape> {
        let curve = Parametric::new(u, v, p_max, poly3);
        if curve.is_none() {
            self.xml.fault(at, || "the curve has no length".to_owned());
        }
        curve.map(|curve| Shape::Parametric(Box::new(curve)))
    }

    fn lateral_profile(&mut self, at: Element<'a>, road: &mut Road) {
        let known = ["superelevation", "shape", "crossfall", "crossSectionSurface"];
        let children = self.xml.geometric(at, &known);
        road.superelevation = self.cubics(&named(&children, "superelevation"), "s", 0.0);
        road.lateral.shapes = self.shapes(&named(&children, "shape"));
        let mut order = Order::new("s");
        for record in named(&children, "crossfall") {
            let side = match record.attribute("side") {
                Some(side @ ("left" | "right" | "both")) => side,
                None => "both",
                Some(other) => {
                    self.xml.fault_in(record, "side", || {
                        format!("expected one of left, right, both, found {}", quoted(other))
                    });
                    continue;
                }
            };
            let one = self.cubics(&[record], "s", 0.0);
            one.0.iter().for_each(|one| order.next(self, record, one.s_m));
            for (of, other) in road.lateral.crossfall.iter_mut().zip(["right", "left"]) {
                if side != other {
                    of.0.extend(&one.0);
                }
            }
        }
        if let Some(surface) = named(&children, "crossSectionSurface").first() {
            self.xml.defect(*surface, || "surface strips are not evaluated: z leaves them out".to_owned());
        }
    }

    /// Profiles over t, one for each s.
    fn shapes(&mut self, records: &[Element<'a>]) -> Vec<(f64, Cubics)> {
        let mut order = Order::new("s");
        let mut shapes: Vec<(f64, Vec<Element<'a>>)> = Vec::new();
        for &record in records {
            let s_m = self.xml.number(record, "s");
            order.next(self, record, s_m);
            match shapes.last_mut() {
                Some((same_m, group)) if *same_m == s_m => group.push(record),
                _ => shapes.push((s_m, vec![record])),
            }
        }
        shapes.into_iter().map(|(s_m, group)| (s_m, self.cubics(&group, "t", 0.0))).collect()
    }
}
