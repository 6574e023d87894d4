//! SUMO as the source of a scenario's traffic.

use anyhow::{bail, ensure};
use swerve_core::Span;
use swerve_geom::Pose2;
use swerve_msg::ActorId;
use swerve_scenario::{Course, MapCourse, Scenario, SumoWorld, TrafficLight};
use swerve_sumo::{LightProgram, Settings, Sumo};

/// The simulation of SUMO of a scenario, which is not started yet, and the identity of its first vehicle; `None` if the
/// scenario has none. `dt` is the step of the world.
///
/// # Errors
/// If its step is not a multiple of that of the world.
pub(crate) fn of(scenario: &Scenario, dt: Span, seed: u64) -> anyhow::Result<Option<(Sumo, ActorId)>> {
    let Some(world) = &scenario.sumo else { return Ok(None) };
    let Course::Map(course) = &scenario.road.course else {
        bail!("world.sumo: expected a scenario on a `[map]`");
    };
    let step = Span::from_secs(world.step_s);
    ensure!(
        step > Span::ZERO && step.ns() % dt.ns() == 0,
        "world.step_s: expected a multiple of the step of the world, sim.dt_ms = {}, found {} s",
        dt.as_secs() * 1e3,
        world.step_s
    );
    let SumoWorld { config, begin_s, warmup_s, range_m, timeout_s, offset_m, .. } = world.clone();
    let first = first_free(scenario);
    let settings = Settings {
        config,
        step,
        begin_s,
        warmup_s,
        range_m,
        timeout_s,
        offset_m,
        seed,
        first,
        stops: stops(course),
        lights: scenario.road.lights.iter().filter_map(|light| link(course, light)).collect(),
    };
    Ok(Some((Sumo::new(settings), first)))
}

/// Smallest identity that is greater than all of a scenario.
fn first_free(scenario: &Scenario) -> ActorId {
    let egos = scenario.egos().into_iter().map(|(id, _)| id.0);
    let actors = scenario.actors.iter().map(|actor| actor.id.0);
    ActorId(egos.chain(actors).max().unwrap_or(0) + 1)
}

/// Poses of start, places on the way, and goal.
fn stops(course: &MapCourse) -> Vec<Pose2> {
    let pose = |lane, s_m| course.map.lane(lane).map(|lane| lane.line.at(s_m).pose);
    course.stops.iter().filter_map(|stop| pose(stop.lane, stop.s_m)).collect()
}

/// Phases of a link of a traffic light of SUMO, whose signals are named by light and link.
fn link(course: &MapCourse, light: &TrafficLight) -> Option<LightProgram> {
    let (name, link) = course.map.signal(light.signal?)?.name.rsplit_once(':')?;
    let link = link.parse().ok()?;
    Some(LightProgram { light: name.to_owned(), link, program: light.program.clone(), gives_way: false })
}
