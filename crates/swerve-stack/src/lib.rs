//! The driving stack as a graph: operators, their settings, and their assembly from a configuration.
//!
//! An operator is one file in `operators/`: its description ([`Node`]), keys, named ports, and the adapter to an
//! algorithm. A [`Registry`] lists all kinds. An [`Assembly`] has the operators that a configuration asks for and the
//! inputs of each; a [`pipeline::Pipeline`] is the resulting graph.

pub mod agent;
pub mod assembly;
pub mod config;
mod controllers;
pub mod course;
mod detectors;
pub mod faults;
mod foreign;
mod kind;
mod localizers;
mod named;
mod operators;
pub mod pipeline;
mod planners;
mod predictors;
mod registry;
pub mod schedule;
mod section;
mod setup;
mod shot;
mod site;
mod stage;
pub mod street;
mod trackers;

pub use assembly::Assembly;
pub use controllers::{ControllerSetup, NamedController};
pub use detectors::{DetectorSetup, NamedDetector, NamedLidarDetector};
pub use foreign::Foreign;
pub use kind::{
    Heavy, KeyProblems, Kind, NoKeys, Node, OnItsWay, OperatorKind, Role, Scheduled, Settings, span_of_ms,
    time_of_ms,
};
pub use localizers::{LidarPoses, NamedLocalizer};
pub use named::Name;
pub use operators::ObstacleSight;
pub use planners::{NamedPlanner, PlannerDefaults};
pub use predictors::{NamedPredictor, PredictorSetup};
pub use registry::Registry;
pub use section::{AnySection, Section};
pub use setup::Setup;
pub use site::{Site, Surroundings};
pub use stage::{Rendered, StreamMemory};
pub use trackers::{NamedTracker, TrackerSetup};
