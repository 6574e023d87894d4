//! Limits of a key beyond its type: the range of a number, and the valid names of a text.
//!
//! The limits are the reader's own: its error for a number far outside states them, and numbers next to them are passed
//! to it to determine which side is accepted. A limit that depends on another key is therefore not included.

use std::collections::BTreeMap;

use schemars::Schema;
use serde_json::{Map, Number, Value};
use swerve_scene::WeatherPreset;
use swerve_stack::config::{Config, detectors};
use swerve_text::{Document, parse_assignment};

use crate::key::{Choice, Key};
use crate::schema::{Arrays, keys_with_places};

/// Keywords of a JSON schema with their values.
type Keywords = Map<String, Value>;

/// Adds the limits of all keys to the schema of a configuration. A place that several keys share gets the limits common
/// to all of them.
pub(crate) fn narrow(schema: &mut Schema) {
    let mut at: BTreeMap<String, Vec<Keywords>> = BTreeMap::new();
    for (key, place) in keys_with_places(schema, "", None, Arrays::Whole) {
        at.entry(place).or_default().push(keywords(&key));
    }
    let mut whole = schema.clone().to_value();
    for (place, all) in at {
        let same = all.iter().all(|one| *one == all[0]);
        if let Some(Value::Object(node)) = whole.pointer_mut(&place).filter(|_| same) {
            node.extend(all[0].clone());
        }
    }
    *schema = Schema::try_from(whole).expect("a schema with more in it is one");
}

fn keywords(key: &Key) -> Keywords {
    let names = accepted_names(&key.key);
    if !names.is_empty() {
        return Keywords::from_iter([("enum".to_owned(), names.into())]);
    }
    if !matches!(key.form.as_str(), "number" | "whole number") {
        return Keywords::new();
    }
    range(key).map_or_else(Keywords::new, |range| ends(key, &range))
}

/// Complete list of valid names of a text, where the type does not contain them.
pub(crate) fn known_names(key: &str) -> Vec<Choice> {
    let choice = |name: &str, doc: &str| Choice { name: name.to_owned(), doc: doc.to_owned() };
    match key {
        "perception.detector" => {
            let own = [
                choice("truth", "Nothing is emulated: all that is visible is reported."),
                choice("custom", "By the numbers of [perception] alone."),
            ];
            own.into_iter().chain(detectors::published().iter().map(|d| choice(&d.name, ""))).collect()
        }
        "render.weather" => WeatherPreset::ALL.iter().map(|weather| choice(weather.name(), "")).collect(),
        _ => Vec::new(),
    }
}

/// These names with the other spellings accepted by the reader.
fn accepted_names(key: &str) -> Vec<String> {
    let carla =
        WeatherPreset::ALL.iter().filter(|_| key == "render.weather").map(|preset| format!("{preset:?}"));
    known_names(key).into_iter().map(|choice| choice.name).chain(carla).collect()
}

/// Settings without which the check does not reach a key, by key prefix: a preset, or adjacent keys without a default.
const NEEDED: [(&str, &str); 9] = [
    ("execution.detector_ms", "execution.model = \"periodic\"\nperception.detector = \"efficientdet-d5@d3\""),
    ("execution.planner_ms", "execution.model = \"periodic\""),
    ("operator.NAME.runtime.work", "operator.any.runtime.work = { per_unit_us = 1.0 }"),
    ("perception.params", "perception.detector = \"custom\""),
    ("planning.cost.NAME.NAME.work", "planning.cost.fot.fast.work = { per_unit_us = 1.0 }"),
    ("planning.rules", "planning.preset = \"paper\""),
    ("sensing.mount", "sensing.mount = { x_m = 1.0, y_m = 0.0, z_m = 1.9, yaw_rad = 0.0 }"),
    (
        "sim.vehicle.tyre.lateral",
        "sim.vehicle.tyre.lateral = { stiffness = 22.0, shape = 1.4, curvature = 0.0 }",
    ),
    (
        "sim.vehicle.tyre.longitudinal",
        "sim.vehicle.tyre.longitudinal = { stiffness = 22.0, shape = 1.6, curvature = 0.4 }",
    ),
];

/// Configuration as TOML in which a key of the list can be set, and its path there.
fn surroundings(key: &Key) -> (toml::Table, String) {
    let needed = NEEDED.iter().find(|(start, _)| key.key.starts_with(start)).map_or("", |(_, needed)| needed);
    let mut table: toml::Table = needed.parse().expect("a test asks for every key");
    let place = key.key.replace("planning.cost.NAME.NAME", "planning.cost.fot.fast").replace("NAME", "any");
    let section = ["planning", "perception.tracker", "operator.any"]
        .into_iter()
        .find(|section| place.starts_with(section));
    for setting in key.only_with.iter().flat_map(|with| with.split(", ")) {
        let setting = setting.replace(" = ", "=");
        if let (Ok((name, value)), Some(section)) = (parse_assignment(&setting), section) {
            let _is_table = swerve_text::set(&mut table, &format!("{section}.{name}"), value);
        }
    }
    (table, place)
}

