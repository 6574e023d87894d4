//! All metrics of a run.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_msg::truth::{EndReason, WorldState};
use swerve_msg::{
    ActorId, ActorKind, ActorNames, Decision, EgoState, GateOutput, Imu, ObstacleList, Plan, PlanStatus,
    PoseQuality, Route, TrackList,
};

use crate::comfort::{Comfort, ComfortMetrics};
use crate::gate::stop_cause;
use crate::others::{Others, OthersImpact};
use crate::score::DrivingScores;
use crate::traffic::{Norm, Traffic, TrafficMetrics};
use crate::verdict::STANDS_MPS;
use crate::{
    Behaviour, BehaviourMetrics, Clearances, Drive, DriveMetrics, GateMetrics, GateStop, GateUse, Impact,
    LateralJerk, LightCourse, Localization, LocalizationMetrics, OperatorMetrics, Outcome, Outline,
    PlanMetrics, PoseGap, ResponseTimes, RunTimes, Summary, TrackComparison, TrackMetrics, Verdict, seconds,
};

/// Inputs of an evaluation that are known before the run.
#[derive(Clone, PartialEq, Debug)]
pub struct Params {
    /// The ego's outline.
    pub ego: Outline,
    /// Time from latching a command to its first effect.
    pub dead_time: Span,
    /// Operator names, in the order of their numbers.
    pub operators: Vec<String>,
    /// Actor names; an actor without a name is called by its number.
    pub actors: ActorNames,
    /// Route of the ego, if known.
    pub route: Option<Route>,
    /// Traffic lights along the route.
    pub lights: Vec<LightCourse>,
    /// Lane and speed that the ego is to keep.
    pub norm: Norm,
    /// True if the tracks are those of detected boxes.
    pub tracks_boxes: bool,
}

/// Result of a run; the content of `metrics.json`.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Metrics {
    /// Outcome of the run.
    pub verdict: Verdict,
    /// Reason for the end of the scenario; null if the run ended before.
    pub end: Option<EndReason>,
    /// Smallest distance between the outlines of the ego and any actor, metres; null without actors.
    pub min_distance_m: Option<f64>,
    /// Id of the actor at that distance.
    pub min_distance_actor: Option<ActorId>,
    /// Name of that actor in the scenario.
    pub min_distance_name: Option<String>,
    /// Instant of that distance, seconds.
    pub min_distance_at_s: Option<f64>,
    /// First contact; null without a collision.
    pub impact: Option<Impact>,
    /// Name of the actor hit.
    pub impact_name: Option<String>,
    /// Actor in front of which the ego stood at the end; null if it was moving, or stood before nothing.
    pub stands_before: Option<ActorId>,
    /// Traffic light at which the ego waited when the run ended; null if it did not.
    #[serde(default)]
    pub waits_at_light: Option<String>,
    /// Number of stop lines that the ego's front passed at red.
    #[serde(default)]
    pub red_lights_passed: usize,
    /// Speed of the ego at the first contact, m/s; null without a collision.
    pub impact_speed_mps: Option<f64>,
    /// Number of collisions between two others.
    #[serde(default)]
    pub collisions_of_others: usize,
    /// First of them; absent if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_collision_of_others: Option<OthersImpact>,
    /// Instant at which part of the ego first left the drivable area, seconds.
    pub left_road_at_s: Option<f64>,
    /// Largest lateral jerk before the first contact.
    pub lateral_jerk: JerkMetrics,
    /// Comfort as nuPlan defines it; null for a drive of less than 0.4 s.
    pub comfort: Option<ComfortMetrics>,
    /// Interaction with traffic: time to collision, headway, use of the opposite lane.
    #[serde(default)]
    pub safety: TrafficMetrics,
    /// Motion of the ego; accelerations and turn rates only before the first contact.
    pub drive: DriveMetrics,
    /// Response times; null if no command took effect.
    pub response: Option<Summary>,
    /// Actors, ordered by id.
    pub actors: Vec<ActorMetrics>,
    /// Plan counts by status.
    pub plans: PlanMetrics,
    /// States of the behaviour planner; absent if it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub behaviour: Option<BehaviourMetrics>,
    /// Use of the safety gate; absent without a gate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate: Option<GateMetrics>,
    /// Error of the poses used for driving; absent if they are the simulator's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub localization: Option<LocalizationMetrics>,
    /// Stamp of the last new pose that reached its readers, if none arrived up to the end, seconds; absent otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_silent_since_s: Option<f64>,
    /// Periods in which no new pose reached its readers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pose_gaps: Vec<PoseGap>,
    /// Run times per operator.
    pub operators: Vec<OperatorMetrics>,
    /// Tracks of detected boxes; absent for a pipeline without a detector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracks: Option<TrackMetrics>,
    /// Driving scores; absent for drives without a goal on a map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scores: Option<DrivingScores>,
}

