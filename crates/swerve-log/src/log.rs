//! A complete log in memory.

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

/// A log read completely into memory, for replay and comparison. [`Reader`] reads record by record.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// Head: everything known at the start of the run.
    pub start: RunStart,
    /// End: everything known at the end of the run; `None` if the log was cut off.
    pub end: Option<RunEnd>,
    /// True if the end contains seals. Without them, changes of head, scenario, configuration, headers and times
    /// cannot be detected.
    pub is_sealed: bool,
    /// Streams that carried messages, in the order of their first message.
    pub streams: Vec<Arc<StreamInfo>>,
    /// All records in run order.
    pub records: Vec<Record>,
}

impl Log {
    /// Reads a complete log; missing or damaged content is an error.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let (log, damage) = Self::salvage(path)?;
        damage.map_or(Ok(log), Err)
    }

    /// Reads the records of a complete log that `keep` selects; missing or damaged content is an error.
    pub fn read_where(path: &Path, keep: impl Fn(&Record) -> bool) -> Result<Self, LogError> {
        let (log, damage) = Self::salvage_where(path, keep)?;
        damage.map_or(Ok(log), Err)
    }

    /// Reads as much as possible and returns the error that ended it, if any. Fails if even the run's start is
    /// unreadable.
    pub fn salvage(path: &Path) -> Result<(Self, Option<LogError>), LogError> {
        Self::salvage_where(path, |_| true)
    }

    /// As [`salvage`](Self::salvage), for the records that `keep` selects.
    pub fn salvage_where(
        path: &Path,
        keep: impl Fn(&Record) -> bool,
    ) -> Result<(Self, Option<LogError>), LogError> {
        Ok(Self::gather(Reader::open(path)?, &keep))
    }

    /// Reads to the end or to the first error.
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

    /// Last instant that the log covers completely: the end of the run; 1 ns before it for a failed run, whose last
    /// instant is incomplete; 1 ns before the last record if the log was cut off; the start of the run without
    /// records.
    pub fn whole_until(&self) -> Time {
        let last = || self.records.iter().rev().find_map(Record::at);
        match &self.end {
            Some(end) if end.failure().is_none() => end.at,
            Some(end) => end.at - Span::from_ns(1),
            None => last().map_or(Time::ZERO, |last| last - Span::from_ns(1)),
        }
    }

    /// The log of a part of the run: operators and streams for which `own` gives another name, under that name.
    #[must_use]
    pub fn part(&self, own: impl Fn(&str) -> Option<String>) -> Self {
        let stream = |info: &Arc<StreamInfo>| {
            let (stream, operator) = (own(&info.stream)?, own(&info.operator)?);
            Some(Arc::new(StreamInfo { stream, operator, ..(**info).clone() }))
        };
        let streams: Vec<Option<Arc<StreamInfo>>> = self.streams.iter().map(stream).collect();
        let of = |info: &Arc<StreamInfo>| {
            let index = self.streams.iter().position(|known| known == info)?;
            streams[index].clone()
        };
        let record = |record: &Record| {
            let mut record = record.clone();
            match &mut record {
                Record::Publication(p) => p.stream = of(&p.stream)?,
                Record::Watermark(w) => (w.stream, w.operator) = (own(&w.stream)?, own(&w.operator)?),
                Record::Step(s) => s.operator = own(&s.operator)?,
                Record::Unfinished(s) => s.operator = own(&s.operator)?,
                Record::Miss(m) => m.operator = own(&m.operator)?,
                Record::Drop(d) => d.operator = own(&d.operator)?,
                Record::Decision(_) => {}
            }
            Some(record)
        };
        let records = self.records.iter().filter_map(record).collect();
        let (start, end) = (self.start.clone(), self.end.clone());
        Self {
            start,
            end,
            is_sealed: self.is_sealed,
            streams: streams.iter().flatten().cloned().collect(),
            records,
        }
    }

    /// The log up to an instant, without steps that were unfinished at its end.
    #[must_use]
    pub fn until(mut self, end: Time) -> Self {
        self.records.retain(|record| match record {
            Record::Decision(_) => true,
            record => record.at().is_some_and(|at| at <= end),
        });
        self
    }

    /// Messages of one stream, in order.
    pub fn publications<'a>(&'a self, stream: &'a str) -> impl Iterator<Item = &'a PublicationRecord> {
        self.all_publications().filter(move |p| p.stream.stream == stream)
    }

    /// Messages of all streams, in order of publication.
    pub fn all_publications(&self) -> impl Iterator<Item = &PublicationRecord> {
        self.records.iter().filter_map(|record| match record {
            Record::Publication(publication) => Some(publication),
            _ => None,
        })
    }

    /// Steps in the order of their ends.
    pub fn steps(&self) -> impl Iterator<Item = &StepRecord> {
        self.records.iter().filter_map(|record| match record {
            Record::Step(step) => Some(step),
            _ => None,
        })
    }

    /// Decisions in order.
    pub fn decisions(&self) -> impl Iterator<Item = &DecisionRecord> {
        self.records.iter().filter_map(|record| match record {
            Record::Decision(decision) => Some(decision),
            _ => None,
        })
    }

    /// Steps that had not ended at the end of the run.
    pub fn unfinished(&self) -> impl Iterator<Item = &UnfinishedRecord> {
        self.records.iter().filter_map(|record| match record {
            Record::Unfinished(step) => Some(step),
            _ => None,
        })
    }

    /// Run times with their stamps by operator, as needed by a run with recorded run times. A step that was
    /// unfinished at the end of the run is assigned a run time up to 1 ns after it, a lower bound.
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

    /// All publications of an operator, watermarks included, as input for [`swerve_flow::Graph::playback`].
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

    /// Intervals (start, end) during which an operator's steps were running, [`Time::MAX`] if unfinished, as input
    /// for [`swerve_flow::Graph::playback_steps`].
    pub fn held(&self, operator: &str) -> Vec<(Time, Time)> {
        let ended = self.steps().filter(|s| s.operator == operator).map(|s| (s.start, s.end));
        let unfinished = self.unfinished().filter(|s| s.operator == operator).map(|s| (s.start, Time::MAX));
        ended.chain(unfinished).collect()
    }
}
