//! Kinds of operators: the one description of each that the stack uses.
//!
//! An operator type that implements [`Kind`] is a kind that configurations can name. A kind whose ports depend on its
//! settings implements [`OperatorKind`] itself.

use core::marker::PhantomData;

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::Span;
use swerve_flow::{NamedInputs, NamedOutputs, Operator, OutputInfo, Payload, PayloadType, PortInfo, Timer};
use swerve_flow::{RuntimeModel, every};
use swerve_scenario::sensor_phase;

use crate::config::Config;
use crate::config::clock::Clock;
use crate::config::domain::Domain;
use crate::config::execution::span_of_ms;
use crate::ladder::Ladder;
use crate::problems::KeyProblems;
use crate::section::{AnySection, Section};
use crate::setup::Setup;
use crate::site::Site;

/// Description of a kind of operator.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Node {
    /// Name in `kind = "..."`.
    pub kind: &'static str,
    /// Description in one line.
    pub doc: &'static str,
    /// Its settings; [`sections`](Self::sections) lists them.
    sections: [Option<&'static dyn AnySection>; 2],
    /// Setting under which it takes part, as written in a configuration; `None` if other keys decide it.
    pub only_with: Option<&'static str>,
    /// Reason that it has to run in the coordinator; `None` if a worker may run it.
    pub stays: Option<&'static str>,
    /// True if only another process can take its steps: this program cannot run it.
    pub elsewhere: bool,
    /// Clocks under which its steps run on a worker thread.
    pub heavy: Heavy,
    /// Role in the pipeline.
    pub role: Role,
    /// Role in the scheduling by the models of `[execution]`, if it has one.
    pub scheduled: Option<Scheduled>,
    /// True if `[operator.NAME] rungs` may change its keys from step to step: a step depends on its inputs alone, or the
    /// state is carried over.
    pub on_ladder: bool,
    /// True if its messages derive from their own stamp.
    pub origin: bool,
    /// True if it runs only where an operator reads it or `log.sensors` names it.
    pub on_demand: bool,
    /// True if a replay always recomputes it: it follows from the messages of the world, which a log has.
    pub follows_from_world: bool,
}

/// Role of an operator in the pipeline.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    /// The simulated world.
    World,
    /// A sensor of the world; `log.sensors` can name it.
    Sensor,
    /// An input from outside.
    Input,
    /// The driving stack, after these.
    Stack,
}

/// Operators that the models of `[execution]` schedule.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scheduled {
    /// A detector that has rungs or is emulated.
    Detector,
    /// The motion planner.
    Planner,
}

impl Scheduled {
    /// Key of `[execution]` for the length.
    pub(crate) const fn key(self) -> &'static str {
        match self {
            Self::Detector => "detector_ms",
            Self::Planner => "planner_ms",
        }
    }
}

/// Clocks under which an operator's steps run on a worker thread.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Heavy {
    /// Never.
    No,
    /// Under wall clock, so that other operators do not wait for them; in virtual time such operators use other threads
    /// themselves.
    OnWallClock,
    /// Always.
    Yes,
}

impl Node {
    /// A kind with its own keys that another process may run.
    pub const fn new(kind: &'static str, doc: &'static str) -> Self {
        Self {
            kind,
            doc,
            sections: [None; 2],
            only_with: None,
            stays: None,
            elsewhere: false,
            heavy: Heavy::No,
            role: Role::Stack,
            scheduled: None,
            on_ladder: false,
            origin: false,
            on_demand: false,
            follows_from_world: false,
        }
    }

    /// A sensor of the simulated world, which runs in the process of the world.
    pub const fn sensor(kind: &'static str, doc: &'static str) -> Self {
        let node = Self::new(kind, doc).stays("sensors are where the world is");
        Self { role: Role::Sensor, ..node }
    }

    /// Sets the role, which is the stack by default.
    #[must_use]
    pub const fn role(mut self, role: Role) -> Self {
        self.role = role;
        self
    }

    /// Adds settings.
    #[must_use]
    pub const fn section(mut self, section: &'static dyn AnySection) -> Self {
        let place = if self.sections[0].is_none() { 0 } else { 1 };
        assert!(self.sections[place].is_none(), "a kind has at most two sections");
        self.sections[place] = Some(section);
        self
    }

