//! Behaviour planners: the ground, speeds and stops within which the motion planner plans.
//!
//! A [`BehaviourPlanner`] reads the situation of one frame and returns a `Decision`. [`FollowRoute`] keeps to the route
//! and its speed limits, stops at red lights, and does not overtake in junctions. [`RuleBased`] also obeys rights of way,
//! stop signs and crossings: it waits for those with priority, and names those who wait for the ego. [`PylotStates`] has
//! the states of Pylot's planner, and decides as [`FollowRoute`].
//!
//! **Frames**: arc lengths and offsets are along the line of the route, metres, positive to the left.
//!
//! Excluded: motion planning, sensors, engine, files.

mod along;
mod follow_route;
mod lights;
mod pylot;
mod rule_based;

use swerve_core::Time;
use swerve_geom::FrenetPoint;
use swerve_map::Map;
use swerve_map::conflict::Conflicts;
use swerve_msg::{Decision, EgoState, Prediction, Route, TrafficLights};
use swerve_vehicle::{Limits, Shape};

pub use follow_route::{FollowRoute, FollowRouteParams};
pub use pylot::{PylotStates, PylotStatesParams};
pub use rule_based::{RuleBased, RuleBasedParams};

/// A map, and the conflict zones of its lanes.
#[derive(Clone, Copy, Debug)]
pub struct Roads<'a> {
    /// The map that the lanes of the route are from.
    pub map: &'a Map,
    /// Its conflict zones.
    pub conflicts: &'a Conflicts,
}

/// Input of a behaviour planner: everything known at the instant of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Instant of the frame.
    pub stamp: Time,
    /// State of the ego.
    pub ego: &'a EgoState,
    /// Route to follow.
    pub route: &'a Route,
    /// Sequence number of the route.
    pub number: u64,
    /// Place of the ego's origin along the route.
    pub place: FrenetPoint,
    /// The map; `None` if it is unknown, or if the planner does not read it.
    pub roads: Option<Roads<'a>>,
    /// Speed on a free road, m/s.
    pub cruise_mps: f64,
    /// Predicted motions of other road users, ordered by identity.
    pub predictions: &'a [Prediction],
    /// Newest signals of the traffic lights, with stop lines on this route.
    pub lights: Option<&'a TrafficLights>,
    /// Outline of the ego.
    pub shape: &'a Shape,
    /// Limits of the ego.
    pub limits: &'a Limits,
}

impl Situation<'_> {
    /// Arc length of the ego's front, metres.
    pub fn front_s_m(&self) -> f64 {
        self.place.s_m + (self.shape.length_m - self.shape.rear_overhang_m)
    }
}

/// A behaviour planner.
pub trait BehaviourPlanner: Send {
    /// Decides once, for each frame in order.
    fn decide(&mut self, at: &Situation<'_>) -> Decision;
}
