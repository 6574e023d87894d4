//! Paths of pedestrians: pavements and crossings, and where they meet.

use swerve_geom::{FrenetPoint, Point2, Polyline, Vector2};
use swerve_map::{Crossing, Lane, LaneKind, Map};

use crate::net::Net;

/// Narrowest pavement, metres.
const WIDTH_MIN_M: f64 = 0.8;
/// Distance beyond the border of the road of paths on maps without pavements, and half their width, metres.
const BESIDE_M: f64 = 1.5;
const BESIDE_HALF_M: f64 = 0.8;
/// Interval of vertices of such paths, metres.
const STEP_M: f64 = 4.0;
/// Distance across which ends of paths are joined, and to which crossings are extended to pavements, metres.
const JOINT_M: f64 = 2.5;
const KERB_M: f64 = 6.0;
/// The same for the ends of crossings, which are on pavements.
const CROSSING_JOINT_M: f64 = 0.5;
/// Half of the width of a crossing that is used at most, metres.
const CROSSING_HALF_M: f64 = 1.5;

/// A way from one path to another.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Joint {
    /// Along the path, metres.
    pub(crate) s_m: f64,
    /// The other path, and the place on it.
    pub(crate) to: usize,
    pub(crate) to_m: f64,
}

/// A pavement or a crossing.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    pub(crate) line: Polyline,
    pub(crate) half_m: f64,
    /// Index of the crossing of the map.
    pub(crate) crossing: Option<usize>,
    pub(crate) joints: Vec<Joint>,
}

/// Paths of a map: its walking lanes, or, without any, paths beside its roads; and its crossings.
pub(super) fn paths(map: &Map, net: &Net) -> Vec<Path> {
    let new = |line: Polyline, half_m: f64| Path { line, half_m, crossing: None, joints: Vec::new() };
    let pavements = map.lanes().iter().filter(|lane| lane.kind == LaneKind::Walking);
    let mut paths: Vec<Path> = Vec::new();
    for lane in pavements {
        let middle = centred(lane);
        let half_m = 0.5 * lane.width_m(0.5 * lane.line.length());
        if let Some(line) =
            middle.filter(|_| 2.0 * half_m >= WIDTH_MIN_M).and_then(|line| off_road(net, &line))
        {
            paths.push(new(line, half_m));
        }
    }
    if paths.is_empty() {
        let outer = map.lanes().iter().filter(|lane| {
            lane.kind == LaneKind::Driving && lane.right.is_none() && !map.is_in_junction(lane.id)
        });
        for lane in outer {
            if let Some(line) = beside(lane).and_then(|line| off_road(net, &line)) {
                paths.push(new(line, BESIDE_HALF_M));
            }
        }
    }
    for (k, crossing) in map.crossings().iter().enumerate() {
        if let Some((line, half_m)) = across(net, k, crossing) {
            let line = to_pavements(&line, &paths).unwrap_or(line);
            paths.push(Path { crossing: Some(k), ..new(line, half_m.min(CROSSING_HALF_M)) });
        }
    }
    join(&mut paths);
    paths
}

/// The middle of a lane, whose line may be elsewhere.
fn centred(lane: &Lane) -> Option<Polyline> {
    let steps = (lane.line.length() / STEP_M).ceil().max(1.0);
    let points = (0..=steps as usize).map(|k| {
        let s_m = lane.line.length() * k as f64 / steps;
        let d_m = 0.5 * (lane.borders.left_m(s_m) - lane.borders.right_m(s_m));
        lane.line.to_map(FrenetPoint { s_m, d_m })
    });
    Polyline::new(&points.collect::<Vec<_>>()).ok()
}

/// A line to the right of the road.
fn beside(lane: &Lane) -> Option<Polyline> {
    let steps = (lane.line.length() / STEP_M).ceil().max(1.0);
    let points = (0..=steps as usize).map(|k| {
        let s_m = lane.line.length() * k as f64 / steps;
        lane.line.to_map(FrenetPoint { s_m, d_m: -lane.borders.right_m(s_m) - BESIDE_M })
    });
    Polyline::new(&points.collect::<Vec<_>>()).ok()
}

