//! The state of operators, streams and resources during a run.

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

use swerve_core::{Span, Time};

use super::answer::{Answer, Finished};
use crate::deadline::Deadline;
use crate::host::Begin;
use crate::input::{Show, Slot, Timer};
use crate::message::{Header, Msg};
use crate::operator::{Body, Offered, OnDeadline, Task, Unusual, run_step};
use crate::payload::{Decode, PayloadType};
use crate::pending::Pending;
use crate::playback::PlaybackRecord;
use crate::policy::Policy;
use crate::report::{Lateness, OperatorReport};
use crate::runtime::{Draw, RuntimeModel};
use crate::sent::Outs;

/// One operator during a run; its index is its rank.
pub(crate) struct Node {
    pub(crate) name: Arc<str>,
    /// `None` in a feed, and while a worker has the body.
    pub(crate) body: Option<Box<dyn Body>>,
    pub(crate) on_deadline: Option<OnDeadline>,
    /// Bodies for steps before which the operator was restarted in the run that is repeated.
    pub(crate) spares: VecDeque<Box<dyn Body>>,
    /// Next publications of a feed, in order of their instants.
    pub(crate) feed: Option<VecDeque<PlaybackRecord>>,
    /// Intervals in which steps played back by a feed hold slots of the resource, in order of their starts.
    pub(crate) held: VecDeque<(Time, Time)>,
    pub(crate) at: Vec<AtPort>,
    pub(crate) timers: Vec<TimerPort>,
    pub(crate) latest: Vec<LatestPort>,
    /// Ports in the order of their declaration.
    pub(crate) order: Vec<PortRef>,
    /// One slot per port, filled for each step.
    pub(crate) slots: Vec<Slot>,
    /// Names of the streams that the ports read, without timers.
    pub(crate) reads: Arc<[Arc<str>]>,
    pub(crate) streams: Vec<usize>,
    pub(crate) runtime: RuntimeModel,
    pub(crate) policy: Policy,
    pub(crate) deadline: Option<Deadline>,
    /// Lower bound of the deadlines of open stamps; `Time::MAX` without deadlines.
    pub(crate) next_deadline: Time,
    /// Stream that determines the length of the deadline.
    pub(crate) policy_stream: Option<usize>,
    pub(crate) uses: Option<usize>,
    pub(crate) origin: bool,
    pub(crate) heavy: bool,
    /// True if only its single port triggers steps, and the steps take no time.
    pub(crate) at_once: bool,
    /// Emptied list of the last step's inputs, reused for the next step.
    pub(crate) spare_reads: Vec<Option<Time>>,
    /// Open frames that have not started, in order of stamps; the first `complete` are complete.
    pub(crate) open: VecDeque<Open>,
    pub(crate) complete: usize,
    /// Steps that hold a place, in order of stamps.
    pub(crate) running: VecDeque<Run>,
    /// Newest stamp that was published or reacted for.
    pub(crate) floor: Time,
    /// Instant at which the newest result was published.
    pub(crate) came_out: Option<Time>,
    /// Newest finished result, kept if a reaction may use it.
    pub(crate) last: Option<Finished>,
    /// One promise of each of its last steps that made promises, oldest first; a dead reference once it is kept and no
    /// longer held anywhere.
    pub(crate) promised: VecDeque<Weak<Pending>>,
    /// Instant since which it has had a complete frame and a free place without a start.
    pub(crate) since: Option<Time>,
    /// True if it had a turn in this sweep for which (e) and (f) have not been done.
    pub(crate) unsettled: bool,
    pub(crate) tally: OperatorReport,
    /// Timing of its timers, under wall clock.
    pub(crate) lateness: Option<Box<Lateness>>,
}

/// A synchronised port that reads a stream.
pub(crate) struct AtPort {
    pub(crate) watermark: Time,
    /// Messages that no step has read yet, in order of stamps.
    pub(crate) queue: VecDeque<Msg>,
    /// Number of messages at the end of the queue that arrived since the operator's last turn.
    pub(crate) fresh: usize,
    /// Delayed publications under way: arrival, message if any, watermark.
    pub(crate) pending: VecDeque<(Time, Option<Msg>, Time)>,
}

/// A timer port.
pub(crate) struct TimerPort {
    pub(crate) timer: Timer,
    /// Next tick that has not been taken in.
    pub(crate) next: Time,
    /// True if the tick at `next` opened its frame in this turn.
    pub(crate) ticking: bool,
    pub(crate) watermark: Time,
}

/// A port that reads the newest messages of a stream.
pub(crate) struct LatestPort {
    pub(crate) stream: usize,
    pub(crate) depth: usize,
    pub(crate) show: Show,
    /// Number in its stream of the newest message that a step has read.
    pub(crate) read: Option<u64>,
    pub(crate) feedback: bool,
}

#[derive(Clone, Copy)]
pub(crate) enum PortRef {
    At(usize),
    Timer(usize),
    Latest(usize),
}

