//! Verdict on the end of a scenario.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{LineTracker, angle_between};
use swerve_msg::truth::{Actor, EndReason, InfractionKind, Verdict, WorldState};
use swerve_msg::{ActorId, GateMode, Route, Signal};

use crate::gate::stop_cause;
use crate::{LightCourse, Outline, seconds};

/// Speed below which the ego counts as stationary, m/s.
pub(crate) const STANDS_MPS: f64 = 0.1;
/// Maximum distance ahead of a stationary ego at which an actor blocks it, metres.
const IN_THE_WAY_M: f64 = 25.0;

/// Search range for positions along the route near the ego, metres.
const FRONT_REACH_M: f64 = 15.0;
/// Distance beyond a stop line, measured at the front, up to which an ego still waits at it, metres.
const BEYOND_LINE_M: f64 = 1.0;
/// Angle between the ego's heading and the direction to an actor above which it is behind, degrees. Source: nuPlan.
const BEHIND_DEG: f64 = 150.0;
/// Lateral margin around the outline for blocking actors, metres.
const BESIDE_M: f64 = 0.5;

/// First contact of the ego with an actor.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Impact {
    /// Actor hit.
    pub actor: ActorId,
    /// Instant, seconds since the run started.
    pub at_s: f64,
    /// Speed of the ego just before, m/s.
    pub ego_speed_mps: f64,
    /// Closing speed along the contact normal just before, m/s.
    pub closing_speed_mps: f64,
    /// Impulse of the first contact step, N s.
    pub impulse_n_s: f64,
    /// False if the ego stood, or was hit from behind: the centre of the actor was more than 150 degrees off the heading
    /// of the rear axle. As in nuPlan, but collisions at the sides are always at fault.
    #[serde(default = "at_fault")]
    pub at_fault: bool,
}

/// Collisions in files without the answer.
fn at_fault() -> bool {
    true
}

/// Accumulates world states and determines the verdict.
#[derive(Clone, Debug)]
pub struct Outcome {
    ego: Outline,
    route: Option<Route>,
    lights: Vec<LightCourse>,
    gate: GateMode,
    has_driven: bool,
    stands: bool,
    impact: Option<(Time, Impact)>,
    left_road: Option<Time>,
    end: Option<EndReason>,
    /// Actor that blocks the ego at the end.
    stands_before: Option<ActorId>,
    is_alone: bool,
    /// Light at which it waits at the end.
    waits_at: Option<usize>,
    /// True if it is at rest at the end, held by the gate.
    is_held: bool,
    /// Position of the front along the route, if there are lights.
    front_s_m: Option<f64>,
    /// Tracker of the ego's projection to the route, and its arc length, metres.
    place: LineTracker,
    ego_s_m: Option<f64>,
    red_lights_passed: usize,
}

impl Outcome {
    /// Creates an accumulator for an ego of this outline on a route with these lights.
    pub fn new(ego: Outline, route: Option<Route>, lights: Vec<LightCourse>) -> Self {
        Self {
            ego,
            route,
            lights,
            gate: GateMode::Manual,
            has_driven: false,
            stands: false,
            impact: None,
            left_road: None,
            end: None,
            stands_before: None,
            is_alone: true,
            waits_at: None,
            is_held: false,
            front_s_m: None,
            place: LineTracker::default(),
            ego_s_m: None,
            red_lights_passed: 0,
        }
    }

    /// Takes another route of the ego, with the lights along it.
    pub fn follow(&mut self, route: Route, lights: Vec<LightCourse>) {
        (self.route, self.lights) = (Some(route), lights);
        (self.place, self.front_s_m) = (LineTracker::default(), None);
    }

    /// Sets the mode of the safety gate from now on.
    pub fn gate(&mut self, mode: GateMode) {
        self.gate = mode;
    }

