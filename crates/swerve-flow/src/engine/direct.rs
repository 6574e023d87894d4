//! A shortcut through the turn of the simplest operators: one synchronised input and nothing else, at most one
//! output, no run time, no deadline, no resource, nothing open. Its frame starts and ends as soon as it opens,
//! so that (a) to (f) come down to one step and one publication. It shows in no result.

use super::Engine;
use super::node::Node;
use super::start::step;
use super::turn::Answer;
use crate::input::Slot;
use crate::message::Msg;
use crate::operator::{Meter, Task};
use crate::report::RunError;
use crate::runtime::RuntimeModel;

impl Node {
    /// Whether the operator may ever take the shortcut.
    pub(super) fn may_be_direct(&self) -> bool {
        self.order.len() == 1
            && self.streams.len() <= 1
            && self.at.len() == 1
            && self.runtime == RuntimeModel::Zero
            && !self.heavy
            && self.deadline.is_none()
            && self.uses.is_none()
    }

    /// Whether exactly one frame opens in this turn, and nothing else is to be done.
    fn is_direct(&self) -> bool {
        let port = &self.at[0];
        port.fresh == 1
            && port.queue.len() == 1
            && port.pending.is_empty()
            && self.open.is_empty()
            && self.running.is_empty()
            && port.queue[0].header.stamp > self.floor
    }
}

impl Engine<'_> {
    /// Takes the shortcut if it can; says whether it did.
    pub(super) fn direct_turn(&mut self, rank: usize) -> bool {
        let node = &mut self.nodes[rank];
        if !node.direct || !self.observers.is_empty() || !node.is_direct() {
            return false;
        }
        let port = &mut node.at[0];
        port.fresh = 0;
        let msg = port.queue.pop_front().expect("just counted");
        let mut slot = [Slot::Message(msg)];
        let mut next = Some(rank);
        while let Some(rank) = next {
            next = self.direct_step(rank, &mut slot);
        }
        true
    }

    /// Answers the frame whose one message is in `slot`. What the operator publishes goes straight into the slot
    /// for the step of its reader, where that is whose turn comes next anyway.
    fn direct_step(&mut self, rank: usize, slot: &mut [Slot; 1]) -> Option<usize> {
        let node = &mut self.nodes[rank];
        let [Slot::Message(Msg { header, .. })] = slot else { return None };
        let (now, stamp) = (self.now, header.stamp);
        let origin = if node.origin { Some(stamp) } else { header.origin };
        let mut task = Task::new(now, stamp, self.seed);
        let body = node.body.as_mut().expect("only heavy operators go away");
        let panic = step(&mut **body, &node.name, &mut task, slot, &mut self.outs);
        node.tally.steps += 1;
        node.tally.ended += 1;
        // Taken apart, it is dropped here and not by a function that asks for all that most tasks have not.
        let Task { meter: Meter { units, .. }, unusual, .. } = task;
        node.tally.units += units;
        if let Some(reason) = unusual.and_then(|unusual| unusual.stop_run) {
            self.stop.get_or_insert(reason);
        }
        if let Some(message) = panic {
            self.failure = Some(RunError::Panic { operator: node.name.to_string(), message: message.into() });
            return None;
        }
        let &[id] = &node.streams[..] else { return None };
        let watermark = node.at[0].watermark.max(stamp);
        let Some(sent) = self.outs.take_all().next().map(|(_, sent)| sent) else {
            self.publish_risen(rank, 0, watermark);
            return None;
        };
        node.floor = stamp;
        node.tally.messages += 1;
        let stream = &mut self.streams[id];
        let answer = Answer { stamp, reused_from: None, origin, reads: &[] };
        let header = stream.next_header(now, watermark, &answer);
        self.digest.message(stream.key, &header, sent.digest);
        match stream.sole {
            Some(reader) if self.ready.is_before_all(reader) => {
                self.nodes[reader].at[0].watermark = watermark;
                // As an assignment it would be put together elsewhere first: the old value is dropped before.
                drop(core::mem::replace(&mut slot[0], Slot::Message(Msg { header, sent })));
                Some(reader)
            }
            _ => {
                self.deliver(id, Msg { header, sent });
                None
            }
        }
    }
}
