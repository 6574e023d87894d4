//! Inertial unit.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::Imu;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::InertialUnit;

use crate::kind::{Kind, NoKeys, Node, Settings, span_of_ms};
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
    const NODE: Node =
        Node::sensor("imu", "accelerations and turn rates of the inertial unit").sections(&["sensing"]);
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.config();
        let (sensing, vehicle) = (&config.sensing, &config.sim.vehicle);
        let period = span_of_ms(sensing.imu_period_ms);
        Ok(Self(InertialUnit::new(sensing.imu, vehicle, period, site.name(), config.seed)))
    }

    fn timer(_: &NoKeys, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(settings.setup.sensing.imu_period_ms)))
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
