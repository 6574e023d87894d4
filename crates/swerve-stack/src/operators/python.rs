//! Custom operators in Python: a Python class takes their steps, the configuration declares their ports.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_flow::{
    AnyInput, AnyOperator, AnyOutputs, Context, OutputInfo, PayloadType, PortInfo, PortMode, every,
};

use crate::config::execution::span_of_ms;
use crate::config::is_plain_name;
use crate::kind::{Node, OperatorKind, Settings};
use crate::problems::{KeyProblems, one_of, problem};
use crate::registry::Registry;
use crate::section::Section;
use crate::setup::Setup;
use crate::site::Site;

/// Operators written in Python.
pub(super) struct Python;

/// Keys of a Python operator.
#[derive(Serialize, Deserialize, JsonSchema, Default, Ranges)]
#[serde(deny_unknown_fields, default)]
struct Table {
    /// Inputs by port, each a mode and a message type: `Image` (of the frame's stamp), `latest EgoState`, `window(16)
    /// EgoState`.
    inputs: BTreeMap<String, String>,
    /// Message types of the outputs, by port.
    outputs: BTreeMap<String, String>,
    /// Period of additional steps, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    period_ms: Option<f64>,
}

/// Port of its timer.
const TICK: &str = "tick";

/// Largest number of messages in a window.
const WINDOW_MAX: usize = 4096;

/// Message type of this name, among those that operators of the registry read and publish.
pub(super) fn message(name: &str, registry: &Registry) -> Result<PayloadType, String> {
    let messages = registry.messages();
    let found = messages.iter().find(|message| message.name() == name);
    found.copied().ok_or_else(|| {
        let names: Vec<String> = messages.iter().map(PayloadType::name).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        format!("unknown message `{name}`{}", one_of(name, &names))
    })
}

/// Mode and message type of a port.
fn reading(text: &str, registry: &Registry) -> Result<(PortMode, PayloadType), String> {
    let Some((how, name)) = text.trim().rsplit_once(' ') else {
        return Ok((PortMode::At, message(text.trim(), registry)?));
    };
    let window = |how: &str| how.strip_prefix("window(")?.strip_suffix(')')?.trim().parse().ok();
    let mode = match how.trim() {
        "latest" => PortMode::Latest,
        how => match window(how) {
            Some(n @ 1..=WINDOW_MAX) => PortMode::Window(n),
            _ => {
                return Err(format!(
                    "expected MESSAGE, latest MESSAGE or window(N) MESSAGE with N from 1 to {WINDOW_MAX}, found `{text}`"
                ));
            }
        },
    };
    Ok((mode, message(name, registry)?))
}

impl Table {
    const SECTION: Section<Self> = Section::own(Self::problems);

    fn of(settings: &Settings<'_>) -> Self {
        Self::SECTION.get(settings.setup, settings.name)
    }

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let registry = &setup.registry;
        let mut told = KeyProblems::new();
        let inputs =
            self.inputs.iter().map(|(port, text)| ("inputs", port, reading(text, registry).map(drop)));
        let outputs =
            self.outputs.iter().map(|(port, name)| ("outputs", port, message(name, registry).map(drop)));
        for (side, port, read) in inputs.chain(outputs) {
            let name = if port == TICK { Err("the timer's port has this name".to_owned()) } else { Ok(()) };
            let plain = is_plain_name(port).then_some(());
            let plain = plain.ok_or_else(|| "expected a name of letters, digits and underscores".to_owned());
            let wrong = name.and(plain).and(read).err();
            told.extend(wrong.map(|message| (format!("{side}.{port}"), message)));
        }
        let of_the_stamp =
            |text: &String| reading(text, registry).is_ok_and(|(mode, _)| mode == PortMode::At);
        if told.is_empty() && self.period_ms.is_none() && !self.inputs.values().any(of_the_stamp) {
            let message = "nothing makes it step: expected a message that is neither `latest` nor `window`, or `period_ms`";
            told.push(("inputs".into(), message.into()));
        }
        told.extend(self.out_of_range().into_iter().map(problem));
        told
    }
}

impl OperatorKind for Python {
    fn node(&self) -> Node {
        Node::new("python", "an operator written in Python, with the ports that the configuration declares")
            .section(&Table::SECTION)
            .elsewhere()
    }

    fn schema(&self) -> Option<schemars::Schema> {
        Some(schemars::schema_for!(Table))
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        let payload = |name: &str| message(name, &settings.setup.registry).ok();
        let outputs = Table::of(settings).outputs.into_iter();
        outputs.filter_map(|(port, name)| Some(OutputInfo::declared(port, payload(&name)?))).collect()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        let table = Table::of(settings);
        let stream = |(port, text): (String, String)| {
            let (mode, message) = reading(&text, &settings.setup.registry).ok()?;
            Some(PortInfo::declared(port, mode, Some(message)))
        };
        let timer = table.period_ms.map(|_| PortInfo::declared(TICK, PortMode::Every, None));
        table.inputs.into_iter().filter_map(stream).chain(timer).collect()
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let period = Table::of(&site.settings()).period_ms;
        site.add_any(Elsewhere, period.map(|ms| every(span_of_ms(ms))))
    }
}

/// Placeholder in a process that does not take the operator's steps.
pub(super) struct Elsewhere;

impl AnyOperator for Elsewhere {
    fn step(&mut self, _: &mut Context<'_>, _: Vec<AnyInput>, _: &mut AnyOutputs<'_>) {
        panic!("it is written in Python, and the process that has it runs none");
    }
}

#[cfg(test)]
mod tests;
