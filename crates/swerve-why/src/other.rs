//! Causal chain of a run not decided by an actor: safety gate, pose, red light, end of the route or time-out.

use swerve_core::{Span, Time};
use swerve_drive::light_courses;
use swerve_eval::{Account, DecidedBy, GateStop, LightCourse, Metrics, Milestone, PoseGap, Verdict, Why};
use swerve_geom::LineTracker;
use swerve_msg::truth::{EndReason, WorldState};
use swerve_msg::{EgoState, Signal};
use swerve_stack::pipeline::Pipeline;

use super::ego_only::EgoOnly;
use super::{BRAKES_MPS2, Logged};

/// Speed below which the car counts as stationary, m/s, and minimum duration of a reported standstill.
const STANDS_MPS: f64 = 0.1;
const STANDS: Span = Span::from_ms(500);
/// Range of the front of a car waiting at a stop line: distances before and beyond the line, metres.
const BEFORE_LINE_M: f64 = 25.0;
const BEYOND_LINE_M: f64 = 1.0;

/// Maximum time from a pose gap to a gate stop caused by it, seconds.
const GATE_AFTER_S: f64 = 0.3;

/// A step, its time, and the time that passed before it.
type Step = (Milestone, Time, String);

/// The ego's drive and the lights on its route.
struct Way<'a> {
    metrics: &'a Metrics,
    states: Vec<EgoState>,
    /// Position of the ego's front along the route at each state, metres.
    front_s_m: Vec<f64>,
    lights: Vec<LightCourse>,
}

/// Causal chain of a drive with these metrics, from its log.
pub(super) fn told(logged: &Logged, pipeline: &Pipeline, metrics: &Metrics) -> anyhow::Result<Why> {
    let way = Way::new(logged, pipeline, metrics)?;
    let (sentence, mut steps) = match metrics.decided_by() {
        DecidedBy::Gate(stop) => way.gate(stop),
        DecidedBy::Pose(since_s) => {
            way.uncertain(since_s, "its pose was too uncertain for the lane: the planner braked")
        }
        DecidedBy::NoPose(since_s) => way.uncertain(since_s, "it had no pose: none came"),
        DecidedBy::LostPose(gap) => way.without_pose(gap),
        DecidedBy::PoseDelay(stood_s) => way.delayed(stood_s),
        _ => way.lights_and_end(),
    };
    steps.sort_by_key(|(_, at, _)| *at);
    let mut accounts: Vec<Account> = Vec::new();
    for (what, at, reason) in steps {
        let waited = accounts.last().map_or(Span::ZERO, |last| at - last.1);
        let waited = if waited > Span::ZERO { vec![(reason, waited)] } else { Vec::new() };
        accounts.push((what, at, waited));
    }
    Ok(Why::without_actor(metrics.verdict, sentence, &accounts))
}

impl<'a> Way<'a> {
    fn new(logged: &Logged, pipeline: &Pipeline, metrics: &'a Metrics) -> anyhow::Result<Self> {
        let mut states = Vec::new();
        if let Some(world) = pipeline.assembly.publisher::<WorldState>() {
            for publication in logged.log.publications(world) {
                states.push(publication.decode::<EgoOnly>()?.0.state);
            }
        }
        let lights = light_courses(&pipeline.scenario.road, &pipeline.route, pipeline.until);
        let shape = &pipeline.vehicle.shape;
        let front_m = shape.center_ahead_m() + 0.5 * shape.length_m;
        let mut place = LineTracker::default();
        let mut front = |state: &EgoState| place.locate(pipeline.route.line(), state.pose.ahead(front_m)).s_m;
        // Without traffic lights there are no stop lines to compare with.
        let front_s_m = if lights.is_empty() { Vec::new() } else { states.iter().map(&mut front).collect() };
        Ok(Self { metrics, states, front_s_m, lights })
    }

