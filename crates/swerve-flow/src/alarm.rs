//! The clock that paces a run, and alarms at the deadlines of its steps.

use std::time::Instant;

use swerve_core::{Span, Time};

use crate::simulated_time::SimulatedTime;

/// The clock that paces one run.
#[derive(Clone)]
pub(crate) enum Pace {
    /// The real clock since this instant.
    Real(Instant),
    /// Simulated time, advanced from outside.
    Simulated(SimulatedTime),
}

impl Pace {
    /// Starts the real clock.
    pub(crate) fn begin() -> Self {
        Self::Real(crate::host::now())
    }

    pub(crate) fn now(&self) -> Time {
        match self {
            Self::Real(begin) => {
                Time::from_ns(i64::try_from(crate::host::ns_since(*begin)).unwrap_or(i64::MAX))
            }
            Self::Simulated(clock) => clock.now(),
        }
    }

    /// True if it advances without an event that wakes the run.
    pub(crate) fn runs_by_itself(&self) -> bool {
        matches!(self, Self::Real(_))
    }

    /// Creates an alarm for a step's deadline.
    pub(crate) fn alarm(&self, deadline: Time) -> Alarm {
        Alarm { pace: self.clone(), deadline }
    }
}

/// Checks whether the clock has passed a step's deadline.
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
