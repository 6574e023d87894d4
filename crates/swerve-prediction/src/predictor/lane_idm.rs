//! Vehicles keep to their lane and their distance, or brake.
//!
//! The speed is that of the intelligent driver model (Treiber, Hennecke and Helbing 2000) behind whoever is next on the
//! lane, who is driven by it too, and at most what the bend allows. The gap that a driver wants is what he has now, within
//! bounds. The lane is the road at the vehicle's offset, and what of its speed goes across dies away; without a road, or
//! beside it, it is straight on.

use swerve_core::Time;
use swerve_geom::{FrenetPoint, Point2, Vector2, math};
use swerve_msg::{ActorKind, Forecast, Mode, Route};

use super::drawn::{forecast, mode, spread};
use super::filters::{CTRA, IMM, beliefs, forecasts as filtered};
use super::straight::VELOCITY_WINDOW_S;
use super::{Horizon, Seen};
use crate::idm::{self, STAND_GAP_M};
use crate::road::{SETTLES_S, share_along};

/// Largest acceleration and comfortable braking, m/s².
const GAIN_MPS2: f64 = 1.0;
const BRAKE_MPS2: f64 = 2.0;
/// Bounds of the gap in time, seconds; the larger is wanted where nobody is ahead.
const HEADWAY_S: [f64; 2] = [0.4, 2.0];
/// Speed that is wanted, over the present one: who is alone goes on as he goes.
const WANTED_SHARE: f64 = 1.05;
/// Largest acceleration across in a bend, m/s².
const LATERAL_MPS2: f64 = 3.0;
/// The present acceleration goes over into the model's with this time constant, seconds.
const ACCELERATION_FADES_S: f64 = 1.0;
/// In half a second nobody has come farther along the road than this, metres.
const NEAR_M: f64 = 60.0;
/// Whoever is this far ahead is nobody's leader, metres.
const AHEAD_MAX_M: f64 = 100.0;
/// Share of vehicles that brake for no reason that is known here, and how hard, m/s².
const YIELDS: f64 = 0.1;
const YIELD_MPS2: f64 = 2.0;

/// A vehicle in its lane.
struct Driver<'a> {
    place: Place<'a>,
    /// Index of the next vehicle on the lane, and the gap between both bumpers, metres.
    leader: Option<(usize, f64)>,
    speed_mps: f64,
    first_mps: f64,
    /// Present acceleration beyond the model's, which fades, m/s².
    extra_mps2: f64,
    /// How far it has come, metres.
    on_m: f64,
}

/// Where a vehicle is, and along what it goes.
#[derive(Clone)]
struct Place<'a> {
    point: Point2,
    velocity_mps: Vector2,
    /// The same by the road, where there is one.
    by_road: Option<FrenetPoint>,
    along: Option<OnRoad<'a>>,
}

/// Along a road.
#[derive(Clone)]
struct OnRoad<'a> {
    route: &'a Route,
    at: FrenetPoint,
    /// Metres of its line to a metre of the lane, negative against it.
    sense: f64,
    /// Speed across, to the left, m/s.
    across_mps: f64,
}

/// Two modes each, of vehicles: on, or braking; of people: on, or stopping.
pub(super) fn forecasts(
    seen: &[Seen],
    stamp: Time,
    horizon: &Horizon,
    road: Option<&Route>,
) -> Vec<Forecast> {
    let places: Vec<Place> = seen.iter().map(|seen| Place::of(seen, stamp, road)).collect();
    let mut drivers: Vec<Driver> = Vec::with_capacity(seen.len());
    for (k, (place, seen_k)) in places.iter().zip(seen).enumerate() {
        let leader = if walks(seen_k) { None } else { leader(&places, seen, k) };
        drivers.push(Driver::of(seen_k, place, leader));
    }
    let paths = driven(&mut drivers, horizon);
    let of_one = |(k, seen): (usize, &Seen)| {
        if walks(seen) {
            return filtered(core::slice::from_ref(seen), stamp, horizon, IMM).remove(0);
        }
        let braking = braked(&places[k], horizon);
        let of_path = |probability: f64, points: &[Point2]| -> Mode {
            mode(probability, seen, stamp, (horizon, &spread(seen, stamp, horizon, points)))
        };
        forecast(seen, vec![of_path(1.0 - YIELDS, &paths[k]), of_path(YIELDS, &braking)])
    };
    seen.iter().enumerate().map(of_one).collect()
}

