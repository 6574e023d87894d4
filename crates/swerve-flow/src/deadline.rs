//! Deadlines: the time by which a stamp has to be answered, and the reaction to a miss.

use core::fmt;

use serde::{Deserialize, Serialize};
use swerve_core::Span;

use crate::stream::{Edge, Source};

/// Deadline of an operator. The deadline of each stamp is the anchor plus the length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deadline {
    pub(crate) length: Length,
    pub(crate) anchor: Anchor,
    pub(crate) reaction: Reaction,
}

/// Length of a deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Length {
    Static(Span),
    /// The newest message of a stream at the anchor instant; the span until there is one.
    Policy(Edge, Span),
}

/// Instant from which a deadline is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Anchor {
    /// Arrival: the instant at which the first message or tick of the frame became visible.
    #[default]
    Arrival,
    /// The stamp of the frame.
    Stamp,
    /// The start of the step.
    Start,
}

/// Reaction to a missed deadline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reaction {
    /// Publishes no message; the watermark rises to the stamp.
    #[default]
    Skip,
    /// Publishes the newest finished result again, under the new stamp; nothing before the first result.
    ReuseLast,
    /// Publishes the output of the operator for a missed deadline, if it has one.
    OnDeadline,
}

impl Deadline {
    /// A deadline of fixed length, counted from arrival, with nothing published on a miss.
    pub const fn after(length: Span) -> Self {
        Self { length: Length::Static(length), anchor: Anchor::Arrival, reaction: Reaction::Skip }
    }

    /// A deadline whose length is the newest message of a stream (or feedback edge) at the anchor instant, and `before`
    /// until there is one.
    pub fn from_policy(policy: impl Into<Source<Span>>, before: Span) -> Self {
        Self {
            length: Length::Policy(policy.into().edge, before),
            anchor: Anchor::Arrival,
            reaction: Reaction::Skip,
        }
    }

    /// Counts the deadline from `anchor`.
    #[must_use]
    pub const fn anchor(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    /// Reacts to a miss with `reaction`.
    #[must_use]
    pub const fn reaction(mut self, reaction: Reaction) -> Self {
        self.reaction = reaction;
        self
    }
}

impl fmt::Display for Anchor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Arrival => "arrival",
            Self::Stamp => "stamp",
            Self::Start => "start",
        })
    }
}

impl fmt::Display for Reaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Skip => "skip",
            Self::ReuseLast => "reuse_last",
            Self::OnDeadline => "on_deadline",
        })
    }
}
