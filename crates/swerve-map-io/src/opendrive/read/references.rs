//! References between elements, resolved when all are read.

use std::collections::BTreeSet;

use crate::opendrive::{Contact, LaneSection, Network, Target};
use crate::problem::quoted;
use crate::xml::{Element, Reader};
use swerve_text::did_you_mean;

/// Most identities that a wrong one is compared with.
const COMPARED_MAX: usize = 2000;

/// A reference from an attribute of an element.
pub(super) struct Reference<'a> {
    pub(super) at: Element<'a>,
    pub(super) attribute: &'static str,
    pub(super) wanted: Wanted,
}

/// The element that is referred to.
pub(super) enum Wanted {
    Road(String),
    Junction(String),
    Signal(String),
    Controller(String),
    LaneBeyond(LinkedLane),
    JunctionLane(JunctionLane),
}

/// A lane beyond an end of a lane section.
#[derive(Clone, Copy)]
pub(super) struct LinkedLane {
    pub(super) road: usize,
    pub(super) section: usize,
    pub(super) end: Contact,
    pub(super) other: i32,
}

/// A lane link of a junction, by indices.
#[derive(Clone, Copy)]
pub(super) struct JunctionLane {
    pub(super) junction: usize,
    pub(super) connection: usize,
    pub(super) link: usize,
}

/// Identities of elements by kind.
struct Known<'n> {
    network: &'n Network,
    junctions: BTreeSet<&'n str>,
    signals: BTreeSet<&'n str>,
    controllers: BTreeSet<&'n str>,
}

/// Notes references to elements that are not there.
pub(super) fn resolve(xml: &mut Reader, references: Vec<Reference<'_>>, network: &Network) {
    let known = Known {
        network,
        junctions: network.junctions.iter().map(|junction| &*junction.id).collect(),
        signals: network.roads.iter().flat_map(|road| &road.signals).map(|signal| &*signal.id).collect(),
        controllers: network.controllers.iter().map(|controller| &*controller.id).collect(),
    };
    let roads = || network.road_of.keys().map(String::as_str);
    for Reference { at, attribute, wanted } in references {
        match wanted {
            Wanted::Road(id) if !network.road_of.contains_key(&id) => {
                missing(xml, at, attribute, ("road", &id), roads());
            }
            Wanted::Junction(id) if !known.junctions.contains(&*id) => {
                missing(xml, at, attribute, ("junction", &id), known.junctions.iter().copied());
            }
            Wanted::Signal(id) if !known.signals.contains(&*id) => {
                missing(xml, at, attribute, ("signal", &id), known.signals.iter().copied());
            }
            Wanted::Controller(id) if !known.controllers.contains(&*id) => {
                missing(xml, at, attribute, ("controller", &id), known.controllers.iter().copied());
            }
            Wanted::LaneBeyond(lane) => lane_beyond(xml, at, &known, lane),
            Wanted::JunctionLane(lane) => junction_lane(xml, at, &known, lane),
            _ => {}
        }
    }
}

/// Notes that an element is not there, with the nearest identity.
fn missing<'n>(
    xml: &mut Reader,
    at: Element<'_>,
    attribute: &str,
    (kind, id): (&str, &str),
    known: impl Iterator<Item = &'n str>,
) {
    xml.defect(at, || {
        let hint = did_you_mean(id, known.take(COMPARED_MAX));
        format!("`{attribute}`: expected the identity of a {kind}, found {}{hint}", quoted(id))
    });
}

/// Notes a lane that is not in a lane section, with those that are.
fn missing_lane(xml: &mut Reader, at: Element<'_>, section: &LaneSection, road: &str, lane: i32) {
    xml.defect(at, || {
        let ids: Vec<String> = section.lanes().map(|lane| lane.id.to_string()).collect();
        format!("expected a lane of road {}, one of {}, found {lane}", quoted(road), ids.join(", "))
    });
}

fn lane_beyond(xml: &mut Reader, at: Element<'_>, known: &Known<'_>, lane: LinkedLane) {
    let LinkedLane { road: index, section, end, other } = lane;
    let network = known.network;
    let Some(road) = network.roads.get(index) else { return };
    if other == 0 {
        return xml.defect(at, || "the centre lane is linked, which carries no traffic".to_owned());
    }
    let next = match end {
        Contact::Start => section.checked_sub(1),
        Contact::End => Some(section + 1).filter(|next| *next < road.sections.len()),
    };
    let (road, beyond) = match (next, road.link_at(end)) {
        (Some(next), _) => (road, road.sections.get(next)),
        (None, Some(link)) => match (link.target, network.road(&link.id)) {
            (Target::Road(Contact::Start), Some(road)) => (road, road.sections.first()),
            (Target::Road(Contact::End), Some(road)) => (road, road.sections.last()),
            // A junction's lanes are in its connections.
            _ => return,
        },
        (None, None) => {
            let name = if end == Contact::Start { "predecessor" } else { "successor" };
            return xml.defect(at, || format!("the road has no {name} whose lane {other} could be linked"));
        }
    };
    if let Some(beyond) = beyond.filter(|beyond| beyond.lane(other).is_none()) {
        missing_lane(xml, at, beyond, &road.id, other);
    }
}

fn junction_lane(xml: &mut Reader, at: Element<'_>, known: &Known<'_>, lane: JunctionLane) {
    let Some(junction) = known.network.junctions.get(lane.junction) else { return };
    let Some(connection) = junction.connections.get(lane.connection) else { return };
    let Some(link) = connection.lane_links.get(lane.link) else { return };
    if let Some(road) = known.network.road(&connection.incoming) {
        let into = |end: Contact| {
            road.link_at(end).is_some_and(|to| to.target == Target::Junction && to.id == junction.id)
        };
        let sections = [(Contact::Start, road.sections.first()), (Contact::End, road.sections.last())];
        let ends: Vec<&LaneSection> =
            sections.into_iter().filter(|(end, _)| into(*end)).filter_map(|(_, section)| section).collect();
        if let Some(&section) = ends.first()
            && ends.iter().all(|section| section.lane(link.from).is_none())
        {
            missing_lane(xml, at, section, &road.id, link.from);
        }
    }
    if let Some(road) = known.network.road(&connection.continuing) {
        let section = match connection.contact {
            Contact::Start => road.sections.first(),
            Contact::End => road.sections.last(),
        };
        if let Some(section) = section.filter(|section| section.lane(link.to).is_none()) {
            missing_lane(xml, at, section, &road.id, link.to);
        }
    }
}