/// Maximum time from a gap between poses to leaving the road because of it, seconds: the time that plans take to lead
/// back to the lane centre.
const AFTER_GAP_S: f64 = 4.0;

/// Standstill because of the pose below which a time-out is not attributed to it, seconds.
const STOOD_MIN_S: f64 = 1.0;

/// Largest age of a list of tracks that is compared with the truth.
const RECENT: Span = Span::from_ms(3000);

/// Actor or cause that decided the result of a run.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum DecidedBy<'a> {
    /// An actor: it was hit, blocks the ego, or was passed nearest.
    Actor(&'a ActorMetrics),
    /// The safety gate, which was stopping or holding the car at the end.
    Gate(GateStop),
    /// A red light at which the ego waited at the end, by name.
    Light(&'a str),
    /// Pose uncertainty, because of which the planner stopped the ego; since this instant, seconds.
    Pose(f64),
    /// A missing pose, because of which the controller stopped the ego; since this instant, seconds.
    NoPose(f64),
    /// A gap between poses: the ego left the road during it, or soon after.
    LostPose(PoseGap),
    /// Pose uncertainty, because of which the ego stood most of its time at rest until the time-out; duration, seconds.
    PoseDelay(f64),
    /// No cause: there was no actor.
    Nobody,
}

impl Metrics {
    /// Cause of the result. A collision has precedence over what held the car at the end.
    pub fn decided_by(&self) -> DecidedBy<'_> {
        let actor = || self.deciding_actor().map_or(DecidedBy::Nobody, DecidedBy::Actor);
        if self.impact.is_some() {
            return actor();
        }
        if let Some(gap) = self.gap_before_leaving() {
            return DecidedBy::LostPose(gap);
        }
        let held = self.gate.as_ref().filter(|gate| stop_cause(gate.end).is_some());
        if let Some(stop) = held.and_then(|gate| gate.stops.last()) {
            return DecidedBy::Gate(*stop);
        }
        match &self.waits_at_light {
            Some(light) if self.stands_before.is_none() => DecidedBy::Light(light),
            _ if self.verdict == Verdict::Timeout && self.stood_for_pose() => {
                DecidedBy::PoseDelay(self.plans.stood_uncertain_s)
            }
            _ if self.verdict == Verdict::Stopped && self.stands_before.is_none() => {
                let none = || self.pose_silent_since_s.map_or_else(actor, DecidedBy::NoPose);
                self.plans.pose_uncertain_since_s.map_or_else(none, DecidedBy::Pose)
            }
            _ => actor(),
        }
    }

    /// Gap between poses during which, or soon after which, the ego left the road.
    fn gap_before_leaving(&self) -> Option<PoseGap> {
        let left_s = self.left_road_at_s?;
        let is_before = |gap: &&PoseGap| {
            gap.from_s <= left_s && gap.until_s.is_none_or(|until_s| left_s <= until_s + AFTER_GAP_S)
        };
        self.pose_gaps.iter().rev().find(is_before).copied()
    }

    /// True if the ego stood for long, mostly because of its pose.
    fn stood_for_pose(&self) -> bool {
        let PlanMetrics { stood_s, stood_uncertain_s, .. } = self.plans;
        stood_uncertain_s >= STOOD_MIN_S && stood_uncertain_s > 0.5 * stood_s
    }

    /// Actor that decided the verdict: the one hit, else the one that blocks the ego, else the nearest pedestrian, else
    /// the nearest actor.
    pub fn deciding_actor(&self) -> Option<&ActorMetrics> {
        let decided = self.impact.map(|impact| impact.actor).or(self.stands_before);
        if let Some(actor) = decided {
            return self.actors.iter().find(|a| a.actor == actor);
        }
        let nearest = |people: bool| {
            let of = self.actors.iter().filter(move |a| !people || a.kind.is_person());
            of.min_by(|a, b| a.min_distance_m.total_cmp(&b.min_distance_m))
        };
        nearest(true).or_else(|| nearest(false))
    }
}

