//! Observers: they are told everything that a run does, in commit order, and are readers of nothing.

mod dispatch;

use std::sync::Arc;

use swerve_core::Time;

pub use dispatch::Dispatcher;

use crate::deadline::Reaction;
use crate::decision::Decision;
use crate::payload::Sent;
use crate::report::RunReport;

/// Is told everything that happens in a run, in commit order: a recorder, a table, a test. It goes along where its run
/// is moved to another thread.
pub trait Observer: Send {
    /// One event.
    fn event(&mut self, event: &Event<'_>);

    /// Whether it looks at how long steps took on this host, which costs two readings of a clock a step.
    fn wants_host_time(&self) -> bool {
        true
    }
}

impl<F: FnMut(&Event<'_>) + Send> Observer for F {
    fn event(&mut self, event: &Event<'_>) {
        self(event);
    }
}

/// What an observer is told.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// A message or a bare watermark was published.
    Publication(Publication<'a>),
    /// A step started.
    StepStart(StepStart<'a>),
    /// A step came to its modelled end.
    StepEnd(StepEnd<'a>),
    /// A deadline passed.
    Miss(Miss<'a>),
    /// A frame or a result was dropped.
    Drop(Dropped<'a>),
    /// Something was decided that is no function of the inputs.
    Decision(&'a Decision),
    /// The run is over; nothing follows.
    End(&'a RunReport),
}

/// A publication: of a message, or of a watermark alone.
#[derive(Clone, Debug)]
pub struct Publication<'a> {
    /// Who published it.
    pub operator: &'a str,
    /// On which stream.
    pub stream: &'a str,
    /// Which of the operator's outputs that is.
    pub port: usize,
    /// How many messages the stream carried before; for a bare watermark, how many so far.
    pub seq: u64,
    /// The instant that the message describes; none for a bare watermark.
    pub stamp: Option<Time>,
    /// The stream carries no later message with a stamp at or below this.
    pub watermark: Time,
    /// The present instant.
    pub visible_at: Time,
    /// In which sweep of the instant: 0 but for what follows from a shared resource's starts.
    pub pass: u32,
    /// The stamp of the step that computed it, in a repeat.
    pub reused_from: Option<Time>,
    /// The stamp of the newest sensor frame that it derives from.
    pub origin: Option<Time>,
    /// What the step that computed it read.
    pub reads: Reads<'a>,
    /// What it carries; none for a bare watermark.
    pub payload: Option<&'a Sent>,
}

/// What a step read: per input other than timers, the stamp of the (newest) message, none if there was none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reads<'a> {
    pub(crate) names: &'a [Arc<str>],
    pub(crate) stamps: &'a [Option<Time>],
}

impl<'a> Reads<'a> {
    /// Inputs by the name of their stream, in the order of the operator's ports.
    pub fn iter(&self) -> impl Iterator<Item = (&'a str, Option<Time>)> + use<'a> {
        self.names.iter().map(|name| &**name).zip(self.stamps.iter().copied())
    }
}

/// The start of a step.
#[derive(Clone, Debug)]
pub struct StepStart<'a> {
    /// Whose step.
    pub operator: &'a str,
    /// For which stamp.
    pub stamp: Time,
    /// The present instant.
    pub at: Time,
    /// When the stamp has to be answered.
    pub deadline: Option<Time>,
    /// What it reads.
    pub reads: Reads<'a>,
}

/// The modelled end of a step.
#[derive(Clone, Debug)]
pub struct StepEnd<'a> {
    /// Whose step.
    pub operator: &'a str,
    /// For which stamp.
    pub stamp: Time,
    /// When it started.
    pub start: Time,
    /// The present instant.
    pub end: Time,
    /// The units of work that it counted.
    pub units: u64,
    /// How long it took on this host; not repeatable.
    pub host_ns: u64,
    /// Its result was not published, or will not be: the stamp is answered already.
    pub late: bool,
}

/// A missed deadline.
#[derive(Clone, Debug)]
pub struct Miss<'a> {
    /// Whose deadline.
    pub operator: &'a str,
    /// For which stamp.
    pub stamp: Time,
    /// When it passed.
    pub deadline: Time,
    /// The present instant.
    pub at: Time,
    /// What answers.
    pub reaction: Reaction,
    /// Whether the step had started.
    pub started: bool,
}

/// A frame that will not be answered, or a result that will not be published.
#[derive(Clone, Debug)]
pub struct Dropped<'a> {
    /// Whose frame.
    pub operator: &'a str,
    /// For which stamp.
    pub stamp: Time,
    /// The present instant.
    pub at: Time,
    /// Why.
    pub reason: DropReason,
}

/// Why a frame or a result was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DropReason {
    /// A newer frame was started, or waits, instead.
    Skipped,
    /// The queue was full.
    QueueFull,
    /// A newer stamp was published before this one, which was waiting.
    GivenUp,
    /// A newer stamp was published before this one's result.
    Overtaken,
    /// A message came for a stamp that was answered already, so it opened no frame.
    TooLate,
}
