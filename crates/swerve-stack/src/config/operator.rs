//! `[operator.NAME]` and `[resource.NAME]`: kind, inputs and execution of operators.

use core::fmt;
use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;

use super::execution::{self, Deadline, Runtime};

/// One operator: its kind, inputs and execution.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(default)]
pub struct OperatorConfig {
    /// Kind, one of those that `swerve operators` lists; that of the pipeline's operator of this name when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// `enabled = false` removes it from the pipeline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enabled: Option<bool>,
    /// Streams that it reads, by port; found by type when absent.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub reads: BTreeMap<String, Reads>,
    /// Run time; `zero` when absent (the planner: its cost; an emulated detector: the published one).
    pub runtime: Option<Runtime>,
    /// Busy policy; `skip_to_latest` when absent.
    pub policy: Option<String>,
    /// Deadline of its steps.
    #[ranges(nested)]
    pub deadline: Option<Deadline>,
    /// Period of a timer that its steps run on, ms: they read the newest input, and none twice. Without it they run when
    /// their input arrives.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub every_ms: Option<f64>,
    /// Ladder: variants of the operator as `{ name = "fast", ms = 5, KEY = VALUE }`, each with its run time and the keys
    /// that differ. A step takes the finest that meets the deadline, the fastest if none does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rungs: Vec<RungConfig>,
    /// Resource of which each step holds a slot.
    pub uses: Option<String>,
    /// Communication delay of its outputs, ms.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(range(min = 0.0, max = execution::MS_MAX))]
    pub delay_ms: f64,
    /// Keys of its kind, or of the kind's tables for this operator only.
    #[serde(flatten)]
    #[schemars(with = "crate::config::AnyTable")]
    pub keys: toml::Table,
}

/// A rung of a ladder: a variant of the operator.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
pub struct RungConfig {
    /// Name of the rung.
    pub name: String,
    /// Run time of a step, ms.
    #[schemars(range(min = 0.0, max = execution::MS_MAX))]
    pub ms: f64,
    /// Keys of the operator that differ on this rung.
    #[serde(flatten)]
    #[schemars(with = "crate::config::AnyTable")]
    pub keys: toml::Table,
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// Streams that a port reads.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Reads {
    /// A stream, or the first stream of an operator.
    Stream(String),
    /// Several streams, for a port that takes any number.
    Streams(Vec<String>),
    /// A stream with properties of the edge.
    Edge(EdgeConfig),
}

/// A stream with properties of the edge.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EdgeConfig {
    /// Stream, or the operator whose first stream is read.
    pub stream: String,
    /// Reads over a feedback edge, which closes a loop; the port's default when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback: Option<bool>,
    /// Reads before faults are injected; the port's default when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before_faults: Option<bool>,
}

/// By the type of the value, so that problems within it are reported under their own keys.
impl<'de> Deserialize<'de> for Reads {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AnyForm;
        impl<'de> Visitor<'de> for AnyForm {
            type Value = Reads;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a stream, an array of streams, or { stream = \"...\", feedback = true }")
            }

            fn visit_str<E: de::Error>(self, stream: &str) -> Result<Reads, E> {
                Ok(Reads::Stream(stream.to_owned()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, streams: A) -> Result<Reads, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(streams)).map(Reads::Streams)
            }

            fn visit_map<A: MapAccess<'de>>(self, edge: A) -> Result<Reads, A::Error> {
                EdgeConfig::deserialize(MapAccessDeserializer::new(edge)).map(Reads::Edge)
            }
        }
        deserializer.deserialize_any(AnyForm)
    }
}

impl Reads {
    /// The streams, each with feedback and before-faults where these are set.
    pub(crate) fn each(&self) -> Vec<(&str, Option<bool>, Option<bool>)> {
        match self {
            Self::Stream(stream) => vec![(stream, None, None)],
            Self::Streams(streams) => streams.iter().map(|stream| (stream.as_str(), None, None)).collect(),
            Self::Edge(edge) => vec![(&edge.stream, edge.feedback, edge.before_faults)],
        }
    }
}

/// Returns true if a name is valid for operators in streams, topics and files.
pub(crate) fn is_plain_name(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
}

/// A shared resource.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct ResourceConfig {
    /// Steps that may hold it at once.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub slots: usize,
}
