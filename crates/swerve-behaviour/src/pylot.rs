//! Pylot's behaviour planner.
//!
//! Gog et al., "Pylot: A Modular Platform for Exploring Latency-Accuracy Tradeoffs in Autonomous Vehicles", ICRA 2021. Of
//! the states of the published code, two can be reached: it follows the waypoints, and after 50 s without motion it
//! overtakes, until it has moved for 3 s; only this state is published. Its motion planners ignore it, so the decision is that of
//! [`FollowRoute`](crate::FollowRoute).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Time};
use swerve_msg::{Decision, DrivingState};

use crate::{BehaviourPlanner, FollowRoute, FollowRouteParams, Situation};

/// Speed below which the ego does not move, m/s.
const STANDS_MPS: f64 = 0.7;

/// Parameters of [`PylotStates`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct PylotStatesParams {
    /// Time without motion after which it overtakes, seconds.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub blocked_s: f64,
    /// Time of motion after which it follows the waypoints again, seconds.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub moves_s: f64,
}

impl Default for PylotStatesParams {
    fn default() -> Self {
        Self { blocked_s: 50.0, moves_s: 3.0 }
    }
}

/// Pylot's states: follows the waypoints, or overtakes.
#[derive(Clone, Debug)]
pub struct PylotStates {
    params: PylotStatesParams,
    along: FollowRoute,
    overtakes: bool,
    /// Instant since which the ego does what would end the state.
    since: Option<Time>,
}

impl PylotStates {
    /// Creates the planner.
    pub fn new(params: PylotStatesParams) -> Self {
        let along = FollowRoute::new(FollowRouteParams::default());
        Self { params, along, overtakes: false, since: None }
    }
}

impl BehaviourPlanner for PylotStates {
    fn decide(&mut self, at: &Situation<'_>) -> Decision {
        let stands = at.ego.speed_mps < STANDS_MPS;
        let (ends, after_s) = match self.overtakes {
            true => (!stands, self.params.moves_s),
            false => (stands, self.params.blocked_s),
        };
        self.since = ends.then(|| self.since.unwrap_or(at.stamp));
        if self.since.is_some_and(|since| (at.stamp - since).as_secs() > after_s) {
            (self.overtakes, self.since) = (!self.overtakes, None);
        }
        let state = self.overtakes.then_some(DrivingState::Overtake);
        Decision { state, ..self.along.decide(at) }
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::Span;
    use swerve_geom::{FrenetPoint, Point2, Polyline};
    use swerve_msg::{EgoState, Route};
    use swerve_vehicle::{Limits, Shape};

    use super::*;

    #[test]
    fn overtakes_after_fifty_seconds_at_rest_until_it_has_moved_for_three() {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(100.0, 0.0)]).unwrap();
        let route = Route::uniform(line, 1.75, 1.75);
        let mut planner = PylotStates::new(PylotStatesParams::default());
        let mut state = |at_s: f64, speed_mps: f64| {
            let ego = EgoState { speed_mps, ..EgoState::default() };
            let (shape, limits) = (Shape::default(), Limits::default());
            let decision = planner.decide(&Situation {
                stamp: Time::ZERO + Span::from_secs(at_s),
                ego: &ego,
                route: &route,
                number: 1,
                place: FrenetPoint { s_m: 10.0, d_m: 0.0 },
                roads: None,
                cruise_mps: 10.0,
                predictions: &[],
                lights: None,
                shape: &shape,
                limits: &limits,
            });
            assert!(decision.stops.is_empty());
            decision.state == Some(DrivingState::Overtake)
        };
        for (at_s, speed_mps, expected) in [
            (0.0, 5.0, false),
            (1.0, 0.0, false),
            (40.0, 1.0, false),
            (41.0, 0.0, false),
            (91.0, 0.0, false),
            (91.1, 0.0, true),
            (92.0, 2.0, true),
            (94.0, 0.0, true),
            (95.0, 2.0, true),
            (98.1, 2.0, false),
        ] {
            assert_eq!(state(at_s, speed_mps), expected, "{at_s} s");
        }
    }
}
