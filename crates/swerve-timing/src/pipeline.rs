//! A pipeline of black boxes: what a timing file says, checked and with every default spelled out.

use swerve_core::Span;
use swerve_flow::{Deadline, Policy, RuntimeModel};

/// A pipeline whose operators compute nothing and take time.
#[derive(Clone, Debug, PartialEq)]
pub struct Pipeline {
    /// How long to run it; events at its very end still happen.
    pub span: Span,
    /// The operators, in the order of the file.
    pub operators: Vec<BlackBox>,
    /// The resources that operators share, in the order of the file.
    pub resources: Vec<Resource>,
}

/// An operator of which only the timing is known; it publishes one message per frame on a stream of its own name.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackBox {
    /// Its name, and that of its stream.
    pub name: String,
    /// Its timer, if it has one.
    pub timer: Option<Timer>,
    /// Operators whose streams are joined by stamp: indices into [`Pipeline::operators`].
    pub at: Vec<usize>,
    /// Operators of which the newest message is read.
    pub latest: Vec<usize>,
    /// As `latest`, through a feedback edge.
    pub feedback: Vec<usize>,
    /// How long its steps take.
    pub runtime: RuntimeModel,
    /// What happens to frames while it is busy.
    pub policy: Policy,
    /// Until when a stamp has to be answered.
    pub deadline: Option<Deadline>,
    /// The resource that its steps occupy: index into [`Pipeline::resources`].
    pub uses: Option<usize>,
}

/// Ticks at `phase + k * period`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timer {
    /// From tick to tick; above zero.
    pub period: Span,
    /// The first tick; not below zero.
    pub phase: Span,
}

/// Something that at most `slots` steps use at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Resource {
    /// Its name.
    pub name: String,
    /// At least one.
    pub slots: usize,
}

impl BlackBox {
    /// Every input that it reads, in the order at, latest, feedback.
    pub fn inputs(&self) -> impl Iterator<Item = usize> {
        self.at.iter().chain(&self.latest).chain(&self.feedback).copied()
    }
}

impl Pipeline {
    /// Whether nobody reads operator `i`, except through feedback: what it publishes is a result of the pipeline.
    pub fn is_sink(&self, i: usize) -> bool {
        !self.operators.iter().any(|op| op.at.contains(&i) || op.latest.contains(&i))
    }
}

/// Finds the operators of a pipeline by the names that a run tells of them.
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

    /// The index of the operator, looked for from the last one on: a run tells of one after the other.
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
