//! The state of operators and streams during a run.

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

use swerve_core::{Span, Time};

use super::answer::Answer;
use crate::deadline::Deadline;
use crate::input::{Slot, Timer};
use crate::message::{Header, Msg};
use crate::operator::{Body, Offered, OnDeadline, Unusual};
use crate::payload::{Decode, Outs};
use crate::playback::PlaybackRecord;
use crate::policy::Policy;
use crate::promise::Pending;
use crate::report::{Lateness, OperatorReport};
use crate::runtime::{Draw, RuntimeModel};

/// One operator during a run; its index is its rank.
pub(crate) struct Node {
    pub(crate) name: Arc<str>,
    /// Absent in a feed, and while a worker has it.
    pub(crate) body: Option<Box<dyn Body>>,
    pub(crate) on_deadline: Option<OnDeadline>,
    /// Bodies for steps before which it was restarted in the run that is repeated.
    pub(crate) spares: VecDeque<Box<dyn Body>>,
    /// What a feed publishes next, in order of its instants.
    pub(crate) feed: Option<VecDeque<PlaybackRecord>>,
    /// When the steps that a feed plays back hold slots of the resource, in order of their starts.
    pub(crate) held: VecDeque<(Time, Time)>,
    pub(crate) at: Vec<AtPort>,
    pub(crate) timers: Vec<TimerPort>,
    pub(crate) latest: Vec<LatestPort>,
    /// The ports in the order of their declaration.
    pub(crate) order: Vec<PortRef>,
    /// One slot per port, filled for each step.
    pub(crate) slots: Vec<Slot>,
    /// The names of the streams that the ports read, timers left out.
    pub(crate) reads: Arc<[Arc<str>]>,
    pub(crate) streams: Vec<usize>,
    pub(crate) runtime: RuntimeModel,
    pub(crate) policy: Policy,
    pub(crate) deadline: Option<Deadline>,
    /// No open stamp has its deadline before this; `Time::MAX` without deadlines.
    pub(crate) next_deadline: Time,
    /// The stream that decides how long the deadline is.
    pub(crate) policy_stream: Option<usize>,
    pub(crate) uses: Option<usize>,
    pub(crate) origin: bool,
    pub(crate) heavy: bool,
    /// Nothing but its one port says when it takes a step, and none of them takes time.
    pub(crate) at_once: bool,
    /// What the last step read, emptied, for the next one.
    pub(crate) spare_reads: Vec<Option<Time>>,
    /// Open frames that have not started, in order of stamps; the first `complete` are complete.
    pub(crate) open: VecDeque<Open>,
    pub(crate) complete: usize,
    /// Steps that hold a place, in order of stamps.
    pub(crate) running: VecDeque<Run>,
    /// The newest stamp that was published or reacted for.
    pub(crate) floor: Time,
    /// When the newest result came out.
    pub(crate) came_out: Option<Time>,
    /// The newest finished result, kept where a reaction may want it.
    pub(crate) last: Option<Finished>,
    /// Of its last steps that promised something one promise each, oldest first; gone where it is kept and nobody
    /// holds it any more.
    pub(crate) promised: VecDeque<Weak<Pending>>,
    /// Since when it has had a complete frame and a free place without a start.
    pub(crate) since: Option<Time>,
    /// It had a turn in this sweep whose (e) and (f) are still to come.
    pub(crate) unsettled: bool,
    pub(crate) tally: OperatorReport,
    /// How its timers keep time, under wall clock.
    pub(crate) lateness: Option<Box<Lateness>>,
}

/// A synchronised port that reads a stream.
pub(crate) struct AtPort {
    pub(crate) watermark: Time,
    /// Messages that no step has taken yet, in order of stamps.
    pub(crate) queue: VecDeque<Msg>,
    /// How many at the end of the queue came since the operator's last turn.
    pub(crate) fresh: usize,
    /// Delayed publications on their way: when they arrive, the message if any, the watermark.
    pub(crate) pending: VecDeque<(Time, Option<Msg>, Time)>,
}

/// A timer port.
pub(crate) struct TimerPort {
    pub(crate) timer: Timer,
    /// The next tick that was not taken in.
    pub(crate) next: Time,
    /// The tick at `next` opened its frame in this turn.
    pub(crate) ticking: bool,
    pub(crate) watermark: Time,
}

/// A port that reads the newest messages of a stream.
pub(crate) struct LatestPort {
    pub(crate) stream: usize,
    pub(crate) depth: usize,
    /// Gives all of them, not only the newest.
    pub(crate) window: bool,
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
    /// `Time::MAX` where it has none (yet).
    pub(crate) deadline: Time,
}

/// A step that holds a place.
pub(crate) struct Run {
    pub(crate) stamp: Time,
    pub(crate) start: Time,
    /// The modelled end; a lower bound of it while `draw` still has to be settled.
    pub(crate) end: Time,
    pub(crate) settled: bool,
    /// What the run-time model says, under wall clock: the step may take longer here, but not less.
    pub(crate) least_end: Time,
    pub(crate) draw: Draw,
    /// `Time::MAX` where there is none.
    pub(crate) deadline: Time,
    /// The modelled end has come.
    pub(crate) finished: bool,
    /// The stamp is answered: the step only holds its place until its end.
    pub(crate) resolved: bool,
    /// It holds a slot of the operator's resource.
    pub(crate) slot: bool,
    pub(crate) origin: Option<Time>,
    pub(crate) reads: Vec<Option<Time>>,
    pub(crate) offered: Option<Offered>,
    pub(crate) outcome: Outcome,
}

