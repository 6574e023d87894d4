//! Operators in processes of their own: the transport (iceoryx2), and who starts, watches and ends the processes.
//!
//! A run has one *coordinator*, which has the graph, the world and the log, and *workers*, which hold operators
//! of the same graph in a [`Worker`](swerve_flow::Worker). The coordinator hands a worker one step at a time
//! ([`RemoteExecutor`](swerve_flow::RemoteExecutor)): a call goes out as a message in shared memory, a waker wakes the
//! worker, the answer comes back the same way. Small messages are in the call itself. What fills images and
//! point clouds is written by its sensor into shared memory and read there by all: the call names the place.
//!
//! | file | what |
//! |---|---|
//! | `folder.rs` | a name of its own for all that a run leaves on the machine; removal of what dead runs left |
//! | `leftovers.rs` | shared memory of runs that were killed |
//! | `service.rs` | the one place where services are made, so that both ends always agree |
//! | `waker.rs` | wakes the process at the other end |
//! | `link.rs` | a call and its answer |
//! | `lend.rs` | memory that sensors write and workers read in place |
//! | `pool.rs` | the workers of a run: started, watched, started again or given up |
//! | `worker.rs` | the other end |
//!
//! No other crate sees iceoryx2.

mod error;
mod folder;
mod leftovers;
mod lend;
mod link;
mod pool;
mod service;
mod waker;
mod worker;

pub use error::IpcError;
pub use leftovers::dead_runs;
pub use link::{Traffic, kill_workers};
pub use pool::{LATE_S, OnLoss, OnWorkerEvent, WorkerEvent, WorkerPool, WorkerSpec};
pub use service::writable;
pub use worker::{Setup, work};
