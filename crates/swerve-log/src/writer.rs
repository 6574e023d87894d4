//! Writer thread: records into an MCAP file.

use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader as McapHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions};
use serde::Serialize;
use swerve_core::{Span, Time};
use swerve_flow::cbor;

use crate::LogError;
use crate::batch::{Batch, Item, left_out};
use crate::format::{self, Kind, unsigned};
use crate::mcap_record::{Channel, Schema};
use crate::record::{RunEnd, RunStart, StreamInfo};
use crate::seals::{self, Seals};
use crate::view::View;

const PROFILE: &str = "swerve";
const CHUNK_BYTES: u64 = 1 << 20;
/// Maximum run time lost when the process is killed.
const FLUSH_EVERY: Span = Span::from_ms(1000);

/// Writes records into an MCAP file.
pub(crate) struct LogWriter<W: Write + Seek> {
    path: PathBuf,
    /// `None` once closed.
    mcap: Option<mcap::Writer<W>>,
    singles: [u16; Kind::SINGLE.len()],
    streams: Vec<u16>,
    /// Channel and number of messages of each view topic.
    views: BTreeMap<String, (u16, u32)>,
    scratch: Vec<u8>,
    records: u64,
    seals: Seals,
    flushed_at: Time,
    ended: bool,
}

