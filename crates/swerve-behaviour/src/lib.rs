//! Behaviour planners: the ground, speeds and stops within which the motion planner plans.
//!
//! A [`BehaviourPlanner`] reads the situation of one frame and returns a `Decision`. [`FollowRoute`] keeps to the route
//! and its speed limits, stops at red lights, and does not overtake in junctions.
//!
//! **Frames**: arc lengths and offsets are along the line of the route, metres, positive to the left.
//!
//! Excluded: motion planning, maps beyond the route, sensors, engine, files.

mod follow_route;
mod lights;

use swerve_core::Time;
use swerve_geom::FrenetPoint;
use swerve_msg::{Decision, EgoState, Prediction, Route, TrafficLights};
use swerve_vehicle::{Limits, Shape};

pub use follow_route::{FollowRoute, FollowRouteParams};

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
