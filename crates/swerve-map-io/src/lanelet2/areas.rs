//! Areas: ways around them, relations of such ways, and parking spaces.

use std::collections::VecDeque;

use swerve_geom::Point2;
use swerve_map::{Area, AreaId, AreaKind};

use super::lanelets::points;
use super::osm::{Osm, Relation, tag};
use crate::strip::distinct;
use crate::xml::{Reader, number};

/// Kind of an area by the type of its way or the subtype of its relation.
fn kind_of(name: &str) -> AreaKind {
    match name {
        "parking" | "parking_lot" | "parking_spot" => AreaKind::Parking,
        "walkway" | "bus_stop_area" => AreaKind::Walking,
        "no_stopping_area" | "no_parking_area" => AreaKind::NoStopping,
        "traffic_island" | "keepout" | "vegetation" | "building" | "hatched_road_markings" => {
            AreaKind::NoEntry
        }
        _ => AreaKind::Other,
    }
}

/// Areas of a file: ways first, then relations, each in the order of their identities.
pub(super) fn areas(xml: &mut Reader, osm: &Osm<'_>) -> Vec<Area> {
    let mut areas = Vec::new();
    let mut add = |name: i64, kind, outline: Vec<Point2>| {
        let id = AreaId(areas.len() as u32);
        areas.push(Area { id, name: name.to_string(), kind, outline });
    };
    for (id, way) in &osm.ways {
        let kind = tag(way.element, "type").unwrap_or_default();
        // The ground of junctions and crosswalks is theirs.
        if matches!(kind, "crosswalk_polygon" | "intersection_area") {
            continue;
        }
        if kind == "parking_space" {
            let line = points(xml, osm, way.element, *id);
            if let Some(outline) = line.and_then(|line| space(xml, way.element, &line)) {
                add(*id, AreaKind::Parking, outline);
            }
        } else if matches!(tag(way.element, "area"), Some("yes" | "true"))
            && let Some(outline) = points(xml, osm, way.element, *id).and_then(ring)
        {
            add(*id, kind_of(kind), outline);
        }
    }
    for (id, relation) in &osm.relations {
        if tag(relation.element, "type") != Some("multipolygon") {
            continue;
        }
        let outer = outer(xml, osm, relation).and_then(ring);
        match outer {
            Some(outline) => add(*id, kind_of(tag(relation.element, "subtype").unwrap_or_default()), outline),
            None => xml.defect(relation.element, || {
                "expected ways with the role `outer` around an area: left out".to_owned()
            }),
        }
    }
    areas
}

/// Corners of a closed line; `None` for fewer than 3.
fn ring(points: Vec<Point2>) -> Option<Vec<Point2>> {
    let mut corners = distinct(points);
    if corners.len() > 1 && corners[0].distance(corners[corners.len() - 1]) < 1e-6 {
        corners.pop();
    }
    Some(corners).filter(|corners| corners.len() >= 3)
}

/// Outer border of a relation: its ways joined at their ends, in any direction.
fn outer(xml: &mut Reader, osm: &Osm<'_>, relation: &Relation<'_>) -> Option<Vec<Point2>> {
    /// Most ways around an area.
    const WAYS_MAX: usize = 200;
    let members: Vec<_> = relation.members("way", "outer").collect();
    if members.len() > WAYS_MAX {
        return None;
    }
    let mut open: VecDeque<Vec<Point2>> =
        members.iter().map(|member| points(xml, osm, member.element, member.id)).collect::<Option<_>>()?;
    let mut ring = open.pop_front()?;
    while !open.is_empty() {
        let end = *ring.last()?;
        let meets = |way: &Vec<Point2>| [way.first(), way.last()].contains(&Some(&end));
        let mut next = open.remove(open.iter().position(meets)?)?;
        if next.first() != Some(&end) {
            next.reverse();
        }
        ring.extend(next);
    }
    Some(ring)
}

/// Rectangle around the line of a parking space, of the width in its tag.
fn space(xml: &mut Reader, at: crate::xml::Element<'_>, line: &[Point2]) -> Option<Vec<Point2>> {
    let ([first, ..], [.., last]) = (line, line) else { return None };
    let width_m = tag(at, "width").map_or(Err("expected the tag `width`, metres".to_owned()), number);
    let width_m =
        width_m.map_err(|message| xml.defect(at, || message)).ok().filter(|width_m| *width_m > 0.0)?;
    let along = *last - *first;
    let aside = along.left() * (0.5 * width_m / along.norm().max(1e-6));
    Some(vec![*first + aside, *first - aside, *last - aside, *last + aside])
}
