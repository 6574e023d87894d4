//! Benchmarks against peers: see the folder `benches`.
