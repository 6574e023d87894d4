//! Who writes the commands: while the switch is on, one writer of each topic is heard and no other.

use std::collections::BTreeMap;

use swerve_ros2::bridge::{EndpointId, WriterGuid};

/// The writers of command topics.
#[derive(Debug, Default)]
pub(super) struct Writers {
    /// Whether those that are heard now stay the only ones.
    pinned: bool,
    /// The newest writer of each topic; while they are pinned, the one that was.
    heard: BTreeMap<EndpointId, WriterGuid>,
    /// Commands of others, by topic.
    refused: BTreeMap<EndpointId, u64>,
}

impl Writers {
    /// Whether a command of this writer may go on. A topic that nobody wrote on before takes its first writer.
    pub(super) fn hear(&mut self, topic: EndpointId, writer: WriterGuid) -> bool {
        let known = self.heard.entry(topic).or_insert(writer);
        if self.pinned && *known != writer {
            *self.refused.entry(topic).or_default() += 1;
            return false;
        }
        *known = writer;
        true
    }

    /// From here on those that were heard last are the only ones, or no longer.
    pub(super) fn pin(&mut self, pinned: bool) {
        self.pinned = pinned;
    }

    /// Commands that were refused, by topic.
    pub(super) fn into_refused(self) -> BTreeMap<EndpointId, u64> {
        self.refused
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_writer_of_each_topic_is_heard_while_the_switch_is_on() {
        let [ours, other] = [WriterGuid([1; 16]), WriterGuid([2; 16])];
        let [steering, speed] = [EndpointId(3), EndpointId(4)];
        let mut writers = Writers::default();
        assert!(writers.hear(steering, other) && writers.hear(steering, ours), "the newest one");
        writers.pin(true);
        assert!(writers.hear(steering, ours) && !writers.hear(steering, other));
        assert!(writers.hear(speed, other) && !writers.hear(speed, ours), "the first one");
        assert!(writers.hear(steering, ours), "a stranger changes nothing");
        // Let in again by the switch: a stack that was started anew has another name.
        writers.pin(false);
        assert!(writers.hear(steering, other));
        writers.pin(true);
        assert!(writers.hear(steering, other) && !writers.hear(steering, ours));
        assert_eq!(writers.into_refused(), [(steering, 2), (speed, 1)].into());
    }
}