/// An open stamp whose step has not started.
#[derive(Clone, Copy)]
pub(crate) struct Open {
    pub(crate) stamp: Time,
    /// `Time::MAX` if it has no deadline (yet).
    pub(crate) deadline: Time,
}

/// A step that holds a place.
pub(crate) struct Run {
    pub(crate) stamp: Time,
    pub(crate) start: Time,
    /// The modelled end; a lower bound until `settled`.
    pub(crate) end: Time,
    pub(crate) settled: bool,
    /// End by the run-time model, under wall clock: the step may take longer on this host, but not less.
    pub(crate) least_end: Time,
    pub(crate) draw: Draw,
    /// `Time::MAX` if there is no deadline.
    pub(crate) deadline: Time,
    /// True if the modelled end has been reached.
    pub(crate) finished: bool,
    /// True if the stamp is answered: the step only holds its place until its end.
    pub(crate) resolved: bool,
    /// True if it holds a slot of the operator's resource.
    pub(crate) slot: bool,
    pub(crate) origin: Option<Time>,
    pub(crate) reads: Vec<Option<Time>>,
    pub(crate) offered: Option<Offered>,
    pub(crate) outcome: Outcome,
}

/// Result of executing a step on the host.
pub(crate) enum Outcome {
    /// A worker has it, under this ticket.
    Away(u64),
    Here(Ran),
}

/// A step that ran on the host.
#[derive(Default)]
pub(crate) struct Ran {
    pub(crate) outs: Outs,
    pub(crate) units: u64,
    /// Count at which the step was requested to stop.
    pub(crate) stopped_at: Option<u64>,
    /// True if the step continued after that.
    pub(crate) went_on: bool,
    pub(crate) host_ns: u64,
    pub(crate) unusual: Option<Box<Unusual>>,
    pub(crate) panic: Option<Box<str>>,
}

impl Run {
    /// True if the step was requested to stop, stopped, and sent nothing: the reaction has to answer its stamp.
    pub(crate) fn left_to_reaction(&self) -> bool {
        let left = |ran: &Ran| ran.stopped_at.is_some() && !ran.went_on && ran.is_empty();
        !self.resolved
            && self.deadline < Time::MAX
            && matches!(&self.outcome, Outcome::Here(ran) if left(ran))
    }
}

impl Ran {
    pub(crate) fn is_empty(&self) -> bool {
        self.outs.is_empty()
    }
}

/// A port that joins on a stream.
#[derive(Clone, Copy)]
pub(crate) struct Reader {
    pub(crate) rank: usize,
    /// Index among the synchronised ports of that operator.
    pub(crate) port: usize,
}

/// One stream during a run.
pub(crate) struct StreamState {
    pub(crate) name: Arc<str>,
    /// Digest of its name, for the run's digest.
    pub(crate) key: u64,
    /// Type of its messages.
    pub(crate) payload: PayloadType,
    pub(crate) decode: Decode,
    pub(crate) watermark: Time,
    pub(crate) seq: u64,
    pub(crate) delay: Span,
    /// Ports that join on it.
    pub(crate) readers: Vec<Reader>,
    /// Newest messages, as many as its readers need.
    pub(crate) history: VecDeque<Msg>,
    /// Number of messages that its readers need; 0 without readers of the newest messages.
    pub(crate) depth: usize,
}

impl StreamState {
    /// Creates the header of the next message, and updates the stream.
    #[inline]
    pub(crate) fn next_header(&mut self, now: Time, watermark: Time, answer: &Answer<'_>) -> Header {
        let &Answer { stamp, reused_from, origin, .. } = answer;
        let header = Header { stamp, visible_at: now, seq: self.seq, watermark, reused_from, origin };
        self.seq += 1;
        self.watermark = watermark;
        header
    }

    /// Number of messages at the front of the history that are visible at `now`.
    pub(crate) fn visible(&self, now: Time, strictly_before: bool) -> usize {
        let hidden = |msg: &&Msg| {
            let at = msg.header.visible_at.saturating_add(self.delay);
            at > now || (strictly_before && at == now)
        };
        self.history.len() - self.history.iter().rev().take_while(hidden).count()
    }

    /// Keeps a message for readers of the newest ones, and drops messages that none of them can read any more.
    pub(crate) fn remember(&mut self, msg: Msg, now: Time) {
        if self.depth == 0 {
            return;
        }
        self.history.push_back(msg);
        while self.history.len() > self.depth {
            // The front is obsolete once `depth` newer ones are visible even across a feedback edge.
            let covering = self.history[self.depth].header.visible_at.saturating_add(self.delay);
            if covering >= now {
                break;
            }
            self.history.pop_front();
        }
    }
}

impl Node {
    /// Report of the operator.
    pub(crate) fn report(&self) -> OperatorReport {
        let ticks = self.lateness.as_ref().map(|lateness| lateness.report());
        OperatorReport { ticks, ..self.tally.clone() }
    }

