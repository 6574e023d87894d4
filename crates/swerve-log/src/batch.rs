//! Batches of records on their way to the writer thread.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use serde::{Serialize, Serializer};
use swerve_core::Time;
use swerve_flow::{Sent, cbor};

use crate::record::{
    DropRecord, MessageHeader, MissRecord, RunEnd, StepRecord, StreamInfo, UnfinishedRecord, WatermarkRecord,
};
use crate::view::View;

/// Payload at which a batch is sent, bytes.
pub(crate) const BATCH_BYTES: usize = 256 << 10;

/// A name shared by many records.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Name(pub(crate) Arc<str>);

impl Serialize for Name {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.0)
    }
}

impl core::borrow::Borrow<str> for Name {
    fn borrow(&self) -> &str {
        &self.0
    }
}

/// One record on its way to the writer thread; ranges index the bytes of the batch.
pub(crate) enum Item {
    /// Declares the stream with the next number, from 0.
    Stream(StreamInfo),
    Message {
        stream: usize,
        header: MessageHeader,
        payload: Range<usize>,
    },
    /// A message whose payload may still be computing; of omitted payloads only the digest is logged.
    Promised {
        stream: usize,
        header: MessageHeader,
        payload: Sent,
        leaves_out: bool,
    },
    Watermark(WatermarkRecord<Name>),
    Step(StepRecord<Name>),
    Unfinished(UnfinishedRecord<Name>),
    Miss(MissRecord<Name>),
    Drop(DropRecord<Name>),
    Decision {
        at: Time,
        cbor: Range<usize>,
    },
    View(View),
    End(RunEnd),
}

impl Item {
    /// Returns true if this item fills a batch by itself.
    pub(crate) fn is_big(&self) -> bool {
        match self {
            Self::View(view) => view.bytes >= BATCH_BYTES,
            Self::Promised { leaves_out, .. } => !leaves_out,
            _ => false,
        }
    }
}

/// Batch of records on its way to the writer thread.
#[derive(Default)]
pub(crate) struct Batch {
    pub(crate) items: Vec<Item>,
    pub(crate) bytes: Vec<u8>,
    /// Memory held by its views, bytes.
    pub(crate) views_bytes: usize,
    pub(crate) since: Option<Time>,
}

/// Appends the placeholder for an omitted payload: in CBOR, a map of `left_out` to the digest.
pub fn left_out(payload: &Sent, out: &mut Vec<u8>) {
    let place = BTreeMap::from([("left_out", payload.digest().to_string())]);
    cbor::write(&place, out);
}
