//! What a configuration may say at a key beyond the form of its type: within which ends a number, which of some names a text.
//!
//! The ends are the reader's own: what it says of a number far outside names them, and numbers just beside them are
//! given to it to see on which side of each they are taken. So an end that depends on another key is none here.

use std::collections::BTreeMap;

use schemars::Schema;
use serde_json::{Map, Number, Value};
use swerve_scene::WeatherPreset;
use swerve_stack::config::{Config, detectors};
use swerve_text::parse_assignment;

use crate::key::{Choice, Key};
use crate::schema::{Arrays, keys_with_places};

/// Keywords of a JSON schema with their values.
type Keywords = Map<String, Value>;

/// Puts the limits of all keys into the schema of a configuration, where their values stand. A place that stands for several
/// keys takes what holds for all of them.
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
    range(&key.key, &key.form).map_or_else(Keywords::new, |range| ends(&key.key, &key.form, &range))
}

/// Names that a text may be, where the type does not say them and there are no others.
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

/// The same with other spellings that the reader takes.
fn accepted_names(key: &str) -> Vec<String> {
    let carla =
        WeatherPreset::ALL.iter().filter(|_| key == "render.weather").map(|preset| format!("{preset:?}"));
    known_names(key).into_iter().map(|choice| choice.name).chain(carla).collect()
}

/// What the check of a configuration says of a number that is far too large, or too small.
pub(crate) fn range(key: &str, form: &str) -> Option<String> {
    const FAR: [&str; 6] = ["1e300", "-1e300", "4000000000000000000", "4000000000", "255", "0"];
    if !matches!(form, "number" | "whole number") {
        return None;
    }
    // That a number has to be a whole one tells its type, a choice of names tells of other keys.
    let is_range = |told: &String| {
        !["a whole number", "one of", "exactly one of"].iter().any(|start| told.starts_with(start))
    };
    let told = FAR.iter().filter_map(|value| expected(key, value)).find(is_range);
    told.or_else(|| expected(key, "-1").filter(|told| told.starts_with("a whole number")))
}

/// What the check says that it expected in the place of a value; none where it takes it.
fn expected(key: &str, value: &str) -> Option<String> {
    let key = key.replace("NAME", "any");
    let set = parse_assignment(&format!("{key}={value}")).ok()?;
    let problems = Config::load(None, &[set]).err()?;
    let told = problems.iter().find(|problem| problem.key == key)?;
    let (_, expected) = told.message.split_once("expected ")?;
    let expected = expected.split(", found").next()?.split("; ").next()?;
    Some(expected.to_owned())
}

/// The ends of a range that is told in words.
fn ends(key: &str, form: &str, range: &str) -> Keywords {
    let whole = form == "whole number";
    let text = |x: f64| if whole { format!("{x:.0}") } else { format!("{x:e}") };
    let is_out = |x: f64| expected(key, &text(x)).as_deref() == Some(range);
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

/// The numbers in a text; nothing is where one says that something is not negative.
fn numbers(text: &str) -> Vec<f64> {
    let words = text.split([' ', ',']).filter_map(|word| word.parse().ok());
    let zero = text.contains("not negative").then_some(0.0);
    words.chain(zero).filter(|x: &f64| x.abs() < 1e15).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_those_of_the_reader() {
        let of = |key: &str, form: &str| {
            let keywords = ends(key, form, &range(key, form).unwrap());
            keywords
                .into_iter()
                .map(|(keyword, end)| format!("{keyword} {end}"))
                .collect::<Vec<_>>()
                .join(", ")
        };
        for (key, form, wanted) in [
            ("planning.added_latency_ms", "number", "maximum 100000, minimum 0"),
            ("sim.dt_ms", "number", "maximum 20, minimum 1"),
            ("camera.NAME.vignetting", "number", "maximum 1, minimum 0"),
            ("sim.vehicle.tyre.friction", "number", "exclusiveMinimum 0, maximum 4"),
            ("seed", "whole number", "minimum 0"),
            ("log.jpeg_quality", "whole number", "maximum 100, minimum 1"),
        ] {
            assert_eq!(of(key, form), wanted, "{key}");
        }
    }
}
