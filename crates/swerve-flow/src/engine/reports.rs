//! Reports of sources and workers under wall clock, received at an instant.

use std::collections::VecDeque;

use swerve_core::{Span, Time};

use super::Engine;
use super::node::Outcome;
use crate::decision::{Decision, DropReason};
use crate::inbox::{Arrival, Report};
use crate::observer::Event;
use crate::playback::PlaybackRecord;

impl Engine<'_> {
    /// Passes a decision to the observers, if this run takes decisions.
    pub(crate) fn decide(&mut self, decision: impl FnOnce() -> Decision) {
        if self.wall.is_some() && !self.observers.is_empty() {
            self.tell(&Event::Decision(&decision()));
        }
    }

    /// True if nothing more can be reported: all sources are closed and no worker has a step.
    pub(crate) fn is_idle(&self) -> bool {
        let closed = |rank: &usize| self.streams[self.nodes[*rank].streams[0]].watermark == Time::MAX;
        let away = self.nodes.iter().flat_map(|node| &node.running);
        self.sources.iter().all(closed)
            && !away.into_iter().any(|run| matches!(run.outcome, Outcome::Away(_)))
    }

    /// Receives reports at the instant `now`.
    pub(crate) fn take_reports(&mut self, arrivals: VecDeque<Arrival>, now: Time) {
        self.now = now;
        for arrival in arrivals {
            let rank = self.rank_of[arrival.operator];
            let stream = self.nodes[rank].streams[0];
            let queued =
                self.nodes[rank].feed.as_ref().and_then(VecDeque::back).map(|record| record.watermark);
            let watermark = queued.unwrap_or(self.streams[stream].watermark);
            let record = match arrival.report {
                Report::Message(stamp, sent) => {
                    let stamp = stamp.unwrap_or(now.max(watermark.saturating_add(Span::from_ns(1))));
                    if stamp <= watermark {
                        self.drop_stamp(rank, stamp, DropReason::TooLate);
                        continue;
                    }
                    PlaybackRecord::sent(now, stamp, sent)
                }
                Report::Watermark(new) if new <= watermark => continue,
                Report::Watermark(new) => PlaybackRecord::bare(now, new),
            };
            let stamp = record.message.as_ref().map(|message| message.stamp);
            let operator = self.nodes[rank].name.clone();
            self.decide(|| Decision::Arrival { operator: operator.to_string(), stamp, at: now });
            self.nodes[rank].feed.as_mut().expect("only feeds have handles").push_back(record);
            self.ready.insert(rank);
        }
        let Some(pool) = &self.pool else { return };
        for (ticket, rank) in pool.finished() {
            let node = &mut self.nodes[rank];
            let away = |run: &&mut super::node::Run| matches!(run.outcome, Outcome::Away(t) if t == ticket);
            // A step that was reported before waits for its modelled end.
            if let Some(run) = node.running.iter_mut().find(away)
                && run.end == Time::MAX
            {
                run.end = now.max(run.least_end);
                let (stamp, run_time) = (run.stamp, run.end - run.start);
                let operator = node.name.clone();
                self.decide(|| Decision::RunTime { operator: operator.to_string(), stamp, run_time });
                self.rearm(rank);
            }
        }
    }
}
