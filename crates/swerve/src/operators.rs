//! `swerve operators`: the kinds of operators that a configuration can name.

use anyhow::bail;
use swerve_flow::{OutputInfo, PortInfo, PortMode};
use swerve_report::output::print;
use swerve_stack::config::Config;
use swerve_stack::{OperatorKind, Registry, Settings};
use swerve_text::nearest;

/// `swerve operators`.
#[derive(clap::Args, Debug)]
pub(crate) struct OperatorsArgs {
    /// Show this one: ports, messages, keys with their defaults
    kind: Option<String>,
}

/// Lists the kinds, or shows one.
///
/// # Errors
/// A kind that is not there.
pub(crate) fn run(args: &OperatorsArgs, registry: &Registry) -> anyhow::Result<()> {
    let Some(name) = &args.kind else { return print(&list(registry)) };
    let Some(kind) = registry.kind(name) else {
        let names: Vec<&str> = registry.kinds().map(|kind| kind.node().kind).collect();
        let near = nearest(name, names.iter().copied());
        let near = near.map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
        bail!("unknown kind `{name}`, expected one of {}{near}", names.join(", "));
    };
    print(&show(&**kind, registry))
}

fn list(registry: &Registry) -> String {
    let rows = registry.kinds().map(|kind| vec![kind.node().kind.to_owned(), kind.node().doc.to_owned()]);
    align(&rows.collect::<Vec<_>>())
}

/// Columns, each as wide as its widest entry.
fn align(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width =
        |column: usize| rows.iter().filter_map(|row| row.get(column)).map(String::len).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        format!("  {}\n", cells.join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

fn show(kind: &dyn OperatorKind, registry: &Registry) -> String {
    let node = kind.node();
    let config = Config { registry: registry.clone(), ..Config::default() };
    let settings = Settings { name: node.kind, config: &config, offered: &[] };
    let mut text = format!("{}: {}\n", node.kind, node.doc);
    if let Some(why) = node.stays {
        text += &format!("runs in the coordinator's process: {why}\n");
    }
    let section = |title: &str, rows: Vec<Vec<String>>| match rows.is_empty() {
        true => String::new(),
        false => format!("\n{title}\n{}", align(&rows)),
    };
    text += &section("reads", kind.inputs(&settings).iter().map(input).collect());
    text += &section("publishes", kind.outputs(&settings).iter().map(output).collect());
    text += &keys(kind, &config);
    text
}

fn input(port: &PortInfo) -> Vec<String> {
    let how = match port.mode {
        PortMode::At => "of the frame's stamp".to_owned(),
        PortMode::Latest => "the newest".to_owned(),
        PortMode::Window(n) => format!("the newest {n}"),
        PortMode::Every => "timer".to_owned(),
    };
    let many = if port.many { ", any number" } else { "" };
    let optional = if port.optional { ", may be left out" } else { "" };
    let feedback = if port.feedback { ", over a feedback edge" } else { "" };
    let payload = port.payload.map(|payload| payload.name()).unwrap_or_default();
    vec![port.name.to_owned(), payload, format!("{how}{many}{optional}{feedback}"), port.doc.to_owned()]
}

fn output(port: &OutputInfo) -> Vec<String> {
    vec![port.name.to_owned(), port.payload.name(), port.doc.to_owned()]
}

/// The keys of a kind: its own, or those of the tables that it is set by.
fn keys(kind: &dyn OperatorKind, config: &Config) -> String {
    let node = kind.node();
    let mut text = String::new();
    let own = kind.keys();
    if !own.is_empty() {
        text += &format!("\nkeys of [operator.NAME]\n{}", indented(&own));
    }
    if let Some(section) = node.named_section {
        text += &format!(
            "\nkeys of [operator.NAME] or [{section}.NAME]: those of the configuration's `{section}`\n"
        );
    }
    let defaults = toml::Table::try_from(config).unwrap_or_default();
    for section in node.sections {
        if let Some(toml::Value::Table(table)) = defaults.get(*section) {
            let plain = table.iter().filter(|(_, value)| !value.is_table());
            let plain: toml::Table = plain.map(|(key, value)| (key.clone(), value.clone())).collect();
            text += &format!(
                "\nkeys of [{section}], or of [operator.NAME] for one alone, with their defaults\n{}",
                indented(&plain)
            );
        }
    }
    text
}

fn indented(table: &toml::Table) -> String {
    let text = toml::to_string(table).unwrap_or_default();
    text.lines().map(|line| format!("  {line}\n")).collect()
}
