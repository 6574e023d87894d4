//! A run in virtual time that its caller advances: to an instant, or to the next frame of one operator.

use std::sync::Arc;

use swerve_core::{Span, Time};
use thiserror::Error;

use crate::engine::Engine;
use crate::error::GraphError;
use crate::graph::Graph;
use crate::inbox::Inbox;
use crate::message::{Header, Msg};
use crate::observer::Observer;
use crate::options::RunOptions;
use crate::payload::ErasedPayload;
use crate::playback::PlaybackRecord;
use crate::report::{EndReason, RunError, RunReport};

/// A run in virtual time that its caller advances.
///
/// Its result is that of [`run_virtual`](crate::run_virtual). In between, the caller reads streams
/// ([`newest`](Self::newest)) and provides data: through the inputs of an operator before which the session holds
/// ([`hold_before`](Self::hold_before)), through the handles of the graph's [sources](Graph::source), or for later
/// instants ([`feed`](Self::feed)). Data given to the handle of a source while the session holds is published at the
/// current instant; data given between two instants, one nanosecond after the last. So the result is a function of the
/// graph, the seed, and the data with its times.
pub struct Session<'o> {
    engine: Engine<'o>,
    inbox: Arc<Inbox>,
    until: Time,
    /// Rank of the operator before whose turns the session holds.
    before: Option<usize>,
    begun: bool,
    /// True during an instant: the next turn is that of `before`.
    holds: bool,
}

/// Reason why a session stopped advancing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// The session holds before the turn of the operator given to [`hold_before`](Session::hold_before).
    Held,
    /// All instants up to the requested one are settled.
    Instant,
    /// The run has ended.
    End,
}

/// Header and payload of a message; `None` if a promise was broken, which ends the run.
fn carried(message: &Msg) -> Option<(&Header, &Arc<dyn ErasedPayload>)> {
    Some((&message.header, &message.sent.made()?.payload))
}

/// A source that the caller of a session feeds: [`Session::source`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fed(usize);

/// Reason why a session refused a record.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FeedError {
    /// The instant of the record is over.
    #[error("instant {at} is over: the session is at {now}")]
    Past {
        /// Instant of the record.
        at: Time,
        /// Current instant of the session.
        now: Time,
    },
    /// A message does not follow those before it on its stream.
    #[error("stamp {stamp}: expected one after {after}, up to which the stream is complete")]
    NotAfter {
        /// Stamp of the message.
        stamp: Time,
        /// Watermark of the stream.
        after: Time,
    },
    /// A message would complete its stream beyond the stamp of a message that follows.
    #[error("stamp {stamp}: expected one before {before}, the stamp of a message that follows")]
    NotBefore {
        /// Stamp of the message.
        stamp: Time,
        /// Stamp of the message that follows.
        before: Time,
    },
    /// The source has no such output, or its messages are of another type.
    #[error("{0}")]
    Type(String),
}

/// A stream whose newest messages are kept: [`Session::watch`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watched(usize);

impl<'o> Session<'o> {
    /// Creates a run of `graph`; nothing is executed yet.
    ///
    /// # Errors
    /// If the graph has an error, or the system cannot start a worker thread.
    pub fn new(
        graph: Graph,
        options: &RunOptions,
        observers: Vec<&'o mut dyn Observer>,
    ) -> Result<Self, RunError> {
        let inbox = graph.inbox.clone();
        let mut engine = Engine::new(graph, options, None, observers, None)?;
        engine.wake_all();
        let until = options.until.unwrap_or(Time::MAX);
        Ok(Self { engine, inbox, until, before: None, begun: false, holds: false })
    }

    /// Passes all events from now on to an observer that the session owns.
    pub fn observe(&mut self, observer: Box<dyn Observer>) {
        self.engine.observe(observer);
    }

    /// The source of this name, for [`feed`](Self::feed); `None` if there is no such operator, or it has steps.
    pub fn source(&self, operator: &str) -> Option<Fed> {
        self.engine.rank(operator).filter(|rank| self.engine.is_feed(*rank)).map(Fed)
    }

    /// Gives a source a record to publish at the record's instant, in the turn of the source. A bare watermark that is
    /// not above that of the stream is ignored.
    ///
    /// # Errors
    /// If the instant is over, the type is wrong, or the stamps on a stream would not increase.
    pub fn feed(&mut self, source: Fed, record: PlaybackRecord) -> Result<(), FeedError> {
        let (at, now) = (record.visible_at, self.engine.now());
        let is_over = if self.begun { at <= now && !(self.holds && at == now) } else { at < Time::ZERO };
        if is_over {
            return Err(FeedError::Past { at, now });
        }
        self.engine.feed(source.0, record)
    }

