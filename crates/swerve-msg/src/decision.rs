//! Decisions of the behaviour planner.

use serde::{Deserialize, Serialize};
use swerve_core::{Time, unless_default};
use swerve_map::Borders;

use crate::{ActorId, ActorNames};

/// Decision of the behaviour planner: the ground, speeds and stops within which the motion planner plans.
///
/// Arc lengths are along the line of one route, the message of the router with the sequence number `route`.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Decision {
    /// Stamp of the predictions that it is based on.
    pub stamp: Time,
    /// Sequence number of the route.
    pub route: u64,
    /// Borders of the ground to use beside the route's line; `None` for the route's ground between lines that must not be
    /// crossed, which plans leave in an emergency only.
    pub corridor: Option<Borders>,
    /// Speeds to keep, ordered by arc length.
    pub limits: Vec<SpeedLimit>,
    /// Arc length up to which moving road users may be overtaken, metres; `None` without a limit.
    pub overtake_until_m: Option<f64>,
    /// Places to stop at, the nearest first.
    pub stops: Vec<StopPoint>,
    /// Road users to give way to, ordered by identity.
    pub yields: Vec<ActorId>,
    /// Vehicles ahead that wait in a queue before a stop line, ordered by identity: they are not overtaken.
    #[serde(default, serialize_with = "unless_default")]
    pub waiting: Vec<ActorId>,
    /// Vehicles that give way to the ego, ordered by identity.
    #[serde(default, serialize_with = "unless_default")]
    pub expected_to_yield: Vec<ExpectedStop>,
    /// State of driving; `None` if the planner has no states.
    #[serde(default, serialize_with = "unless_default")]
    pub state: Option<DrivingState>,
    /// Road user that is the reason for the state.
    #[serde(default, serialize_with = "unless_default")]
    pub because: Option<ActorId>,
}

/// A vehicle that gives way to the ego.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ExpectedStop {
    /// The vehicle.
    pub id: ActorId,
    /// Length of way from its present place after which it stops, metres.
    pub after_m: f64,
}

/// State of driving.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DrivingState {
    /// On a free road.
    Cruise,
    /// Behind another vehicle.
    Follow,
    /// Towards a traffic light at which it stops.
    ApproachLight,
    /// At rest before a traffic light.
    WaitAtLight,
    /// Towards a place where it gives way.
    GiveWay,
    /// At rest, until those with priority have passed.
    WaitForGap,
    /// Slowly up to the zone of those with priority, after a stop.
    Creep,
    /// Towards a stop sign, or at rest before it.
    StopSign,
    /// Before a junction without room beyond it.
    WaitForRoom,
    /// In a junction.
    InJunction,
    /// Before a crossing that a pedestrian uses.
    WaitForPedestrian,
    /// Slower, for a gap in the lane that it changes to.
    Merge,
    /// From one lane of the route to the next.
    LaneChange,
    /// Over the line of its lane, past something.
    Overtake,
    /// Braking as hard as only an emergency justifies.
    EmergencyStop,
}

impl DrivingState {
    /// Description in words, with the ego as the subject.
    pub fn words(self) -> &'static str {
        match self {
            Self::Cruise => "cruises",
            Self::Follow => "follows",
            Self::ApproachLight => "approaches a light",
            Self::WaitAtLight => "waits at a light",
            Self::GiveWay => "gives way",
            Self::WaitForGap => "waits for a gap",
            Self::Creep => "moves up",
            Self::StopSign => "stops at a stop sign",
            Self::WaitForRoom => "waits for room",
            Self::InJunction => "drives through a junction",
            Self::WaitForPedestrian => "stops for a pedestrian",
            Self::Merge => "merges",
            Self::LaneChange => "changes lane",
            Self::Overtake => "overtakes",
            Self::EmergencyStop => "brakes hard",
        }
    }

    /// Description in words, with the name of the road user that is the reason.
    pub fn words_because(self, who: Option<&str>) -> String {
        match (self, who) {
            (state, None) => state.words().to_owned(),
            (Self::Follow, Some(who)) => format!("follows {who}"),
            (Self::GiveWay, Some(who)) => format!("gives way to {who}"),
            (Self::Merge, Some(who)) => format!("merges behind {who}"),
            (Self::WaitForPedestrian, Some(who)) => format!("stops for {who}"),
            (state, Some(who)) => format!("{}, because of {who}", state.words()),
        }
    }
}

/// State over several decisions, with the latest road user that was the reason for it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Driving {
    /// State; `None` if the planner has no states, or left them.
    pub state: Option<DrivingState>,
    /// Road user; a reason that is missing for some frames of a state is the last one.
    pub because: Option<ActorId>,
}

