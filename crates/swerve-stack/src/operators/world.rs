//! The simulated world.

use anyhow::Context as _;
use swerve_core::Span;
use swerve_flow::{
    AnyInput, AnyOperator, AnyOutputs, Context, Every, Inputs, Latest, Operator, OutputInfo, PayloadType,
    Port, PortInfo, PortMode, Timer, Wire, every,
};
use swerve_msg::truth::{EndReason, WorldState};
use swerve_msg::{ActorId, Command};
use swerve_sim::{SimParams, Simulator};

use crate::config::execution::span_of_ms;
use crate::course::Course;
use crate::kind::{Kind, Node, Role, Settings};
use crate::named::NoKeys;
use crate::namespace::Namespace;
use crate::site::{Building, Edge, Site};
use crate::sumo;

/// The simulated world. At its tick `k` it integrates from tick `k - 1` under the commands latched there,
/// publishes the state, then latches the newest commands.
struct Steps {
    world: Box<dyn swerve_world::World>,
    dt: Span,
    /// Command of each ego that a stack drives.
    latched: Vec<(ActorId, Command)>,
    /// Number of steps taken, including the first state.
    taken: usize,
    /// Commands of the first ego that are given.
    course: Option<Course>,
}

impl Steps {
    fn new(site: &Site<'_>) -> anyhow::Result<Self> {
        let sim = &site.config().sim;
        let params = SimParams { dt: span_of_ms(sim.dt_ms), vehicle: sim.vehicle.clone() };
        let scenario = &site.surroundings().scenario;
        let latched = scenario.egos().iter().map(|(id, _)| (*id, Command::default())).collect();
        let mut simulator = Simulator::exact(scenario.clone(), &params)?;
        if let Some((others, first)) = sumo::of(simulator.scenario(), params.dt, site.setup().seed)? {
            simulator.set_others(Box::new(others), first);
        }
        let world = Box::new(simulator);
        Ok(Self { world, dt: params.dt, latched, taken: 0, course: site.setup().course.clone() })
    }

    /// Takes a step, then latches the newest command of each ego. Ends the run once the scenario is over for all egos.
    fn take(&mut self, cx: &mut Context<'_>, newest: impl IntoIterator<Item = Option<Command>>) {
        if self.taken > 0 {
            let until = self.world.state().stamp + self.dt;
            self.world.advance(until, &self.latched);
        } else {
            // Its failure is that of the world.
            let _failed = self.world.start();
        }
        if let Some(failure) = self.world.failure() {
            // Against the wall clock, a lost step alone does not end the run.
            cx.fail_run(failure.0.clone());
            cx.stop_run(failure.0.clone());
        }
        for ((_, latched), command) in self.latched.iter_mut().zip(newest) {
            // Commands that are not finite do not reach the pedals.
            *latched = command.filter(Command::is_finite).unwrap_or(*latched);
        }
        if let Some(course) = &self.course {
            self.latched[0].1 = course.command(self.taken, self.latched[0].1);
        }
        self.taken += 1;
        let ended: Option<Vec<EndReason>> = self.states().map(|state| state.ended).collect();
        if let Some(reason) = ended.and_then(|reasons| reasons.first().copied()) {
            cx.stop_run(format!("{reason:?}").to_lowercase());
        }
    }

    /// The state in the view of each ego.
    fn states(&self) -> impl Iterator<Item = &WorldState> {
        self.latched.iter().filter_map(|(id, _)| self.world.state_of(*id))
    }
}

/// The simulated world of one ego.
pub(super) struct World(Steps);

/// Inputs of the world.
#[derive(Inputs)]
pub(super) struct In {
    /// Steps of the world.
    step: Every,
    /// Command for pedals and steering.
    #[port(feedback)]
    command: Latest<Command>,
}

impl Kind for World {
    const NODE: Node = Node::new("simulator", "the simulated world: rapier's bodies, moved step by step")
        .stays("it is the world")
        .role(Role::World);
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        Steps::new(site).map(Self)
    }

    fn timer(_: &NoKeys, settings: &Settings<'_>) -> Option<Timer> {
        Some(steps(settings))
    }
}

/// Timer of the world's steps.
fn steps(settings: &Settings<'_>) -> Timer {
    every(span_of_ms(settings.setup.sim.dt_ms))
}

impl Operator for World {
    type In = In;
    type Out = Port<WorldState>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        self.0.take(cx, [input.command.get().map(|command| **command)]);
        out.loan().send(self.0.world.state().clone());
    }
}

/// The simulated world of several egos: it reads a command of each, and publishes the state in the view of each.
struct Shared(Steps);

impl AnyOperator for Shared {
    fn step(&mut self, cx: &mut Context<'_>, inputs: Vec<AnyInput>, out: &mut AnyOutputs<'_>) {
        let command = |input: &AnyInput| match input {
            AnyInput::Message(message) => message.downcast_ref::<Command>().copied(),
            _ => None,
        };
        self.0.take(cx, inputs.iter().skip(1).map(command));
        for (port, state) in self.0.states().enumerate() {
            out.send(port, state.clone()).expect("it has an output for each ego");
        }
    }
}

/// Adds the world of several egos in place of that of one. `stacks` are the names of their stacks, ordered by identity.
///
/// # Errors
/// As for a world of one ego; or a stack has no command for the car.
pub(crate) fn add_shared(site: &mut Site<'_>, stacks: &[&Namespace]) -> anyhow::Result<()> {
    let operator = Shared(Steps::new(site)?);
    let timer = steps(&site.settings());
    let command = site.placed.inputs.iter().find(|input| input.port.name == "command");
    let command =
        command.and_then(|input| input.from.first()).context("no operator commands the cars")?.clone();
    let names: Vec<String> =
        site.surroundings().scenario.egos().iter().map(|(_, name)| (*name).to_owned()).collect();
    let port = |name: &String| PortInfo {
        feedback: true,
        ..PortInfo::declared(name.clone(), PortMode::Latest, Some(PayloadType::of::<Command>()))
    };
    let step = PortInfo::declared("step", PortMode::Every, None);
    let inputs: Vec<PortInfo> = core::iter::once(step).chain(names.iter().map(port)).collect();
    let output = |name: &String| OutputInfo {
        name: name.clone().into(),
        doc: "State of the world in the view of this ego.",
        payload: PayloadType::of::<WorldState>(),
    };
    let outputs: Vec<OutputInfo> = names.iter().map(output).collect();
    let mut commands = stacks.iter().map(|stack| stack.stream(&command.stream));
    let Building { graph, loops, .. } = &mut *site.building;
    graph.add_any_wired(&site.placed.name, operator, (&inputs, &outputs), |graph, port| {
        let Some(payload) = port.payload else { return Ok(Wire::Timer(timer)) };
        let feedback = graph.feedback_any(format!("{}.{}", site.placed.name, port.name), payload);
        let stream = commands.next().context("each ego has a stack")?;
        loops.push((feedback, Edge { stream, ..command.clone() }));
        anyhow::Ok(Wire::from(feedback))
    })?;
    Ok(())
}
