//! Records of a log.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Time};

use crate::LogError;

/// All that is known when a run starts; the first record of a log.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct RunStart {
    /// Version of the program.
    pub version: String,
    /// The seed.
    pub seed: u64,
    /// The resolved configuration with every default spelled out, in the text form that the program reads.
    pub config: String,
    /// Anything else worth keeping: scenario text, command line, host.
    pub extra: BTreeMap<String, String>,
}

/// All that is known when a run has ended; the last record of a log. A log without it was cut off.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct RunEnd {
    /// The run's digest.
    pub digest: Digest,
    /// The last instant of the run.
    pub at: Time,
    /// Why it ended.
    pub reason: String,
    /// The engine's report, JSON.
    pub report: String,
}

/// Beginning of the reason of a failed run.
pub(crate) const FAILED: &str = "failed: ";

impl RunEnd {
    /// The failure that ended the run, if one did: its last instant may be incomplete then.
    pub fn failure(&self) -> Option<&str> {
        self.reason.strip_prefix(FAILED)
    }

    /// The digest, unless it covers a part of an instant.
    pub fn whole_digest(&self) -> Option<Digest> {
        self.failure().is_none().then_some(self.digest)
    }

    /// A note on the last instant, where it is incomplete.
    pub fn incomplete(&self) -> Option<String> {
        let why = self.failure()?;
        Some(format!("the run failed at {:.3} s ({why}): that instant is incomplete", self.at.as_secs()))
    }
}

/// A stream that the run produced.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct StreamInfo {
    /// Its name.
    pub stream: String,
    /// The operator that publishes it.
    pub operator: String,
    /// Which of the operator's outputs it is.
    pub port: usize,
    /// Rust type of its messages.
    pub type_name: String,
    /// Form of their payloads in CDDL (RFC 8610): the rule `payload` and those that it names.
    pub form: String,
}

/// When a message describes the world, when it could be read, and where it comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct MessageHeader {
    /// The instant that the message describes.
    pub stamp: Time,
    /// No later message of the stream has a stamp at or below this.
    pub watermark: Time,
    /// The instant at which it was published.
    pub visible_at: Time,
    /// In which sweep of that instant.
    pub pass: u32,
    /// How many messages the stream carried before.
    pub seq: u64,
    /// The stamp of the step that computed it, in a repeat.
    pub reused_from: Option<Time>,
    /// The stamp of the newest sensor frame that it derives from.
    pub origin: Option<Time>,
}

/// One message of a stream.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PublicationRecord {
    /// Its stream.
    pub stream: Arc<StreamInfo>,
    /// When and whence.
    pub header: MessageHeader,
    /// The payload in CBOR, the bytes as they were written.
    pub payload_cbor: Arc<[u8]>,
}

/// A watermark published without a message.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct WatermarkRecord<S = String> {
    /// The stream.
    pub stream: S,
    /// Its operator.
    pub operator: S,
    /// Which of the operator's outputs it is.
    pub port: usize,
    /// The watermark.
    pub watermark: Time,
    /// The instant at which it was published.
    pub visible_at: Time,
    /// In which sweep of that instant.
    pub pass: u32,
    /// How many messages the stream carried before.
    pub seq: u64,
}

/// One step from its start to its modelled end.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct StepRecord<S = String> {
    /// Whose step.
    pub operator: S,
    /// For which stamp.
    pub stamp: Time,
    /// When it started.
    pub start: Time,
    /// When it ended.
    pub end: Time,
    /// The units of work that it counted.
    pub units: u64,
    /// How long it took on the host, nanoseconds; not repeatable.
    pub host_ns: u64,
    /// Its result was not published, or will not be, because the stamp is answered already.
    pub late: bool,
}

/// A step that had not come to its end when the run had.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct UnfinishedRecord<S = String> {
    /// Whose step.
    pub operator: S,
    /// For which stamp.
    pub stamp: Time,
    /// When it started.
    pub start: Time,
}

/// A missed deadline.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct MissRecord<S = String> {
    /// Whose deadline.
    pub operator: S,
    /// For which stamp.
    pub stamp: Time,
    /// When it passed.
    pub deadline: Time,
    /// When it was handled.
    pub at: Time,
    /// The reaction that answered.
    pub reaction: S,
    /// Whether the step had started.
    pub started: bool,
}

/// A frame that was not answered, or a result that was not published.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct DropRecord<S = String> {
    /// Whose frame.
    pub operator: S,
    /// For which stamp.
    pub stamp: Time,
    /// When.
    pub at: Time,
    /// Why.
    pub reason: S,
}

/// Something that was decided in the run and is no function of its inputs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DecisionRecord {
    /// The decision, CBOR.
    pub cbor: Arc<[u8]>,
}

/// One record of a log, as its reader gives it: in the order in which the run did it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Record {
    /// A message.
    Publication(PublicationRecord),
    /// A watermark without a message.
    Watermark(WatermarkRecord),
    /// A step.
    Step(StepRecord),
    /// A step without its end.
    Unfinished(UnfinishedRecord),
    /// A missed deadline.
    Miss(MissRecord),
    /// A dropped frame or result.
    Drop(DropRecord),
    /// A decision.
    Decision(DecisionRecord),
}

impl PublicationRecord {
    /// The payload as a `T`.
    pub fn decode<T: DeserializeOwned>(&self) -> Result<T, LogError> {
        decode(&self.payload_cbor, &self.stream.stream, self.header.seq)
    }
}

impl DecisionRecord {
    /// The decision as a `T`.
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
