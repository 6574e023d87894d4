//! All measures of one run.

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_msg::truth::{EndReason, WorldState};
use swerve_msg::{
    ActorId, ActorKind, EgoState, GateOutput, Imu, ObstacleList, Plan, PlanStatus, PoseQuality, Route,
};

use crate::comfort::{Comfort, ComfortMetrics};
use crate::gate::stop_cause;
use crate::traffic::{Norm, Traffic, TrafficMetrics};
use crate::verdict::STANDS_MPS;
use crate::{
    Clearances, Drive, DriveMetrics, GateMetrics, GateStop, GateUse, Impact, LateralJerk, LightCourse,
    Localization, LocalizationMetrics, OperatorMetrics, Outcome, Outline, PlanMetrics, PoseGap,
    ResponseTimes, RunTimes, Summary, Verdict, seconds,
};

/// Facts that an evaluation has to know beforehand.
#[derive(Clone, PartialEq, Debug)]
pub struct Params {
    /// The ego's outline.
    pub ego: Outline,
    /// From latching a command to its first effect.
    pub dead_time: Span,
    /// Names of the operators, in the order of their numbers.
    pub operators: Vec<String>,
    /// Names of the actors, in the order of their identities, which begin at 1; one without is called by its number.
    pub actors: Vec<String>,
    /// The way that the ego is to go, where it is known.
    pub route: Option<Route>,
    /// The traffic lights of that way.
    pub lights: Vec<LightCourse>,
    /// The lane and the speed that the ego is to keep.
    pub norm: Norm,
}

/// The result of a run; `metrics.json` is this struct.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Metrics {
    /// The outcome in one word.
    pub verdict: Verdict,
    /// Why the scenario ended; null when the run was ended before.
    pub end: Option<EndReason>,
    /// Smallest distance between the outlines of the ego and any actor, metres; null without actors.
    pub min_distance_m: Option<f64>,
    /// The actor of that distance.
    pub min_distance_actor: Option<ActorId>,
    /// Its name in the scenario.
    pub min_distance_name: Option<String>,
    /// Its instant, seconds.
    pub min_distance_at_s: Option<f64>,
    /// The first contact; null when nothing was hit.
    pub impact: Option<Impact>,
    /// Name of the actor that was hit.
    pub impact_name: Option<String>,
    /// The actor that the ego stood before at the end; null when it drove, or stood before nothing.
    pub stands_before: Option<ActorId>,
    /// The traffic light that the ego waited at when the run ended; null where it did not.
    #[serde(default)]
    pub waits_at_light: Option<String>,
    /// How many stop lines the ego's front went over while their light was red.
    #[serde(default)]
    pub red_lights_passed: usize,
    /// Speed of the ego at the first contact, m/s; null when nothing was hit.
    pub impact_speed_mps: Option<f64>,
    /// Instant at which part of the ego first left the drivable ground, seconds.
    pub left_road_at_s: Option<f64>,
    /// Largest lateral jerk before the first contact.
    pub lateral_jerk: JerkMetrics,
    /// Comfort as nuPlan defines it; null for a drive of less than 0.4 s.
    pub comfort: Option<ComfortMetrics>,
    /// Driving among others: time to collision, headway, the other lane.
    #[serde(default)]
    pub safety: TrafficMetrics,
    /// The drive; its accelerations and turn rates are those before the first contact.
    pub drive: DriveMetrics,
    /// Response times; null when no command took effect.
    pub response: Option<Summary>,
    /// The actors, ordered by identity.
    pub actors: Vec<ActorMetrics>,
    /// Plans by status.
    pub plans: PlanMetrics,
    /// Use of the safety gate; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate: Option<GateMetrics>,
    /// How far the poses that it drove by were off; absent where they were the simulator's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub localization: Option<LocalizationMetrics>,
    /// Stamp of the last pose that reached its readers and said something new, seconds, where none came any more up to the end;
    /// absent otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_silent_since_s: Option<f64>,
    /// Times in which no new pose reached its readers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pose_gaps: Vec<PoseGap>,
    /// Run times per operator.
    pub operators: Vec<OperatorMetrics>,
}

/// An ego that leaves the road within this time after a gap between poses left it because of that, seconds: plans take as
/// long to lead back to the middle of the lane.
const AFTER_GAP_S: f64 = 4.0;

/// An ego that stood for less than this for its pose did not run out of time for it, seconds.
const STOOD_MIN_S: f64 = 1.0;

