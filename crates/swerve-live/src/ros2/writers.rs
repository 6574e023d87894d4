//! Writers of commands: while the switch is on, only one writer per topic is accepted.

use std::collections::BTreeMap;

use swerve_ros2::bridge::{EndpointId, WriterGuid};

/// Known writers of the command topics.
#[derive(Debug, Default)]
pub(super) struct Writers {
    /// True if the known writers are the only ones accepted.
    pinned: bool,
    /// Newest writer of each topic; while pinned, the accepted one.
    heard: BTreeMap<EndpointId, WriterGuid>,
    /// Rejected commands of other writers, by topic.
    refused: BTreeMap<EndpointId, u64>,
}

impl Writers {
    /// Returns true if a command of this writer is accepted. A topic without a known writer accepts its first one.
    pub(super) fn hear(&mut self, topic: EndpointId, writer: WriterGuid) -> bool {
        let known = self.heard.entry(topic).or_insert(writer);
        if self.pinned && *known != writer {
            *self.refused.entry(topic).or_default() += 1;
            return false;
        }
        *known = writer;
        true
    }

    /// Pins the known writers as the only ones accepted, or unpins them.
    pub(super) fn pin(&mut self, pinned: bool) {
        self.pinned = pinned;
    }

    /// Number of rejected commands, by topic.
    pub(super) fn into_refused(self) -> BTreeMap<EndpointId, u64> {
        self.refused
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writers_accept_one_per_topic_while_the_switch_is_on() {
        let [ours, other] = [WriterGuid([1; 16]), WriterGuid([2; 16])];
        let [steering, speed] = [EndpointId(3), EndpointId(4)];
        let mut writers = Writers::default();
        assert!(writers.hear(steering, other) && writers.hear(steering, ours), "the newest one");
        writers.pin(true);
        assert!(writers.hear(steering, ours) && !writers.hear(steering, other));
        assert!(writers.hear(speed, other) && !writers.hear(speed, ours), "the first one");
        assert!(writers.hear(steering, ours), "a stranger changes nothing");
        // Releasing the switch admits another writer: a restarted stack has a different GUID.
        writers.pin(false);
        assert!(writers.hear(steering, other));
        writers.pin(true);
        assert!(writers.hear(steering, other) && !writers.hear(steering, ours));
        assert_eq!(writers.into_refused(), [(steering, 2), (speed, 1)].into());
    }
}
