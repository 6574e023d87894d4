//! A run in virtual time that is stepped from outside: to an instant, or to the next frame of one operator.

use std::sync::Arc;

use swerve_core::{Span, Time};

use crate::engine::Engine;
use crate::graph::{Graph, GraphError};
use crate::message::{Header, Msg};
use crate::observer::Observer;
use crate::options::RunOptions;
use crate::payload::ErasedPayload;
use crate::report::{EndReason, RunError, RunReport};
use crate::wall::Inbox;

/// A run in virtual time that somebody outside moves on.
///
/// It comes out as [`run_virtual`](crate::run_virtual) does it. In between its caller looks at streams
/// ([`newest`](Self::newest)), and says something: through what an operator that the session holds before
/// ([`hold_before`](Self::hold_before)) is going to read, or through the handles of the graph's
/// [sources](Graph::source). What a source is given while the session holds is published at the present instant;
/// what it is given between two instants, one nanosecond after the last. So the result is a function of the graph,
/// the seed, and what was said when.
pub struct Session<'o> {
    engine: Engine<'o>,
    inbox: Arc<Inbox>,
    until: Time,
    /// The rank of the operator before whose turns it holds.
    before: Option<usize>,
    begun: bool,
    /// An instant is under way: the next turn is that of `before`.
    holds: bool,
}

/// How far a session came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// It holds before the turn of the operator that it was told to hold before.
    Held,
    /// All instants up to the one asked for are settled.
    Instant,
    /// The run is over.
    End,
}

/// A message as it is shown outside; none where a promise was broken, which ends the run.
fn carried(message: &Msg) -> Option<(&Header, &Arc<dyn ErasedPayload>)> {
    Some((&message.header, &message.sent.made()?.payload))
}

/// A stream whose newest messages are kept: [`Session::watch`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watched(usize);

impl<'o> Session<'o> {
    /// A run of `graph` of which nothing has happened yet.
    ///
    /// # Errors
    /// When the graph has a fault, or the system gives no worker thread.
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

    /// Holds from now on before each turn of this operator in which a frame opens for it.
    ///
    /// # Errors
    /// When there is no such operator.
    pub fn hold_before(&mut self, operator: &str) -> Result<(), GraphError> {
        let unknown = || GraphError::UnknownOperator { operator: operator.into() };
        self.before = Some(self.engine.rank(operator).ok_or_else(unknown)?);
        Ok(())
    }

    /// Keeps the newest `depth` messages of a stream from now on; none where there is no such stream.
    pub fn watch(&mut self, stream: &str, depth: usize) -> Option<Watched> {
        self.engine.keep(stream, depth).map(Watched)
    }

    /// The newest messages of a stream that a reader without feedback would see at this moment, oldest first: at
    /// least as many as are [watched](Self::watch), if there are so many.
    pub fn recent(&self, stream: Watched) -> impl Iterator<Item = (&Header, &Arc<dyn ErasedPayload>)> {
        self.engine.seen(stream.0).filter_map(carried)
    }

    /// The newest message of a stream that a reader without feedback would see at this moment.
    pub fn newest(&self, stream: Watched) -> Option<(&Header, &Arc<dyn ErasedPayload>)> {
        self.engine.seen(stream.0).next_back().and_then(carried)
    }

    /// Why the run failed, if it did.
    pub fn failure(&self) -> Option<&RunError> {
        self.engine.failure()
    }

    /// The present instant.
    pub fn now(&self) -> Time {
        self.engine.now()
    }

    /// Goes on until it holds or the run is over.
    pub fn advance(&mut self) -> Reached {
        self.advance_to(Time::MAX)
    }

    /// Goes on until it holds, the run is over, or everything up to and including `instant` is settled.
    pub fn advance_to(&mut self, instant: Time) -> Reached {
        match self.engine.workers() {
            Some(pool) => pool.install(|| self.go_on_to(instant)),
            None => self.go_on_to(instant),
        }
    }

    fn go_on_to(&mut self, instant: Time) -> Reached {
        loop {
            // A sweep that is under way is brought to its end, as in every run.
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

    /// Goes on with the instant that is under way, or begins the next one; says so where there is none to begin.
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

    /// Ends the run, wherever it is, and gives its report.
    ///
    /// # Errors
    /// As [`run_virtual`](crate::run_virtual).
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
