//! Handling of frames that arrive while their operator is busy.

use core::fmt;

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};

/// Busy policy of an operator: the number of concurrent steps, and the frames that wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// One step at a time, followed by the newest waiting frame. The same as `Pipelined` with one place.
    #[default]
    SkipToLatest,
    /// One step at a time; up to `capacity` frames wait, and the oldest is started next.
    Queue {
        /// Maximum number of waiting frames.
        capacity: usize,
        /// Reaction to one more frame.
        full: Full,
    },
    /// Up to `places` steps at once, as in a pipeline of stages.
    Pipelined {
        /// Maximum number of concurrent steps.
        places: usize,
        /// Handling of results that are not finished in the order of their stamps.
        late: Late,
    },
}

/// Reaction to a frame that arrives while the queue is full.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Full {
    /// The oldest waiting frame is dropped.
    #[default]
    DropOldest,
    /// The newest waiting frame is dropped.
    DropNewest,
    /// The run ends as failed.
    Fail,
}

/// Handling of results that are not finished in the order of their stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Late {
    /// Newer results wait for older ones.
    #[default]
    Waits,
    /// A result that would be published after a newer one is dropped.
    Overtaken,
    /// Newer results wait; one that was finished by the publication before it is published this long after that.
    PutOff(Span),
}

impl Policy {
    /// A queue of `capacity` frames that drops the oldest frame when full.
    pub const fn queue(capacity: usize) -> Self {
        Self::Queue { capacity, full: Full::DropOldest }
    }

    /// A pipeline of `places` steps with results published in order.
    pub const fn pipelined(places: usize) -> Self {
        Self::Pipelined { places, late: Late::Waits }
    }

    /// Maximum number of concurrent steps.
    pub const fn places(self) -> usize {
        match self {
            Self::SkipToLatest | Self::Queue { .. } => 1,
            Self::Pipelined { places, .. } => places,
        }
    }

    /// Maximum number of complete frames that wait while no place is free.
    pub const fn waiting_max(self) -> usize {
        match self {
            Self::SkipToLatest | Self::Pipelined { .. } => 1,
            Self::Queue { capacity, .. } => capacity,
        }
    }

    pub(crate) const fn overtakes(self) -> bool {
        matches!(self, Self::Pipelined { late: Late::Overtaken, .. })
    }

    /// Earliest instant at which a result finished at `end` may be published, with the one before it published at
    /// `before`.
    pub(crate) fn comes_out(self, end: Time, before: Option<Time>) -> Time {
        match (self, before) {
            (Self::Pipelined { late: Late::PutOff(by), .. }, Some(before)) if end <= before => {
                before.saturating_add(by)
            }
            _ => end,
        }
    }
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::SkipToLatest => f.write_str("skip_to_latest"),
            Self::Queue { capacity, full: Full::DropOldest } => write!(f, "queue({capacity})"),
            Self::Queue { capacity, full: Full::DropNewest } => write!(f, "queue({capacity}, drop_newest)"),
            Self::Queue { capacity, full: Full::Fail } => write!(f, "queue({capacity}, fail)"),
            Self::Pipelined { places, late: Late::Waits } => write!(f, "pipelined({places})"),
            Self::Pipelined { places, late: Late::Overtaken } => write!(f, "pipelined({places}, overtaking)"),
            Self::Pipelined { places, late: Late::PutOff(by) } => {
                write!(f, "pipelined({places}, put_off {})", by.as_secs() * 1e3)
            }
        }
    }
}