impl Driving {
    /// Takes the next decision; returns true if the state or the road user changed.
    pub fn take(&mut self, decision: &Decision) -> bool {
        let kept = self.because.filter(|_| decision.state == self.state);
        let next = Self { state: decision.state, because: decision.because.or(kept) };
        core::mem::replace(self, next) != next
    }

    /// Name of the road user, with the names of tracks; a track without a name is called by its number.
    pub fn because_name(&self, names: &ActorNames) -> Option<String> {
        let name = |id: ActorId| names.get(&id).cloned().unwrap_or_else(|| format!("track {}", id.0));
        self.because.map(name)
    }
}

/// A speed to keep on a part of a route, up to the next one.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct SpeedLimit {
    /// Start of the part along the route, metres.
    pub from_m: f64,
    /// Speed, m/s.
    pub speed_mps: f64,
}

/// A place to stop at.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct StopPoint {
    /// Arc length before which the front of the ego stops, metres.
    pub s_m: f64,
    /// Reason.
    pub cause: StopReason,
}

/// Reasons to stop at a place.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// A traffic light that is red, or yellow and far enough away.
    TrafficLight,
    /// Road users with priority.
    GiveWay,
    /// A stop sign, before which the ego has not stood yet.
    StopSign,
    /// A pedestrian on a crossing, or on the way to it.
    Crossing,
    /// No room beyond a junction.
    NoRoom,
}

impl Decision {
    /// Speed at arc length `s_m` from which the ego keeps all limits, those ahead with a deceleration of `brake_mps2`,
    /// m/s; infinite without a limit.
    pub fn speed_mps(&self, s_m: f64, brake_mps2: f64) -> f64 {
        let begun = self.limits.partition_point(|limit| limit.from_m <= s_m);
        let before = |limit: &SpeedLimit| {
            let ahead_m = (limit.from_m - s_m).max(0.0);
            (limit.speed_mps * limit.speed_mps + 2.0 * brake_mps2 * ahead_m).sqrt()
        };
        // The first limit holds before its start too.
        let here_mps = self.limits.get(begun.max(1) - 1).map_or(f64::INFINITY, |limit| limit.speed_mps);
        self.limits.iter().skip(begun.max(1)).map(before).fold(here_mps, f64::min)
    }

    /// Distance from arc length `s_m` for which moving road users may be overtaken, metres; infinite without a limit.
    pub fn overtake_max_m(&self, s_m: f64) -> f64 {
        self.overtake_until_m.map_or(f64::INFINITY, |until_m| (until_m - s_m).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_falls_before_a_lower_limit_and_rises_at_a_higher_one() {
        let limit = |from_m, speed_mps| SpeedLimit { from_m, speed_mps };
        let limits = vec![limit(0.0, 20.0), limit(100.0, 10.0), limit(200.0, 15.0)];
        let decision = Decision { limits, ..Decision::default() };
        // From 20 to 10 m/s with 2 m/s² take (400 - 100) / 4 = 75 m.
        for (s_m, speed_mps) in
            [(-5.0, 20.0), (20.0, 20.0), (25.0, 20.0), (100.0, 10.0), (199.0, 10.0), (200.0, 15.0)]
        {
            assert_eq!(decision.speed_mps(s_m, 2.0), speed_mps, "{s_m} m");
        }
        assert!((decision.speed_mps(64.0, 2.0) - 244f64.sqrt()).abs() < 1e-12);
        assert_eq!(Decision::default().speed_mps(3.0, 2.0), f64::INFINITY);
    }

    #[test]
    fn words_of_a_state_name_the_road_user() {
        let words = |state: DrivingState| (state.words_because(None), state.words_because(Some("van")));
        for (state, alone, named) in [
            (DrivingState::Cruise, "cruises", "cruises, because of van"),
            (DrivingState::Follow, "follows", "follows van"),
            (DrivingState::GiveWay, "gives way", "gives way to van"),
            (DrivingState::WaitForGap, "waits for a gap", "waits for a gap, because of van"),
            (DrivingState::Merge, "merges", "merges behind van"),
            (DrivingState::WaitForPedestrian, "stops for a pedestrian", "stops for van"),
        ] {
            assert_eq!(words(state), (alone.to_owned(), named.to_owned()));
        }
    }

    #[test]
    fn overtaking_ends_at_its_arc_length() {
        let decision = Decision { overtake_until_m: Some(50.0), ..Decision::default() };
        assert_eq!([decision.overtake_max_m(20.0), decision.overtake_max_m(60.0)], [30.0, 0.0]);
        assert_eq!(Decision::default().overtake_max_m(20.0), f64::INFINITY);
    }
}
