//! Connections: lanes that continue each other.

use std::collections::{BTreeMap, BTreeSet};

use swerve_map::LaneId;
use swerve_text::did_you_mean;

use super::edges::{Edges, Slot};
use crate::import::Gap;
use crate::problem::quoted;
use crate::xml::{Element, Reader};

/// Largest gap of lane ends that is not listed, metres: the file's centimetres, diagonally.
const ROUNDED_M: f64 = 0.015;

/// Largest gap of lane ends that are joined, metres: the one that `Map` accepts.
const JOINABLE_M: f64 = 0.1;

/// Most lanes that are too short in a row.
const SHORT_MAX: usize = 64;

/// Most names that a wrong one is compared with.
const COMPARED_MAX: usize = 2000;

/// A connection; lanes by their numbers in [`Edges::files`].
pub(super) struct Connection<'a> {
    pub(super) from: usize,
    pub(super) to: usize,
    /// First lane inside the junction.
    pub(super) via: Option<usize>,
    /// Traffic light and link.
    pub(super) light: Option<(&'a str, u32)>,
    /// Right of way: `M` priority, `m` minor, `s` stop, `w` all-way stop, `=` equal, `o` `O` traffic light.
    pub(super) state: &'a str,
}

impl Connection<'_> {
    /// The lane after the first.
    pub(super) fn next(&self) -> usize {
        self.via.unwrap_or(self.to)
    }
}

/// Reads a connection; `None` where a lane is missing.
pub(super) fn read<'a>(xml: &mut Reader, at: Element<'a>, edges: &Edges<'a>) -> Option<Connection<'a>> {
    let _children = xml.children(at, &["param", "stopOffset"]);
    let from = end(xml, at, edges, ["from", "fromLane"]);
    let to = end(xml, at, edges, ["to", "toLane"]);
    let via = match at.attribute("via") {
        Some(name) => {
            let found = edges.lane_of.get(name).copied();
            if found.is_none() {
                missing(xml, at, "via", ("lane", name), edges.lane_of.keys().copied());
            }
            found
        }
        None => None,
    };
    let light = match (at.attribute("tl"), at.has_attribute("linkIndex")) {
        (Some(light), true) => xml
            .integer(at, "linkIndex")
            .and_then(|index| u32::try_from(index).ok())
            .map(|index| (light, index)),
        _ => None,
    };
    Some(Connection { from: from?, to: to?, via, light, state: at.attribute("state").unwrap_or_default() })
}

/// Lane at an end of a connection.
fn end<'a>(xml: &mut Reader, at: Element<'a>, edges: &Edges<'a>, [edge, lane]: [&str; 2]) -> Option<usize> {
    let index = xml.integer(at, lane);
    let Some(name) = at.attribute(edge) else {
        xml.missing(at, edge);
        return None;
    };
    let index = index?;
    let Some(&number) = edges.edge_of.get(name) else {
        missing(xml, at, edge, ("edge", name), edges.edge_of.keys().copied());
        return None;
    };
    let lanes = edges.edges.get(number).map(|edge| &edge.lanes)?;
    let found = usize::try_from(index).ok().and_then(|index| lanes.get(index).copied());
    if found.is_none() {
        xml.defect(at, || {
            format!(
                "`{lane}`: expected one of the {} lanes of edge {}, found {index}",
                lanes.len(),
                quoted(name)
            )
        });
    }
    found
}

fn missing<'n>(
    xml: &mut Reader,
    at: Element<'_>,
    attribute: &str,
    (kind, name): (&str, &str),
    known: impl Iterator<Item = &'n str>,
) {
    xml.defect(at, || {
        let hint = did_you_mean(name, known.take(COMPARED_MAX));
        format!("`{attribute}`: no {kind} is named {}{hint}", quoted(name))
    });
}

/// Sets the successors of all lanes; lanes without length are skipped. Returns the gaps.
pub(super) fn join(edges: &mut Edges<'_>, connections: &[Connection<'_>]) -> Vec<Gap> {
    let mut next: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for connection in connections {
        next.entry(connection.from).or_default().insert(connection.next());
    }
    let mut gaps = Vec::new();
    for number in 0..edges.files.len() {
        let Some(id) = edges.lane(number) else { continue };
        let followers = beyond(edges, &next, number);
        let mut successors = Vec::with_capacity(followers.len());
        for (other, successor) in followers {
            let [from, to] = [&edges.files[number], &edges.files[other]];
            let gap_m = from.ends[1].distance(to.ends[0]);
            let joined = gap_m <= JOINABLE_M;
            if joined {
                successors.push(successor);
            }
            if gap_m > ROUNDED_M {
                let ends = format!("lane {} at its end and lane {} at its start", from.id, to.id);
                gaps.push(Gap { ends, gap_m, joined });
            }
        }
        edges.lanes[id.0 as usize].successors = successors;
    }
    gaps
}

/// Lanes of the map that continue a lane, through lanes without length: number in the file and identity in the map.
fn beyond(
    edges: &Edges<'_>,
    next: &BTreeMap<usize, BTreeSet<usize>>,
    from: usize,
) -> BTreeMap<usize, LaneId> {
    let (mut found, mut open, mut seen) = (BTreeMap::new(), vec![from], BTreeSet::new());
    while let Some(at) = open.pop() {
        for &to in next.get(&at).into_iter().flatten() {
            match edges.files[to].slot {
                Slot::Lane(id) => drop(found.insert(to, id)),
                Slot::Short if seen.len() < SHORT_MAX && seen.insert(to) => open.push(to),
                _ => {}
            }
        }
    }
    found
}
