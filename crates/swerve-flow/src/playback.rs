//! Publications of an earlier run, to be published again.

use std::sync::Arc;

use swerve_core::Time;

use crate::observer::Publication;
use crate::payload::{Decode, Payload, PayloadType};
use crate::sent::Sent;

/// One publication of an operator in an earlier run.
#[derive(Clone, Debug)]
pub struct PlaybackRecord {
    /// Index of the operator's output.
    pub port: usize,
    /// Instant of publication.
    pub visible_at: Time,
    /// Index of the sweep within that instant; above 0 only for operators that follow a shared resource.
    pub pass: u32,
    /// Watermark that it carried.
    pub watermark: Time,
    /// The message; `None` for a bare watermark.
    pub message: Option<PlaybackMessage>,
}

/// The message of a [`PlaybackRecord`].
#[derive(Clone, Debug)]
pub struct PlaybackMessage {
    /// Instant that the message describes.
    pub stamp: Time,
    /// Stamp of the step that computed it, if it was a repeat.
    pub reused_from: Option<Time>,
    /// Stamp of the newest sensor frame that it derives from.
    pub origin: Option<Time>,
    /// Payload of the message.
    pub payload: PlaybackPayload,
}

/// Payload of a recorded message.
#[derive(Clone)]
pub struct PlaybackPayload(Kind);

#[derive(Clone)]
enum Kind {
    Ready(Sent),
    Cbor(Arc<[u8]>),
}

/// Maximum size of CBOR that is decoded only once, bytes: decoded it takes no more memory than the CBOR, which contains
/// field names. Larger payloads (images, point clouds) are decoded one at a time.
const SMALL: usize = 16 << 10;

impl core::fmt::Debug for PlaybackPayload {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match &self.0 {
            Kind::Ready(sent) => write!(f, "{sent:?}"),
            Kind::Cbor(bytes) => write!(f, "{} bytes of CBOR", bytes.len()),
        }
    }
}

impl PlaybackPayload {
    /// Creates a payload from a value in memory.
    pub fn value<T: Payload>(value: T) -> Self {
        Self(Kind::Ready(Sent::new(Arc::new(value))))
    }

    /// Creates a payload from its form in a log.
    pub fn cbor(bytes: impl Into<Arc<[u8]>>) -> Self {
        Self(Kind::Cbor(bytes.into()))
    }
}

impl PlaybackRecord {
    /// Creates a record of a message published at `visible_at`, with its stamp as watermark.
    pub fn message<T: Payload>(visible_at: Time, stamp: Time, value: T) -> Self {
        Self::sent(visible_at, stamp, Sent::new(Arc::new(value)))
    }

    pub(crate) fn sent(visible_at: Time, stamp: Time, sent: Sent) -> Self {
        let payload = PlaybackPayload(Kind::Ready(sent));
        let message = PlaybackMessage { stamp, reused_from: None, origin: Some(stamp), payload };
        Self { port: 0, visible_at, pass: 0, watermark: stamp, message: Some(message) }
    }

    /// Creates a record of a bare watermark published at `visible_at`.
    pub fn bare(visible_at: Time, watermark: Time) -> Self {
        Self { port: 0, visible_at, pass: 0, watermark, message: None }
    }

    /// Creates the record of a publication that an observer received.
    pub fn of(publication: &Publication<'_>) -> Self {
        let message = publication.stamp.zip(publication.payload).map(|(stamp, payload)| {
            let mut cbor = Vec::new();
            payload.to_cbor(&mut cbor);
            PlaybackMessage {
                stamp,
                reused_from: publication.reused_from,
                origin: publication.origin,
                payload: PlaybackPayload::cbor(cbor),
            }
        });
        Self {
            port: publication.port,
            visible_at: publication.visible_at,
            pass: publication.pass,
            watermark: publication.watermark,
            message,
        }
    }

    /// Checks that the payload has the type of its stream; keeps the decoded form of a small one.
    pub(crate) fn take_in(&mut self, expected: &PayloadType) -> Result<(), (Time, String)> {
        let Some(PlaybackMessage { payload: PlaybackPayload(kind), stamp, .. }) = &mut self.message else {
            return Ok(());
        };
        match kind {
            Kind::Ready(sent) if sent.type_id() != expected.id => {
                Err((*stamp, format!("expected {}, found {}", expected.full_name, sent.type_name())))
            }
            Kind::Ready(_) => Ok(()),
            Kind::Cbor(bytes) => {
                let made = (expected.decode)(bytes).map_err(|reason| (*stamp, reason))?;
                if bytes.len() <= SMALL {
                    *kind = Kind::Ready(made.into());
                }
                Ok(())
            }
        }
    }

    /// Payload in memory, decoded if necessary.
    pub(crate) fn payload(&self, decode: Decode) -> Option<Sent> {
        self.message.as_ref().map(|message| match &message.payload.0 {
            Kind::Ready(sent) => sent.clone(),
            Kind::Cbor(bytes) => {
                decode(bytes).expect("the graph decoded every record when it took them in").into()
            }
        })
    }
}
