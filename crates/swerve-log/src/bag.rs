//! Reader for third-party recordings: rosbag2 logs in MCAP format.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::LogError;
use crate::format::RECORD_MAX;
use crate::mcap_record::{self, Schema, op, op_name};
use crate::reader::{describe, open_sized, read_some};

/// A topic of a recording.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct BagTopic {
    /// Name of the topic.
    pub name: String,
    /// Message type, such as `sensor_msgs/msg/Image`; empty if the recording does not contain it.
    pub type_name: String,
    /// Message encoding: `cdr` for ROS 2.
    pub encoding: String,
    /// Schema encoding: `ros2msg`, `protobuf`; empty if the recording does not contain it.
    pub schema_encoding: String,
    /// Schema data.
    pub schema: Vec<u8>,
}

/// A recorded message.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BagMessage {
    /// Index of the topic in [`Bag::topics`].
    pub topic: usize,
    /// Instant of reception by the recorder, on its host's clock, nanoseconds since the Unix epoch.
    pub received_ns: u64,
    /// Serialized message.
    pub data: Vec<u8>,
}

/// Reads a recording from its start, in file order. Memory is bounded by the longest record.
pub struct Bag {
    path: PathBuf,
    file: BufReader<File>,
    /// Bytes of the file not read yet.
    left: u64,
    mcap: LinearReader,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, usize>,
    topics: Vec<BagTopic>,
    messages: u64,
    strays: u64,
    over: bool,
}

impl Bag {
    /// Opens a recording.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let (file, left) = open_sized(path)?;
        let options = LinearReaderOptions::default()
            .with_record_length_limit(RECORD_MAX)
            .with_prevalidate_chunk_crcs(true);
        Ok(Self {
            path: path.into(),
            file: BufReader::with_capacity(256 << 10, file),
            left,
            mcap: LinearReader::new_with_options(options),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            topics: Vec::new(),
            messages: 0,
            strays: 0,
            over: false,
        })
    }

    /// Topics found so far.
    pub fn topics(&self) -> &[BagTopic] {
        &self.topics
    }

    /// Number of messages on channels that the recording does not describe; they are skipped.
    pub fn strays(&self) -> u64 {
        self.strays
    }

    /// Reads the next message; `None` after the last.
    ///
    /// # Errors
    /// If the file is damaged or truncated. All messages before the damage have been returned, and none follow.
    pub fn next_message(&mut self) -> Result<Option<BagMessage>, LogError> {
        while !self.over {
            let problem = match self.mcap.next_event() {
                None => {
                    self.over = true;
                    break;
                }
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    // Never allocate more than the file holds.
                    let n = wanted.min(usize::try_from(self.left).unwrap_or(usize::MAX));
                    let read = read_some(&mut self.file, self.mcap.insert(n));
                    let read = read.map_err(|source| LogError::Read { path: self.path.clone(), source })?;
                    self.mcap.notify_read(read);
                    self.left = self.left.saturating_sub(read as u64);
                    continue;
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    let taken = Record::parse(opcode, data);
                    match taken.ok_or_else(|| format!("expected {} within its length", op_name(opcode))) {
                        Ok(record) => match self.take(record) {
                            Some(message) => return Ok(Some(message)),
                            None => continue,
                        },
                        Err(problem) => problem,
                    }
                }
                Some(Err(error)) => describe(&error),
            };
            self.over = true;
            return Err(LogError::CutOff { path: self.path.clone(), problem, messages: self.messages });
        }
        Ok(None)
    }

    fn take(&mut self, record: Record) -> Option<BagMessage> {
        match record {
            Record::Other => None,
            Record::Schema(id, schema) => {
                self.schemas.insert(id, schema);
                None
            }
            Record::Channel(channel) => {
                // The summary section repeats channels.
                if !self.channels.contains_key(&channel.id) {
                    self.channels.insert(channel.id, self.topics.len());
                    let Schema { name: type_name, encoding: schema_encoding, data: schema, .. } =
                        self.schemas.get(&channel.schema).cloned().unwrap_or_default();
                    let (name, encoding) = (channel.topic, channel.encoding);
                    self.topics.push(BagTopic { name, type_name, encoding, schema_encoding, schema });
                }
                None
            }
            Record::Message { channel, received_ns, data } => {
                let Some(topic) = self.channels.get(&channel) else {
                    self.strays += 1;
                    return None;
                };
                self.messages += 1;
                Some(BagMessage { topic: *topic, received_ns, data })
            }
        }
    }
}

/// A record of the file.
enum Record {
    Schema(u16, Schema),
    Channel(mcap_record::Channel),
    Message { channel: u16, received_ns: u64, data: Vec<u8> },
    Other,
}

