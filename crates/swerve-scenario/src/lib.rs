//! Scenarios: the text form (TOML) in, a checked [`Scenario`] out, or every [`Problem`] of the file at once.
//!
//! A scenario is a road, where the ego starts and ends, the other actors with what sets them off and how they
//! move, and what is expected of the run. Places are given along the road: `s` metres from its start, `d`
//! metres to the left of the centre line of the ego's lane. **All places of vehicles, the ego's too, are of
//! the centre of their outline.** [`Scenario::drawn`] applies all that a seed varies, and nothing else does.
//!
//! Absences: no physics, no clock; the only file it opens is the one that [`Scenario::read`] is given.

mod check;
mod draw;
mod expect;
mod model;
mod parse;
mod problem;
mod road;

pub use draw::{Draws, sensor_phase};
pub use expect::{Bound, Expectation, Metric, Verdict};
pub use model::{
    Actor, Along, Direction, EgoStart, End, Motion, RoadPlace, Scenario, SpeedPoint, Standstill, Subject,
    Trigger,
};
pub use problem::Problem;
pub use road::{Road, Segment};
