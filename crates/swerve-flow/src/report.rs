//! What a run comes to.

use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Span, Time};
use thiserror::Error;

use crate::graph::GraphError;

/// What a run came to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunReport {
    /// One number that two equal runs share: over (stream, stamp, visible_at, payload) in commit order.
    pub digest: Digest,
    /// Why it ended.
    pub end: EndReason,
    /// The last instant that was swept.
    pub at: Time,
    /// The seed.
    pub seed: u64,
    /// How many instants were swept.
    pub instants: u64,
    /// Per operator, in the order of their ranks.
    pub operators: Vec<OperatorReport>,
    /// How many steps ran on worker threads while another one did. Depends on the host; not part of the digest.
    pub overlapped_steps: u64,
}

/// Why a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndReason {
    /// The requested span is over.
    Until,
    /// An operator ended the run.
    Stopped(String),
    /// Nothing is left to be done, ever.
    Idle,
    /// It was ended from outside.
    Interrupted,
    /// It failed.
    Failed(String),
}

/// What one operator did in a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct OperatorReport {
    /// Its name.
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
    /// Run times drawn for want of a record.
    pub unrecorded: u64,
    /// The sum of its steps' run times, of those that came to their end.
    pub busy: Span,
    /// How many steps came to their modelled end.
    pub ended: u64,
    /// Units of work that its steps counted.
    pub units: u64,
    /// How its timers kept time, under wall clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ticks: Option<TickReport>,
}

/// How an operator's timers kept time on the real clock: how much later than due its turn came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TickReport {
    /// Ticks taken.
    pub ticks: u64,
    /// Ticks whose turn came when the next one was due already.
    pub missed: u64,
    /// Half of them were at most this late, nanoseconds (to an eighth of it).
    pub p50_ns: u64,
    /// 99 of 100 were at most this late, nanoseconds (to an eighth of it).
    pub p99_ns: u64,
    /// The latest, nanoseconds.
    pub max_ns: u64,
}

/// How late ticks were: counts in buckets an eighth wide.
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

/// Of every power of two, so many buckets.
const STEPS: u64 = 8;
const BUCKETS: usize = 62 * STEPS as usize;

/// Which bucket so many nanoseconds are in.
fn bucket(ns: u64) -> usize {
    let power = u64::from(ns.max(STEPS).ilog2()) - 3;
    (power * STEPS + (ns >> power)) as usize
}

/// The largest time in a bucket.
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
    fn lateness_is_known_to_an_eighth() {
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
    /// A newer frame was started, or waits, instead.
    pub skipped: u64,
    /// The queue was full.
    pub queue_full: u64,
    /// A newer stamp was published before this one, which was waiting.
    pub given_up: u64,
    /// A newer stamp was published before this one's result.
    pub overtaken: u64,
    /// Messages for stamps that were answered already.
    pub too_late: u64,
}

impl Drops {
    /// All frames and results dropped, for whatever reason; messages that opened no frame are not among them.
    pub fn total(&self) -> u64 {
        self.skipped + self.queue_full + self.given_up + self.overtaken
    }
}

impl RunReport {
    /// What the operator of this name did.
    pub fn operator(&self, name: &str) -> Option<&OperatorReport> {
        self.operators.iter().find(|operator| operator.name == name)
    }
}

/// Why a run could not be brought to its end. Observers have been told all that happened before.
#[derive(Debug, Error)]
pub enum RunError {
    /// The graph has an error; no step ran.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// An operator panicked.
    #[error("operator `{operator}` panicked: {message}")]
    Panic {
        /// Which.
        operator: String,
        /// What it said.
        message: String,
    },
    /// A step that another process took did not come to its end.
    #[error("operator `{operator}`: {why}")]
    Lost {
        /// Whose step.
        operator: String,
        /// What happened.
        why: String,
    },
    /// A queue was full whose policy forbids it.
    #[error("the queue of operator `{operator}` is full at stamp {stamp}")]
    QueueFull {
        /// Whose queue.
        operator: String,
        /// The stamp that found no room.
        stamp: Time,
    },
    /// The system gave no worker thread.
    #[error("no worker thread: {0}")]
    Thread(#[from] std::io::Error),
}
