//! Operators in processes of their own: the transport (iceoryx2), and who starts, watches and ends the processes.
//!
//! A run has one *coordinator*, which has the graph, the world and the log, and *workers*, which hold operators
//! of the same graph in a [`Workshop`](swerve_flow::Workshop). The coordinator hands a worker one step at a time
//! ([`Elsewhere`](swerve_flow::Elsewhere)): a call goes out as a message in shared memory, a doorbell wakes the
//! worker, the answer comes back the same way. Small messages are in the call itself. What fills images and
//! point clouds is written by its sensor into shared memory and read there by all: the call names the place.
//!
//! | file | what |
//! |---|---|
//! | `folder.rs` | a name of its own for all that a run leaves on the machine; removal of what dead runs left |
//! | `service.rs` | the one place where services are made, so that both ends always agree |
//! | `bell.rs` | wakes the process at the other end |
//! | `link.rs` | a call and its answer |
//! | `lend.rs` | memory that sensors write and workers read in place |
//! | `crew.rs` | the workers of a run: started, watched, started again or given up |
//! | `worker.rs` | the other end |
//!
//! No other crate sees iceoryx2.

mod bell;
mod crew;
mod error;
mod folder;
mod lend;
mod link;
mod service;
mod worker;

pub use crew::{Crew, Employment, Happening, OnLoss, Told};
pub use error::IpcError;
pub use link::Traffic;
pub use worker::{Setup, work};
