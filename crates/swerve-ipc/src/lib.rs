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
//! | `message.rs` | headers and kinds of messages |
//! | `service.rs` | creation of all services, so that both ends always agree; `no_service.rs` without the feature `processes` |
//! | `waker.rs` | wakes the process at the other end |
//! | `link.rs` | a call and its answer |
//! | `lend.rs` | memory that sensors write and workers read in place |
//! | `pool.rs` | worker processes of a run: started, watched, restarted or given up |
//! | `worker.rs` | the worker's end |
//!
//! No other crate depends on iceoryx2. Without the feature `processes` neither does this one: see [`MISSING`].

#![cfg_attr(
    not(feature = "processes"),
    allow(dead_code, reason = "without the feature, its helpers are unused")
)]

mod error;
mod event;
mod folder;
mod interrupt;
mod leftovers;
mod lend;
mod link;
mod message;
mod pool;
#[cfg(feature = "processes")]
mod service;
#[cfg(not(feature = "processes"))]
#[path = "no_service.rs"]
mod service;
mod tail;
mod waker;
mod worker;

pub use error::IpcError;
pub use event::{LATE_S, OnWorkerEvent, WorkerEvent};
pub use folder::writable;
pub use interrupt::Interrupt;
pub use leftovers::dead_runs;
pub use link::{Traffic, kill_workers};
pub use pool::{OnLoss, WorkerPool, WorkerSpec};
pub use worker::{WorkerSetup, work};

/// Reason why this program cannot start processes; `None` if it can.
pub const MISSING: Option<&str> = if cfg!(feature = "processes") { None } else { Some(NOT_BUILT) };

const NOT_BUILT: &str =
    "this program was built without processes: build it with `--features processes` (all: `--features full`)";
