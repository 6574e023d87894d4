//! Event sensors: collisions, lane lines crossed, red lights passed.
//!
//! They must process **every** simulation step and publish a message for each, usually an empty one, so that readers
//! know at once that there was no event. Two of them keep the previous step.

use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, Obb, Point2, Polyline, Pose2};
use swerve_msg::truth::{Collision, WorldState};
use swerve_msg::{
    CollisionEvent, CollisionEvents, LaneInvasion, LaneInvasions, RedLightEvent, RedLightEvents, Route, Side,
    Signal,
};
use swerve_scenario::{Road, RoadLines, TrafficLight};
use swerve_vehicle::Shape;

/// Search range around the ego's last position along the road, metres.
const REACH_M: f64 = 15.0;
/// Clearance at which the outline has left a line, metres: driving along its edge is one event.
const CLEAR_M: f64 = 0.1;
/// Distance of the front behind a stop line from which the line counts as ahead again, metres.
const BACK_M: f64 = 0.5;

/// Contacts of the ego that began in the step that led to this state.
pub fn collisions(world: &WorldState) -> CollisionEvents {
    let event = |(with, collision): (_, &Collision)| {
        let actor = world.actor(with)?;
        Some(CollisionEvent {
            actor: actor.id,
            kind: actor.kind,
            impulse_n_s: collision.impulse_n_s,
            closing_speed_mps: collision.closing_speed_mps,
        })
    };
    let mut events: Vec<_> = world.collisions_of_ego().filter_map(event).collect();
    events.sort_by_key(|event| event.actor);
    CollisionEvents { stamp: world.stamp, events }
}

/// Detects when the ego's outline moves onto a line of the road.
#[derive(Clone, Debug)]
pub struct LaneInvasionSensor {
    line: Polyline,
    shape: Shape,
    lines: RoadLines,
    /// For each of [`RoadLines::ALL`], true if the ego is on it.
    on_it: [bool; RoadLines::ALL.len()],
    /// Previous position of the outline's centre.
    last: Option<FrenetPoint>,
}

impl LaneInvasionSensor {
    /// Creates a sensor for a car of this outline on this road (of a checked scenario).
    pub fn new(road: &Road, shape: Shape) -> Self {
        let on_it = [false; RoadLines::ALL.len()];
        Self { line: road.line(), shape, lines: road.lines(), on_it, last: None }
    }

    /// Lines that the outline moved onto, or over, since the previous state. Lines under the ego in the first state are
    /// not events.
    pub fn sense(&mut self, world: &WorldState) -> LaneInvasions {
        let outline = self.shape.footprint(world.ego.state.pose);
        let center = outline.center.point();
        let now = match self.last {
            Some(last) => self.line.project_near(center, last.s_m, REACH_M),
            None => self.line.project(center),
        };
        let [right_m, left_m] = spread(&self.line, &outline, now.s_m);
        let mut events = Vec::new();
        for (line, was_on_it) in RoadLines::ALL.into_iter().zip(&mut self.on_it) {
            let Some(d_m) = self.lines.offset_m(line, now.s_m) else {
                *was_on_it = false;
                continue;
            };
            let on_it = right_m < d_m && d_m < left_m;
            let last = self.last.and_then(|last| Some((last.d_m, self.lines.offset_m(line, last.s_m)?)));
            let leapt = last.is_some_and(|(from_m, line_m)| (from_m < line_m) != (now.d_m < d_m));
            if let Some((from_m, line_m)) = last.filter(|_| !*was_on_it && (on_it || leapt)) {
                let side = if from_m < line_m { Side::Left } else { Side::Right };
                events.push(LaneInvasion { line, line_d_m: d_m, side, s_m: now.s_m });
            }
            let clear = right_m > d_m + CLEAR_M || left_m < d_m - CLEAR_M;
            *was_on_it = on_it || (*was_on_it && !clear);
        }
        self.last = Some(now);
        LaneInvasions { stamp: world.stamp, events }
    }
}

