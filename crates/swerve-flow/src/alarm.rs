//! The real clock of a run, and alarms at the deadlines of its steps.

use std::time::Instant;

use swerve_core::{Span, Time};

/// The real clock of one run.
#[derive(Clone, Copy)]
pub(crate) struct Pace {
    begin: Instant,
}

impl Pace {
    /// Starts the clock.
    pub(crate) fn begin() -> Self {
        Self { begin: crate::host::now() }
    }

    pub(crate) fn now(self) -> Time {
        Time::from_ns(i64::try_from(crate::host::ns_since(self.begin)).unwrap_or(i64::MAX))
    }

    /// Creates an alarm for a step's deadline.
    pub(crate) fn alarm(self, deadline: Time) -> Alarm {
        Alarm { pace: self, deadline }
    }
}

/// Checks whether the real clock has passed a step's deadline.
pub(crate) struct Alarm {
    pace: Pace,
    deadline: Time,
}

impl Alarm {
    /// Creates an alarm that goes off after `left` from now.
    pub(crate) fn after(left: Span) -> Self {
        Pace::begin().alarm(Time::ZERO + left)
    }

    pub(crate) fn is_out(&self) -> bool {
        self.pace.now() >= self.deadline
    }

    /// Time left until the deadline; zero once it has passed.
    pub(crate) fn left(&self) -> Span {
        (self.deadline - self.pace.now()).max(Span::ZERO)
    }
}
