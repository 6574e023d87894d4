//! Traffic light sensor: signals of the scenario's lights, limited by what the sensor can see.

use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer};
use swerve_msg::truth::WorldState;
use swerve_msg::{Route, TrafficLights};
use swerve_sim::sense::{SensorMount, SensorParams, TrafficLightSensor};

use super::behaviour::RouteNews;
use super::obstacles::sight;
use crate::config::SensingConfig;
use crate::config::execution::span_of_ms;
use crate::kind::{Kind, Node, Settings};
use crate::section::Section;
use crate::site::Site;
use crate::unseen::Unseen;

/// Publishes signals of the scenario's lights, with the limits of the obstacle sensor.
pub(super) struct LightSensor {
    sensor: TrafficLightSensor,
    mount: SensorMount,
    params: SensorParams,
    news: RouteNews,
    unseen: Unseen,
}

/// The newest state of the world, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the sensor.
    tick: Every,
    /// State of the world to measure.
    world: Latest<WorldState>,
    /// Route of the ego, on which the stop lines are.
    route: Option<Latest<Route>>,
}

impl Kind for LightSensor {
    const NODE: Node = Node::sensor(
        "traffic_light_sensor",
        "signals of traffic lights, cut by range, field of view and occlusion",
    )
    .on_demand();
    type Table = SensingConfig;
    const SECTION: Section<SensingConfig> = SensingConfig::SECTION;

    fn new(sensing: SensingConfig, site: &Site<'_>) -> anyhow::Result<Self> {
        let (mount, params) = sight(&sensing, &site.config().sim.vehicle.shape);
        let unseen = Unseen::new(&sensing, &site.surroundings().scenario)?;
        let sensor = TrafficLightSensor::new(&site.surroundings().scenario.road);
        Ok(Self { sensor, mount, params, news: RouteNews::default(), unseen })
    }

    fn timer(sensing: &SensingConfig, settings: &Settings<'_>) -> Option<Timer> {
        Some(settings.drawn_timer(span_of_ms(sensing.period_ms)))
    }
}

impl Operator for LightSensor {
    type In = In;
    type Out = Port<TrafficLights>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(route) = self.news.take(input.route.as_ref()) {
            self.sensor.follow(route);
        }
        if let Some(world) = input.world.get() {
            out.send(self.sensor.sense(&self.unseen.seen(world), &self.mount, &self.params));
        }
    }
}
