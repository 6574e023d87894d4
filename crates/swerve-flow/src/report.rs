//! Result of a run.

use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Span, Time};
use thiserror::Error;

use crate::error::GraphError;

/// Result of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunReport {
    /// Digest that is equal for equal runs: over (stream, stamp, visible_at, payload) in commit order.
    pub digest: Digest,
    /// Reason why the run ended.
    pub end: EndReason,
    /// Last instant that was swept.
    pub at: Time,
    /// Seed of the run.
    pub seed: u64,
    /// Number of instants that were swept.
    pub instants: u64,
    /// Reports of the operators, in the order of their ranks.
    pub operators: Vec<OperatorReport>,
    /// Number of steps that ran on worker threads while another one did. Depends on the host; not part of the digest.
    pub overlapped_steps: u64,
}

/// Reason why a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndReason {
    /// The requested span has elapsed.
    Until,
    /// An operator ended the run.
    Stopped(String),
    /// All work is done.
    Idle,
    /// The run was ended from outside.
    Interrupted,
    /// The run failed.
    Failed(String),
}

/// Activity of one operator in a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct OperatorReport {
    /// Name of the operator.
    pub name: String,
    /// Steps started.
    pub steps: u64,
    /// Messages published, repeats included.
    pub messages: u64,
    /// Messages that repeated an older result.
    pub repeats: u64,
    /// Watermarks published without a message.
    pub bare: u64,
    /// Deadlines missed.
    pub misses: u64,
    /// Frames and results dropped.
    pub drops: Drops,
    /// Run times drawn because there was no record.
    pub unrecorded: u64,
    /// Sum of the run times of its steps that ended.
    pub busy: Span,
    /// Number of steps that reached their modelled end.
    pub ended: u64,
    /// Units of work that its steps counted.
    pub units: u64,
    /// Timing of its timers, under wall clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ticks: Option<TickReport>,
}

/// Timing of an operator's timers on the real clock: the delay of its turn after a tick was due.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TickReport {
    /// Number of ticks.
    pub ticks: u64,
    /// Ticks whose turn came after the next one was due.
    pub missed: u64,
    /// Median delay, nanoseconds (to an eighth of it).
    pub p50_ns: u64,
    /// 99th percentile of the delay, nanoseconds (to an eighth of it).
    pub p99_ns: u64,
    /// Maximum delay, nanoseconds.
    pub max_ns: u64,
}

/// Histogram of the delay of ticks, in buckets an eighth wide.
#[derive(Clone, Debug)]
pub(crate) struct Lateness {
    counts: Vec<u64>,
    report: TickReport,
}

impl Default for Lateness {
    fn default() -> Self {
        Self { counts: vec![0; BUCKETS], report: TickReport::default() }
    }
}

/// Number of buckets per power of two.
const STEPS: u64 = 8;
const BUCKETS: usize = 62 * STEPS as usize;

/// Index of the bucket that contains `ns` nanoseconds.
fn bucket(ns: u64) -> usize {
    let power = u64::from(ns.max(STEPS).ilog2()) - 3;
    (power * STEPS + (ns >> power)) as usize
}

/// Largest time in a bucket.
fn largest(bucket: usize) -> u64 {
    let (power, step) = match bucket as u64 {
        small if small < 2 * STEPS => (0, small),
        other => (other / STEPS - 1, other % STEPS + STEPS),
    };
    ((step + 1) << power) - 1
}

impl Lateness {
    pub(crate) fn tick(&mut self, late_ns: u64, missed: bool) {
        self.counts[bucket(late_ns).min(BUCKETS - 1)] += 1;
        self.report.ticks += 1;
        self.report.missed += u64::from(missed);
        self.report.max_ns = self.report.max_ns.max(late_ns);
    }

    pub(crate) fn report(&self) -> TickReport {
        let TickReport { ticks, max_ns, .. } = self.report;
        let at = |percent: u64| {
            let mut left = (ticks * percent).div_ceil(100).max(1);
            let bucket = self.counts.iter().position(|count| {
                let here = *count >= left;
                left -= if here { 0 } else { *count };
                here
            });
            bucket.map_or(0, largest).min(max_ns)
        };
        TickReport { p50_ns: at(50), p99_ns: at(99), ..self.report }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lateness_is_accurate_to_an_eighth() {
        for ns in (0..100).chain([1000, 1023, 1024, 99_999, 2_000_000, 5_000_000_000]) {
            let largest = largest(bucket(ns));
            assert!(ns <= largest && largest <= ns + ns / 8, "{ns}: {largest}");
        }
        let mut lateness = Lateness::default();
        for us in 1..=200 {
            lateness.tick(us * 1000, us > 198);
        }
        let report = lateness.report();
        assert_eq!((report.ticks, report.missed, report.max_ns), (200, 2, 200_000));
        assert!((100_000..113_000).contains(&report.p50_ns), "{report:?}");
        assert!((198_000..=200_000).contains(&report.p99_ns), "{report:?}");
        assert_eq!(Lateness::default().report(), TickReport::default());
    }
}

/// Frames and results dropped, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Drops {
    /// A newer frame was started or waits instead.
    pub skipped: u64,
    /// The queue was full.
    pub queue_full: u64,
    /// A newer stamp was published while this frame was waiting.
    pub given_up: u64,
    /// A newer stamp was published before this result.
    pub overtaken: u64,
    /// Messages for stamps that had already been answered.
    pub too_late: u64,
}

impl Drops {
    /// Number of all dropped frames and results; excludes messages that opened no frame.
    pub fn total(&self) -> u64 {
        self.skipped + self.queue_full + self.given_up + self.overtaken
    }
}

impl RunReport {
    /// Report of the operator of this name.
    pub fn operator(&self, name: &str) -> Option<&OperatorReport> {
        self.operators.iter().find(|operator| operator.name == name)
    }
}

/// Error that ended a run. Observers have received all events before it.
#[derive(Debug, Error)]
pub enum RunError {
    /// The graph has an error; no step was executed.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// An operator panicked.
    #[error("operator `{operator}` panicked: {message}")]
    Panic {
        /// Name of the operator.
        operator: String,
        /// Panic message.
        message: String,
    },
    /// A step did not complete: in another process, or for want of something outside of the program.
    #[error("operator `{operator}`: {why}")]
    Lost {
        /// Name of the operator.
        operator: String,
        /// Reason for the loss.
        why: String,
    },
    /// A queue was full whose policy is to fail then.
    #[error("the queue of operator `{operator}` is full at stamp {stamp}")]
    QueueFull {
        /// Name of the operator.
        operator: String,
        /// Stamp of the frame that found no room.
        stamp: Time,
    },
    /// The system could not start a worker thread.
    #[error("no worker thread: {0}")]
    Thread(#[from] std::io::Error),
}