impl<W: Write + Seek> LogWriter<W> {
    pub(crate) fn new(path: &Path, to: W, start: &RunStart) -> Result<Self, LogError> {
        let options = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true) // a chunk is written at once, so that a kill leaves none half written
            .library(seals::LIBRARY)
            .profile(PROFILE);
        let failed = |error| write_error(path, &error);
        let mut mcap = options.create(to).map_err(failed)?;
        let metadata = Metadata { name: format::RUN_START.into(), metadata: format::start_to_map(start) };
        mcap.write_metadata(&metadata).map_err(failed)?;
        let mut seals = Seals::default();
        seals.file(PROFILE, seals::LIBRARY);
        seals.head(&metadata.metadata);
        let mut singles = [0; Kind::SINGLE.len()];
        for (id, kind) in singles.iter_mut().zip(Kind::SINGLE) {
            let (name, topic) = (format!("swerve.{}", kind.name()), format!("/swerve/{}", kind.name()));
            let metadata = BTreeMap::from([(format::KIND.into(), kind.name().into())]);
            let added = add_channel(&mut mcap, &mut seals, topic, metadata, (name, kind.schema().into()));
            *id = added.map_err(failed)?;
        }
        mcap.flush().map_err(failed)?;
        Ok(Self {
            path: path.into(),
            mcap: Some(mcap),
            singles,
            streams: Vec::new(),
            views: BTreeMap::new(),
            scratch: Vec::new(),
            records: 0,
            seals,
            flushed_at: Time::ZERO,
            ended: false,
        })
    }

    /// Writes one batch. After an error the file is left as it is: readable, but without an end record.
    pub(crate) fn write(&mut self, batch: Batch) -> Result<(), LogError> {
        let Batch { items, bytes, .. } = batch;
        items.into_iter().try_for_each(|item| self.item(item, &bytes)).map_err(|error| {
            self.abandon();
            self.cut_off(&error)
        })
    }

    /// Error that describes the state of the file after a failed write.
    fn cut_off(&self, error: &McapError) -> LogError {
        let (path, flushed) = (self.path.clone(), self.flushed_at.as_secs());
        let reason = format!(
            "{}; what it holds stays readable, up to {flushed:.1} s of run time at least; the rest is lost",
            reason(error)
        );
        LogError::Write { path, reason }
    }

    /// Completes the file if the run has ended, else leaves it incomplete; returns the number of records.
    pub(crate) fn close(mut self) -> Result<u64, LogError> {
        let Some(mcap) = &mut self.mcap else { return Ok(self.records) };
        let written = if self.ended { mcap.finish().map(|_| ()) } else { mcap.flush() };
        let written = written.and_then(|()| {
            let Some(mcap) = self.mcap.take() else { return Ok(()) };
            Ok(mcap.into_inner().flush()?)
        });
        written.map(|()| self.records).map_err(|error| self.cut_off(&error))
    }

    fn item(&mut self, item: Item, bytes: &[u8]) -> Result<(), McapError> {
        self.records += u64::from(!matches!(item, Item::Stream(_) | Item::View(_) | Item::End(_)));
        match item {
            Item::Stream(info) => self.stream(&info),
            Item::Message { stream, header, payload } => {
                self.scratch.clear();
                format::write_message(&header, &bytes[payload], &mut self.scratch);
                let channel = self.streams[stream];
                self.put(channel, header.seq, header.visible_at, header.stamp)
            }
            Item::Promised { stream, header, payload, leaves_out } => {
                let mut cbor = Vec::new();
                match leaves_out {
                    true => left_out(&payload, &mut cbor),
                    false => payload.to_cbor(&mut cbor),
                }
                self.scratch.clear();
                format::write_message(&header, &cbor, &mut self.scratch);
                self.put(self.streams[stream], header.seq, header.visible_at, header.stamp)
            }
            Item::Watermark(r) => self.single(Kind::Watermarks, &r, r.visible_at, r.watermark),
            Item::Step(r) => self.single(Kind::Steps, &r, r.end, r.stamp),
            Item::Unfinished(r) => self.single(Kind::Unfinished, &r, r.start, r.stamp),
            Item::Miss(r) => self.single(Kind::Misses, &r, r.at, r.stamp),
            Item::Drop(r) => self.single(Kind::Drops, &r, r.at, r.stamp),
            Item::Decision { at, cbor } => {
                self.scratch.clear();
                self.scratch.extend_from_slice(&bytes[cbor]);
                self.put(self.channel(Kind::Decisions), 0, at, at)
            }
            Item::View(view) => self.view(view),
            Item::End(end) => self.end(&end),
        }
    }

    fn stream(&mut self, info: &StreamInfo) -> Result<(), McapError> {
        let Some(mcap) = &mut self.mcap else { return Ok(()) };
        let form = [Kind::Stream.schema(), &info.form].concat();
        let metadata = BTreeMap::from([
            (format::KIND.into(), Kind::Stream.name().into()),
            ("stream".into(), info.stream.clone()),
            ("operator".into(), info.operator.clone()),
            ("port".into(), info.port.to_string()),
        ]);
        let topic = format!("/{}", info.stream);
        let schema = (info.type_name.clone(), form);
        self.streams.push(add_channel(mcap, &mut self.seals, topic, metadata, schema)?);
        Ok(())
    }

    fn view(&mut self, view: View) -> Result<(), McapError> {
        let View { topic, visible_at, stamp, encode, .. } = view;
        self.scratch.clear();
        encode(&mut self.scratch);
        let Some(mcap) = self.mcap.as_mut().filter(|_| !self.scratch.is_empty()) else { return Ok(()) };
        let (channel, count) = match self.views.get_mut(&topic.name) {
            Some(known) => known,
            None => {
                let form = &topic.schema;
                let schema = mcap.add_schema(&form.name, form.encoding, &form.data)?;
                let mut metadata = topic.metadata.clone();
                metadata.insert(format::KIND.into(), Kind::View.name().into());
                let channel = mcap.add_channel(schema, &topic.name, form.message_encoding, &metadata)?;
                if let Some((name, metadata)) = topic.file_metadata.clone() {
                    mcap.write_metadata(&Metadata { name, metadata })?;
                }
                self.views.entry(topic.name.clone()).or_insert((channel, 0))
            }
        };
        let (channel, seq) = (*channel, *count);
        *count = count.wrapping_add(1);
        self.put(channel, seq.into(), visible_at, stamp)
    }

    fn channel(&self, kind: Kind) -> u16 {
        let place = Kind::SINGLE.iter().position(|k| *k == kind);
        self.singles[place.expect("streams have channels of their own")]
    }

    fn single(
        &mut self,
        kind: Kind,
        record: &impl Serialize,
        at: Time,
        stamp: Time,
    ) -> Result<(), McapError> {
        self.scratch.clear();
        cbor::write(record, &mut self.scratch);
        self.put(self.channel(kind), 0, at, stamp)
    }

    /// Writes the scratch buffer as a message.
    fn put(&mut self, channel_id: u16, seq: u64, at: Time, stamp: Time) -> Result<(), McapError> {
        let Some(mcap) = &mut self.mcap else { return Ok(()) };
        let header = McapHeader {
            channel_id,
            sequence: seq as u32, // MCAP's sequence number wraps; the one in the message header does not
            log_time: unsigned(at),
            publish_time: unsigned(stamp),
        };
        self.seals.message(&header, &self.scratch);
        mcap.write_to_known_channel(&header, &self.scratch)?;
        if at - self.flushed_at >= FLUSH_EVERY {
            self.flushed_at = at;
            mcap.flush()?;
        }
        Ok(())
    }

    fn end(&mut self, end: &RunEnd) -> Result<(), McapError> {
        let Some(mcap) = &mut self.mcap else { return Ok(()) };
        let mut metadata = format::end_to_map(end, self.records);
        metadata.insert(format::SEALS.into(), self.seals.lines(&metadata));
        mcap.write_metadata(&Metadata { name: format::RUN_END.into(), metadata })?;
        self.ended = true;
        Ok(())
    }

    /// Closes the file without the footer that MCAP's drop handler would write.
    fn abandon(&mut self) {
        if let Some(mcap) = self.mcap.take() {
            drop(mcap.into_inner());
        }
    }
}

impl<W: Write + Seek> Drop for LogWriter<W> {
    fn drop(&mut self) {
        self.abandon();
    }
}

/// Adds a channel and its schema (name and text) to the file and to the seals; returns the number of the channel.
fn add_channel<W: Write + Seek>(
    mcap: &mut mcap::Writer<W>,
    seals: &mut Seals,
    topic: String,
    metadata: BTreeMap<String, String>,
    (name, text): (String, String),
) -> Result<u16, McapError> {
    let schema = mcap.add_schema(&name, format::SCHEMA_ENCODING, text.as_bytes())?;
    let id = mcap.add_channel(schema, &topic, format::ENCODING, &metadata)?;
    let channel = Channel { id, schema, topic, encoding: format::ENCODING.into(), metadata };
    seals.channel(
        &channel,
        &Schema { name, encoding: format::SCHEMA_ENCODING.into(), text, ..Schema::default() },
    );
    Ok(id)
}

fn write_error(path: &Path, error: &McapError) -> LogError {
    LogError::Write { path: path.into(), reason: reason(error) }
}

fn reason(error: &McapError) -> String {
    match error {
        // MCAP uses one text for all system errors; the system's own is more specific.
        McapError::Io(source) => source.to_string(),
        other => other.to_string(),
    }
}
