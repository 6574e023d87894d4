//! Wheel encoders. There is no reading at the first tick, which has no time to count over.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::WheelOdometry;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::{WheelOdometer, rolling_speeds_radps};
use swerve_vehicle::VehicleParams;

use crate::kind::{Kind, NoKeys, Node, Settings, span_of_ms};
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
    const NODE: Node =
        Node::sensor("wheel_odometry", "encoders of the wheels").sections(&["sensing"]).on_demand();
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.config();
        let vehicle = config.sim.vehicle.clone();
        let odometer = WheelOdometer::new(config.sensing.odometry, &vehicle, site.name(), config.seed);
        Ok(Self { odometer, vehicle })
    }

    fn timer(_: &NoKeys, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(settings.setup.sensing.odometry_period_ms)))
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
