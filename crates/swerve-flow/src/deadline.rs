//! Deadlines: until when a stamp has to be answered, and what answers it otherwise.

use core::fmt;

use serde::{Deserialize, Serialize};
use swerve_core::Span;

use crate::input::{Edge, Source};

/// The deadline of an operator; each of its stamps has its own: anchor plus length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deadline {
    pub(crate) length: Length,
    pub(crate) anchor: Anchor,
    pub(crate) reaction: Reaction,
}

/// How long a deadline is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Length {
    Static(Span),
    /// The newest message of a stream at the anchor instant; the span before there is one.
    Policy(Edge, Span),
}

/// From when a deadline counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Anchor {
    /// The first message or tick of the frame became visible.
    #[default]
    Arrival,
    /// The stamp itself.
    Stamp,
    /// The step started.
    Start,
}

/// What answers a stamp whose deadline passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reaction {
    /// No message; the watermark rises to the stamp.
    #[default]
    Skip,
    /// The newest finished result again, under the new stamp; nothing before the first result.
    ReuseLast,
    /// What [`Operator::on_deadline`](crate::Operator::on_deadline) publishes.
    OnDeadline,
}

impl Deadline {
    /// A deadline of fixed length, counted from arrival, with nothing published on a miss.
    pub const fn after(length: Span) -> Self {
        Self { length: Length::Static(length), anchor: Anchor::Arrival, reaction: Reaction::Skip }
    }

    /// A deadline whose length is the newest message of a stream (or feedback edge) at the anchor instant,
    /// and `before` as long as there is none.
    pub fn from_policy(policy: impl Into<Source<Span>>, before: Span) -> Self {
        Self {
            length: Length::Policy(policy.into().edge, before),
            anchor: Anchor::Arrival,
            reaction: Reaction::Skip,
        }
    }

    /// Counts from `anchor`.
    #[must_use]
    pub const fn anchor(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    /// Answers a miss by `reaction`.
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
