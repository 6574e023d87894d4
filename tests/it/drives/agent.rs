//! Drives by an agent in place of a part of the stack.

use swerve_core::Time;
use swerve_drive::read_scenario;
use swerve_flow::{Reached, RunOptions, Session};
use swerve_msg::truth::WorldState;
use swerve_msg::{Command, EgoState};
use swerve_stack::Setup;
use swerve_stack::agent::{Agent, Seat, Target};
use swerve_stack::pipeline::Pipeline;

fn lane() -> (Setup, swerve_scenario::Scenario) {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/lane.toml");
    (Setup::default(), read_scenario(file.as_ref()).unwrap())
}

/// Drives until an instant; returns the true states and the number of requests to the agent.
fn driven(agent: &Agent, until: Time) -> (Vec<EgoState>, usize) {
    let (config, scenario) = lane();
    let pipeline = Pipeline::build_for(&config, &scenario, agent).unwrap();
    let options = RunOptions::until(until).seed(config.seed);
    let mut session = Session::new(pipeline.graph, &options, vec![]).unwrap();
    session.hold_before(&agent.operator(&config).unwrap()).unwrap();
    let world = session.watch("world", 1).unwrap();
    let mut states = Vec::new();
    while session.advance() == Reached::Held {
        let (_, payload) = session.newest(world).unwrap();
        states.push((**payload).as_any().downcast_ref::<WorldState>().unwrap().ego.state);
    }
    let asked = states.len();
    session.finish().unwrap();
    (states, asked)
}

#[test]
fn target_is_followed_at_and_beside_the_route() {
    let seat = Seat::default();
    seat.set(Target { speed_mps: 6.0, offset_m: 0.8 });
    let (states, asked) = driven(&Agent::Target(seat), Time::from_ms(6000));
    let (_, scenario) = lane();
    let last = states.last().unwrap();
    let place = scenario.road.route().project(last.pose.point());
    assert_eq!(asked, 121, "once a frame of the obstacle sensor");
    assert!((last.speed_mps - 6.0).abs() < 0.5, "{last:?}");
    assert!((place.d_m - 0.8).abs() < 0.2, "{place:?}");
}

#[test]
fn agent_at_the_wheel_is_asked_once_per_period_and_its_command_is_driven() {
    let seat = Seat::default();
    seat.set(Command::FULL_BRAKE);
    let (states, asked) = driven(&Agent::Command(seat), Time::from_ms(1000));
    assert_eq!(asked, 101);
    assert!(states[100].speed_mps < states[0].speed_mps - 3.0, "{:?}", states[100]);
}
