//! Which operators a configuration has, in which order, and what each of them reads.
//!
//! The pipeline is text: parts in `base/`, changed by `[operator.NAME]` tables. Streams are found by type, or by name
//! where the type alone does not decide.

mod additions;
mod base;
mod links;
mod settings;
mod written;

use std::sync::Arc;

use swerve_core::Span;
use swerve_flow::{GraphInfo, OutputInfo, Payload, PayloadType, PortInfo};

use crate::config::resolved::Resolved;
use crate::config::{Config, OperatorConfig};
use crate::kind::{KeyProblems, Node, OperatorKind, Role, Scheduled, Settings};
use swerve_msg::{Detections, Image, TrafficLights};
use swerve_text::nearest;

pub use additions::Redirected;
pub(crate) use base::{on_road, pipeline_names, scheduled_operator, sensor_operators};
pub use settings::COMMON_KEYS;
pub(crate) use settings::gather_named_sections;

/// The operators of a pipeline, in the order of its graph.
#[derive(Clone)]
pub struct Assembly {
    operators: Vec<Placed>,
    /// All that there may be, under these settings or others, with what is known of their kinds.
    known: Vec<(String, Option<Node>)>,
}

/// One operator of a pipeline.
#[derive(Clone)]
pub struct Placed {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: Arc<dyn OperatorKind>,
    /// What `[operator.NAME]` says, the pipeline's own text included.
    pub own: OperatorConfig,
    /// What it reads, by port.
    pub inputs: Vec<Input>,
    /// What it publishes.
    pub outputs: Vec<Output>,
    /// The configuration where its own keys change it.
    config: Option<Arc<Config>>,
    /// What that comes to.
    pub resolved: Arc<Resolved>,
    /// Its period or fixed deadline, under the models of `[execution]` that have one.
    pub(crate) length: Option<Span>,
    offered: Arc<[PayloadType]>,
}

/// An input port and what feeds it; nothing for a timer.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// The port.
    pub port: PortInfo,
    /// The streams that it reads.
    pub from: Vec<Edge>,
}

/// A stream as a port reads it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Edge {
    /// Its name.
    pub stream: String,
    /// Over a feedback edge.
    pub feedback: bool,
    /// Before faults befall it.
    pub raw: bool,
}

/// A stream that an operator publishes.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Its name: that of the operator, or `operator.port` where it has several.
    pub stream: String,
    /// The port.
    pub port: OutputInfo,
    /// Whether nothing comes of it under these settings.
    pub silent: bool,
    /// Why it holds nothing at all, where it does not.
    pub empty: Option<String>,
}

impl Placed {
    /// What the configuration says of it.
    pub fn settings<'a>(&'a self, config: &'a Config) -> Settings<'a> {
        let config = self.config.as_deref().unwrap_or(config);
        Settings { name: &self.name, config, offered: &self.offered }
    }
}

impl Assembly {
    /// The operators that `config` asks for.
    ///
    /// # Errors
    /// All that is wrong with `[operator.NAME]` tables and with what operators read, by key.
    pub fn new(config: &Config) -> anyhow::Result<Self> {
        let mut problems = KeyProblems::new();
        let assembly = Self::with_problems(config, &mut problems);
        let lines: Vec<String> = problems.iter().map(|(key, message)| format!("{key}: {message}")).collect();
        anyhow::ensure!(lines.is_empty(), lines.join("\n"));
        Ok(assembly)
    }

    /// The same, as far as it goes; what is wrong comes to the `problems` that are known, without what only follows
    /// from them.
    pub(crate) fn with_problems(config: &Config, problems: &mut KeyProblems) -> Self {
        let entries = base::entries(config);
        let node = |own: &OperatorConfig| Some(config.registry.kind(own.kind.as_deref()?)?.node());
        let mut known: Vec<_> = entries.iter().map(|(name, own)| (name.clone(), node(own))).collect();
        let mut operators = Vec::new();
        let resolved = Arc::new(Resolved::new(config, problems));
        for (name, own) in entries {
            operators.extend(placed((config, &resolved), (name, own), problems));
        }
        check_outside(config, &operators, problems);
        let offered: Arc<[PayloadType]> = offered(&operators);
        for placed in &mut operators {
            placed.offered = offered.clone();
            let settings = placed.settings(config);
            placed.inputs = ports(&settings, &placed.kind);
        }
        links::link(&mut operators, config, problems);
        for (name, node) in &mut known {
            let placed = operators.iter().find(|placed| placed.name == *name);
            if let (Some(node), Some(placed)) = (node, placed) {
                node.stays = placed.kind.stays(&placed.settings(config));
            }
        }
        Self { operators, known }
    }

