//! Drivers of simulated traffic on lane maps: cars, cyclists and pedestrians, without physics.
//!
//! [`Traffic`] moves all of them. It decides at fixed intervals from the state of the previous interval, so that the
//! order of the actors has no effect, and moves smoothly in between. Cars and cyclists follow lanes by the intelligent
//! driver model, change lanes by MOBIL, and obey traffic lights, stop lines and rights of way. Each wanders without end:
//! at a fork it takes a lane by a draw keyed by seed and actor. Pedestrians walk along pavements and over crossings by
//! social forces. [`Traffic::drivers`] makes the drivers of a simulated world.
//!
//! **Frames**: the map frame of `swerve_geom`, metres, x east, y north, headings in radians from x towards y; places
//! along lanes and ways are arc lengths of vehicle centres.
//!
//! Excluded: physics, scenarios, files; `docs/traffic.md` has the models and their limits.

mod car;
mod change;
mod driver;
mod follow;
mod junction;
mod lights;
mod net;
mod scene;
mod setup;
mod spawn;
#[cfg(test)]
mod tests;
mod traffic;
mod walk;

pub use driver::GroupDriver;
pub use lights::Lights;
pub use setup::{DriverParams, TrafficSetup};
pub use traffic::{Counts, Traffic, TrafficActor};
