//! Counterfactual drive in which the planner does not know of an actor.

use std::collections::BTreeSet;

use swerve_core::Time;
use swerve_drive::process::Processes;
use swerve_drive::record_run_times;
use swerve_flow::{Event, Observer, RunOptions, StopHandle, run_virtual};
use swerve_log::PublicationRecord;
use swerve_msg::truth::WorldState;
use swerve_msg::{EgoState, Plan};
use swerve_stack::config::clock::Clock;
use swerve_stack::pipeline::Pipeline;

use super::ego_only::EgoOnly;
use super::timeline::Timeline;
use super::without::{OTHER, Without, is_other};

/// Difference in acceleration that counts as an effect, m/s².
const ACCELERATES_MPS2: f64 = 0.5;
/// Difference in steering angle that counts as an effect, radians: the same lateral acceleration at 18 m/s.
const STEERS_RAD: f64 = 0.25 * core::f64::consts::PI / 180.0;

/// Result of comparing such a drive with the logged one.
#[derive(Debug)]
pub(super) struct Unaware {
    /// Stamps of logged plans that differ in that drive while their predecessors agree.
    pub(super) changes: Vec<Time>,
    pub(super) answer: Answer,
}

impl Unaware {
    pub(super) const UNKNOWN: Self = Self { changes: Vec::new(), answer: Answer::Unknown };
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Answer {
    /// The first state in which the logged car deviates.
    Effect(Time),
    /// The car does not deviate.
    Nothing,
    /// The drives differ before any command of a changed plan, so that the comparison is meaningless.
    Unknown,
}

/// Compares plans and world states with the logged ones until the car deviates.
struct Compared<'a> {
    states: Vec<(Time, &'a PublicationRecord)>,
    plans: Vec<(Time, &'a PublicationRecord)>,
    world: &'a str,
    planner: &'a str,
    /// Stamp before which there are no tracks of the actor.
    from: Time,
    /// Simulation step that applies the first command resulting from a plan with this stamp.
    tick: &'a (dyn Fn(Time) -> Option<Time> + Sync),
    stop: StopHandle,
    changes: Vec<Time>,
    is_changed: bool,
    answer: Option<Answer>,
}

impl Without<'_> {
    /// Compares with the drive without the actor. Returns the first change of a plan even if nothing else is known.
    /// Takes the pipeline twice, as the planner may have to plan again alone.
    pub(super) fn compare(
        &self,
        [first, second]: [Pipeline; 2],
        (planner, world): (&str, &str),
        timeline: &Timeline<'_>,
        times: (&(dyn Fn(Time) -> Option<Time> + Sync), Time),
    ) -> anyhow::Result<Unaware> {
        let is_repeatable = first.clock != Clock::Wall;
        // Without consent, programs that the log names are not started.
        let unaware = self.drive(first, (planner, world), timeline, times).unwrap_or(Unaware::UNKNOWN);
        if is_repeatable && unaware.answer != Answer::Unknown {
            return Ok(unaware);
        }
        // Under wall clock the car's path may differ slightly: the planner must get its logged inputs.
        let change = self.first_difference(second, planner, timeline)?;
        let later = |change| unaware.changes.iter().copied().filter(move |stamp| *stamp > change);
        let changes = change.into_iter().flat_map(|change| core::iter::once(change).chain(later(change)));
        Ok(Unaware { changes: changes.collect(), answer: unaware.answer })
    }

    /// Drives again from the start to `until`: the world, the planner and the operators between the planner and the
    /// world. Their other inputs are played back from the log without the predictions of the actor's tracks, and each
    /// step takes as long as in the log. So both drives, including all sensor data, agree up to the first changed plan;
    /// a pose estimated from sensors is the logged one, valid until the car deviates.
    fn drive(
        &self,
        mut pipeline: Pipeline,
        (planner, world): (&str, &str),
        timeline: &Timeline<'_>,
        (tick, until): (&(dyn Fn(Time) -> Option<Time> + Sync), Time),
    ) -> anyhow::Result<Unaware> {
        if !pipeline.fed.is_empty() || !timeline.leads(planner, world) {
            // The world, or an external stack that drove, is not here.
            return Ok(Unaware::UNKNOWN);
        }
        let mut again: BTreeSet<String> = timeline.between(planner, world);
        again.extend([planner.to_owned(), world.to_owned()]);
        // Operators that derive the car's state from the world alone use the world that is driven again.
        let own: Vec<String> = timeline.operators().filter(|name| timeline.is_own(name, &again)).collect();
        again.extend(own);
        record_run_times(&mut pipeline, self.log, |name| again.contains(name));
        self.play_others(&mut pipeline, timeline, |name| again.contains(name))?;
        let _processes = Processes::start_needed(self.setup, &mut pipeline)?;
        let all = |stream| self.log.publications(stream).map(|p| (p.header.stamp, p)).collect();
        let mut compared = Compared {
            states: all(world),
            plans: all(timeline.stream_of::<Plan>(planner).unwrap_or(planner)),
            world,
            planner,
            from: self.from,
            tick,
            stop: pipeline.graph.stop_handle(),
            changes: Vec::new(),
            is_changed: false,
            answer: None,
        };
        let options = RunOptions::until(until.min(pipeline.until)).seed(self.log.start.seed).threads(1);
        run_virtual(pipeline.graph, &options, vec![&mut compared])?;
        Ok(Unaware { changes: compared.changes, answer: compared.answer.unwrap_or(Answer::Nothing) })
    }
}

impl Compared<'_> {
    fn plan(&mut self, stamp: Time, unaware: &Plan) {
        if stamp < self.from {
            return;
        }
        let Ok(place) = self.plans.binary_search_by_key(&stamp, |(stamp, _)| *stamp) else { return };
        let Ok(logged) = self.plans[place].1.decode::<Plan>() else { return };
        let is_changed = is_other(&logged, unaware);
        if is_changed && !self.is_changed {
            self.changes.push(stamp);
        }
        self.is_changed = is_changed;
    }

