//! Digest of a run.

use std::collections::VecDeque;
use std::sync::Arc;

use swerve_core::{Digest, Hasher};

use crate::message::Header;
use crate::pending::Pending;
use crate::sent::Sent;

/// Digest of the run, which hashes messages in batches.
pub(super) struct Commits {
    hasher: Hasher,
    /// Messages to be hashed: stream, stamp, visible_at and payload of each.
    waiting: Vec<[u8; 32]>,
    /// Number of waiting messages at which they are hashed.
    enough: usize,
    /// Messages whose payload has not been made yet, and their positions in `waiting`.
    promised: VecDeque<(usize, Arc<Pending>)>,
    /// A broken promise.
    pub(super) broken: Option<Arc<Pending>>,
}

/// Number of messages hashed at a time.
const HASHED: usize = 512;

/// Maximum number of messages that wait behind an unfinished payload, before the engine waits for it.
const WAITING_MAX: usize = 8192;

impl Commits {
    pub(super) fn new() -> Self {
        let waiting = Vec::with_capacity(HASHED);
        let promised = VecDeque::new();
        Self { hasher: Hasher::new(), waiting, enough: HASHED, promised, broken: None }
    }

    #[inline]
    pub(super) fn message(&mut self, stream: u64, header: &Header, sent: &Sent) {
        self.take_made(false);
        if self.waiting.len() >= self.enough {
            self.make_room();
        }
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&stream.to_le_bytes());
        bytes[8..16].copy_from_slice(&header.stamp.ns().to_le_bytes());
        bytes[16..24].copy_from_slice(&header.visible_at.ns().to_le_bytes());
        match sent.promised() {
            None => bytes[24..].copy_from_slice(&sent.digest().0.to_le_bytes()),
            Some(promised) => self.promised.push_back((self.waiting.len(), promised.clone())),
        }
        self.waiting.push(bytes);
    }

    /// Hashes the messages before the first unfinished payload; all messages, once too many wait.
    #[inline(never)]
    fn make_room(&mut self) {
        self.take_made(self.waiting.len() >= WAITING_MAX);
        let made = self.promised.front().map_or(self.waiting.len(), |(at, _)| *at);
        self.hasher.bytes(self.waiting[..made].as_flattened());
        self.waiting.drain(..made);
        self.promised.iter_mut().for_each(|(at, _)| *at -= made);
        self.enough = self.waiting.len() + HASHED;
    }

    /// Adds the digests of payloads made meanwhile, in order, or waits for all payloads, and releases them.
    fn take_made(&mut self, all: bool) {
        while self.promised.front().is_some_and(|(_, promised)| all || promised.is_settled()) {
            let Some((at, promised)) = self.promised.pop_front() else { return };
            match promised.wait() {
                Ok(made) => self.waiting[at][24..].copy_from_slice(&made.digest.0.to_le_bytes()),
                Err(_) => self.broken = Some(promised),
            }
        }
    }

    /// Digest of all messages so far.
    pub(super) fn digest(&mut self) -> Digest {
        self.take_made(true);
        self.make_room();
        self.hasher.digest()
    }
}
