//! Benches beside peers: see the folder `benches`.
