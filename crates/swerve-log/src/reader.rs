//! Record-by-record reader for logs.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::McapError;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use serde::de::DeserializeOwned;

use crate::LogError;
use crate::format::{self, Kind};
use crate::mcap_record::{self, Schema, op, op_name};
use crate::record::{DecisionRecord, PublicationRecord, Record, RunEnd, RunStart, StreamInfo};
use crate::seals::{Seals, first_difference};

/// Reads a log from its start. Any damage ends it with an error that states the position; all records before the
/// damage have been returned.
pub struct Reader<R = File> {
    path: PathBuf,
    file: BufReader<R>,
    size: u64,
    mcap: LinearReader,
    /// Bytes of the file passed to `mcap` so far.
    taken: u64,
    context: Context,
    over: bool,
}

/// State of the reader.
#[derive(Default)]
struct Context {
    start: Option<RunStart>,
    end: Option<RunEnd>,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Channel>,
    streams: Vec<Arc<StreamInfo>>,
    records: u64,
    seals: Seals,
    is_sealed: bool,
}

#[derive(Clone)]
enum Channel {
    Stream(Arc<StreamInfo>),
    Single(Kind),
    View,
}

/// Fault in a file.
enum Fault {
    Mcap(McapError),
    Content(String),
    Foreign(String),
}

/// Opens a file; returns it with its length.
pub(crate) fn open_sized(path: &Path) -> Result<(File, u64), LogError> {
    let failed = |source| LogError::Read { path: path.into(), source };
    let mut file = swerve_text::open_file(path).map_err(failed)?;
    let size = file.seek(SeekFrom::End(0)).and_then(|size| file.rewind().map(|()| size)).map_err(failed)?;
    Ok((file, size))
}

