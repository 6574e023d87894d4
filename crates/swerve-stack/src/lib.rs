//! The driving stack as a graph: operators, their settings, and their assembly from a configuration.
//!
//! An operator is one file in `operators/`: its description ([`Node`]), keys, named ports, and the adapter to an
//! algorithm. A [`Registry`] lists all kinds. An [`Assembly`] has the operators that a configuration asks for and the
//! inputs of each; a [`pipeline::Pipeline`] is the resulting graph.

pub mod agent;
mod algorithms;
pub mod assembly;
mod base;
mod behaviours;
pub mod config;
mod controllers;
pub mod course;
mod detectors;
pub mod faults;
mod foreign;
mod kind;
mod ladder;
mod localizers;
mod named;
mod namespace;
mod operators;
pub mod pipeline;
mod planners;
mod predictors;
mod problems;
mod read;
mod registry;
pub mod schedule;
mod section;
mod sections;
mod setup;
mod shot;
mod site;
mod stage;
mod standard;
pub mod street;
mod sumo;
mod trackers;
mod unseen;

pub use assembly::Assembly;
pub use behaviours::NamedBehaviour;
pub use config::execution::{span_of_ms, time_of_ms};
pub use config::localization::LidarPoses;
pub use controllers::{ControllerSetup, NamedController};
pub use detectors::{DetectorSetup, NamedDetector, NamedLidarDetector};
pub use foreign::Foreign;
pub use kind::{Heavy, Kind, Node, OnItsWay, OperatorKind, Role, Scheduled, Settings};
pub use localizers::NamedLocalizer;
pub use named::{Name, NoKeys};
pub use namespace::Namespace;
pub use operators::ObstacleSight;
pub use planners::{NamedPlanner, PlannerDefaults};
pub use predictors::{NamedPredictor, PredictorSetup};
pub use problems::KeyProblems;
pub use registry::Registry;
pub use section::{AnySection, Section};
pub use setup::Setup;
pub use site::{Site, Surroundings};
pub use stage::{Rendered, StreamMemory};
pub use trackers::{NamedTracker, TrackerSetup};
