//! Kinds of operators: all that the house knows of one stands in one place.
//!
//! An operator type that implements [`Kind`] is a kind that configurations can name. One whose ports depend on its
//! settings implements [`OperatorKind`] itself.

use core::marker::PhantomData;

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::{Span, Time};
use swerve_flow::{NamedInputs, NamedOutputs, Operator, OutputInfo, Payload, PayloadType, PortInfo, Timer};
use swerve_flow::{RuntimeModel, every};
use swerve_scenario::sensor_phase;

use crate::config::Config;
use crate::config::clock::Clock;
use crate::registry::Registry;
use crate::site::Site;

/// What is wrong with settings, by key.
pub type KeyProblems = Vec<(String, String)>;

/// What the house knows of a kind of operator.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Node {
    /// Its name in `kind = "..."`.
    pub kind: &'static str,
    /// What it does, in one line.
    pub doc: &'static str,
    /// The tables of the configuration whose keys `[operator.NAME]` sets for this one operator.
    pub sections: &'static [&'static str],
    /// The table whose entry of the operator's name holds its settings: `[camera.front]` for `front`.
    pub named_section: Option<&'static str>,
    /// The setting under which it takes part, as a configuration writes it; none where that is told by other means.
    pub only_with: Option<&'static str>,
    /// Why its steps are taken where the run is driven; none where another process may take them.
    pub stays: Option<&'static str>,
    /// Only another process can take its steps: this program has none for it.
    pub elsewhere: bool,
    /// When its steps are worth a thread of their own.
    pub heavy: Heavy,
    /// Where it stands.
    pub role: Role,
    /// Which of those it is that the models of `[execution]` schedule, if one.
    pub scheduled: Option<Scheduled>,
    /// Its messages derive from their own stamp.
    pub origin: bool,
    /// It runs where an operator reads it or `log.sensors` names it.
    pub on_demand: bool,
    /// A replay computes it again wherever it is cut: it follows from what comes from the world, which a log holds.
    pub follows_from_world: bool,
}

/// Where an operator stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    /// It is the simulated world.
    World,
    /// It measures the world; `log.sensors` can name it.
    Sensor,
    /// It is fed from outside.
    Input,
    /// Behind these.
    Stack,
}

/// What the models of `[execution]` schedule.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scheduled {
    /// A detector that has rungs, or is emulated.
    Detector,
    /// The motion planner.
    Planner,
}

/// When the steps of an operator are worth a worker thread.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Heavy {
    /// Never.
    No,
    /// Against the real clock, so that nobody waits for them; in virtual time they leave their work to other threads
    /// themselves.
    OnWallClock,
    /// Always.
    Yes,
}

impl Node {
    /// A kind that another process may run, with keys of its own.
    pub const fn new(kind: &'static str, doc: &'static str) -> Self {
        Self {
            kind,
            doc,
            sections: &[],
            named_section: None,
            only_with: None,
            stays: None,
            elsewhere: false,
            heavy: Heavy::No,
            role: Role::Stack,
            scheduled: None,
            origin: false,
            on_demand: false,
            follows_from_world: false,
        }
    }

    /// A sensor of the simulated world, which runs where the world is.
    pub const fn sensor(kind: &'static str, doc: &'static str) -> Self {
        let node = Self::new(kind, doc).stays("sensors are where the world is");
        Self { role: Role::Sensor, ..node }
    }

    /// Where it stands, if not in the stack.
    #[must_use]
    pub const fn role(mut self, role: Role) -> Self {
        self.role = role;
        self
    }

