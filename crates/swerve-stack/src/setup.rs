//! Setup of a run: its configuration, and what no file can hold.

use core::ops::{Deref, DerefMut};

use crate::config::Config;
use crate::config::programs::Consent;
use crate::course::Course;
use crate::registry::Registry;

/// Configuration of a run with the kinds that it can name, the commands that the world replays, and the user's consent.
///
/// Dereferences to its configuration.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Configuration.
    pub config: Config,
    /// Kinds of operators and algorithms that the configuration can name.
    pub registry: Registry,
    /// Commands that the simulated world replays first, and the record of those that it took.
    pub course: Option<Course>,
    /// Programs that the user allows the run to start.
    pub consent: Consent,
}

impl Setup {
    /// Setup of a configuration with a registry, without replayed commands and consent.
    pub fn new(config: Config, registry: &Registry) -> Self {
        Self { config, registry: registry.clone(), course: None, consent: Consent::default() }
    }

    /// The same setup with another configuration.
    #[must_use]
    pub fn with_config(&self, config: Config) -> Self {
        Self { config, ..self.clone() }
    }
}

/// Setup with Swerve's own kinds.
impl From<Config> for Setup {
    fn from(config: Config) -> Self {
        Self { config, ..Self::default() }
    }
}

impl Deref for Setup {
    type Target = Config;

    fn deref(&self) -> &Config {
        &self.config
    }
}

impl DerefMut for Setup {
    fn deref_mut(&mut self) -> &mut Config {
        &mut self.config
    }
}
