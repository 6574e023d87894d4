//! Operators of a configuration, their order, and the streams that each of them reads.
//!
//! The pipeline is text: parts in `base/`, changed by `[operator.NAME]` tables. Streams are found by type, or by name
//! where the type alone does not decide.

mod additions;
mod check;
mod domain;
mod idle;
mod links;
mod processes;
pub(crate) mod settings;
mod written;

use std::sync::Arc;

use swerve_flow::{GraphInfo, Payload, PayloadType};
use swerve_msg::{Detections, Image, TrafficLights};
use swerve_text::{did_you_mean, nearest};

use crate::base;
use crate::config::OperatorConfig;
use crate::config::old_names::removed_kind;
use crate::config::resolved::Resolved;
use crate::kind::{Node, OperatorKind, Role, Settings};
use crate::ladder::Schedule;
use crate::problems::{KeyProblems, one_of};
use crate::schedule;
use crate::setup::Setup;
use crate::site::first_stream;

pub use crate::site::{Edge, Input, Output, Placed};
pub use additions::Redirected;
pub use settings::COMMON_KEYS;

/// The operators of a pipeline, in the order of its graph.
#[derive(Clone)]
pub struct Assembly {
    operators: Vec<Placed>,
    /// All operators possible under these or other settings, with the nodes of known kinds.
    known: Vec<(String, Option<Node>)>,
}

impl Assembly {
    /// Assembles the operators that `config` asks for.
    ///
    /// # Errors
    /// All problems of the operators' settings and inputs, by key.
    pub fn new(setup: &Setup) -> anyhow::Result<Self> {
        let mut problems = setup.problems_of_sections();
        let assembly = Self::with_problems(setup, &mut problems);
        let lines: Vec<String> = problems.iter().map(|(key, message)| format!("{key}: {message}")).collect();
        anyhow::ensure!(lines.is_empty(), lines.join("\n"));
        Ok(assembly)
    }

    /// As [`new`](Self::new), as far as possible. Adds its problems to the `problems` already known, except those that
    /// only follow from them.
    pub(crate) fn with_problems(setup: &Setup, problems: &mut KeyProblems) -> Self {
        let entries = base::entries(setup);
        let node = |own: &OperatorConfig| Some(setup.registry.kind(own.kind.as_deref()?)?.node());
        let mut known: Vec<_> = entries.iter().map(|(name, own)| (name.clone(), node(own))).collect();
        let mut operators = Vec::new();
        let resolved = Arc::new(Resolved::new(setup));
        for (name, own) in entries {
            operators.extend(placed((setup, &resolved), (name, own), problems));
        }
        check_outside(setup, &operators, problems);
        let offered: Arc<[PayloadType]> = offered(&operators);
        for placed in &mut operators {
            placed.offered = offered.clone();
            let settings = placed.settings(setup);
            placed.inputs = ports(&settings, &placed.kind);
        }
        links::link(&mut operators, setup, problems);
        for (name, node) in &mut known {
            let placed = operators.iter().find(|placed| placed.name == *name);
            if let (Some(node), Some(placed)) = (node, placed) {
                node.stays = placed.kind.stays(&placed.settings(setup));
            }
        }
        Self { operators, known }
    }

    /// The operators, in the order of the graph.
    pub fn operators(&self) -> &[Placed] {
        &self.operators
    }

    /// Operator of this name.
    pub fn operator(&self, name: &str) -> Option<&Placed> {
        self.operators.iter().find(|placed| placed.name == name)
    }

    /// Returns true if there is an operator of this name.
    pub fn has(&self, name: &str) -> bool {
        self.operator(name).is_some()
    }

