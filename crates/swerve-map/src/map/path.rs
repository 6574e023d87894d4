//! Paths over lanes that a road user may take.

use core::fmt;
use std::sync::OnceLock;

use swerve_geom::{FrenetPoint, Point2, Polyline, Pose2, angle_between};

use super::{Bounds, Map};
use crate::{Lane, LaneId, LanePlace};

/// Length of a path beyond its first lane, metres: beyond the travel of any vehicle within a horizon.
const REACH_M: f64 = 150.0;
/// Largest number of lanes in a path, and of paths from one lane; both bound cyclic maps.
const LANES_MAX: usize = 64;
const PATHS_MAX: usize = 16;
/// Lanes without a successor or predecessor are extended by this, metres, because maps end where the road does not.
const BEYOND_M: f64 = 150.0;
/// The direction of an extension is that of this last part of the lane, metres, because hand-drawn ends are
/// inaccurate.
const END_M: f64 = 20.0;
/// Lateral tolerance for a position to be on a lane, metres.
const BESIDE_M: f64 = 1.0;
/// Half of the length over which curvature is averaged, metres, because hand-drawn bounds are inaccurate.
const BEND_M: f64 = 5.0;

/// A path: lanes, each a successor of the one before, as one line. Where the map ends, the line goes on straight.
#[derive(Clone, PartialEq, Debug)]
pub struct LanePath {
    /// Lanes in order, and the start of each along the line, metres.
    pub lanes: Vec<(LaneId, f64)>,
    /// Centre line.
    pub line: Polyline,
    /// Stop lines in order: position along the line, metres, and lane.
    pub stop_lines: Vec<(f64, LaneId)>,
    /// Total turning on the lanes after the first, in either direction, radians.
    pub turn_rad: f64,
    /// Curvature at intervals of [`BEND_M`], 1/m.
    curvatures_1pm: Vec<f64>,
}

/// Derived values of each lane, computed at first use. Maps with equal lanes have equal ones.
#[derive(Clone, Default)]
pub(super) struct Paths(OnceLock<Vec<Onward>>);

impl PartialEq for Paths {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Paths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Paths")
    }
}

/// Ways to go on from a lane.
#[derive(Clone)]
struct Onward {
    /// For lanes without a predecessor or successor.
    extended: Option<Extended>,
    paths: OnceLock<Vec<LanePath>>,
}

/// A lane with its extensions.
#[derive(Clone)]
struct Extended {
    line: Polyline,
    /// Length of the extension before the lane, metres.
    before_m: f64,
    bounds: Bounds,
}

impl Map {
    /// Paths from the start of a lane, up to 150 m beyond its end; at most 16. Empty for an unknown lane.
    pub fn paths(&self, from: LaneId) -> &[LanePath] {
        let Some(onward) = self.onward(from) else { return &[] };
        onward.paths.get_or_init(|| {
            let sequences =
                self.sequences(from, |lane| lane.successors.iter().filter_map(|id| self.lane(*id)));
            sequences.iter().map(|lanes| LanePath::over(self, lanes)).collect()
        })
    }

    /// Sequences of lanes from one on. At each lane, all lanes are followed that `onward` returns for it, the first one
    /// first. A sequence ends where there are none, or 150 m beyond its first lane; there are at most 16. Empty for an
    /// unknown lane.
    pub fn sequences<'m, I>(&'m self, from: LaneId, onward: impl Fn(&'m Lane) -> I) -> Vec<Vec<&'m Lane>>
    where
        I: IntoIterator<Item = &'m Lane>,
    {
        let mut open: Vec<Vec<&Lane>> = self.lane(from).map(|first| vec![first]).into_iter().collect();
        let mut found = Vec::new();
        while let Some(lanes) = open.pop().filter(|_| found.len() < PATHS_MAX) {
            let after_m: f64 = lanes[1..].iter().map(|lane| lane.line.length()).sum();
            let is_whole = after_m >= REACH_M || lanes.len() >= LANES_MAX;
            let next: Vec<&Lane> = match lanes.last().copied().filter(|_| !is_whole) {
                Some(last) => onward(last).into_iter().collect(),
                None => Vec::new(),
            };
            let with = |lane: &&'m Lane| lanes.iter().copied().chain([*lane]).collect();
            open.extend(next.iter().rev().map(with));
            if next.is_empty() {
                found.push(lanes);
            }
        }
        found
    }

    /// Successor of a lane with the smallest cost; of equal costs, the one with the smallest identity. Successors
    /// without a cost are ignored.
    pub fn best_successor(&self, lane: &Lane, cost: impl Fn(&Lane) -> Option<f64>) -> Option<&Lane> {
        let nexts = lane.successors.iter().filter_map(|id| self.lane(*id));
        let costs = nexts.filter_map(|next| Some((cost(next)?, next)));
        let best = costs.min_by(|(a, next), (b, other)| a.total_cmp(b).then(next.id.cmp(&other.id)));
        best.map(|(_, next)| next)
    }

    /// Positions of a point on all lanes whose paths a road user there may follow, ordered by identity: those that
    /// contain it or are up to 1 m beside it. Lanes without a predecessor or successor are extended by 150 m, to
    /// negative arc lengths and beyond their length.
    pub fn path_places(&self, point: Point2) -> impl Iterator<Item = LanePlace> {
        let lanes = self.lanes.iter().zip(&self.bounds).zip(self.all_onward());
        lanes.filter_map(move |((lane, bounds), onward)| {
            let place = match &onward.extended {
                Some(extended) => extended.place_of(point),
                None if bounds.has(point, BESIDE_M) => place_along(&lane.line, point),
                None => None,
            };
            let place = place.filter(|place| lane.borders.room_m(*place) >= -BESIDE_M)?;
            Some(LanePlace { lane: lane.id, place })
        })
    }

    /// Pose of the centre line of a lane, extended as by [`path_places`](Self::path_places), beside a place. `None` for
    /// an unknown lane.
    pub fn path_pose(&self, LanePlace { lane, place }: LanePlace) -> Option<Pose2> {
        let extended = self.onward(lane)?.extended.as_ref();
        Some(match extended {
            Some(extended) => extended.line.at(extended.before_m + place.s_m).pose,
            None => self.lane(lane)?.line.at(place.s_m).pose,
        })
    }

    fn onward(&self, lane: LaneId) -> Option<&Onward> {
        self.index(lane).map(|index| &self.all_onward()[index])
    }

    fn all_onward(&self) -> &[Onward] {
        let of = |lane| Onward { extended: Extended::of(self, lane), paths: OnceLock::new() };
        self.paths.0.get_or_init(|| self.lanes.iter().map(of).collect())
    }
}

impl Extended {
    /// `None` for a lane with predecessors and successors.
    fn of(map: &Map, lane: &Lane) -> Option<Self> {
        let mut points = lane.line.points().to_vec();
        let mut before_m = 0.0;
        if map.predecessors(lane.id).is_empty() {
            points.insert(0, beyond(&lane.line, 0.0, END_M));
            before_m = points[0].distance(points[1]);
        }
        if lane.successors.is_empty() {
            let length_m = lane.line.length();
            points.push(beyond(&lane.line, length_m, length_m - END_M));
        }
        let line = Polyline::new(&points).ok().filter(|_| points.len() > lane.line.points().len())?;
        let bounds = Bounds::beside(&line, lane.borders.farthest_m().max(0.0) + BESIDE_M);
        Some(Self { line, before_m, bounds })
    }