    /// Its settings are these tables of the configuration.
    #[must_use]
    pub const fn sections(mut self, sections: &'static [&'static str]) -> Self {
        self.sections = sections;
        self
    }

    /// Its settings are an entry of this table.
    #[must_use]
    pub const fn named_section(mut self, section: &'static str) -> Self {
        self.named_section = Some(section);
        self
    }

    /// It takes part under this setting alone.
    #[must_use]
    pub const fn only_with(mut self, setting: &'static str) -> Self {
        self.only_with = Some(setting);
        self
    }

    /// Its steps are taken where the run is driven.
    #[must_use]
    pub const fn stays(mut self, why: &'static str) -> Self {
        self.stays = Some(why);
        self
    }

    /// Only another process can take its steps.
    #[must_use]
    pub const fn elsewhere(mut self) -> Self {
        self.elsewhere = true;
        self
    }

    /// Its steps are worth a worker thread.
    #[must_use]
    pub const fn heavy(mut self, heavy: Heavy) -> Self {
        self.heavy = heavy;
        self
    }

    /// The models of `[execution]` say when it runs and how long it may take.
    #[must_use]
    pub const fn scheduled(mut self, scheduled: Scheduled) -> Self {
        self.scheduled = Some(scheduled);
        self
    }

    /// Its messages derive from their own stamp.
    #[must_use]
    pub const fn origin(mut self) -> Self {
        self.origin = true;
        self
    }

    /// It runs where it is read.
    #[must_use]
    pub const fn on_demand(mut self) -> Self {
        self.on_demand = true;
        self
    }

    /// A replay computes it again wherever it is cut.
    #[must_use]
    pub const fn follows_from_world(mut self) -> Self {
        self.follows_from_world = true;
        self
    }
}

/// One operator of a configuration: its name, and the configuration as it stands for it.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// The operator's name.
    pub name: &'a str,
    /// The configuration, with what `[operator.NAME]` sets in the sections of its kind.
    pub config: &'a Config,
    /// What the operators of the pipeline publish.
    pub offered: &'a [PayloadType],
}

impl Settings<'_> {
    /// Whether an operator of the pipeline publishes messages of this type.
    pub fn offers<T: Payload>(&self) -> bool {
        self.offered.contains(&PayloadType::of::<T>())
    }

    /// A timer whose first tick is drawn from the seed, where the run draws at all.
    pub fn drawn_timer(&self, period: Span) -> Timer {
        every(period).phase(self.phase(period))
    }

    /// The first tick of such a timer.
    pub fn phase(&self, period: Span) -> Span {
        let Config { seed, sim, .. } = self.config;
        match sim.draws && self.config.live.is_none() {
            true => sensor_phase(*seed, self.name, period, span_of_ms(sim.dt_ms)),
            false => Span::ZERO,
        }
    }

    /// Whether the run lives by the real clock.
    pub fn on_wall_clock(&self) -> bool {
        self.config.clock.source == Clock::Wall
    }
}

/// A time that the configuration's check has seen.
pub fn span_of_ms(ms: f64) -> Span {
    Span::from_secs(ms * 1e-3)
}

/// The same as an instant of the run.
pub fn time_of_ms(ms: f64) -> Time {
    Time::ZERO + span_of_ms(ms)
}

/// What lies between the stamp of a sensor's message and its readers: run time of its operator, which therefore has
/// several frames under way. Where `[operator.NAME]` gives a run time, that comes before it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OnItsWay {
    /// From the stamp to the readers.
    pub after: Span,
    /// Frames under way at once.
    pub frames: usize,
}

/// A kind of operator, as an assembly sees it.
pub trait OperatorKind: Send + Sync {
    /// What the house knows of it.
    fn node(&self) -> Node;

