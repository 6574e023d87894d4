//! What a run of a pipeline did, as the JSON, the chart and the page need it.

use swerve_core::Time;
use swerve_flow::{DropReason, Event, RunReport};

use super::pipeline::Names;

/// Everything that a run did, in commit order.
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
    /// What the engine counted.
    pub report: Option<RunReport>,
}

/// One publication; operators are indices into [`Pipeline::operators`](super::Pipeline::operators).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Publication {
    /// Who published it.
    pub operator: usize,
    /// The instant that it describes; none for a bare watermark.
    pub stamp: Option<Time>,
    /// No later message of this operator has a stamp at or below it.
    pub watermark: Time,
    /// When it was published.
    pub visible_at: Time,
    /// The stamp of the step that computed it, in a repeat.
    pub reused_from: Option<Time>,
    /// The stamp of the newest sensor message that it derives from.
    pub origin: Option<Time>,
    /// The stamps read by the step that computed it, in the order of [`inputs`](super::BlackBox::inputs);
    /// empty for a bare watermark.
    pub reads: Vec<Option<Time>>,
}

/// One step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Whose step.
    pub operator: usize,
    /// For which stamp.
    pub stamp: Time,
    /// When it started.
    pub start: Time,
    /// Its modelled end; none when the run was over before.
    pub end: Option<Time>,
    /// Its result was of no use: the stamp was answered already.
    pub late: bool,
}

/// Something that happened to a stamp at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// To whose stamp.
    pub operator: usize,
    /// To which stamp.
    pub stamp: Time,
    /// When.
    pub at: Time,
}

impl Trace {
    /// Notes one event of a run.
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
            // A message that comes too late opens no frame: nothing of this operator is lost by it.
            Event::Drop(d) if d.reason == DropReason::TooLate => {}
            Event::Drop(d) => self.drops.push(Mark { operator: index(d.operator), stamp: d.stamp, at: d.at }),
            Event::Decision(_) => {}
            Event::End(report) => self.report = Some((*report).clone()),
        }
    }
}
