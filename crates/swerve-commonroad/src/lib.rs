//! CommonRoad: reader of scenarios (2020a, XML), reader and writer of solutions, and a checker of solutions with costs.
//!
//! [`Scenario`] is a file as plain values: roads (through `swerve_map_io`), obstacles with their motion, environment
//! obstacles, planning problems with their goals; [`xml_of_protobuf`] makes the text of a file in the protobuf format. [`Solution`] is a solution file. [`check()`] decides whether a solution
//! is valid, in the order of the official checker, and states the first step and the amount of each failure. [`costs`]
//! computes the parts of the cost functions. [`Scenario::to_toml`] makes a scenario of Swerve, and [`Recorder`] a solution
//! of the states of its drive.
//!
//! **Frames and units.** The map frame of the file: metres, x east, y north, headings in radians from x towards y, as
//! they are in the file, not wrapped. Instants are time steps of [`Scenario::step_s`] seconds. The position of an
//! obstacle is the centre of its rectangle. That of a solution is the centre of gravity of its vehicle, which is also
//! the centre of its rectangle.
//!
//! **Errors.** `swerve_map_io::Problems`: file, line, column, element and the expected value. Files are at most 256 MiB
//! when unpacked, with at most [`OBSTACLES_MAX`] obstacles of together [`STATES_MAX`] states.
//!
//! **Source.** "CommonRoad: documentation of the XML format", version 2020a; `commonroad-io` 2024.3 for solutions;
//! `commonroad-drivability-checker` 2025.4.0 for the checks and costs; `commonroad-vehicle-models` 3.0.2 for vehicles.
//!
//! Excluded: version 2018b, the three-part protobuf format of 2026, uncertain positions of obstacles, multi-body and trailer models, input
//! vectors, the parts D, O, LC, Jlat, Jlon and Vlon of the costs, which need a reference path, the driving itself, and
//! files other than those passed in as text.

mod check;
mod cost;
mod drive;
mod feasible;
mod kinematic;
mod model;
mod obstacle;
mod problem;
mod protobuf;
mod read;
mod recorder;
mod road;
mod scenario;
mod shape;
mod solution;
mod vehicle;
mod write;

pub use check::{Failure, StateId, Verdict, check};
pub use cost::{CostFunction, Costs, Part, costs};
pub use drive::NoWay;
pub use feasible::{Miss, misses};
pub use model::Model;
pub use obstacle::{Motion, Obstacle, ObstacleKind, Occupancy, State};
pub use problem::{Goal, GoalPosition, Interval, PlanningProblem};
pub use protobuf::{ProtobufError, xml_of_protobuf};
pub use recorder::{Ego, Recorder};
pub use road::Road;
pub use scenario::{Beside, Environment, Lanelet, Scenario};
pub use shape::Shape;
pub use solution::{Driven, Solution, SolutionState};
pub use vehicle::{Vehicle, VehicleKind};

/// Most obstacles of a scenario.
pub const OBSTACLES_MAX: usize = 10_000;

/// Most states of all obstacles of a scenario together, and of a solution.
pub const STATES_MAX: usize = 2_000_000;