impl Record {
    /// Parses a record; `None` if the body is malformed for its opcode.
    fn parse(opcode: u8, body: &[u8]) -> Option<Self> {
        Some(match opcode {
            op::SCHEMA => {
                let (id, schema) = mcap_record::schema(body)?;
                Self::Schema(id, schema)
            }
            op::CHANNEL => Self::Channel(mcap_record::channel(body)?),
            op::MESSAGE => {
                let (MessageHeader { channel_id: channel, log_time: received_ns, .. }, data) =
                    mcap_record::message(body)?;
                Self::Message { channel, received_ns, data: data.to_vec() }
            }
            _ => Self::Other,
        })
    }
}

#[cfg(test)]
mod tests {
    use mcap::records::MessageHeader;
    use mcap::{Compression, WriteOptions, Writer};
    use proptest::prelude::*;

    use super::*;

    /// A recording as written by rosbag2: 40 messages, alternating between two topics.
    fn recorded(compression: Option<Compression>, chunks: bool) -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let options = WriteOptions::new()
            .profile("ros2")
            .compression(compression)
            .use_chunks(chunks)
            .chunk_size(Some(300));
        let mut writer = Writer::with_options(&mut bytes, options).unwrap();
        let channels = ["/a", "/b"].map(|topic| {
            let schema = writer.add_schema("std_msgs/msg/Bool", "ros2msg", b"bool data").unwrap();
            writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
        });
        for i in 0..40_u32 {
            let header = MessageHeader {
                channel_id: channels[i as usize % 2],
                sequence: i,
                log_time: 1_000 + u64::from(i),
                publish_time: 900,
            };
            writer.write_to_known_channel(&header, &[0, 1, 0, 0, i as u8, 0, 0, 0]).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        bytes.into_inner()
    }

    fn read(bytes: &[u8]) -> (Vec<BagMessage>, Bag, Result<(), LogError>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        std::fs::write(&path, bytes).unwrap();
        let mut bag = Bag::open(&path).unwrap();
        let mut messages = Vec::new();
        let end = loop {
            match bag.next_message() {
                Ok(Some(message)) => messages.push(message),
                Ok(None) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        assert!(matches!(bag.next_message(), Ok(None)), "nothing follows the end");
        (messages, bag, end)
    }

    #[test]
    fn bag_reads_every_common_compression_and_layout() {
        for (compression, chunks) in
            [(None, false), (None, true), (Some(Compression::Zstd), true), (Some(Compression::Lz4), true)]
        {
            let (messages, bag, end) = read(&recorded(compression, chunks));
            end.unwrap();
            assert_eq!((messages.len(), bag.strays()), (40, 0), "{compression:?}");
            let topic = BagTopic {
                name: "/b".into(),
                type_name: "std_msgs/msg/Bool".into(),
                encoding: "cdr".into(),
                schema_encoding: "ros2msg".into(),
                schema: b"bool data".to_vec(),
            };
            assert_eq!(bag.topics()[1], topic);
            let told: Vec<_> = messages.iter().map(|m| (m.topic, m.received_ns, m.data[4])).collect();
            assert_eq!(told, (0..40).map(|i| (i % 2, 1_000 + i as u64, i as u8)).collect::<Vec<_>>());
        }
    }

    #[test]
    fn bag_reads_messages_before_a_truncation() {
        let whole = recorded(Some(Compression::Zstd), true);
        let (messages, _, end) = read(&whole[..whole.len() / 2]);
        assert!((1..40).contains(&messages.len()), "{}", messages.len());
        let told = end.unwrap_err().to_string();
        assert!(told.contains("drive.mcap: ends or is damaged after"), "{told}");
        let (none, _, end) = read(b"no recording at all");
        assert!(none.is_empty() && end.is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: proptest::test_runner::RngSeed::Fixed(11), cases: 300, ..ProptestConfig::default()
        })]

        /// Truncated and changed anywhere: an end or an error, never a panic, never more messages than written.
        #[test]
        fn bag_ends_cleanly_on_any_damage(
            form in 0..4_usize,
            flips in prop::collection::vec((any::<prop::sample::Index>(), 1..=255_u8), 0..6),
            cut in prop::option::of(any::<prop::sample::Index>()),
        ) {
            let forms =
                [(None, false), (None, true), (Some(Compression::Zstd), true), (Some(Compression::Lz4), true)];
            let mut bytes = recorded(forms[form].0, forms[form].1);
            for (at, mask) in flips {
                let at = at.index(bytes.len());
                bytes[at] ^= mask;
            }
            if let Some(cut) = cut {
                bytes.truncate(cut.index(bytes.len()));
            }
            let (messages, bag, _) = read(&bytes);
            prop_assert!(messages.len() as u64 + bag.strays() <= 40);
        }
    }
}
