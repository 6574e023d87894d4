//! Lane graph for predictors: a map, and the lane sequences that start at each lane.

use std::collections::BTreeMap;

use swerve_geom::{FrenetPoint, Point2, Polyline, Pose2, angle_between};
use swerve_map::{Lane, LaneId, Map, SignalId};

/// Distance ahead up to which lane sequences are followed, metres: beyond the travel of any vehicle within a horizon.
const REACH_M: f64 = 150.0;
/// Largest number of lanes in a sequence, and of sequences from one lane; both bound cyclic maps.
const LANES_MAX: usize = 32;
const WAYS_MAX: usize = 16;
/// Lanes without a successor or predecessor are extended by this, metres, because maps end where the road does not.
const BEYOND_M: f64 = 150.0;
/// The direction of an extension is that of this last part of the lane, metres, because hand-drawn ends are
/// inaccurate.
const END_M: f64 = 20.0;
/// Lateral tolerance for a position to be on a lane, metres.
const BESIDE_M: f64 = 1.0;

/// Half of the length over which curvature is averaged, metres, because hand-drawn bounds are inaccurate.
const BEND_M: f64 = 5.0;

/// Lanes of a map, and the sequences over them.
#[derive(Clone, PartialEq, Debug)]
pub struct LaneGraph {
    map: Map,
    /// Extended lanes, by lane index in the map.
    reaches: Vec<Reach>,
    /// Lane sequences from each lane, by lane index in the map.
    ways: Vec<Vec<LaneWay>>,
}

/// A lane with its extensions.
#[derive(Clone, PartialEq, Debug)]
struct Reach {
    /// Centre line with extensions.
    line: Polyline,
    /// Length of the extension before the lane, metres.
    before_m: f64,
    /// Bounding box.
    low: Point2,
    high: Point2,
}

/// A sequence of lanes as one line.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct LaneWay {
    /// Lane indices in the map, and the start of each along the line, metres.
    pub(crate) lanes: Vec<(usize, f64)>,
    pub(crate) line: Polyline,
    /// Stop lines: position along the line, metres, and index of the lane in the map.
    pub(crate) stops: Vec<(f64, usize)>,
    /// Total turning on the lanes after the first, radians.
    pub(crate) turn_rad: f64,
    /// Curvature at intervals of [`BEND_M`], 1/m.
    curvatures_1pm: Vec<f64>,
}

/// A position on a lane, along its extended line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Spot {
    /// Index of the lane in the map.
    pub(crate) lane: usize,
    pub(crate) at: FrenetPoint,
}

impl LaneGraph {
    /// Builds the sequences over the lanes of a map.
    pub fn new(map: Map) -> Self {
        let place: BTreeMap<LaneId, usize> =
            map.lanes().iter().enumerate().map(|(k, lane)| (lane.id, k)).collect();
        let reaches: Vec<Reach> = map.lanes().iter().map(|lane| Reach::of(&map, lane)).collect();
        let way = |first| {
            let chains = chains(&map, &place, first);
            chains.iter().map(|lanes| LaneWay::over(lanes, &map, &reaches)).collect()
        };
        let ways = (0..map.lanes().len()).map(way).collect();
        Self { map, reaches, ways }
    }

    /// The map.
    pub fn map(&self) -> &Map {
        &self.map
    }

    pub(crate) fn ways(&self, lane: usize) -> &[LaneWay] {
        &self.ways[lane]
    }

    /// Identities of the traffic signals of a lane's stop lines.
    pub(crate) fn signals(&self, lane: usize) -> impl Iterator<Item = SignalId> {
        let lines = self.map.stop_lines_of(self.map.lanes()[lane].id);
        lines.iter().flat_map(|line| line.signals.iter().copied())
    }

    /// Positions of a point on all lanes that contain it, within the lateral tolerance.
    pub(crate) fn spots(&self, point: Point2) -> Vec<Spot> {
        let near = self.map.lanes().iter().zip(&self.reaches).enumerate();
        near.filter(|(_, (_, reach))| reach.has(point))
            .filter_map(|(k, (lane, reach))| {
                let at = reach.line.project(point);
                let on_lane = FrenetPoint { s_m: at.s_m - reach.before_m, d_m: at.d_m };
                let is_on = (0.0..=reach.line.length()).contains(&at.s_m)
                    && lane.borders.room_m(on_lane) >= -BESIDE_M;
                is_on.then_some(Spot { lane: k, at })
            })
            .collect()
    }