    /// Why its steps are taken where the run is driven under these settings; none where another process may take them.
    fn stays(&self, _settings: &Settings<'_>) -> Option<&'static str> {
        self.node().stays
    }

    /// Its own keys with their defaults.
    fn keys(&self) -> toml::Table {
        toml::Table::new()
    }

    /// The schema of its own keys, where it tells one: `swerve keys` lists them by it.
    fn schema(&self) -> Option<schemars::Schema> {
        None
    }

    /// What is wrong with its own keys.
    fn problems(&self, keys: &toml::Table, _registry: &Registry) -> KeyProblems {
        let unknown = |key: &String| (key.clone(), format!("unknown key: a `{}` has none", self.node().kind));
        keys.keys().map(unknown).collect()
    }

    /// Whether there is one under these settings.
    fn is_there(&self, _settings: &Settings<'_>) -> bool {
        true
    }

    /// What it publishes, in the order of its ports.
    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo>;

    /// Whether an output stays silent under these settings: nobody is connected to it by its type.
    fn is_silent(&self, _settings: &Settings<'_>, _output: &str) -> bool {
        false
    }

    /// Why an output holds nothing at all under these settings, where that is so: nobody may read it.
    fn is_empty(&self, _settings: &Settings<'_>, _output: &str) -> Option<String> {
        None
    }

    /// What it reads, in the order of its ports.
    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo>;

    /// The streams that its settings name, by port.
    fn reads(&self, _settings: &Settings<'_>) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// How long its steps take where `[operator.NAME]` does not say it.
    ///
    /// # Errors
    /// What is wrong with the settings that say it.
    fn runtime(&self, _settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        Ok(RuntimeModel::Zero)
    }

    /// What its steps take where `[operator.NAME]` does not say it, usually and at most, ms; none where nothing does.
    fn takes_ms(&self, _settings: &Settings<'_>) -> Option<[f64; 2]> {
        None
    }

    /// What lies between a sensor's stamp and its readers.
    fn on_its_way(&self, _settings: &Settings<'_>) -> Option<OnItsWay> {
        None
    }

    /// Delay of its streams beside that of `[operator.NAME]`, ms.
    fn added_delay_ms(&self, _settings: &Settings<'_>) -> f64 {
        0.0
    }

    /// Adds it to the graph.
    ///
    /// # Errors
    /// When what its settings ask for is not to be had.
    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()>;
}

/// An operator that configurations can name.
///
/// `[operator.NAME] kind = "..."` makes one; its other keys are read as a [`Table`](Self::Table).
pub trait Kind: Operator<In: NamedInputs, Out: NamedOutputs> + Sized {
    /// What the house knows of it.
    const NODE: Node;

    /// Its keys; unknown ones are refused if it says so (`#[serde(deny_unknown_fields, default)]`).
    type Table: Serialize + DeserializeOwned + Default;

    /// Makes one.
    ///
    /// # Errors
    /// When what its settings ask for is not to be had.
    fn new(table: Self::Table, site: &Site<'_>) -> anyhow::Result<Self>;

    /// What is wrong with values of its keys.
    fn problems(_table: &Self::Table) -> KeyProblems {
        Vec::new()
    }

    /// The timer of its [`Every`](swerve_flow::Every) port, where it has one.
    fn timer(_table: &Self::Table, _settings: &Settings<'_>) -> Option<Timer> {
        None
    }

    /// Whether there is one under these settings.
    fn is_there(_settings: &Settings<'_>) -> bool {
        true
    }

    /// How long its steps take where `[operator.NAME]` does not say it.
    ///
    /// # Errors
    /// What is wrong with the settings that say it.
    fn runtime(_table: &Self::Table, _settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        Ok(RuntimeModel::Zero)
    }
}

/// The keys of a kind that has none of its own.
#[derive(Default, Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoKeys {}

/// A [`Kind`] in a registry.
pub(crate) struct Registered<K>(PhantomData<fn() -> K>);

impl<K> Registered<K> {
    pub(crate) const fn new() -> Self {
        Self(PhantomData)
    }
}

impl<K: Kind> Registered<K> {
    /// The operator's own keys, which the configuration's check has read already.
    fn table(settings: &Settings<'_>) -> Result<K::Table, String> {
        // Keys of a section are in the configuration as it stands for this operator.
        if !K::NODE.sections.is_empty() || K::NODE.named_section.is_some() {
            return Ok(K::Table::default());
        }
        let own = settings.config.operator.get(settings.name).map(|own| own.keys.clone());
        swerve_text::read(&own.unwrap_or_default()).map_err(|problems| swerve_text::in_one_line(&problems))
    }
}

impl<K: Kind> OperatorKind for Registered<K> {
    fn node(&self) -> Node {
        K::NODE
    }

    fn keys(&self) -> toml::Table {
        toml::Table::try_from(K::Table::default()).unwrap_or_default()
    }

    fn problems(&self, keys: &toml::Table, _registry: &Registry) -> KeyProblems {
        swerve_text::read::<K::Table>(keys).map_or_else(|problems| problems, |table| K::problems(&table))
    }

    fn is_there(&self, settings: &Settings<'_>) -> bool {
        K::is_there(settings)
    }

    fn outputs(&self, _settings: &Settings<'_>) -> Vec<OutputInfo> {
        K::Out::ports()
    }

    fn inputs(&self, _settings: &Settings<'_>) -> Vec<PortInfo> {
        K::In::ports()
    }

    fn runtime(&self, settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        K::runtime(&Self::table(settings)?, settings)
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let wrong = |message| anyhow::anyhow!("operator.{}: {message}", site.name());
        let timer = K::timer(&Self::table(&site.settings()).map_err(wrong)?, &site.settings());
        let operator = K::new(Self::table(&site.settings()).map_err(wrong)?, site)?;
        site.add(operator, timer)
    }
}
