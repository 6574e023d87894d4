//! Maps of lanes, and routes over them.
//!
//! A [`Map`] is a set of [`Lane`]s: each has a centre line, borders whose distance from it may vary along the
//! way, neighbours to both sides, successors, a kind and a speed limit. A [`Route`] is a way over lanes: one
//! line from start to end with the [`Borders`] of the ground that may be driven on. Who drives, plans, judges
//! or draws asks the route for its borders *at an arc length*; nobody can ask for a width that holds everywhere.
//!
//! Places along a line are Frenet places: `s` metres of arc length from its start, `d` metres to its left.
//! Distances of borders are measured across the line, positive on their own side. A border of constant distance
//! is one number, in memory and in text, and costs no search.
//!
//! Absences: no file format, no traffic, no messages; finding a way through a map is for the caller.

mod border;
mod lane;
mod map;
mod route;

pub use border::{Border, BorderError, Borders, Station};
pub use lane::{Lane, LaneId, LaneKind, Neighbour};
pub use map::{LanePlace, Map, MapError};
pub use route::{Route, RouteError, Stretch};
