//! A pipeline of black boxes: the contents of a timing file, checked and with all defaults filled in.

use swerve_core::Span;
use swerve_flow::{Deadline, Policy, RuntimeModel};

/// A pipeline whose operators compute nothing and take time.
#[derive(Clone, Debug, PartialEq)]
pub struct Pipeline {
    /// Duration of the run; events at its very end still happen.
    pub span: Span,
    /// Operators, in the order of the file.
    pub operators: Vec<BlackBox>,
    /// Resources that operators share, in the order of the file.
    pub resources: Vec<Resource>,
}

/// An operator of which only the timing is known; it publishes one message per frame on a stream with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackBox {
    /// Name of the operator and of its stream.
    pub name: String,
    /// Timer, if the operator has one.
    pub timer: Option<Timer>,
    /// Operators whose streams are joined by stamp: indices into [`Pipeline::operators`].
    pub at: Vec<usize>,
    /// Operators whose newest message is read.
    pub latest: Vec<usize>,
    /// As `latest`, through feedback edges.
    pub feedback: Vec<usize>,
    /// Run time of its steps.
    pub runtime: RuntimeModel,
    /// Handling of frames while the operator is busy.
    pub policy: Policy,
    /// Deadline for answering a stamp.
    pub deadline: Option<Deadline>,
    /// Resource that its steps occupy: index into [`Pipeline::resources`].
    pub uses: Option<usize>,
}

/// Ticks at `phase + k * period`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timer {
    /// Time between ticks; above zero.
    pub period: Span,
    /// Time of the first tick; not below zero.
    pub phase: Span,
}

/// Resource that at most `slots` steps use at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Resource {
    /// Name of the resource.
    pub name: String,
    /// Number of slots, at least one.
    pub slots: usize,
}

impl BlackBox {
    /// Inputs of the operator, in the order at, latest, feedback.
    pub fn inputs(&self) -> impl Iterator<Item = usize> {
        self.at.iter().chain(&self.latest).chain(&self.feedback).copied()
    }
}

impl Pipeline {
    /// True if no operator reads operator `i` except through feedback: its publications are results of the pipeline.
    pub fn is_sink(&self, i: usize) -> bool {
        !self.operators.iter().any(|op| op.at.contains(&i) || op.latest.contains(&i))
    }
}

/// Finds the operators of a pipeline by the names in a run's events.
#[derive(Clone, Debug)]
pub(crate) struct Names<'a> {
    pub(crate) pipeline: &'a Pipeline,
    sinks: Vec<bool>,
    last: usize,
}

impl<'a> Names<'a> {
    pub(crate) fn new(pipeline: &'a Pipeline) -> Self {
        let sinks = (0..pipeline.operators.len()).map(|i| pipeline.is_sink(i)).collect();
        Self { pipeline, sinks, last: 0 }
    }

    /// Returns the index of an operator. The search begins at the last one found, because events mostly follow in
    /// order.
    pub(crate) fn index(&mut self, name: &str) -> usize {
        let (before, from) = self.pipeline.operators.split_at(self.last);
        let is_it = |op: &BlackBox| op.name == name;
        let found = from.iter().position(is_it).map(|i| i + self.last);
        self.last =
            found.or_else(|| before.iter().position(is_it)).expect("the graph was made of these operators");
        self.last
    }

    /// As [`Pipeline::is_sink`].
    pub(crate) fn is_sink(&self, i: usize) -> bool {
        self.sinks[i]
    }
}
