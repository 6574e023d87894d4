//! Sensors that report the events of every step of the world, mostly none.

use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_msg::truth::WorldState;
use swerve_msg::{CollisionEvents, LaneInvasions as Invasions, RedLightEvents, Route};
use swerve_sim::sense::{self, LaneInvasionSensor, RedLightSensor};

use super::behaviour::RouteNews;
use crate::kind::{Kind, Node};
use crate::named::NoKeys;
use crate::site::Site;

/// Every state of the world.
#[derive(Inputs)]
pub(super) struct In {
    /// State of the world.
    world: At<WorldState>,
}

/// Every state of the world, and the route.
#[derive(Inputs)]
pub(super) struct LightsIn {
    /// State of the world.
    world: At<WorldState>,
    /// Route of the ego, on which the stop lines are.
    route: Option<Latest<Route>>,
}

/// Reports contacts of the ego as they begin.
pub(super) struct CollisionSensor;

/// Reports lines of the road that the ego crosses onto.
pub(super) struct LaneInvasions(LaneInvasionSensor);

/// Reports stop lines that the ego crosses while their light is red.
pub(super) struct RedLights(RedLightSensor, RouteNews);

impl Kind for CollisionSensor {
    const NODE: Node = Node::sensor("collision_sensor", "what the ego begins to touch").on_demand();
    type Table = NoKeys;

    fn new(_: NoKeys, _: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self)
    }
}

impl Kind for LaneInvasions {
    const NODE: Node =
        Node::sensor("lane_invasion_sensor", "lines of the road that the ego comes onto").on_demand();
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let around = site.surroundings();
        Ok(Self(LaneInvasionSensor::new(&around.scenario.road, around.vehicle.shape)))
    }
}

impl Kind for RedLights {
    const NODE: Node =
        Node::sensor("red_light_sensor", "stop lines that the ego goes over at a red light").on_demand();
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let around = site.surroundings();
        Ok(Self(RedLightSensor::new(&around.scenario.road, around.vehicle.shape), RouteNews::default()))
    }
}

impl Operator for CollisionSensor {
    type In = In;
    type Out = Port<CollisionEvents>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(world) = input.world.get() {
            out.send(sense::collisions(world));
        }
    }
}

impl Operator for LaneInvasions {
    type In = In;
    type Out = Port<Invasions>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(world) = input.world.get() {
            out.send(self.0.sense(world));
        }
    }
}

impl Operator for RedLights {
    type In = LightsIn;
    type Out = Port<RedLightEvents>;

    fn step(&mut self, _: &mut Context<'_>, input: &LightsIn, out: &mut Self::Out) {
        if let Some(route) = self.1.take(input.route.as_ref()) {
            self.0.follow(route);
        }
        if let Some(world) = input.world.get() {
            out.send(self.0.sense(world));
        }
    }
}
