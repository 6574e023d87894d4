//! States of the behaviour planner in a drive.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_msg::{ActorNames, Decision, Driving, DrivingState, EgoState};

use crate::seconds;
use crate::verdict::STANDS_MPS;

/// States of the behaviour planner; `behaviour` in `metrics.json`.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct BehaviourMetrics {
    /// Changes of the state, or of the road user that is the reason for it, in order of time.
    pub changes: Vec<StateChange>,
    /// Time in each state, seconds.
    pub seconds: BTreeMap<DrivingState, f64>,
    /// Instant from which the ego stood up to the end, seconds; absent if it moved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stands_since_s: Option<f64>,
}

/// State from an instant on.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct StateChange {
    /// Instant at which the decision became visible, seconds.
    pub at_s: f64,
    /// State; null if the planner left its states.
    pub state: Option<DrivingState>,
    /// Name of the road user that is the reason; null without one.
    pub because: Option<String>,
}

impl StateChange {
    /// Description in words, with the ego as the subject.
    pub fn words(&self) -> String {
        let words = |state: DrivingState| state.words_because(self.because.as_deref());
        self.state.map_or_else(|| "no state".to_owned(), words)
    }
}

impl BehaviourMetrics {
    /// State at an instant, seconds.
    pub fn at(&self, at_s: f64) -> Option<&StateChange> {
        self.changes[..self.changes.partition_point(|change| change.at_s <= at_s)].last()
    }

    /// Standstill at the end in words, with the state; `None` if the ego moved.
    pub fn standstill(&self) -> Option<String> {
        let (since_s, last) = (self.stands_since_s?, self.changes.last()?);
        Some(format!("stands since {since_s:.2} s: {}", last.words()))
    }
}

/// Accumulates the decisions of a behaviour planner.
#[derive(Clone, Debug, Default)]
pub struct Behaviour {
    changes: Vec<StateChange>,
    spans: BTreeMap<DrivingState, Span>,
    /// The newest state, and the instant of the newest decision; `None` before the first with a state.
    last: Option<(Driving, Time)>,
    stands_since: Option<Time>,
    now: Time,
}

impl Behaviour {
    /// Adds a state of the ego.
    pub fn ego(&mut self, ego: &EgoState) {
        self.now = ego.stamp;
        if ego.speed_mps.abs() > STANDS_MPS {
            self.stands_since = None;
        } else {
            self.stands_since.get_or_insert(ego.stamp);
        }
    }

    /// Adds a decision that became visible at `at`; `names` are those of tracks.
    pub fn take(&mut self, at: Time, decision: &Decision, names: &ActorNames) {
        let (mut driving, since) = self.last.unwrap_or((Driving::default(), at));
        if let Some(before) = driving.state {
            *self.spans.entry(before).or_default() += at - since;
        }
        if driving.take(decision) {
            let because = driving.because_name(names);
            self.changes.push(StateChange { at_s: seconds(at), state: driving.state, because });
        }
        if !self.changes.is_empty() {
            self.last = Some((driving, at));
        }
    }

    /// Metrics; `None` for a planner without states.
    pub fn metrics(&self) -> Option<BehaviourMetrics> {
        let (driving, since) = self.last?;
        let mut spans = self.spans.clone();
        if let Some(state) = driving.state {
            *spans.entry(state).or_default() += (self.now - since).max(Span::ZERO);
        }
        Some(BehaviourMetrics {
            changes: self.changes.clone(),
            seconds: spans.into_iter().map(|(state, span)| (state, seconds(Time::ZERO + span))).collect(),
            stands_since_s: self.stands_since.map(seconds),
        })
    }
}

#[cfg(test)]
mod tests {
    use swerve_msg::ActorId;

    use super::*;
    use DrivingState::{Cruise, GiveWay, WaitForGap};

    #[test]
    fn changes_have_their_reasons_and_states_their_times() {
        let names = [(ActorId(3), "van".to_owned())].into();
        let mut behaviour = Behaviour::default();
        behaviour.take(Time::ZERO, &Decision::default(), &names);
        assert_eq!(behaviour.metrics(), None);
        for (ms, state, because) in [
            (100, Cruise, None),
            (200, Cruise, None),
            (300, GiveWay, None),
            (400, GiveWay, Some(3)),
            (500, GiveWay, None),
            (600, WaitForGap, Some(3)),
            (700, WaitForGap, Some(8)),
        ] {
            let because = because.map(ActorId);
            let decision = Decision { state: Some(state), because, ..Decision::default() };
            behaviour.take(Time::from_ms(ms), &decision, &names);
        }
        for (ms, speed_mps) in [(0, 0.0), (300, 2.0), (600, 0.0), (1000, 0.0)] {
            behaviour.ego(&EgoState { stamp: Time::from_ms(ms), speed_mps, ..EgoState::default() });
        }
        let metrics = behaviour.metrics().unwrap();
        let change = |at_s, state, because: Option<&str>| StateChange {
            at_s,
            state: Some(state),
            because: because.map(str::to_owned),
        };
        assert_eq!(
            metrics.changes,
            [
                change(0.1, Cruise, None),
                change(0.3, GiveWay, None),
                change(0.4, GiveWay, Some("van")),
                change(0.6, WaitForGap, Some("van")),
                change(0.7, WaitForGap, Some("track 8")),
            ]
        );
        assert_eq!(metrics.seconds, [(Cruise, 0.2), (GiveWay, 0.3), (WaitForGap, 0.4)].into());
        assert_eq!(metrics.at(0.05), None);
        assert_eq!(metrics.at(0.45), Some(&metrics.changes[2]));
        let stands = "stands since 0.60 s: waits for a gap, because of track 8";
        assert_eq!(metrics.standstill().as_deref(), Some(stands));
        // JSON keys are the names of the states.
        let json = serde_json::to_value(&metrics).unwrap();
        assert_eq!(json["seconds"]["wait_for_gap"], 0.4);
        assert_eq!(serde_json::from_value::<BehaviourMetrics>(json).unwrap(), metrics);
    }

    #[test]
    fn planner_may_leave_its_states() {
        let mut behaviour = Behaviour::default();
        let overtakes = Decision { state: Some(DrivingState::Overtake), ..Decision::default() };
        behaviour.take(Time::from_ms(1000), &overtakes, &ActorNames::new());
        behaviour.take(Time::from_ms(4000), &Decision::default(), &ActorNames::new());
        behaviour.ego(&EgoState { stamp: Time::from_ms(9000), speed_mps: 5.0, ..EgoState::default() });
        let metrics = behaviour.metrics().unwrap();
        let changes: Vec<_> = metrics.changes.iter().map(|change| (change.at_s, change.words())).collect();
        assert_eq!(changes, [(1.0, "overtakes".to_owned()), (4.0, "no state".to_owned())]);
        assert_eq!(metrics.seconds, [(DrivingState::Overtake, 3.0)].into());
        assert_eq!(metrics.standstill(), None);
    }
}