fn walks(seen: &Seen) -> bool {
    matches!(seen.past.kind, ActorKind::Pedestrian | ActorKind::Static)
}

impl<'a> Place<'a> {
    fn of(seen: &Seen, stamp: Time, road: Option<&'a Route>) -> Self {
        let velocity_mps = seen.past.velocity_mps(VELOCITY_WINDOW_S);
        let point = seen.past.now(stamp, velocity_mps);
        let by_road = road.map(|route| route.project(point));
        let along = road.zip(by_road).and_then(|(route, at)| {
            let line = route.line();
            let share = share_along(route, at, velocity_mps)?;
            let heading: Vector2 = line.at(at.s_m).pose.direction();
            let sense = if heading.dot(velocity_mps) < 0.0 { -1.0 } else { 1.0 };
            // In the road's own coordinates: over half a second of a bend the velocity seems to go across.
            let across_mps =
                seen.past.before(VELOCITY_WINDOW_S).map_or(heading.cross(velocity_mps), |before| {
                    let last = seen.past.last();
                    let d_m = |point| route.project_near(point, at.s_m, NEAR_M).d_m;
                    (d_m(last.point) - d_m(before.point)) / (last.at - before.at).as_secs()
                });
            Some(OnRoad { route, at, sense: sense / share, across_mps })
        });
        Self { point, velocity_mps, by_road, along }
    }

    /// How far `other` is ahead along the lane, and how far beside it, metres.
    fn ahead_of(&self, other: &Self) -> (f64, f64) {
        match self.along.as_ref().zip(other.by_road) {
            Some((OnRoad { at, sense, .. }, there)) => ((there.s_m - at.s_m) / sense, there.d_m - at.d_m),
            None => {
                let unit = self.velocity_mps * (1.0 / self.velocity_mps.norm().max(1e-9));
                let off: Vector2 = other.point - self.point;
                (unit.dot(off), unit.cross(off))
            }
        }
    }

    /// Where it is after `on_m` along its lane and `t_s`.
    fn at(&self, on_m: f64, t_s: f64) -> Point2 {
        match &self.along {
            Some(OnRoad { route, at, sense, across_mps }) => {
                let beside_m = across_mps * SETTLES_S * (1.0 - math::exp(-t_s / SETTLES_S));
                route.unproject(FrenetPoint { s_m: at.s_m + sense * on_m, d_m: at.d_m + beside_m })
            }
            None => {
                let speed_mps = self.velocity_mps.norm().max(1e-9);
                self.point + self.velocity_mps * (on_m / speed_mps)
            }
        }
    }

    /// The largest speed that the bend `on_m` ahead allows, m/s.
    fn bend_mps(&self, on_m: f64) -> f64 {
        let curvature_1pm = self.along.as_ref().map_or(0.0, |along| {
            along.route.line().at(along.at.s_m + along.sense * on_m).curvature_1pm.abs()
        });
        (LATERAL_MPS2 / curvature_1pm.max(1e-6)).sqrt()
    }
}

