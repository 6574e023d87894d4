//! Text of events: `foxglove.Log`.

use foxglove::messages::Log;
use foxglove::messages::log::Level;
use swerve_core::Time;
use swerve_flow::{DropReason, Dropped, Reaction};
use swerve_msg::truth::{EndReason, InfractionKind, WorldState};
use swerve_msg::{ActorId, ActorNames, DrivingState, GateMode, PlanStatus};

use crate::form::timestamp;

/// One line of the log.
pub(crate) struct Line {
    pub(crate) stamp: Time,
    level: Level,
    name: String,
    words: String,
}

impl Line {
    fn new(stamp: Time, level: Level, name: &str, words: impl Into<String>) -> Self {
        Self { stamp, level, name: name.into(), words: words.into() }
    }

    pub(crate) fn message(self) -> Log {
        Log {
            timestamp: Some(timestamp(self.stamp)),
            level: self.level as i32,
            message: self.words,
            name: self.name,
            file: String::new(),
            line: 0,
        }
    }
}

/// Collisions, infractions and end of the run in a world step.
pub(crate) fn world(
    (operator, world): (&str, &WorldState),
    names: &ActorNames,
    has_ended: bool,
) -> Vec<Line> {
    let line = |level, words: String| Line::new(world.stamp, level, operator, words);
    let mut lines = Vec::new();
    let name = |id: ActorId| names.get(&id).cloned().unwrap_or_else(|| format!("actor {}", id.0));
    for (with, hit) in world.collisions_of_ego() {
        let words = format!("collision with {} at {:.1} m/s", name(with), hit.speeds_mps[0]);
        lines.push(line(Level::Error, words));
    }
    for hit in world.collisions_of_others() {
        let [a, b] = hit.parties.map(name);
        let words = format!("{a} and {b} collide, closing at {:.1} m/s", hit.closing_speed_mps);
        lines.push(line(Level::Warning, words));
    }
    for broken in &world.infractions {
        let words = match broken.kind {
            InfractionKind::LeftRoad => "left the road",
        };
        lines.push(line(Level::Warning, words.into()));
    }
    if let (Some(why), false) = (world.ended, has_ended) {
        let words = match why {
            EndReason::Goal => "over: the end of the road",
            EndReason::Stopped => "over: the ego stands",
            EndReason::Collision => "over: some time after a collision",
            EndReason::Timeout => "over: out of time",
        };
        lines.push(line(Level::Info, words.into()));
    }
    lines
}

/// Change of the plan's status.
pub(crate) fn plan(operator: &str, stamp: Time, status: PlanStatus) -> Line {
    let words = match status {
        PlanStatus::Route => "nothing to plan for: along the route",
        PlanStatus::Found => "a path was found",
        PlanStatus::Kept => "no path found: the previous plan goes on",
        PlanStatus::Brake => "no path found: full brake",
        PlanStatus::Stop => "no path found: speed zero along the route",
        PlanStatus::GaveUp => "no path found: along the route regardless",
        PlanStatus::Comfortable => "within the limits of comfort",
        PlanStatus::PoseUncertain => "stopping: the pose is too uncertain for the lane",
        PlanStatus::Refused => "a plan with impossible values: full brake",
    };
    let level = if status.is_fallback() { Level::Warning } else { Level::Info };
    Line::new(stamp, level, operator, words)
}

/// Change of the behaviour planner's state; `because` names the road user that is the reason.
pub(crate) fn behaviour(operator: &str, stamp: Time, state: DrivingState, because: Option<&str>) -> Line {
    let level = if state == DrivingState::EmergencyStop { Level::Warning } else { Level::Info };
    Line::new(stamp, level, operator, state.words_because(because))
}

/// Change of the safety gate's mode.
pub(crate) fn gate(operator: &str, stamp: Time, mode: GateMode) -> Line {
    let (level, words) = match mode {
        GateMode::Manual => (Level::Info, "the driver drives".to_owned()),
        GateMode::Driving => (Level::Info, "the stack drives".to_owned()),
        GateMode::Stopping(cause) => (Level::Warning, format!("the car is stopped: {}", cause.words())),
        GateMode::Holding(cause) => (Level::Info, format!("the car is held: {}", cause.words())),
    };
    Line::new(stamp, level, operator, words)
}

/// Missed deadline of the frame of `stamp`, at `at`.
pub(crate) fn miss(operator: &str, stamp: Time, at: Time, reaction: Reaction) -> Line {
    let answer = match reaction {
        Reaction::Skip => "nothing is said",
        Reaction::ReuseLast => "the last result is repeated",
        Reaction::OnDeadline => "the operator's answer for that",
    };
    let words = format!("deadline of the frame of {:.3} s missed: {answer}", stamp.as_secs());
    Line::new(at, Level::Warning, operator, words)
}

/// A dropped frame or result.
pub(crate) fn dropped(dropped: &Dropped<'_>) -> Line {
    let why = match dropped.reason {
        DropReason::Skipped => "a newer one came",
        DropReason::QueueFull => "the queue is full",
        DropReason::GivenUp => "given up",
        DropReason::Overtaken => "overtaken",
        DropReason::TooLate => "too late",
    };
    let words = format!("frame of {:.3} s dropped: {why}", dropped.stamp.as_secs());
    Line::new(dropped.at, Level::Debug, dropped.operator, words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_geom::{Point, Transform, Vector};
    use swerve_msg::EgoState;
    use swerve_msg::truth::{Collision, EgoTruth};

    #[test]
    fn change_of_state_names_the_road_user() {
        let line = |state, because| behaviour("behaviour", Time::ZERO, state, because);
        let gives_way = line(DrivingState::GiveWay, Some("vehicle_12"));
        assert_eq!((gives_way.level, gives_way.words), (Level::Info, "gives way to vehicle_12".to_owned()));
        assert_eq!(line(DrivingState::Cruise, None).words, "cruises");
        assert_eq!(line(DrivingState::EmergencyStop, None).level, Level::Warning);
    }

    #[test]
    fn collision_names_both_parties_unless_one_is_the_ego() {
        let hit = |parties: [u32; 2]| Collision {
            stamp: Time::ZERO,
            parties: parties.map(ActorId),
            impulse_n_s: 0.0,
            closing_speed_mps: 9.04,
            speeds_mps: [8.0, 3.0],
        };
        let zero = Vector::new(0.0, 0.0, 0.0);
        let state = WorldState {
            stamp: Time::ZERO,
            ego: EgoTruth {
                id: ActorId::EGO,
                map_from_ego: Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, 0.0), 0.0, 0.0, 0.0),
                state: EgoState::default(),
                velocity_mps: zero,
                specific_force_mps2: Vector::new(0.0, 0.0, 0.0),
                angular_velocity_radps: Vector::new(0.0, 0.0, 0.0),
            },
            actors: Vec::new(),
            collisions: vec![hit([1, 2]), hit([0, 2])],
            infractions: Vec::new(),
            ended: None,
        };
        let names = [(ActorId(1), "van".to_owned())].into();
        let lines = world(("world", &state), &names, false);
        let lines: Vec<_> = lines.into_iter().map(|line| (line.level as i32, line.words)).collect();
        let (error, warning) = (Level::Error as i32, Level::Warning as i32);
        let others = "van and actor 2 collide, closing at 9.0 m/s";
        assert_eq!(
            lines,
            [(error, "collision with actor 2 at 8.0 m/s".to_owned()), (warning, others.to_owned())]
        );
    }
}
