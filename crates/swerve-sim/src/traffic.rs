//! Road users of a scenario's traffic: their places at the start, and their drivers.

use std::sync::Arc;

use swerve_core::Time;
use swerve_geom::{Obb, Vector2};
use swerve_map::Aspect;
use swerve_msg::{ActorId, ActorKind};
use swerve_scenario::{Actor, Course, Scenario};
use swerve_traffic::{Lights, Traffic, TrafficSetup};
use swerve_vehicle::Shape;

/// The scenario with the road users of its traffic among its actors, placed with draws of `seed`; unchanged without
/// traffic, and if they are there already. Those for which there is no place are left out.
#[must_use]
pub fn with_traffic(mut scenario: Scenario, shape: &Shape, seed: u64) -> Scenario {
    let Some(traffic) = scenario.traffic.as_mut().filter(|traffic| traffic.seed.is_none()) else {
        return scenario;
    };
    traffic.seed = Some(seed);
    let Some(traffic) = of_scenario(&scenario, shape) else { return scenario };
    let mut numbers = [0_usize; 3];
    let placed = traffic.actors().iter().filter_map(|actor| {
        let pose = traffic.movement(actor.id, Time::ZERO)?.pose;
        let k = match actor.kind {
            ActorKind::Pedestrian => 1,
            ActorKind::Cyclist => 2,
            _ => 0,
        };
        numbers[k] += 1;
        let name = format!("{}_{}", swerve_scenario::Traffic::WORDS[k], numbers[k]);
        Some(Actor::at_rest(actor.id, name, actor.kind, actor.extent, pose))
    });
    let placed: Vec<Actor> = placed.collect();
    scenario.actors.extend(placed);
    scenario
}

/// The traffic of a scenario at the start; `None` if it has none, or is not placed yet.
pub(crate) fn of_scenario(scenario: &Scenario, shape: &Shape) -> Option<Traffic> {
    let traffic = scenario.traffic.as_ref()?;
    let Course::Map(course) = &scenario.road.course else { return None };
    let setup = TrafficSetup {
        vehicles: traffic.vehicles,
        pedestrians: traffic.pedestrians,
        cyclists: traffic.cyclists,
        first_id: traffic.first_id.0,
        closed: course.closures.iter().map(|closure| (closure.at.lane, closure.at.s_m)).collect(),
        ..TrafficSetup::default()
    };
    let programs = scenario.road.lights.clone();
    let aspect = move |id, at| {
        let light = programs.iter().find(|light| light.signal == Some(id));
        light.map_or(Aspect::Off, |light| light.aspect(at))
    };
    let line = scenario.road.line();
    let moving = |body: Obb, speed_mps: f64| (body, body.center.direction() * speed_mps);
    let ego = moving(shape.footprint(scenario.ego_pose(&line, shape)), scenario.ego.start_speed());
    let others = scenario
        .other_egos
        .iter()
        .map(|other| moving(shape.footprint(other.pose(shape)), other.start.start_speed()));
    let actors = scenario.actors.iter().filter(|actor| !is_of_traffic(scenario, actor.id));
    // Those that a script moves may stand at first.
    let actors = actors.map(|actor| moving(actor.extent.footprint(actor.pose(&line)), 0.0));
    let bodies: Vec<(Obb, Vector2)> = core::iter::once(ego).chain(others).chain(actors).collect();
    Some(Traffic::among(Arc::clone(&course.map), &setup, Lights::new(aspect), traffic.seed?, &bodies))
}

/// Returns true for the identities of a scenario's traffic.
pub(crate) fn is_of_traffic(scenario: &Scenario, id: ActorId) -> bool {
    scenario.traffic.is_some_and(|traffic| {
        (traffic.first_id.0..traffic.first_id.0 + traffic.count() as u32).contains(&id.0)
    })
}