    /// From now on, holds before each turn of this operator in which a frame opens for it.
    ///
    /// # Errors
    /// If there is no operator of this name.
    pub fn hold_before(&mut self, operator: &str) -> Result<(), GraphError> {
        let unknown = || GraphError::UnknownOperator { operator: operator.into() };
        self.before = Some(self.engine.rank(operator).ok_or_else(unknown)?);
        Ok(())
    }

    /// From now on, keeps the newest `depth` messages of a stream; `None` if there is no such stream.
    pub fn watch(&mut self, stream: &str, depth: usize) -> Option<Watched> {
        self.engine.keep(stream, depth).map(Watched)
    }

    /// Newest messages of a stream that a reader without feedback would receive now, oldest first: at least as many as
    /// are [watched](Self::watch), if there are as many.
    pub fn recent(&self, stream: Watched) -> impl Iterator<Item = (&Header, &Arc<dyn ErasedPayload>)> {
        self.engine.seen(stream.0).filter_map(carried)
    }

    /// Newest message of a stream that a reader without feedback would receive now.
    pub fn newest(&self, stream: Watched) -> Option<(&Header, &Arc<dyn ErasedPayload>)> {
        self.engine.seen(stream.0).next_back().and_then(carried)
    }

    /// Error of the run, if it failed.
    pub fn failure(&self) -> Option<&RunError> {
        self.engine.failure()
    }

    /// True if the run was stopped before its end: by an operator, an error, [`stop`](Self::stop) or a handle.
    pub fn is_stopped(&self) -> bool {
        self.engine.is_over() || self.inbox.is_stopped()
    }

    /// Current instant.
    pub fn now(&self) -> Time {
        self.engine.now()
    }

    /// Advances until the session holds or the run has ended.
    pub fn advance(&mut self) -> Reached {
        self.advance_to(Time::MAX)
    }

    /// Advances until the session holds, the run has ended, or everything up to and including `instant` is settled.
    pub fn advance_to(&mut self, instant: Time) -> Reached {
        match self.engine.workers() {
            Some(pool) => pool.install(|| self.go_on_to(instant)),
            None => self.go_on_to(instant),
        }
    }

    fn go_on_to(&mut self, instant: Time) -> Reached {
        loop {
            // A sweep that has begun is completed, as in every run.
            if !self.holds && (self.engine.is_over() || self.inbox.is_stopped()) {
                return Reached::End;
            }
            if let Some(reached) = self.begin_next(instant) {
                return reached;
            }
            self.holds = self.engine.go_on(self.before);
            if self.holds {
                return Reached::Held;
            }
        }
    }

    /// Continues the current instant, or begins the next one; returns the reason if there is none to begin.
    fn begin_next(&mut self, instant: Time) -> Option<Reached> {
        let arrivals = self.inbox.take();
        if core::mem::take(&mut self.holds) {
            self.engine.take_reports(arrivals, self.engine.now());
            if let Some(held) = self.before {
                self.engine.take_held_turn(held);
            }
            return None;
        }
        if !core::mem::replace(&mut self.begun, true) {
            self.engine.take_reports(arrivals, Time::ZERO);
            self.engine.begin(Time::ZERO);
            return None;
        }
        if !arrivals.is_empty() {
            let now = self.engine.now().saturating_add(Span::from_ns(1));
            self.engine.take_reports(arrivals, now);
            self.engine.begin(now);
            return None;
        }
        let next = self.engine.next_due();
        if next == Time::MAX || next > self.until {
            return Some(Reached::End);
        }
        if next > instant {
            return Some(Reached::Instant);
        }
        self.engine.begin(next);
        None
    }

    /// Ends the run after its current instant, for this reason, as an operator can.
    pub fn stop(&mut self, reason: &str) {
        self.engine.stop(reason);
    }

    /// Ends the run at its current instant and returns its report.
    ///
    /// # Errors
    /// As for [`run_virtual`](crate::run_virtual).
    pub fn finish(self) -> Result<RunReport, RunError> {
        self.inbox.close();
        let end = match self.engine.next_due() {
            _ if self.inbox.is_stopped() => EndReason::Interrupted,
            Time::MAX => EndReason::Idle,
            next if next > self.until => EndReason::Until,
            _ => EndReason::Interrupted,
        };
        self.engine.finish(end)
    }
}