    /// All names that `[operator.NAME]` may have, in the order of the graph.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.known.iter().map(|(name, _)| name.as_str())
    }

    /// Node of an operator's kind, even if it does not run under these settings.
    pub fn node(&self, name: &str) -> Option<Node> {
        self.known.iter().find(|(known, _)| known == name).and_then(|(_, node)| *node)
    }

    /// All streams, each with the operator that publishes it.
    pub fn streams(&self) -> impl Iterator<Item = (&Placed, &Output)> {
        self.operators.iter().flat_map(|placed| placed.outputs.iter().map(move |output| (placed, output)))
    }

    /// Stream of this name, or the first stream of the operator of this name.
    pub fn stream(&self, name: &str) -> Option<(&Placed, &Output)> {
        let named = self.streams().find(|(_, output)| output.stream == name);
        named.or_else(|| self.streams().find(|(placed, _)| placed.name == name))
    }

    /// First operator that publishes messages of this type; streams with injected faults are not considered.
    pub fn publisher<T: Payload>(&self) -> Option<&str> {
        self.first_stream::<T>().map(|(placed, _)| placed.name.as_str())
    }

    /// The first stream of messages of this type, with the operator that publishes it.
    pub(crate) fn first_stream<T: Payload>(&self) -> Option<(&Placed, &Output)> {
        first_stream::<T>(&self.operators)
    }

    /// Stream of images that an operator detects boxes or traffic lights in; `None` for other operators.
    pub fn image_of(&self, detector: &str) -> Option<&str> {
        let placed = self.operator(detector)?;
        let found = [PayloadType::of::<Detections>(), PayloadType::of::<TrafficLights>()];
        let detects = |output: &Output| found.contains(&output.port.payload);
        let is_image = |input: &&Input| input.port.payload == Some(PayloadType::of::<Image>());
        let image = placed.inputs.iter().find(is_image).filter(|_| placed.outputs.iter().any(detects))?;
        image.from.first().map(|edge| edge.stream.as_str())
    }

    /// The pipeline as TOML that reproduces it: the settings of `config`, and every operator with its kind and inputs.
    /// `graph` adds comments on how operators run.
    pub fn to_toml(&self, setup: &Setup, graph: &GraphInfo) -> String {
        written::written(self, setup, graph)
    }
}

/// Builds an operator and its ports; `None` if it takes no part under its settings.
fn placed(
    (setup, base): (&Setup, &Arc<Resolved>),
    (name, own): (String, OperatorConfig),
    problems: &mut KeyProblems,
) -> Option<Placed> {
    let Some(kind) = &own.kind else {
        // A monitor of an unknown sensor has no entry either; `check_monitors` reports it.
        if !setup.monitor.contains_key(&name) {
            problems.push((format!("operator.{name}"), unknown_operator(setup, &name)));
        }
        return None;
    };
    let Some(kind) = setup.registry.kind(kind).cloned() else {
        problems.push((format!("operator.{name}.kind"), unknown_kind(setup, kind)));
        return None;
    };
    if own.enabled == Some(false) {
        return None;
    }
    let view = settings::view(setup, &name, &*kind, &own.keys);
    let view = view.unwrap_or_else(|wrong| {
        problems.extend(wrong);
        None
    });
    let (config_of_its_own, resolved) =
        view.map_or((None, None), |(setup, resolved)| (Some(setup), Some(resolved)));
    let mut placed = Placed {
        name,
        kind,
        own,
        inputs: Vec::new(),
        outputs: Vec::new(),
        setup: config_of_its_own.map(Arc::new),
        resolved: resolved.map_or_else(|| base.clone(), Arc::new),
        schedule: Schedule::default(),
        offered: Arc::new([]),
    };
    let settings = placed.settings(setup);
    if !placed.kind.is_there(&settings) {
        if setup.operator.get(&placed.name).is_some_and(|asked| asked.kind.is_some()) {
            problems.push((format!("operator.{}.kind", placed.name), takes_no_part(&placed.kind.node())));
        }
        return None;
    }
    let ports = schedule::outputs(&*placed.kind, &settings);
    let several = ports.len() > 1;
    let outputs = ports.into_iter().map(|port| Output {
        stream: if several { format!("{}.{}", placed.name, port.name) } else { placed.name.clone() },
        silent: placed.kind.is_silent(&settings, &port.name),
        empty: placed.kind.is_empty(&settings, &port.name),
        port,
    });
    placed.outputs = outputs.collect();
    placed.schedule = Schedule::new(&placed, setup, problems);
    Some(placed)
}

