//! Streams that a foreign world feeds: those of the world and its sensors.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{anyhow, bail};
use swerve_core::Span;
use swerve_flow::{Fed, GraphInfo, InputKind, OperatorInfo, Payload, PayloadType, Session};
use swerve_stack::Setup;
use swerve_stack::assembly::{Assembly, Placed};
use swerve_stack::pipeline::Pipeline;
use swerve_text::did_you_mean;

/// A stream that a foreign world feeds.
#[derive(Clone, Debug)]
pub struct InputStream {
    /// Name of the stream.
    pub name: String,
    /// Type of its messages.
    pub payload: PayloadType,
    /// Meaning of its messages, in one line.
    pub doc: &'static str,
    /// Operators of the stack that read it; empty if it is only for the log and the metrics.
    pub readers: Vec<String>,
    /// Time from the stamp of a message to its publication, as configured for a camera, radar or lidar.
    pub latency: Span,
}

/// An input with its place in the session.
pub(super) struct Input {
    pub(super) stream: InputStream,
    pub(super) source: Fed,
    pub(super) port: usize,
    /// True if an operator joins its messages with those of another input: it has to know that none is missing.
    pub(super) is_joined: bool,
}

/// The inputs of a stack, by the name of the stream.
pub(super) struct Inputs(BTreeMap<String, Input>);

impl Inputs {
    pub(super) fn new(
        (setup, assembly, fed): (&Setup, &Assembly, &[String]),
        graph: &GraphInfo,
        session: &Session<'_>,
    ) -> Self {
        let joined = joined(graph, fed);
        let mut inputs = BTreeMap::new();
        for placed in assembly.operators().iter().filter(|placed| fed.contains(&placed.name)) {
            let Some(source) = session.source(&placed.name) else { continue };
            for (port, output) in placed.outputs.iter().enumerate() {
                let stream = InputStream {
                    name: output.stream.clone(),
                    payload: output.port.payload,
                    doc: output.port.doc,
                    readers: readers(graph, &output.stream),
                    latency: latency(setup, placed),
                };
                let is_joined = joined.contains(&output.stream);
                inputs.insert(output.stream.clone(), Input { stream, source, port, is_joined });
            }
        }
        Self(inputs)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Input> {
        self.0.values()
    }

    /// Input of this name.
    ///
    /// # Errors
    /// If there is none, with the nearest name.
    pub(super) fn named(&self, stream: &str) -> anyhow::Result<&Input> {
        self.0.get(stream).ok_or_else(|| {
            let names = || self.0.keys().map(String::as_str);
            let near = did_you_mean(stream, names());
            let known: Vec<&str> = names().collect();
            anyhow!("unknown input stream `{stream}`, expected one of {}{near}", known.join(", "))
        })
    }

    /// First input with messages of this type, by name.
    pub(super) fn first_of<T: Payload>(&self) -> Option<&Input> {
        self.0.values().find(|input| input.stream.payload == PayloadType::of::<T>())
    }
}

/// Refuses run times of operators that take no steps, since the foreign world feeds them.
pub(super) fn check(setup: &Setup, pipeline: &Pipeline) -> anyhow::Result<()> {
    for name in &pipeline.fed {
        let Some(own) = setup.operator.get(name) else { continue };
        let set = [(own.runtime.is_some(), "runtime"), (own.policy.is_some(), "policy")];
        if let Some((_, key)) = set.into_iter().find(|(is_set, _)| *is_set) {
            bail!(
                "operator.{name}.{key}: `{name}` is fed by a foreign world and takes no steps: expected \
                 `operator.{name}.delay_ms` for its latency"
            );
        }
    }
    Ok(())
}

/// Time from a sensor's stamp to the publication of its message.
fn latency(setup: &Setup, placed: &Placed) -> Span {
    placed.kind.on_its_way(&placed.settings(setup)).map_or(Span::ZERO, |way| way.after)
}

fn readers(graph: &GraphInfo, stream: &str) -> Vec<String> {
    let reads = |operator: &&OperatorInfo| {
        operator.inputs.iter().any(|input| input.stream.as_deref() == Some(stream))
    };
    graph.operators.iter().filter(reads).map(|operator| operator.name.clone()).collect()
}

/// Fed streams whose messages an operator joins, by stamp, with those of another fed stream.
fn joined(graph: &GraphInfo, fed: &[String]) -> BTreeSet<String> {
    // Operators are in rank order: the streams that a synchronised port reads are known before it.
    let mut from: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut joined = BTreeSet::new();
    for operator in &graph.operators {
        let is_fed = fed.contains(&operator.name);
        let at = operator.inputs.iter().filter(|input| input.kind == InputKind::At);
        let streams = at.filter_map(|input| from.get(input.stream.as_deref()?)).flatten();
        let all: BTreeSet<&str> = streams.copied().collect();
        if all.len() > 1 {
            joined.extend(all.iter().map(|stream| (*stream).to_owned()));
        }
        for (stream, _) in &operator.outputs {
            from.insert(stream, if is_fed { BTreeSet::from([stream.as_str()]) } else { all.clone() });
        }
    }
    joined
}
