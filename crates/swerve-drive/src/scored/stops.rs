//! Red lights and stop signs near the ego.

use swerve_core::Time;
use swerve_eval::score::{Ego, RedLight, StopSign};
use swerve_geom::Pose2;
use swerve_map::{Lane, LaneId, LaneKind, Map, Signal, StopSign as Sign};
use swerve_msg::{Route, Signal as Shown};
use swerve_scenario::TrafficLight;

use super::lanes::Lanes;

/// Distance before the end of a lane of the line of a light without one, metres.
const BEFORE_END_M: f64 = 1.0;
/// Distance of lines that are looked at, metres: the largest of the Leaderboard's rules, that of stop signs.
const NEAR_M: f64 = 60.0;
/// Length of the area before a stop sign's line in which it has effect, metres.
const SIGN_AREA_M: f64 = 4.0;
/// Distance behind the tail of the point whose lane must be that of the line, metres.
const TAIL_M: f64 = 1.0;

/// Stop lines of a map.
#[derive(Debug)]
pub(super) struct Stops {
    lights: Vec<TrafficLight>,
    red: Vec<LightLine>,
    signs: Vec<SignLine>,
}

/// A stop line with the lights that hold its traffic.
#[derive(Debug)]
struct LightLine {
    lane: LaneId,
    line: Pose2,
    width_m: f64,
    /// Indices of the lights.
    lights: Vec<usize>,
}

/// A stop line with a stop sign.
#[derive(Debug)]
struct SignLine {
    lane: LaneId,
    line: Pose2,
    /// Position along the route, metres; `None` for other traffic.
    route_s_m: Option<f64>,
}

impl Stops {
    pub(super) fn new(map: &Map, lights: &[TrafficLight], route: &Route) -> Self {
        let of_cars = || {
            let lanes = map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving);
            lanes.filter(|lane| !map.is_in_junction(lane.id))
        };
        let red = of_cars().flat_map(|lane| light_lines(map, lane, lights, route)).collect();
        let signs = of_cars().flat_map(|lane| {
            let lines = map.stop_lines_of(lane.id).iter().filter(|line| line.sign == Some(Sign::Stop));
            let stretch = route.stretches().iter().find(|stretch| stretch.lane == lane.id);
            lines.map(move |line| {
                let at = lane.line.at(line.s_m).pose;
                // After a change of lanes, the stretch begins on the way along the lane.
                let near = |s_m| route.project_near(at.point(), s_m, lane.line.length()).s_m;
                let route_s_m = stretch.map(|stretch| near(stretch.begin_m + line.s_m));
                SignLine { lane: lane.id, line: at, route_s_m }
            })
        });
        Self { lights: lights.to_vec(), red, signs: signs.collect() }
    }

    /// Lights near the ego that are red at an instant.
    pub(super) fn red_lights(&self, at: Time, ego: &Ego, lanes: &Lanes) -> Vec<RedLight> {
        let tail = ego.center.ahead(-ego.half_length_m - TAIL_M);
        let behind = lanes.nearest(tail).map(|(lane, _)| lane);
        let is_own = |line: &LightLine| {
            behind.is_some_and(|lane| lane.id == line.lane || lane.successors.contains(&line.lane))
        };
        let is_near = |line: &&LightLine| line.line.point().distance(ego.center.point()) <= NEAR_M;
        let is_red = |light: &&usize| self.lights[**light].signal(at) == Shown::Red;
        let light = |line: &LightLine| {
            let id = *line.lights.iter().find(is_red)?;
            Some(RedLight {
                id: id as u64,
                center: line.line.point(),
                line: line.line,
                lane_width_m: line.width_m,
                is_own_lane: is_own(line),
            })
        };
        self.red.iter().filter(is_near).filter_map(light).collect()
    }

    /// Stop signs of the ego's route near a pose at `s_m` along the route.
    pub(super) fn signs(&self, center: Pose2, s_m: f64) -> Vec<StopSign> {
        let sign = |line: &SignLine| {
            let away_m = line.line.point().distance(center.point());
            let to_m = line.route_s_m.filter(|_| away_m <= NEAR_M)? - s_m;
            let from_m = to_m - SIGN_AREA_M;
            let middle = line.line.ahead(-0.5 * SIGN_AREA_M).point();
            let distance_m = middle.distance(center.point());
            Some(StopSign { id: u64::from(line.lane.0), from_m, to_m, distance_m })
        };
        self.signs.iter().filter_map(sign).collect()
    }
}

/// Stop lines of a lane with the lights that hold its traffic.
fn light_lines(map: &Map, lane: &Lane, lights: &[TrafficLight], route: &Route) -> Vec<LightLine> {
    let stretches = route.stretches();
    let on_route = stretches.iter().position(|stretch| stretch.lane == lane.id);
    let next = on_route.and_then(|k| stretches.get(k + 1)).map(|next| next.lane);
    let mut found: Vec<LightLine> = Vec::new();
    for (k, light) in lights.iter().enumerate() {
        let Some(signal) = light.signal.and_then(|id| map.signal(id)) else { continue };
        let Some(s_m) = line_s_m(map, lane, signal, next) else { continue };
        let line = lane.line.at(s_m).pose;
        match found.iter_mut().find(|one| one.line == line) {
            Some(one) => one.lights.push(k),
            None => {
                found.push(LightLine { lane: lane.id, line, width_m: lane.width_m(s_m), lights: vec![k] })
            }
        }
    }
    found
}

/// Position along a lane of the line of a signal that its traffic obeys, metres, on the way to the lane `next` of the
/// route, or to any lane; as `Route::stop_s_m` for lanes of the route.
fn line_s_m(map: &Map, lane: &Lane, signal: &Signal, next: Option<LaneId>) -> Option<f64> {
    let obeys = |id: &LaneId| signal.lanes.binary_search(id).is_ok();
    let is_inside = |id: &LaneId| map.is_in_junction(*id);
    let lines = map.stop_lines_of(lane.id);
    let line = lines.iter().find(|line| line.signals.binary_search(&signal.id).is_ok());
    let is_for_turn = match next {
        Some(next) => is_inside(&next) && obeys(&next),
        None => {
            let inside = || lane.successors.iter().filter(|id| is_inside(id));
            inside().count() > 0 && inside().all(obeys)
        }
    };
    let is_for_any = obeys(&lane.id) || !signal.lanes.iter().any(is_inside);
    match line {
        Some(line) if is_for_turn || is_for_any => Some(line.s_m),
        None if obeys(&lane.id) || is_for_turn => Some((lane.line.length() - BEFORE_END_M).max(0.0)),
        _ => None,
    }
}
