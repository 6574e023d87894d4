//! Sensors that see every step of the world and say of each what happened in it, mostly nothing.

use swerve_flow::{At, Context, Operator, Port};
use swerve_msg::truth::WorldState;
use swerve_msg::{CollisionEvents, LaneInvasions, RedLightEvents};
use swerve_sim::sense::{self, LaneInvasionSensor, RedLightSensor};

/// What the ego begins to touch.
pub(super) struct Collisions;

impl Operator for Collisions {
    type In = (At<WorldState>,);
    type Out = Port<CollisionEvents>;

    fn step(&mut self, _: &mut Context<'_>, (world,): &Self::In, out: &mut Self::Out) {
        if let Some(world) = world.get() {
            out.send(sense::collisions(world));
        }
    }
}

/// Lines of the road that the ego comes onto.
pub(super) struct Lines(pub(super) LaneInvasionSensor);

impl Operator for Lines {
    type In = (At<WorldState>,);
    type Out = Port<LaneInvasions>;

    fn step(&mut self, _: &mut Context<'_>, (world,): &Self::In, out: &mut Self::Out) {
        if let Some(world) = world.get() {
            out.send(self.0.sense(world));
        }
    }
}

/// Stop lines that the ego goes over while their light is red.
pub(super) struct RedLights(pub(super) RedLightSensor);

impl Operator for RedLights {
    type In = (At<WorldState>,);
    type Out = Port<RedLightEvents>;

    fn step(&mut self, _: &mut Context<'_>, (world,): &Self::In, out: &mut Self::Out) {
        if let Some(world) = world.get() {
            out.send(self.0.sense(world));
        }
    }
}
