//! The behaviour planner that obeys rights of way.
//!
//! The conflict zones of the route are grouped into blocks: zones between which there is no room to wait. In each frame,
//! the planner decides whether the ego may enter the next block, from the instants at which it and the others would enter
//! and leave each zone. If it may not, the ego stops before the block: at the stop line, if there is one. Once the ego is
//! in a block, or too near to stop, it stops only before a zone in which others are in the way, and only where it is not
//! in the way of others itself.
//!
//! Without a map it drives as [`FollowRoute`](crate::FollowRoute).

mod block;
mod creep;
mod entry;
mod merge;
mod others;
mod people;
mod queue;
mod state;
mod trust;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Time};
use swerve_msg::{ActorId, Decision, DrivingState, ExpectedStop, Signal, StopPoint, StopReason};

use self::block::{Block, OnLane, RouteCrossing};
use self::creep::Around;
use self::entry::{Entry, Refusal, needed_mps2};
use self::merge::{Adaptation, Join};
use self::others::{Others, REST_MPS, Vehicle};
use self::state::Facts;
use self::trust::Trust;
use crate::along::along;
use crate::lights::LightStops;
use crate::{BehaviourPlanner, FollowRouteParams, Roads, Situation};

/// Deceleration at which a block comes into view, m/s², and the time and distance by which it does so earlier.
const VIEW_MPS2: f64 = 1.5;
const VIEW_S: f64 = 2.5;
const VIEW_M: f64 = 10.0;
/// Distance before a place to wait in which the ego counts as waiting there, metres.
const AT_LINE_M: f64 = 6.0;
/// Distance over a place to wait from which it is passed, metres.
const PASSED_M: f64 = 0.5;
/// Deceleration with which a stop that is decided is kept, m/s²: more than that for which one is decided.
const KEEPS_MPS2: f64 = 5.0;
/// Largest deceleration for people at a crossing, m/s².
const CROSSING_MPS2: f64 = 4.0;
/// Time at rest before a stop sign, seconds.
const STOP_SIGN_S: f64 = 1.0;
/// Time for which a way must be free before the ego goes, seconds.
const FREE_S: f64 = 0.5;
/// Share of all reserves that suffices while the ego goes.
const GOES_SHARE: f64 = 0.5;
/// Speed up to which the ego counts as at rest once it has been, m/s.
const CREEPS_MPS: f64 = 1.0;
/// Gap and time gap up to which a vehicle ahead is followed, metres and seconds; and its growth while it is followed.
const FOLLOW_M: f64 = 10.0;
const FOLLOW_S: f64 = 2.0;
const FOLLOW_GROWTH: f64 = 1.5;
/// Deceleration from which a stop is an emergency, m/s²: comfort ends at 4.05 (nuPlan).
const EMERGENCY_MPS2: f64 = 5.0;
/// Distance over the line of its lane from which the ego overtakes, metres.
const OVER_LINE_M: f64 = 0.1;
/// Distance of a light's stop line from the map's up to which they are the same, metres.
const SAME_LINE_M: f64 = 2.0;

/// Parameters of [`RuleBased`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct RuleBasedParams {
    /// Deceleration for a stop at a yellow light or before a junction, m/s²: if it takes more, the ego goes on.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub brake_mps2: f64,
    /// Time from a reason to brake or to start to its effect, seconds.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub reaction_s: f64,
    /// Acceleration of the ego that decisions are based on, m/s².
    #[schemars(range(min = 0.1, max = 10.0))]
    pub gain_mps2: f64,
    /// Reserve between the passage of the ego and those with priority, seconds. With the time to pass a junction from
    /// rest this makes gaps of 5 to 7 s; drivers accept 6.2 s to 7.1 s (Highway Capacity Manual 2010, chapter 19).
    #[schemars(range(min = 0.0, max = 10.0))]
    pub margin_s: f64,
    /// Time at rest after which smaller gaps are accepted, seconds.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub patience_s: f64,
    /// Gap that is accepted then, seconds.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub gap_s: f64,
    /// Speed at which the ego moves up to the first zone of those with priority after it has stopped for them, m/s; 0: it
    /// stays at the line, as it does at lights.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub creep_mps: f64,
}

