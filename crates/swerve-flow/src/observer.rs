//! Observers receive every event of a run, in commit order, and never affect the run.

mod dispatch;

use std::sync::Arc;

use swerve_core::Time;

pub use dispatch::Dispatcher;

use crate::deadline::Reaction;
use crate::decision::{Decision, DropReason};
use crate::report::RunReport;
use crate::sent::Sent;

/// Receives every event of a run, in commit order: a recorder, a table, a test. It is `Send` because a run can be moved
/// to another thread.
pub trait Observer: Send {
    /// Handles one event.
    fn event(&mut self, event: &Event<'_>);

    /// True if the observer uses the duration of steps on this host, which costs two clock readings per step.
    fn wants_host_time(&self) -> bool {
        true
    }
}

impl<F: FnMut(&Event<'_>) + Send> Observer for F {
    fn event(&mut self, event: &Event<'_>) {
        self(event);
    }
}

/// An observer of an engine.
pub(crate) enum Watcher<'o> {
    /// It is the caller's.
    Lent(&'o mut dyn Observer),
    /// The engine drops it.
    Owned(Box<dyn Observer>),
}

impl Watcher<'_> {
    #[inline]
    pub(crate) fn get(&mut self) -> &mut dyn Observer {
        match self {
            Self::Lent(observer) => &mut **observer,
            Self::Owned(observer) => &mut **observer,
        }
    }
}

/// Event that an observer receives.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// A message or a bare watermark was published.
    Publication(Publication<'a>),
    /// A step started.
    StepStart(StepStart<'a>),
    /// A step reached its modelled end.
    StepEnd(StepEnd<'a>),
    /// A deadline was missed.
    Miss(Miss<'a>),
    /// A frame or a result was dropped.
    Drop(Dropped<'a>),
    /// A decision was taken that the inputs do not determine.
    Decision(&'a Decision),
    /// The run has ended; no event follows.
    End(&'a RunReport),
}

/// Publication of a message or of a bare watermark.
#[derive(Clone, Debug)]
pub struct Publication<'a> {
    /// Operator that published it.
    pub operator: &'a str,
    /// Stream on which it was published.
    pub stream: &'a str,
    /// Index of the operator's output.
    pub port: usize,
    /// Number of messages on the stream before this one; for a bare watermark, the number so far.
    pub seq: u64,
    /// Instant that the message describes; `None` for a bare watermark.
    pub stamp: Option<Time>,
    /// The stream carries no later message with a stamp at or below this.
    pub watermark: Time,
    /// Current instant.
    pub visible_at: Time,
    /// Index of the sweep within the instant; above 0 only for what follows from a start on a shared resource.
    pub pass: u32,
    /// Stamp of the step that computed it, if it is a repeat.
    pub reused_from: Option<Time>,
    /// Stamp of the newest sensor frame that it derives from.
    pub origin: Option<Time>,
    /// Inputs of the step that computed it.
    pub reads: Reads<'a>,
    /// Payload of the message; `None` for a bare watermark.
    pub payload: Option<&'a Sent>,
}

/// Inputs read by a step: the stamp of the (newest) message of each input except timers, `None` if there was none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reads<'a> {
    pub(crate) names: &'a [Arc<str>],
    pub(crate) stamps: &'a [Option<Time>],
}

impl<'a> Reads<'a> {
    /// Inputs with the names of their streams, in the order of the operator's ports.
    pub fn iter(&self) -> impl Iterator<Item = (&'a str, Option<Time>)> + use<'a> {
        self.names.iter().map(|name| &**name).zip(self.stamps.iter().copied())
    }
}

/// The start of a step.
#[derive(Clone, Debug)]
pub struct StepStart<'a> {
    /// Operator that executes the step.
    pub operator: &'a str,
    /// Stamp that the step is for.
    pub stamp: Time,
    /// Current instant.
    pub at: Time,
    /// Instant by which the stamp has to be answered.
    pub deadline: Option<Time>,
    /// Inputs of the step.
    pub reads: Reads<'a>,
}

/// The modelled end of a step.
#[derive(Clone, Debug)]
pub struct StepEnd<'a> {
    /// Operator that executed the step.
    pub operator: &'a str,
    /// Stamp that the step was for.
    pub stamp: Time,
    /// Instant at which the step started.
    pub start: Time,
    /// Current instant.
    pub end: Time,
    /// Units of work that the step counted.
    pub units: u64,
    /// Duration of the step on this host, nanoseconds; not repeatable.
    pub host_ns: u64,
    /// True if its result is not published because the stamp has already been answered.
    pub late: bool,
}

/// A missed deadline.
#[derive(Clone, Debug)]
pub struct Miss<'a> {
    /// Operator that the deadline belongs to.
    pub operator: &'a str,
    /// Stamp that was not answered in time.
    pub stamp: Time,
    /// Instant of the deadline.
    pub deadline: Time,
    /// Current instant.
    pub at: Time,
    /// Reaction that answers the stamp.
    pub reaction: Reaction,
    /// True if the step had started.
    pub started: bool,
}

/// A frame that will not be answered, or a result that will not be published.
#[derive(Clone, Debug)]
pub struct Dropped<'a> {
    /// Operator of the frame.
    pub operator: &'a str,
    /// Stamp of the frame.
    pub stamp: Time,
    /// Current instant.
    pub at: Time,
    /// Reason for the drop.
    pub reason: DropReason,
}
