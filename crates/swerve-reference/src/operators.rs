//! `swerve operators`: lists the operator kinds of a configuration.

use anyhow::bail;
use swerve_flow::{OutputInfo, PayloadType, PortInfo, PortMode};
use swerve_msg::Detections;
use swerve_report::output::print;
use swerve_stack::Setup;
use swerve_stack::assembly::COMMON_KEYS;
use swerve_stack::schedule;
use swerve_stack::{OperatorKind, Registry, Settings};
use swerve_text::nearest;

/// `swerve operators`.
#[derive(clap::Args, Debug)]
pub struct OperatorsArgs {
    /// Kind to show: ports, messages, keys with their defaults
    kind: Option<String>,
}

/// Lists the kinds, or shows one.
///
/// # Errors
/// If the kind does not exist.
pub fn run(args: &OperatorsArgs, registry: &Registry) -> anyhow::Result<()> {
    let Some(name) = &args.kind else { return print(&list(registry)) };
    let Some(kind) = registry.kind(name) else {
        let names: Vec<&str> = registry.kinds().map(|kind| kind.node().kind).collect();
        match nearest(name, names.iter().copied()) {
            Some(near) => bail!("unknown kind `{name}`; did you mean `{near}`?"),
            None => bail!("unknown kind `{name}`, expected one of {}", names.join(", ")),
        }
    };
    print(&show(&**kind, registry))
}

fn list(registry: &Registry) -> String {
    let rows = registry.kinds().map(|kind| vec![kind.node().kind.to_owned(), kind.node().doc.to_owned()]);
    align(&rows.collect::<Vec<_>>())
}

/// Aligns columns to their widest entry.
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
    let mut text = format!("{}: {}\n", node.kind, node.doc);
    if let Some(why) = node.stays {
        text += &format!("runs in the coordinator's process: {why}\n");
    }
    let section = |title: &str, rows: Vec<Vec<String>>| match rows.is_empty() {
        true => String::new(),
        false => format!("\n{title}\n{}", align(&rows)),
    };
    let under = settings_that_matter(registry);
    let reads = |settings: &Settings<'_>| schedule::inputs(kind, settings).iter().map(input).collect();
    let publishes = |settings: &Settings<'_>| schedule::outputs(kind, settings).iter().map(output).collect();
    text += &section("reads", rows(node.kind, &under, &reads));
    text += &section("publishes", rows(node.kind, &under, &publishes));
    text += &keys(kind);
    let common = COMMON_KEYS.iter().map(|(key, doc)| vec![(*key).to_owned(), (*doc).to_owned()]);
    text + &section("keys of [operator.NAME] that every operator has", common.collect())
}

/// Settings under which kinds have other ports, with labels.
fn settings_that_matter(registry: &Registry) -> Vec<(&'static str, Setup)> {
    const TEXTS: [(&str, &str); 7] = [
        ("", ""),
        ("behind a detector", "perception.detector = \"custom\""),
        ("execution.model = \"periodic\"", "execution.model = \"periodic\""),
        ("on a ladder", "perception.ladder = true\nplanning.ladder = \"fot@d3\""),
        ("gate.enabled = true", "gate.enabled = true"),
        ("of a lidar", "[lidar.any]\n[monitor.sensor_monitor]\nsensor = \"any\""),
        ("in `swerve live`", "[live]"),
    ];
    let read = |text: &str| Setup::new(toml::from_str(text).expect("a test reads each of them"), registry);
    TEXTS.iter().map(|(name, text)| (*name, read(text))).collect()
}