impl Default for RuleBasedParams {
    fn default() -> Self {
        Self {
            brake_mps2: 3.0,
            reaction_s: 0.5,
            gain_mps2: 2.0,
            margin_s: 1.0,
            patience_s: 20.0,
            gap_s: 3.0,
            creep_mps: 1.5,
        }
    }
}

/// The ego on its route.
#[derive(Clone, Copy, Debug)]
struct Own {
    /// Place of its centre and of its front, metres.
    center_m: f64,
    front_m: f64,
    half_m: f64,
    speed_mps: f64,
    /// Speed on a free road, m/s.
    cruise_mps: f64,
    /// Its origin in the map, metres.
    x_m: f64,
    y_m: f64,
}

impl Own {
    /// Distance within which blocks and crossings are decided about, metres.
    fn view_m(&self) -> f64 {
        self.speed_mps * self.speed_mps / (2.0 * VIEW_MPS2) + VIEW_S * self.speed_mps + VIEW_M
    }
}

/// Memory of a block or crossing.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    /// True if the ego stops before it, and true if it goes.
    stops: bool,
    goes: bool,
    /// Time at rest there, and time for which the way is free, seconds; at rest at most [`FREE_S`].
    waits_s: f64,
    free_s: f64,
    /// True once it has stood before its sign.
    has_stood: bool,
    /// Time at rest by now, or since it may move up, seconds.
    stands_s: f64,
    /// Place to wait that the ego has moved up to or moves up to, metres, and true while it moves.
    creep_m: Option<f64>,
    creeps: bool,
}

/// Zones and crossings of a route.
#[derive(Clone, Debug, Default)]
struct Course {
    route: Option<u64>,
    lanes: Vec<OnLane>,
    blocks: Vec<(Block, Held)>,
    crossings: Vec<(RouteCrossing, Held)>,
    joins: Vec<Join>,
}

/// Obeys lights, signs, rights of way and crossings.
#[derive(Clone, Debug)]
pub struct RuleBased {
    params: RuleBasedParams,
    lights: LightStops,
    others: Others,
    trust: Trust,
    course: Course,
    last: Option<Time>,
    rests: bool,
    follows: Option<ActorId>,
}

/// A place to stop at, and those because of whom.
struct Stop {
    point: StopPoint,
    who: Vec<ActorId>,
}

impl RuleBased {
    /// Creates the planner.
    pub fn new(params: RuleBasedParams) -> Self {
        let RuleBasedParams { brake_mps2, reaction_s, .. } = params;
        Self {
            params,
            lights: LightStops::new(FollowRouteParams { brake_mps2, reaction_s }),
            others: Others::default(),
            trust: Trust::default(),
            course: Course::default(),
            last: None,
            rests: false,
            follows: None,
        }
    }