    /// The operators, in the order of the graph.
    pub fn operators(&self) -> &[Placed] {
        &self.operators
    }

    /// The operator of this name.
    pub fn operator(&self, name: &str) -> Option<&Placed> {
        self.operators.iter().find(|placed| placed.name == name)
    }

    /// Whether there is an operator of this name.
    pub fn has(&self, name: &str) -> bool {
        self.operator(name).is_some()
    }

    /// All names that `[operator.NAME]` may have, in the order of the graph.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.known.iter().map(|(name, _)| name.as_str())
    }

    /// What is known of the kind of an operator, whether or not it runs under these settings.
    pub fn node(&self, name: &str) -> Option<Node> {
        self.known.iter().find(|(known, _)| known == name).and_then(|(_, node)| *node)
    }

    /// All streams with the operators that publish them.
    pub fn streams(&self) -> impl Iterator<Item = (&Placed, &Output)> {
        self.operators.iter().flat_map(|placed| placed.outputs.iter().map(move |output| (placed, output)))
    }

    /// The stream that a name stands for: its own, or the first one of an operator.
    pub fn stream(&self, name: &str) -> Option<(&Placed, &Output)> {
        let named = self.streams().find(|(_, output)| output.stream == name);
        named.or_else(|| self.streams().find(|(placed, _)| placed.name == name))
    }

    /// The first operator that publishes messages of this type. What faults make of them is published by others.
    pub fn publisher<T: Payload>(&self) -> Option<&str> {
        self.first_stream::<T>().map(|(placed, _)| placed.name.as_str())
    }

    /// The first stream of messages of this type, with the operator that publishes it.
    pub(crate) fn first_stream<T: Payload>(&self) -> Option<(&Placed, &Output)> {
        let payload = PayloadType::of::<T>();
        self.streams().find(|(_, output)| output.port.payload == payload)
    }

    /// The stream of images that an operator looks for boxes or lights in, where it is one that detects.
    pub fn image_of(&self, detector: &str) -> Option<&str> {
        let placed = self.operator(detector)?;
        let found = [PayloadType::of::<Detections>(), PayloadType::of::<TrafficLights>()];
        let detects = |output: &Output| found.contains(&output.port.payload);
        let is_image = |input: &&Input| input.port.payload == Some(PayloadType::of::<Image>());
        let image = placed.inputs.iter().find(is_image).filter(|_| placed.outputs.iter().any(detects))?;
        image.from.first().map(|edge| edge.stream.as_str())
    }

    /// The pipeline as the text that makes it: what `config` sets, and every operator with its kind and what it reads;
    /// `graph` says how they run.
    pub fn to_toml(&self, config: &Config, graph: &GraphInfo) -> String {
        written::written(self, config, graph)
    }
}

/// An operator in its place, if there is one under its settings.
fn placed(
    (config, base): (&Config, &Arc<Resolved>),
    (name, own): (String, OperatorConfig),
    problems: &mut KeyProblems,
) -> Option<Placed> {
    let Some(kind) = &own.kind else {
        // A watcher of no sensor stands behind none; `check_monitors` says so.
        if !config.monitor.contains_key(&name) {
            problems.push((format!("operator.{name}"), unknown_operator(config, &name)));
        }
        return None;
    };
    let Some(kind) = config.registry.kind(kind).cloned() else {
        problems.push((format!("operator.{name}.kind"), unknown_kind(config, kind)));
        return None;
    };
    if own.enabled == Some(false) {
        return None;
    }
    let view = settings::view(config, &name, &*kind, &own.keys);
    let view = view.unwrap_or_else(|wrong| {
        problems.extend(wrong);
        None
    });
    let (config_of_its_own, resolved) =
        view.map_or((None, None), |(config, resolved)| (Some(config), Some(resolved)));
    let mut placed = Placed {
        name,
        kind,
        own,
        inputs: Vec::new(),
        outputs: Vec::new(),
        config: config_of_its_own.map(Arc::new),
        resolved: resolved.map_or_else(|| base.clone(), Arc::new),
        length: None,
        offered: Arc::new([]),
    };
    let settings = placed.settings(config);
    if !placed.kind.is_there(&settings) {
        if config.operator.get(&placed.name).is_some_and(|asked| asked.kind.is_some()) {
            problems.push((format!("operator.{}.kind", placed.name), takes_no_part(&placed.kind.node())));
        }
        return None;
    }
    let ports = placed.kind.outputs(&settings);
    let several = ports.len() > 1;
    let outputs = ports.into_iter().map(|port| Output {
        stream: if several { format!("{}.{}", placed.name, port.name) } else { placed.name.clone() },
        silent: placed.kind.is_silent(&settings, &port.name),
        empty: placed.kind.is_empty(&settings, &port.name),
        port,
    });
    placed.outputs = outputs.collect();
    placed.length =
        placed.kind.node().scheduled.and_then(|scheduled| length(scheduled, &placed, config, problems));
    Some(placed)
}

