//! Lanelets: relations of a left and a right way, in the direction of travel.

use std::collections::{BTreeMap, BTreeSet};

use swerve_geom::{Point2, Polyline};
use swerve_map::LaneId;

use super::osm::{Osm, Relation, tag};
use super::{marks, tags};
use crate::draft::{Center, Draft};
use crate::slope::raised_borders;
use crate::strip::distinct;
use crate::xml::{Element, Reader};

/// A way as a border of a lanelet.
#[derive(Clone, Debug)]
pub(super) struct Side {
    /// Identity of the way.
    pub(super) way: i64,
    /// True if the direction of travel is against that of the way.
    pub(super) inverted: bool,
    /// First and last node in the direction of travel.
    pub(super) ends: [i64; 2],
}

/// A lane: a lanelet in one direction.
pub(super) struct Lanelet<'a> {
    /// Identity of the relation.
    pub(super) relation: i64,
    /// True for the second lane of a lanelet with traffic in both directions.
    pub(super) backward: bool,
    /// Left and right border.
    pub(super) sides: [Side; 2],
    pub(super) draft: Draft<'a>,
}

/// A line through nodes.
#[derive(Clone, Debug, Default)]
struct Line {
    nodes: Vec<i64>,
    points: Vec<Point2>,
    heights_m: Vec<Option<f64>>,
}

impl Line {
    fn reverse(&mut self) {
        self.nodes.reverse();
        self.points.reverse();
        self.heights_m.reverse();
    }

    /// Point in the middle of the list, or between two.
    fn middle(&self) -> Point2 {
        match self.points[..] {
            [a, b] => a + (b - a) * 0.5,
            _ => self.points[self.points.len() / 2],
        }
    }

    /// Distance of a point to the left of the line, metres; 0 for a line without length.
    fn left_m(&self, point: Point2) -> f64 {
        Polyline::new(&self.points).map_or(0.0, |line| line.project(point).d_m)
    }
}

/// Lanes of all lanelets, in the order of their identities; those against the direction of a lanelet at the end.
pub(super) fn lanelets<'a>(
    xml: &mut Reader,
    osm: &Osm<'a>,
    speeds_mps: &BTreeMap<i64, f64>,
    types: &mut BTreeMap<String, usize>,
) -> Vec<Lanelet<'a>> {
    let mut lanes = Vec::new();
    for (id, relation) in &osm.relations {
        if tag(relation.element, "type") != Some("lanelet") {
            continue;
        }
        let subtype: String =
            tag(relation.element, "subtype").unwrap_or("without subtype").chars().take(40).collect();
        *types.entry(subtype).or_default() += 1;
        lanes.extend(lanelet(xml, osm, (*id, relation), speeds_mps));
    }
    let both_ways = |lane: &&Lanelet<'a>| {
        lane.draft.kind == swerve_map::LaneKind::Driving && tags::is_both_ways(lane.draft.element)
    };
    let backward: Vec<Lanelet<'a>> = lanes.iter().filter(both_ways).map(Lanelet::turned).collect();
    lanes.extend(backward);
    lanes
}

impl<'a> Lanelet<'a> {
    /// The lane in the opposite direction.
    fn turned(&self) -> Self {
        let [left, right] = &self.sides;
        let turned = |side: &Side| Side {
            inverted: !side.inverted,
            ends: [side.ends[1], side.ends[0]],
            way: side.way,
        };
        let draft = &self.draft;
        Self {
            relation: self.relation,
            backward: true,
            sides: [turned(right), turned(left)],
            draft: Draft {
                element: draft.element,
                name: format!("{}:backward", draft.name),
                kind: draft.kind,
                speed_limit_mps: draft.speed_limit_mps,
                left: reversed(&draft.right),
                right: reversed(&draft.left),
                raised: draft.raised.as_ref().map(|[left, right]| [reversed(right), reversed(left)]),
                center: match &draft.center {
                    Center::Given(line) => Center::Given(reversed(line)),
                    _ => Center::Between,
                },
                marks: [draft.marks[1], draft.marks[0]],
                beside: [None; 2],
                successors: BTreeSet::new(),
            },
        }
    }
}

fn reversed<T: Copy>(line: &[T]) -> Vec<T> {
    line.iter().rev().copied().collect()
}

fn lanelet<'a>(
    xml: &mut Reader,
    osm: &Osm<'a>,
    (id, relation): (i64, &Relation<'a>),
    speeds_mps: &BTreeMap<i64, f64>,
) -> Option<Lanelet<'a>> {
    let at = relation.element;
    let left = border(xml, osm, relation, "left");
    let right = border(xml, osm, relation, "right");
    let ((left_way, mut left), (right_way, mut right)) = (left?, right?);
    let inverted = aligned(xml, at, &mut left, &mut right);
    let kind = tags::kind(xml, at);
    let by_rule =
        relation.members("relation", "regulatory_element").find_map(|rule| speeds_mps.get(&rule.id));
    let speed_limit_mps = by_rule.copied().or_else(|| tags::speed(xml, at, "speed_limit"));
    let center = center(xml, osm, relation, &left, &right);
    let side = |way: i64, inverted: bool, line: &Line| Side {
        way,
        inverted,
        ends: [line.nodes[0], line.nodes[line.nodes.len() - 1]],
    };
    let sides = [side(left_way, inverted[0], &left), side(right_way, inverted[1], &right)];
    // A lane is to the right of its left border.
    let marks = [0, 1].map(|k| marks::mark(xml, osm, sides[k].way, (k == 0) == sides[k].inverted));
    Some(Lanelet {
        relation: id,
        backward: false,
        draft: Draft {
            element: at,
            name: id.to_string(),
            kind,
            speed_limit_mps,
            raised: raised_borders([&left, &right].map(|line| (&*line.points, &*line.heights_m))),
            left: distinct(left.points),
            right: distinct(right.points),
            center,
            marks,
            beside: [None; 2],
            successors: BTreeSet::new(),
        },
        sides,
    })
}

