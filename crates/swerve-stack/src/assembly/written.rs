//! The pipeline as TOML that reproduces it.

use core::fmt::Write as _;

use swerve_flow::{GraphInfo, OperatorInfo};
use toml::{Table, Value};

use super::{Assembly, Edge, Input, Placed};
use crate::config::{Config, OperatorConfig};
use crate::setup::Setup;

/// Settings of the configuration, then every operator with its kind and all its inputs, and how it runs as a comment.
pub(super) fn written(assembly: &Assembly, setup: &Setup, graph: &GraphInfo) -> String {
    let mut text = settings(setup);
    for placed in assembly.operators() {
        let runs = graph.operators.iter().find(|info| info.name == placed.name).map(runs);
        let heading = format!("operator.{}", placed.name);
        text += &section(&heading, runs.as_deref(), &operator(placed));
    }
    let is_there = |name: &str| assembly.has(name);
    for (name, own) in setup.operator.iter().filter(|(name, _)| !is_there(name)) {
        text += &section(&format!("operator.{name}"), None, &plain(own));
    }
    text
}

/// Run time, policy and deadline of an operator, from its own table, the tables of its kind, or defaults.
fn runs(info: &OperatorInfo) -> String {
    if info.feed {
        return "fed from outside".to_owned();
    }
    let deadline =
        info.deadline.as_ref().map_or_else(String::new, |deadline| format!("; deadline {deadline}"));
    format!("run time {}; {}{deadline}", info.runtime, info.policy)
}

/// A table under its heading.
fn section(heading: &str, comment: Option<&str>, table: &Table) -> String {
    let mut text = format!("[{heading}]\n");
    if let Some(comment) = comment {
        let _ = writeln!(text, "# {comment}");
    }
    for (key, value) in table {
        let _ = writeln!(text, "{key} = {value}");
    }
    text + "\n"
}

fn plain(value: &impl serde::Serialize) -> Table {
    Table::try_from(value).expect("a configuration is plain tables and values")
}

fn operator(placed: &Placed) -> Table {
    let own = OperatorConfig { reads: Default::default(), enabled: None, ..placed.own.clone() };
    let mut table = plain(&own);
    table.insert("kind".to_owned(), placed.kind.node().kind.into());
    let reads = placed.inputs.iter().filter(|input| !input.from.is_empty());
    let reads: Table = reads.map(|input| (input.port.name.to_string(), streams(input))).collect();
    if !reads.is_empty() {
        table.insert("reads".to_owned(), reads.into());
    }
    table
}

/// The `reads` value of a port.
fn streams(input: &Input) -> Value {
    let one = |edge: &Edge| {
        let mut table = Table::new();
        // The port's defaults are written only where either value is true.
        for (key, is, by_itself) in
            [("feedback", edge.feedback, input.port.feedback), ("before_faults", edge.raw, input.port.raw)]
        {
            if is || by_itself {
                table.insert(key.to_owned(), is.into());
            }
        }
        let stream = Value::from(edge.stream.clone());
        if table.is_empty() {
            return stream;
        }
        table.insert("stream".to_owned(), stream);
        table.into()
    };
    match &input.from[..] {
        [edge] => one(edge),
        // Several streams of one port all have the port's defaults.
        edges => edges.iter().map(|edge| Value::from(edge.stream.clone())).collect::<Vec<_>>().into(),
    }
}

/// Tables of the configuration except those of its operators, without default values.
fn settings(setup: &Setup) -> String {
    fn defaults<T: Default>(
        named: &std::collections::BTreeMap<String, T>,
    ) -> std::collections::BTreeMap<String, T> {
        named.keys().map(|name| (name.clone(), T::default())).collect()
    }
    let default = plain(&Config {
        camera: defaults(&setup.camera),
        radar: defaults(&setup.radar),
        lidar: defaults(&setup.lidar),
        monitor: defaults(&setup.monitor),
        process: defaults(&setup.process),
        ..Config::default()
    });
    let mut all = plain(&setup.config);
    all.remove("operator");
    let (tables, values): (Table, Table) = all.into_iter().partition(|(_, value)| value.is_table());
    let mut text: String =
        changed(&values, Some(&default)).iter().map(|(key, value)| format!("{key} = {value}\n\n")).collect();
    for (name, table) in &tables {
        let (Value::Table(table), default) = (table, default.get(name).and_then(Value::as_table)) else {
            continue;
        };
        if NAMED.contains(&name.as_str()) {
            for (entry, value) in table {
                let Value::Table(inner) = value else { continue };
                let default = default.and_then(|default| default.get(entry)).and_then(Value::as_table);
                text += &section(&format!("{name}.{entry}"), None, &changed(inner, default));
            }
            continue;
        }
        let table = changed(table, default);
        if !table.is_empty() {
            text += &section(name, None, &table);
        }
    }
    text
}

/// Tables whose entries are named by the user.
const NAMED: [&str; 7] = ["camera", "radar", "lidar", "monitor", "process", "resource", "fault"];

/// Keys whose values differ from the default.
fn changed(table: &Table, default: Option<&Table>) -> Table {
    let is_changed =
        |(key, value): &(&String, &Value)| default.and_then(|default| default.get(*key)) != Some(*value);
    table.iter().filter(is_changed).map(|(key, value)| (key.clone(), value.clone())).collect()
}