    fn state(&mut self, stamp: Time, unaware: &WorldState) {
        // Before that both drives agree.
        let Some(first) = self.changes.first() else { return };
        let Ok(place) = self.states.binary_search_by_key(&stamp, |(stamp, _)| *stamp) else { return };
        let Ok(EgoOnly(logged)) = self.states[place].1.decode() else { return };
        self.answer = match drives_otherwise(&logged.state, &unaware.ego.state) {
            true if (self.tick)(*first).is_some_and(|tick| stamp > tick) => Some(Answer::Effect(stamp)),
            true => Some(Answer::Unknown),
            // The motion of a crashed car no longer follows its commands.
            false if unaware.collisions_of_ego().next().is_some() => Some(Answer::Nothing),
            false => None,
        };
        if self.answer.is_some() {
            self.stop.stop();
        }
    }
}

impl Observer for Compared<'_> {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(p) = event else { return };
        let (None, Some(stamp), Some(payload)) = (self.answer, p.stamp, p.payload) else { return };
        if p.operator == self.planner
            && let Some(plan) = payload.downcast_ref()
        {
            self.plan(stamp, plan);
        } else if p.operator == self.world
            && let Some(state) = payload.downcast_ref()
        {
            self.state(stamp, state);
        }
    }
}

/// True if a car differs from another one at the same instant in position, speed, acceleration or steering.
pub(super) fn drives_otherwise(a: &EgoState, b: &EgoState) -> bool {
    a.pose.point().distance(b.pose.point()) > OTHER
        || (a.speed_mps - b.speed_mps).abs() > OTHER
        || (a.accel_mps2 - b.accel_mps2).abs() >= ACCELERATES_MPS2
        || (a.steering_rad - b.steering_rad).abs() >= STEERS_RAD
}

#[cfg(test)]
mod tests {
    use swerve_geom::Pose2;

    use super::*;

    #[test]
    fn deviation_is_detected_by_position_speed_acceleration_or_steering() {
        let then = EgoState { speed_mps: 10.0, accel_mps2: -1.0, ..EgoState::default() };
        let near = EgoState {
            pose: Pose2::new(0.09, 0.0, 0.0),
            speed_mps: 10.09,
            accel_mps2: -1.49,
            steering_rad: 0.9 * STEERS_RAD,
            ..then
        };
        assert!(!drives_otherwise(&then, &near) && !drives_otherwise(&near, &then));
        for other in [
            EgoState { pose: Pose2::new(0.0, 0.11, 0.0), ..then },
            EgoState { speed_mps: 9.89, ..then },
            EgoState { accel_mps2: -0.5, ..then },
            EgoState { steering_rad: -STEERS_RAD, ..then },
        ] {
            assert!(drives_otherwise(&then, &other) && drives_otherwise(&other, &then), "{other:?}");
        }
    }
}