/// The way of a border and its line; its absence is a fault.
fn border(xml: &mut Reader, osm: &Osm<'_>, relation: &Relation<'_>, role: &str) -> Option<(i64, Line)> {
    let at = relation.element;
    let found: Vec<_> = relation.members.iter().filter(|member| member.role == role).collect();
    let [member] = found[..] else {
        xml.fault(at, || format!("expected one way with the role `{role}`, found {}", found.len()));
        return None;
    };
    if member.kind != "way" {
        xml.fault(member.element, || {
            format!("expected a way with the role `{role}`, found a {}", member.kind)
        });
        return None;
    }
    let line = line(xml, osm, (member.element, member.id), true)?;
    if line.nodes.len() < 2 {
        xml.fault(member.element, || {
            format!("expected a way of at least 2 nodes, found {}", line.nodes.len())
        });
        return None;
    }
    Some((member.id, line))
}

/// Line of a way. Where it or one of its nodes is missing, `None` and a fault of a border, else a defect.
fn line(xml: &mut Reader, osm: &Osm<'_>, (at, way): (Element<'_>, i64), is_border: bool) -> Option<Line> {
    let mut wrong = |at: Element<'_>, message: String| match is_border {
        true => xml.fault(at, || message),
        false => xml.defect(at, || message),
    };
    let Some(found) = osm.ways.get(&way) else {
        wrong(at, format!("expected the identity of a way, found {way}"));
        return None;
    };
    let mut line = Line::default();
    let mut is_whole = true;
    for &(nd, id) in &found.nodes {
        match osm.nodes.get(&id).map(|node| (node.element, node.at, node.z_m)) {
            Some((_, Some(point), z_m)) => {
                line.nodes.push(id);
                line.points.push(point);
                line.heights_m.push(z_m);
                continue;
            }
            Some((node, None, _)) => {
                wrong(node, "expected the tags `local_x` and `local_y`, as other nodes have".to_owned());
            }
            None => wrong(nd, format!("expected the identity of a node, found {id}")),
        }
        is_whole = false;
    }
    is_whole.then_some(line)
}

/// Points of a way that is no border; `None` and a defect where it or one of its nodes is missing.
pub(super) fn points(xml: &mut Reader, osm: &Osm<'_>, at: Element<'_>, way: i64) -> Option<Vec<Point2>> {
    line(xml, osm, (at, way), false).map(|line| line.points)
}

/// Turns both borders into the direction of travel, as Lanelet2 does: the middle of the right one is to the right of the
/// left one, and the other way round. Returns true for those that are turned.
fn aligned(xml: &mut Reader, at: Element<'_>, left: &mut Line, right: &mut Line) -> [bool; 2] {
    let left_turned = left.left_m(right.middle()) >= 0.0;
    if left_turned {
        left.reverse();
    }
    let mut right_turned = right.left_m(left.middle()) <= 0.0;
    if right_turned {
        right.reverse();
    }
    let ends = |line: &Line| (line.points[0], line.points[line.points.len() - 1]);
    let ((a, b), (c, d)) = (ends(left), ends(right));
    if a.distance(c) + b.distance(d) > a.distance(d) + b.distance(c) {
        xml.defect(at, || "its borders cross, or the direction of its right border is not clear".to_owned());
        right.reverse();
        right_turned = !right_turned;
    }
    [left_turned, right_turned]
}

/// Centre line of the file, in the direction of travel, or none.
fn center(xml: &mut Reader, osm: &Osm<'_>, relation: &Relation<'_>, left: &Line, right: &Line) -> Center {
    // The second name is that of RoadRunner.
    let named = relation.members("way", "centerline").chain(relation.members("way", "center"));
    let Some(member) = named.into_iter().next() else { return Center::Between };
    let Some(mut points) = points(xml, osm, member.element, member.id).map(distinct) else {
        return Center::Between;
    };
    if points.len() < 2 {
        xml.defect(member.element, || "expected a centre line with a length: not used".to_owned());
        return Center::Between;
    }
    let begin = left.points[0] + (right.points[0] - left.points[0]) * 0.5;
    if points[0].distance(begin) > points[points.len() - 1].distance(begin) {
        points.reverse();
    }
    Center::Given(points)
}

/// Identity in the map of the lane at an index of the list.
pub(super) fn lane_id(index: usize) -> LaneId {
    LaneId(index as u32)
}
