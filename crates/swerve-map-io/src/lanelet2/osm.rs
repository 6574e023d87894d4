//! Nodes, ways and relations of an OSM file.

use std::collections::BTreeMap;

use swerve_geom::Point2;

use super::tangent::Tangent;
use crate::content::all;
use crate::problem::quoted;
use crate::xml::{Element, Reader, number};

/// Elements of the root.
const KNOWN: [&str; 8] = ["node", "way", "relation", "MetaInfo", "bounds", "note", "meta", "changeset"];

/// Value of a tag of an element.
pub(super) fn tag<'a>(of: Element<'a>, key: &str) -> Option<&'a str> {
    tag_element(of, key).map(|tag| tag.attribute("v").unwrap_or_default().trim())
}

/// The `tag` element of a key.
pub(super) fn tag_element<'a>(of: Element<'a>, key: &str) -> Option<Element<'a>> {
    all(of, "tag").find(|tag| tag.attribute("k") == Some(key))
}

/// A node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node<'a> {
    pub(super) element: Element<'a>,
    /// Position in the ground plane; `None` if the other nodes have local coordinates and this one has none.
    pub(super) at: Option<Point2>,
    /// Height, metres.
    pub(super) z_m: Option<f64>,
}

/// A way: a line through nodes.
#[derive(Clone, Debug)]
pub(super) struct Way<'a> {
    pub(super) element: Element<'a>,
    /// Elements `nd` and the nodes that they name.
    pub(super) nodes: Vec<(Element<'a>, i64)>,
}

/// A relation of elements.
#[derive(Clone, Debug)]
pub(super) struct Relation<'a> {
    pub(super) element: Element<'a>,
    pub(super) members: Vec<Member<'a>>,
}

/// A member of a relation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member<'a> {
    pub(super) element: Element<'a>,
    /// `node`, `way` or `relation`.
    pub(super) kind: &'a str,
    pub(super) role: &'a str,
    pub(super) id: i64,
}

impl<'a> Relation<'a> {
    /// Members of a type and role.
    pub(super) fn members<'s>(
        &'s self,
        kind: &'s str,
        role: &'s str,
    ) -> impl Iterator<Item = &'s Member<'a>> + use<'s, 'a> {
        self.members.iter().filter(move |member| member.kind == kind && member.role == role)
    }
}

/// Contents of an OSM file.
#[derive(Default)]
pub(super) struct Osm<'a> {
    pub(super) nodes: BTreeMap<i64, Node<'a>>,
    pub(super) ways: BTreeMap<i64, Way<'a>>,
    pub(super) relations: BTreeMap<i64, Relation<'a>>,
    /// Latitude and longitude of the origin, degrees; `None` for local coordinates.
    pub(super) origin_deg: Option<[f64; 2]>,
}

impl<'a> Osm<'a> {
    /// Reads all elements that are not deleted.
    pub(super) fn read(xml: &mut Reader, root: Element<'a>) -> Self {
        let mut osm = Self::default();
        let elements = xml.children(root, &KNOWN);
        let is_local = |node: &Element<'a>| {
            node.tag_name().name() == "node"
                && tag(*node, "local_x").is_some()
                && tag(*node, "local_y").is_some()
        };
        let local = elements.iter().any(is_local);
        let mut tangent = None;
        for at in elements {
            let is_gone =
                at.attribute("action") == Some("delete") || at.attribute("visible") == Some("false");
            let kind = at.tag_name().name();
            if is_gone || !["node", "way", "relation"].contains(&kind) {
                continue;
            }
            let Some(id) = identity(xml, at, "id") else { continue };
            let is_new = match kind {
                "node" => {
                    let place =
                        if local { local_place(xml, at) } else { osm.globe_place(xml, at, &mut tangent) };
                    let z_m = tag_element(at, "ele").and_then(|ele| xml.lenient(ele, "v"));
                    let z_m = z_m.or_else(|| xml.lenient(at, "ele"));
                    osm.nodes.insert(id, Node { element: at, at: place, z_m }).is_none()
                }
                "way" => {
                    let nodes = all(at, "nd").filter_map(|nd| Some((nd, identity(xml, nd, "ref")?)));
                    osm.ways.insert(id, Way { element: at, nodes: nodes.collect() }).is_none()
                }
                _ => {
                    let members = all(at, "member").filter_map(|member| {
                        let kind = xml.name(member, "type", &["node", "way", "relation"])?;
                        let role = member.attribute("role").unwrap_or_default();
                        Some(Member { element: member, kind, role, id: identity(xml, member, "ref")? })
                    });
                    osm.relations.insert(id, Relation { element: at, members: members.collect() }).is_none()
                }
            };
            if !is_new {
                xml.fault_in(at, "id", || {
                    format!("expected an identity that no other {kind} has, found {id} again")
                });
            }
        }
        osm
    }

    /// Position by latitude and longitude, of which the first one is the origin. Where they are wrong, which is a fault,
    /// it is the origin.
    fn globe_place(
        &mut self,
        xml: &mut Reader,
        at: Element<'a>,
        tangent: &mut Option<Tangent>,
    ) -> Option<Point2> {
        let faults = xml.faults();
        let place_deg = ["lat", "lon"].map(|name| xml.number(at, name));
        for (name, value, most) in [("lat", place_deg[0], 90.0), ("lon", place_deg[1], 180.0)] {
            if value.abs() > most {
                xml.fault_in(at, name, || format!("expected degrees from -{most} to {most}, found {value}"));
            }
        }
        if xml.faults() > faults {
            return Some(Point2::new(0.0, 0.0));
        }
        let tangent = tangent.get_or_insert_with(|| {
            self.origin_deg = Some(place_deg);
            Tangent::new(place_deg)
        });
        let [x_m, y_m] = tangent.project(place_deg);
        Some(Point2::new(x_m, y_m))
    }
}

/// Position by local coordinates; `None` without them. Where they are wrong, which is a fault, it is the origin.
fn local_place(xml: &mut Reader, at: Element<'_>) -> Option<Point2> {
    let [x, y] = ["local_x", "local_y"].map(|key| tag_element(at, key));
    let mut coordinate = |tag: Element<'_>| {
        number(tag.attribute("v").unwrap_or_default()).unwrap_or_else(|message| {
            xml.fault_in(tag, "v", || message);
            0.0
        })
    };
    Some(Point2::new(coordinate(x?), coordinate(y?)))
}

/// Identity of an element, or one that it names: a whole number of 64 bits.
fn identity(xml: &mut Reader, of: Element<'_>, name: &str) -> Option<i64> {
    let Some(text) = of.attribute(name) else {
        xml.missing(of, name);
        return None;
    };
    let value = text.trim().parse::<i64>().ok();
    if value.is_none() {
        xml.fault_in(of, name, || format!("expected a whole number, found {}", quoted(text)));
    }
    value
}
