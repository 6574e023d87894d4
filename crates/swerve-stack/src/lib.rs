//! The driving stack as a graph: the operators, their settings, and how a configuration assembles them.

pub mod config;
pub mod pipeline;
pub mod street;