    /// Position of a point along the lane, if it is beside it or its extensions.
    fn place_of(&self, point: Point2) -> Option<FrenetPoint> {
        let place = self.bounds.has(point, 0.0).then(|| place_along(&self.line, point))??;
        Some(FrenetPoint { s_m: place.s_m - self.before_m, d_m: place.d_m })
    }
}

/// Position of a point beside a line.
fn place_along(line: &Polyline, point: Point2) -> Option<FrenetPoint> {
    let place = line.project(point);
    (0.0..=line.length()).contains(&place.s_m).then_some(place)
}

/// Extends a line beyond the end at `end_m`, in the direction from `from_m` to it.
fn beyond(line: &Polyline, end_m: f64, from_m: f64) -> Point2 {
    let [end, from] = [end_m, from_m.clamp(0.0, line.length())].map(|s_m| line.at(s_m).pose.point());
    let off = end - from;
    end + off * (BEYOND_M / off.norm().max(1e-6))
}

/// Total turning of a line in either direction, radians.
fn turn(line: &Polyline) -> f64 {
    let headings: Vec<f64> = line.points().windows(2).map(|two| (two[1] - two[0]).heading()).collect();
    headings.windows(2).map(|two| angle_between(two[0], two[1]).abs()).sum()
}

/// Mean curvature of a line around a position, 1/m.
fn bend_1pm(line: &Polyline, s_m: f64) -> f64 {
    let heading_rad = |s_m: f64| line.at(s_m).pose.heading_rad;
    angle_between(heading_rad(s_m - BEND_M), heading_rad(s_m + BEND_M)) / (2.0 * BEND_M)
}

impl LanePath {
    fn over(map: &Map, sequence: &[&Lane]) -> Self {
        let mut points: Vec<Point2> = Vec::new();
        let (mut lanes, mut stop_lines, mut turn_rad, mut begin_m) = (Vec::new(), Vec::new(), 0.0, 0.0);
        for (n, lane) in sequence.iter().enumerate() {
            let extended = map.onward(lane.id).and_then(|onward| onward.extended.as_ref());
            let (line, before_m) =
                extended.map_or((&lane.line, 0.0), |extended| (&extended.line, extended.before_m));
            // At joints, the end of a lane replaces the start of the next.
            points.extend(&line.points()[usize::from(n > 0)..]);
            let of_lane = map.stop_lines_of(lane.id).iter();
            stop_lines.extend(of_lane.map(|stop| (begin_m + before_m + stop.s_m, lane.id)));
            lanes.push((lane.id, begin_m + before_m));
            turn_rad += if n > 0 { turn(&lane.line) } else { 0.0 };
            begin_m += line.length();
        }
        let line = Polyline::new(&points).expect("lanes have lines, which are lines together");
        let curvature = |k: usize| bend_1pm(&line, BEND_M * k as f64);
        let curvatures_1pm = (0..=(line.length() / BEND_M) as usize).map(curvature).collect();
        Self { lanes, line, stop_lines, turn_rad, curvatures_1pm }
    }

    /// Start of a lane along the line, metres; `None` if it is not on the path.
    pub fn begin_m(&self, lane: LaneId) -> Option<f64> {
        self.lanes.iter().find(|(on, _)| *on == lane).map(|(_, begin_m)| *begin_m)
    }

    /// Curvature averaged over 10 m, 1/m; zero beyond the ends.
    pub fn curvature_1pm(&self, s_m: f64) -> f64 {
        let k = (s_m / BEND_M).round();
        if k < 0.0 { 0.0 } else { self.curvatures_1pm.get(k as usize).copied().unwrap_or(0.0) }
    }
}

#[cfg(test)]
mod tests;