    /// Watermark of a publication at this moment; `Time::MIN` if there is none.
    pub(crate) fn watermark(&self) -> Time {
        let mut oldest = self.open.front().map_or(Time::MAX, |open| open.stamp);
        if !self.running.is_empty()
            && let Some(run) = self.running.iter().find(|run| !run.resolved)
        {
            oldest = run.stamp;
        }
        let mut least = self.joined();
        if oldest < Time::MAX {
            least = least.min(oldest.saturating_add(Span::from_ns(-1)));
        }
        self.floor.max(least)
    }

    /// Smallest watermark of the synchronised ports.
    pub(crate) fn joined(&self) -> Time {
        if self.at.is_empty() && self.timers.is_empty() {
            return Time::MIN;
        }
        let at = self.at.iter().fold(Time::MAX, |least, port| least.min(port.watermark));
        self.timers.iter().fold(at, |least, port| least.min(port.watermark))
    }

    /// True if there is more to do at `now` after steps were started: a step ends, a deadline is missed, or frames are
    /// left to be started.
    pub(crate) fn has_more(&self, now: Time) -> bool {
        self.complete > 0 || self.next_deadline <= now || self.running.iter().any(|run| run.end <= now)
    }

    /// Number of steps that can still start.
    pub(crate) fn free_places(&self) -> usize {
        self.policy.places().saturating_sub(self.running.len())
    }

    /// Index at which the frame of `stamp` has to be inserted; `None` if it is open or was answered.
    pub(crate) fn opening(&self, stamp: Time) -> Option<usize> {
        if stamp <= self.floor {
            return None;
        }
        let index = match self.open.back() {
            Some(last) if last.stamp >= stamp => self.open.partition_point(|open| open.stamp < stamp),
            _ => return Some(self.open.len()),
        };
        (self.open[index].stamp != stamp).then_some(index)
    }

    /// Stamp of the only frame, if it has just arrived, is complete, and its step is everything that the turn has to
    /// do.
    #[inline]
    pub(crate) fn frame_at_once(&self) -> Option<Time> {
        let [port] = &self.at[..] else { return None };
        let is_alone = port.fresh == 1 && port.queue.len() == 1 && port.pending.is_empty();
        if !(is_alone && self.open.is_empty() && self.running.is_empty()) {
            return None;
        }
        let stamp = port.queue.front()?.header.stamp;
        (self.floor < stamp && stamp <= port.watermark).then_some(stamp)
    }

    /// Releases slots that a played-back step held until `now`.
    pub(crate) fn release_held(&mut self, now: Time) {
        let mut index = 0;
        while let Some((start, end)) = self.held.get(index)
            && *start <= now
        {
            if *end <= now {
                self.held.remove(index);
            } else {
                index += 1;
            }
        }
    }

    /// Number of slots that played-back steps hold at `now`.
    pub(crate) fn held_now(&self, now: Time) -> usize {
        self.held.iter().take_while(|(start, _)| *start <= now).filter(|(_, end)| now < *end).count()
    }

    /// Next instant at which that number changes.
    pub(crate) fn held_change(&self, now: Time) -> Time {
        let started = self.held.iter().take_while(|(start, _)| *start <= now).map(|(_, end)| *end);
        let next = self.held.iter().map(|(start, _)| *start).find(|start| *start > now);
        started.chain(next).min().unwrap_or(Time::MAX)
    }

    /// Removes the open frame at `index` with its messages, and returns its stamp.
    pub(crate) fn discard(&mut self, index: usize) -> Time {
        let open = self.open.remove(index).expect("the caller found it");
        self.complete -= usize::from(index < self.complete);
        for port in 0..self.at.len() {
            self.at[port].take(open.stamp);
        }
        open.stamp
    }
}

impl AtPort {
    /// Removes and returns the message of the frame at `stamp`.
    #[inline]
    pub(crate) fn take(&mut self, stamp: Time) -> Option<Msg> {
        if self.queue.front()?.header.stamp == stamp {
            return self.queue.pop_front();
        }
        let index = self.queue.binary_search_by_key(&stamp, |msg| msg.header.stamp).ok()?;
        self.queue.remove(index)
    }
}

/// A resource during a run.
pub(crate) struct ResourceState {
    pub(crate) slots: usize,
    /// Operators that use it, by rank.
    pub(crate) users: Vec<usize>,
    /// True if a user had a turn in this sweep.
    pub(crate) touched: bool,
}

/// Executes one step on the current thread; with `begin`, measures its host time from there.
#[inline(always)]
pub(super) fn run(
    body: &mut dyn Body,
    name: &str,
    task: &mut Task,
    slots: &mut [Slot],
    begin: Option<Begin>,
    ran: &mut Ran,
) {
    ran.panic = run_step(body, name, task, slots, &mut ran.outs);
    ran.host_ns = begin.map_or(0, Begin::ns);
    ran.units = task.meter.units;
    if let Some(cut) = &task.meter.cut {
        (ran.stopped_at, ran.went_on) = (cut.stopped_at, cut.went_on);
    }
    ran.unusual = task.unusual.take();
}
