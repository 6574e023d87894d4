//! Checks of commands to a real vehicle.

use swerve_core::{Span, Time};
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_msg::{MotionCommand, Plan};

use crate::kind::{Kind, Node, Settings};
use crate::named::NoKeys;
use crate::site::Site;

/// Passes on commands that are made from a new state and a recent plan. The gate treats the absence of commands as
/// silence.
pub(super) struct FreshCommands {
    timeout: Span,
    last: Time,
}

/// Command, and newest plan.
#[derive(Inputs)]
pub(super) struct In {
    /// Command of the controller.
    command: At<MotionCommand>,
    /// Plan that it follows.
    plan: Latest<Plan>,
}

impl Kind for FreshCommands {
    const NODE: Node =
        Node::new("fresh_commands", "commands from a new state and a plan that is not too old")
            .stays("it is the vehicle's side of the stack");
    type Table = NoKeys;

    fn is_there(settings: &Settings<'_>) -> bool {
        settings.setup.live.is_some()
    }

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let live = site.config().live.clone().unwrap_or_default();
        Ok(Self { timeout: Span::from_secs(live.plan_timeout_s), last: Time::MIN })
    }
}

impl Operator for FreshCommands {
    type In = In;
    type Out = Port<MotionCommand>;

    fn step(&mut self, cx: &mut Context<'_>, In { command, plan }: &In, out: &mut Self::Out) {
        let (Some(command), Some(plan)) = (command.get(), plan.get()) else { return };
        if command.stamp > self.last && cx.now() - plan.stamp <= self.timeout {
            self.last = command.stamp;
            out.forward(command.shared());
        }
    }
}