    /// Stops before blocks, and vehicles that give way in those that the ego passes.
    fn pass_blocks(
        &mut self,
        at: &Situation<'_>,
        own: Own,
        (vehicles, red_m, lead_m): (&[Vehicle], Option<f64>, Option<f64>),
        dt_s: f64,
    ) -> (Vec<Stop>, Vec<ExpectedStop>) {
        let (mut stops, mut expected): (_, Vec<(ActorId, f64)>) = (Vec::new(), Vec::new());
        let view_m = own.view_m();
        self.trust.forget(at.stamp);
        let Course { blocks, crossings, .. } = &mut self.course;
        for (block, held) in blocks {
            let to_m = held.stop_m(block) - own.front_m;
            if block.end_m < own.center_m {
                continue;
            }
            // What comes into view stays in view; behind a red light, nothing is decided yet.
            let is_in_view = held.stops || to_m < view_m;
            if !is_in_view || red_m.is_some_and(|red_m| red_m < block.end_m) {
                break;
            }
            let around = Around { crossings, lead_m };
            let entry = Entry {
                own,
                params: &self.params,
                vehicles,
                waits_s: held.waits_s,
                goes_s: if held.goes { held.free_s } else { 0.0 },
                share: if held.goes { GOES_SHARE } else { 1.0 },
                has_green: block.light_m.is_some_and(|line_m| applies(at, line_m)),
                has_moved_up: held.creep_m.is_some(),
            };
            let mut yielding = entry.must_yield(block);
            yielding.retain(|(other, in_m)| self.trust.expects(other, *in_m, at.stamp));
            let most_mps2 = if held.stops { KEEPS_MPS2 } else { self.params.brake_mps2 };
            let is_over = to_m < if held.stops { -PASSED_M } else { 0.0 };
            let is_before = !is_over && needed_mps2(own.speed_mps, to_m) <= most_mps2;
            let stop = if is_before {
                held.enter(block, &entry, around, dt_s)
            } else {
                (held.stops, held.goes, held.creeps) = (false, true, false);
                held.free_s += dt_s;
                let inside = entry.stop_inside(block);
                inside.map(|(s_m, who)| Stop { point: StopPoint { s_m, cause: StopReason::GiveWay }, who })
            };
            let may_enter = stop.is_none() || !is_before;
            if may_enter {
                expected.extend(yielding.iter().map(|(other, in_m)| (other.id, *in_m)));
            }
            stops.extend(stop);
            if !may_enter {
                break;
            }
        }
        expected.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        expected.dedup_by_key(|one| one.0);
        (stops, expected.into_iter().map(|(id, after_m)| ExpectedStop { id, after_m }).collect())
    }

    /// Stops before crossings.
    fn pass_crossings(&mut self, at: &Situation<'_>, (roads, own): (Roads<'_>, Own)) -> Vec<Stop> {
        let mut stops = Vec::new();
        for (crossing, held) in &mut self.course.crossings {
            let to_m = crossing.stop_m - own.front_m;
            let is_over = to_m < -PASSED_M;
            let most_mps2 = if held.stops { KEEPS_MPS2 } else { CROSSING_MPS2 };
            let can_stop = !is_over && to_m < own.view_m() && needed_mps2(own.speed_mps, to_m) <= most_mps2;
            let who = if can_stop {
                people::in_way(at, roads, (own, &self.params), crossing, held.stops)
            } else {
                None
            };
            held.stops = who.is_some();
            let point = StopPoint { s_m: crossing.stop_m.max(own.front_m), cause: StopReason::Crossing };
            stops.extend(who.map(|who| Stop { point, who: vec![who] }));
        }
        stops
    }

    /// The vehicle ahead of the ego and the place of its rear, if the ego follows it.
    fn lead(&mut self, own: Own, vehicles: &[Vehicle]) -> Option<(ActorId, f64)> {
        let ahead = vehicles.iter().filter_map(|other| {
            let s_m = other.route_m.filter(|s_m| *s_m > own.center_m)?;
            Some((other.id, s_m - other.half_m))
        });
        let (id, rear_m) = ahead.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let growth = if self.follows == Some(id) { FOLLOW_GROWTH } else { 1.0 };
        let near_m = (FOLLOW_M + FOLLOW_S * own.speed_mps) * growth;
        (rear_m - own.front_m < near_m).then_some((id, rear_m))
    }

    /// The speed before the next change of lanes, unless the ego stops before it.
    fn join(
        &mut self,
        (at, roads, own): (&Situation<'_>, Roads<'_>, Own),
        decision: &Decision,
        vehicles: &[Vehicle],
        stop: Option<&Stop>,
    ) -> Option<Adaptation> {
        let next = self.course.joins.iter_mut().find(|one| own.center_m < one.change.at_m)?;
        if stop.is_some_and(|stop| stop.point.s_m < next.over_m) {
            return None;
        }
        let free_mps = decision.speed_mps(own.center_m, self.params.brake_mps2).min(own.cruise_mps);
        next.adapt(own, free_mps, (vehicles, at, roads), &self.params)
    }

    /// Remembers the blocks and crossings of the newest route.
    fn take_route(&mut self, at: &Situation<'_>, roads: Roads<'_>) {
        if self.course.route == Some(at.number) {
            return;
        }
        let held = Held::default();
        let half_m = 0.5 * at.shape.length_m;
        let lanes = block::lanes(at.route, roads.map);
        let blocks = block::blocks(at.route, &lanes, roads, half_m).into_iter();
        let blocks = blocks.map(|block| (block, held)).collect();
        let crossings = block::crossings(at.route, roads).into_iter().map(|one| (one, held)).collect();
        let joins = merge::joins(at.route, &lanes, roads.map);
        self.course = Course { route: Some(at.number), lanes, blocks, crossings, joins };
    }

    /// True if the condition holds for the memory of any block.
    fn any_held(&self, is: impl Fn(&Held) -> bool) -> bool {
        self.course.blocks.iter().any(|(_, held)| is(held))
    }

    /// The state, and the road user because of whom.
    fn state(
        &mut self,
        at: &Situation<'_>,
        own: Own,
        stops: &[Stop],
        (lead, joins): (Option<(ActorId, f64)>, Option<Adaptation>),
    ) -> (DrivingState, Option<ActorId>) {
        let rests_mps = if self.rests { CREEPS_MPS } else { REST_MPS };
        self.rests = own.speed_mps < rests_mps;
        let nearest = stops.first();
        let lead =
            lead.filter(|(_, rear_m)| nearest.is_none_or(|nearest| *rear_m < nearest.point.s_m + PASSED_M));
        self.follows = lead.map(|(id, _)| id);
        let changes = |one: &Join| {
            let [from_m, to_m] = one.change.part_m;
            (from_m..to_m).contains(&own.center_m)
        };
        let facts = Facts {
            stop: nearest.map(|nearest| nearest.point.cause),
            rests: self.rests,
            creeps: self.any_held(|held| held.creeps),
            has_lead: lead.is_some(),
            is_in_junction: at.route.to_junction_m(own.center_m) == 0.0,
            brakes_hard: at.ego.accel_mps2 < -EMERGENCY_MPS2,
            joins: joins.is_some(),
            changes_lane: self.course.joins.iter().any(changes),
            is_over_line: at.place.d_m + 0.5 * at.shape.width_m
                > at.route.lane().left_m(at.place.s_m) + OVER_LINE_M,
        };
        let state = state::next(facts);
        let because = match state {
            DrivingState::Follow => self.follows,
            DrivingState::Merge => joins.and_then(|joins| joins.behind),
            _ => nearest.and_then(|nearest| nearest.who.first().copied()),
        };
        (state, because)
    }
}