/// As [`Read::read`], but retries on interruption by a signal.
pub(crate) fn read_some(file: &mut impl Read, into: &mut [u8]) -> std::io::Result<usize> {
    loop {
        match file.read(into) {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

impl Reader {
    /// Opens a log and reads the start of the run.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let (file, size) = open_sized(path)?;
        Self::of(path, file, size)
    }
}

impl<R: Read + Seek> Reader<R> {
    /// Reads from any source of `size` bytes; `path` is its name in errors.
    pub(crate) fn of(path: &Path, file: R, size: u64) -> Result<Self, LogError> {
        let options = LinearReaderOptions::default()
            .with_record_length_limit(format::RECORD_MAX)
            .with_prevalidate_chunk_crcs(true)
            .with_validate_data_section_crc(true)
            .with_validate_summary_section_crc(true)
            .with_check_finishes_after_end_magic(true);
        let mut reader = Self {
            path: path.into(),
            file: BufReader::with_capacity(256 << 10, file),
            size,
            mcap: LinearReader::new_with_options(options),
            taken: 0,
            context: Context::default(),
            over: false,
        };
        while reader.context.start.is_none() {
            if reader.advance()?.is_some() || reader.over {
                let problem = "expected the run's metadata before the first message".into();
                return Err(LogError::Foreign { path: path.into(), problem });
            }
        }
        Ok(reader)
    }

    /// Reads the next record; `None` after the last one of a complete log.
    pub fn next_record(&mut self) -> Result<Option<Record>, LogError> {
        while !self.over {
            if let Some(record) = self.advance()? {
                return Ok(Some(record));
            }
        }
        Ok(None)
    }

    /// Head: everything known at the start of the run.
    pub fn run_start(&self) -> &RunStart {
        self.context.start.as_ref().expect("`open` gives no reader without it")
    }

    /// End: everything known at the end of the run; `None` until all records have been read.
    pub fn run_end(&self) -> Option<&RunEnd> {
        self.context.end.as_ref()
    }

    /// Returns true if the end has been read and contains seals: digests of everything else in the file.
    pub fn is_sealed(&self) -> bool {
        self.context.is_sealed
    }

    /// Streams found so far.
    pub fn streams(&self) -> &[Arc<StreamInfo>] {
        &self.context.streams
    }

    /// Processes one MCAP record or reads more of the file.
    fn advance(&mut self) -> Result<Option<Record>, LogError> {
        let fault = match self.mcap.next_event() {
            None => {
                self.over = true;
                return if self.context.end.is_some() { Ok(None) } else { Err(self.incomplete()) };
            }
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                // At most one MCAP record is requested, and records above the limit are rejected before; never
                // allocate more than the file holds.
                let held = usize::try_from(self.size.saturating_sub(self.taken)).unwrap_or(usize::MAX);
                let n = wanted.min(held);
                let read = read_some(&mut self.file, self.mcap.insert(n));
                let read = read.map_err(|source| LogError::Read { path: self.path.clone(), source })?;
                self.mcap.notify_read(read);
                self.taken += read as u64;
                return Ok(None);
            }
            Some(Ok(LinearReadEvent::Record { data, opcode })) => match self.context.take(opcode, data) {
                Ok(record) => return Ok(record),
                Err(fault) => fault,
            },
            Some(Err(error)) => Fault::Mcap(error),
        };
        self.over = true;
        Err(self.error(fault))
    }

    fn incomplete(&self) -> LogError {
        LogError::Incomplete { path: self.path.clone(), size: self.size, records: self.context.records }
    }

    fn error(&mut self, fault: Fault) -> LogError {
        let path = self.path.clone();
        let last = self.last_record();
        let cut_between = last.is_none_or(|(_, _, end)| end == self.size) && self.taken == self.size;
        let (problem, at_end) = match fault {
            Fault::Foreign(problem) => return LogError::Foreign { path, problem },
            Fault::Content(problem) => (problem, false),
            Fault::Mcap(McapError::UnexpectedEof) if cut_between && self.taken > MAGIC_LEN => {
                if self.context.end.is_none() {
                    return self.incomplete();
                }
                ("expected another record, found the end of the file".into(), true)
            }
            Fault::Mcap(error) => (describe(&error), false),
        };
        let (offset, record) = match last {
            _ if at_end => (self.size, "the summary after the last record".into()),
            Some((offset, opcode, _)) => (offset, op_name(opcode).to_owned()),
            None => (0, "the magic number at its start".into()),
        };
        LogError::Damaged { path, offset, size: self.size, record, problem, records: self.context.records }
    }

    /// Start, opcode and end of the record that contains the last byte read, found by walking the records; `None`
    /// if that byte is before the first record.
    fn last_record(&mut self) -> Option<(u64, u8, u64)> {
        let (mut last, mut offset) = (None, MAGIC_LEN);
        while offset < self.taken {
            let mut head = [0; HEAD_LEN];
            self.file.seek(SeekFrom::Start(offset)).ok()?;
            let whole = self.file.read_exact(&mut head).is_ok();
            let [opcode, length @ ..] = head;
            let end = offset.saturating_add(HEAD_LEN as u64).saturating_add(u64::from_le_bytes(length));
            last = Some((offset, opcode, if whole { end } else { u64::MAX }));
            offset = if whole { end } else { u64::MAX };
        }
        last
    }
}

/// Length of the magic number at both ends of an MCAP file, bytes.
const MAGIC_LEN: u64 = 8;
/// Length of a record's opcode and length field, bytes.
const HEAD_LEN: usize = 9;

/// Describes an MCAP error as an unmet expectation.
pub(crate) fn describe(error: &McapError) -> String {
    match error {
        McapError::UnexpectedEof => "expected more bytes, found the end of the file".into(),
        McapError::UnsupportedCompression(name) if name == "zstd" => {
            "this program was built without zstd: build it with `--features ros2` (all: `--features full`)"
                .into()
        }
        McapError::BadMagic => "expected the magic number of an MCAP file".into(),
        McapError::BytesAfterEndMagic => "expected the end of the file, found more bytes".into(),
        McapError::BadChunkCrc { saved, calculated } => {
            format!("expected contents with checksum {saved:08x}, found {calculated:08x}")
        }
        McapError::BadDataCrc { saved, calculated } => {
            format!("expected all before it to have checksum {saved:08x}, found {calculated:08x}")
        }
        McapError::BadSummaryCrc { saved, calculated } => {
            format!("expected a summary with checksum {saved:08x}, found {calculated:08x}")
        }
        McapError::RecordTooLarge { len, .. } | McapError::ChunkTooLarge(len) => {
            format!("expected a record of at most {} bytes, found a length of {len}", format::RECORD_MAX)
        }
        other => format!("expected a sound MCAP record: {other}"),
    }
}

impl Context {
    /// Processes one record; returns it if it is of interest to the caller.
    fn take(&mut self, opcode: u8, body: &[u8]) -> Result<Option<Record>, Fault> {
        let broken = || Fault::Content(format!("expected {} within its length", op_name(opcode)));
        match opcode {
            op::HEADER => {
                let (profile, library) = mcap_record::header(body).ok_or_else(broken)?;
                self.seals.file(&profile, &library);
                Ok(None)
            }
            op::SCHEMA => {
                let (id, schema) = mcap_record::schema(body).ok_or_else(broken)?;
                self.schemas.insert(id, schema);
                Ok(None)
            }
            op::CHANNEL => self.channel(mcap_record::channel(body).ok_or_else(broken)?).map(|()| None),
            op::METADATA => {
                let (name, map) = mcap_record::metadata(body).ok_or_else(broken)?;
                self.metadata(&name, map).map(|()| None)
            }
            op::MESSAGE => {
                let (header, data) = mcap_record::message(body).ok_or_else(broken)?;
                self.seals.message(&header, data);
                let record = self.message(header.channel_id, data).map_err(Fault::Content)?;
                self.records += u64::from(record.is_some());
                Ok(record)
            }
            _ => Ok(None), // indices and statistics, which are not used
        }
    }

    fn metadata(&mut self, name: &str, mut map: BTreeMap<String, String>) -> Result<(), Fault> {
        match name {
            format::RUN_START => {
                self.seals.head(&map);
                self.start = Some(format::start_from_map(map).map_err(Fault::Foreign)?);
            }
            format::RUN_END => {
                let sealed = map.remove(format::SEALS);
                self.is_sealed = sealed.is_some();
                if let Some(part) =
                    sealed.and_then(|sealed| first_difference(&sealed, &self.seals.lines(&map)))
                {
                    return Err(Fault::Content(format!("{part} was changed after it was written")));
                }
                let (end, records) = format::end_from_map(map).map_err(Fault::Content)?;
                if records != self.records {
                    return Err(Fault::Content(format!("expected {records} records before the run's end")));
                }
                self.end = Some(end);
            }
            _ => {}
        }
        Ok(())
    }

    fn channel(&mut self, channel: mcap_record::Channel) -> Result<(), Fault> {
        if self.channels.contains_key(&channel.id) {
            return Ok(()); // the summary section repeats channels
        }
        let foreign = |key: &str| Fault::Foreign(format!("expected channels with an entry `{key}`"));
        let kind = channel.metadata.get(format::KIND).and_then(|kind| Kind::from_name(kind));
        let kind = kind.ok_or_else(|| foreign(format::KIND))?;
        let schema = self.schemas.get(&channel.schema).cloned().unwrap_or_default();
        if kind != Kind::View {
            self.seals.channel(&channel, &schema);
        }
        let mut metadata = channel.metadata;
        let of = match kind {
            Kind::View => Channel::View,
            _ if channel.encoding != format::ENCODING => {
                return Err(Fault::Foreign(format!("expected messages in {}", format::ENCODING)));
            }
            Kind::Stream => {
                let mut take = |key| metadata.remove(key).ok_or_else(|| foreign(key));
                let info = Arc::new(StreamInfo {
                    stream: take("stream")?,
                    operator: take("operator")?,
                    port: take("port")?.parse().map_err(|_| foreign("port"))?,
                    type_name: schema.name,
                    form: schema.text.strip_prefix(Kind::Stream.schema()).unwrap_or_default().to_owned(),
                });
                self.streams.push(info.clone());
                Channel::Stream(info)
            }
            single => Channel::Single(single),
        };
        self.channels.insert(channel.id, of);
        Ok(())
    }

    /// Record of a message; `None` for a message of a view.
    fn message(&self, id: u16, data: &[u8]) -> Result<Option<Record>, String> {
        let record = match self
            .channels
            .get(&id)
            .ok_or_else(|| format!("expected a known channel, found number {id}"))?
        {
            Channel::Stream(info) => {
                let (header, payload) = format::read_message(data)?;
                let payload_cbor = payload.into();
                Record::Publication(PublicationRecord { stream: info.clone(), header, payload_cbor })
            }
            Channel::Single(Kind::Watermarks) => Record::Watermark(parse(data)?),
            Channel::Single(Kind::Steps) => Record::Step(parse(data)?),
            Channel::Single(Kind::Unfinished) => Record::Unfinished(parse(data)?),
            Channel::Single(Kind::Misses) => Record::Miss(parse(data)?),
            Channel::Single(Kind::Drops) => Record::Drop(parse(data)?),
            Channel::Single(Kind::Decisions | Kind::Stream | Kind::View) => {
                Record::Decision(DecisionRecord { cbor: data.into() })
            }
            Channel::View => return Ok(None),
        };
        Ok(Some(record))
    }
}

fn parse<T: DeserializeOwned>(data: &[u8]) -> Result<T, String> {
    swerve_flow::cbor::read(data)
        .map_err(|error| format!("expected {}: {error}", core::any::type_name::<T>()))
}
