//! Wheel encoders. There is no reading at the first tick, which has no time to count over.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::WheelOdometry;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::{WheelOdometer, rolling_speeds_radps};
use swerve_vehicle::VehicleParams;

use crate::config::SensingConfig;
use crate::config::execution::span_of_ms;
use crate::kind::{Kind, Node, Settings};
use crate::section::Section;
use crate::site::Site;

/// Publishes the wheel encoders' readings, from the second tick on.
pub(super) struct Odometry {
    odometer: WheelOdometer,
    vehicle: VehicleParams,
}

/// The newest state of the world, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the sensor.
    tick: Every,
    /// State of the world to measure.
    world: Latest<WorldState>,
}

impl Kind for Odometry {
    const NODE: Node = Node::sensor("wheel_odometry", "encoders of the wheels").on_demand();
    type Table = SensingConfig;
    const SECTION: Section<SensingConfig> = SensingConfig::SECTION;

    fn new(sensing: SensingConfig, site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.config();
        let vehicle = config.sim.vehicle.clone();
        let odometer = WheelOdometer::new(sensing.odometry, &vehicle, site.name(), config.seed);
        Ok(Self { odometer, vehicle })
    }

    fn timer(sensing: &SensingConfig, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(sensing.odometry_period_ms)))
    }
}

impl Operator for Odometry {
    type In = In;
    type Out = Port<WheelOdometry>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let Some(world) = input.world.get() else { return };
        if let Some(reading) = self.odometer.sense(world, rolling_speeds_radps(&world.ego, &self.vehicle)) {
            out.send(reading);
        }
    }
}
