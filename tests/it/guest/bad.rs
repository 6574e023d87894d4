//! Bad input of a foreign world: one clear error each, and the run goes on.

use swerve_core::Time;
use swerve_drive::{Stack, StackOptions};
use swerve_geom::Pose2;
use swerve_msg::{EgoState, Imu, ObstacleList};

use super::{config, scenario};

fn stack() -> Stack {
    Stack::new(&config(&["sim.draws=false"]), &scenario("lane"), &StackOptions::default()).unwrap()
}

fn at(ms: i64) -> Time {
    Time::from_ms(ms)
}

fn pose(ms: i64) -> EgoState {
    EgoState { stamp: at(ms), pose: Pose2::new(1.0, 0.0, 0.0), speed_mps: 5.0, ..EgoState::default() }
}

#[track_caller]
fn refused<T>(result: anyhow::Result<T>, words: &[&str]) {
    let error = format!("{:#}", result.err().expect("an error"));
    for word in words {
        assert!(error.contains(word), "{error}");
    }
    assert!(!error.contains('\n'), "{error}");
}

#[test]
fn messages_that_do_not_fit_are_refused() {
    let mut stack = stack();
    refused(
        stack.feed("obstacle", ObstacleList::default()),
        &["unknown input stream `obstacle`", "did you mean `obstacles`?"],
    );
    refused(stack.feed("planner", ObstacleList::default()), &["unknown input stream `planner`", "obstacles"]);
    refused(stack.feed("pose", Imu::default()), &["`pose`", "expected messages of type EgoState, found Imu"]);
    refused(stack.feed_cbor("pose", b"\xff\x00"), &["`pose`", "expected a message of type EgoState"]);
    refused(stack.feed_cbor("pose", b"\xa1\x65stamp\x05"), &["`pose`", "missing field"]);
    refused(stack.feed_cbor("pose", b"\xa0"), &["`pose`", "with a stamp"]);
    let nan = EgoState { speed_mps: f64::NAN, ..pose(0) };
    refused(stack.feed("pose", nan), &["`pose`: speed_mps is NaN: expected a finite number"]);
    refused(stack.feed("pose", EgoState { stamp: at(-1), ..pose(0) }), &["`pose`: stamp -0.001 s"]);
    stack.feed("pose", pose(0)).unwrap();
    refused(stack.feed("pose", pose(0)), &["`pose`", "expected one after 0.000 s"]);
    stack.advance_to(at(20)).unwrap();
    refused(
        stack.feed("pose", pose(20)),
        &["`pose`: stamp 0.020 s", "advanced to 0.020 s", "before advancing"],
    );
    stack.feed("pose", pose(30)).unwrap();
    assert!(stack.advance_to(at(30)).is_ok());
}

#[test]
fn instants_that_do_not_follow_are_refused() {
    let mut stack = stack();
    stack.advance_to(at(50)).unwrap();
    refused(stack.advance_to(at(40)), &["advance to 0.040 s: time goes back, the stack is at 0.050 s"]);
    refused(stack.advance_to(Time::MAX), &["the scenario ends at", "end.timeout_s"]);
    let until = stack.until();
    stack.advance_to(until).unwrap();
    stack.advance_to(until).unwrap();
    let outcome = stack.finish().unwrap();
    assert_eq!(outcome.metrics.verdict, swerve_eval::Verdict::Unfinished);
}

#[test]
fn an_ego_that_starts_off_the_road_is_refused() {
    let mut stack = stack();
    let beside = EgoState { pose: Pose2::new(1.0, 60.0, 0.0), ..pose(0) };
    refused(stack.feed("pose", beside), &["`pose`: the ego starts at (1.0, 60.0) m", "m off the road"]);
    let far = EgoState { pose: Pose2::new(-300.0, 0.0, 0.0), ..pose(0) };
    refused(stack.feed("pose", far), &["off the road", "begins at (0.0, 0.0) m"]);
    let turned = EgoState { pose: Pose2::new(1.0, 0.0, 3.1), ..pose(0) };
    refused(stack.feed("pose", turned), &["3.10 rad off the route"]);
    stack.feed("pose", pose(0)).unwrap();
    // Later it may leave the road.
    stack.feed("pose", EgoState { stamp: at(10), ..beside }).unwrap();
}

#[test]
fn configurations_of_another_world_are_refused() {
    let of = |sets: &[&str]| Stack::new(&config(sets), &scenario("lane"), &StackOptions::default());
    refused(
        of(&["operator.world.delay_ms=1"]),
        &["operator.world: the world is the program that feeds the stack"],
    );
    refused(of(&["sim.dt_ms=10"]), &["sim.dt_ms: the foreign world has its own step"]);
    refused(of(&["clock.source=wall"]), &["clock.source", "expected \"virtual\""]);
    refused(
        of(&["operator.obstacles.runtime={ fixed_ms = 5 }"]),
        &["operator.obstacles.runtime", "delay_ms"],
    );
    let several = Stack::new(&config(&[]), &scenario("maps/two_egos"), &StackOptions::default());
    refused(several, &["several egos"]);
}

#[test]
fn streams_that_are_read_have_to_exist() {
    let mut stack = stack();
    refused(stack.newest_any("planer"), &["unknown stream `planer`", "did you mean `planner`?"]);
    assert!(stack.newest::<EgoState>("pose").unwrap().is_none());
    stack.feed("pose", pose(0)).unwrap();
    stack.advance_to(at(0)).unwrap();
    refused(stack.newest::<Imu>("pose"), &["`pose`", "EgoState", "not Imu"]);
}

#[test]
fn a_run_without_its_world_is_refused() {
    let config = config(&["sim.guest=true"]);
    refused(
        swerve_drive::drive(&config, &scenario("lane")),
        &["sim.guest: there is no world", "swerve.Stack"],
    );
}
