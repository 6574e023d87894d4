//! Recorder that writes a log during the run.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use crossbeam_channel::{Sender, bounded};
use swerve_core::{Span, Time};
use swerve_flow::{Event, Sent};

use crate::LogError;
use crate::batch::{BATCH_BYTES, Batch, Item, Name};
use crate::record::{
    DropRecord, MessageHeader, MissRecord, RunEnd, RunStart, StepRecord, StreamInfo, UnfinishedRecord,
    WatermarkRecord,
};
use crate::view::{View, Views};
use crate::writer::LogWriter;

/// Number of batches that may wait for the writer thread; beyond that the run waits for the disk.
const BATCHES: usize = 64;
/// Number of records at which a batch is sent to the writer thread.
const BATCH_RECORDS: usize = 256;
/// Run time after which a batch is sent.
const BATCH_SPAN: Span = Span::from_ms(100);
/// Number of big items (images, point clouds; one batch each) that may wait, which bounds memory.
const BIG: usize = 16;

/// Predicate that selects the payloads of which only the digest is logged.
pub type LeavesOut = fn(&Sent) -> bool;

/// Writes a run into a file on a separate thread.
///
/// The run passes batches through a bounded queue and waits when it is full: nothing is ever dropped. The writer
/// thread compresses and writes to disk. The file grows chunk by chunk under its final name and is readable at any
/// time, even after the process was killed; it is a complete log only after [`end`](Self::end) and
/// [`finish`](Self::finish). A failed write stops the recording but not the run; [`finish`](Self::finish) returns
/// the error.
pub struct Recorder {
    path: PathBuf,
    batch: Batch,
    now: Time,
    names: BTreeSet<Name>,
    streams: Vec<(Name, usize)>,
    running: Vec<UnfinishedRecord<Name>>,
    leaves_out: Option<LeavesOut>,
    views: Vec<Box<dyn Views>>,
    shown: Vec<View>,
    sender: Option<Sender<Batch>>,
    /// Receives a token for each big item that waits.
    big: Sender<()>,
    thread: Option<JoinHandle<Result<u64, LogError>>>,
    /// Error that ended the recording.
    failed: Option<LogError>,
}

impl Recorder {
    /// Creates the file, which must not exist, and starts the writer thread.
    pub fn create(path: &Path, start: &RunStart) -> Result<Self, LogError> {
        let file = File::create_new(path).map_err(|source| LogError::Create { path: path.into(), source })?;
        Self::start(path, BufWriter::with_capacity(64 << 10, file), start)
    }

    /// Logs only the digest of the selected payloads: large ones that can be recomputed.
    pub fn leave_out(&mut self, payloads: LeavesOut) {
        self.leaves_out = Some(payloads);
    }

    /// Logs the messages of these views in addition to the run, after those of the views before.
    pub fn show(&mut self, views: Box<dyn Views>) {
        self.views.push(views);
    }

    /// Logs the views of an event.
    pub(crate) fn show_event(&mut self, event: &Event<'_>) {
        let mut shown = core::mem::take(&mut self.shown);
        self.views.iter_mut().for_each(|views| views.event(event, &mut shown));
        for view in shown.drain(..) {
            self.view(view);
        }
        self.shown = shown;
    }

    fn view(&mut self, view: View) {
        let at = view.visible_at;
        self.batch.views_bytes += view.bytes;
        self.push(at, Item::View(view));
    }

    pub(crate) fn leaves_out(&self, payload: &Sent) -> bool {
        self.leaves_out.is_some_and(|leaves_out| leaves_out(payload))
    }

