//! Accelerations and turn rates at the centre of gravity.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::Imu;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::{self, ImuParams};

use crate::kind::{Kind, NoKeys, Node, Settings, span_of_ms};
use crate::site::Site;

/// Accelerations and turn rates at the centre of gravity.
pub(super) struct ImuSensor {
    params: ImuParams,
    seed: u64,
}

/// The newest state of the world, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// The sensor's period.
    tick: Every,
    /// What there is to be measured.
    world: Latest<WorldState>,
}

impl Kind for ImuSensor {
    const NODE: Node =
        Node::sensor("imu", "accelerations and turn rates at the centre of gravity").sections(&["sensing"]);
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.config();
        Ok(Self { params: config.sensing.imu, seed: config.seed })
    }

    fn timer(_: &NoKeys, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(settings.config.sensing.imu_period_ms)))
    }
}

impl Operator for ImuSensor {
    type In = In;
    type Out = Port<Imu>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let Some(world) = input.world.get() else { return };
        out.loan().send(sense::imu(world, cx.name(), &self.params, self.seed));
    }
}
