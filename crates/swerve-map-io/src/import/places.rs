//! Lanes of the map at places of the network.

use core::cell::Cell;
use std::collections::BTreeMap;

use swerve_geom::Point2;
use swerve_map::{Lane, LaneId, LaneKind};

use super::{Build, ImportError, LaneSource, REFERENCES_MAX};
use crate::opendrive::{Corner, Network, Object, Outline, Validity};

/// The network and the lanes of the map.
pub(super) struct Places<'b> {
    pub(super) network: &'b Network,
    build: &'b Build,
    /// References to lanes so far.
    references: Cell<usize>,
}

/// Lanes of a road for which a record holds.
#[derive(Clone, Copy)]
pub(super) struct Scope<'r> {
    /// Index of the road.
    pub(super) road: usize,
    /// Position along the road, metres.
    pub(super) s_m: f64,
    /// Direction of traffic: `+`, `-`, or another text for both.
    pub(super) orientation: &'r str,
    /// Lanes; empty for all.
    pub(super) validity: &'r [Validity],
    pub(super) kinds: &'r [LaneKind],
}

impl<'b> Places<'b> {
    pub(super) fn new(network: &'b Network, build: &'b Build) -> Self {
        Self { network, build, references: Cell::new(0) }
    }

    /// Lanes of the map with their sources.
    pub(super) fn lanes(&self) -> impl Iterator<Item = (&'b Lane, &'b LaneSource)> {
        self.build.lanes.iter().zip(&self.build.sources)
    }

    pub(super) fn lane(&self, id: LaneId) -> &'b Lane {
        &self.build.lanes[id.0 as usize]
    }

    pub(super) fn source(&self, id: LaneId) -> &'b LaneSource {
        &self.build.sources[id.0 as usize]
    }

    pub(super) fn lane_at(&self, road: usize, section: usize, lane: i32) -> Option<LaneId> {
        self.build.lane_at((road, section, lane))
    }

    /// The lane before each lane, and the lane after it, on the same road; the first of several.
    pub(super) fn along_roads(&self) -> (BTreeMap<LaneId, LaneId>, BTreeMap<LaneId, LaneId>) {
        let (mut before, mut after) = (BTreeMap::new(), BTreeMap::new());
        for (lane, source) in self.lanes() {
            for next in lane.successors.iter().filter(|next| self.source(**next).road == source.road) {
                before.entry(*next).or_insert(lane.id);
                after.entry(lane.id).or_insert(*next);
            }
        }
        (before, after)
    }

    /// Counts references to lanes.
    ///
    /// # Errors
    /// If there are more than [`REFERENCES_MAX`].
    pub(super) fn count(&self, references: usize) -> Result<(), ImportError> {
        self.references.set(self.references.get().saturating_add(references));
        if self.references.get() > REFERENCES_MAX { Err(ImportError::TooManyReferences) } else { Ok(()) }
    }

    /// Lanes for which a record holds, from the left of the road to its right.
    pub(super) fn in_scope(&self, scope: Scope<'_>) -> Result<Vec<LaneId>, ImportError> {
        let Some(road) = self.network.roads.get(scope.road).filter(|road| !road.sections.is_empty()) else {
            return Ok(Vec::new());
        };
        let at = road.section_at(scope.s_m);
        let is_valid = |lane: i32| {
            let within = |one: &Validity| {
                (one.from_lane.min(one.to_lane)..=one.from_lane.max(one.to_lane)).contains(&lane)
            };
            scope.validity.is_empty() || scope.validity.iter().any(within)
        };
        let is_along = |lane: i32| match scope.orientation {
            "+" => road.runs_forward(lane),
            "-" => !road.runs_forward(lane),
            _ => true,
        };
        let lanes = road.sections[at].lanes().filter(|lane| is_along(lane.id) && is_valid(lane.id));
        let found = lanes.filter_map(|lane| self.lane_at(scope.road, at, lane.id));
        let found: Vec<LaneId> = found.filter(|id| scope.kinds.contains(&self.lane(*id).kind)).collect();
        self.count(found.len())?;
        Ok(found)
    }

    /// Arc length along a lane at a position of its road, metres.
    pub(super) fn along_m(&self, id: LaneId, s_m: f64) -> f64 {
        let LaneSource { road, section, lane, span_m: [from_m, to_m], .. } = *self.source(id);
        let line = &self.lane(id).line;
        let road = &self.network.roads[road];
        let s_m = s_m.clamp(from_m, to_m);
        let mut edges = road.edges(&road.sections[section], lane > 0, s_m);
        let Some((_, edges)) = edges.find(|(one, _)| one.id == lane) else { return 0.0 };
        let at = self.point(self.source(id).road, s_m, edges.center().t_m);
        line.project(at).s_m.clamp(0.0, line.length())
    }

    /// Point beside a road in the ground plane.
    pub(super) fn point(&self, road: usize, s_m: f64, t_m: f64) -> Point2 {
        let [x_m, y_m, _] = self.network.place(&self.network.roads[road], s_m, t_m).position_m;
        Point2::new(x_m, y_m)
    }

    /// Outlines of an object of a road in the ground plane: those of the file with 3 corners or more, or else its
    /// rectangle; empty for an object without extent.
    pub(super) fn outlines(&self, road: usize, object: &Object) -> Vec<Vec<Point2>> {
        let place = self.network.place(&self.network.roads[road], object.s_m, object.t_m);
        let (sin, cos) = swerve_geom::math::sin_cos(place.reference_heading_rad + object.heading_rad);
        let [x, y, _] = place.position_m;
        let local = |u: f64, v: f64| Point2::new(x + u * cos - v * sin, y + u * sin + v * cos);
        let corner = |corner: &Corner| match *corner {
            Corner::Local { u_m, v_m } => local(u_m, v_m),
            Corner::Road { s_m, t_m } => self.point(road, s_m, t_m),
        };
        let outline = |outline: &Outline| outline.corners.iter().map(corner).collect::<Vec<_>>();
        let given: Vec<_> = object.outlines.iter().map(outline).filter(|all| all.len() > 2).collect();
        let [u, v] = [0.5 * object.size_m[0], 0.5 * object.size_m[1]];
        if given.is_empty() && u > 0.0 && v > 0.0 {
            return vec![vec![local(u, v), local(-u, v), local(-u, -v), local(u, -v)]];
        }
        given
    }
}
