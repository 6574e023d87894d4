//! Drivers of road users.

use swerve_core::Time;
use swerve_geom::{Obb, Pose2, Vector2};
use swerve_map::Map;
use swerve_msg::ActorId;
use swerve_msg::truth::WorldState;

/// Pose and velocity of a road user.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Movement {
    /// Centre of its footprint in the map.
    pub pose: Pose2,
    /// Velocity over ground, m/s.
    pub velocity_mps: Vector2,
}

impl Movement {
    /// At rest at a pose.
    pub fn at_rest(pose: Pose2) -> Self {
        Self { pose, velocity_mps: Vector2::default() }
    }
}

/// Input of a driver: the world after a step.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The road user that it drives.
    pub own: ActorId,
    /// State of the world.
    pub world: &'a WorldState,
    /// Outline of the ego in that state.
    pub ego: Obb,
    /// Lanes of the world.
    pub map: &'a Map,
}

impl View<'_> {
    /// Instant of the state.
    pub fn now(&self) -> Time {
        self.world.stamp
    }
}

/// Moves one road user.
///
/// A road user that has been hit is moved by physics from then on; its driver still observes the world.
pub trait Driver: Send {
    /// Observes the world after each step, in order, beginning with the state at instant 0.
    fn observe(&mut self, view: &View<'_>);

    /// Movement at `to`, the end of a step that begins at `from`, the instant of the newest observed state; `None` if
    /// the road user stays at rest from `from` to `to`.
    fn movement(&self, from: Time, to: Time) -> Option<Movement>;
}