impl Held {
    /// Decides whether the ego enters a block before which it can stop; the stop if it does not.
    fn enter(&mut self, block: &Block, entry: &Entry<'_>, around: Around<'_>, dt_s: f64) -> Option<Stop> {
        let own = entry.own;
        let is_near = self.creep_m.is_some() || self.stop_m(block) - own.front_m < AT_LINE_M;
        let waits = is_near && own.speed_mps < REST_MPS;
        self.stands_s = if waits { self.stands_s + dt_s } else { 0.0 };
        if waits || self.creeps {
            self.waits_s += dt_s;
        } else if own.speed_mps > CREEPS_MPS && !self.goes {
            // One that goes after long waiting still accepts a smaller gap.
            self.waits_s = 0.0;
        }
        self.has_stood |= waits && self.waits_s >= STOP_SIGN_S;
        // A front that is over the line by a little stays where it is.
        let stop = |held: &Self, cause, who| {
            let point = StopPoint { s_m: held.stop_m(block).max(own.front_m), cause };
            Some(Stop { point, who })
        };
        if block.has_stop_sign && !self.has_stood {
            (self.stops, self.goes) = (true, false);
            return stop(self, StopReason::StopSign, Vec::new());
        }
        let Some(refusal) = entry.refusal(block) else {
            // Until it moves, it does not use the gap.
            self.free_s = (self.free_s + dt_s).min(if waits { FREE_S } else { f64::INFINITY });
            self.stops &= self.free_s < FREE_S;
            self.goes = !self.stops;
            self.creeps &= self.stops;
            return self.stops.then(|| stop(self, StopReason::GiveWay, Vec::new())).flatten();
        };
        (self.free_s, self.stops, self.goes) = (0.0, true, false);
        match refusal {
            Refusal::GiveWay(who) => {
                self.move_up(block, entry, around);
                stop(self, StopReason::GiveWay, who)
            }
            Refusal::NoRoom(who) => {
                self.creeps = false;
                stop(self, StopReason::NoRoom, vec![who])
            }
        }
    }
}

