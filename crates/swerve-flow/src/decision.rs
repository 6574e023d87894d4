//! Decision records: what in a wall-clock run is no function of its inputs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};

use crate::observer::DropReason;

/// One thing that a wall-clock run (or a measured run time) decided. With the messages of its sources,
/// these repeat the run bit for bit in virtual time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "decision", rename_all = "snake_case")]
pub enum Decision {
    /// The run began.
    Begin {
        /// Whether the real clock moved it.
        wall_clock: bool,
    },
    /// A source's message, or its watermark alone, was taken in.
    Arrival {
        /// The source.
        operator: String,
        /// The stamp that it got; none for a watermark alone.
        stamp: Option<Time>,
        /// The instant that it got.
        at: Time,
    },
    /// A step ended.
    RunTime {
        /// Whose step.
        operator: String,
        /// For which stamp.
        stamp: Time,
        /// From its start to its end.
        run_time: Span,
    },
    /// A deadline passed before the stamp was answered.
    Deadline {
        /// Whose deadline.
        operator: String,
        /// For which stamp.
        stamp: Time,
        /// When it was handled.
        at: Time,
        /// How many values the running step had offered.
        offers: u64,
    },
    /// A frame or a result was dropped.
    Drop {
        /// Whose frame.
        operator: String,
        /// For which stamp.
        stamp: Time,
        /// When.
        at: Time,
        /// Why.
        reason: DropReason,
    },
    /// A step was told to stop.
    Stop {
        /// Whose step.
        operator: String,
        /// For which stamp.
        stamp: Time,
        /// The units that it had counted.
        units: u64,
    },
    /// A step that was taken by another process did not come to its end.
    Lost {
        /// Whose step.
        operator: String,
        /// For which stamp.
        stamp: Time,
        /// What happened.
        why: String,
    },
    /// A step was the first of an operator that was restarted, in the state that it starts a run with.
    #[serde(alias = "afresh")]
    Restarted {
        /// Whose step.
        operator: String,
        /// For which stamp.
        stamp: Time,
    },
    /// The run was ended from outside.
    End {
        /// The last instant that was swept.
        at: Time,
    },
}

/// Decisions of an earlier run, to be taken again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Replay {
    steps: BTreeMap<String, BTreeMap<Time, Decided>>,
    end: Option<Time>,
    wall_clock: bool,
}

/// What was decided for one step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Decided {
    pub(crate) run_time: Option<Span>,
    pub(crate) stop_at: Option<u64>,
    pub(crate) offers: Option<u64>,
    pub(crate) lost: bool,
    pub(crate) restarted: bool,
}

impl Replay {
    /// What was decided for a step, if the earlier run had it.
    pub(crate) fn step(&self, operator: &str, stamp: Time) -> Option<Decided> {
        self.steps.get(operator)?.get(&stamp).copied()
    }

    /// Whether the earlier run followed the real clock.
    pub(crate) fn of_wall_clock(&self) -> bool {
        self.wall_clock
    }

    /// The last instant of the earlier run, if it was ended from outside.
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
                // Arrivals come with the sources' messages; drops follow from the rest.
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
