//! Setup of a run: its configuration, and what no file can hold.

use core::ops::{Deref, DerefMut};

use crate::config::Config;
use crate::config::programs::{Consent, Layer, Refusal};
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

    /// Consents to all programs that it names, as requested by the user.
    pub fn allow_programs(&mut self) {
        self.consent = Consent::to_all(&self.config);
    }

    /// Consents to the programs named by the user's own texts; `layers` are all texts of the configuration, later ones
    /// overriding earlier ones. A value that no layer has is refused.
    pub fn trust(&mut self, layers: &[Layer]) {
        self.consent = Consent::by_layers(&self.config, layers);
    }

    /// Reason to start no program for a process: the user has not consented to it.
    pub fn refusal(&self, process: &str) -> Option<Refusal> {
        self.consent.refusal(&self.config, process)
    }

    /// The same setup with another configuration.
    #[must_use]
    pub fn with_config(&self, config: Config) -> Self {
        Self { config, ..self.clone() }
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
