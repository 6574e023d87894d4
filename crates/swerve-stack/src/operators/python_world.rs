//! A world and its sensors in Python: one class, in one process, takes the steps of both.
//!
//! The world is stepped with the period `sim.dt_ms` under the command of the step before, like the simulated one. Excluded:
//! what the class answers, which `swerve.World` in Python describes; rules of collisions and of the end, which are those of
//! a guest's world.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_flow::{OutputInfo, PayloadType, PortInfo, PortMode, every};
use swerve_msg::Command;
use swerve_msg::truth::WorldState;

use super::python::{Elsewhere, message};
use crate::config::execution::span_of_ms;
use crate::kind::{Node, OperatorKind, Role, Settings};
use crate::problems::{KeyProblems, problem};
use crate::section::Section;
use crate::setup::Setup;
use crate::site::Site;

/// Kind of a world in Python.
pub(super) struct PythonWorld;

/// Kind of a sensor of a world in Python.
pub(super) struct PythonSensor;

impl OperatorKind for PythonWorld {
    fn node(&self) -> Node {
        Node::new("python_world", "a world written in Python, in place of the simulated one")
            .elsewhere()
            .role(Role::World)
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        vec![OutputInfo::declared("state", PayloadType::of::<WorldState>())]
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        let command = PortInfo::declared("command", PortMode::Latest, Some(PayloadType::of::<Command>()));
        vec![PortInfo::declared("step", PortMode::Every, None), PortInfo { feedback: true, ..command }]
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        anyhow::ensure!(
            site.surroundings().scenario.other_egos.is_empty(),
            "the scenario has several egos: a world in Python has one"
        );
        let step = span_of_ms(site.config().sim.dt_ms);
        site.add_any(Elsewhere, Some(every(step)))
    }
}

/// Keys of a sensor of a world in Python.
#[derive(Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
struct Table {
    /// Type of its messages, such as `ObstacleList` or `Image`.
    message: String,
    /// Period, ms: a multiple of `sim.dt_ms`, the step of the world.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    period_ms: f64,
}

impl Default for Table {
    fn default() -> Self {
        Self { message: String::new(), period_ms: 50.0 }
    }
}

impl Table {
    const SECTION: Section<Self> = Section::own(Self::problems);

    fn of(settings: &Settings<'_>) -> Self {
        Self::SECTION.get(settings.setup, settings.name)
    }

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut problems = KeyProblems::new();
        let found = match &*self.message {
            "" => Err("expected the type of its messages, such as `ObstacleList`".to_owned()),
            name => message(name, &setup.registry).map(drop),
        };
        problems.extend(found.err().map(|why| ("message".to_owned(), why)));
        let dt_ms = setup.sim.dt_ms;
        if span_of_ms(self.period_ms).ns() % span_of_ms(dt_ms).ns().max(1) != 0 {
            let why = format!(
                "expected a multiple of the step of the world, sim.dt_ms = {dt_ms}, found {}",
                self.period_ms
            );
            problems.push(("period_ms".into(), why));
        }
        problems.extend(self.out_of_range().into_iter().map(problem));
        problems
    }
}

impl OperatorKind for PythonSensor {
    fn node(&self) -> Node {
        Node::new("python_sensor", "a sensor of a world written in Python")
            .section(&Table::SECTION)
            .elsewhere()
            .role(Role::Sensor)
            .origin()
            .on_demand()
    }

    fn schema(&self) -> Option<schemars::Schema> {
        Some(schemars::schema_for!(Table))
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        let table = Table::of(settings);
        // Without keys there is no output: the registry asks for the outputs of all kinds to list the messages.
        let named = Some(table.message).filter(|name| !name.is_empty());
        let payload = named.and_then(|name| message(&name, &settings.setup.registry).ok());
        payload.map(|payload| OutputInfo::declared("seen", payload)).into_iter().collect()
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        let state = PortInfo::declared("state", PortMode::Latest, Some(PayloadType::of::<WorldState>()));
        vec![PortInfo::declared("tick", PortMode::Every, None), state]
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let period = span_of_ms(Table::of(&site.settings()).period_ms);
        site.add_any(Elsewhere, Some(every(period)))
    }
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use super::*;
    use crate::Assembly;

    const WORLD: &str = "[operator.world]\nkind = 'python_world'\n[operator.obstacles]\nkind = 'python_sensor'\nmessage = 'ObstacleList'\n";
    const PROCESS: &str = "[process.world]\noperators = ['world', 'obstacles']\nstart = ['python3', '-m', 'swerve', 'worker', 'w.py:W']\n";

    fn read(text: &str) -> Result<Setup, Vec<String>> {
        let document = Document::parse("c.toml", text).unwrap();
        Setup::from_document(&document, &[])
            .map_err(|problems| problems.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn python_world_reads_commands_over_a_feedback_edge_and_its_sensor_is_an_origin() {
        let text = format!("{WORLD}{PROCESS}");
        let setup = read(&text).unwrap_or_else(|problems| panic!("{problems:#?}"));
        let assembly = Assembly::new(&setup).unwrap();
        let world = assembly.operator("world").unwrap();
        let command = &world.inputs.iter().find(|input| input.port.name == "command").unwrap().from[0];
        assert!(command.feedback && command.stream == "controller", "{command:?}");
        let tracker = assembly.operator("tracker").unwrap();
        let mut reads = tracker.inputs.iter().flat_map(|input| &input.from);
        assert!(reads.any(|edge| edge.stream == "obstacles"), "the tracker reads the sensor");
        assert!(assembly.node("obstacles").unwrap().origin);
    }

    #[test]
    fn python_world_problems_are_reported_with_line_and_key() {
        let cases = [
            ("message = 'Obstacles'\n", "c.toml:5: operator.obstacles.message: unknown message `Obstacles`"),
            ("period_ms = 50.0\n", "operator.obstacles.message: expected the type of its messages"),
            (
                "message = 'Imu'\nperiod_ms = 4.0\n",
                "c.toml:6: operator.obstacles.period_ms: expected a multiple",
            ),
            ("message = 'Imu'\nperiod = 4.0\n", "c.toml:6: operator.obstacles.period: unknown key"),
        ];
        for (keys, expected) in cases {
            let world = WORLD.replace("message = 'ObstacleList'\n", keys);
            let problems = read(&format!("{world}{PROCESS}")).unwrap_err();
            assert!(problems.iter().any(|line| line.contains(expected)), "{keys}: {problems:#?}");
        }
        let problems = read(WORLD).unwrap_err();
        let expected = "operator.world.kind: its steps are taken by a process";
        assert!(problems.iter().any(|line| line.contains(expected)), "{problems:#?}");
    }
}
