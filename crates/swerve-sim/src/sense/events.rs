//! Sensors of events: collisions, lines crossed, red lights passed.
//!
//! They are to see **every** step of the world, and give a message for each, mostly an empty one: who waits
//! for an event then knows at once that there was none. Two of them remember the step before.

use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, Obb, Point2, Polyline, Pose2};
use swerve_msg::truth::WorldState;
use swerve_msg::{
    CollisionEvent, CollisionEvents, LaneInvasion, LaneInvasions, RedLightEvent, RedLightEvents, RoadLine,
    Side, Signal,
};
use swerve_scenario::{Road, TrafficLight};
use swerve_vehicle::Shape;

/// How far from its last known place along the road the ego is looked for, metres.
const REACH_M: f64 = 15.0;
/// A line is left when the outline is this far from it, metres: to drive along its edge is one event.
const CLEAR_M: f64 = 0.1;
/// A stop line is ahead again when the front is this far behind it, metres.
const BACK_M: f64 = 0.5;

/// Contacts of the ego that began in the step that led to this state.
pub fn collisions(world: &WorldState) -> CollisionEvents {
    let event = |collision: &swerve_msg::truth::Collision| {
        let actor = world.actors.iter().find(|actor| actor.id == collision.actor)?;
        Some(CollisionEvent {
            actor: actor.id,
            kind: actor.kind,
            impulse_n_s: collision.impulse_n_s,
            closing_speed_mps: collision.closing_speed_mps,
        })
    };
    let mut events: Vec<_> = world.collisions.iter().filter_map(event).collect();
    events.sort_by_key(|event| event.actor);
    CollisionEvents { stamp: world.stamp, events }
}

/// Tells when the ego's outline comes onto a line of the road.
#[derive(Clone, Debug)]
pub struct LaneInvasionSensor {
    line: Polyline,
    shape: Shape,
    lines: Vec<Crossing>,
    /// Where the middle of the outline was.
    last: Option<FrenetPoint>,
}

/// One line and whether the ego is on it.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Crossing {
    line: RoadLine,
    d_m: f64,
    on_it: bool,
}

impl LaneInvasionSensor {
    /// For a car of this outline on this road (of a checked scenario).
    pub fn new(road: &Road, shape: Shape) -> Self {
        let crossing = |(line, d_m)| Crossing { line, d_m, on_it: false };
        let lines = road.lines().into_iter().map(crossing).collect();
        Self { line: road.line(), shape, lines, last: None }
    }

    /// The lines that the outline came onto, or leapt over, since the state before. On which lines the ego is
    /// in the first state is no event.
    pub fn sense(&mut self, world: &WorldState) -> LaneInvasions {
        let outline = self.shape.footprint(world.ego.state.pose);
        let center = outline.center.point();
        let now = match self.last {
            Some(last) => self.line.project_near(center, last.s_m, REACH_M),
            None => self.line.project(center),
        };
        let [right_m, left_m] = spread(&self.line, &outline, now.s_m);
        let mut events = Vec::new();
        for crossing in &mut self.lines {
            let d_m = crossing.d_m;
            let on_it = right_m < d_m && d_m < left_m;
            let leapt = self.last.is_some_and(|last| (last.d_m < d_m) != (now.d_m < d_m));
            if let Some(last) = self.last.filter(|_| !crossing.on_it && (on_it || leapt)) {
                let side = if last.d_m < d_m { Side::Left } else { Side::Right };
                events.push(LaneInvasion { line: crossing.line, line_d_m: d_m, side, s_m: now.s_m });
            }
            let clear = right_m > d_m + CLEAR_M || left_m < d_m - CLEAR_M;
            crossing.on_it = on_it || (crossing.on_it && !clear);
        }
        self.last = Some(now);
        LaneInvasions { stamp: world.stamp, events }
    }
}

/// How far the outline is to the right and to the left of a line, metres to the left: its corners and the
/// middles of its sides, which a bend can come nearer to.
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

/// Tells when the ego's front goes over a stop line while its light is red.
#[derive(Clone, Debug)]
pub struct RedLightSensor {
    line: Polyline,
    shape: Shape,
    lights: Vec<TrafficLight>,
    /// For each light whether its stop line is behind the front.
    passed: Vec<bool>,
    /// When, and where the front was along the road.
    last: Option<(Time, f64)>,
}

impl RedLightSensor {
    /// For a car of this outline on this road (of a checked scenario).
    pub fn new(road: &Road, shape: Shape) -> Self {
        let (lights, passed) = (road.lights.clone(), vec![false; road.lights.len()]);
        Self { line: road.line(), shape, lights, passed, last: None }
    }

    /// The red lights whose stop lines the front went over since the state before; the signal is that of the
    /// instant at which it did, by its way since then. A line over which it went back counts anew.
    pub fn sense(&mut self, world: &WorldState) -> RedLightEvents {
        let front = front(&self.shape, world.ego.state.pose);
        let Some((then, from_m)) = self.last else {
            let s_m = self.line.project(front).s_m;
            self.last = Some((world.stamp, s_m));
            self.passed = self.lights.iter().map(|light| s_m >= light.stop_s_m).collect();
            return RedLightEvents { stamp: world.stamp, events: Vec::new() };
        };
        let s_m = self.line.project_near(front, from_m, REACH_M).s_m;
        let dt = world.stamp - then;
        let mut events = Vec::new();
        for (i, (light, passed)) in self.lights.iter().zip(&mut self.passed).enumerate() {
            let stop_s_m = light.stop_s_m;
            if *passed {
                *passed = s_m > stop_s_m - BACK_M;
            } else if s_m >= stop_s_m {
                *passed = true;
                let share = ((stop_s_m - from_m) / (s_m - from_m)).clamp(0.0, 1.0);
                let at = then + Span::from_secs(dt.as_secs() * share);
                if let (Signal::Red, since) = light.phase(at) {
                    let speed_mps = (s_m - from_m) / dt.as_secs().max(1e-9);
                    let (light, red_for_s) = (i as u32, since.as_secs());
                    events.push(RedLightEvent { light, stop_s_m, passed: at, red_for_s, speed_mps });
                }
            }
        }
        self.last = Some((world.stamp, s_m));
        RedLightEvents { stamp: world.stamp, events }
    }
}

/// The middle of the front bumper.
fn front(shape: &Shape, pose: Pose2) -> Point2 {
    pose.ahead(shape.length_m - shape.rear_overhang_m).point()
}

#[cfg(test)]
mod tests;
