//! A shortcut through the turn of the simplest operators: one synchronised input and nothing else, no run
//! time, no deadline, no resource, nothing open. Its frame starts and ends as soon as it opens, so that
//! (a) to (f) come down to one step and one publication. It shows in no result.

use super::Engine;
use super::node::Node;
use super::start::step;
use super::turn::Answer;
use crate::input::Slot;
use crate::operator::{Meter, Task};
use crate::report::RunError;
use crate::runtime::RuntimeModel;

impl Node {
    /// Whether the operator may ever take the shortcut.
    pub(super) fn may_be_direct(&self) -> bool {
        self.order.len() == 1
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
        let (now, seed) = (self.now, self.seed);
        let node = &mut self.nodes[rank];
        if !node.direct || !self.observers.is_empty() || !node.is_direct() {
            return false;
        }
        let port = &mut node.at[0];
        port.fresh = 0;
        let msg = port.queue.pop_front().expect("just counted");
        let stamp = msg.header.stamp;
        let origin = if node.origin { Some(stamp) } else { msg.header.origin };
        let joined = port.watermark;
        node.slots[0] = Slot::Message(msg);
        let mut task =
            Task { now, stamp, deadline: None, seed, rng: None, meter: Meter::default(), stop_run: None };
        let body = node.body.as_mut().expect("only heavy operators go away");
        let panic = step(&mut **body, &node.name, &mut task, &mut node.slots, &mut self.outs);
        node.tally.steps += 1;
        node.tally.ended += 1;
        node.tally.units += task.meter.units;
        if let Some(reason) = task.stop_run.take() {
            self.stop.get_or_insert(reason.into());
        }
        if let Some(message) = panic {
            self.failure = Some(RunError::Panic { operator: node.name.to_string(), message: message.into() });
            return true;
        }
        let ports = node.streams.len();
        if self.outs[..ports].iter().any(Option::is_some) {
            node.floor = stamp;
        }
        let watermark = node.floor.max(joined);
        let answer = Answer { stamp, reused_from: None, origin, reads: &[] };
        for port in 0..ports {
            match self.outs[port].take() {
                Some(sent) => self.publish_on(rank, port, watermark, &answer, sent),
                None => self.publish_risen(rank, port, watermark),
            }
        }
        true
    }
}
