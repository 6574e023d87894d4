//! Junctions and controllers.

use std::collections::BTreeSet;

use super::references::{JunctionLane, Wanted};
use super::{Reading, Reference};
use crate::opendrive::{Connection, Contact, Controller, Junction, JunctionKind, LaneLink, Priority};
use crate::xml::{Element, optional};

impl<'a> Reading<'a> {
    pub(super) fn junction(&mut self, at: Element<'a>, index: usize) -> Junction {
        const KNOWN: [&str; 9] = [
            "connection",
            "priority",
            "controller",
            "surface",
            "planView",
            "crossPath",
            "boundary",
            "elevationGrid",
            "roadSection",
        ];
        let kind = match at.attribute("type") {
            None | Some("") => "default",
            Some(_) => self.xml.name(at, "type", &JunctionKind::NAMES).unwrap_or("default"),
        };
        let mut junction = Junction {
            id: self.xml.text(at, "id"),
            name: optional(at, "name"),
            kind: JunctionKind::of(kind),
            connections: Vec::new(),
            priorities: Vec::new(),
            controllers: Vec::new(),
        };
        let mut ids = BTreeSet::new();
        for child in self.xml.children(at, &KNOWN) {
            match child.tag_name().name() {
                "connection" => {
                    let place = (index, junction.connections.len());
                    let connection = self.connection(child, junction.kind, place);
                    if !ids.insert(connection.id.clone()) {
                        self.xml.defect(child, || format!("connection {} is there twice", connection.id));
                    }
                    junction.connections.push(connection);
                }
                "priority" => junction.priorities.extend(self.priority(child)),
                "controller" => {
                    let id = self.xml.text(child, "id");
                    let wanted = Wanted::Controller(id.clone());
                    self.references.push(Reference { at: child, attribute: "id", wanted });
                    junction.controllers.push(id);
                }
                _ => {}
            }
        }
        junction
    }

    /// A right of way; `None` for a road with priority over all others, or below all.
    fn priority(&mut self, at: Element<'a>) -> Option<Priority> {
        let [high, low] = ["high", "low"].map(|attribute| {
            let id = at.attribute(attribute).filter(|id| !id.is_empty())?;
            self.references.push(Reference { at, attribute, wanted: Wanted::Road(id.to_owned()) });
            Some(id.to_owned())
        });
        Some(Priority { high: high?, low: low? })
    }

    fn connection(&mut self, at: Element<'a>, kind: JunctionKind, place: (usize, usize)) -> Connection {
        let children = self.xml.children(at, &["laneLink", "predecessor", "successor"]);
        let (expected, other) = match kind {
            JunctionKind::Direct => ("linkedRoad", "connectingRoad"),
            _ => ("connectingRoad", "linkedRoad"),
        };
        // Exporters write the one for the other.
        let continuing =
            if at.has_attribute(other) && !at.has_attribute(expected) { other } else { expected };
        let mut connection = Connection {
            id: optional(at, "id"),
            incoming: optional(at, "incomingRoad"),
            continuing: optional(at, continuing),
            contact: Contact::Start,
            lane_links: Vec::new(),
        };
        // Connections of virtual junctions may begin within a road.
        let is_virtual = kind == JunctionKind::Virtual;
        for (attribute, id) in [("incomingRoad", &connection.incoming), (continuing, &connection.continuing)]
        {
            if at.has_attribute(attribute) {
                self.references.push(Reference { at, attribute, wanted: Wanted::Road(id.clone()) });
            } else if !is_virtual {
                self.xml.missing(at, attribute);
            }
        }
        if at.has_attribute("contactPoint") || !is_virtual {
            connection.contact = self.contact(at).unwrap_or(Contact::Start);
        }
        for child in children.into_iter().filter(|child| child.has_tag_name("laneLink")) {
            let ends = (self.xml.integer(child, "from"), self.xml.integer(child, "to"));
            let (Some(from), Some(to)) = ends else { continue };
            if from == 0 || to == 0 {
                self.xml.defect(child, || "the centre lane is linked, which carries no traffic".to_owned());
                continue;
            }
            let lane =
                JunctionLane { junction: place.0, connection: place.1, link: connection.lane_links.len() };
            self.references.push(Reference {
                at: child,
                attribute: "from",
                wanted: Wanted::JunctionLane(lane),
            });
            connection.lane_links.push(LaneLink { from, to });
        }
        connection
    }

    pub(super) fn controller(&mut self, at: Element<'a>) -> Controller {
        let mut controller =
            Controller { id: self.xml.text(at, "id"), name: optional(at, "name"), signals: Vec::new() };
        for child in self.xml.children(at, &["control"]) {
            let id = self.xml.text(child, "signalId");
            self.references.push(Reference {
                at: child,
                attribute: "signalId",
                wanted: Wanted::Signal(id.clone()),
            });
            controller.signals.push(id);
        }
        controller
    }
}
