//! Seals of a log: digests of all that the file holds beside its views, so that a change of any byte is named by
//! the channel that it is in. The digest of a run, which is equal for equal behaviour however it was recorded, does
//! not bind the head, headers, times and records of steps; these do. They tell changes; they are no signature.

use std::collections::BTreeMap;

use mcap::records::MessageHeader;
use swerve_core::Hasher;

use crate::mcap_record::{Channel, Schema};

/// Name of the program that wrote the file, in MCAP's header.
pub(crate) const LIBRARY: &str = "swerve";

/// Digests over the head and each channel of what was written or read so far.
#[derive(Default)]
pub(crate) struct Seals {
    head: Hasher,
    /// Topic and digest by the channel's number.
    channels: BTreeMap<u16, (String, Hasher)>,
    messages: u64,
}

impl Seals {
    /// Takes in MCAP's header.
    pub(crate) fn file(&mut self, profile: &str, library: &str) {
        self.head.value(&(profile, library));
    }

    /// Takes in the metadata of the run's start.
    pub(crate) fn head(&mut self, start: &BTreeMap<String, String>) {
        self.head.value(start);
    }

    /// Takes in a channel that is no view.
    pub(crate) fn channel(&mut self, channel: &Channel, schema: &Schema) {
        let Channel { id, schema: schema_id, topic, encoding, metadata } = channel;
        let mut hasher = Hasher::new();
        hasher.value(&(id, schema_id, topic, encoding, metadata));
        hasher.value(&(&schema.name, &schema.encoding, &schema.text));
        self.channels.insert(*id, (topic.clone(), hasher));
    }

    /// Takes in a message, with its place among all; one of a view is passed over.
    pub(crate) fn message(&mut self, header: &MessageHeader, data: &[u8]) {
        let Some((_, hasher)) = self.channels.get_mut(&header.channel_id) else { return };
        for n in [self.messages, header.sequence.into(), header.log_time, header.publish_time] {
            hasher.number(n);
        }
        hasher.bytes(data);
        self.messages += 1;
    }

    /// One line for each part, name and digest, the run's end last.
    pub(crate) fn lines(&self, end: &BTreeMap<String, String>) -> String {
        let mut of_end = Hasher::new();
        of_end.value(end);
        let channels = self.channels.values().map(|(topic, hasher)| (topic.as_str(), hasher));
        let parts = [("the run's head", &self.head)].into_iter().chain(channels);
        let lines = parts.chain([("the run's end", &of_end)]);
        lines.map(|(name, hasher)| format!("{} {name}\n", hasher.digest())).collect()
    }
}

/// The name of the first part whose seal is another in `found` than in `sealed`.
pub(crate) fn first_difference(sealed: &str, found: &str) -> Option<String> {
    let name = |line: &str| line.split_once(' ').map_or(line, |(_, name)| name).to_owned();
    let mut lines = found.lines().zip(sealed.lines().map(Some).chain(core::iter::repeat(None)));
    let differing = lines.find(|(found, sealed)| Some(*found) != *sealed).map(|(found, _)| name(found));
    differing.or_else(|| (sealed != found).then(|| "the list of seals".into()))
}
