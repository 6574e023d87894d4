//! Streams whose messages the readers in the graph receive.

use std::any::type_name;
use std::collections::{BTreeMap, BTreeSet};

use swerve_flow::{GraphInfo, InputKind, OperatorInfo};

/// Original operator of each stream that is read unmodified.
///
/// If an operator reads a stream and publishes another of the same type, as fault injection does, readers receive
/// the latter: its stream replaces the original.
#[derive(Clone, Debug, Default)]
pub(super) struct Streams {
    sources: BTreeMap<String, String>,
    /// Payload types of all streams, without their paths.
    payloads: BTreeSet<String>,
}

impl Streams {
    pub(super) fn new(graph: &GraphInfo) -> Self {
        let (mut sources, mut payloads): (BTreeMap<String, String>, _) = (BTreeMap::new(), BTreeSet::new());
        // Operators are in topological order: inputs were published before.
        for operator in &graph.operators {
            for (stream, payload) in &operator.outputs {
                let replaced = replaced(graph, operator, payload);
                let source = replaced.and_then(|replaced| sources.remove(replaced));
                sources.insert(stream.clone(), source.unwrap_or_else(|| operator.name.clone()));
                payloads.insert(payload.clone());
            }
        }
        Self { sources, payloads }
    }

    /// Returns true if any stream carries this type.
    pub(super) fn carry<T>(&self) -> bool {
        type_name::<T>().rsplit("::").next().is_some_and(|name| self.payloads.contains(name))
    }

    /// Operator that originally publishes a stream's messages; `None` if another stream has replaced it.
    pub(super) fn source(&self, stream: &str) -> Option<&str> {
        self.sources.get(stream).map(String::as_str)
    }
}

/// Stream of this payload type that an operator reads message by message and republishes.
fn replaced<'a>(graph: &GraphInfo, operator: &'a OperatorInfo, payload: &str) -> Option<&'a str> {
    let is_of_payload = |stream: &str| {
        let outputs = graph.operators.iter().flat_map(|other| &other.outputs);
        outputs.into_iter().any(|(name, other)| name == stream && other == payload)
    };
    let read = operator.inputs.iter().filter(|input| input.kind == InputKind::At);
    read.filter_map(|input| input.stream.as_deref()).find(|stream| is_of_payload(stream))
}

#[cfg(test)]
mod tests {
    use swerve_msg::{EgoState, Gnss};
    use swerve_stack::Setup;

    use swerve_stack::pipeline::Pipeline;
    use swerve_text::Document;

    use super::*;

    #[test]
    fn streams_resolve_to_the_output_of_the_last_fault() {
        let text = "[log]\nsensors = [\"front\"]\n[camera.front]\nwidth_px = 8\nheight_px = 8\n\
                    [fault.a]\nstream = \"pose\"\ndrop = true\n[fault.b]\nstream = \"pose\"\ndelay_ms = 5\n\
                    [fault.dark]\nstream = \"front.rgb\"\ndrop = true\n";
        let config = Setup::from_document(&Document::parse("c.toml", text).unwrap(), &[]).unwrap();
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/lane.toml");
        let scenario = swerve_drive::read_scenario(file.as_ref()).unwrap();
        let info = Pipeline::build(&config, &scenario).unwrap().graph.describe().unwrap();
        let streams = Streams::new(&info);
        assert_eq!((streams.source("pose"), streams.source("a.message")), (None, None));
        assert_eq!(streams.source("b.message"), Some("pose"));
        assert_eq!((streams.source("front.rgb"), streams.source("dark.message")), (None, Some("front")));
        assert!(streams.carry::<EgoState>() && !streams.carry::<Gnss>());
        for stream in ["world", "planner", "imu", "controller"] {
            assert_eq!(streams.source(stream), Some(stream));
        }
    }
}
