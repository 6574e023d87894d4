//! Publishing: headers, the digest, and who is to be told.

use swerve_core::{Digest, Time};

use super::turn::Answer;
use super::{Engine, Event};
use crate::message::{Header, Msg};
use crate::observer::{Publication, Reads};
use crate::payload::{Outs, Sent};

impl Engine<'_> {
    /// Publishes the operator's answer for a stamp on those of its streams that have a message.
    pub(super) fn publish(&mut self, rank: usize, answer: &Answer<'_>, outs: &mut Outs) {
        let node = &mut self.nodes[rank];
        node.floor = answer.stamp;
        let watermark = node.watermark();
        for (port, sent) in outs.iter_mut().enumerate() {
            if let Some(sent) = sent.take() {
                self.publish_on(rank, port, watermark, answer, sent);
            }
        }
    }

    pub(super) fn publish_on(
        &mut self,
        rank: usize,
        port: usize,
        watermark: Time,
        answer: &Answer<'_>,
        sent: Sent,
    ) {
        let now = self.now;
        let node = &mut self.nodes[rank];
        node.tally.messages += 1;
        node.tally.repeats += u64::from(answer.reused_from.is_some());
        let id = node.streams[port];
        let stream = &mut self.streams[id];
        let header = Header {
            stamp: answer.stamp,
            visible_at: now,
            seq: stream.seq,
            watermark,
            reused_from: answer.reused_from,
            origin: answer.origin,
        };
        stream.seq += 1;
        stream.watermark = watermark;
        self.digest.bytes(&digested(stream.key, &header, sent.digest));
        if !self.observers.is_empty() {
            self.tell_publication(rank, port, &header, answer, &sent);
        }
        self.deliver(id, Some(Msg { header, sent }), watermark);
    }

    fn tell_publication(
        &mut self,
        rank: usize,
        port: usize,
        header: &Header,
        answer: &Answer<'_>,
        sent: &Sent,
    ) {
        let node = &self.nodes[rank];
        let (operator, names) = (node.name.clone(), node.reads.clone());
        let stream = self.streams[node.streams[port]].name.clone();
        // A feed has no record of what was read.
        let names = if answer.reads.len() == names.len() { &names[..] } else { &[] };
        self.tell(&Event::Publication(Publication {
            operator: &operator,
            stream: &stream,
            port,
            seq: header.seq,
            stamp: Some(header.stamp),
            watermark: header.watermark,
            visible_at: header.visible_at,
            pass: self.pass,
            reused_from: header.reused_from,
            origin: header.origin,
            reads: Reads { names, stamps: answer.reads },
            payload: Some(&*sent.payload),
        }));
    }

    /// (f) Publishes the operator's watermark where it rose without a message.
    pub(super) fn publish_watermark(&mut self, rank: usize) {
        let watermark = self.nodes[rank].watermark();
        for port in 0..self.nodes[rank].streams.len() {
            self.publish_risen(rank, port, watermark);
        }
    }

    /// Publishes `watermark` on one stream, where it is above what the stream carried last.
    pub(super) fn publish_risen(&mut self, rank: usize, port: usize, watermark: Time) {
        let stream = self.nodes[rank].streams[port];
        if self.streams[stream].watermark < watermark {
            self.publish_bare(rank, port, watermark, self.pass);
        }
    }

    pub(super) fn publish_bare(&mut self, rank: usize, port: usize, watermark: Time, pass: u32) {
        let node = &mut self.nodes[rank];
        node.tally.bare += 1;
        let id = node.streams[port];
        let stream = &mut self.streams[id];
        stream.watermark = watermark;
        if !self.observers.is_empty() {
            let operator = node.name.clone();
            let stream = self.streams[id].name.clone();
            let seq = self.streams[id].seq;
            self.tell(&Event::Publication(Publication {
                operator: &operator,
                stream: &stream,
                port,
                seq,
                stamp: None,
                watermark,
                visible_at: self.now,
                pass,
                reused_from: None,
                origin: None,
                reads: Reads::default(),
                payload: None,
            }));
        }
        self.deliver(id, None, watermark);
    }

    /// Hands a publication to the ports that read the stream.
    fn deliver(&mut self, id: usize, msg: Option<Msg>, watermark: Time) {
        let now = self.now;
        let stream = &mut self.streams[id];
        let arrival = now.saturating_add(stream.delay);
        let mut msg = msg;
        for (index, &(rank, port)) in stream.readers.iter().enumerate() {
            // The last one to be given the message takes it, where nobody looks into the stream's history.
            let last = stream.depth == 0 && index + 1 == stream.readers.len();
            let msg = if last { msg.take() } else { msg.clone() };
            let at = &mut self.nodes[rank].at[port];
            if arrival > now {
                at.pending.push_back((arrival, msg, watermark));
                self.due.set(rank, self.due.get(rank).min(arrival));
                continue;
            }
            at.watermark = watermark;
            if let Some(msg) = msg {
                at.fresh += 1;
                at.queue.push_back(msg);
            }
            self.ready.insert(rank);
        }
        if let Some(msg) = msg {
            stream.remember(msg, now);
        }
    }

    /// Publishes what a feed has for the present instant.
    pub(super) fn publish_feed(&mut self, rank: usize) {
        let (now, pass) = (self.now, self.pass);
        loop {
            let node = &mut self.nodes[rank];
            let Some(feed) = &mut node.feed else { return };
            if feed.front().is_none_or(|record| (record.visible_at, record.pass) > (now, pass)) {
                return;
            }
            let record = feed.pop_front().expect("just seen");
            let Some(message) = &record.message else {
                self.publish_bare(rank, record.port, record.watermark, pass);
                continue;
            };
            let decode = self.streams[self.nodes[rank].streams[record.port]].decode;
            let Some(sent) = record.payload(decode) else { continue };
            let (stamp, reused_from, origin) = (message.stamp, message.reused_from, message.origin);
            let answer = Answer { stamp, reused_from, origin, reads: &[] };
            self.publish_on(rank, record.port, record.watermark, &answer, sent);
        }
    }
}

/// What one message adds to the run's digest.
fn digested(stream: u64, header: &Header, payload: Digest) -> [u8; 32] {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&stream.to_le_bytes());
    bytes[8..16].copy_from_slice(&header.stamp.ns().to_le_bytes());
    bytes[16..24].copy_from_slice(&header.visible_at.ns().to_le_bytes());
    bytes[24..].copy_from_slice(&payload.0.to_le_bytes());
    bytes
}
