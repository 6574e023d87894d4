//! Integration tests: one binary, one module a subject. Those that are ignored need time, a network, other makers'
//! programs: `cargo test -- --ignored` runs them.

mod interop; // other implementations of DDS
mod loopback; // two nodes in one process
mod two_hosts; // two nodes on two hosts