fn ports(settings: &Settings<'_>, kind: &Arc<dyn OperatorKind>) -> Vec<Input> {
    let port = |port| Input { port, from: Vec::new() };
    schedule::inputs(&**kind, settings).into_iter().map(port).collect()
}

fn offered(operators: &[Placed]) -> Arc<[PayloadType]> {
    let outputs = operators.iter().flat_map(|placed| &placed.outputs);
    outputs.filter(|output| !output.silent).map(|output| output.port.payload).collect()
}

/// Checks the environment of the stack: one simulated world, or a vehicle and the kinds that only it feeds; and that an
/// emulated detector is enabled or replaced.
fn check_outside(setup: &Setup, operators: &[Placed], problems: &mut KeyProblems) {
    let is_simulated = setup.live.is_none();
    let worlds = operators.iter().filter(|placed| placed.kind.node().role == Role::World);
    for second in worlds.skip(usize::from(is_simulated)) {
        let message = match is_simulated {
            true => "expected another kind: a run has one simulated world, and that is there already",
            false => "expected another kind: with a vehicle there is no simulated world",
        };
        problems.push((format!("operator.{}.kind", second.name), message.into()));
    }
    for placed in operators.iter().filter(|_| is_simulated) {
        let kind = placed.kind.node().kind;
        if base::is_fed_by_vehicle(kind) {
            let message =
                format!("only a vehicle of `swerve live` feeds `{kind}`: a simulated run would be blind");
            problems.push((format!("operator.{}.kind", placed.name), message));
        }
    }
    let detects = |placed: &Placed| {
        let boxes = PayloadType::of::<Detections>();
        placed.outputs.iter().any(|output| output.port.payload == boxes)
    };
    let is_left_out = setup.operator.get("detector").is_some_and(|own| own.enabled == Some(false));
    if setup.perception.emulates() && is_left_out && !operators.iter().any(detects) {
        let message = format!(
            "`perception.detector` is `{}`, and nothing else detects: expected true, or the detector `truth`",
            setup.perception.detector
        );
        problems.push(("operator.detector.enabled".into(), message));
    }
}

/// Error message for a requested operator that other settings exclude.
fn takes_no_part(node: &Node) -> String {
    if let Some(setting) = node.only_with {
        return format!("`{}` takes part where `{setting}` asks for it", node.kind);
    }
    let tables = node.sections().filter_map(|section| section.table());
    let tables: Vec<String> = tables.map(|table| format!("[{table}]")).collect();
    let by = if tables.is_empty() { "other keys".to_owned() } else { tables.join(", ") };
    format!("`{}` takes no part in this pipeline, which is set by {by}", node.kind)
}

fn unknown_operator(setup: &Setup, name: &str) -> String {
    let names: Vec<String> = base::entries(setup)
        .into_iter()
        .filter(|(_, own)| own.kind.is_some())
        .map(|(name, _)| name)
        .collect();
    let near = did_you_mean(name, names.iter().map(String::as_str));
    format!(
        "unknown operator, expected one of {}, or a `kind` that makes it a new one{near}",
        names.join(", ")
    )
}

/// Error message for an unknown kind. A name that is close to none is taken for a custom kind rather than a typo.
fn unknown_kind(setup: &Setup, kind: &str) -> String {
    if let Some(why) = removed_kind(kind) {
        return format!("the kind `{kind}` was removed: {why}");
    }
    let names: Vec<&str> = setup.registry.kinds().map(|kind| kind.node().kind).collect();
    let own = match nearest(kind, names.iter().copied()) {
        Some(_) => "",
        None => {
            " (one of your own is known to the program of its package alone: there, `cargo run --` in the place of `swerve`)"
        }
    };
    format!("unknown kind `{kind}`{own}{}", one_of(kind, &names))
}

#[cfg(test)]
mod tests;
