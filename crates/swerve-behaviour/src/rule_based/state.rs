//! States of driving.

use swerve_msg::DrivingState::{self, *};
use swerve_msg::StopReason;

/// Facts that decide about the next state.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Facts {
    /// Reason of the nearest stop, if the ego drives or stands before it.
    pub(super) stop: Option<StopReason>,
    /// True if the ego is at rest.
    pub(super) rests: bool,
    /// True if it moves up in a junction while it waits.
    pub(super) creeps: bool,
    /// True if another vehicle is ahead, nearer than the stop.
    pub(super) has_lead: bool,
    pub(super) is_in_junction: bool,
    /// True if it brakes harder than a careful driver ever has to.
    pub(super) brakes_hard: bool,
    /// True if it adapts its speed to the traffic of the lane that it changes to.
    pub(super) joins: bool,
    /// True if its way leads from one lane to the next.
    pub(super) changes_lane: bool,
    /// True if it is over the line of its lane elsewhere.
    pub(super) is_over_line: bool,
}

/// The next state. This is the only place where the state changes: the first row that applies.
pub(super) fn next(facts: Facts) -> DrivingState {
    use StopReason as Stop;
    let Facts { stop, rests, has_lead, is_in_junction, .. } = facts;
    match (stop, rests, has_lead, is_in_junction) {
        _ if facts.brakes_hard => EmergencyStop,
        _ if facts.is_over_line && !rests && !is_in_junction => Overtake,
        (Some(Stop::Crossing), ..) => WaitForPedestrian,
        (None, false, ..) if facts.joins => Merge,
        (None, false, ..) if facts.changes_lane => LaneChange,
        (_, _, true, false) => Follow,
        (Some(Stop::TrafficLight), false, ..) => ApproachLight,
        (Some(Stop::TrafficLight), true, ..) => WaitAtLight,
        (Some(Stop::StopSign), ..) => StopSign,
        (Some(Stop::GiveWay), ..) if facts.creeps => Creep,
        (Some(Stop::GiveWay), false, ..) => GiveWay,
        (Some(Stop::GiveWay), true, ..) => WaitForGap,
        (Some(Stop::NoRoom), ..) => WaitForRoom,
        (None, .., true) => InJunction,
        (None, ..) => Cruise,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_follow_the_table() {
        let facts = |stop, rests, has_lead, is_in_junction| Facts {
            stop,
            rests,
            has_lead,
            is_in_junction,
            ..Facts::default()
        };
        let hard = Facts { brakes_hard: true, ..facts(Some(StopReason::Crossing), false, true, false) };
        let over = |is_in_junction| Facts { is_over_line: true, ..facts(None, false, true, is_in_junction) };
        let change = |stop| Facts { changes_lane: true, ..facts(stop, false, true, false) };
        let creep = |stop| Facts { creeps: true, ..facts(stop, true, false, true) };
        for (facts, state) in [
            (creep(Some(StopReason::GiveWay)), Creep),
            (creep(Some(StopReason::Crossing)), WaitForPedestrian),
            (facts(None, false, false, false), Cruise),
            (facts(None, true, true, false), Follow),
            (facts(None, false, true, true), InJunction),
            (facts(Some(StopReason::GiveWay), false, true, false), Follow),
            (facts(Some(StopReason::GiveWay), false, false, false), GiveWay),
            (facts(Some(StopReason::GiveWay), true, false, true), WaitForGap),
            (facts(Some(StopReason::TrafficLight), false, false, false), ApproachLight),
            (facts(Some(StopReason::TrafficLight), true, false, false), WaitAtLight),
            (facts(Some(StopReason::Crossing), true, true, false), WaitForPedestrian),
            (facts(Some(StopReason::NoRoom), true, false, false), WaitForRoom),
            (facts(Some(StopReason::StopSign), true, false, false), StopSign),
            (hard, EmergencyStop),
            (over(false), Overtake),
            (over(true), InJunction),
            (change(None), LaneChange),
            (Facts { joins: true, ..change(None) }, Merge),
            (change(Some(StopReason::TrafficLight)), Follow),
        ] {
            assert_eq!(next(facts), state, "{facts:?}");
        }
    }
}