/// What came of running a step on the host.
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
    /// The count at which it was told to stop.
    pub(crate) stopped_at: Option<u64>,
    /// It went on after that.
    pub(crate) went_on: bool,
    pub(crate) host_ns: u64,
    pub(crate) unusual: Option<Box<Unusual>>,
    pub(crate) panic: Option<Box<str>>,
}

impl Run {
    /// Whether the step was told to stop, stopped, and sent nothing: its stamp is the reaction's to answer.
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

/// A finished result.
#[derive(Clone)]
pub(crate) struct Finished {
    pub(crate) stamp: Time,
    pub(crate) origin: Option<Time>,
    pub(crate) reads: Vec<Option<Time>>,
    pub(crate) outs: Outs,
}

/// A port that joins on a stream.
#[derive(Clone, Copy)]
pub(crate) struct Reader {
    pub(crate) rank: usize,
    /// Among the synchronised ports of that operator.
    pub(crate) port: usize,
}

/// One stream during a run.
pub(crate) struct StreamState {
    pub(crate) name: Arc<str>,
    /// What stands for its name in the run's digest.
    pub(crate) key: u64,
    pub(crate) decode: Decode,
    pub(crate) watermark: Time,
    pub(crate) seq: u64,
    pub(crate) delay: Span,
    /// The ports that join on it.
    pub(crate) readers: Vec<Reader>,
    /// The newest messages, as deep as its readers look.
    pub(crate) history: VecDeque<Msg>,
    /// How deep that is; 0 where nobody looks.
    pub(crate) depth: usize,
}

impl StreamState {
    /// The header of the next message, which the stream carries from now on.
    #[inline]
    pub(crate) fn next_header(&mut self, now: Time, watermark: Time, answer: &Answer<'_>) -> Header {
        let &Answer { stamp, reused_from, origin, .. } = answer;
        let header = Header { stamp, visible_at: now, seq: self.seq, watermark, reused_from, origin };
        self.seq += 1;
        self.watermark = watermark;
        header
    }

    /// The number of messages at the front of the history that are visible at `now`.
    pub(crate) fn visible(&self, now: Time, strictly_before: bool) -> usize {
        let hidden = |msg: &&Msg| {
            let at = msg.header.visible_at.saturating_add(self.delay);
            at > now || (strictly_before && at == now)
        };
        self.history.len() - self.history.iter().rev().take_while(hidden).count()
    }

    /// Keeps a message for readers of the newest ones, and forgets what none of them can see any more.
    pub(crate) fn remember(&mut self, msg: Msg, now: Time) {
        if self.depth == 0 {
            return;
        }
        self.history.push_back(msg);
        while self.history.len() > self.depth {
            // The front is out of sight once `depth` younger ones are visible even across a feedback edge.
            let covering = self.history[self.depth].header.visible_at.saturating_add(self.delay);
            if covering >= now {
                break;
            }
            self.history.pop_front();
        }
    }
}

impl Node {
    /// What it did.
    pub(crate) fn report(&self) -> OperatorReport {
        let ticks = self.lateness.as_ref().map(|lateness| lateness.report());
        OperatorReport { ticks, ..self.tally.clone() }
    }

    /// The watermark that a publication of this moment carries; `Time::MIN` when there is none.
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

    /// The smallest watermark of the synchronised ports.
    pub(crate) fn joined(&self) -> Time {
        if self.at.is_empty() && self.timers.is_empty() {
            return Time::MIN;
        }
        let at = self.at.iter().fold(Time::MAX, |least, port| least.min(port.watermark));
        self.timers.iter().fold(at, |least, port| least.min(port.watermark))
    }

    /// Whether, after steps started, there is more to do at `now`: one of them is done, or late, or frames
    /// are left to be started.
    pub(crate) fn has_more(&self, now: Time) -> bool {
        self.complete > 0 || self.next_deadline <= now || self.running.iter().any(|run| run.end <= now)
    }

    /// How many steps may still start.
    pub(crate) fn free_places(&self) -> usize {
        self.policy.places().saturating_sub(self.running.len())
    }

    /// Where the frame of `stamp` has to be opened: nowhere if it is open or was answered.
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

    /// The stamp of the only frame that there is, where it came just now, is complete, and its step is all that the
    /// turn is to bring.
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

    /// Lets go of slots that a played-back step held until `now`.
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

    /// How many slots played-back steps hold at `now`.
    pub(crate) fn held_now(&self, now: Time) -> usize {
        self.held.iter().take_while(|(start, _)| *start <= now).filter(|(_, end)| now < *end).count()
    }

    /// When that number changes next.
    pub(crate) fn held_change(&self, now: Time) -> Time {
        let started = self.held.iter().take_while(|(start, _)| *start <= now).map(|(_, end)| *end);
        let next = self.held.iter().map(|(start, _)| *start).find(|start| *start > now);
        started.chain(next).min().unwrap_or(Time::MAX)
    }

    /// Removes the open frame at `index` and gives its stamp; its messages are forgotten.
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
    /// Takes out the message of the frame at `stamp`.
    #[inline]
    pub(crate) fn take(&mut self, stamp: Time) -> Option<Msg> {
        if self.queue.front()?.header.stamp == stamp {
            return self.queue.pop_front();
        }
        let index = self.queue.binary_search_by_key(&stamp, |msg| msg.header.stamp).ok()?;
        self.queue.remove(index)
    }
}