/// The longest stretch of a line that is not on lanes of vehicles.
fn off_road(net: &Net, line: &Polyline) -> Option<Polyline> {
    let is_clear = |point: Point2| {
        net.lanes.iter().all(|lane| {
            let reach_m = 0.5 * lane.width_m.min(3.0) + 0.3;
            let [low, high] = lane.bounds;
            let is_apart =
                |low: f64, high: f64, at: f64| at < low - 2.0 * reach_m || at > high + 2.0 * reach_m;
            if is_apart(low.x_m, high.x_m, point.x_m) || is_apart(low.y_m, high.y_m, point.y_m) {
                return true;
            }
            let place = lane.line.project(point);
            let along = (0.0..=lane.length_m).contains(&place.s_m);
            !along || place.d_m.abs() > reach_m
        })
    };
    let steps = (line.length() / (0.5 * STEP_M)).ceil().max(1.0) as usize;
    let points: Vec<Point2> =
        (0..=steps).map(|k| line.at(line.length() * k as f64 / steps as f64).pose.point()).collect();
    let clear: Vec<bool> = points.iter().map(|point| is_clear(*point)).collect();
    let (mut longest, mut begin) = (0..0, 0);
    for k in 0..=clear.len() {
        if k == clear.len() || !clear[k] {
            if k - begin > longest.len() {
                longest = begin..k;
            }
            begin = k + 1;
        }
    }
    Polyline::new(&points[longest]).ok().filter(|line| line.length() > STEP_M)
}

/// Line over a crossing, across the lanes that it covers, and half of its width, metres.
fn across(net: &Net, k: usize, crossing: &Crossing) -> Option<(Polyline, f64)> {
    let covers = |lane: &&crate::net::NetLane| lane.crossings.iter().any(|(other, _)| *other == k);
    let lane = net.lanes.iter().find(covers)?;
    let part = lane.crossings.iter().find(|(other, _)| *other == k)?.1;
    let ahead = lane.line.at(0.5 * (part[0] + part[1])).pose.direction();
    let count = crossing.outline.len() as f64;
    let sum = crossing.outline.iter().fold((0.0, 0.0), |(x, y), p| (x + p.x_m, y + p.y_m));
    let middle = Point2::new(sum.0 / count, sum.1 / count);
    let reach = |axis: Vector2| {
        let along = crossing.outline.iter().map(|corner| (*corner - middle).dot(axis));
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), m| (low.min(m), high.max(m)))
    };
    let (from_m, to_m) = reach(ahead.left());
    let (back_m, front_m) = reach(ahead);
    let points = [middle + ahead.left() * from_m, middle + ahead.left() * to_m];
    Some((Polyline::new(&points).ok()?, 0.5 * (front_m - back_m)))
}

/// A line over a crossing, extended to the middle of the pavements at its ends.
fn to_pavements(line: &Polyline, paths: &[Path]) -> Option<Polyline> {
    let nearest = |end: Point2| {
        let pavements = paths.iter().filter(|path| path.crossing.is_none());
        let points = pavements.map(|path| {
            let s_m = path.line.project(end).s_m.clamp(0.0, path.line.length());
            path.line.at(s_m).pose.point()
        });
        let near = points.map(|point| (point.distance(end), point)).filter(|(m, _)| *m < KERB_M);
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, point)| point)
    };
    let (begin, end) = (line.points()[0], line.points()[line.points().len() - 1]);
    let points = nearest(begin).into_iter().chain(line.points().iter().copied()).chain(nearest(end));
    Polyline::new(&points.collect::<Vec<_>>()).ok()
}

/// Joins ends with the paths that they touch.
fn join(paths: &mut [Path]) {
    for k in 0..paths.len() {
        let reach_m = if paths[k].crossing.is_some() { CROSSING_JOINT_M } else { JOINT_M };
        for s_m in [0.0, paths[k].line.length()] {
            let end = paths[k].line.at(s_m).pose.point();
            for other in 0..paths.len() {
                let both_cross = paths[k].crossing.is_some() && paths[other].crossing.is_some();
                if other == k || both_cross {
                    continue;
                }
                let length_m = paths[other].line.length();
                let to_m = paths[other].line.project(end).s_m.clamp(0.0, length_m);
                if paths[other].line.at(to_m).pose.point().distance(end) > reach_m {
                    continue;
                }
                let [there, back] = [Joint { s_m, to: other, to_m }, Joint { s_m: to_m, to: k, to_m: s_m }];
                for (path, joint) in [(k, there), (other, back)] {
                    let is_known =
                        |known: &Joint| known.to == joint.to && (known.s_m - joint.s_m).abs() < 1.0;
                    if !paths[path].joints.iter().any(is_known) {
                        paths[path].joints.push(joint);
                    }
                }
            }
        }
    }
    for path in paths {
        path.joints.sort_by(|a, b| a.s_m.total_cmp(&b.s_m).then(a.to.cmp(&b.to)));
    }
}
