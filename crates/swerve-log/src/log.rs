//! A whole log in memory.

use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_flow::{PlaybackMessage, PlaybackPayload, PlaybackRecord};

use crate::LogError;
use crate::reader::Reader;
use crate::record::{
    DecisionRecord, PublicationRecord, Record, RunEnd, RunStart, StepRecord, StreamInfo, UnfinishedRecord,
};

/// A log, read whole: replay and comparison need all of it anyway. [`Reader`] goes record by record.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// The head: all that was known when the run started.
    pub start: RunStart,
    /// The end: all that was known when it ended; `None` where it was cut off.
    pub end: Option<RunEnd>,
    /// Whether the end holds seals. Without them nobody can tell whether head, scenario, configuration, headers and times are
    /// as they were written.
    pub is_sealed: bool,
    /// The streams that carried messages, in the order of their first one.
    pub streams: Vec<Arc<StreamInfo>>,
    /// All records in the order in which the run did them.
    pub records: Vec<Record>,
}

impl Log {
    /// Reads a complete log; anything missing or damaged is an error.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let (log, damage) = Self::salvage(path)?;
        damage.map_or(Ok(log), Err)
    }

    /// Reads of a complete log the records that are to be kept; anything missing or damaged is an error.
    pub fn read_where(path: &Path, keep: impl Fn(&Record) -> bool) -> Result<Self, LogError> {
        let (log, damage) = Self::salvage_where(path, keep)?;
        damage.map_or(Ok(log), Err)
    }

    /// Reads what can be read, and tells what ended the reading. An error when not even the run's start can be.
    pub fn salvage(path: &Path) -> Result<(Self, Option<LogError>), LogError> {
        Self::salvage_where(path, |_| true)
    }

    /// As [`salvage`](Self::salvage), of the records that are to be kept.
    pub fn salvage_where(
        path: &Path,
        keep: impl Fn(&Record) -> bool,
    ) -> Result<(Self, Option<LogError>), LogError> {
        Ok(Self::gather(Reader::open(path)?, &keep))
    }

    /// Reads on to the end, or to what ends the reading.
    pub(crate) fn gather<R: Read + Seek>(
        mut reader: Reader<R>,
        keep: &dyn Fn(&Record) -> bool,
    ) -> (Self, Option<LogError>) {
        let mut records = Vec::new();
        let damage = loop {
            match reader.next_record() {
                Ok(Some(record)) if keep(&record) => records.push(record),
                Ok(Some(_)) => {}
                Ok(None) => break None,
                Err(error) => break Some(error),
            }
        };
        let start = reader.run_start().clone();
        let (end, is_sealed) = (reader.run_end().cloned(), reader.is_sealed());
        (Self { start, end, is_sealed, streams: reader.streams().to_vec(), records }, damage)
    }

    /// The last instant that it holds completely: the run's end; just before it where the run failed, as less was done
    /// at that instant than otherwise; just before its last record where the log was cut off. The run's beginning where
    /// nothing was done.
    pub fn whole_until(&self) -> Time {
        let at = |record: &Record| match record {
            Record::Publication(p) => Some(p.header.visible_at),
            Record::Watermark(w) => Some(w.visible_at),
            Record::Step(s) => Some(s.end),
            Record::Miss(m) => Some(m.at),
            Record::Drop(d) => Some(d.at),
            Record::Unfinished(_) | Record::Decision(_) => None,
        };
        let last = || self.records.iter().rev().find_map(at);
        match &self.end {
            Some(end) if end.failure().is_none() => end.at,
            Some(end) => end.at - Span::from_ns(1),
            None => last().map_or(Time::ZERO, |last| last - Span::from_ns(1)),
        }
    }

    /// The messages of one stream, in order.
    pub fn publications<'a>(&'a self, stream: &'a str) -> impl Iterator<Item = &'a PublicationRecord> {
        self.all_publications().filter(move |p| p.stream.stream == stream)
    }

    /// The messages of all streams, in the order of their publication.
    pub fn all_publications(&self) -> impl Iterator<Item = &PublicationRecord> {
        self.records.iter().filter_map(|record| match record {
            Record::Publication(publication) => Some(publication),
            _ => None,
        })
    }

    /// The steps in the order of their ends.
    pub fn steps(&self) -> impl Iterator<Item = &StepRecord> {
        self.records.iter().filter_map(|record| match record {
            Record::Step(step) => Some(step),
            _ => None,
        })
    }

    /// The decisions in order.
    pub fn decisions(&self) -> impl Iterator<Item = &DecisionRecord> {
        self.records.iter().filter_map(|record| match record {
            Record::Decision(decision) => Some(decision),
            _ => None,
        })
    }

    /// Steps that had not ended when the run had.
    pub fn unfinished(&self) -> impl Iterator<Item = &UnfinishedRecord> {
        self.records.iter().filter_map(|record| match record {
            Record::Unfinished(step) => Some(step),
            _ => None,
        })
    }

    /// Run times by operator, each with its stamp: what a run with recorded run times needs. A step that the
    /// run's end cut off counts as taking until just after it: it did take longer than that.
    pub fn run_times(&self) -> BTreeMap<String, Vec<(Time, Span)>> {
        let after = self.end.as_ref().map(|end| end.at + Span::from_ns(1));
        let ended = self.steps().map(|s| (&s.operator, s.stamp, s.end - s.start));
        let cut_off = self.unfinished().filter_map(|s| Some((&s.operator, s.stamp, after? - s.start)));
        let mut times: BTreeMap<String, Vec<_>> = BTreeMap::new();
        for (operator, stamp, run_time) in ended.chain(cut_off) {
            times.entry(operator.clone()).or_default().push((stamp, run_time));
        }
        times
    }

    /// All that an operator published, watermarks included, to be published again: for
    /// [`swerve_flow::Graph::playback`].
    pub fn playback(&self, operator: &str) -> Vec<PlaybackRecord> {
        let of = |record: &Record| match record {
            Record::Publication(p) if p.stream.operator == operator => Some(PlaybackRecord {
                port: p.stream.port,
                visible_at: p.header.visible_at,
                pass: p.header.pass,
                watermark: p.header.watermark,
                message: Some(PlaybackMessage {
                    stamp: p.header.stamp,
                    reused_from: p.header.reused_from,
                    origin: p.header.origin,
                    payload: PlaybackPayload::cbor(p.payload_cbor.clone()),
                }),
            }),
            Record::Watermark(w) if w.operator == operator => Some(PlaybackRecord {
                port: w.port,
                visible_at: w.visible_at,
                pass: w.pass,
                watermark: w.watermark,
                message: None,
            }),
            _ => None,
        };
        self.records.iter().filter_map(of).collect()
    }

    /// When an operator's steps held their places (start, end; those unfinished for ever): for
    /// [`swerve_flow::Graph::playback_steps`].
    pub fn held(&self, operator: &str) -> Vec<(Time, Time)> {
        let ended = self.steps().filter(|s| s.operator == operator).map(|s| (s.start, s.end));
        let unfinished = self.unfinished().filter(|s| s.operator == operator).map(|s| (s.start, Time::MAX));
        ended.chain(unfinished).collect()
    }
}
