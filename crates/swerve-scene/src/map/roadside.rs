//! Places beside the road: of signs, and of traffic lights.

use swerve_geom::{Point2, Pose2};
use swerve_map::{Lane, LaneKind, Map, Side, Signal, SignalId, StopLine, StopSign};

use super::ground::MapGround;
use super::side::{is_road, neighbour, outwards, sign};
use super::station::Station;

/// Distance of posts from the road, metres.
const ASIDE_M: f64 = 0.6;
/// Distance by which a post is moved if its place is taken, and number of places that are tried.
const MOVED_M: f64 = 0.5;
const TRIED: u32 = 8;
/// Least distance of two posts, metres.
const APART_M: f64 = 0.45;

/// Place of a mast for a traffic light.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SignalMast {
    /// The signal.
    pub signal: SignalId,
    /// Foot of the mast, and the direction in which the light shines, as of [`crate::Kind::TrafficLight`].
    pub pose: Pose2,
    /// Height of the ground, metres.
    pub height_m: f64,
}

/// Masts for all signals of a map, in the order of the signals. Where the position of a signal is on a lane for vehicles,
/// the mast is beside the road at the stop line.
pub fn signal_masts(map: &Map) -> Vec<SignalMast> {
    let ground = MapGround::new(map);
    let mut taken = Vec::new();
    let mut mast = |signal: &Signal| {
        let Pose2 { x_m, y_m, .. } = signal_place(&ground, signal, &taken);
        let pose = Pose2::new(x_m, y_m, signal.heading_rad);
        taken.push(pose.point());
        SignalMast { signal: signal.id, pose, height_m: ground.height_m(pose.point()) }
    };
    map.signals().iter().map(&mut mast).collect()
}

fn signal_place(ground: &MapGround<'_>, signal: &Signal, taken: &[Point2]) -> Pose2 {
    let given = Pose2::new(signal.position.x_m, signal.position.y_m, signal.heading_rad);
    if !ground.is_road(given.point()) && is_free(taken, given.point()) {
        return given;
    }
    let lanes = signal.lanes.iter().filter_map(|id| ground.map.lane(*id));
    let Some(lane) = lanes.min_by_key(|lane| lane.kind != LaneKind::Driving) else { return given };
    let stops = ground.map.stop_lines_of(lane.id).iter();
    let stop = stops.filter(|line| line.signals.contains(&signal.id)).map(|line| line.s_m).next();
    let s_m = stop.unwrap_or_else(|| lane.line.project(signal.position).s_m);
    beside_road(ground, lane, s_m.clamp(0.0, lane.line.length()), taken).unwrap_or(given)
}

/// Places of signs for stop lines, facing their traffic.
pub(super) fn signs(ground: &MapGround<'_>) -> Vec<(StopSign, Pose2)> {
    let mut taken: Vec<Point2> = Vec::new();
    let mut place = |line: &StopLine| {
        let sign = line.sign?;
        let lane = ground.map.lane(line.lane).filter(|lane| lane.kind == LaneKind::Driving)?;
        let at = beside_road(ground, lane, line.s_m, &[])?;
        // Stop lines of lanes that begin at one place have one sign.
        is_free(&taken, at.point()).then(|| {
            taken.push(at.point());
            (sign, Pose2::new(at.x_m, at.y_m, at.heading_rad + core::f64::consts::PI))
        })
    };
    ground.map.stop_lines().iter().filter_map(&mut place).collect()
}

/// Pose beside the road of a lane, in its direction: at the kerb side, off all roads and places that are taken.
fn beside_road(ground: &MapGround<'_>, lane: &Lane, s_m: f64, taken: &[Point2]) -> Option<Pose2> {
    let is_along = |side| neighbour(lane, side).is_none_or(|beside| !beside.opposite);
    let kerb = if is_along(Side::Right) { Side::Right } else { Side::Left };
    let station = Station::new(lane, s_m);
    let heading_rad = lane.line.at(s_m).pose.heading_rad;
    let edge_m = station.border_m(kerb) + sign(kerb) * road_beyond_m(ground, lane, kerb, s_m);
    (0..TRIED).find_map(|k| {
        let out_m = ASIDE_M + MOVED_M * f64::from(k);
        let at = station.at(edge_m + sign(kerb) * out_m);
        let is_good = !ground.is_road(at) && is_free(taken, at);
        is_good.then(|| Pose2::new(at.x_m, at.y_m, heading_rad))
    })
}

/// Width of the lanes with asphalt beyond a border that run in the lane's direction, metres.
fn road_beyond_m(ground: &MapGround<'_>, lane: &Lane, side: Side, s_m: f64) -> f64 {
    let share = s_m / lane.line.length();
    let beyond =
        outwards(ground.map, lane, side).take_while(|(next, is_along)| *is_along && is_road(next.kind));
    beyond.map(|(next, _)| next.width_m(share * next.line.length())).sum()
}

fn is_free(taken: &[Point2], at: Point2) -> bool {
    taken.iter().all(|other| other.distance(at) > APART_M)
}
