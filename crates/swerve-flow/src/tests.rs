//! The rules of `docs/execution.md`, each checked by a test named after its section.

mod any;
mod clock;
mod deadlines;
mod ladders;
mod loops;
mod memory;
mod named;
mod net;
mod paced;
mod ports;
mod promises;
mod remote;
mod runtimes;
mod session;
mod sweep;
mod throughput;
mod words;
