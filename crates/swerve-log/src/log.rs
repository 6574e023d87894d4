//! A whole log in memory.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use swerve_core::Span;

use crate::LogError;
use crate::reader::Reader;
use crate::record::{DecisionRecord, PublicationRecord, Record, RunEnd, RunStart, StepRecord, StreamInfo};

/// A log, read whole: replay and comparison need all of it anyway. [`Reader`] goes record by record.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// What was known when the run started.
    pub start: RunStart,
    /// What was known when it ended; `None` where it was cut off.
    pub end: Option<RunEnd>,
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

    /// Reads what can be read, and tells what ended the reading. An error when not even the run's start can be.
    pub fn salvage(path: &Path) -> Result<(Self, Option<LogError>), LogError> {
        let mut reader = Reader::open(path)?;
        let mut records = Vec::new();
        let damage = loop {
            match reader.next_record() {
                Ok(Some(record)) => records.push(record),
                Ok(None) => break None,
                Err(error) => break Some(error),
            }
        };
        let start = reader.run_start().clone();
        let end = reader.run_end().cloned();
        Ok((Self { start, end, streams: reader.streams().to_vec(), records }, damage))
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

    /// Run times by operator, each with its stamp, ordered by stamp: what a run with recorded run times needs.
    pub fn run_times(&self) -> BTreeMap<String, Vec<(swerve_core::Time, Span)>> {
        let mut times: BTreeMap<String, Vec<_>> = BTreeMap::new();
        for step in self.steps() {
            times.entry(step.operator.clone()).or_default().push((step.stamp, step.end - step.start));
        }
        times.values_mut().for_each(|of| of.sort_by_key(|&(stamp, _)| stamp));
        times
    }
}
