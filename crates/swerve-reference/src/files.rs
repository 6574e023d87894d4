//! JSON schemas of the files that people write (<https://json-schema.org>).
//!
//! The schemas of configurations, studies and timing files are derived from the types that the files are read into. A
//! scenario is read key by key, so its schema is a file, which the tests below compare with the reader.

use schemars::{Schema, schema_for};
use serde_json::Value;
use swerve_stack::Registry;
use swerve_stack::config::Config;
use swerve_study::grid::StudyFile;

use crate::limits;

/// A kind of file.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
pub enum FileKind {
    /// Algorithms and their run times, passed with `-c FILE`
    Config,
    /// Road, ego, other actors, expected result
    Scenario,
    /// Axes of `swerve study`
    Study,
    /// Pipeline of `swerve timing`
    Timing,
}

impl FileKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Config, Self::Scenario, Self::Study, Self::Timing];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Config => "config",
            Self::Scenario => "scenario",
            Self::Study => "study",
            Self::Timing => "timing",
        }
    }

    /// JSON schema, with the names of the registry.
    pub fn schema(self, registry: &Registry) -> Schema {
        match self {
            Self::Config => config(registry),
            Self::Scenario => {
                serde_json::from_str(include_str!("scenario.json")).expect("a test reads the same file")
            }
            Self::Study => schema_for!(StudyFile),
            Self::Timing => swerve_timing::schema(),
        }
    }
}

/// Schema of a configuration. No key is required: an omitted one has a default, or is in another one of several files.
fn config(registry: &Registry) -> Schema {
    let mut schema = schema_for!(Config).to_value();
    require_nothing(&mut schema, false);
    let mut schema = Schema::try_from(schema).expect("a schema with less in it is one");
    limits::narrow(&mut schema, registry);
    schema
}

/// Removes `required` from all tables except those that distinguish choices.
fn require_nothing(schema: &mut Value, is_choice: bool) {
    match schema {
        Value::Object(keywords) => {
            if !is_choice && keywords.get("required").is_some_and(Value::is_array) {
                keywords.remove("required");
            }
            for (keyword, inner) in keywords {
                require_nothing(inner, ["anyOf", "oneOf"].contains(&keyword.as_str()));
            }
        }
        // Each entry of an array of choices is one.
        Value::Array(all) => all.iter_mut().for_each(|one| require_nothing(one, is_choice)),
        _ => {}
    }
}

#[cfg(test)]
mod tests;
