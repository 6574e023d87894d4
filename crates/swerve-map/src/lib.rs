//! Lane maps, and routes over them.
//!
//! A [`Map`] is a set of [`Lane`]s. Each has a centre line, borders whose distance from it may vary with arc length,
//! marks along the borders, neighbours on both sides, successors, a kind and a speed limit. A [`Route`] is a sequence of
//! lanes: one line from start to end with the [`Borders`] of the drivable ground. Simulation, planning, evaluation and
//! drawing query the borders of the route *at an arc length*; there is no query for a width that holds everywhere.
//!
//! Beside lanes, a map has [`Features`]: [`Junction`]s, traffic [`Signal`]s, [`StopLine`]s, [`Crossing`]s and
//! [`Area`]s. They refer to lanes by identity; the map checks that these exist.
//!
//! [`conflict`] finds the parts of lanes on which vehicles would touch each other, and who gives way there.
//!
//! A [`LaneIndex`] finds the nearest lane of a large map. [`router::find`] finds the cheapest way over lanes, which
//! [`Route::over`] makes a route. [`Map::paths`] are the paths from a lane, for road users with an unknown destination.
//!
//! Positions along a line are in Frenet coordinates: `s` metres of arc length from its start, `d` metres to its left.
//! Distances of borders are measured across the line, positive on the border's own side. A border of constant
//! distance is one number, in memory and in text, and is evaluated without a search.
//!
//! Excluded: file formats, traffic, messages.

mod area;
mod border;
mod border_line;
pub mod conflict;
mod crossing;
mod features;
mod index;
mod junction;
mod lane;
mod map;
mod mark;
mod route;
pub mod router;
mod signal;
mod stop_line;
mod text;

pub use area::{Area, AreaId, AreaKind};
pub use border::{Border, BorderError, Borders, Station};
pub use border_line::{BorderLine, BorderLook};
pub use crossing::{Crossing, CrossingId};
pub use features::{Feature, FeatureError, Features};
pub use index::{LaneHint, LaneIndex};
pub use junction::{Junction, JunctionId, RightOfWay};
pub use lane::{Lane, LaneId, LaneKind, Neighbour};
pub use map::{LanePath, LanePlace, Map, MapError};
pub use mark::{LaneMarks, MARK_WIDTH_M, Mark, MarkColour, MarkError, MarkKind, Side};
pub use route::{LaneChange, Route, RouteError, Stretch};
pub use signal::{Aspect, ProgramError, Signal, SignalId, SignalPhase, SignalProgram};
pub use stop_line::{StopLine, StopSign};