/// Ports of a kind: unconditional ones first, then the others with the settings under which they exist.
fn rows(
    kind: &str,
    under: &[(&'static str, Setup)],
    ports: &dyn Fn(&Settings<'_>) -> Vec<Vec<String>>,
) -> Vec<Vec<String>> {
    let boxes = [PayloadType::of::<Detections>()];
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut seen: Vec<Vec<String>> = Vec::new();
    for (name, setup) in under {
        let offered = if setup.perception.emulates() { &boxes[..] } else { &[] };
        for mut row in ports(&Settings { name: kind, setup, offered }) {
            if seen.contains(&row) {
                continue;
            }
            seen.push(row.clone());
            if let Some(doc) = row.last_mut().filter(|_| !name.is_empty()) {
                *doc = format!("{doc} ({name})").trim_start().to_owned();
            }
            rows.push(row);
        }
    }
    rows
}

fn input(port: &PortInfo) -> Vec<String> {
    let how = match port.mode {
        PortMode::At => "of the frame's stamp".to_owned(),
        PortMode::Latest => "the newest".to_owned(),
        PortMode::Window(n) => format!("the last {n}"),
        PortMode::Every => "timer".to_owned(),
    };
    let many = if port.many { ", any number" } else { "" };
    let optional = if port.optional { ", may be left out" } else { "" };
    let feedback = if port.feedback { ", over a feedback edge" } else { "" };
    let payload = port.payload.map(|payload| payload.name()).unwrap_or_default();
    vec![port.name.to_string(), payload, format!("{how}{many}{optional}{feedback}"), port.doc.to_owned()]
}

fn output(port: &OutputInfo) -> Vec<String> {
    vec![port.name.to_string(), port.payload.name(), port.doc.to_owned()]
}

/// Keys of a kind with their defaults: its own, or those of the tables that configure it.
fn keys(kind: &dyn OperatorKind) -> String {
    let node = kind.node();
    let mut text = String::new();
    for section in node.sections() {
        let title = match section.table() {
            None => "[operator.NAME]".to_owned(),
            Some(table) if section.is_of_each() => format!("[operator.NAME] or [{table}.NAME]"),
            Some(table) => format!("[{table}], or of [operator.NAME] for one alone"),
        };
        let keys = defaults(&section.defaults(), section.keys().unwrap_or_default());
        if !keys.is_empty() {
            text += &format!("\nkeys of {title}\n{keys}");
        }
    }
    text
}

/// One line for each key of a table and its subtables; `known` lists all keys, with or without a default.
fn defaults(table: &toml::Table, known: &[&str]) -> String {
    fn lines(prefix: &str, value: &toml::Value, into: &mut Vec<String>) {
        match value {
            toml::Value::Table(inner) if !inner.is_empty() => {
                inner.iter().for_each(|(key, value)| lines(&format!("{prefix}.{key}"), value, into));
            }
            value => into.push(format!("  {prefix} = {value}\n")),
        }
    }
    let mut all = Vec::new();
    table.iter().for_each(|(key, value)| lines(key, value, &mut all));
    let without = known.iter().filter(|key| !table.contains_key(**key));
    all.extend(without.map(|key| format!("  {key}: no default\n")));
    all.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kind_lists_all_its_ports_and_keys() {
        let registry = Registry::standard();
        for (kind, tells) in [
            ("tracker", &["boxes", "Detections", "(behind a detector)", "tracker = {}", "  reads  "][..]),
            (
                "planner",
                &["tick", "(execution.model = \"periodic\")", "rung", "ladder: no default", "cost.fot.fast"],
            ),
            ("controller", &["Command", "MotionCommand", "(gate.enabled = true)", "following: no default"]),
            ("camera", &["in `swerve live`", "width_px = ", "at_m = ", "noise"]),
            ("sensor_monitor", &["cloud", "(of a lidar)", "sensor = \"\"", "output = \"rgb\""]),
            ("imu", &["sensing", "imu.gyro_noise_radps = ", "pose.", "  runtime  ", "  deadline  "]),
        ] {
            let told = show(&**registry.kind(kind).unwrap(), &registry);
            for part in tells {
                assert!(told.contains(part), "{kind}: no {part}\n{told}");
            }
        }
        for kind in registry.kinds() {
            let told = show(&**kind, &registry);
            for (key, _) in COMMON_KEYS {
                assert!(told.lines().any(|line| line.trim_start().starts_with(key)), "{key}\n{told}");
            }
        }
    }
}
