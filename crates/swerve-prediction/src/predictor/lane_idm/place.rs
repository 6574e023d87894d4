//! Positions of vehicles, and the paths that they can follow.

use std::collections::BTreeSet;

use swerve_core::Time;
use swerve_geom::{FrenetPoint, Point2, Polyline, Vector2, angle_between, math};
use swerve_map::{LaneId, LanePath, LanePlace, Map, SignalId};
use swerve_msg::ActorKind;

use crate::past::Past;
use crate::predictor::straight::VELOCITY_WINDOW_S;
use crate::predictor::{Ground, Horizon, Tracked};
use crate::road::{SETTLES_S, Settling, place_of, share_along};

/// Search range along a line beyond twice the straight distance, metres.
const NEAR_M: f64 = 5.0;
/// Largest angle to a lane's direction for following it, and standard deviations of angle and offset from it, radians
/// and metres.
const ALONG_RAD: f64 = 0.6;
const OFF_RAD: f64 = 0.2;
const OFF_M: f64 = 1.0;
/// Distance over which the direction of motion is measured, metres.
const DIRECTION_M: f64 = 1.0;
/// Turning of a path by which its probability falls to 1/e, radians.
const TURN_RAD: f64 = 1.0;
/// Largest number of paths per vehicle, and smallest probability of a path.
const WAYS_MAX: usize = 3;
const WAY_SHARE_MIN: f64 = 0.05;
/// Lower bound of a weight, so that weights can be normalised.
const SHARE_MIN: f64 = 1e-9;
/// Paths are merged if they part farther ahead than the distance covered in this time at the present speed (seconds)
/// plus this distance (metres).
const AHEAD_S: f64 = 6.0;
const AHEAD_M: f64 = 20.0;
/// Speed below which a vehicle is at rest, m/s, and distance before a stop line within which it is waiting there,
/// metres.
const STANDS_MPS: f64 = 0.5;
const AT_LINE_M: f64 = 15.0;

/// Position of a vehicle, and the paths that it can follow.
pub(super) struct Position<'a> {
    pub(super) point: Point2,
    pub(super) velocity_mps: Vector2,
    /// Positions on all lanes; a road without a map is one lane.
    pub(super) spots: Vec<LanePlace>,
    /// Paths with their probabilities, which sum to 1; the likeliest first, never empty.
    pub(super) ways: Vec<(f64, Along<'a>)>,
}

/// A path of a vehicle.
#[derive(Clone)]
pub(super) enum Along<'a> {
    /// Straight ahead from a point, in a direction of length 1.
    Straight(Point2, Vector2),
    /// Along a line.
    Line(OnLine<'a>),
}

/// A path along a line.
#[derive(Clone)]
pub(super) struct OnLine<'a> {
    pub(super) line: &'a Polyline,
    /// The path over a lane map, of which this is the line.
    way: Option<&'a LanePath>,
    pub(super) at: FrenetPoint,
    /// Distance along the line per metre of the path; negative against the line.
    pub(super) sense: f64,
    /// Lateral speed to the left, m/s.
    across_mps: f64,
    /// Lateral settling of an oncoming vehicle that strays; `None`: that of a lane change.
    stray: Option<Settling>,
    /// Next stop line: distance ahead, metres, and its lane.
    stop: Option<(f64, LaneId)>,
}

impl<'a> Position<'a> {
    pub(super) fn of(seen: &Tracked, stamp: Time, ground: Ground<'a>) -> Self {
        let velocity_mps = seen.past.velocity_mps(VELOCITY_WINDOW_S);
        let point = seen.past.now(stamp, velocity_mps);
        let (spots, mut ways) = match ground {
            Ground::Open => (Vec::new(), Vec::new()),
            Ground::Road(route) => {
                let at = place_of(route, point, velocity_mps);
                let on_road = |share: f64| {
                    let heading: Vector2 = route.line().at(at.s_m).pose.direction();
                    let sense = if heading.dot(velocity_mps) < 0.0 { -1.0 } else { 1.0 };
                    let across_mps =
                        across_mps(&seen.past, route.line(), at).unwrap_or(heading.cross(velocity_mps));
                    let line = route.line();
                    let along_mps = heading.dot(velocity_mps);
                    let stray =
                        Settling::of_stray(route, at, seen.track.extent.width_m, [along_mps, across_mps]);
                    let on =
                        OnLine { line, way: None, at, sense: sense / share, across_mps, stray, stop: None };
                    (1.0, Along::Line(on))
                };
                let along = share_along(route, at, velocity_mps).map(on_road);
                (vec![LanePlace { lane: LaneId(0), place: at }], along.into_iter().collect())
            }
            Ground::Lanes(map) => {
                let spots: Vec<LanePlace> = map.path_places(point).collect();
                let ways = ways(&seen.past, velocity_mps, &spots, map);
                (spots, ways)
            }
        };
        if ways.is_empty() {
            let speed_mps = velocity_mps.norm().max(1e-9);
            ways.push((1.0, Along::Straight(point, velocity_mps * (1.0 / speed_mps))));
        }
        Self { point, velocity_mps, spots, ways }
    }
}

