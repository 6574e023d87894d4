//! Description of a graph as plain data.

use serde::Serialize;
use swerve_core::Span;

use super::{BodySpec, Graph, OperatorSpec};
use crate::deadline::Length;
use crate::input::PortSpec;
use crate::stream::Edge;

/// Description of a graph: its operators in rank order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphInfo {
    /// Operators of the graph.
    pub operators: Vec<OperatorInfo>,
    /// Shared resources, with their numbers of slots.
    pub resources: Vec<(String, usize)>,
}

/// Description of one operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OperatorInfo {
    /// Name of the operator.
    pub name: String,
    /// Position in every sweep.
    pub rank: usize,
    /// Inputs of the operator.
    pub inputs: Vec<InputInfo>,
    /// Streams of the operator: name and payload type.
    pub outputs: Vec<(String, String)>,
    /// Run time model of its steps.
    pub runtime: String,
    /// Handling of frames that arrive while it is busy.
    pub policy: String,
    /// Deadline, if it has one.
    pub deadline: Option<String>,
    /// Resource that its steps need.
    pub uses: Option<String>,
    /// Delay of its streams, in nanoseconds.
    pub delay_ns: i64,
    /// True if its messages derive from their own stamp.
    pub origin: bool,
    /// True if worker threads can execute its steps.
    pub heavy: bool,
    /// True if it publishes external reports: a source, or the records of an earlier run.
    pub feed: bool,
}

/// One input of an operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InputInfo {
    /// Read mode of the input.
    pub kind: InputKind,
    /// Stream that it reads; `None` for a timer.
    pub stream: Option<String>,
    /// Operator that publishes the stream.
    pub from: Option<String>,
}

/// Read mode of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum InputKind {
    /// The message with the frame's stamp.
    At,
    /// The newest messages, up to `depth`.
    Latest {
        /// Maximum number of messages.
        depth: usize,
        /// True if read over a feedback edge.
        feedback: bool,
    },
    /// A timer.
    Every {
        /// Time from tick to tick, in nanoseconds.
        period_ns: i64,
        /// Time of the first tick, in nanoseconds.
        phase_ns: i64,
    },
}

pub(super) fn describe(graph: &Graph, order: &[usize]) -> GraphInfo {
    let operators = order.iter().enumerate();
    let operators =
        operators.map(|(rank, index)| operator_info(graph, rank, &graph.operators[*index])).collect();
    let resources = graph.resources.iter().map(|resource| (resource.name.clone(), resource.slots)).collect();
    GraphInfo { operators, resources }
}

fn operator_info(graph: &Graph, rank: usize, operator: &OperatorSpec) -> OperatorInfo {
    let outputs = operator.streams.iter().map(|id| &graph.streams[*id]);
    OperatorInfo {
        name: operator.name.to_string(),
        rank,
        inputs: operator.ports.iter().map(|port| input_info(graph, port)).collect(),
        outputs: outputs.map(|stream| (stream.name.to_string(), stream.payload.name())).collect(),
        runtime: operator.runtime.to_string(),
        policy: operator.policy.to_string(),
        deadline: operator.deadline.map(|deadline| {
            let length = match deadline.length {
                Length::Static(length) => length.to_string(),
                Length::Policy(edge, before) => {
                    let stream = graph.stream_of(edge).map_or("", |id| &graph.streams[id].name);
                    format!("by `{stream}` ({before} before)")
                }
            };
            format!("{length} from {}, then {}", deadline.anchor, deadline.reaction)
        }),
        uses: operator.uses.map(|id| graph.resources[id].name.clone()),
        delay_ns: operator.delay.max(Span::ZERO).ns(),
        origin: operator.origin,
        heavy: operator.heavy,
        feed: matches!(operator.body, BodySpec::Feed(_)),
    }
}

fn input_info(graph: &Graph, port: &PortSpec) -> InputInfo {
    let (kind, edge) = match *port {
        PortSpec::At(id) => (InputKind::At, Some(Edge::Stream(id))),
        PortSpec::Latest { edge, depth, .. } => {
            (InputKind::Latest { depth, feedback: matches!(edge, Edge::Feedback(_)) }, Some(edge))
        }
        PortSpec::Timer(timer) => {
            (InputKind::Every { period_ns: timer.period.ns(), phase_ns: timer.phase.ns() }, None)
        }
    };
    let stream = edge.and_then(|edge| graph.stream_of(edge)).map(|id| &graph.streams[id]);
    InputInfo {
        kind,
        stream: stream.map(|stream| stream.name.to_string()),
        from: stream.map(|stream| graph.operators[stream.producer].name.to_string()),
    }
}
