//! The egos of a scenario: one table `[ego]`, or a table `[ego.NAME]` for each.

use swerve_text::TableReader;
use toml::Value;

use super::{ANGLE, PLACE, SPEED};
use crate::EgoStart;

/// Keys of the table of an ego.
const KEYS: [&str; 9] =
    ["s_m", "d_m", "heading_rad", "target_speed_mps", "start_speed_mps", "end_m", "start", "via", "goal"];

/// Largest number of egos: each has a stack of its own.
const EGOS_MAX: usize = 64;

/// Name of the ego of a table `[ego]`.
const EGO: &str = "ego";

/// Table of one ego, with its name.
pub(super) struct EgoTable<'r> {
    pub(super) name: String,
    pub(super) table: TableReader<'r>,
}

/// Tables of all egos, in the order of the text; empty after a problem.
pub(super) fn tables<'r>(top: &TableReader<'r>) -> Vec<EgoTable<'r>> {
    let is_named = |(key, value): (&String, &Value)| value.is_table() && !KEYS.contains(&key.as_str());
    let has_names =
        top.value("ego").and_then(Value::as_table).is_some_and(|table| table.iter().any(is_named));
    let Some(table) = top.table("ego") else { return Vec::new() };
    if !has_names {
        return vec![EgoTable { name: EGO.to_owned(), table }];
    }
    let names = table.keys();
    if names.len() > EGOS_MAX {
        table.report_whole(format!("expected at most {EGOS_MAX} egos, found {}", names.len()));
        table.reading().guess();
        return Vec::new();
    }
    let is_name = |name: &str| {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        !name.is_empty() && name.chars().all(is_plain) && name != EGO && !KEYS.contains(&name)
    };
    let read = |name: &str| {
        if !is_name(name) {
            let what = "expected a table of an ego, with a name of letters, digits and underscores";
            let taken = format!(", other than `{EGO}` and the keys of an ego");
            let is_taken = name == EGO || KEYS.contains(&name);
            table.report(name, what.to_owned() + if is_taken { &taken } else { "" });
            table.reading().guess();
            return None;
        }
        Some(EgoTable { name: name.to_owned(), table: table.named_table(name)? })
    };
    names.into_iter().filter_map(read).collect()
}

/// Reads start, speeds and goal of an ego on a road that the scenario describes.
pub(super) fn on_strip(table: &TableReader<'_>) -> EgoStart {
    let ego = EgoStart {
        s_m: table.number_or("s_m", 0.0, PLACE),
        d_m: table.number_or("d_m", 0.0, PLACE),
        heading_rad: table.number_or("heading_rad", 0.0, ANGLE),
        target_speed_mps: table.number("target_speed_mps", SPEED),
        start_speed_mps: table.number_if_any("start_speed_mps", SPEED),
        end_m: table.number("end_m", PLACE),
    };
    table.finish();
    ego
}