/// Largest lateral jerk of the readings at the centre of gravity.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct JerkMetrics {
    /// Difference of successive readings over their spacing, m/s³.
    pub raw_max_mps3: Option<f64>,
    /// After the low-pass of [`crate::CUTOFF_HZ`], m/s³.
    pub smooth_max_mps3: Option<f64>,
}

/// Metrics of one actor.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct ActorMetrics {
    /// Actor id.
    pub actor: ActorId,
    /// Name in the scenario.
    pub name: String,
    /// Kind of road user or object.
    pub kind: ActorKind,
    /// Smallest distance between its outline and the ego's, metres.
    pub min_distance_m: f64,
    /// Instant of that distance, seconds.
    pub min_distance_at_s: f64,
    /// Stamp of the first sensor frame in which part of it was visible, seconds; null if never.
    pub first_sight_s: Option<f64>,
    /// Instant at which its first track after that reached its readers, seconds; absent if it had none, or if the
    /// pipeline has no detector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracked_s: Option<f64>,
    /// Instant at which a track of it with the right velocity, to 0.6 m/s, reached its readers, seconds; absent like
    /// `tracked_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_known_s: Option<f64>,
}

/// First sensor frame in which part of an actor was visible.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sight {
    /// The actor.
    pub actor: ActorId,
    /// Stamp of the sensor frame.
    pub at: Time,
}

/// Accumulates the messages of a run and computes its [`Metrics`].
#[derive(Clone, Debug)]
pub struct Evaluation {
    outcome: Outcome,
    others: Others,
    clearances: Clearances,
    drive: Drive,
    /// Lateral specific force at the centre of gravity in the newest world state.
    felt_mps2: Option<(Time, f64)>,
    jerk: LateralJerk,
    comfort: Comfort,
    traffic: Traffic,
    plans: PlanMetrics,
    /// Stamp and status of the newest plan.
    last_plan: Option<(Time, PlanStatus)>,
    sights: Vec<Sight>,
    /// Recent states of the world, for a pipeline with a detector.
    recent: VecDeque<WorldState>,
    /// Tracks of detected boxes; `None` for a pipeline without a detector.
    tracks: Option<TrackComparison>,
    response: ResponseTimes,
    behaviour: Behaviour,
    gate: GateUse,
    localization: Localization,
    runtimes: RunTimes,
    names: ActorNames,
}

impl Evaluation {
    /// Creates an empty evaluation.
    pub fn new(params: Params) -> Self {
        Self {
            traffic: Traffic::new(params.ego, params.route.clone(), params.norm),
            outcome: Outcome::new(params.ego, params.route, params.lights),
            others: Others::default(),
            clearances: Clearances::new(params.ego),
            drive: Drive::default(),
            felt_mps2: None,
            jerk: LateralJerk::default(),
            comfort: Comfort::default(),
            plans: PlanMetrics::default(),
            last_plan: None,
            sights: Vec::new(),
            recent: VecDeque::new(),
            tracks: params.tracks_boxes.then(TrackComparison::default),
            response: ResponseTimes::new(params.dead_time),
            behaviour: Behaviour::default(),
            gate: GateUse::default(),
            localization: Localization::default(),
            runtimes: RunTimes::new(params.operators),
            names: params.actors,
        }
    }

