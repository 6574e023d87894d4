use swerve_flow::{Context, Every, Latest, Operator, Port};
use swerve_msg::Command;
use swerve_msg::truth::WorldState;
use swerve_sim::Simulator;

/// The simulated world. At its tick `k` it integrates from tick `k - 1` under the command latched there,
/// publishes the state, then latches the newest command.
pub(super) struct World {
    simulator: Simulator,
    latched: Command,
    started: bool,
}

impl World {
    pub(super) fn new(simulator: Simulator) -> Self {
        Self { simulator, latched: Command::default(), started: false }
    }
}

impl Operator for World {
    type In = (Every, Latest<Command>);
    type Out = Port<WorldState>;

    fn step(&mut self, cx: &mut Context<'_>, (_, command): &Self::In, out: &mut Self::Out) {
        if self.started {
            self.simulator.step(self.latched);
        }
        self.started = true;
        // Wires to pedals carry numbers: what is none does not reach them.
        if let Some(command) = command.get().filter(|command| command.is_finite()) {
            self.latched = **command;
        }
        let state = self.simulator.state();
        if let Some(reason) = state.ended {
            cx.stop_run(format!("{reason:?}").to_lowercase());
        }
        out.loan().send(state.clone());
    }
}
