//! The ground of a map: its height, and distances from lanes.

use std::collections::BTreeSet;

use swerve_geom::{FrenetPoint, Point2};
use swerve_map::{Lane, LaneId, LaneIndex, LaneKind, LanePlace, Map, Side};

use super::corner::corners;
use super::side::{is_road, neighbour};
use crate::paving::KERB_M;

/// The drawn ground of a map.
#[derive(Clone, Debug)]
pub struct MapGround<'m> {
    pub(super) map: &'m Map,
    /// Lanes for driving and other lanes with asphalt: of two lanes of different width that overlap, the one with the
    /// nearer centre line need not be the one that contains a point.
    roads: [LaneIndex; 2],
    walks: LaneIndex,
    /// Pavements that the map leaves out.
    pub(super) corners: Map,
    of_corners: LaneIndex,
    all: LaneIndex,
    /// Largest distance of a border from its centre line, metres.
    widest_m: f64,
    inside: BTreeSet<LaneId>,
}

impl<'m> MapGround<'m> {
    /// Ground of a map.
    pub fn new(map: &'m Map) -> Self {
        let is_other = |lane: &Lane| is_road(lane.kind) && lane.kind != LaneKind::Driving;
        let roads = [LaneIndex::of(map, |lane| lane.kind == LaneKind::Driving), LaneIndex::of(map, is_other)];
        let walks = LaneIndex::of(map, |lane| lane.kind == LaneKind::Walking);
        // Lanes with identities of their own, which refer to no others.
        let corners =
            Map::new(corners(map)).unwrap_or_else(|_| Map::new(Vec::new()).expect("no lanes are a map"));
        let of_corners = LaneIndex::new(&corners);
        let all = map.lanes().iter().chain(corners.lanes());
        let widest_m = all.map(|lane| lane.borders.farthest_m()).fold(0.0, f64::max);
        Self {
            map,
            roads,
            walks,
            corners,
            of_corners,
            all: LaneIndex::new(map),
            widest_m,
            inside: map.junctions().iter().flat_map(|junction| &junction.lanes).copied().collect(),
        }
    }

    /// Height of the ground at a point, metres: that of a pavement, or else 0.
    pub fn height_m(&self, point: Point2) -> f64 {
        if self.is_pavement(point) && !self.is_road(point) { f64::from(KERB_M) } else { 0.0 }
    }

    /// True on a lane with asphalt.
    pub(super) fn is_road(&self, point: Point2) -> bool {
        self.roads.iter().any(|index| is_within(self.map, index, point))
    }

    /// True on a lane for pedestrians, also where a road is.
    pub(super) fn is_pavement(&self, point: Point2) -> bool {
        is_within(self.map, &self.walks, point) || is_within(&self.corners, &self.of_corners, point)
    }

    /// Heading of the nearest lane for driving, radians.
    pub(super) fn road_heading_rad(&self, point: Point2) -> Option<f64> {
        let (lane, place) = nearest(self.map, &self.roads[0], point)?;
        Some(lane.line.at(place.s_m).pose.heading_rad)
    }

    /// True if every lane is at least `margin_m` metres away from a point.
    pub(super) fn is_clear(&self, point: Point2, margin_m: f64) -> bool {
        [(self.map, &self.all), (&self.corners, &self.of_corners)].into_iter().all(|(map, index)| {
            nearest(map, index, point).is_none_or(|(lane, place)| {
                let on_line = lane.line.at(place.s_m.clamp(0.0, lane.line.length())).pose.point();
                on_line.distance(point) >= self.widest_m + margin_m
            })
        })
    }

    /// True for lanes inside junctions.
    pub(super) fn is_inside(&self, lane: LaneId) -> bool {
        self.inside.contains(&lane)
    }

    /// True if the marks of a border belong to the lane: a neighbour that has marks for the same border does not come first.
    pub(super) fn has_marks(&self, lane: &Lane, side: Side) -> bool {
        let (Some(beside), Some(other)) = (neighbour(lane, side), self.beside(lane, side)) else {
            return true;
        };
        let back = if beside.opposite == (side == Side::Left) { Side::Left } else { Side::Right };
        lane.id < other.id || other.marks.of(back).is_empty()
    }

    /// Lane beside another one.
    pub(super) fn beside(&self, lane: &Lane, side: Side) -> Option<&'m Lane> {
        self.map.lane(neighbour(lane, side)?.lane)
    }
}

/// Lane of an index with the nearest centre line, and the position along it.
fn nearest<'m>(map: &'m Map, index: &LaneIndex, point: Point2) -> Option<(&'m Lane, FrenetPoint)> {
    let LanePlace { lane, place } = index.nearest(point)?;
    Some((map.lane(lane)?, place))
}

/// True if that lane contains the point.
fn is_within(map: &Map, index: &LaneIndex, point: Point2) -> bool {
    nearest(map, index, point).is_some_and(|(lane, place)| {
        (0.0..=lane.line.length()).contains(&place.s_m) && lane.borders.contains(place)
    })
}
