//! A log that the transport cannot flood.

use std::io::Write;
use std::sync::atomic::{AtomicU64, Ordering};

use log::{LevelFilter, Log, Metadata, Record};

/// The same as a filter for `env_logger` and its like.
pub const LOG_FILTER: &str = "warn,rustdds::structure=off";

/// A reader that lost a fragment writes thousands of lines here that nobody can use.
const SILENT: [&str; 1] = ["rustdds::structure"];

/// No more lines than this of all together.
const LINES_MAX: u64 = 1000;

struct Stderr {
    lines: AtomicU64,
}

static STDERR: Stderr = Stderr { lines: AtomicU64::new(0) };

/// Writes what the transport logs from this level on to standard error, without what floods it. Does nothing where
/// the program has a log already.
pub fn log_to_stderr(level: LevelFilter) {
    if log::set_logger(&STDERR).is_ok() {
        log::set_max_level(level);
    }
}

fn is_silent(target: &str) -> bool {
    SILENT.iter().any(|silent| target.starts_with(silent))
}

impl Log for Stderr {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        !is_silent(metadata.target())
    }

    fn log(&self, record: &Record<'_>) {
        if !self.enabled(record.metadata()) {
            return;
        }
        let n = self.lines.fetch_add(1, Ordering::Relaxed);
        if n < LINES_MAX {
            // Nothing is to be done about a standard error that is closed.
            let _ = writeln!(std::io::stderr(), "ros2 {}: {}", record.level(), record.args());
        } else if n == LINES_MAX {
            let _ = writeln!(std::io::stderr(), "ros2: no more lines after {LINES_MAX}");
        }
    }

    fn flush(&self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_floods_is_silent() {
        assert!(is_silent("rustdds::structure::sequence_number"));
        assert!(!is_silent("rustdds::dds::participant"));
    }
}