    /// The gate stopped the car.
    fn gate(&self, stop: GateStop) -> (String, Vec<Step>) {
        let at = Time::ZERO + Span::from_secs(stop.at_s);
        let before = self.states.partition_point(|state| state.stamp <= at).saturating_sub(1);
        let then = self.states.get(before).copied().unwrap_or_default();
        let after = &self.states[before..];
        let mut steps = vec![(Milestone::GateStop, at, String::new())];
        let mut text =
            format!("the safety gate stopped it from {:.2} s on ({})", stop.at_s, stop.cause.words());
        let brakes = after.iter().find(|state| then.accel_mps2 - state.accel_mps2 >= BRAKES_MPS2);
        if let Some(brakes) = brakes {
            text += &format!(", it braked {:.0} ms later", (brakes.stamp - at).as_ms());
            steps.push((Milestone::Effect, brakes.stamp, "pedals and actuators".into()));
        }
        match after.iter().find(|state| is_still(state)) {
            Some(stands) => {
                text += &format!(" and stood from {:.2} s on", stands.stamp.max(at).as_secs());
                steps.push((Milestone::Standstill, stands.stamp.max(at), "braking".into()));
            }
            None => text += " and did not come to a standstill",
        }
        // Without a pose the controller stops publishing, which is the cause that the gate reports.
        let is_then = |gap: &&PoseGap| {
            gap.from_s <= stop.at_s && gap.until_s.is_none_or(|until_s| stop.at_s <= until_s + GATE_AFTER_S)
        };
        if let Some(gap) = self.metrics.pose_gaps.iter().find(is_then) {
            text += &format!("; {}", no_pose(gap));
        }
        if let Some(left_s) = self.metrics.left_road_at_s {
            text = format!("it left the road at {left_s:.2} s; {text}");
        }
        text += &self.nearest();
        (text, steps)
    }

    /// The car stopped because of its pose.
    fn uncertain(&self, since_s: f64, reason: &str) -> (String, Vec<Step>) {
        let since = Time::ZERO + Span::from_secs(since_s);
        let mut text = format!("it stopped because {reason} from {since_s:.2} s on");
        let mut steps = vec![(Milestone::Planned, since, String::new())];
        if let Some(stands) = self.states.iter().find(|state| state.stamp >= since && is_still(state)) {
            text += &format!(" and it stood from {:.2} s on", stands.stamp.as_secs());
            steps.push((Milestone::Standstill, stands.stamp, "braking".into()));
        }
        (text, steps)
    }

    /// The car left the road without a pose, or soon after.
    fn without_pose(&self, gap: PoseGap) -> (String, Vec<Step>) {
        let left_s = self.metrics.left_road_at_s.unwrap_or_default();
        let mut text = format!("it left the road at {left_s:.2} s; {}", no_pose(&gap));
        let mut stops = self.metrics.gate.iter().flat_map(|gate| &gate.stops);
        if let Some(stop) = stops.find(|stop| stop.at_s >= gap.from_s) {
            let cause = stop.cause.words();
            text += &format!("; the safety gate stopped it from {:.2} s on ({cause})", stop.at_s);
        }
        (text + &self.nearest(), self.rest_and_end())
    }

    /// The time ran out while the car stood most of the time because of its pose.
    fn delayed(&self, stood_s: f64) -> (String, Vec<Step>) {
        let reason = "because its pose was too uncertain for the lane";
        let text = format!("{}; it had stood for {stood_s:.1} s {reason}", self.end());
        (text + &self.nearest(), self.rest_and_end())
    }

    /// The first standstill after driving, and the end.
    fn rest_and_end(&self) -> Vec<Step> {
        let moves = self.states.iter().position(|state| !is_still(state)).unwrap_or(self.states.len());
        let stands = self.states[moves..].iter().find(|state| is_still(state));
        let stands = stands.map(|state| (Milestone::Standstill, state.stamp, "driving".into()));
        let went_by = if stands.is_some() { "standing and driving" } else { "driving" };
        let end = self.states.last().map(|state| (Milestone::End, state.stamp, went_by.into()));
        stands.into_iter().chain(end).collect()
    }