/// The period or fixed deadline of an operator that a model of `[execution]` schedules; what is wrong with it is told.
fn length(
    scheduled: Scheduled,
    placed: &Placed,
    config: &Config,
    problems: &mut KeyProblems,
) -> Option<Span> {
    let takes_ms = placed.kind.takes_ms(&placed.settings(config));
    let config = placed.settings(config).config;
    for (key, message) in scheduled.problems(config, &placed.own) {
        problems.push((format!("operator.{}.{key}", placed.name), message.into()));
    }
    scheduled.length(config, &placed.own, &placed.resolved, takes_ms).unwrap_or_else(|message| {
        let problem = (format!("execution.{}", scheduled.key()), message);
        // Of several detectors or planners each would say it.
        if !problems.contains(&problem) {
            problems.push(problem);
        }
        None
    })
}

fn ports(settings: &Settings<'_>, kind: &Arc<dyn OperatorKind>) -> Vec<Input> {
    let port = |port| Input { port, from: Vec::new() };
    kind.inputs(settings).into_iter().map(port).collect()
}

fn offered(operators: &[Placed]) -> Arc<[PayloadType]> {
    let outputs = operators.iter().flat_map(|placed| &placed.outputs);
    outputs.filter(|output| !output.silent).map(|output| output.port.payload).collect()
}

/// What is around the stack: one simulated world, or a vehicle; and who is emulated has to be there.
fn check_outside(config: &Config, operators: &[Placed], problems: &mut KeyProblems) {
    let is_simulated = config.live.is_none();
    let worlds = operators.iter().filter(|placed| placed.kind.node().role == Role::World);
    for second in worlds.skip(usize::from(is_simulated)) {
        let message = match is_simulated {
            true => "expected another kind: a run has one simulated world, and that is there already",
            false => "expected another kind: a vehicle is driven, and there is no simulated world",
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
    let is_left_out = config.operator.get("detector").is_some_and(|own| own.enabled == Some(false));
    if config.perception.emulates() && is_left_out && !operators.iter().any(detects) {
        let message = format!(
            "`perception.detector` is `{}`, and nothing else detects: expected true, or the detector `truth`",
            config.perception.detector
        );
        problems.push(("operator.detector.enabled".into(), message));
    }
}

/// Told where somebody asked for an operator that the other settings leave out.
fn takes_no_part(node: &Node) -> String {
    if let Some(setting) = node.only_with {
        return format!("`{}` takes part where `{setting}` asks for it", node.kind);
    }
    let sections: Vec<String> = node.sections.iter().map(|section| format!("[{section}]")).collect();
    let by = if sections.is_empty() { "other keys".to_owned() } else { sections.join(", ") };
    format!("`{}` takes no part in this pipeline, which is set by {by}", node.kind)
}

fn unknown_operator(config: &Config, name: &str) -> String {
    let names: Vec<String> = base::entries(config)
        .into_iter()
        .filter(|(_, own)| own.kind.is_some())
        .map(|(name, _)| name)
        .collect();
    let near = nearest(name, names.iter().map(String::as_str));
    let near = near.map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
    format!(
        "unknown operator, expected one of {}, or a `kind` that makes it a new one{near}",
        names.join(", ")
    )
}

/// What is said of a kind that is not there. A name that is near none is somebody's own rather than a slip.
fn unknown_kind(config: &Config, kind: &str) -> String {
    let names: Vec<&str> = config.registry.kinds().map(|kind| kind.node().kind).collect();
    let own = match nearest(kind, names.iter().copied()) {
        Some(_) => "",
        None => {
            " (one of your own is known to the program of its package alone: there, `cargo run --` in the place of `swerve`)"
        }
    };
    format!("unknown kind `{kind}`{own}{}", one_of(kind, &names))
}

/// The end of a message that a name is unknown.
pub(crate) fn one_of(name: &str, names: &[&str]) -> String {
    let near = nearest(name, names.iter().copied());
    let near = near.map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
    if names.is_empty() {
        ", and there is none".to_owned()
    } else {
        format!(", expected one of {}{near}", names.join(", "))
    }
}

#[cfg(test)]
mod tests;
