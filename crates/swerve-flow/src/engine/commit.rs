//! Publishing: headers, and delivery to observers and readers.

use swerve_core::Time;

use super::answer::Answer;
use super::due::{Due, Ready};
use super::node::{Node, Reader, StreamState};
use super::{Engine, Event, tell};
use crate::message::Msg;
use crate::observer::{Publication, Reads};
use crate::sent::{Outs, Sent};

impl Engine<'_> {
    /// Publishes the operator's answer for a stamp on those of its streams that have a message.
    pub(super) fn publish(&mut self, rank: usize, answer: &Answer<'_>, outs: &mut Outs) {
        let node = &mut self.nodes[rank];
        node.floor = answer.stamp;
        let watermark = node.watermark();
        self.publish_with(rank, watermark, answer, outs);
    }

    /// As [`publish`](Self::publish), with a watermark that is known to be the operator's.
    #[inline]
    pub(super) fn publish_with(
        &mut self,
        rank: usize,
        watermark: Time,
        answer: &Answer<'_>,
        outs: &mut Outs,
    ) {
        if let Some(sent) = outs.take_first() {
            self.publish_on(rank, 0, watermark, answer, sent);
        }
        if outs.is_empty() {
            return;
        }
        for (port, sent) in outs.take_others() {
            self.publish_on(rank, port, watermark, answer, sent);
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
        let stream = &mut self.streams[node.streams[port]];
        let msg = Msg { header: stream.next_header(now, watermark, answer), sent };
        self.digest.message(stream.key, &msg.header, &msg.sent);
        if !self.observers.is_empty() {
            let publication = publication(node, port, stream, &msg, answer, self.pass);
            tell(&mut self.observers, &Event::Publication(publication));
        }
        // Delivered to the ports that read the stream.
        if stream.depth > 0 {
            stream.remember(msg.clone(), now);
        }
        let Some((&last, others)) = stream.readers.split_last() else { return };
        let arrival = now.saturating_add(stream.delay);
        let (nodes, due, ready) = (&mut self.nodes, &mut self.due, &mut self.ready);
        for &reader in others {
            hand_over(nodes, due, ready, reader, arrival, now, msg.clone());
        }
        // The last reader takes the message itself: most streams have one reader.
        hand_over(nodes, due, ready, last, arrival, now, msg);
    }

    /// (f) Publishes the operator's watermark if it rose without a message.
    pub(super) fn publish_watermark(&mut self, rank: usize) {
        let watermark = self.nodes[rank].watermark();
        for port in 0..self.nodes[rank].streams.len() {
            self.publish_risen(rank, port, watermark);
        }
    }

    /// Publishes `watermark` on one stream, if it is above the stream's last watermark.
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
            let publication = Publication {
                operator: &node.name,
                stream: &stream.name,
                port,
                seq: stream.seq,
                stamp: None,
                watermark,
                visible_at: self.now,
                pass,
                reused_from: None,
                origin: None,
                reads: Reads::default(),
                payload: None,
            };
            tell(&mut self.observers, &Event::Publication(publication));
        }
        self.deliver_bare(id, watermark);
    }

    /// Delivers a bare watermark to the ports that read the stream.
    fn deliver_bare(&mut self, id: usize, watermark: Time) {
        let now = self.now;
        let stream = &self.streams[id];
        let arrival = now.saturating_add(stream.delay);
        for &Reader { rank, port } in &stream.readers {
            let at = &mut self.nodes[rank].at[port];
            if arrival > now {
                at.pending.push_back((arrival, None, watermark));
                self.due.set(rank, self.due.get(rank).min(arrival));
            } else {
                at.watermark = watermark;
                self.ready.insert(rank);
            }
        }
    }

    /// Publishes the records of a feed for the current instant.
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

/// Builds the event of a message for the observers.
#[inline(always)]
fn publication<'a>(
    node: &'a Node,
    port: usize,
    stream: &'a StreamState,
    Msg { header, sent }: &'a Msg,
    answer: &Answer<'a>,
    pass: u32,
) -> Publication<'a> {
    // A feed has no record of the inputs.
    let names = if answer.reads.len() == node.reads.len() { &node.reads[..] } else { &[] };
    Publication {
        operator: &node.name,
        stream: &stream.name,
        port,
        seq: header.seq,
        stamp: Some(header.stamp),
        watermark: header.watermark,
        visible_at: header.visible_at,
        pass,
        reused_from: header.reused_from,
        origin: header.origin,
        reads: Reads { names, stamps: answer.reads },
        payload: Some(sent),
    }
}

/// Delivers a message to one port: now, or on its arrival if the stream is delayed.
#[inline(always)]
fn hand_over(
    nodes: &mut [Node],
    due: &mut Due,
    ready: &mut Ready,
    Reader { rank, port }: Reader,
    arrival: Time,
    now: Time,
    msg: Msg,
) {
    let at = &mut nodes[rank].at[port];
    if arrival > now {
        let watermark = msg.header.watermark;
        at.pending.push_back((arrival, Some(msg), watermark));
        due.set(rank, due.get(rank).min(arrival));
    } else {
        at.watermark = msg.header.watermark;
        at.fresh += 1;
        at.queue.push_back(msg);
        ready.insert(rank);
    }
}