/// Mean lateral speed to the left of the line over the last half second, m/s, in the line's coordinates: in a bend,
/// the velocity itself has a spurious lateral component.
fn across_mps(past: &Past, line: &Polyline, at: FrenetPoint) -> Option<f64> {
    let (before, last) = (past.before(VELOCITY_WINDOW_S)?, past.last());
    let near_m = 2.0 * before.point.distance(last.point) + NEAR_M;
    let d_m = |point| line.project_near(point, at.s_m, near_m).d_m;
    Some((d_m(last.point) - d_m(before.point)) / (last.at - before.at).as_secs())
}

/// Direction of the last motion, radians; `None` without motion.
fn heading_rad(past: &Past) -> Option<f64> {
    let now = past.last().point;
    let before = past.sightings.iter().rev().find(|one| one.point.distance(now) > DIRECTION_M)?;
    Some((now - before.point).heading())
}

/// Paths over a lane map for a vehicle at these positions.
fn ways<'a>(past: &Past, velocity_mps: Vector2, spots: &[LanePlace], map: &'a Map) -> Vec<(f64, Along<'a>)> {
    let heading_rad = heading_rad(past);
    let ahead_m = velocity_mps.norm() * AHEAD_S + AHEAD_M;
    // Share, position along the path, and the path.
    let mut found: Vec<(f64, FrenetPoint, &LanePath)> = Vec::new();
    for spot in spots {
        let is_drivable = map.lane(spot.lane).is_some_and(|lane| lane.kind.is_drivable());
        let Some(pose) = map.path_pose(*spot).filter(|_| is_drivable) else { continue };
        let off_rad = heading_rad.map_or(0.0, |own| angle_between(pose.heading_rad, own));
        if off_rad.abs() > ALONG_RAD {
            continue;
        }
        let (rad, m) = (off_rad / OFF_RAD, spot.place.d_m / OFF_M);
        let weight = math::exp(-0.5 * (rad * rad + m * m)).max(SHARE_MIN);
        let paths = map.paths(spot.lane);
        let likely = |path: &LanePath| math::exp(-path.turn_rad / TURN_RAD).max(SHARE_MIN);
        let sum: f64 = paths.iter().map(likely).sum();
        // Only paths from the same lane are merged.
        let of_lane = found.len();
        for path in paths {
            let share = weight * likely(path) / sum;
            let begin_m = path.begin_m(spot.lane).unwrap_or(0.0);
            let at = FrenetPoint { s_m: begin_m + spot.place.s_m, d_m: spot.place.d_m };
            let parts = |other: &LanePath| {
                let both = path.lanes.iter().zip(&other.lanes);
                both.filter(|(a, b)| a.0 != b.0).map(|(a, _)| a.1 - at.s_m).next()
            };
            let same = |(.., other): &&mut (f64, FrenetPoint, &LanePath)| {
                parts(other).is_none_or(|parts_m| parts_m > ahead_m)
            };
            match found[of_lane..].iter_mut().find(same) {
                Some((sum, ..)) => *sum += share,
                None => found.push((share, at, path)),
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(WAYS_MAX);
    let all: f64 = found.iter().map(|(share, ..)| share).sum();
    found.retain(|(share, ..)| *share >= WAY_SHARE_MIN * all);
    let all: f64 = found.iter().map(|(share, ..)| share).sum();
    let way = |(share, at, path): (f64, FrenetPoint, &'a LanePath)| {
        let across_mps = across_mps(past, &path.line, at).unwrap_or(0.0);
        let next = path.stop_lines.iter().find(|(stop_m, _)| *stop_m > at.s_m);
        let stop = next.map(|(stop_m, lane)| (stop_m - at.s_m, *lane));
        let line = &path.line;
        let on = OnLine { line, way: Some(path), at, sense: 1.0, across_mps, stray: None, stop };
        (share / all, Along::Line(on))
    };
    found.into_iter().map(way).collect()
}

/// For each step of a horizon: the time ahead, seconds, and the completed share of the lateral motion of a lane
/// change.
pub(super) fn settled(horizon: &Horizon) -> Vec<[f64; 2]> {
    let step_s = horizon.step.as_secs();
    let at = |ahead_s: f64| [ahead_s, 1.0 - math::exp(-ahead_s / SETTLES_S)];
    (0..=horizon.steps).map(|k| at(step_s * k as f64)).collect()
}

impl Along<'_> {
    /// Distance of `other` ahead along the path, and its lateral offset, metres; `None` if it is on other lanes.
    pub(super) fn ahead_of(&self, other: &Position<'_>) -> Option<(f64, f64)> {
        match self {
            Self::Straight(from, unit) => {
                let off: Vector2 = other.point - *from;
                Some((unit.dot(off), unit.cross(off)))
            }
            Self::Line(OnLine { way, at, sense, .. }) => {
                let on = |LanePlace { lane, place }: &LanePlace| {
                    let begin_m = match way {
                        Some(way) => way.begin_m(*lane)?,
                        None => 0.0,
                    };
                    Some(((begin_m + place.s_m - at.s_m) / sense, place.d_m - at.d_m))
                };
                let ahead = other.spots.iter().filter_map(on).filter(|(ahead_m, _)| *ahead_m > 0.0);
                ahead.min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
            }
        }
    }

    /// Position after `on_m`, at a step of [`settled`].
    pub(super) fn at(&self, on_m: f64, [ahead_s, settled]: [f64; 2]) -> Point2 {
        match self {
            Self::Line(OnLine { line, at, sense, across_mps, stray, .. }) => {
                let beside_m = match stray {
                    Some(stray) => stray.moved_m(across_mps * ahead_s, ahead_s),
                    None => across_mps * SETTLES_S * settled,
                };
                line.to_map(FrenetPoint { s_m: at.s_m + sense * on_m, d_m: at.d_m + beside_m })
            }
            Self::Straight(from, unit) => *from + *unit * on_m,
        }
    }

    /// Curvature `on_m` ahead, 1/m.
    pub(super) fn curvature_1pm(&self, on_m: f64) -> f64 {
        match self {
            Self::Line(OnLine { line, way, at, sense, .. }) => {
                let s_m = at.s_m + sense * on_m;
                way.map_or_else(|| line.at(s_m).curvature_1pm, |way| way.curvature_1pm(s_m))
            }
            Self::Straight(..) => 0.0,
        }
    }

    /// Next stop line: distance ahead, metres, and its lane.
    pub(super) fn stop(&self) -> Option<(f64, LaneId)> {
        match self {
            Self::Line(on) => on.stop,
            Self::Straight(..) => None,
        }
    }
}

/// Lanes with a vehicle waiting at their stop line, and all lanes with the same signals: these are presumed red.
pub(super) fn held_up(places: &[Position<'_>], seen: &[Tracked], ground: Ground<'_>) -> BTreeSet<LaneId> {
    let Ground::Lanes(map) = ground else { return BTreeSet::new() };
    let mut red = BTreeSet::new();
    for (place, one) in places.iter().zip(seen).filter(|(_, one)| !walks(one)) {
        let Some((stop_m, lane)) = place.ways[0].1.stop() else { continue };
        let front_m = stop_m - 0.5 * one.track.extent.length_m;
        if place.velocity_mps.norm() < STANDS_MPS && front_m < AT_LINE_M {
            red.insert(lane);
        }
    }
    let signals = |lane: LaneId| -> Vec<SignalId> {
        map.stop_lines_of(lane).iter().flat_map(|line| line.signals.iter().copied()).collect()
    };
    let waited: BTreeSet<Vec<SignalId>> = red.iter().map(|lane| signals(*lane)).collect();
    if waited.iter().any(|signals| !signals.is_empty()) {
        let same = map.stop_lines().iter().map(|line| line.lane).filter(|lane| {
            let signals = signals(*lane);
            !signals.is_empty() && waited.contains(&signals)
        });
        red.extend(same);
    }
    red
}

pub(super) fn walks(seen: &Tracked) -> bool {
    matches!(seen.past.kind, ActorKind::Pedestrian | ActorKind::Static)
}
