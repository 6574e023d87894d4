//! Localization emulated by the true pose with errors.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::EgoState;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::{self, PoseParams};

use crate::config::SensingConfig;
use crate::config::execution::span_of_ms;
use crate::kind::{Kind, Node, Settings};
use crate::section::Section;
use crate::site::Site;

/// Publishes the true pose with errors.
pub(crate) struct PoseSensor {
    params: PoseParams,
    seed: u64,
}

/// The newest state of the world, at each tick.
#[derive(Inputs)]
pub(crate) struct In {
    /// Period of the sensor.
    tick: Every,
    /// State of the world to measure.
    world: Latest<WorldState>,
}

impl Kind for PoseSensor {
    const NODE: Node = Node::sensor("pose_sensor", "localization, as good as its errors let it be");
    type Table = SensingConfig;
    const SECTION: Section<SensingConfig> = SensingConfig::SECTION;

    fn new(sensing: SensingConfig, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self { params: sensing.pose, seed: site.config().seed })
    }

    fn timer(sensing: &SensingConfig, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(sensing.pose_period_ms)))
    }
}

impl Operator for PoseSensor {
    type In = In;
    type Out = Port<EgoState>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let Some(world) = input.world.get() else { return };
        out.loan().send(sense::pose(world, cx.name(), &self.params, self.seed));
    }
}
