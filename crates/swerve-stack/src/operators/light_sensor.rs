//! Traffic light sensor: signals of the scenario's lights, limited by what the sensor can see.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::TrafficLights;
use swerve_msg::truth::WorldState;
use swerve_sim::sense::{SensorMount, SensorParams, TrafficLightSensor};

use super::obstacles::sight;
use crate::kind::{Kind, NoKeys, Node, Settings, span_of_ms};
use crate::site::Site;

/// Publishes signals of the scenario's lights, with the limits of the obstacle sensor.
pub(super) struct LightSensor {
    sensor: TrafficLightSensor,
    mount: SensorMount,
    params: SensorParams,
}

/// The newest state of the world, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the sensor.
    tick: Every,
    /// State of the world to measure.
    world: Latest<WorldState>,
}

impl Kind for LightSensor {
    const NODE: Node = Node::sensor(
        "traffic_light_sensor",
        "signals of traffic lights, cut by range, field of view and occlusion",
    )
    .sections(&["sensing"])
    .on_demand();
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let (mount, params) = sight(site.config());
        Ok(Self { sensor: TrafficLightSensor::new(&site.surroundings().scenario.road), mount, params })
    }

    fn timer(_: &NoKeys, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(settings.setup.sensing.period_ms)))
    }
}

impl Operator for LightSensor {
    type In = In;
    type Out = Port<TrafficLights>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(world) = input.world.get() {
            out.send(self.sensor.sense(world, &self.mount, &self.params));
        }
    }
}