    /// Describes the nearest actor.
    fn nearest(&self) -> String {
        let nearest = self.metrics.min_distance_m.zip(self.metrics.min_distance_name.as_ref());
        nearest.map_or_else(
            || "; there was no other road user".into(),
            |(away_m, name)| format!("; {name} was nearest, {away_m:.2} m away"),
        )
    }

    /// The car waited at lights, or drove undisturbed.
    fn lights_and_end(&self) -> (String, Vec<Step>) {
        let waits = self.waits();
        let mut steps = Vec::new();
        let mut notes = Vec::new();
        for &(light, from, until) in &waits {
            let light = &self.lights[light];
            let turned = light.shows.iter().rev().filter(|(at, _)| *at <= from.stamp);
            let turned = turned.take_while(|(_, signal)| signal.holds()).last();
            let name = &light.name;
            steps.extend(turned.map(|(at, _)| (Milestone::Light, *at, "driving".into())));
            steps.push((Milestone::Standstill, from.stamp, format!("driving up to the line of {name}")));
            let mut note = format!("it waited at the light {name} from {:.2} s on", from.stamp.as_secs());
            if let Some(until) = until {
                note = format!(
                    "it waited at the light {name} from {:.2} to {:.2} s",
                    from.stamp.as_secs(),
                    until.as_secs()
                );
                steps.push((Milestone::MovesOff, until, format!("waiting at {name}")));
            }
            notes.push(note);
        }
        notes.extend(self.red_lights_passed());
        if self.metrics.actors.is_empty() {
            notes.push("there was no other road user".into());
        }
        let is_standing = self.states.last().is_some_and(is_still);
        if let Some(end) = self.states.last() {
            let went_by = if is_standing { "standing" } else { "driving" };
            steps.push((Milestone::End, end.stamp, went_by.into()));
        }
        let text = std::iter::once(self.end()).chain(notes).collect::<Vec<_>>().join("; ");
        (text, steps)
    }

    /// Describes the end.
    fn end(&self) -> String {
        let last = self.states.last().copied().unwrap_or_default();
        let at_s = last.stamp.as_secs();
        let has_driven = self.states.iter().any(|state| !is_still(state));
        match (self.metrics.verdict, self.metrics.end) {
            (Verdict::LeftRoad, _) => {
                format!("it left the road at {:.2} s", self.metrics.left_road_at_s.unwrap_or(at_s))
            }
            (_, Some(EndReason::Goal)) => format!("it came to the end of its way at {at_s:.2} s"),
            (_, Some(EndReason::Stopped)) => format!("it came to its standstill at {at_s:.2} s"),
            (_, Some(EndReason::Timeout)) if !has_driven => {
                format!("the time was over at {at_s:.2} s and it had never set off")
            }
            (_, Some(EndReason::Timeout)) => {
                format!("the time was over at {at_s:.2} s, at {:.1} m/s", last.speed_mps.abs())
            }
            (_, Some(EndReason::Collision) | None) => {
                format!("the run was ended at {at_s:.2} s, before its scenario was")
            }
        }
    }

    /// Stops before a line with a light that was not green: the light's index, the first stationary state, and the time
    /// of departure.
    fn waits(&self) -> Vec<(usize, EgoState, Option<Time>)> {
        let mut waits = Vec::new();
        let mut k = 0;
        while let Some(from) = self.states[k..].iter().position(is_still).map(|n| n + k) {
            let moves = self.states[from..].iter().position(|s| !is_still(s)).map(|n| n + from);
            let (first, until) = (self.states[from], moves.map(|k| self.states[k].stamp));
            k = moves.unwrap_or(self.states.len());
            let is_at = |light: &LightCourse| {
                let ahead_m = light.stop_s_m - self.front_s_m[from];
                (-BEYOND_LINE_M..=BEFORE_LINE_M).contains(&ahead_m)
                    && light.signal(first.stamp).is_some_and(Signal::holds)
            };
            let light = self.lights.iter().position(is_at);
            let is_long = until.is_none_or(|until| until - first.stamp >= STANDS);
            waits.extend(light.filter(|_| is_long).map(|light| (light, first, until)));
        }
        waits
    }

