//! JSON schemas of the files that people write (<https://json-schema.org>).
//!
//! Those of configurations, studies and timing files come of the types that the files are read into. A scenario is read
//! key by key, so that its schema stands in a file; the tests below hold it against the reader.

use std::sync::LazyLock;

use schemars::{Schema, schema_for};
use serde_json::Value;
use swerve_stack::config::Config;
use swerve_study::grid::StudyFile;

use crate::limits;

/// A kind of file.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
pub enum FileKind {
    /// Which algorithms, how long each takes: `-c FILE`
    Config,
    /// A road, the ego, other actors, what is expected
    Scenario,
    /// What `swerve study` varies
    Study,
    /// What `swerve timing` reads
    Timing,
}

impl FileKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Config, Self::Scenario, Self::Study, Self::Timing];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Config => "config",
            Self::Scenario => "scenario",
            Self::Study => "study",
            Self::Timing => "timing",
        }
    }

    /// Its JSON schema.
    pub fn schema(self) -> Schema {
        match self {
            Self::Config => {
                // The reader is asked for thousands of numbers.
                static CONFIG: LazyLock<Schema> = LazyLock::new(config);
                CONFIG.clone()
            }
            Self::Scenario => {
                serde_json::from_str(include_str!("scenario.json")).expect("a test reads the same file")
            }
            Self::Study => schema_for!(StudyFile),
            Self::Timing => swerve_timing::schema(),
        }
    }
}

/// The schema of a configuration. No key is required: one that is left out has a default, or stands in another file
/// of several.
fn config() -> Schema {
    let mut schema = schema_for!(Config).to_value();
    require_nothing(&mut schema, false);
    let mut schema = Schema::try_from(schema).expect("a schema with less in it is one");
    limits::narrow(&mut schema);
    schema
}

/// Takes `required` out of all tables but those that it tells apart.
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
        // Of an array of choices each one is.
        Value::Array(all) => all.iter_mut().for_each(|one| require_nothing(one, is_choice)),
        _ => {}
    }
}

#[cfg(test)]
mod tests;
