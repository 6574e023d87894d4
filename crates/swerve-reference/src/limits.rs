//! Valid names of a text, where its type does not contain them.

use schemars::Schema;
use serde_json::Value;
use swerve_scene::WeatherPreset;
use swerve_stack::config::detectors;

use crate::key::Choice;
use crate::schema::{Arrays, keys_with_places};

/// Adds these names to the schema of a configuration.
pub(crate) fn narrow(schema: &mut Schema) {
    let mut whole = schema.clone().to_value();
    for (key, place) in keys_with_places(schema, "", None, Arrays::Whole) {
        let names = accepted_names(&key.key);
        if let Some(Value::Object(node)) = whole.pointer_mut(&place).filter(|_| !names.is_empty()) {
            node.insert("enum".to_owned(), names.into());
        }
    }
    *schema = Schema::try_from(whole).expect("a schema with more in it is one");
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

#[cfg(test)]
mod tests;
