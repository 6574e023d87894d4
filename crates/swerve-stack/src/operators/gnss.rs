//! Satellite receiver.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::Gnss;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::GnssReceiver;

use crate::kind::{Kind, NoKeys, Node, Settings, span_of_ms};
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
    const NODE: Node = Node::sensor("gnss", "satellite fixes").sections(&["sensing"]).on_demand();
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.config();
        Ok(Self(GnssReceiver::new(config.sensing.gnss.clone(), site.name(), config.seed)))
    }

    fn timer(_: &NoKeys, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(settings.setup.sensing.gnss_period_ms)))
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
