//! Seals of a log: digests of everything in the file except its views, so that a change of any byte is attributed
//! to its channel. The digest of a run, which is equal for equal behaviour regardless of how it was recorded, does
//! not cover the head, headers, times and step records; seals do. Seals detect changes but are not a signature.

use std::collections::BTreeMap;

use mcap::records::MessageHeader;
use swerve_core::Hasher;

use crate::mcap_record::{Channel, Schema};

/// Name of the writing program in the MCAP header.
pub(crate) const LIBRARY: &str = "swerve";

/// Digests of the head and of each channel, over the data written or read so far.
#[derive(Default)]
pub(crate) struct Seals {
    head: Hasher,
    /// Topic and digest by channel number.
    channels: BTreeMap<u16, (String, Hasher)>,
    messages: u64,
}

impl Seals {
    /// Adds the MCAP header.
    pub(crate) fn file(&mut self, profile: &str, library: &str) {
        self.head.value(&(profile, library));
    }

    /// Adds the metadata of the run's start.
    pub(crate) fn head(&mut self, start: &BTreeMap<String, String>) {
        self.head.value(start);
    }

    /// Adds a channel that is not a view.
    pub(crate) fn channel(&mut self, channel: &Channel, schema: &Schema) {
        let Channel { id, schema: schema_id, topic, encoding, metadata } = channel;
        let mut hasher = Hasher::new();
        hasher.value(&(id, schema_id, topic, encoding, metadata));
        hasher.value(&(&schema.name, &schema.encoding, &schema.text));
        self.channels.insert(*id, (topic.clone(), hasher));
    }

    /// Adds a message and its position among all messages; skips messages of views.
    pub(crate) fn message(&mut self, header: &MessageHeader, data: &[u8]) {
        let Some((_, hasher)) = self.channels.get_mut(&header.channel_id) else { return };
        for n in [self.messages, header.sequence.into(), header.log_time, header.publish_time] {
            hasher.number(n);
        }
        hasher.bytes(data);
        self.messages += 1;
    }

    /// Formats the seals: one line per part with digest and name, the run's end last.
    pub(crate) fn lines(&self, end: &BTreeMap<String, String>) -> String {
        let mut of_end = Hasher::new();
        of_end.value(end);
        let channels = self.channels.values().map(|(topic, hasher)| (topic.as_str(), hasher));
        let parts = [("the run's head", &self.head)].into_iter().chain(channels);
        let lines = parts.chain([("the run's end", &of_end)]);
        lines.map(|(name, hasher)| format!("{} {name}\n", hasher.digest())).collect()
    }
}

/// Name of the first part whose seal in `found` differs from that in `sealed`.
pub(crate) fn first_difference(sealed: &str, found: &str) -> Option<String> {
    let name = |line: &str| line.split_once(' ').map_or(line, |(_, name)| name).to_owned();
    let mut lines = found.lines().zip(sealed.lines().map(Some).chain(core::iter::repeat(None)));
    let differing = lines.find(|(found, sealed)| Some(*found) != *sealed).map(|(found, _)| name(found));
    differing.or_else(|| (sealed != found).then(|| "the list of seals".into()))
}
