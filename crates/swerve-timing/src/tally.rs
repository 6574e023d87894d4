//! Counts and run times of a run, in the few bytes per step that a run of hours allows.

use swerve_core::{Span, Time};
use swerve_flow::{DropReason, Event, Observer};

use super::pipeline::{Names, Pipeline};

/// Counts and run times of a run, as shown in the table.
#[derive(Clone, Debug)]
pub struct Tally<'a> {
    names: Names<'a>,
    /// Tally of each operator of the pipeline.
    pub operators: Vec<OperatorTally>,
}

/// Activity of one operator.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OperatorTally {
    /// Steps that started.
    pub steps: u64,
    /// Messages published.
    pub messages: u64,
    /// Messages among them that repeat an older result.
    pub repeats: u64,
    /// Deadlines missed.
    pub misses: u64,
    /// Frames and results dropped.
    pub drops: u64,
    /// Run times of the steps that ended, in the order of their ends.
    pub run_times: Vec<Span>,
    /// Response times, if the operator's messages are results: from the newest sensor frame that a message derives from
    /// to the message.
    pub responses: Vec<Span>,
    /// Time spent in steps within the span of the run.
    pub busy: Span,
    /// Stamps and starts of the steps that have not ended.
    running: Vec<(Time, Time)>,
}

impl<'a> Tally<'a> {
    /// Creates the tally of a run of this pipeline before it begins.
    pub(crate) fn new(pipeline: &'a Pipeline) -> Self {
        Self {
            names: Names::new(pipeline),
            operators: vec![OperatorTally::default(); pipeline.operators.len()],
        }
    }

    fn of(&mut self, operator: &str) -> &mut OperatorTally {
        &mut self.operators[self.names.index(operator)]
    }
}

impl Observer for Tally<'_> {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Publication(p) if p.stamp.is_none() => {}
            Event::Publication(p) => {
                let index = self.names.index(p.operator);
                let is_result = self.names.is_sink(index);
                let tally = &mut self.operators[index];
                tally.messages += 1;
                tally.repeats += u64::from(p.reused_from.is_some());
                tally.responses.extend(p.origin.filter(|_| is_result).map(|origin| p.visible_at - origin));
            }
            Event::StepStart(s) => {
                let tally = self.of(s.operator);
                tally.steps += 1;
                tally.running.push((s.stamp, s.at));
            }
            Event::StepEnd(s) => {
                let tally = self.of(s.operator);
                tally.running.retain(|running| *running != (s.stamp, s.start));
                tally.run_times.push(s.end - s.start);
                tally.busy += s.end - s.start;
            }
            Event::Miss(m) => self.of(m.operator).misses += 1,
            // A message that arrives too late opens no frame, so this operator loses nothing.
            Event::Drop(d) if d.reason == DropReason::TooLate => {}
            Event::Drop(d) => self.of(d.operator).drops += 1,
            Event::Decision(_) => {}
            Event::End(_) => {
                let end = Time::ZERO + self.names.pipeline.span;
                for tally in &mut self.operators {
                    tally.busy =
                        tally.running.iter().fold(tally.busy, |busy, (_, start)| busy + (end - *start));
                }
            }
        }
    }

    fn wants_host_time(&self) -> bool {
        false
    }
}
