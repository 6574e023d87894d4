//! Records of a log.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Time};
use swerve_flow::{DropReason, Reaction};

use crate::LogError;

/// Everything known at the start of a run; the first record of a log.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct RunStart {
    /// Version of the program.
    pub version: String,
    /// Random seed.
    pub seed: u64,
    /// Resolved configuration with all defaults, in the text format that the program reads.
    pub config: String,
    /// Further information: scenario text, command line, host.
    pub extra: BTreeMap<String, String>,
}

/// Everything known at the end of a run; the last record of a log. A log without it was cut off.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct RunEnd {
    /// Digest of the run.
    pub digest: Digest,
    /// Last instant of the run.
    pub at: Time,
    /// Reason for the end.
    pub reason: String,
    /// Report of the engine, JSON.
    pub report: String,
}

/// Prefix of the reason of a failed run.
pub(crate) const FAILED: &str = "failed: ";

impl RunEnd {
    /// Failure that ended the run, if any; its last instant may then be incomplete.
    pub fn failure(&self) -> Option<&str> {
        self.reason.strip_prefix(FAILED)
    }

    /// Digest of the run; `None` if its last instant is incomplete.
    pub fn whole_digest(&self) -> Option<Digest> {
        self.failure().is_none().then_some(self.digest)
    }

    /// Note on the incomplete last instant, if it is.
    pub fn incomplete(&self) -> Option<String> {
        let why = self.failure()?;
        Some(format!("the run failed at {:.3} s ({why}): that instant is incomplete", self.at.as_secs()))
    }
}

/// A stream of the run.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct StreamInfo {
    /// Name of the stream.
    pub stream: String,
    /// Operator that publishes it.
    pub operator: String,
    /// Index of the operator's output port.
    pub port: usize,
    /// Rust type of its messages.
    pub type_name: String,
    /// CDDL (RFC 8610) of the payload: the rule `payload` and those that it references.
    pub form: String,
}

/// Times, sequence number and provenance of a message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct MessageHeader {
    /// The instant that the message describes.
    pub stamp: Time,
    /// Watermark: no later message of the stream has a stamp at or below it.
    pub watermark: Time,
    /// Instant of publication.
    pub visible_at: Time,
    /// Sweep of that instant.
    pub pass: u32,
    /// Number of earlier messages of the stream.
    pub seq: u64,
    /// For a repeated result, the stamp of the step that computed it.
    pub reused_from: Option<Time>,
    /// Stamp of the newest sensor frame from which it derives.
    pub origin: Option<Time>,
}

/// One message of a stream.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PublicationRecord {
    /// Stream of the message.
    pub stream: Arc<StreamInfo>,
    /// Times, sequence number and provenance.
    pub header: MessageHeader,
    /// Payload in CBOR, exactly as written.
    pub payload_cbor: Arc<[u8]>,
}

/// A watermark published without a message.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct WatermarkRecord<S = String> {
    /// Name of the stream.
    pub stream: S,
    /// Operator that publishes it.
    pub operator: S,
    /// Index of the operator's output port.
    pub port: usize,
    /// The watermark.
    pub watermark: Time,
    /// Instant of publication.
    pub visible_at: Time,
    /// Sweep of that instant.
    pub pass: u32,
    /// Number of earlier messages of the stream.
    pub seq: u64,
}

/// One step from its start to its modelled end.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct StepRecord<S = String> {
    /// Operator that ran.
    pub operator: S,
    /// Stamp of the step.
    pub stamp: Time,
    /// Start of the step.
    pub start: Time,
    /// Modelled end of the step.
    pub end: Time,
    /// Units of work that it counted.
    pub units: u64,
    /// Duration on the host, nanoseconds; not reproducible.
    pub host_ns: u64,
    /// True if the result is not published because the stamp has already been answered.
    pub late: bool,
}

/// A step that had not ended at the end of the run.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct UnfinishedRecord<S = String> {
    /// Operator that was running.
    pub operator: S,
    /// Stamp of the step.
    pub stamp: Time,
    /// Start of the step.
    pub start: Time,
}

/// A missed deadline.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct MissRecord<S = String> {
    /// Operator with the deadline.
    pub operator: S,
    /// Stamp of the frame.
    pub stamp: Time,
    /// The deadline.
    pub deadline: Time,
    /// Instant at which the miss was handled.
    pub at: Time,
    /// Reaction to the miss.
    pub reaction: S,
    /// True if the step had started.
    pub started: bool,
}

/// A frame that was not processed, or a result that was not published.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct DropRecord<S = String> {
    /// Operator that dropped it.
    pub operator: S,
    /// Stamp of the frame.
    pub stamp: Time,
    /// Instant of the drop.
    pub at: Time,
    /// Reason for the drop.
    pub reason: S,
}

/// A decision made during the run that is not a function of its inputs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DecisionRecord {
    /// The decision, CBOR.
    pub cbor: Arc<[u8]>,
}

/// One record of a log, in run order.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Record {
    /// A message.
    Publication(PublicationRecord),
    /// A watermark without a message.
    Watermark(WatermarkRecord),
    /// A step.
    Step(StepRecord),
    /// A step without an end.
    Unfinished(UnfinishedRecord),
    /// A missed deadline.
    Miss(MissRecord),
    /// A dropped frame or result.
    Drop(DropRecord),
    /// A decision.
    Decision(DecisionRecord),
}

impl Record {
    /// Instant at which it took effect; `None` for unfinished steps and decisions.
    pub fn at(&self) -> Option<Time> {
        match self {
            Self::Publication(p) => Some(p.header.visible_at),
            Self::Watermark(w) => Some(w.visible_at),
            Self::Step(s) => Some(s.end),
            Self::Miss(m) => Some(m.at),
            Self::Drop(d) => Some(d.at),
            Self::Unfinished(_) | Self::Decision(_) => None,
        }
    }
}

impl PublicationRecord {
    /// Decodes the payload as a `T`.
    pub fn decode<T: DeserializeOwned>(&self) -> Result<T, LogError> {
        decode(&self.payload_cbor, &self.stream.stream, self.header.seq)
    }
}

impl DecisionRecord {
    /// Decodes the decision as a `T`.
    pub fn decode<T: DeserializeOwned>(&self) -> Result<T, LogError> {
        decode(&self.cbor, "decisions", 0)
    }
}

fn decode<T: DeserializeOwned>(cbor: &[u8], stream: &str, seq: u64) -> Result<T, LogError> {
    swerve_flow::cbor::read(cbor).map_err(|reason| LogError::Payload {
        stream: stream.into(),
        seq,
        type_name: core::any::type_name::<T>(),
        reason,
    })
}

pub(crate) fn reaction_name(reaction: Reaction) -> &'static str {
    match reaction {
        Reaction::Skip => "skip",
        Reaction::ReuseLast => "reuse_last",
        Reaction::OnDeadline => "on_deadline",
    }
}

pub(crate) fn reason_name(reason: DropReason) -> &'static str {
    match reason {
        DropReason::Skipped => "skipped",
        DropReason::QueueFull => "queue_full",
        DropReason::GivenUp => "given_up",
        DropReason::Overtaken => "overtaken",
        DropReason::TooLate => "too_late",
    }
}
