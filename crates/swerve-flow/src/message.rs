//! A message: payload and header.

use core::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Time};

use crate::payload::Payload;
use crate::sent::Sent;

/// Header of a message: the instant that it describes, when it was published, and its origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Instant that the message describes.
    pub stamp: Time,
    /// Instant of publication; readers see the message later by the stream's delay, if it has one.
    pub visible_at: Time,
    /// Number of messages on the stream before this one.
    pub seq: u64,
    /// The stream carries no later message with a stamp at or below this.
    pub watermark: Time,
    /// Stamp of the step that computed the payload, if a missed deadline repeated an older result.
    pub reused_from: Option<Time>,
    /// Stamp of the newest sensor frame that the message derives from.
    pub origin: Option<Time>,
}

/// A message as seen by a reader; dereferences to the payload, which all readers share.
#[derive(Debug)]
pub struct Message<T> {
    header: Header,
    value: Arc<T>,
    /// Digest of the payload.
    pub(crate) digest: Digest,
}

impl<T> Message<T> {
    /// Stamp, visibility and origin.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Payload, to be passed on without a copy.
    pub fn shared(&self) -> Arc<T> {
        self.value.clone()
    }
}

impl<T> Clone for Message<T> {
    fn clone(&self) -> Self {
        Self { header: self.header, value: self.value.clone(), digest: self.digest }
    }
}

impl<T> Deref for Message<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

/// A message inside the engine, with its type erased.
#[derive(Clone)]
pub(crate) struct Msg {
    pub(crate) header: Header,
    pub(crate) sent: Sent,
}

impl Msg {
    #[inline]
    pub(crate) fn typed<T: Payload>(self) -> Message<T> {
        let (value, digest) = self.sent.typed();
        Message { header: self.header, value, digest }
    }
}
