//! Operators in separate processes: the transport (iceoryx2), and starting, watching and ending the processes.
//!
//! A run has one *coordinator*, which has the graph, the world and the log, and *workers*, which hold operators of the
//! same graph in a [`Worker`](swerve_flow::Worker). The coordinator passes one step at a time to a worker
//! ([`RemoteExecutor`](swerve_flow::RemoteExecutor)): a call is sent as a message in shared memory, a waker wakes the
//! worker, and the answer returns in the same way. Small messages are part of the call. A sensor writes the data of
//! images and point clouds into shared memory, where all processes read it: the call names its place.
//!
//! | file | content |
//! |---|---|
//! | `folder.rs` | unique names for everything that a run leaves on the machine; cleanup after dead runs |
//! | `leftovers.rs` | cleanup of shared memory that killed runs left |
//! | `service.rs` | creation of all services, so that both ends always agree |
//! | `waker.rs` | wakes the process at the other end |
//! | `link.rs` | a call and its answer |
//! | `lend.rs` | memory that sensors write and workers read in place |
//! | `pool.rs` | worker processes of a run: started, watched, restarted or given up |
//! | `worker.rs` | the worker's end |
//!
//! No other crate depends on iceoryx2.

mod error;
mod event;
mod folder;
mod leftovers;
mod lend;
mod link;
mod pool;
mod service;
mod waker;
mod worker;

pub use error::IpcError;
pub use event::{LATE_S, OnWorkerEvent, WorkerEvent};
pub use leftovers::dead_runs;
pub use link::{Traffic, kill_workers};
pub use pool::{OnLoss, WorkerPool, WorkerSpec};
pub use service::writable;
pub use worker::{WorkerSetup, work};
