//! Traits of a simulated world: the world itself, and the drivers of the road users in it.
//!
//! A [`World`] has a map, advances under the commands of the egos, and has a state, `swerve_msg::truth::WorldState`.
//! `swerve_sim::Simulator` is an implementation; another simulator is one more.
//!
//! A [`Driver`] moves one road user. The world calls it once per step with everything that the driver may know, so that
//! a drive is a function of scenario, parameters and seed. Scripts are drivers; traffic models, recorded tracks and the
//! road users of other simulators are others.
//!
//! [`Others`] is another simulator that moves road users, which come and go.
//!
//! **Frames**: the map frame of `swerve_geom`, metres, x east, y north, headings in radians from x towards y.
//!
//! Excluded: physics, scenarios, files, and the stack that drives the egos.

mod driver;
mod others;
mod world;

pub use driver::{Driver, Movement, View};
pub use others::{Other, Others, OthersError};
pub use world::World;