    /// Adds the world state after one step.
    pub fn take(&mut self, world: &WorldState) {
        for (actor, c) in world.collisions_of_ego() {
            if self.impact.is_none_or(|(first, _)| c.stamp < first) {
                let impact = Impact {
                    actor,
                    at_s: seconds(c.stamp),
                    ego_speed_mps: c.speeds_mps[0],
                    closing_speed_mps: c.closing_speed_mps,
                    impulse_n_s: c.impulse_n_s,
                    at_fault: is_at_fault(world, actor, c.speeds_mps),
                };
                self.impact = Some((c.stamp, impact));
            }
        }
        for infraction in &world.infractions {
            match infraction.kind {
                InfractionKind::LeftRoad => {
                    self.left_road.get_or_insert(infraction.stamp);
                }
            }
        }
        self.ego_s_m =
            self.route.as_ref().map(|route| self.place.locate(route.line(), world.ego.state.pose).s_m);
        self.pass_lights(world);
        self.is_alone &= world.actors.is_empty();
        let stands = world.ego.state.speed_mps.abs() <= STANDS_MPS;
        self.has_driven |= !stands;
        self.stands = stands;
        if self.end.is_none() && world.ended.is_some() {
            self.end = world.ended;
            // An ego that never set off was not brought to rest by anything.
            if stands && self.has_driven {
                self.stands_before = in_the_way(world, self.ego, self.route.as_ref().zip(self.ego_s_m));
                self.waits_at = self.light_ahead(world);
                self.is_held = stop_cause(self.gate).is_some();
            }
        }
    }

    /// True if the ego is at rest after having set off.
    pub(crate) fn stands_again(&self) -> bool {
        self.has_driven && self.stands
    }

    /// Verdict so far. Precedence: collision, then leaving the road, then how the run ended.
    pub fn verdict(&self) -> Verdict {
        match (self.impact, self.left_road, self.end) {
            (Some(_), _, _) | (None, None, Some(EndReason::Collision)) => Verdict::Collision,
            (None, Some(_), _) => Verdict::LeftRoad,
            (None, None, Some(EndReason::Goal | EndReason::Stopped)) => match self.is_alone {
                true => Verdict::Completed,
                false => Verdict::Avoided,
            },
            (None, None, Some(EndReason::Timeout)) => {
                let is_safe = self.is_held || self.stands_before.is_some() || self.waits_at.is_some();
                if is_safe { Verdict::Stopped } else { Verdict::Timeout }
            }
            (None, None, None) => Verdict::Unfinished,
        }
    }

    /// First contact.
    pub fn impact(&self) -> Option<Impact> {
        self.impact.map(|(_, impact)| impact)
    }

    /// Instant of the first contact.
    pub fn impact_at(&self) -> Option<Time> {
        self.impact.map(|(at, _)| at)
    }

    /// Instant at which part of the ego first left the drivable area.
    pub fn left_road_at(&self) -> Option<Time> {
        self.left_road
    }

    /// Actor that blocked the ego when the scenario ended.
    pub fn stands_before(&self) -> Option<ActorId> {
        self.stands_before
    }

    /// Traffic light at which the ego waited when the scenario ended.
    pub fn waits_at_light(&self) -> Option<&str> {
        self.waits_at.map(|light| self.lights[light].name.as_str())
    }

    /// Number of stop lines that the ego's front passed at red.
    pub fn red_lights_passed(&self) -> usize {
        self.red_lights_passed
    }

    /// Arc length of the ego's front along the route, metres.
    fn front_s_m(&self, world: &WorldState) -> Option<f64> {
        let front_m = self.ego.center_ahead_m + 0.5 * self.ego.length_m;
        let front = world.ego.state.pose.ahead(front_m).point();
        Some(self.route.as_ref()?.project_near(front, self.ego_s_m? + front_m, FRONT_REACH_M).s_m)
    }

    fn pass_lights(&mut self, world: &WorldState) {
        if self.lights.is_empty() {
            return;
        }
        let now_m = self.front_s_m(world);
        if let (Some(before_m), Some(now_m)) = (self.front_s_m, now_m) {
            let is_passed = |light: &&LightCourse| {
                before_m < light.stop_s_m
                    && now_m >= light.stop_s_m
                    && light.signal(world.stamp) == Some(Signal::Red)
            };
            self.red_lights_passed += self.lights.iter().filter(is_passed).count();
        }
        self.front_s_m = now_m;
    }

    /// Nearest light that holds traffic and whose stop line is just ahead of the ego.
    fn light_ahead(&self, world: &WorldState) -> Option<usize> {
        let front_s_m = self.front_s_m(world)?;
        let ahead = |light: &LightCourse| light.stop_s_m - front_s_m;
        let is_waited_for = |(_, light): &(usize, &LightCourse)| {
            (-BEYOND_LINE_M..=IN_THE_WAY_M).contains(&ahead(light))
                && light.signal(world.stamp).is_some_and(Signal::holds)
        };
        let waited_for = self.lights.iter().enumerate().filter(is_waited_for);
        waited_for.min_by(|a, b| ahead(a.1).total_cmp(&ahead(b.1))).map(|(k, _)| k)
    }

