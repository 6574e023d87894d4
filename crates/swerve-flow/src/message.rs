//! A message: what is said, and when.

use core::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Time};

use crate::payload::{Payload, Sent};

/// When a message describes the world, when it could be read, and where it comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// The instant that the message describes.
    pub stamp: Time,
    /// The instant at which it was published; its readers see it later by the stream's delay, if it has one.
    pub visible_at: Time,
    /// How many messages the stream carried before this one.
    pub seq: u64,
    /// The stream carries no later message with a stamp at or below this.
    pub watermark: Time,
    /// The stamp of the step that computed it, where a missed deadline had an older result repeated.
    pub reused_from: Option<Time>,
    /// The stamp of the newest sensor frame that it derives from.
    pub origin: Option<Time>,
}

/// One message as its reader sees it; dereferences to the payload, which all readers share.
#[derive(Debug)]
pub struct Message<T> {
    header: Header,
    value: Arc<T>,
    /// The payload's fingerprint.
    pub(crate) digest: Digest,
}

impl<T> Message<T> {
    /// Stamp, visibility and descent.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The payload, to be passed on without a copy.
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

/// A message inside the engine.
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
