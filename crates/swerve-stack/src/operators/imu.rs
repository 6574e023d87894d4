//! Inertial unit.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::Imu;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::InertialUnit;

use crate::config::SensingConfig;
use crate::config::execution::span_of_ms;
use crate::kind::{Kind, Node, Settings};
use crate::section::Section;
use crate::site::Site;

/// Publishes accelerations and turn rates of the inertial unit.
pub(super) struct ImuSensor(InertialUnit);

/// The newest state of the world, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the sensor.
    tick: Every,
    /// State of the world to measure.
    world: Latest<WorldState>,
}

impl Kind for ImuSensor {
    const NODE: Node = Node::sensor("imu", "accelerations and turn rates of the inertial unit");
    type Table = SensingConfig;
    const SECTION: Section<SensingConfig> = SensingConfig::SECTION;

    fn new(sensing: SensingConfig, site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.config();
        let period = span_of_ms(sensing.imu_period_ms);
        Ok(Self(InertialUnit::new(sensing.imu, &config.sim.vehicle, period, site.name(), config.seed)))
    }

    fn timer(sensing: &SensingConfig, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(sensing.imu_period_ms)))
    }
}

impl Operator for ImuSensor {
    type In = In;
    type Out = Port<Imu>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let Some(world) = input.world.get() else { return };
        out.loan().send(self.0.sense(world));
    }
}
