//! What a search finds, and what it asks of that.

use super::motion::{Hints, Motion};
use super::search::Task;

/// The answer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Candidate {
    /// Its motion.
    pub motion: Motion,
    /// Its whole cost.
    pub cost: f64,
    /// Offset at its end, metres.
    pub d_m: f64,
    /// Speed at its end, m/s.
    pub v_mps: f64,
    /// Time of its end, seconds.
    pub t_s: f64,
    /// Until when it is driven: its end, or the last sample before the line's end, seconds.
    pub last_s: f64,
}

/// A candidate with the parts of its cost that do not depend on obstacles.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Priced {
    /// The candidate.
    pub candidate: Candidate,
    /// Its lateral part.
    pub lateral: f64,
    /// Its longitudinal part.
    pub longitudinal: f64,
}

/// How a search ended.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Outcome {
    /// The cheapest valid candidate.
    Found(Candidate),
    /// No candidate is valid.
    Nothing,
    /// The budget was used up before.
    Stopped,
}

impl Outcome {
    /// The candidate, if there is one.
    pub fn found(self) -> Option<Candidate> {
        if let Self::Found(candidate) = self { Some(candidate) } else { None }
    }
}

/// What a candidate has to hold.
pub trait Judge {
    /// Whether it is sure to fail, where one before it did: a short look, which may let pass what fails.
    fn fails_too(&mut self, candidate: &Candidate) -> bool;

    /// Whether it holds all.
    fn holds(&mut self, candidate: &Candidate) -> bool;
}

/// The checks of a task, with where candidates hit something.
pub(super) struct TaskChecks<'a> {
    task: &'a Task<'a>,
    hints: Hints,
}

impl<'a> TaskChecks<'a> {
    pub(super) fn new(task: &'a Task<'a>) -> Self {
        Self { task, hints: Hints::default() }
    }
}

impl Judge for TaskChecks<'_> {
    fn fails_too(&mut self, candidate: &Candidate) -> bool {
        let Task { checks, line, .. } = self.task;
        checks.fails_too(line, &candidate.motion, candidate.last_s, &self.hints)
    }

    fn holds(&mut self, candidate: &Candidate) -> bool {
        self.task.checks.hold(self.task.line, &candidate.motion, candidate.last_s, &mut self.hints)
    }
}
