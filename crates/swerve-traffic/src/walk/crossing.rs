//! Crossings: when pedestrians go, and where vehicles stop for them.

use swerve_core::{Span, Time};
use swerve_geom::Polyline;
use swerve_map::Aspect;

use crate::car::Car;
use crate::lights::Lights;
use crate::net::{Net, StopAt};
use crate::scene::Scene;

/// Deceleration that a pedestrian expects of a car, m/s², and its reaction time, seconds.
const BRAKE_MPS2: f64 = 2.0;
const REACTION_S: f64 = 1.0;
/// Gap between a stopped car and a crossing, metres.
const GAP_M: f64 = 0.8;
/// Distance of a stop line before the crossing that its light is for, metres.
const LINE_M: f64 = 25.0;
/// Time between a pedestrian and a vehicle that is not of the traffic, seconds.
const CLEAR_S: f64 = 1.5;
/// Distance within which a vehicle looks for crossings, metres.
const AHEAD_M: f64 = 80.0;

/// True if a pedestrian may step onto a crossing that takes `takes_s` to cross.
pub(super) fn is_free(
    net: &Net,
    (cars, scene): (&[Car], &Scene),
    crossing: usize,
    (lights, now): (&Lights, Time),
    takes_s: f64,
    line: &Polyline,
) -> bool {
    let parts = |lane: usize| net.lane(lane).crossings.iter().filter(move |(k, _)| *k == crossing);
    let until = now + Span::from_secs(takes_s);
    for lane in 0..net.lanes.len() {
        for (_, part) in parts(lane) {
            for stop in stops(net, lane, part[0]) {
                let aspects = [now, until].map(|at| lights.strictest(&stop.signals, at));
                if aspects.iter().any(|aspect| !matches!(aspect, Aspect::Red | Aspect::Off)) {
                    return false;
                }
            }
        }
    }
    let comes = |car: &Car| {
        car.way.iter().any(|(lane, begin_m)| {
            parts(*lane).any(|(_, part)| {
                let to_m = begin_m + part[0] - car.x_m - car.half_m();
                let past_m = begin_m + part[1] - car.x_m + car.half_m();
                let v = car.speed_mps;
                let stops_m = v * v / (2.0 * BRAKE_MPS2) + REACTION_S * v + GAP_M;
                past_m > 0.0 && to_m < stops_m
            })
        })
    };
    // A car of the traffic stops for a pedestrian; others are expected to drive on.
    let drives_on = |other: &crate::scene::Other| {
        let center = other.body.center.point();
        let place = line.project(center);
        let s_m = place.s_m.clamp(0.0, line.length());
        let away = line.at(s_m).pose.point() - center;
        let reach_m = away.norm() - other.body.radius();
        let speed_mps = other.velocity_mps.norm();
        let nears = other.velocity_mps.dot(away) > 0.0;
        reach_m < GAP_M || (nears && speed_mps > 0.5 && reach_m < speed_mps * (takes_s + CLEAR_S))
    };
    !cars.iter().any(|car| !car.is_hit && comes(car)) && !scene.others.iter().any(drives_on)
}

/// Stop lines with lights on a lane or those before it that hold traffic before a place.
fn stops(net: &Net, lane: usize, s_m: f64) -> impl Iterator<Item = &StopAt> {
    let own = net.lane(lane).stops.iter().filter(move |stop| stop.s_m < s_m && stop.s_m > s_m - LINE_M);
    let before = net.lane(lane).before.iter().flat_map(move |before| {
        let length_m = net.lane(*before).length_m;
        net.lane(*before).stops.iter().filter(move |stop| length_m - stop.s_m + s_m < LINE_M)
    });
    own.chain(before).filter(|stop| !stop.signals.is_empty())
}

/// Places before crossings in use at which a vehicle stops, along its way, metres.
pub(super) fn stops_m(net: &Net, car: &Car, used: &[bool]) -> Vec<f64> {
    let mut stops_m = Vec::new();
    for &(lane, begin_m) in car.way.iter().take_while(|(_, begin_m)| *begin_m < car.x_m + AHEAD_M) {
        for (crossing, part) in &net.lane(lane).crossings {
            let stop_m = begin_m + part[0] - car.half_m() - GAP_M;
            if used[*crossing] && stop_m > car.x_m - 0.3 {
                stops_m.push(stop_m);
            }
        }
    }
    stops_m
}
