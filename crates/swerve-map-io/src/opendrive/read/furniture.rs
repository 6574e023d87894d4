//! Signals and objects.

use super::references::Wanted;
use super::{Reading, Reference, named};
use crate::opendrive::{Corner, Object, Outline, Physical, Road, Signal, SignalReference, Validity};
use crate::xml::{Element, optional};

impl<'a> Reading<'a> {
    pub(super) fn signals(&mut self, at: Element<'a>, road: &mut Road) {
        for child in self.xml.children(at, &["signal", "signalReference", "signalGroup"]) {
            match child.tag_name().name() {
                "signal" => {
                    let signal = self.signal(child);
                    self.on_road(child, signal.s_m, road.length_m);
                    road.signals.push(signal);
                }
                "signalReference" => {
                    let children = self.xml.children(child, &["validity"]);
                    let reference = SignalReference {
                        id: self.xml.text(child, "id"),
                        s_m: self.xml.number(child, "s"),
                        t_m: self.xml.number(child, "t"),
                        orientation: optional(child, "orientation"),
                        validity: self.validity(&named(&children, "validity")),
                    };
                    self.on_road(child, reference.s_m, road.length_m);
                    let wanted = Wanted::Signal(reference.id.clone());
                    self.references.push(Reference { at: child, attribute: "id", wanted });
                    road.signal_references.push(reference);
                }
                _ => {}
            }
        }
    }

    fn signal(&mut self, at: Element<'a>) -> Signal {
        const KNOWN: [&str; 9] = [
            "validity",
            "dependency",
            "reference",
            "positionRoad",
            "positionInertial",
            "semantics",
            "staticBoard",
            "vmsBoard",
            "displayArea",
        ];
        let children = self.xml.children(at, &KNOWN);
        let related = children.iter().filter_map(|child| match child.tag_name().name() {
            "dependency" => child.attribute("id"),
            "reference" => child.attribute("elementId"),
            _ => None,
        });
        let physical = children.iter().find_map(|child| self.physical(*child));
        Signal {
            physical,
            related: related.map(str::to_owned).collect(),
            id: self.xml.text(at, "id"),
            name: optional(at, "name"),
            s_m: self.xml.number(at, "s"),
            t_m: self.xml.number(at, "t"),
            z_offset_m: self.xml.lenient(at, "zOffset").unwrap_or_default(),
            dynamic: at.attribute("dynamic") == Some("yes"),
            orientation: optional(at, "orientation"),
            country: optional(at, "country"),
            kind: optional(at, "type"),
            subtype: optional(at, "subtype"),
            value: self.xml.lenient(at, "value"),
            unit: optional(at, "unit"),
            heading_rad: self.xml.lenient(at, "hOffset").unwrap_or_default(),
            size_m: ["width", "height"].map(|name| self.xml.lenient(at, name).unwrap_or_default()),
            validity: self.validity(&named(&children, "validity")),
        }
    }

    fn physical(&mut self, at: Element<'a>) -> Option<Physical> {
        match at.tag_name().name() {
            "positionRoad" => {
                let road = self.xml.text(at, "roadId");
                self.references.push(Reference {
                    at,
                    attribute: "roadId",
                    wanted: Wanted::Road(road.clone()),
                });
                let [s_m, t_m] = ["s", "t"].map(|name| self.xml.number(at, name));
                let z_offset_m = self.xml.lenient(at, "zOffset").unwrap_or_default();
                Some(Physical::Road { road, s_m, t_m, z_offset_m })
            }
            "positionInertial" => {
                let [x_m, y_m] = ["x", "y"].map(|name| self.xml.number(at, name));
                Some(Physical::Inertial([x_m, y_m, self.xml.lenient(at, "z").unwrap_or_default()]))
            }
            _ => None,
        }
    }

    fn validity(&mut self, records: &[Element<'a>]) -> Vec<Validity> {
        let mut validity = Vec::new();
        for &record in records {
            let lanes = (self.xml.integer(record, "fromLane"), self.xml.integer(record, "toLane"));
            if let (Some(from_lane), Some(to_lane)) = lanes {
                validity.push(Validity { from_lane, to_lane });
            }
        }
        validity
    }

    /// Notes a position beyond the road.
    fn on_road(&mut self, at: Element<'_>, s_m: f64, length_m: f64) {
        if !(-1e-3..=length_m + 1e-3).contains(&s_m) {
            self.xml.defect(at, || format!("`s`: expected 0 to the road's length, {length_m}, found {s_m}"));
        }
    }

    pub(super) fn objects(&mut self, at: Element<'a>, road: &mut Road) {
        for child in self.xml.children(at, &["object", "objectReference", "tunnel", "bridge"]) {
            if child.has_tag_name("object") {
                let object = self.object(child);
                self.on_road(child, object.s_m, road.length_m);
                road.objects.push(object);
            }
        }
    }

    fn object(&mut self, at: Element<'a>) -> Object {
        const KNOWN: [&str; 11] = [
            "repeat",
            "outline",
            "outlines",
            "material",
            "validity",
            "parkingSpace",
            "markings",
            "borders",
            "surface",
            "skeleton",
            "reference",
        ];
        let children = self.xml.children(at, &KNOWN);
        let grouped = named(&children, "outlines");
        let mut outlines = named(&children, "outline");
        for group in grouped {
            outlines.extend(self.xml.children(group, &["outline"]));
        }
        let size_m = match at.has_attribute("radius") {
            true => {
                let diameter_m = 2.0 * self.xml.lenient(at, "radius").unwrap_or_default();
                [diameter_m, diameter_m, self.xml.lenient(at, "height").unwrap_or_default()]
            }
            false => ["length", "width", "height"].map(|name| self.xml.lenient(at, name).unwrap_or_default()),
        };
        Object {
            id: optional(at, "id"),
            name: optional(at, "name"),
            kind: optional(at, "type"),
            subtype: optional(at, "subtype"),
            orientation: optional(at, "orientation"),
            s_m: self.xml.number(at, "s"),
            t_m: self.xml.number(at, "t"),
            z_offset_m: self.xml.lenient(at, "zOffset").unwrap_or_default(),
            heading_rad: self.xml.lenient(at, "hdg").unwrap_or_default(),
            size_m,
            outlines: outlines.into_iter().map(|outline| self.outline(outline)).collect(),
            validity: self.validity(&named(&children, "validity")),
            repeats: named(&children, "repeat").len(),
        }
    }

    fn outline(&mut self, at: Element<'a>) -> Outline {
        let mut corners = Vec::new();
        for child in self.xml.children(at, &["cornerRoad", "cornerLocal", "curveRoad", "curveLocal"]) {
            match child.tag_name().name() {
                "cornerRoad" => {
                    let [s_m, t_m] = ["s", "t"].map(|name| self.xml.number(child, name));
                    corners.push(Corner::Road { s_m, t_m });
                }
                "cornerLocal" => {
                    let [u_m, v_m] = ["u", "v"].map(|name| self.xml.number(child, name));
                    corners.push(Corner::Local { u_m, v_m });
                }
                _ => {}
            }
        }
        Outline { closed: at.attribute("closed") != Some("false"), corners }
    }
}