    /// Its settings. `[operator.NAME]` sets a key in the first section that has it.
    pub fn sections(&self) -> impl Iterator<Item = &'static dyn AnySection> + use<> {
        self.sections.into_iter().flatten()
    }

    /// Name of the table of the configuration with a table for each operator, if the kind has one.
    pub(crate) fn table_of_each(&self) -> Option<&'static str> {
        self.sections().find(|section| section.is_of_each())?.table()
    }

    /// Sets the setting under which it takes part.
    #[must_use]
    pub const fn only_with(mut self, setting: &'static str) -> Self {
        self.only_with = Some(setting);
        self
    }

    /// Sets the reason that it has to run in the coordinator.
    #[must_use]
    pub const fn stays(mut self, why: &'static str) -> Self {
        self.stays = Some(why);
        self
    }

    /// Requires another process for its steps.
    #[must_use]
    pub const fn elsewhere(mut self) -> Self {
        self.elsewhere = true;
        self
    }

    /// Sets the clocks under which its steps run on a worker thread.
    #[must_use]
    pub const fn heavy(mut self, heavy: Heavy) -> Self {
        self.heavy = heavy;
        self
    }

    /// Schedules it by the models of `[execution]`.
    #[must_use]
    pub const fn scheduled(mut self, scheduled: Scheduled) -> Self {
        self.scheduled = Some(scheduled);
        self
    }

    /// Lets the rungs of a ladder take turns at its steps.
    #[must_use]
    pub const fn on_ladder(mut self) -> Self {
        self.on_ladder = true;
        self
    }

    /// Marks its messages as deriving from their own stamp.
    #[must_use]
    pub const fn origin(mut self) -> Self {
        self.origin = true;
        self
    }

    /// Runs it only where it is read.
    #[must_use]
    pub const fn on_demand(mut self) -> Self {
        self.on_demand = true;
        self
    }

    /// Marks it as always recomputed by a replay.
    #[must_use]
    pub const fn follows_from_world(mut self) -> Self {
        self.follows_from_world = true;
        self
    }
}

/// Name of an operator, and the configuration as it applies to it.
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    /// Name of the operator.
    pub name: &'a str,
    /// The configuration, in whose sections the keys of `[operator.NAME]` override the values.
    pub setup: &'a Setup,
    /// Message types that the operators of the pipeline publish.
    pub offered: &'a [PayloadType],
}

impl Settings<'_> {
    /// Returns true if an operator of the pipeline publishes messages of this type.
    pub fn offers<T: Payload>(&self) -> bool {
        self.offered.contains(&PayloadType::of::<T>())
    }

    /// Timer with a first tick drawn from the seed, if the run draws at all.
    pub fn drawn_timer(&self, period: Span) -> Timer {
        every(period).phase(self.phase(period))
    }

    /// First tick of such a timer.
    pub fn phase(&self, period: Span) -> Span {
        let Config { seed, sim, .. } = &self.setup.config;
        match sim.draws && self.setup.live.is_none() {
            true => sensor_phase(*seed, self.name, period, span_of_ms(sim.dt_ms)),
            false => Span::ZERO,
        }
    }

    /// Returns true if the run is under wall clock.
    pub fn on_wall_clock(&self) -> bool {
        self.setup.clock.source == Clock::Wall
    }
}

/// Latency from the stamp of a sensor's message to its readers: run time of its operator, which therefore processes
/// several frames at once. A run time in `[operator.NAME]` overrides it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OnItsWay {
    /// Time from the stamp to the readers.
    pub after: Span,
    /// Frames in flight at once.
    pub frames: usize,
}

/// A kind of operator, as used by an assembly.
pub trait OperatorKind: Send + Sync {
    /// Description of the kind.
    fn node(&self) -> Node;