/// Who or what decided how a run went.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum DecidedBy<'a> {
    /// An actor: it was hit, is what the ego stands before, or was passed nearest.
    Actor(&'a ActorMetrics),
    /// The safety gate, which was stopping or holding the car at the end.
    Gate(GateStop),
    /// A red light, at which the ego waited at the end; its name.
    Light(&'a str),
    /// The accuracy of the pose, for which the planner stopped the ego: since this instant, seconds.
    Pose(f64),
    /// The controller stopped the ego, since there was no pose from this instant on, seconds.
    NoPose(f64),
    /// The ego left the road without a pose, or soon after.
    LostPose(PoseGap),
    /// The accuracy of the pose, for which the ego stood most of the time that it stood until the time was over, seconds.
    PoseDelay(f64),
    /// Nobody: there was no other.
    Nobody,
}

impl Metrics {
    /// Who or what decided how the run went. What was hit comes before all, then what held the car at the end.
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

    /// The gap between poses in which the ego left the road, or after which it did soon.
    fn gap_before_leaving(&self) -> Option<PoseGap> {
        let left_s = self.left_road_at_s?;
        let is_before = |gap: &&PoseGap| {
            gap.from_s <= left_s && gap.until_s.is_none_or(|until_s| left_s <= until_s + AFTER_GAP_S)
        };
        self.pose_gaps.iter().rev().find(is_before).copied()
    }

    /// Whether the ego stood for long, and most of that for its pose.
    fn stood_for_pose(&self) -> bool {
        let PlanMetrics { stood_s, stood_uncertain_s, .. } = self.plans;
        stood_uncertain_s >= STOOD_MIN_S && stood_uncertain_s > 0.5 * stood_s
    }

    /// The actor that decided the verdict: the one hit, else the one that the ego stands before, else of the people,
    /// else of all, the one passed nearest.
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
    /// Raw difference of successive readings, m/s³.
    pub raw_max_mps3: Option<f64>,
    /// After the low-pass of [`crate::CUTOFF_HZ`], m/s³.
    pub smooth_max_mps3: Option<f64>,
}

/// One actor's part in the run.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct ActorMetrics {
    /// Identity.
    pub actor: ActorId,
    /// Name in the scenario.
    pub name: String,
    /// Kind of road user or thing.
    pub kind: ActorKind,
    /// Smallest distance between its outline and the ego's, metres.
    pub min_distance_m: f64,
    /// Instant of that distance, seconds.
    pub min_distance_at_s: f64,
    /// When a sensor first saw part of it, seconds; null when none did.
    pub first_sight_s: Option<f64>,
}

/// The first instant at which a sensor saw part of an actor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sight {
    /// The actor.
    pub actor: ActorId,
    /// Stamp of the sensor frame.
    pub at: Time,
}

/// Takes in what happens in a run, message by message, and gives its [`Metrics`].
#[derive(Clone, Debug)]
pub struct Evaluation {
    outcome: Outcome,
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
    response: ResponseTimes,
    gate: GateUse,
    localization: Localization,
    runtimes: RunTimes,
    names: Vec<String>,
}

impl Evaluation {
    /// Nothing taken in yet.
    pub fn new(params: Params) -> Self {
        Self {
            traffic: Traffic::new(params.ego, params.route.clone(), params.norm),
            outcome: Outcome::new(params.ego, params.route, params.lights),
            clearances: Clearances::new(params.ego),
            drive: Drive::default(),
            felt_mps2: None,
            jerk: LateralJerk::default(),
            comfort: Comfort::default(),
            plans: PlanMetrics::default(),
            last_plan: None,
            sights: Vec::new(),
            response: ResponseTimes::new(params.dead_time),
            gate: GateUse::default(),
            localization: Localization::default(),
            runtimes: RunTimes::new(params.operators),
            names: params.actors,
        }
    }

    /// The state of the world after one step.
    pub fn world(&mut self, world: &WorldState) {
        self.outcome.take(world);
        self.clearances.take(world);
        let comfort = self.counts_for_comfort(world.stamp);
        self.drive.take(&world.ego.state, comfort);
        if comfort {
            self.comfort.take(&world.ego.state);
            self.traffic.take(world);
        }
        self.felt_mps2 = Some((world.stamp, world.ego.specific_force_mps2.coords.y));
        self.response.world_step(world.stamp);
        self.localization.truth(&world.ego.state);
    }

    /// A pose as it reaches its readers, after the faults of its stream.
    pub fn pose_heard(&mut self, ego: &EgoState) {
        self.localization.heard(ego);
    }

