//! Satellite receiver.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::Gnss;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::GnssReceiver;

use crate::config::SensingConfig;
use crate::config::execution::span_of_ms;
use crate::kind::{Kind, Node, Settings};
use crate::section::Section;
use crate::site::Site;

/// Publishes satellite fixes.
pub(super) struct Receiver(GnssReceiver);

/// The newest state of the world, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the receiver.
    tick: Every,
    /// State of the world to measure.
    world: Latest<WorldState>,
}

impl Kind for Receiver {
    const NODE: Node = Node::sensor("gnss", "satellite fixes").on_demand();
    type Table = SensingConfig;
    const SECTION: Section<SensingConfig> = SensingConfig::SECTION;

    fn new(sensing: SensingConfig, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self(GnssReceiver::new(sensing.gnss, site.name(), site.config().seed)))
    }

    fn timer(sensing: &SensingConfig, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(sensing.gnss_period_ms)))
    }
}

impl Operator for Receiver {
    type In = In;
    type Out = Port<Gnss>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let Some(world) = input.world.get() else { return };
        if let Some(fix) = self.0.sense(world) {
            out.loan().send(fix);
        }
    }
}
