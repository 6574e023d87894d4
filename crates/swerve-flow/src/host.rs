//! The real clock: for the wall-clock executor, measured run times and statistics of this host, nothing else.

use std::time::Instant;

/// The present moment of the real clock.
#[expect(clippy::disallowed_methods, reason = "the one place of the engine that reads the real clock")]
pub(crate) fn now() -> Instant {
    Instant::now()
}

/// Nanoseconds since `begin`.
pub(crate) fn ns_since(begin: Instant) -> u64 {
    u64::try_from((now() - begin).as_nanos()).unwrap_or(u64::MAX)
}