/// A number in the form of a key: an array holds it at every position.
fn of_form(form: &str, number: &toml::Value) -> Option<toml::Value> {
    if matches!(form, "number" | "whole number") {
        return Some(number.clone());
    }
    let of = form.strip_prefix("array of ")?;
    let counted = of.split_once(" x ").and_then(|(count, of)| Some((count.parse().ok()?, of)));
    let (count, of) = counted.unwrap_or((1, of));
    Some(toml::Value::Array(vec![of_form(of, number)?; count]))
}

/// Range stated by the check of a configuration for a number far too large or too small.
pub(crate) fn range(key: &Key) -> Option<String> {
    const FAR: [&str; 6] = ["1e300", "-1e300", "4000000000000000000", "4000000000", "255", "0"];
    // Messages about whole numbers concern the type, and choices of names belong to other keys.
    let is_range = |told: &String| {
        !["a whole number", "one of", "exactly one of"].iter().any(|start| told.starts_with(start))
    };
    let of_places = expected(key, FAR[0]);
    if key.form.starts_with("array") && of_places.windows(2).any(|two| two[0] != two[1]) {
        return None;
    }
    let told = FAR.iter().flat_map(|value| expected(key, value)).find(is_range);
    told.or_else(|| expected(key, "-1").into_iter().find(|told| told.starts_with("a whole number")))
}

/// Ranges expected by the check in place of a value; empty if the value is accepted.
fn expected(key: &Key, value: &str) -> Vec<String> {
    expected_with(key, value, &[])
}

/// Same as [`expected`], with other keys also set.
fn expected_with(key: &Key, value: &str, with: &[(String, toml::Value)]) -> Vec<String> {
    let (mut table, place) = surroundings(key);
    for (key, value) in with {
        if swerve_text::set(&mut table, key, value.clone()).is_err() {
            return Vec::new();
        }
    }
    let number =
        parse_assignment(&format!("x={value}")).ok().and_then(|(_, number)| of_form(&key.form, &number));
    let Some(number) = number else { return Vec::new() };
    if swerve_text::set(&mut table, &place, number).is_err() {
        return Vec::new();
    }
    let document = Document::parse("range", table.to_string());
    let problems =
        document.ok().and_then(|document| Config::from_document(&document, &[]).err()).unwrap_or_default();
    let is_here =
        |key: &str| key.strip_prefix(&place).is_some_and(|rest| rest.is_empty() || rest.starts_with('['));
    let here = problems.iter().filter(|problem| is_here(&problem.key));
    let ranges = here.filter_map(|problem| {
        let (_, expected) = problem.message.split_once("expected ")?;
        Some(expected.split(", found").next()?.split("; ").next()?.to_owned())
    });
    ranges.collect()
}

/// Limits of a range stated in words.
fn ends(key: &Key, range: &str) -> Keywords {
    let whole = key.form == "whole number";
    let text = |x: f64| if whole { format!("{x:.0}") } else { format!("{x:e}") };
    let is_out = |x: f64| expected(key, &text(x)).iter().any(|told| told == range);
    let mut found = Keywords::new();
    for end in numbers(range).into_iter().filter(|end| !whole || end.fract() == 0.0) {
        let beside = if whole { 1.0 } else { (end.abs() * 1e-6).max(1e-12) };
        let keyword = match (is_out(end - beside), is_out(end), is_out(end + beside)) {
            (true, false, false) => "minimum",
            (true, true, false) => "exclusiveMinimum",
            (false, false, true) => "maximum",
            (false, true, true) => "exclusiveMaximum",
            _ => continue,
        };
        let number = if end.fract() == 0.0 { Some(Number::from(end as i64)) } else { Number::from_f64(end) };
        found.extend(number.map(|number| (keyword.to_owned(), number.into())));
    }
    found
}

/// Numbers in a text; "not negative" counts as zero.
fn numbers(text: &str) -> Vec<f64> {
    let words = text.split([' ', ',']).filter_map(|word| word.parse().ok());
    let zero = text.contains("not negative").then_some(0.0);
    words.chain(zero).filter(|x: &f64| x.abs() < 1e15).collect()
}

#[cfg(test)]
mod tests;