    /// Takes the newest route of the ego, with the lights along it.
    pub fn follow(&mut self, route: &Route, lights: Vec<LightCourse>) {
        if self.traffic.is_on(route) {
            return;
        }
        self.traffic.follow(route.clone());
        self.outcome.follow(route.clone(), lights);
    }

    /// Adds the world state after one step.
    pub fn world(&mut self, world: &WorldState) {
        self.outcome.take(world);
        self.others.take(world);
        self.clearances.take(world);
        let comfort = self.counts_for_comfort(world.stamp);
        self.drive.take(&world.ego.state, comfort);
        if comfort {
            self.comfort.take(&world.ego.state);
            self.traffic.take(world);
        }
        if self.tracks.is_some() {
            while self.recent.front().is_some_and(|oldest| world.stamp - oldest.stamp > RECENT) {
                self.recent.pop_front();
            }
            self.recent.push_back(world.clone());
        }
        self.felt_mps2 = Some((world.stamp, world.ego.specific_force_mps2.coords.y));
        self.response.world_step(world.stamp);
        self.localization.truth(&world.ego.state);
        self.behaviour.ego(&world.ego.state);
    }

    /// Adds a pose as it reaches its readers, after the faults of its stream.
    pub fn pose_heard(&mut self, ego: &EgoState) {
        self.localization.heard(ego);
    }

    /// Adds a pose used for driving, after the world state of its stamp.
    pub fn pose(&mut self, ego: &EgoState) {
        let _off_m = self.localization.pose(ego);
    }

    /// Adds the pose quality reported by localization, after the pose of the same stamp.
    pub fn pose_quality(&mut self, quality: &PoseQuality) {
        self.localization.quality(quality);
    }

    /// Adds an IMU reading, after the world state of its stamp. The jerk is sampled at its instants; in a simulated
    /// world the true acceleration is used, without sensor noise.
    pub fn imu(&mut self, imu: &Imu) {
        if self.counts_for_comfort(imu.stamp) {
            let felt = self.felt_mps2.filter(|(at, _)| *at == imu.stamp);
            self.jerk.take(imu.stamp, felt.map_or(imu.accel_mps2[1], |(_, lateral)| lateral));
        }
    }

    /// Adds the actors seen by a sensor.
    pub fn seen(&mut self, list: &ObstacleList) {
        for obstacle in list.obstacles.iter().filter(|o| o.visible_share > 0.0) {
            if let Err(slot) = self.sights.binary_search_by_key(&obstacle.id, |s| s.actor) {
                self.sights.insert(slot, Sight { actor: obstacle.id, at: list.stamp });
            }
        }
    }

    /// Adds a list of tracks that reaches its readers at `at`, after the world state of its stamp.
    pub fn tracks(&mut self, list: &TrackList, at: Time) {
        let Some(tracks) = &mut self.tracks else { return };
        let truth = self.recent.iter().rev().find(|state| state.stamp <= list.stamp);
        if let Some(truth) = truth {
            tracks.add((list, at), truth, &self.sights, |_| None);
        }
    }

    /// Adds a published plan.
    pub fn plan(&mut self, plan: &Plan) {
        let before = self.last_plan.replace((plan.stamp, plan.status));
        if let Some((since, status)) = before.filter(|_| self.outcome.stands_again()) {
            self.plans.stood(status, (plan.stamp - since).as_secs().max(0.0));
        }
        self.plans.take(plan);
    }

    /// Adds a command that became visible to the world; `origin` is the newest sensor stamp that it derives from.
    pub fn command(&mut self, visible_at: Time, origin: Option<Time>) {
        self.response.command(visible_at, origin);
    }

    /// Adds a decision of the behaviour planner that became visible at `at`; `names` are those of tracks.
    pub fn decision(&mut self, at: Time, decision: &Decision, names: &ActorNames) {
        self.behaviour.take(at, decision, names);
    }

    /// Adds an output of the safety gate.
    pub fn gate(&mut self, at: Time, output: &GateOutput) {
        self.outcome.gate(output.mode);
        self.gate.take(at, output);
    }