    /// Pose of the lane's line at a position.
    pub(crate) fn pose(&self, spot: &Spot) -> Pose2 {
        self.reaches[spot.lane].line.at(spot.at.s_m).pose
    }

    /// Returns true if a position is between the ends of its lane.
    pub(crate) fn is_between_ends(&self, spot: &Spot) -> bool {
        let s_m = spot.at.s_m - self.reaches[spot.lane].before_m;
        (0.0..=self.map.lanes()[spot.lane].line.length()).contains(&s_m)
    }
}

impl Reach {
    fn of(map: &Map, lane: &Lane) -> Self {
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
        let beside_m = lane.borders.farthest_m().max(0.0) + BESIDE_M;
        let (mut low, mut high) = (points[0], points[0]);
        for at in &points {
            low = Point2::new(low.x_m.min(at.x_m), low.y_m.min(at.y_m));
            high = Point2::new(high.x_m.max(at.x_m), high.y_m.max(at.y_m));
        }
        Self {
            line: Polyline::new(&points).expect("a line with more points is one"),
            before_m,
            low: Point2::new(low.x_m - beside_m, low.y_m - beside_m),
            high: Point2::new(high.x_m + beside_m, high.y_m + beside_m),
        }
    }

    fn has(&self, point: Point2) -> bool {
        (self.low.x_m..=self.high.x_m).contains(&point.x_m)
            && (self.low.y_m..=self.high.y_m).contains(&point.y_m)
    }
}

/// Extends a line beyond the end at `end_m`, in the direction from `from_m` to it.
fn beyond(line: &Polyline, end_m: f64, from_m: f64) -> Point2 {
    let [end, from] = [end_m, from_m.clamp(0.0, line.length())].map(|s_m| line.at(s_m).pose.point());
    let off = end - from;
    end + off * (BEYOND_M / off.norm().max(1e-6))
}

/// All lane sequences from one lane, up to the limits.
fn chains(map: &Map, place: &BTreeMap<LaneId, usize>, first: usize) -> Vec<Vec<usize>> {
    let (mut open, mut found) = (vec![vec![first]], Vec::new());
    while let Some(lanes) = open.pop().filter(|_| found.len() < WAYS_MAX) {
        let after_m: f64 = lanes[1..].iter().map(|k| map.lanes()[*k].line.length()).sum();
        let next = &map.lanes()[lanes[lanes.len() - 1]].successors;
        if next.is_empty() || after_m >= REACH_M || lanes.len() >= LANES_MAX {
            found.push(lanes);
        } else {
            // The first successor is followed first.
            let on = |id: &LaneId| lanes.iter().copied().chain([place[id]]).collect();
            open.extend(next.iter().rev().map(on));
        }
    }
    found
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

impl LaneWay {
    fn over(chain: &[usize], map: &Map, reaches: &[Reach]) -> Self {
        let mut points: Vec<Point2> = Vec::new();
        let (mut lanes, mut lines, mut turn_rad, mut begin_m) = (Vec::new(), Vec::new(), 0.0, 0.0);
        for (n, &k) in chain.iter().enumerate() {
            let (lane, reach) = (&map.lanes()[k], &reaches[k]);
            // At joints, the end of a lane replaces the start of the next.
            points.extend(&reach.line.points()[usize::from(n > 0)..]);
            let of_lane = map.stop_lines_of(lane.id).iter();
            lines.extend(of_lane.map(|stop| (begin_m + reach.before_m + stop.s_m, k)));
            lanes.push((k, begin_m));
            turn_rad += if n > 0 { turn(&lane.line) } else { 0.0 };
            begin_m += reach.line.length();
        }
        let line = Polyline::new(&points).expect("lanes have lines, which are lines together");
        let curvature = |k: usize| bend_1pm(&line, BEND_M * k as f64);
        let curvatures_1pm = (0..=(line.length() / BEND_M) as usize).map(curvature).collect();
        Self { lanes, line, stops: lines, turn_rad, curvatures_1pm }
    }

    /// Curvature, 1/m; zero beyond the ends.
    pub(crate) fn curvature_1pm(&self, s_m: f64) -> f64 {
        let k = (s_m / BEND_M).round();
        if k < 0.0 { 0.0 } else { self.curvatures_1pm.get(k as usize).copied().unwrap_or(0.0) }
    }
}

#[cfg(test)]
mod tests;