/// Range of the outline's lateral distance from a line, metres to the left: its corners and the midpoints of its sides,
/// which can be closer in a bend.
fn spread(line: &Polyline, outline: &Obb, near_s_m: f64) -> [f64; 2] {
    let corners = outline.corners();
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for (i, corner) in corners.into_iter().enumerate() {
        let next = corners[(i + 1) % 4];
        for point in [corner, corner + (next - corner) * 0.5] {
            let d_m = line.project_near(point, near_s_m, REACH_M).d_m;
            ends = [ends[0].min(d_m), ends[1].max(d_m)];
        }
    }
    ends
}

/// Detects when the ego's front passes a stop line while its light is red.
#[derive(Clone, Debug)]
pub struct RedLightSensor {
    road: Road,
    line: Polyline,
    shape: Shape,
    /// Lights that the ego obeys, with their index in the scenario and their stop lines along the route, metres.
    lights: Vec<(u32, TrafficLight, f64)>,
    /// For each light, true if its stop line is behind the front.
    passed: Vec<bool>,
    /// Previous stamp, and position of the front along the road.
    last: Option<(Time, f64)>,
}

impl RedLightSensor {
    /// Creates a sensor for a car of this outline on the first route of this road (of a checked scenario).
    pub fn new(road: &Road, shape: Shape) -> Self {
        let (lights, passed) = (Vec::new(), Vec::new());
        let mut sensor = Self { road: road.clone(), line: road.line(), shape, lights, passed, last: None };
        sensor.follow(&road.route());
        sensor
    }

    /// Takes another route of the ego.
    pub fn follow(&mut self, route: &Route) {
        let obeyed =
            |(k, light): (u32, &TrafficLight)| Some((k, light.clone(), self.road.stop_s_m(light, route)?));
        self.lights = (0..).zip(&self.road.lights).filter_map(obeyed).collect();
        (self.line, self.last) = (route.line().clone(), None);
    }

    /// Red lights whose stop lines the front passed since the previous state. The signal is taken at the interpolated
    /// instant of passing. A line crossed again after reversing counts again.
    pub fn sense(&mut self, world: &WorldState) -> RedLightEvents {
        let front = front(&self.shape, world.ego.state.pose);
        let Some((then, from_m)) = self.last else {
            let s_m = self.line.project(front).s_m;
            self.last = Some((world.stamp, s_m));
            self.passed = self.lights.iter().map(|(_, _, stop_s_m)| s_m >= *stop_s_m).collect();
            return RedLightEvents { stamp: world.stamp, events: Vec::new() };
        };
        let s_m = self.line.project_near(front, from_m, REACH_M).s_m;
        let dt = world.stamp - then;
        let mut events = Vec::new();
        for ((index, light, stop_s_m), passed) in self.lights.iter().zip(&mut self.passed) {
            let stop_s_m = *stop_s_m;
            if *passed {
                *passed = s_m > stop_s_m - BACK_M;
            } else if s_m >= stop_s_m {
                *passed = true;
                let share = ((stop_s_m - from_m) / (s_m - from_m)).clamp(0.0, 1.0);
                let at = then + Span::from_secs(dt.as_secs() * share);
                if let (Signal::Red, since) = light.phase(at) {
                    let speed_mps = (s_m - from_m) / dt.as_secs().max(1e-9);
                    let (light, red_for_s) = (*index, since.as_secs());
                    events.push(RedLightEvent { light, stop_s_m, passed: at, red_for_s, speed_mps });
                }
            }
        }
        self.last = Some((world.stamp, s_m));
        RedLightEvents { stamp: world.stamp, events }
    }
}

/// Centre of the front bumper.
fn front(shape: &Shape, pose: Pose2) -> Point2 {
    pose.ahead(shape.length_m - shape.rear_overhang_m).point()
}

#[cfg(test)]
mod tests;
