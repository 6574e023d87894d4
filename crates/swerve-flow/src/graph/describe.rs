//! What a graph consists of, as plain data.

use serde::Serialize;
use swerve_core::Span;

use super::{BodySpec, Graph, OperatorSpec};
use crate::deadline::Length;
use crate::input::{Edge, PortSpec};

/// What a graph consists of: operators in rank order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphInfo {
    /// The operators.
    pub operators: Vec<OperatorInfo>,
    /// The shared resources, with their slots.
    pub resources: Vec<(String, usize)>,
}

/// One operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OperatorInfo {
    /// Its name.
    pub name: String,
    /// Its place in every sweep.
    pub rank: usize,
    /// Its inputs.
    pub inputs: Vec<InputInfo>,
    /// Its streams: name and payload type.
    pub outputs: Vec<(String, String)>,
    /// How long its steps take.
    pub runtime: String,
    /// What happens to frames that find it busy.
    pub policy: String,
    /// Its deadline.
    pub deadline: Option<String>,
    /// The resource that its steps need.
    pub uses: Option<String>,
    /// The delay of its streams, in nanoseconds.
    pub delay_ns: i64,
    /// Whether its messages derive from their own stamp.
    pub origin: bool,
    /// Whether its steps are worth a worker thread.
    pub heavy: bool,
    /// Whether it publishes what is reported to it: a source, or the records of an earlier run.
    pub feed: bool,
}

/// One input of an operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InputInfo {
    /// How it reads.
    pub kind: InputKind,
    /// The stream that it reads; none for a timer.
    pub stream: Option<String>,
    /// The operator that publishes it.
    pub from: Option<String>,
}

/// How an input reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum InputKind {
    /// The message of the frame's stamp.
    At,
    /// The newest so many messages.
    Latest {
        /// How many.
        depth: usize,
        /// Whether over a feedback edge.
        feedback: bool,
    },
    /// A timer.
    Every {
        /// From tick to tick, in nanoseconds.
        period_ns: i64,
        /// The first tick, in nanoseconds.
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
