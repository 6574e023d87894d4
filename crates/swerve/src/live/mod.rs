//! `swerve live`: a vehicle on the other side of ROS 2's topics, driven.
//!
//! | module | what |
//! |---|---|
//! | [`intake`] | from ROS messages, live or recorded, to what the graph takes in |
//! | [`time`] | from a sensor's clock to the time of the run |
//! | [`vehicle`] | what a vehicle says and is told: one small trait for each interface |
//! | [`graph`] | the graph, with sources in the place of the simulated world |
//!
//! The graph depends on no transport: a bridge feeds it through [`graph::Inputs`], a recorded drive through
//! [`intake::Arrived::record`] and [`swerve_flow::Graph::playback`].

pub mod engage;
pub mod graph;
pub mod intake;
pub mod time;
pub mod vehicle;