    /// A pose that the stack drives by, after the world state of its stamp.
    pub fn pose(&mut self, ego: &EgoState) {
        let _off_m = self.localization.pose(ego);
    }

    /// What localization says of the pose of the same stamp, after that.
    pub fn pose_quality(&mut self, quality: &PoseQuality) {
        self.localization.quality(quality);
    }

    /// A reading of the inertial measurement unit, after the world state of its stamp. Its instants are those of the jerk;
    /// in a simulated world the acceleration is the true one, without the sensor's noise.
    pub fn imu(&mut self, imu: &Imu) {
        if self.counts_for_comfort(imu.stamp) {
            let felt = self.felt_mps2.filter(|(at, _)| *at == imu.stamp);
            self.jerk.take(imu.stamp, felt.map_or(imu.accel_mps2[1], |(_, lateral)| lateral));
        }
    }

    /// Takes in a sensor's sight of the actors.
    pub fn seen(&mut self, list: &ObstacleList) {
        for obstacle in list.obstacles.iter().filter(|o| o.visible_share > 0.0) {
            if let Err(slot) = self.sights.binary_search_by_key(&obstacle.id, |s| s.actor) {
                self.sights.insert(slot, Sight { actor: obstacle.id, at: list.stamp });
            }
        }
    }

    /// A plan was published.
    pub fn plan(&mut self, plan: &Plan) {
        let before = self.last_plan.replace((plan.stamp, plan.status));
        if let Some((since, status)) = before.filter(|_| self.outcome.stands_again()) {
            self.plans.stood(status, (plan.stamp - since).as_secs().max(0.0));
        }
        self.plans.take(plan);
    }

    /// A command became visible to the world; `origin` is the newest sensor stamp that it derives from.
    pub fn command(&mut self, visible_at: Time, origin: Option<Time>) {
        self.response.command(visible_at, origin);
    }

    /// The safety gate spoke.
    pub fn gate(&mut self, at: Time, output: &GateOutput) {
        self.outcome.gate(output.mode);
        self.gate.take(at, output);
    }

    /// The run-time table, for what the engine tells of steps, misses and drops.
    pub fn runtimes(&mut self) -> &mut RunTimes {
        &mut self.runtimes
    }

    /// First sights so far, ordered by actor.
    pub fn sights(&self) -> &[Sight] {
        &self.sights
    }

    /// The outcome so far.
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// The distances so far.
    pub fn clearances(&self) -> &Clearances {
        &self.clearances
    }

    /// The result.
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
            gate: self.gate.metrics(),
            pose_silent_since_s: self.localization.silent_since().map(seconds),
            pose_gaps: self.localization.gaps(),
            localization: self.localization.metrics(),
            operators: self.runtimes.table(),
        }
    }

    /// The outcome's verdict; an ego at rest that was stopped for its pose did not run out of time.
    fn verdict(&self) -> Verdict {
        let rests = self.drive.metrics().speed_end_mps.abs() <= STANDS_MPS;
        match self.outcome.verdict() {
            Verdict::Timeout if rests && self.stops_for_pose() => Verdict::Stopped,
            verdict => verdict,
        }
    }

    /// True if the ego stopped, or had to, for a pose that was too uncertain or missing.
    fn stops_for_pose(&self) -> bool {
        self.plans.pose_uncertain_since_s.is_some() || self.localization.silent_since().is_some()
    }

    fn actors(&self) -> Vec<ActorMetrics> {
        let sight = |actor| self.sights.iter().find(|s| s.actor == actor).map(|s| seconds(s.at));
        let one = |c: &crate::Clearance| ActorMetrics {
            actor: c.actor,
            name: self.name(c.actor),
            kind: c.kind,
            min_distance_m: c.distance_m,
            min_distance_at_s: seconds(c.at),
            first_sight_s: sight(c.actor),
        };
        self.clearances.each().iter().map(one).collect()
    }

    fn name(&self, actor: ActorId) -> String {
        let place = (actor.0 as usize).checked_sub(1);
        place.and_then(|place| self.names.get(place)).cloned().unwrap_or_else(|| actor.0.to_string())
    }

    /// Whether what was felt at `stamp` is the driving and not a crash.
    fn counts_for_comfort(&self, stamp: Time) -> bool {
        self.outcome.impact_at().is_none_or(|impact| stamp < impact)
    }
}

#[cfg(test)]
mod tests;
