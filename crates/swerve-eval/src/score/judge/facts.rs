//! Facts of each step that a judge needs.

use swerve_geom::{Point2, Pose2};

use crate::score::leaderboard::Struck;

/// A route to judge.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct JudgedRoute {
    /// Length, metres.
    pub length_m: f64,
    /// Number of sections in which the ego's speed is compared with that of the traffic (2.x).
    pub speed_checkpoints: u32,
}

impl JudgedRoute {
    /// A route with the four sections of Leaderboard 2.x. Bench2Drive has
    /// [20](crate::score::bench2drive::SPEED_CHECKPOINTS).
    pub fn of_length(length_m: f64) -> Self {
        Self { length_m, speed_checkpoints: 4 }
    }
}

/// End of a route.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ending {
    /// The end was reached.
    Completed,
    /// The ego stood for 180 s.
    Blocked,
    /// The ego left the route.
    Deviated,
    /// The route took too long.
    TimedOut,
}

/// The ego.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ego {
    /// Pose of the centre of its outline.
    pub center: Pose2,
    /// Half its length, metres.
    pub half_length_m: f64,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Speed along its heading, m/s; negative backwards.
    pub forward_mps: f64,
}

/// Position of the ego on the route and the map.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct RoutePlace {
    /// Arc length along the route, metres.
    pub s_m: f64,
    /// Distance of the ego's centre from the route, metres.
    pub off_route_m: f64,
    /// Distance of the ego's centre from the end of the route, metres.
    pub to_end_m: f64,
    /// Distance of the ego's centre from the nearest lane for driving or parking, metres; zero inside.
    pub off_lanes_m: f64,
    /// True if the nearest lane has the opposite direction; always false in junctions.
    pub against_traffic: bool,
    /// Heading of the nearest lane, radians.
    pub lane_heading_rad: f64,
    /// Speed limit, m/s; without one that is positive, progress adds no time to the timeout (2.x).
    pub limit_mps: f64,
}

/// Contact with another party.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Touch {
    /// Identity; `None` for the static world.
    pub other: Option<u64>,
    /// Kind.
    pub kind: Struck,
}

/// A traffic light that is red.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RedLight {
    /// Identity.
    pub id: u64,
    /// Centre of the light's area of effect.
    pub center: Point2,
    /// Middle of the stop line, with the heading of its lane.
    pub line: Pose2,
    /// Width of the lane, metres.
    pub lane_width_m: f64,
    /// True if the lane behind the ego's tail is that of the stop line.
    pub is_own_lane: bool,
}

/// A stop sign near the ego, by the ends of its area of effect along the ego's lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StopSign {
    /// Identity.
    pub id: u64,
    /// Distance along the lane to the near end, metres; negative behind the ego's centre.
    pub from_m: f64,
    /// Distance along the lane to the far end, metres.
    pub to_m: f64,
    /// Distance of the ego's centre from the middle of the area, metres. In 1.0 it is that from the sign.
    pub distance_m: f64,
}

/// An emergency vehicle, by the pose of its centre.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct EmergencyVehicle(pub Pose2);

/// Facts of one step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StepFacts<'a> {
    /// Time since the begin of the route, seconds.
    pub at_s: f64,
    /// The ego.
    pub ego: Ego,
    /// Its place.
    pub place: RoutePlace,
    /// Contacts of the ego in this step.
    pub touches: &'a [Touch],
    /// Red lights.
    pub red_lights: &'a [RedLight],
    /// Stop signs.
    pub stop_signs: &'a [StopSign],
    /// Mean speed of the background vehicles, m/s; `None` without any.
    pub traffic_mps: Option<f64>,
    /// Scenarios of the route that are running: identity, and instant of the begin, seconds.
    pub scenarios: &'a [(u64, f64)],
}