    /// Records into any sink; `path` is its name in errors.
    pub fn start<W: Write + Seek + Send + 'static>(
        path: &Path,
        to: W,
        start: &RunStart,
    ) -> Result<Self, LogError> {
        let mut writer = LogWriter::new(path, to, start)?;
        let (sender, receiver) = bounded::<Batch>(BATCHES);
        let (big, big_done) = bounded::<()>(BIG);
        let work = move || {
            // An error drops the receiver, which the run notices at its next batch.
            for batch in receiver {
                let big = batch.items.iter().filter(|item| item.is_big()).count();
                writer.write(batch)?;
                big_done.try_iter().take(big).for_each(drop);
            }
            writer.close()
        };
        let thread = std::thread::Builder::new().name("swerve-log".into()).spawn(work);
        let thread = thread.map_err(|source| LogError::Create { path: path.into(), source })?;
        Ok(Self {
            path: path.into(),
            batch: Batch::default(),
            now: Time::ZERO,
            names: BTreeSet::new(),
            streams: Vec::new(),
            running: Vec::new(),
            leaves_out: None,
            views: Vec::new(),
            shown: Vec::new(),
            sender: Some(sender),
            big,
            thread: Some(thread),
            failed: None,
        })
    }

    /// Records a message of a stream. `info` describes the stream when it is first used, `encode` appends the
    /// payload in CBOR.
    pub fn message(
        &mut self,
        stream: &str,
        info: impl FnOnce() -> StreamInfo,
        header: MessageHeader,
        encode: impl FnOnce(&mut Vec<u8>),
    ) {
        let stream = self.stream(stream, info);
        let payload = self.bytes(encode);
        self.push(header.visible_at, Item::Message { stream, header, payload });
    }

    /// As [`message`](Self::message), with a payload that may still be computing; the writer thread waits for it.
    pub(crate) fn promised(
        &mut self,
        stream: &str,
        info: impl FnOnce() -> StreamInfo,
        header: MessageHeader,
        payload: &Sent,
    ) {
        let (stream, leaves_out) = (self.stream(stream, info), self.leaves_out(payload));
        let item = Item::Promised { stream, header, payload: payload.clone(), leaves_out };
        self.push(header.visible_at, item);
    }

    /// Number of a stream, which is declared when first used.
    fn stream(&mut self, stream: &str, info: impl FnOnce() -> StreamInfo) -> usize {
        let known = self.streams.iter().find(|(name, _)| &*name.0 == stream).map(|&(_, number)| number);
        known.unwrap_or_else(|| {
            let number = self.streams.len();
            let name = self.name(stream);
            self.streams.push((name, number));
            self.batch.items.push(Item::Stream(info()));
            number
        })
    }

    /// Records a watermark without a message.
    pub fn watermark(&mut self, record: WatermarkRecord<&str>) {
        let record = WatermarkRecord {
            stream: self.name(record.stream),
            operator: self.name(record.operator),
            port: record.port,
            watermark: record.watermark,
            visible_at: record.visible_at,
            pass: record.pass,
            seq: record.seq,
        };
        self.push(record.visible_at, Item::Watermark(record));
    }

    /// Records the start of a step. It is only logged if the step has not ended by [`end`](Self::end).
    pub fn step_started(&mut self, record: &UnfinishedRecord<&str>) {
        let operator = self.name(record.operator);
        self.running.push(UnfinishedRecord { operator, stamp: record.stamp, start: record.start });
    }

    /// Records a step that ended.
    pub fn step(&mut self, record: StepRecord<&str>) {
        let StepRecord { operator, stamp, start, end, units, host_ns, late } = record;
        let operator = self.name(operator);
        if let Some(place) = self.running.iter().position(|r| r.stamp == stamp && r.operator == operator) {
            self.running.remove(place);
        }
        self.push(end, Item::Step(StepRecord { operator, stamp, start, end, units, host_ns, late }));
    }

    /// Records a missed deadline.
    pub fn miss(&mut self, record: MissRecord<&str>) {
        let MissRecord { operator, stamp, deadline, at, reaction, started } = record;
        let (operator, reaction) = (self.name(operator), self.name(reaction));
        self.push(at, Item::Miss(MissRecord { operator, stamp, deadline, at, reaction, started }));
    }

    /// Records a dropped frame or result.
    pub fn dropped(&mut self, record: DropRecord<&str>) {
        let DropRecord { operator, stamp, at, reason } = record;
        let (operator, reason) = (self.name(operator), self.name(reason));
        self.push(at, Item::Drop(DropRecord { operator, stamp, at, reason }));
    }

    /// Records a decision at the instant `at`; `encode` appends it in CBOR.
    pub fn decision(&mut self, at: Time, encode: impl FnOnce(&mut Vec<u8>)) {
        let cbor = self.bytes(encode);
        self.push(at, Item::Decision { at, cbor });
    }

    /// Records the end of the run; nothing may follow.
    pub fn end(&mut self, end: RunEnd) {
        for unfinished in core::mem::take(&mut self.running) {
            self.push(end.at, Item::Unfinished(unfinished));
        }
        self.push(end.at, Item::End(end));
        self.send();
    }

    /// Instant of the last record.
    pub(crate) fn now(&self) -> Time {
        self.now
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Error that ended the recording; the batch that failed and all later ones are missing.
    pub fn failure(&self) -> Option<&LogError> {
        self.failed.as_ref()
    }

    /// Waits until everything is written; returns the number of records or the error. Without a prior
    /// [`end`](Self::end), the file is readable but incomplete.
    pub fn finish(mut self) -> Result<u64, LogError> {
        let joined = self.join();
        match self.failed.take() {
            Some(failed) => Err(failed),
            None => joined.unwrap_or(Ok(0)),
        }
    }

    fn name(&mut self, name: &str) -> Name {
        if let Some(known) = self.names.get(name) {
            return known.clone();
        }
        let new = Name(name.into());
        self.names.insert(new.clone());
        new
    }

    fn bytes(&mut self, encode: impl FnOnce(&mut Vec<u8>)) -> Range<usize> {
        let start = self.batch.bytes.len();
        encode(&mut self.batch.bytes);
        start..self.batch.bytes.len()
    }

    fn push(&mut self, at: Time, item: Item) {
        let is_big = item.is_big();
        if is_big {
            // Fails if the writer has failed; the next batch reports that.
            let _sent = self.big.send(());
        }
        self.now = at;
        self.batch.items.push(item);
        let since = *self.batch.since.get_or_insert(at);
        let bytes = self.batch.bytes.len() + self.batch.views_bytes;
        let full = self.batch.items.len() >= BATCH_RECORDS || bytes >= BATCH_BYTES || is_big;
        if full || at - since >= BATCH_SPAN {
            self.send();
        }
    }

    fn send(&mut self) {
        let batch = core::mem::take(&mut self.batch);
        if let Some(sender) = &self.sender
            && !batch.items.is_empty()
            && sender.send(batch).is_err()
        {
            // The writer has failed and ended.
            self.sender = None;
            self.failed = self.thread.take().and_then(|thread| self.written(thread).err());
        }
    }

    fn join(&mut self) -> Option<Result<u64, LogError>> {
        self.send();
        self.sender = None;
        self.thread.take().map(|thread| self.written(thread))
    }

    /// Result of the writer thread.
    fn written(&self, thread: JoinHandle<Result<u64, LogError>>) -> Result<u64, LogError> {
        let panicked =
            |_| Err(LogError::Write { path: self.path.clone(), reason: "the writer panicked".into() });
        thread.join().unwrap_or_else(panicked)
    }
}

impl Drop for Recorder {
    /// Writes the remaining batches, so that a failed run leaves a readable log.
    fn drop(&mut self) {
        let _nobody_left_to_tell = self.join();
    }
}
