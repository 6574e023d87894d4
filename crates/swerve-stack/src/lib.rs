//! The driving stack as a graph: the operators, their settings, and how a configuration assembles them.
//!
//! An operator is one file in `operators/`: what the house knows of it ([`Node`]), its keys, its named ports, and the
//! adapter to an algorithm. A [`Registry`] has them all. An [`Assembly`] says which of them a configuration asks for and
//! what each reads; a [`pipeline::Pipeline`] is the graph of that.

pub mod agent;
pub mod assembly;
pub mod config;
pub mod course;
pub mod faults;
mod kind;
mod operators;
pub mod pipeline;
mod registry;
mod shot;
mod site;
mod stage;
pub mod street;

pub use assembly::Assembly;
pub use kind::{
    Heavy, KeyProblems, Kind, NoKeys, Node, OnItsWay, OperatorKind, Role, Scheduled, Settings, span_of_ms,
    time_of_ms,
};
pub use operators::ObstacleSight;
pub use registry::Registry;
pub use site::{Site, Surroundings};
pub use stage::{Rendered, StreamMemory};
