//! Result of a search, and the conditions it checks.

use super::motion::{Hints, Motion};
use super::task::Task;

/// A candidate motion.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Candidate {
    /// Motion.
    pub motion: Motion,
    /// Total cost.
    pub cost: f64,
    /// End offset, metres.
    pub d_m: f64,
    /// End speed, m/s.
    pub v_mps: f64,
    /// End time, seconds.
    pub t_s: f64,
    /// Time until which it is driven: its end, or the last sample before the line's end, seconds.
    pub last_s: f64,
}

/// A candidate with the parts of its cost that do not depend on obstacles.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Priced {
    /// The candidate.
    pub candidate: Candidate,
    /// Lateral part of the cost.
    pub lateral: f64,
    /// Longitudinal part of the cost.
    pub longitudinal: f64,
}

/// Outcome of a search.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Outcome {
    /// The cheapest valid candidate.
    Found(Candidate),
    /// No candidate is valid.
    Nothing,
    /// The budget was used up before the search was complete.
    Stopped,
}

impl Outcome {
    /// The candidate, if there is one.
    pub fn found(self) -> Option<Candidate> {
        if let Self::Found(candidate) = self { Some(candidate) } else { None }
    }
}

/// Conditions on a candidate.
pub trait Judge {
    /// Returns true if the candidate certainly fails where an earlier one did: a quick check that may pass candidates
    /// that fail.
    fn fails_too(&mut self, candidate: &Candidate) -> bool;

    /// Returns true if the candidate satisfies all conditions.
    fn holds(&mut self, candidate: &Candidate) -> bool;
}

/// Checks of a task, with the places where candidates collide.
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