    /// Reason for the end of the scenario; `None` while it continues.
    pub fn end(&self) -> Option<EndReason> {
        self.end
    }
}

/// True unless the ego stood, or a moving actor came from behind, given the speeds of both just before, m/s.
fn is_at_fault(world: &WorldState, actor: ActorId, [ego_mps, actor_mps]: [f64; 2]) -> bool {
    let own = world.ego.state.pose;
    let is_behind = world.actor(actor).is_some_and(|actor| {
        let to = actor.pose.point() - own.point();
        angle_between(own.heading_rad, to.heading()).abs() > BEHIND_DEG.to_radians()
    });
    ego_mps.abs() > STANDS_MPS && !(is_behind && actor_mps > STANDS_MPS)
}

/// Nearest actor that blocks a stationary ego: ahead of its outline or on its route, with a margin.
fn in_the_way(world: &WorldState, ego: Outline, route: Option<(&Route, f64)>) -> Option<ActorId> {
    let state = &world.ego.state;
    let lane = Outline {
        length_m: IN_THE_WAY_M,
        width_m: ego.width_m + 2.0 * BESIDE_M,
        center_ahead_m: ego.center_ahead_m + 0.5 * (ego.length_m + IN_THE_WAY_M),
    };
    let (lane, outline) = (lane.footprint(state.pose), ego.footprint(state.pose));
    let is_on_route = |actor: &Actor| {
        let Some((route, s_m)) = route else { return false };
        let near = |point| route.project_near(point, s_m, IN_THE_WAY_M + ego.length_m + FRONT_REACH_M);
        let (own, other) = (near(outline.center.point()), near(actor.pose.point()));
        let beside_m = 0.5 * (ego.width_m + actor.extent.width_m) + BESIDE_M;
        let ahead_m = other.s_m - own.s_m - 0.5 * ego.length_m;
        (-0.5 * ego.length_m..=IN_THE_WAY_M).contains(&ahead_m) && other.d_m.abs() <= beside_m
    };
    let is_blocking = |actor: &&Actor| actor.gap_m(&lane) <= 0.0 || is_on_route(actor);
    let blocking = world.actors.iter().filter(is_blocking);
    blocking.min_by(|a, b| a.gap_m(&outline).total_cmp(&b.gap_m(&outline))).map(|actor| actor.id)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use swerve_geom::{Map, Point, Point2, Polyline, Pose2, Transform, Vector, Vector2};
    use swerve_msg::truth::{Actor, Collision, EgoTruth, Infraction};
    use swerve_msg::{ActorKind, EgoState, Extent, StopCause};

    pub(crate) fn world(ms: i64, x_m: f64) -> WorldState {
        let stamp = Time::from_ms(ms);
        let state = EgoState { stamp, pose: Pose2::new(x_m, 0.0, 0.0), ..EgoState::default() };
        WorldState {
            stamp,
            ego: EgoTruth {
                id: ActorId::EGO,
                map_from_ego: Transform::from_roll_pitch_yaw(Point::<Map>::new(x_m, 0.0, 0.0), 0.0, 0.0, 0.0),
                state,
                velocity_mps: Vector::new(0.0, 0.0, 0.0),
                specific_force_mps2: Vector::new(0.0, 0.0, 9.81),
                angular_velocity_radps: Vector::new(0.0, 0.0, 0.0),
            },
            actors: Vec::new(),
            collisions: Vec::new(),
            infractions: Vec::new(),
            ended: None,
        }
    }

    pub(crate) fn actor(id: u32, kind: ActorKind, pose: Pose2, length_m: f64, width_m: f64) -> Actor {
        let extent = Extent { length_m, width_m, height_m: 1.8 };
        Actor { id: ActorId(id), kind, pose, z_m: 0.0, extent, velocity_mps: Vector2::new(0.0, 0.0) }
    }

    pub(crate) fn hit(ms: i64, actor: u32) -> Collision {
        Collision {
            stamp: Time::from_ms(ms),
            parties: [ActorId::EGO, ActorId(actor)],
            impulse_n_s: 900.0,
            closing_speed_mps: 7.0,
            speeds_mps: [12.0, 5.0],
        }
    }

    const EGO: Outline = Outline { length_m: 4.93, width_m: 1.86, center_ahead_m: 1.425 };

    /// World state half a second earlier, at speed.
    fn driving() -> WorldState {
        let mut state = world(500, -3.0);
        state.ego.state.speed_mps = 6.0;
        state
    }

    fn outcome(of: impl Fn(&mut WorldState)) -> Outcome {
        let mut state = world(1000, 0.0);
        of(&mut state);
        let mut outcome = Outcome::new(EGO, None, Vec::new());
        outcome.take(&driving());
        outcome.take(&state);
        outcome
    }

    #[test]
    fn every_ending_has_its_verdict() {
        for (end, verdict) in [
            (None, Verdict::Unfinished),
            (Some(EndReason::Goal), Verdict::Avoided),
            (Some(EndReason::Stopped), Verdict::Avoided),
            (Some(EndReason::Timeout), Verdict::Timeout),
            (Some(EndReason::Collision), Verdict::Collision),
        ] {
            let beside = actor(1, ActorKind::Truck, Pose2::new(20.0, 5.0, 0.0), 5.2, 2.6);
            let some = |w: &mut WorldState| (w.ended, w.actors) = (end, vec![beside.clone()]);
            assert_eq!(outcome(some).verdict(), verdict);
        }
        assert_eq!(outcome(|w| w.ended = Some(EndReason::Goal)).verdict(), Verdict::Completed);
    }

    #[test]
    fn ego_standing_before_an_obstacle_has_stopped() {
        let at_end = |x_m: f64, y_m: f64, speed_mps: f64| {
            outcome(|w| {
                w.ended = Some(EndReason::Timeout);
                w.ego.state.speed_mps = speed_mps;
                let far = actor(1, ActorKind::Car, Pose2::new(20.0, 0.0, 0.0), 4.0, 1.8);
                let person = actor(2, ActorKind::Pedestrian, Pose2::new(x_m, y_m, 0.0), 0.5, 0.5);
                w.actors = if x_m < 50.0 { vec![far, person] } else { vec![person] };
            })
        };
        let before = at_end(6.0, 1.0, 0.0);
        assert_eq!((before.verdict(), before.stands_before()), (Verdict::Stopped, Some(ActorId(2))));
        let mut turned = world(1000, 0.0);
        turned.ended = Some(EndReason::Timeout);
        turned.ego.state.pose = Pose2::new(0.0, 1.0, 0.4);
        turned.actors = vec![actor(2, ActorKind::Pedestrian, Pose2::new(4.7, 0.0, 0.0), 0.5, 0.5)];
        let line = Polyline::new(&[Point2::new(-9.0, 0.0), Point2::new(99.0, 0.0)]).unwrap();
        for (route, verdict) in
            [(None, Verdict::Timeout), (Some(Route::uniform(line, 6.0, 2.0)), Verdict::Stopped)]
        {
            let mut outcome = Outcome::new(EGO, route, Vec::new());
            outcome.take(&driving());
            outcome.take(&turned);
            assert_eq!(outcome.verdict(), verdict, "she is beside its outline, and on its route");
        }
        assert_eq!(at_end(6.0, 4.0, 0.0).stands_before(), Some(ActorId(1)), "she is on the pavement");
        assert_eq!(at_end(60.0, 0.0, 0.0).verdict(), Verdict::Timeout, "far away");
        assert_eq!(at_end(6.0, 0.0, 1.0).verdict(), Verdict::Timeout, "it drives");
    }

    /// A light with this signal from 0.7 s on.
    fn light(stop_s_m: f64, signal: Signal) -> LightCourse {
        LightCourse {
            name: "crossing".into(),
            s_m: stop_s_m + 10.0,
            d_m: -3.0,
            stop_s_m,
            shows: vec![(Time::ZERO, Signal::Green), (Time::from_ms(700), signal)],
        }
    }

    #[test]
    fn stop_line_passed_at_red_is_counted_once() {
        let line = Polyline::new(&[Point2::new(-90.0, 0.0), Point2::new(99.0, 0.0)]).unwrap();
        for (signal, passed) in [(Signal::Red, 1), (Signal::Yellow, 0), (Signal::Green, 0), (Signal::Off, 0)]
        {
            let route = Route::uniform(line.clone(), 6.0, 2.0);
            let mut outcome =
                Outcome::new(EGO, Some(route), vec![light(100.0, signal), light(150.0, signal)]);
            for step in 0..20 {
                outcome.take(&world(1000 + 100 * step, step as f64));
            }
            assert_eq!(outcome.red_lights_passed(), passed, "{signal:?}");
        }
    }

    #[test]
    fn ego_stopped_by_gate_or_red_light_has_stopped_unless_it_never_drove() {
        let line = Polyline::new(&[Point2::new(-90.0, 0.0), Point2::new(99.0, 0.0)]).unwrap();
        let (far, holds) = (light(300.0, Signal::Red), GateMode::Holding(StopCause::Emergency));
        // The front is at 93.9 m along the route.
        for (light, gate, drove, speed_mps, verdict, waits) in [
            (&far, holds, true, 0.0, Verdict::Stopped, None),
            (&far, GateMode::Stopping(StopCause::Released), true, 0.0, Verdict::Stopped, None),
            (&far, holds, false, 0.0, Verdict::Timeout, None),
            (&far, holds, true, 0.5, Verdict::Timeout, None),
            (&far, GateMode::Driving, true, 0.0, Verdict::Timeout, None),
            (&light(96.0, Signal::Red), GateMode::Manual, true, 0.0, Verdict::Stopped, Some("crossing")),
            (&light(96.0, Signal::Red), GateMode::Manual, false, 0.0, Verdict::Timeout, None),
            (&light(96.0, Signal::Green), GateMode::Manual, true, 0.0, Verdict::Timeout, None),
            (&light(96.0, Signal::Off), GateMode::Manual, true, 0.0, Verdict::Timeout, None),
            (&light(91.0, Signal::Red), GateMode::Manual, true, 0.0, Verdict::Timeout, None),
            (&light(120.0, Signal::Red), GateMode::Manual, true, 0.0, Verdict::Timeout, None),
        ] {
            let mut outcome =
                Outcome::new(EGO, Some(Route::uniform(line.clone(), 6.0, 2.0)), vec![light.clone()]);
            if drove {
                outcome.take(&driving());
            }
            outcome.gate(gate);
            let mut state = world(1000, 0.0);
            (state.ego.state.speed_mps, state.ended) = (speed_mps, Some(EndReason::Timeout));
            outcome.take(&state);
            let told = (light.stop_s_m, gate, drove, speed_mps);
            assert_eq!((outcome.verdict(), outcome.waits_at_light()), (verdict, waits), "{told:?}");
        }
    }

    #[test]
    fn verdict_prefers_collision_over_leaving_the_road_over_goal() {
        let left = Infraction { stamp: Time::from_ms(900), kind: InfractionKind::LeftRoad };
        let off = outcome(|w| {
            w.infractions.push(left.clone());
            w.ended = Some(EndReason::Goal);
        });
        assert_eq!((off.verdict(), off.left_road_at()), (Verdict::LeftRoad, Some(Time::from_ms(900))));
        let both = outcome(|w| {
            w.infractions.push(left.clone());
            w.collisions.push(hit(950, 2));
        });
        assert_eq!(both.verdict(), Verdict::Collision);
    }

    #[test]
    fn first_contact_counts() {
        let o = outcome(|w| w.collisions = vec![hit(980, 3), hit(950, 2), hit(999, 1)]);
        let impact = o.impact().unwrap();
        assert_eq!((impact.actor, impact.at_s), (ActorId(2), 0.95));
        assert_eq!((impact.ego_speed_mps, impact.closing_speed_mps), (12.0, 7.0));
    }

    #[test]
    fn collision_from_behind_or_at_rest_is_not_at_fault() {
        for (x_m, y_m, speeds_mps, at_fault) in [
            (4.5, 0.0, [12.0, 5.0], true),
            (-3.2, 0.9, [12.0, 15.0], false),
            (-3.2, 0.9, [12.0, 0.0], true),
            // Beside the rear axle.
            (-0.5, 1.8, [12.0, 15.0], true),
            (4.5, 0.0, [0.0, 5.0], false),
        ] {
            let o = outcome(|w| {
                w.actors = vec![actor(2, ActorKind::Car, Pose2::new(x_m, y_m, 0.0), 4.0, 1.8)];
                w.collisions = vec![Collision { speeds_mps, ..hit(950, 2) }];
            });
            assert_eq!(o.impact().map(|impact| impact.at_fault), Some(at_fault), "{x_m} {speeds_mps:?}");
        }
    }

    #[test]
    fn verdict_names_match_the_files() {
        for verdict in Verdict::ALL {
            assert_eq!(serde_json::to_string(&verdict).unwrap(), format!("\"{}\"", verdict.name()));
        }
    }
}
