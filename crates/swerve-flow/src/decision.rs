//! Decision records: the events of a wall-clock run that its inputs do not determine.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};

/// Decision of a wall-clock run, or a measured run time. With the messages of the sources, the decisions repeat the run
/// bit for bit in virtual time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "decision", rename_all = "snake_case")]
pub enum Decision {
    /// The run began.
    Begin {
        /// True if the run followed the real clock.
        wall_clock: bool,
    },
    /// A source's message, or a bare watermark, was received.
    Arrival {
        /// Name of the source.
        operator: String,
        /// Stamp that the message was given; `None` for a bare watermark.
        stamp: Option<Time>,
        /// Instant that the arrival was given.
        at: Time,
    },
    /// A step ended.
    RunTime {
        /// Operator that executed the step.
        operator: String,
        /// Stamp that the step was for.
        stamp: Time,
        /// Time from the start of the step to its end.
        run_time: Span,
    },
    /// A deadline passed before the stamp was answered.
    Deadline {
        /// Operator that the deadline belongs to.
        operator: String,
        /// Stamp that was not answered in time.
        stamp: Time,
        /// Instant at which the miss was handled.
        at: Time,
        /// Number of values that the running step had offered.
        offers: u64,
    },
    /// A frame or a result was dropped.
    Drop {
        /// Operator of the frame.
        operator: String,
        /// Stamp of the frame.
        stamp: Time,
        /// Instant of the drop.
        at: Time,
        /// Reason for the drop.
        reason: DropReason,
    },
    /// A step was requested to stop.
    Stop {
        /// Operator that executed the step.
        operator: String,
        /// Stamp that the step was for.
        stamp: Time,
        /// Units of work that the step had counted.
        units: u64,
    },
    /// A step in another process did not complete.
    Lost {
        /// Operator of the step.
        operator: String,
        /// Stamp that the step was for.
        stamp: Time,
        /// Reason for the loss.
        why: String,
    },
    /// A step was the first one of an operator after a restart, from its initial state.
    #[serde(alias = "afresh")]
    Restarted {
        /// Operator that was restarted.
        operator: String,
        /// Stamp that the step was for.
        stamp: Time,
    },
    /// The run was ended from outside.
    End {
        /// Last instant that was swept.
        at: Time,
    },
}

/// Reason why a frame or a result was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DropReason {
    /// A newer frame was started or waits instead.
    Skipped,
    /// The queue was full.
    QueueFull,
    /// A newer stamp was published while this frame was waiting.
    GivenUp,
    /// A newer stamp was published before this result.
    Overtaken,
    /// A message arrived for a stamp that had already been answered, so it opened no frame.
    TooLate,
}

/// Decisions of an earlier run, to be repeated.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Replay {
    steps: BTreeMap<String, BTreeMap<Time, Decided>>,
    end: Option<Time>,
    wall_clock: bool,
}

/// Decisions about one step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Decided {
    pub(crate) run_time: Option<Span>,
    pub(crate) stop_at: Option<u64>,
    pub(crate) offers: Option<u64>,
    pub(crate) lost: bool,
    pub(crate) restarted: bool,
}

impl Replay {
    /// Decisions about a step, if the earlier run executed it.
    pub(crate) fn step(&self, operator: &str, stamp: Time) -> Option<Decided> {
        self.steps.get(operator)?.get(&stamp).copied()
    }

    /// True if the earlier run followed the real clock.
    pub(crate) fn of_wall_clock(&self) -> bool {
        self.wall_clock
    }

    /// Last instant of the earlier run, if it was ended from outside.
    pub(crate) fn end(&self) -> Option<Time> {
        self.end
    }
}

impl FromIterator<Decision> for Replay {
    fn from_iter<I: IntoIterator<Item = Decision>>(decisions: I) -> Self {
        let mut replay = Self::default();
        for decision in decisions {
            let (operator, stamp, decided) = match decision {
                Decision::RunTime { operator, stamp, run_time } => {
                    (operator, stamp, Decided { run_time: Some(run_time), ..Decided::default() })
                }
                Decision::Stop { operator, stamp, units } => {
                    (operator, stamp, Decided { stop_at: Some(units), ..Decided::default() })
                }
                Decision::Deadline { operator, stamp, offers, .. } => {
                    (operator, stamp, Decided { offers: Some(offers), ..Decided::default() })
                }
                Decision::Lost { operator, stamp, .. } => {
                    (operator, stamp, Decided { lost: true, ..Decided::default() })
                }
                Decision::Restarted { operator, stamp } => {
                    (operator, stamp, Decided { restarted: true, ..Decided::default() })
                }
                Decision::Begin { wall_clock } => {
                    replay.wall_clock = wall_clock;
                    continue;
                }
                Decision::End { at } => {
                    replay.end = Some(at);
                    continue;
                }
                // Arrivals are part of the sources' messages; drops follow from the rest.
                Decision::Arrival { .. } | Decision::Drop { .. } => continue,
            };
            let step = replay.steps.entry(operator).or_default().entry(stamp).or_default();
            step.run_time = step.run_time.or(decided.run_time);
            step.stop_at = step.stop_at.or(decided.stop_at);
            step.offers = step.offers.or(decided.offers);
            step.lost |= decided.lost;
            step.restarted |= decided.restarted;
        }
        replay
    }
}
