//! Valid names of a text, where its type does not contain them.

use schemars::Schema;
use serde_json::{Value, json};
use swerve_scene::WeatherPreset;
use swerve_stack::Registry;
use swerve_stack::config::detectors;

use crate::key::Choice;
use crate::schema::{Arrays, keys_with_places};

/// Adds these names, those of operator kinds, and those of algorithms of the registry to the schema of a configuration.
pub(crate) fn narrow(schema: &mut Schema, registry: &Registry) {
    let mut whole = schema.clone().to_value();
    for (key, place) in keys_with_places(schema, "", None, Arrays::Whole) {
        let mut names = accepted_names(&key.key);
        if key.key == "operator.NAME.kind" {
            names.extend(registry.kinds().map(|kind| kind.node().kind.to_owned()));
        }
        let Some(Value::Object(node)) = whole.pointer_mut(&place) else { continue };
        if !names.is_empty() {
            node.insert("enum".to_owned(), names.into());
        }
        if let Some(Value::Array(choices)) = node.get_mut("oneOf") {
            let is_known = |name: &str| key.choices.iter().any(|choice| choice.name == name);
            let custom = algorithms(&key.key, registry).into_iter().filter(|name| !is_known(name));
            choices.extend(custom.map(|name| json!({ "type": "string", "const": name })));
        }
    }
    *schema = Schema::try_from(whole).expect("a schema with more in it is one");
}

/// Names of the algorithms that a key can name; the type of the key lists the built-in ones.
pub(crate) fn algorithms(key: &str, registry: &Registry) -> Vec<&'static str> {
    match key {
        "control.controller" => registry.controllers().collect(),
        "localization.localizer" => registry.localizers().collect(),
        "operator.NAME.detector" => registry.detectors().collect(),
        "planning.planner" => registry.planners().collect(),
        "prediction.predictor" => registry.predictors().collect(),
        _ => Vec::new(),
    }
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