/// True if the light at a stop line applies: also if it is not seen, but not if it is off.
fn applies(at: &Situation<'_>, line_m: f64) -> bool {
    let lights = at.lights.map_or(&[][..], |lights| &lights.lights);
    let mut own = lights
        .iter()
        .filter(|light| light.stop_s_m.is_some_and(|stop_m| (stop_m - line_m).abs() < SAME_LINE_M));
    !own.any(|light| light.signal == Some(Signal::Off))
}

impl BehaviourPlanner for RuleBased {
    fn decide(&mut self, at: &Situation<'_>) -> Decision {
        let mut decision = along(at);
        let light = |s_m: &f64| Stop {
            point: StopPoint { s_m: *s_m, cause: StopReason::TrafficLight },
            who: Vec::new(),
        };
        let mut stops: Vec<Stop> = self.lights.update(at).iter().map(light).collect();
        let dt_s = self.last.map_or(0.0, |last| (at.stamp - last).as_secs().max(0.0));
        self.last = Some(at.stamp);
        let center_m = at.place.s_m + at.shape.center_ahead_m();
        let own = Own {
            center_m,
            front_m: at.front_s_m(),
            half_m: 0.5 * at.shape.length_m,
            speed_mps: at.ego.speed_mps.max(0.0),
            cruise_mps: at.cruise_mps,
            x_m: at.ego.pose.x_m,
            y_m: at.ego.pose.y_m,
        };
        if let Some(roads) = at.roads.filter(|_| at.ego.is_plausible()) {
            self.take_route(at, roads);
            let vehicles = self.others.update(at, roads, &self.course.lanes);
            let lead = self.lead(own, &vehicles);
            let blocks = self.course.blocks.iter().map(|(block, _)| block.stop_m);
            let crossings = self.course.crossings.iter().map(|(crossing, _)| crossing.stop_m);
            decision.waiting = queue::waiting(own, blocks.chain(crossings), &vehicles);
            let lead_m = lead.map(|(_, rear_m)| rear_m);
            let red_m = stops.iter().map(|stop| stop.point.s_m).reduce(f64::min);
            let (more, expected) = self.pass_blocks(at, own, (&vehicles, red_m, lead_m), dt_s);
            let has_moved_up = self.any_held(|held| held.stops && held.creep_m.is_some());
            if let Some(stop) = more.first().filter(|_| has_moved_up) {
                decision.limits =
                    creep::slow(&decision.limits, [at.place.s_m, stop.point.s_m], self.params.creep_mps);
            }
            decision.expected_to_yield = expected;
            stops.extend(more);
            stops.extend(self.pass_crossings(at, (roads, own)));
            stops.sort_by(|a, b| a.point.s_m.total_cmp(&b.point.s_m));
            let joins = self.join((at, roads, own), &decision, &vehicles, stops.first());
            if let Some(Adaptation { speed_mps, until_m, stop_m, behind }) = joins {
                decision.limits = creep::slow(&decision.limits, [at.place.s_m, until_m], speed_mps);
                let stop = stop_m.map(|s_m| StopPoint { s_m, cause: StopReason::GiveWay });
                stops.splice(..0, stop.map(|point| Stop { point, who: behind.into_iter().collect() }));
            }
            let (state, because) = self.state(at, own, &stops, (lead, joins));
            (decision.state, decision.because) = (Some(state), because);
        }
        let gives_way = stops.iter().filter(|stop| stop.point.cause == StopReason::GiveWay);
        decision.yields = gives_way.flat_map(|stop| stop.who.iter().copied()).collect();
        decision.yields.sort_unstable();
        decision.yields.dedup();
        decision.expected_to_yield.retain(|one| decision.yields.binary_search(&one.id).is_err());
        decision.stops = stops.into_iter().map(|stop| stop.point).collect();
        decision
    }
}

#[cfg(test)]
mod tests;
