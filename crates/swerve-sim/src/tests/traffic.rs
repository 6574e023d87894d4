//! Traffic of a scenario in the simulated world.

use swerve_msg::ActorKind;
use swerve_msg::truth::Actor;
use swerve_scenario::Course;

use super::*;
use crate::with_traffic;

/// An ego on an arm of the crossing with lights.
fn crossing(vehicles: usize, pedestrians: usize) -> Scenario {
    let text = format!(
        "name = \"x\"\n[map]\nfile = \"crossing.xodr\"\n[traffic]\nvehicles = {vehicles}\npedestrians = {pedestrians}\n\
         [ego]\nstart = {{ road = \"4\", lane = -1, s_m = 20.0 }}\ngoal = {{ road = \"3\", lane = 1, s_m = 60.0 }}\n\
         target_speed_mps = 10.0\nstart_speed_mps = 0.0\n[end]\ntimeout_s = 60.0\n"
    );
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps/test.toml");
    Scenario::parse(file, &text).unwrap_or_else(|problems| panic!("{problems}"))
}

fn with_seed(scenario: &Scenario, seed: u64) -> Simulator {
    Simulator::new(scenario, &at_hz(200), seed).unwrap()
}

const STAND: Command = Command { steering_rad: 0.0, throttle: 0.0, brake: 1.0 };

/// States of 20 s with a standing ego, ten a second.
fn standing(sim: &mut Simulator) -> Vec<WorldState> {
    let step = |k: usize| {
        let state = sim.step(STAND).clone();
        assert!(state.collisions.is_empty(), "{:?}", state.collisions);
        k.is_multiple_of(20).then_some(state)
    };
    (0..4_000).filter_map(step).collect()
}

#[test]
fn traffic_drives_and_walks_without_contacts_and_repeats() {
    let scenario = crossing(20, 10);
    let mut sim = with_seed(&scenario, 3);
    let first = sim.state().actors.clone();
    assert_eq!(first.len(), 30);
    let people = first.iter().filter(|actor| actor.kind == ActorKind::Pedestrian).count();
    assert_eq!(people, 10);
    // The first state has the speeds of the next steps.
    let moving = |actors: &[Actor]| actors.iter().filter(|actor| actor.velocity_mps.norm() > 0.5).count();
    assert!(moving(&first) > 15, "{}", moving(&first));
    let states = standing(&mut sim);
    let last = states.last().unwrap();
    let moved = first.iter().zip(&last.actors).filter(|(a, b)| a.pose.point().distance(b.pose.point()) > 5.0);
    let moved = moved.count();
    assert!(moved > 20, "{moved}");
    assert_eq!(states, standing(&mut with_seed(&scenario, 3)), "bit for bit");
    assert_ne!(first, with_seed(&scenario, 4).state().actors);
    let more = with_seed(&crossing(21, 10), 3);
    let names = [sim.scenario(), more.scenario()].map(Scenario::names);
    assert_eq!(names[1][&ActorId(1)], "vehicle_1");
    let of = |names: &swerve_msg::ActorNames, actors: &[Actor], name: &str| {
        actors.iter().find(|actor| names[&actor.id] == name).unwrap().pose
    };
    for name in ["vehicle_1", "vehicle_20", "pedestrian_1", "pedestrian_10"] {
        let both = [of(&names[0], &first, name), of(&names[1], &more.state().actors, name)];
        assert_eq!(both[0], both[1], "{name}: one vehicle more moves no other");
    }
}

#[test]
fn vehicle_of_the_traffic_that_is_hit_moves_by_physics() {
    let mut sim = with_seed(&crossing(30, 0), 1);
    let ahead = |state: &WorldState| Command {
        steering_rad: 0.0,
        throttle: if state.ego.state.speed_mps < 20.0 { 1.0 } else { 0.0 },
        brake: 0.0,
    };
    let mut hit = None;
    for _ in 0..4_000 {
        let command = if hit.is_some() { STAND } else { ahead(sim.state()) };
        let state = sim.step(command);
        hit = hit.or(state.collisions.first().and_then(|collision| collision.other_than(ActorId::EGO)));
    }
    let hit = hit.expect("the ego drives on at a red light or into a queue");
    assert!(sim.scenario().names()[&hit].starts_with("vehicle_"));
    let rest_mps = sim.state().actor(hit).unwrap().velocity_mps.norm();
    assert!(rest_mps < 0.1, "friction brings it to rest, not its driver on its way: {rest_mps}");
}

#[test]
fn road_users_without_a_place_are_counted() {
    let scenario = crossing(300, 0);
    let placed = with_traffic(scenario.clone(), &at_hz(200).vehicle.shape, 1);
    assert!(placed.left_out() > 50, "{}", placed.left_out());
    assert_eq!(placed.left_out() + placed.actors.len(), 300);
    assert_eq!(scenario.left_out(), 0, "not placed yet");
    assert_eq!(scenario.old_verdicts(), Vec::<String>::new());
}

#[test]
fn traffic_keeps_away_from_a_closed_place_of_the_scenario() {
    let scenario = crossing(20, 0);
    let text = scenario
        .text
        .replace("[traffic]", "[[map.closure]]\nat = { road = \"1\", lane = 1, s_m = 40.0 }\n[traffic]");
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps/test.toml");
    let closed = Scenario::parse(file, &text).unwrap_or_else(|problems| panic!("{problems}"));
    let Course::Map(course) = &closed.road.course else { panic!("a map") };
    let closure = course.closures[0].at;
    let lane = course.map.lane(closure.lane).unwrap();
    let at = lane.line.at(closure.s_m).pose.point();
    let passes = |scenario: &Scenario| {
        let mut sim = with_seed(scenario, 3);
        let states = standing(&mut sim);
        let is_there = |actor: &Actor| actor.pose.point().distance(at) < 1.5;
        states.iter().any(|state| state.actors.iter().any(is_there))
    };
    assert!(passes(&scenario) && !passes(&closed));
}