/// The next on the lane of vehicle `k`, and the gap between them.
fn leader(places: &[Place], seen: &[Seen], k: usize) -> Option<(usize, f64)> {
    let own = seen[k].track.extent;
    let gap = |(j, place): (usize, &Place)| {
        let (other, near) = (seen[j].track.extent, places[k].point.distance(place.point) < AHEAD_MAX_M);
        let (ahead_m, beside_m) = if near { places[k].ahead_of(place) } else { (-1.0, 0.0) };
        let same_way = place.velocity_mps.dot(places[k].velocity_mps) >= 0.0;
        let is_next =
            j != k && ahead_m > 0.0 && same_way && beside_m.abs() < 0.5 * (own.width_m + other.width_m);
        is_next.then_some((j, (ahead_m - 0.5 * (own.length_m + other.length_m)).max(0.1)))
    };
    places.iter().enumerate().filter_map(gap).min_by(|a, b| a.1.total_cmp(&b.1))
}

impl<'a> Driver<'a> {
    fn of(seen: &Seen, place: &Place<'a>, leader: Option<(usize, f64)>) -> Self {
        let speed_mps = place.velocity_mps.norm();
        let along = place.velocity_mps * (1.0 / speed_mps.max(1e-6));
        // Who walks is only somebody to keep behind.
        let gain_mps2 = match walks(seen) {
            true => 0.0,
            false => along.dot(beliefs(&seen.past, CTRA)[0].derivative(2)).clamp(-8.0, 4.0),
        };
        let place = place.clone();
        Self { place, leader, speed_mps, first_mps: speed_mps, extra_mps2: gain_mps2, on_m: 0.0 }
    }

    /// The model's acceleration with `gap_m` to a leader at `leader_mps`, m/s².
    fn wanted_mps2(&self, leader: Option<(f64, f64)>) -> f64 {
        let v = self.speed_mps;
        let free_mps = (self.first_mps * WANTED_SHARE + 0.1).min(self.place.bend_mps(self.on_m + v));
        let first_gap_m = self.leader.map_or(f64::INFINITY, |(_, gap_m)| gap_m);
        let headway_s =
            ((first_gap_m - STAND_GAP_M) / self.first_mps.max(1.0)).clamp(HEADWAY_S[0], HEADWAY_S[1]);
        let driver = idm::Driver { gain_mps2: GAIN_MPS2, brake_mps2: BRAKE_MPS2, headway_s };
        driver.acceleration_mps2(v, free_mps.max(0.1), leader).max(-8.0)
    }
}

/// Everybody's way, all at once.
fn driven(drivers: &mut [Driver], horizon: &Horizon) -> Vec<Vec<Point2>> {
    let mut paths: Vec<Vec<Point2>> = drivers.iter().map(|driver| vec![driver.place.at(0.0, 0.0)]).collect();
    let step_s = horizon.step.as_secs();
    for k in 1..=horizon.steps {
        let gains: Vec<f64> = drivers
            .iter()
            .map(|driver| {
                let leader = driver
                    .leader
                    .map(|(j, gap_m)| (gap_m + drivers[j].on_m - driver.on_m, drivers[j].speed_mps));
                let model = driver.wanted_mps2(leader);
                model
                    + (driver.extra_mps2 - model) * math::exp(-step_s * (k - 1) as f64 / ACCELERATION_FADES_S)
            })
            .collect();
        for ((driver, gain), path) in drivers.iter_mut().zip(gains).zip(&mut paths) {
            let next_mps = (driver.speed_mps + gain * step_s).max(0.0);
            driver.on_m += 0.5 * (driver.speed_mps + next_mps) * step_s;
            driver.speed_mps = next_mps;
            path.push(driver.place.at(driver.on_m, step_s * k as f64));
        }
    }
    paths
}

/// The way of who brakes to a stand.
fn braked(place: &Place, horizon: &Horizon) -> Vec<Point2> {
    let speed_mps = place.velocity_mps.norm();
    let at = |k: usize| {
        let t_s = horizon.step.as_secs() * k as f64;
        let brakes_s = t_s.min(speed_mps / YIELD_MPS2);
        place.at(speed_mps * brakes_s - 0.5 * YIELD_MPS2 * brakes_s * brakes_s, t_s)
    };
    (0..=horizon.steps).map(at).collect()
}