    /// Lights that the front passed while red.
    fn red_lights_passed(&self) -> Vec<String> {
        let passes = |light: &LightCourse| {
            let over =
                self.front_s_m.windows(2).position(|s| s[0] < light.stop_s_m && s[1] >= light.stop_s_m)?;
            let at = self.states[over + 1].stamp;
            let is_red = light.signal(at) == Some(Signal::Red);
            is_red.then(|| {
                format!("it went over the stop line of {} at {:.2} s, at red", light.name, at.as_secs())
            })
        };
        self.lights.iter().filter_map(passes).collect()
    }
}

/// Describes a pose gap.
fn no_pose(&PoseGap { from_s, until_s }: &PoseGap) -> String {
    match until_s {
        Some(until_s) => format!("no new pose came from {from_s:.2} to {until_s:.2} s"),
        None => format!("no new pose came from {from_s:.2} s on"),
    }
}

fn is_still(state: &EgoState) -> bool {
    state.speed_mps.abs() <= STANDS_MPS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wait_at_a_red_light_is_reported() {
        let ego = swerve_eval::Outline { length_m: 5.0, width_m: 2.0, center_ahead_m: 1.5 };
        let params = swerve_eval::Params {
            ego,
            dead_time: Span::ZERO,
            operators: Vec::new(),
            actors: swerve_msg::ActorNames::new(),
            route: None,
            lights: Vec::new(),
            norm: swerve_eval::Norm::default(),
            tracks_boxes: false,
        };
        let metrics = swerve_eval::Evaluation::new(params).metrics();
        // 10 m/s for 6 s, 4 s of standstill before the line at 62 m, then on over the line at 101 m.
        let at = |k: i64| {
            let (t, stands) = (k as f64 * 0.1, (60..100).contains(&k));
            let s_m = if t < 6.0 { 10.0 * t } else { 60.0 + 10.0 * (t - 10.0).max(0.0) };
            let speed_mps = if stands { 0.0 } else { 10.0 };
            (EgoState { stamp: Time::from_ms(100 * k), speed_mps, ..EgoState::default() }, s_m)
        };
        let (states, front_s_m) = (0..150).map(at).unzip();
        let ms = Time::from_ms;
        let light = |name: &str, stop_s_m, shows| LightCourse {
            name: name.into(),
            s_m: stop_s_m,
            d_m: 0.0,
            stop_s_m,
            shows,
        };
        let first = vec![
            (ms(0), Signal::Green),
            (ms(2000), Signal::Yellow),
            (ms(4000), Signal::Red),
            (ms(9900), Signal::Green),
        ];
        let lights = vec![light("one", 62.0, first), light("two", 101.0, vec![(ms(0), Signal::Red)])];
        let way = Way { metrics: &metrics, states, front_s_m, lights };
        let (text, steps) = way.lights_and_end();
        for part in
            ["it waited at the light one from 6.00 to 10.00 s", "the stop line of two at 14.10 s, at red"]
        {
            assert!(text.contains(part), "{text}");
        }
        let told: Vec<(Milestone, Time)> = steps.iter().map(|(what, at, _)| (*what, *at)).collect();
        assert_eq!(
            told,
            [
                (Milestone::Light, ms(2000)),
                (Milestone::Standstill, ms(6000)),
                (Milestone::MovesOff, ms(10_000)),
                (Milestone::End, ms(14_900)),
            ]
        );
    }
}
