//! The simulated world.

use swerve_core::Span;
use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer, every};
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, Command};
use swerve_sim::{SimParams, Simulator};

use crate::config::execution::span_of_ms;
use crate::course::Course;
use crate::kind::{Kind, Node, Role, Settings};
use crate::named::NoKeys;
use crate::site::Site;

/// The simulated world. At its tick `k` it integrates from tick `k - 1` under the command latched there,
/// publishes the state, then latches the newest command.
pub(super) struct World {
    world: Box<dyn swerve_world::World>,
    dt: Span,
    latched: Command,
    /// Number of steps taken, including the first state.
    steps: usize,
    course: Option<Course>,
}

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
        let sim = &site.config().sim;
        let params = SimParams { dt: span_of_ms(sim.dt_ms), vehicle: sim.vehicle.clone() };
        let simulator = Simulator::exact(site.surroundings().scenario.clone(), &params)?;
        let course = site.setup().course.clone();
        Ok(Self { world: Box::new(simulator), dt: params.dt, latched: Command::default(), steps: 0, course })
    }

    fn timer(_: &NoKeys, settings: &Settings<'_>) -> Option<Timer> {
        Some(every(span_of_ms(settings.setup.sim.dt_ms)))
    }
}

impl Operator for World {
    type In = In;
    type Out = Port<WorldState>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if self.steps > 0 {
            let until = self.world.state().stamp + self.dt;
            self.world.advance(until, &[(ActorId::EGO, self.latched)]);
        }
        // Commands that are not finite do not reach the pedals.
        if let Some(command) = input.command.get().filter(|command| command.is_finite()) {
            self.latched = **command;
        }
        if let Some(course) = &self.course {
            self.latched = course.command(self.steps, self.latched);
        }
        self.steps += 1;
        let state = self.world.state();
        if let Some(reason) = state.ended {
            cx.stop_run(format!("{reason:?}").to_lowercase());
        }
        out.loan().send(state.clone());
    }
}