    /// Reason that it has to run in the coordinator under these settings; `None` if a worker may run it.
    fn stays(&self, _settings: &Settings<'_>) -> Option<&'static str> {
        self.node().stays
    }

    /// Schema of its own keys, if available: `swerve keys` lists them from it.
    fn schema(&self) -> Option<schemars::Schema> {
        None
    }

    /// Returns true if it takes part under these settings.
    fn is_there(&self, _settings: &Settings<'_>) -> bool {
        true
    }

    /// Outputs, in the order of its ports.
    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo>;

    /// Returns true if an output stays silent under these settings: no reader is connected to it by type.
    fn is_silent(&self, _settings: &Settings<'_>, _output: &str) -> bool {
        false
    }

    /// Reason that an output never carries data under these settings, if so: it must not be read.
    fn is_empty(&self, _settings: &Settings<'_>, _output: &str) -> Option<String> {
        None
    }

    /// Inputs, in the order of its ports.
    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo>;

    /// Streams that its settings name, by port.
    fn reads(&self, _settings: &Settings<'_>) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Run-time model where `[operator.NAME]` gives none.
    ///
    /// # Errors
    /// Problems of the settings that define it.
    fn runtime(&self, _settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        Ok(RuntimeModel::Zero)
    }

    /// Usual and largest run time where `[operator.NAME]` gives none, ms; `None` if unknown.
    fn takes_ms(&self, _settings: &Settings<'_>) -> Option<[f64; 2]> {
        None
    }

    /// Ladder that its settings put it on; it is then added once for each rung.
    fn ladder(&self, _settings: &Settings<'_>) -> Option<Ladder> {
        None
    }

    /// Latency from a sensor's stamp to its readers.
    fn on_its_way(&self, _settings: &Settings<'_>) -> Option<OnItsWay> {
        None
    }

    /// Delay of its streams in addition to that of `[operator.NAME]`, ms.
    fn added_delay_ms(&self, _settings: &Settings<'_>) -> f64 {
        0.0
    }

    /// Domain of the model for camera images that it uses, if it uses one with a known domain.
    fn domain(&self, _settings: &Settings<'_>) -> Option<Domain> {
        None
    }

    /// Adds it to the graph, with the settings of one rung if it is on a ladder.
    ///
    /// # Errors
    /// If its settings request something unavailable.
    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()>;
}

/// An operator that configurations can name.
///
/// `[operator.NAME] kind = "..."` makes one; its other keys are read as a [`Table`](Self::Table).
pub trait Kind: Operator<In: NamedInputs, Out: NamedOutputs> + Sized {
    /// Description of the kind.
    const NODE: Node;

    /// Settings; `#[serde(deny_unknown_fields, default)]` makes the type refuse unknown keys.
    type Table: Serialize + DeserializeOwned + Default + 'static;

    /// Place of the settings: `[operator.NAME]` alone, or on top of a table of the configuration.
    const SECTION: Section<Self::Table> = Section::own(|table, _| Self::problems(table));

    /// Builds the operator.
    ///
    /// # Errors
    /// If its settings request something unavailable.
    fn new(table: Self::Table, site: &Site<'_>) -> anyhow::Result<Self>;

    /// Problems of the values of its keys.
    fn problems(_table: &Self::Table) -> KeyProblems {
        Vec::new()
    }

    /// Domain of the model for camera images that it uses, if it uses one with a known domain.
    fn domain(_table: &Self::Table) -> Option<Domain> {
        None
    }

    /// Timer of its [`Every`](swerve_flow::Every) port, if it has one.
    fn timer(_table: &Self::Table, _settings: &Settings<'_>) -> Option<Timer> {
        None
    }

    /// Returns true if it takes part under these settings.
    fn is_there(_settings: &Settings<'_>) -> bool {
        true
    }

    /// Carries the state from the rung of the step before to that of the next one, for a kind on a
    /// [ladder](Node::on_ladder).
    fn carry(_from: &mut Self, _to: &mut Self) {}

    /// Run-time model where `[operator.NAME]` gives none.
    ///
    /// # Errors
    /// Problems of the settings that define it.
    fn runtime(_table: &Self::Table, _settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        Ok(RuntimeModel::Zero)
    }
}

/// A [`Kind`] in a registry.
pub(crate) struct Registered<K>(PhantomData<fn() -> K>);

impl<K> Registered<K> {
    pub(crate) const fn new() -> Self {
        Self(PhantomData)
    }
}

impl<K: Kind> Registered<K> {
    fn table(settings: &Settings<'_>) -> K::Table {
        K::SECTION.get(settings.setup, settings.name)
    }
}

impl<K: Kind> OperatorKind for Registered<K> {
    fn node(&self) -> Node {
        K::NODE.section(const { &K::SECTION })
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
        K::runtime(&Self::table(settings), settings)
    }

    fn domain(&self, settings: &Settings<'_>) -> Option<Domain> {
        K::domain(&Self::table(settings))
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let table = Self::table(&site.settings());
        let timer = K::timer(&table, &site.settings());
        let operator = K::new(table, site)?;
        site.add_carrying(operator, timer, K::carry)
    }
}
