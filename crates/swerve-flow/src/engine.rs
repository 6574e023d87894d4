//! The executor: one sweep for every instant, whatever drives the clock.

mod answer;
mod commit;
mod commits;
mod due;
mod held;
mod node;
mod pool;
mod reports;
mod resource;
mod setup;
mod start;
mod turn;

use std::sync::Arc;

use swerve_core::Time;

use crate::alarm::Pace;
use crate::decision::{Decision, DropReason, Replay};
use crate::observer::{Dropped, Event, Watcher};
use crate::pending::Pending;
use crate::report::{EndReason, RunError, RunReport};
use commits::Commits;
use due::{Due, Ready};
use node::{Node, ResourceState, StreamState};
use pool::Pool;

/// A graph during a run.
pub(crate) struct Engine<'o> {
    nodes: Vec<Node>,
    streams: Vec<StreamState>,
    resources: Vec<ResourceState>,
    /// Rank of each operator, in the order in which the operators were added.
    rank_of: Vec<usize>,
    /// Ranks of the sources that are fed from outside.
    sources: Vec<usize>,
    due: Due,
    ready: Ready,
    /// Current instant.
    now: Time,
    /// Index of the current sweep of this instant, from 0.
    pass: u32,
    pool: Option<Pool>,
    /// The real clock, if the run follows it.
    wall: Option<Pace>,
    /// True if heavy operators have only one step on the host at a time: in a wall-clock run, or when one is repeated.
    one_worker: bool,
    seed: u64,
    replay: Option<Replay>,
    digest: Commits,
    instants: u64,
    observers: Vec<Watcher<'o>>,
    /// True if an observer uses the duration of steps on the host.
    host_time: bool,
    /// Reason why the run ends after this sweep.
    stop: Option<String>,
    failure: Option<RunError>,
}

/// Passes an event to the observers, while the event borrows other parts of the engine.
fn tell(observers: &mut [Watcher<'_>], event: &Event<'_>) {
    for observer in observers {
        observer.get().event(event);
    }
}

impl Engine<'_> {
    /// Next instant at which something is due.
    pub(crate) fn next_due(&self) -> Time {
        self.due.next()
    }

    /// Last instant that was swept.
    pub(crate) fn now(&self) -> Time {
        self.now
    }

    /// True if the run ends after the current sweep.
    pub(crate) fn is_over(&self) -> bool {
        self.stop.is_some() || self.failure.is_some()
    }

    /// Gives every operator a turn in the next sweep.
    pub(crate) fn wake_all(&mut self) {
        (0..self.nodes.len()).for_each(|rank| self.ready.insert(rank));
    }

    /// Settles the instant `now`: every operator with something to do takes its turn, in rank order.
    pub(crate) fn sweep(&mut self, now: Time) {
        self.begin(now);
        self.go_on(None);
    }

    /// Begins the sweep of the instant `now`.
    pub(crate) fn begin(&mut self, now: Time) {
        self.now = now;
        self.pass = 0;
        self.instants += 1;
        if let Some(promised) = self.digest.broken.take() {
            self.note_broken(&promised);
        }
        self.due.mark(now, &mut self.ready);
    }

    /// Continues a sweep to its end, or up to the turn at which a frame opens for the operator of rank `held`; returns
    /// true if that turn is next.
    pub(crate) fn go_on(&mut self, held: Option<usize>) -> bool {
        while self.failure.is_none() {
            while let Some(rank) = self.ready.pop() {
                if held == Some(rank) && self.nodes[rank].opens_frame(self.now) {
                    self.ready.insert(rank);
                    return true;
                }
                self.turn(rank);
                if self.failure.is_some() {
                    return false;
                }
            }
            self.pass += 1;
            self.share_resources();
            if self.failure.is_some() || (self.ready.is_empty() && self.due.next() > self.now) {
                return false;
            }
            self.due.mark(self.now, &mut self.ready);
        }
        false
    }

    /// Passes an event to the observers.
    fn tell(&mut self, event: &Event<'_>) {
        tell(&mut self.observers, event);
    }

    fn drop_stamp(&mut self, rank: usize, stamp: Time, reason: DropReason) {
        let node = &mut self.nodes[rank];
        let drops = &mut node.tally.drops;
        *match reason {
            DropReason::Skipped => &mut drops.skipped,
            DropReason::QueueFull => &mut drops.queue_full,
            DropReason::GivenUp => &mut drops.given_up,
            DropReason::Overtaken => &mut drops.overtaken,
            DropReason::TooLate => &mut drops.too_late,
        } += 1;
        if self.observers.is_empty() {
            return;
        }
        let operator = node.name.clone();
        let at = self.now;
        self.tell(&Event::Drop(Dropped { operator: &operator, stamp, at, reason }));
        self.decide(|| Decision::Drop { operator: operator.to_string(), stamp, at, reason });
    }

    /// Threads of the run, in virtual time and if there are several; the engine's thread has to be one of them.
    pub(crate) fn workers(&self) -> Option<Arc<rayon::ThreadPool>> {
        self.pool.as_ref().and_then(Pool::workers)
    }

    /// Records why the payload of a promise was not made, if so.
    fn note_broken(&mut self, promised: &Pending) {
        if let Err(why) = promised.wait() {
            let (operator, message) = (promised.operator.to_string(), why.to_owned());
            self.failure.get_or_insert(RunError::Panic { operator, message });
        }
    }

    /// Ends the run: passes the report to the observers and returns it.
    pub(crate) fn finish(mut self, end: EndReason) -> Result<RunReport, RunError> {
        let digest = self.digest.digest();
        if let Some(promised) = self.digest.broken.take() {
            self.note_broken(&promised);
        }
        let end = match (&self.failure, self.stop.take()) {
            (Some(failure), _) => EndReason::Failed(failure.to_string()),
            (None, Some(reason)) => EndReason::Stopped(reason),
            (None, None) => end,
        };
        let report = RunReport {
            digest,
            end,
            at: self.now,
            seed: self.seed,
            instants: self.instants,
            operators: self.nodes.iter().map(Node::report).collect(),
            overlapped_steps: self.pool.as_ref().map_or(0, Pool::overlapped),
        };
        self.tell(&Event::End(&report));
        match self.failure.take() {
            Some(failure) => Err(failure),
            None => Ok(report),
        }
    }
}
