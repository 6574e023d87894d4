//! Junctions and their rights of way.

use std::collections::{BTreeMap, BTreeSet};

use swerve_map::{Junction, JunctionId, LaneId, RightOfWay};

use super::edges::Edges;
use crate::problem::quoted;
use crate::xml::{Element, Reader};

/// Most rights of way of a map.
const RIGHTS_MAX: usize = 2_000_000;

/// Junctions of the file that are neither parts of other junctions nor dead ends, numbered in the order of the file.
pub(super) fn junctions<'a>(
    xml: &mut Reader,
    elements: impl Iterator<Item = Element<'a>>,
    edges: &Edges<'a>,
) -> Vec<Junction> {
    let inside = inside(edges);
    let (mut junctions, mut ids, mut rights) = (Vec::new(), BTreeSet::new(), 0);
    for at in elements {
        let requests = xml.children(at, &["request", "param"]);
        let Some(id) = at.attribute("id") else {
            xml.missing(at, "id");
            continue;
        };
        if !ids.insert(id) {
            let message = || format!("expected an identity that no other has, found {} again", quoted(id));
            xml.fault_in(at, "id", message);
            continue;
        }
        if matches!(at.attribute("type"), Some("internal" | "dead_end")) {
            continue;
        }
        let lanes = inside.get(id).cloned().unwrap_or_default();
        let incoming = numbers(xml, at, "incLanes", edges).into_iter().filter_map(|lane| edges.lane(lane?));
        let incoming = incoming.collect();
        let requests: Vec<_> = requests.into_iter().filter(|child| child.has_tag_name("request")).collect();
        let rights_of_way = rights_of_way(xml, at, &requests, (edges, &lanes));
        rights += rights_of_way.len();
        if rights > RIGHTS_MAX {
            xml.fault(at, || format!("expected at most {RIGHTS_MAX} rights of way"));
            return junctions;
        }
        let number = JunctionId(junctions.len() as u32);
        junctions.push(Junction { id: number, name: id.to_owned(), lanes, incoming, rights_of_way });
    }
    junctions
}

/// Lanes inside each junction: those of its edges, which are named after it, such as `:C_3` of junction `C`.
fn inside<'a>(edges: &Edges<'a>) -> BTreeMap<&'a str, Vec<LaneId>> {
    let mut inside: BTreeMap<&str, Vec<LaneId>> = BTreeMap::new();
    for (number, lane) in edges.files.iter().enumerate() {
        let edge = &edges.edges[lane.edge];
        let name = edge.id.strip_prefix(':').and_then(|id| id.rsplit_once('_'));
        if let (Some((junction, _)), Some(id), "internal") = (name, edges.lane(number), edge.function) {
            inside.entry(junction).or_default().push(id);
        }
    }
    inside
}

/// Lanes in a list; `None` for those that are missing, which are reported.
fn numbers(xml: &mut Reader, at: Element<'_>, attribute: &str, edges: &Edges<'_>) -> Vec<Option<usize>> {
    let names = at.attribute(attribute).unwrap_or_default().split_whitespace();
    let mut found = |name: &str| {
        let number = edges.lane_of.get(name).copied();
        if number.is_none() {
            xml.defect(at, || format!("`{attribute}`: no lane is named {}", quoted(name)));
        }
        number
    };
    names.map(&mut found).collect()
}

/// Rights of way between lanes inside: bit `k` of a response, from the right, is set if link `k` has priority. The lane of
/// a link is the one of `intLanes`: of a link with a place to wait in the junction, the lane after it.
fn rights_of_way(
    xml: &mut Reader,
    at: Element<'_>,
    requests: &[Element<'_>],
    (edges, inside): (&Edges<'_>, &[LaneId]),
) -> Vec<RightOfWay> {
    let links: Vec<Option<LaneId>> = numbers(xml, at, "intLanes", edges)
        .into_iter()
        .map(|lane| edges.lane(lane?).filter(|id| inside.binary_search(id).is_ok()))
        .collect();
    let mut rights = Vec::new();
    // Networks may be without lanes inside junctions.
    for &request in requests.iter().filter(|_| !links.is_empty()) {
        let Some(index) = xml.integer(request, "index").and_then(|index| usize::try_from(index).ok()) else {
            continue;
        };
        let response = request.attribute("response").unwrap_or_default();
        if index >= links.len() || response.len() != links.len() {
            xml.defect(request, || {
                format!(
                    "expected an index below {0} and a response of {0} bits, as `intLanes` has lanes; found {1} and {2} bits",
                    links.len(),
                    index,
                    response.len()
                )
            });
            continue;
        }
        let Some(lane) = links[index] else { continue };
        let bits = response.bytes().rev().zip(&links).filter(|(bit, _)| *bit == b'1');
        rights.extend(bits.filter_map(|(_, to)| Some(RightOfWay { lane, to: (*to)? })));
        if rights.len() > RIGHTS_MAX {
            break;
        }
    }
    rights
}
