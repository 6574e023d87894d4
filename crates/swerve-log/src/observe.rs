//! Observers that write engine events to logs and traces.

use std::io::Write;

use swerve_flow::{Decision, EndReason, Event, Observer, Publication, RunReport, cbor};

use crate::batch::left_out;
use crate::record::{
    DropRecord, FAILED, MessageHeader, MissRecord, RunEnd, StepRecord, StreamInfo, UnfinishedRecord,
    WatermarkRecord, reaction_name, reason_name,
};
use crate::{Recorder, TraceWriter};

impl Observer for Recorder {
    fn event(&mut self, event: &Event<'_>) {
        // Views of the end are logged before the end itself.
        self.show_event(event);
        match event {
            Event::Publication(publication) => self.publication(publication),
            Event::StepStart(e) => {
                let (operator, stamp, start) = (e.operator, e.stamp, e.at);
                self.step_started(&UnfinishedRecord { operator, stamp, start });
            }
            Event::StepEnd(e) => self.step(StepRecord {
                operator: e.operator,
                stamp: e.stamp,
                start: e.start,
                end: e.end,
                units: e.units,
                host_ns: e.host_ns,
                late: e.late,
            }),
            Event::Miss(e) => self.miss(MissRecord {
                operator: e.operator,
                stamp: e.stamp,
                deadline: e.deadline,
                at: e.at,
                reaction: reaction_name(e.reaction),
                started: e.started,
            }),
            Event::Drop(e) => self.dropped(DropRecord {
                operator: e.operator,
                stamp: e.stamp,
                at: e.at,
                reason: reason_name(e.reason),
            }),
            Event::Decision(decision) => self.decided(decision),
            Event::End(report) => self.end(run_end(report)),
        }
    }
}

impl Recorder {
    fn publication(&mut self, p: &Publication<'_>) {
        let (Some(stamp), Some(payload)) = (p.stamp, p.payload) else {
            return self.watermark(WatermarkRecord {
                stream: p.stream,
                operator: p.operator,
                port: p.port,
                watermark: p.watermark,
                visible_at: p.visible_at,
                pass: p.pass,
                seq: p.seq,
            });
        };
        let header = MessageHeader {
            stamp,
            watermark: p.watermark,
            visible_at: p.visible_at,
            pass: p.pass,
            seq: p.seq,
            reused_from: p.reused_from,
            origin: p.origin,
        };
        let info = || StreamInfo {
            stream: p.stream.into(),
            operator: p.operator.into(),
            port: p.port,
            type_name: payload.type_name().into(),
            form: payload.cddl(),
        };
        if payload.is_promised() {
            return self.promised(p.stream, info, header, payload);
        }
        let leaves_out = self.leaves_out(payload);
        self.message(p.stream, info, header, |out| {
            if leaves_out { left_out(payload, out) } else { payload.to_cbor(out) }
        });
    }

    fn decided(&mut self, decision: &Decision) {
        let at = match decision {
            Decision::Arrival { at, .. }
            | Decision::Deadline { at, .. }
            | Decision::Drop { at, .. }
            | Decision::End { at } => *at,
            Decision::Begin { .. }
            | Decision::RunTime { .. }
            | Decision::Stop { .. }
            | Decision::Lost { .. }
            | Decision::Restarted { .. } => self.now(),
        };
        self.decision(at, |out| cbor::write(decision, out));
    }
}

impl<W: Write + Send> Observer for TraceWriter<W> {
    fn event(&mut self, event: &Event<'_>) {
        self.take(event);
    }
}

fn run_end(report: &RunReport) -> RunEnd {
    let reason = match &report.end {
        EndReason::Until => "until".into(),
        EndReason::Stopped(by) => format!("stopped by {by}"),
        EndReason::Idle => "idle".into(),
        EndReason::Interrupted => "interrupted".into(),
        EndReason::Failed(why) => format!("{FAILED}{why}"),
    };
    let text = serde_json::to_string(report).expect("a report is plain data");
    RunEnd { digest: report.digest, at: report.at, reason, report: text }
}

#[cfg(test)]
mod tests;
