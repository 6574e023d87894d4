//! Settings of kinds of operators: typed tables of the configuration, or of `[operator.NAME]` alone.

use core::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_text::{Guessed, Misread};
use toml::{Table, Value};

use crate::config::Config;
use crate::problems::{KeyProblems, within};
use crate::setup::Setup;

/// Settings of a kind of operator as a type: those of `[operator.NAME]`, on top of a table of the configuration if it
/// has one for the kind.
pub struct Section<T: 'static> {
    base: Option<Base<T>>,
    problems: fn(&T, &Setup) -> KeyProblems,
}

/// Table of the configuration: one for all operators of a kind (`[planning]`), or one for each (`[camera.NAME]`).
pub(crate) struct Base<T: 'static> {
    pub(crate) name: &'static str,
    pub(crate) get: fn(&Config, &str) -> T,
    pub(crate) put: fn(&mut Config, &str, T),
    /// Names of the tables, if each operator has one.
    pub(crate) of_each: Option<fn(&Config) -> Vec<String>>,
}

/// Section with a table of the configuration: `of_config!(planning, problems)`, or `of_config!(camera.NAME, problems)`
/// where each operator has one.
macro_rules! of_config {
    ($table:ident, $problems:expr) => {
        $crate::section::Section::on(
            $crate::section::Base {
                name: stringify!($table),
                get: |config, _| config.$table.clone(),
                put: |config, _, settings| config.$table = settings,
                of_each: None,
            },
            $problems,
        )
    };
    ($table:ident.NAME, $problems:expr) => {
        $crate::section::Section::on(
            $crate::section::Base {
                name: stringify!($table),
                get: |config, name| config.$table.get(name).cloned().unwrap_or_default(),
                put: |config, name, settings| drop(config.$table.insert(name.to_owned(), settings)),
                of_each: Some(|config| config.$table.keys().cloned().collect()),
            },
            $problems,
        )
    };
}
pub(crate) use of_config;

impl<T> Section<T> {
    /// Settings of `[operator.NAME]` alone. `problems` reports invalid values by their keys.
    pub const fn own(problems: fn(&T, &Setup) -> KeyProblems) -> Self {
        Self { base: None, problems }
    }

    /// Settings on top of a table of the configuration.
    pub(crate) const fn on(base: Base<T>, problems: fn(&T, &Setup) -> KeyProblems) -> Self {
        Self { base: Some(base), problems }
    }
}

impl<T: DeserializeOwned + Default> Section<T> {
    /// Settings of an operator, whose keys already override those of the table; the defaults if they are invalid, which
    /// is reported where they are checked.
    pub fn get(&self, config: &Config, operator: &str) -> T {
        match &self.base {
            Some(base) => (base.get)(config, operator),
            None => {
                let own = config.operator.get(operator);
                own.and_then(|own| swerve_text::read(&own.keys).ok()).unwrap_or_default()
            }
        }
    }
}

/// A [`Section`] of any type.
pub trait AnySection: Sync {
    /// Name of the table of the configuration, if there is one.
    fn table(&self) -> Option<&'static str>;

    /// Returns true if each operator has a table of its name.
    fn is_of_each(&self) -> bool;

    /// All keys; `None` if any key is accepted.
    fn keys(&self) -> Option<&'static [&'static str]>;

    /// Keys with a default, and their defaults.
    fn defaults(&self) -> Table;

    /// Overrides settings of an operator by its own keys.
    ///
    /// # Errors
    /// Unknown keys and values of another form. The configuration then has the values as far as they can be repaired.
    fn override_by(
        &self,
        keys: &Table,
        config: &mut Config,
        operator: &str,
    ) -> Result<(), (KeyProblems, Guessed)>;

    /// Problems of the settings of an operator, by their keys in the section.
    fn problems(&self, setup: &Setup, operator: &str) -> KeyProblems;

    /// Problems of the table of the configuration, by their keys in the configuration.
    fn problems_of_table(&self, setup: &Setup) -> KeyProblems;
}

impl<T: Serialize + DeserializeOwned + Default> AnySection for Section<T> {
    fn table(&self) -> Option<&'static str> {
        self.base.as_ref().map(|base| base.name)
    }

    fn is_of_each(&self) -> bool {
        self.base.as_ref().is_some_and(|base| base.of_each.is_some())
    }

    fn keys(&self) -> Option<&'static [&'static str]> {
        swerve_text::keys::<T>("")
    }

    fn defaults(&self) -> Table {
        Table::try_from(T::default()).unwrap_or_default()
    }

    fn override_by(
        &self,
        keys: &Table,
        config: &mut Config,
        operator: &str,
    ) -> Result<(), (KeyProblems, Guessed)> {
        let mut table = match &self.base {
            Some(base) => Table::try_from((base.get)(config, operator)).expect("a table of plain values"),
            None => Table::new(),
        };
        for (key, value) in keys {
            match (table.get_mut(key), value) {
                // Of tables within the section, single keys are overridden.
                (Some(Value::Table(old)), Value::Table(new)) => old.extend(new.clone()),
                _ => drop(table.insert(key.clone(), value.clone())),
            }
        }
        let (settings, read) = match swerve_text::read_meant::<T>(&table) {
            Ok(settings) => (Some(settings), Ok(())),
            Err(Misread { problems, meant, guessed }) => (meant, Err((problems, guessed))),
        };
        match (&self.base, settings) {
            (_, None) => {}
            (Some(base), Some(settings)) => (base.put)(config, operator, settings),
            (None, Some(settings)) => {
                let own = config.operator.entry(operator.to_owned()).or_default();
                own.keys = Table::try_from(&settings).unwrap_or(table);
            }
        }
        read
    }

    fn problems(&self, setup: &Setup, operator: &str) -> KeyProblems {
        (self.problems)(&self.get(setup, operator), setup)
    }

    fn problems_of_table(&self, setup: &Setup) -> KeyProblems {
        let Some(base) = &self.base else { return KeyProblems::new() };
        let of = |key: &str, operator: &str| within(key, self.problems(setup, operator));
        match base.of_each {
            None => of(base.name, base.name),
            Some(names) => {
                names(setup).iter().flat_map(|name| of(&format!("{}.{name}", base.name), name)).collect()
            }
        }
    }
}

impl PartialEq for dyn AnySection {
    fn eq(&self, other: &Self) -> bool {
        self.table() == other.table() && self.keys() == other.keys()
    }
}

impl Eq for dyn AnySection {}

impl fmt::Debug for dyn AnySection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}]", self.table().unwrap_or("operator.NAME"))
    }
}