    /// Run-time table, to which the engine's steps, misses and drops are added.
    pub fn runtimes(&mut self) -> &mut RunTimes {
        &mut self.runtimes
    }

    /// First sights so far, ordered by actor.
    pub fn sights(&self) -> &[Sight] {
        &self.sights
    }

    /// Outcome so far.
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// Distances so far.
    pub fn clearances(&self) -> &Clearances {
        &self.clearances
    }

    /// Metrics so far.
    pub fn metrics(&self) -> Metrics {
        let nearest = self.clearances.smallest();
        let impact = self.outcome.impact();
        Metrics {
            verdict: self.verdict(),
            end: self.outcome.end(),
            min_distance_m: nearest.map(|c| c.distance_m),
            min_distance_actor: nearest.map(|c| c.actor),
            min_distance_name: nearest.map(|c| self.name(c.actor)),
            min_distance_at_s: nearest.map(|c| seconds(c.at)),
            impact,
            impact_name: impact.map(|i| self.name(i.actor)),
            stands_before: self.outcome.stands_before(),
            waits_at_light: self.outcome.waits_at_light().map(str::to_owned),
            red_lights_passed: self.outcome.red_lights_passed(),
            impact_speed_mps: impact.map(|i| i.ego_speed_mps),
            collisions_of_others: self.others.count(),
            first_collision_of_others: self.others.first(|actor| self.name(actor)),
            left_road_at_s: self.outcome.left_road_at().map(seconds),
            lateral_jerk: JerkMetrics {
                raw_max_mps3: self.jerk.raw_max_mps3(),
                smooth_max_mps3: self.jerk.smooth_max_mps3(),
            },
            comfort: self.comfort.metrics(),
            safety: self.traffic.metrics(),
            drive: self.drive.metrics(),
            response: self.response.summary(),
            actors: self.actors(),
            plans: self.plans,
            behaviour: self.behaviour.metrics(),
            gate: self.gate.metrics(),
            pose_silent_since_s: self.localization.silent_since().map(seconds),
            pose_gaps: self.localization.gaps(),
            localization: self.localization.metrics(),
            operators: self.runtimes.table(),
            tracks: self.tracks.as_ref().map(TrackComparison::metrics),
            scores: None,
        }
    }

    /// Verdict of the outcome; an ego at rest that was stopped for its pose counts as stopped, not as out of time.
    fn verdict(&self) -> Verdict {
        let rests = self.drive.metrics().speed_end_mps.abs() <= STANDS_MPS;
        match self.outcome.verdict() {
            Verdict::Timeout if rests && self.stops_for_pose() => Verdict::Stopped,
            verdict => verdict,
        }
    }

    /// True if the ego stopped, or had to, because its pose was too uncertain or missing.
    fn stops_for_pose(&self) -> bool {
        self.plans.pose_uncertain_since_s.is_some() || self.localization.silent_since().is_some()
    }

    fn actors(&self) -> Vec<ActorMetrics> {
        let sight = |actor| self.sights.iter().find(|s| s.actor == actor).map(|s| seconds(s.at));
        let followed = |actor| self.tracks.as_ref().map(|tracks| tracks.followed(actor)).unwrap_or_default();
        let one = |c: &crate::Clearance| ActorMetrics {
            actor: c.actor,
            name: self.name(c.actor),
            kind: c.kind,
            min_distance_m: c.distance_m,
            min_distance_at_s: seconds(c.at),
            first_sight_s: sight(c.actor),
            tracked_s: followed(c.actor).tracked_s,
            velocity_known_s: followed(c.actor).velocity_known_s,
        };
        self.clearances.each().iter().map(one).collect()
    }

    fn name(&self, actor: ActorId) -> String {
        self.names.get(&actor).cloned().unwrap_or_else(|| actor.0.to_string())
    }

    /// True if the acceleration at `stamp` is due to driving and not to a crash.
    fn counts_for_comfort(&self, stamp: Time) -> bool {
        self.outcome.impact_at().is_none_or(|impact| stamp < impact)
    }
}

#[cfg(test)]
mod tests;
