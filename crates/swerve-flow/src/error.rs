//! Errors of graphs.

use swerve_core::Time;
use thiserror::Error;

/// An error in a graph.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum GraphError {
    /// Operators wait for each other in a cycle.
    #[error("cycle without a feedback edge: {}", operators.join(" -> "))]
    Cycle {
        /// The cycle, in which each operator reads the one before it; the first is repeated at the end.
        operators: Vec<String>,
    },
    /// Two operators or streams share a name.
    #[error("the name `{name}` is used twice")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// A feedback edge was not connected to a stream.
    #[error("feedback edge `{feedback}`, read by {}, is connected to no stream", readers.join(", "))]
    Unconnected {
        /// Name of the edge.
        feedback: String,
        /// Operators that read it.
        readers: Vec<String>,
    },
    /// A feedback edge was connected twice.
    #[error("feedback edge `{feedback}` is connected twice")]
    FeedbackTwice {
        /// Name of the edge.
        feedback: String,
    },
    /// A feedback edge was connected to a stream of another type.
    #[error("feedback edge `{feedback}`: expected a stream of `{expected}`, found {found}")]
    FeedbackType {
        /// Name of the edge.
        feedback: String,
        /// Type of its messages.
        expected: String,
        /// Stream that was found, with its type.
        found: String,
    },
    /// A port was connected to a source that it cannot read.
    #[error("operator `{operator}`, port `{port}`: expected {expected}, found {found}")]
    Wire {
        /// Name of the operator.
        operator: String,
        /// Name of the port.
        port: String,
        /// Sources that the port accepts.
        expected: String,
        /// Source that was found.
        found: String,
    },
    /// An operator was connected to a stream, edge or resource of another graph.
    #[error("operator `{operator}` was given a handle of another graph")]
    ForeignHandle {
        /// Name of the operator.
        operator: String,
    },
    /// The operator has no input that would trigger it.
    #[error("operator `{operator}` has no synchronised input: give it an `At` or an `Every` port")]
    NeverFires {
        /// Name of the operator.
        operator: String,
    },
    /// A number is invalid.
    #[error("operator `{operator}`: {reason}")]
    Value {
        /// Name of the operator.
        operator: String,
        /// Reason why the number is invalid.
        reason: &'static str,
    },
    /// A resource without slots.
    #[error("resource `{resource}` has no slot, so {} would never start", users.join(", "))]
    NoSlots {
        /// Name of the resource.
        resource: String,
        /// Operators that use it.
        users: Vec<String>,
    },
    /// No operator has this name.
    #[error("there is no operator `{operator}`")]
    UnknownOperator {
        /// The name.
        operator: String,
    },
    /// A recorded publication names an output that the operator does not have.
    #[error("operator `{operator}` has no output {port}, but a record was published there")]
    PlaybackPort {
        /// Name of the operator.
        operator: String,
        /// Index of the output.
        port: usize,
    },
    /// A recorded payload is not of the stream's type.
    #[error("operator `{operator}`, record of stamp {at}: {reason}")]
    PlaybackPayload {
        /// Name of the operator.
        operator: String,
        /// Stamp of the record.
        at: Time,
        /// Reason why the payload does not fit.
        reason: String,
    },
}
