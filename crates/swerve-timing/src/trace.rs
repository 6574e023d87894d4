//! Events of a pipeline's run, as needed by the JSON, the chart and the page.

use swerve_core::Time;
use swerve_flow::{DropReason, Event, RunReport};

use super::pipeline::Names;

/// All events of a run, in commit order.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Messages and bare watermarks.
    pub publications: Vec<Publication>,
    /// Steps, in the order of their starts.
    pub steps: Vec<Step>,
    /// Deadlines missed.
    pub misses: Vec<Mark>,
    /// Frames and results dropped.
    pub drops: Vec<Mark>,
    /// Report of the engine, once the run has ended.
    pub report: Option<RunReport>,
}

/// One publication; operators are indices into [`Pipeline::operators`](super::Pipeline::operators).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Publication {
    /// Operator that published it.
    pub operator: usize,
    /// Instant that it describes; `None` for a bare watermark.
    pub stamp: Option<Time>,
    /// No later message of this operator has a stamp at or below it.
    pub watermark: Time,
    /// Time of publication.
    pub visible_at: Time,
    /// Stamp of the step that computed it, if it is a repeat.
    pub reused_from: Option<Time>,
    /// Stamp of the newest sensor message that it derives from.
    pub origin: Option<Time>,
    /// Stamps read by the step that computed it, in the order of [`inputs`](super::BlackBox::inputs); empty for a bare
    /// watermark.
    pub reads: Vec<Option<Time>>,
}

/// One step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Operator that executed it.
    pub operator: usize,
    /// Stamp that it was for.
    pub stamp: Time,
    /// Start time.
    pub start: Time,
    /// Modelled end; `None` if the run ended before.
    pub end: Option<Time>,
    /// True if its result was of no use because the stamp had already been answered.
    pub late: bool,
}

/// A miss or a drop of a stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Operator that it belongs to.
    pub operator: usize,
    /// Stamp that was missed or dropped.
    pub stamp: Time,
    /// Time of the miss or drop.
    pub at: Time,
}

impl Trace {
    /// Records one event of a run.
    pub(crate) fn note(&mut self, names: &mut Names<'_>, event: &Event<'_>) {
        let mut index = |name: &str| names.index(name);
        match event {
            Event::Publication(p) => self.publications.push(Publication {
                operator: index(p.operator),
                stamp: p.stamp,
                watermark: p.watermark,
                visible_at: p.visible_at,
                reused_from: p.reused_from,
                origin: p.origin,
                reads: p.stamp.map_or_else(Vec::new, |_| p.reads.iter().map(|(_, stamp)| stamp).collect()),
            }),
            Event::StepStart(s) => self.steps.push(Step {
                operator: index(s.operator),
                stamp: s.stamp,
                start: s.at,
                end: None,
                late: false,
            }),
            Event::StepEnd(s) => {
                let operator = index(s.operator);
                let ended = |step: &&mut Step| step.operator == operator && step.stamp == s.stamp;
                let step = self.steps.iter_mut().rev().find(ended).expect("a step starts before it ends");
                step.end = Some(s.end);
                step.late = s.late;
            }
            Event::Miss(m) => {
                self.misses.push(Mark { operator: index(m.operator), stamp: m.stamp, at: m.at })
            }
            // A message that arrives too late opens no frame, so this operator loses nothing.
            Event::Drop(d) if d.reason == DropReason::TooLate => {}
            Event::Drop(d) => self.drops.push(Mark { operator: index(d.operator), stamp: d.stamp, at: d.at }),
            Event::Decision(_) => {}
            Event::End(report) => self.report = Some((*report).clone()),
        }
    }
}
