//! States of the behaviour planner for a page.

use swerve_eval::BehaviourMetrics;
use swerve_msg::DrivingState;

use super::run::{Behaviour, StateChange};

/// Maximum number of changes on a page.
const CHANGES_MAX: usize = 200;

impl From<&BehaviourMetrics> for Behaviour {
    fn from(metrics: &BehaviourMetrics) -> Self {
        let change = |change: &swerve_eval::StateChange| StateChange {
            t: (change.at_s * 1e6).round() as i64,
            state: change.state.map_or("no state", DrivingState::words),
            because: change.because.clone().unwrap_or_default(),
        };
        let time = |(state, s): (&DrivingState, &f64)| (state.words(), (s * 1e3).round() as i64);
        let mut times: Vec<_> = metrics.seconds.iter().map(time).collect();
        times.sort_by_key(|(_, ms)| -ms);
        Self {
            changes: metrics.changes.iter().take(CHANGES_MAX).map(change).collect(),
            more: metrics.changes.len().saturating_sub(CHANGES_MAX),
            times,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_has_the_first_changes_and_the_longest_state_first() {
        let one = |k: usize| swerve_eval::StateChange {
            at_s: 0.5 * k as f64,
            state: Some(if k.is_multiple_of(2) { DrivingState::Cruise } else { DrivingState::Follow }),
            because: (k % 2 == 1).then(|| "van".to_owned()),
        };
        let seconds = [(DrivingState::Cruise, 20.0), (DrivingState::Follow, 81.5)].into();
        let metrics =
            BehaviourMetrics { changes: (0..203).map(one).collect(), seconds, ..Default::default() };
        let page = Behaviour::from(&metrics);
        assert_eq!((page.changes.len(), page.more), (200, 3));
        let follows = StateChange { t: 1_500_000, state: "follows", because: "van".into() };
        assert_eq!(page.changes[3], follows);
        assert_eq!(page.times, [("follows", 81_500), ("cruises", 20_000)]);
    }
}
