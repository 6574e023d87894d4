//! Lane maps, and routes over them.
//!
//! A [`Map`] is a set of [`Lane`]s. Each has a centre line, borders whose distance from it may vary with arc length,
//! neighbours on both sides, successors, a kind and a speed limit. A [`Route`] is a sequence of lanes: one line from
//! start to end with the [`Borders`] of the drivable ground. Simulation, planning, evaluation and drawing query the
//! borders of the route *at an arc length*; there is no query for a width that holds everywhere.
//!
//! A [`LaneIndex`] finds the nearest lane of a large map.
//!
//! Positions along a line are in Frenet coordinates: `s` metres of arc length from its start, `d` metres to its left.
//! Distances of borders are measured across the line, positive on the border's own side. A border of constant
//! distance is one number, in memory and in text, and is evaluated without a search.
//!
//! Excluded: file formats, traffic, messages; route planning over a map is left to the caller.

mod border;
mod index;
mod lane;
mod map;
mod route;

pub use border::{Border, BorderError, Borders, Station};
pub use index::{LaneHint, LaneIndex};
pub use lane::{Lane, LaneId, LaneKind, Neighbour};
pub use map::{LanePlace, Map, MapError};
pub use route::{Route, RouteError, Stretch};
