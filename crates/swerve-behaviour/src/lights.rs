//! Stops at red and yellow traffic lights.

use swerve_core::Time;
use swerve_geom::Polyline;
use swerve_msg::{Signal, TrafficLight, TrafficLights};

use crate::{FollowRouteParams, Situation};

/// Distance over a line from which it counts as passed, metres.
const PASSED_M: f64 = 0.5;
/// Largest distance of a stop line from another route on which it is kept, metres.
const ON_ROUTE_M: f64 = 2.0;
/// Shortest time for which every light is yellow, seconds. Source: MUTCD (2009), section 4D.26.
const YELLOW_MIN_S: f64 = 3.0;
/// Distance from the line at which the tail is past it, metres: up to this distance the CARLA Leaderboard counts a light
/// that turns red as run.
const BEHIND_M: f64 = 1.0;
/// Reserve before the light can be red for an ego that goes on at yellow, seconds: the first frame that shows yellow is
/// late, and the speed is not held exactly.
const EARLY_S: f64 = 0.25;

/// The ego before a line.
#[derive(Clone, Copy, Debug)]
struct Car {
    front_s_m: f64,
    length_m: f64,
    speed_mps: f64,
    accel_mps2: f64,
    brake_max_mps2: f64,
}

/// Stop lines of the lights at which the ego has to stop.
#[derive(Clone, Debug)]
pub(crate) struct LightStops {
    params: FollowRouteParams,
    /// Lines at which the ego stops, by arc length.
    held: Vec<f64>,
    /// Lines of yellow lights, and the times since which they are yellow.
    yellow: Vec<(f64, Time)>,
    /// Sequence number of the route that these arc lengths are on, and its line.
    route: Option<(u64, Polyline)>,
}

impl LightStops {
    pub(crate) fn new(params: FollowRouteParams) -> Self {
        Self { params, held: Vec::new(), yellow: Vec::new(), route: None }
    }

    /// Arc lengths of the lines at which the ego stops.
    pub(crate) fn update(&mut self, at: &Situation<'_>) -> &[f64] {
        self.move_to(at);
        if let Some(lights) = at.lights.filter(|_| at.ego.is_plausible()) {
            let car = Car {
                front_s_m: at.front_s_m(),
                length_m: at.shape.length_m,
                speed_mps: at.ego.speed_mps,
                accel_mps2: at.ego.accel_mps2,
                brake_max_mps2: at.limits.brake_max_mps2,
            };
            self.hold(lights, car);
        }
        &self.held
    }

    /// Moves the lines to a new route; those that are not on it are dropped.
    fn move_to(&mut self, at: &Situation<'_>) {
        if self.route.as_ref().is_some_and(|(number, _)| *number == at.number) {
            return;
        }
        if let Some((_, before)) = &self.route {
            let moved = |s_m: f64| {
                let place = at.route.project(before.at(s_m).pose.point());
                (place.d_m.abs() < ON_ROUTE_M).then_some(place.s_m)
            };
            self.held = self.held.iter().filter_map(|s_m| moved(*s_m)).collect();
            self.yellow =
                self.yellow.iter().filter_map(|(s_m, since)| Some((moved(*s_m)?, *since))).collect();
        }
        self.route = Some((at.number, at.route.line().clone()));
    }

    /// Updates the lines at which the ego stops: of red lights, of yellow ones by
    /// [`stops_at_yellow`](Self::stops_at_yellow), and of held lights that show nothing now; except lines behind the
    /// ego and new ones too close for full braking.
    fn hold(&mut self, lights: &TrafficLights, car: Car) {
        let front_s_m = car.front_s_m;
        let TrafficLights { stamp, ref lights, .. } = *lights;
        self.watch_yellow(lights, stamp);
        let full_m = way_m(car.speed_mps, car.brake_max_mps2);
        let can_stop = |line_s_m: f64| front_s_m + full_m < line_s_m;
        let holds = |light: &TrafficLight| {
            let line_s_m = light.stop_s_m.filter(|line_s_m| front_s_m < line_s_m + PASSED_M)?;
            let held = self.held.contains(&line_s_m);
            let stops = match light.signal {
                Some(Signal::Red) => held || can_stop(line_s_m),
                Some(Signal::Yellow) => held || self.stops_at_yellow(line_s_m, stamp, car),
                Some(Signal::Green | Signal::Off) => false,
                None => held,
            };
            stops.then_some(line_s_m)
        };
        let mut now: Vec<f64> = lights.iter().filter_map(holds).collect();
        // A light out of sight is not taken for green.
        let gone = |line_s_m: &&f64| {
            front_s_m < **line_s_m + PASSED_M && lights.iter().all(|light| light.stop_s_m != Some(**line_s_m))
        };
        now.extend(self.held.iter().filter(gone));
        self.held = now;
    }

    /// Keeps the times since which lights are yellow.
    fn watch_yellow(&mut self, lights: &[TrafficLight], stamp: Time) {
        let is_yellow = |line_s_m: f64| {
            let shows = |light: &TrafficLight| {
                light.stop_s_m == Some(line_s_m) && light.signal == Some(Signal::Yellow)
            };
            lights.iter().any(shows)
        };
        self.yellow.retain(|(line_s_m, _)| is_yellow(*line_s_m));
        for line_s_m in
            lights.iter().filter_map(|light| light.stop_s_m).filter(|line_s_m| is_yellow(*line_s_m))
        {
            if !self.yellow.iter().any(|(known, _)| *known == line_s_m) {
                self.yellow.push((line_s_m, stamp));
            }
        }
    }

    /// Returns true if the ego stops at a yellow light: comfortably where there is room; else only if its tail cannot be
    /// past the line in the least time that a light is yellow, and full braking suffices. So there is no position from
    /// which the ego can neither stop nor pass (the dilemma zone of Gazis, Herman and Maradudin 1960).
    fn stops_at_yellow(&self, line_s_m: f64, stamp: Time, car: Car) -> bool {
        let Car { front_s_m, length_m, speed_mps, accel_mps2, brake_max_mps2 } = car;
        let ahead_m = line_s_m - front_s_m;
        let over_m = ahead_m + length_m + BEHIND_M;
        let FollowRouteParams { brake_mps2, reaction_s } = self.params;
        if way_m(speed_mps, brake_mps2) + speed_mps * reaction_s < ahead_m {
            return true;
        }
        let since =
            self.yellow.iter().find(|(known, _)| *known == line_s_m).map_or(stamp, |(_, since)| *since);
        // The reserve does not cause hard braking after a decision to go on. Neither does an ego that slows down for
        // something else; at first, it is expected to go on with that.
        let is_first = since == stamp;
        let (early_s, gain_mps2) = if is_first { (EARLY_S, accel_mps2.min(0.0)) } else { (0.0, 0.0) };
        let left_s = YELLOW_MIN_S - early_s - (stamp - since).as_secs();
        let mean_mps = (speed_mps + 0.5 * gain_mps2 * left_s).max(0.0);
        mean_mps * left_s < over_m && way_m(speed_mps, brake_max_mps2) < ahead_m
    }
}

/// Stopping distance, metres.
fn way_m(speed_mps: f64, brake_mps2: f64) -> f64 {
    0.5 * speed_mps * speed_mps / brake_mps2
}

#[cfg(test)]
mod tests;
