//! Ladders of operators, and the schedules that have them.

use swerve_core::Span;
use toml::Table;

/// Rungs that the steps of an operator choose from: the finest one that meets the deadline, the fastest if none does.
#[derive(Clone, PartialEq, Debug)]
pub struct Ladder {
    /// The rungs, the fastest first. Without rungs the operator has the output for them, which stays silent.
    pub rungs: Vec<Rung>,
    /// True if they set the run time of a step.
    pub sets_run_time: bool,
}

/// A variant of an operator.
#[derive(Clone, PartialEq, Debug)]
pub struct Rung {
    /// Name.
    pub name: String,
    /// Run time of a step.
    pub run_time: Span,
    /// Keys of its kind that differ from those of the operator.
    pub keys: Table,
}

/// Schedule of an operator.
#[derive(Clone, Default)]
pub(crate) struct Schedule {
    /// Period of its timer; `None` if it steps when its input arrives.
    pub(crate) period: Option<Span>,
    /// Constant deadline by `execution.model`.
    pub(crate) deadline: Option<Span>,
    pub(crate) ladder: Option<Ladder>,
}

impl Schedule {
    /// Rungs to build the operator for; `None` for an operator without rungs.
    pub(crate) fn rungs(&self) -> Vec<Option<&Rung>> {
        let rungs = self.ladder.as_ref().map_or(&[][..], |ladder| &ladder.rungs);
        if rungs.is_empty() { vec![None] } else { rungs.iter().map(Some).collect() }
    }
}

/// Output for the rung that a step took.
pub(crate) const RUNG: &str = "rung";
