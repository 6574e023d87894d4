//! Integration tests: one binary, one module per subject. The ignored tests need time, a network, or third-party
//! programs: run them with `cargo test -- --ignored`.

mod interop; // other DDS implementations
mod loopback; // two nodes in one process
mod two_hosts; // two nodes on two hosts
