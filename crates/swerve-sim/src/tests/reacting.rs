//! Recorded vehicles that brake for the ego.

use std::sync::Arc;

use super::*;
use swerve_geom::Pose2;
use swerve_msg::truth::Actor;
use swerve_scenario::{Motion, Track};

/// A road of 600 m on which the ego drives, among cars recorded at 10 m/s for 20 s, from these places on.
fn among(cars: &[(f64, f64)], reacts: bool) -> Scenario {
    let car = |k: usize| {
        format!(
            "[[actor]]\nname = \"car_{k}\"\nkind = \"car\"\nsize = {{ length_m = 4.0, width_m = 2.0, height_m = 1.5 }}\n\
             s_m = {}\nd_m = 6.0\n",
            300 + 10 * k
        )
    };
    let actors: String = (0..cars.len()).map(car).collect();
    let mut scenario = scenario(&format!(
        "name = \"x\"\n[road]\nsegments = [{{ length_m = 600.0 }}]\nleft_m = 12.0\n\
         [ego]\ns_m = 100.0\ntarget_speed_mps = 10.0\nend_m = 500.0\n{actors}[end]\ntimeout_s = 15.0\n\
         [expect]\nverdict = \"avoided\"\nduration_s = {{ max = 60.0 }}\n"
    ));
    for (actor, (x_m, y_m)) in scenario.actors.iter_mut().zip(cars) {
        let poses: Arc<[Pose2]> = (0..=200).map(|k| Pose2::new(x_m + f64::from(k), *y_m, 0.0)).collect();
        actor.motion = vec![Motion::Track(Track { from_s: 0.0, step_s: 0.1, poses, reacts })];
    }
    scenario
}

/// All states of a drive in which the ego keeps `speed_mps`, given the time, seconds.
fn states(scenario: &Scenario, speed_mps: impl Fn(f64) -> f64) -> Vec<WorldState> {
    let mut sim = exact(scenario, 200);
    let mut all = Vec::new();
    drive(
        &mut sim,
        |state| keep(state, speed_mps((state.stamp - Time::ZERO).as_secs())),
        |state| all.push(state.clone()),
    );
    all
}

fn hits(states: &[WorldState]) -> usize {
    states.iter().map(|state| state.collisions.len()).sum()
}

fn car(state: &WorldState, k: usize) -> &Actor {
    &state.actors[k]
}

#[test]
fn recorded_car_brakes_for_an_ego_that_is_slower_than_the_recorded_one() {
    let behind = [(80.0, 0.0), (65.0, 0.0)];
    let slow = |_: f64| 5.0;
    assert!(hits(&states(&among(&behind, false), slow)) > 0, "exact replay drives into the ego");
    let reacting = states(&among(&behind, true), slow);
    assert_eq!(hits(&reacting), 0);
    let last = &reacting[reacting.len() - 1];
    assert!(last.stamp >= Time::from_ms(14_900), "{}", last.stamp);
    // Both follow at the ego's speed, the second behind the first.
    let (first, second) = (car(last, 0), car(last, 1));
    for one in [first, second] {
        assert!((one.velocity_mps.x - 5.0).abs() < 0.5 && one.pose.y_m == 0.0, "{one:?}");
    }
    let gap_m = first.pose.x_m - second.pose.x_m - 4.0;
    assert!((2.0..12.0).contains(&gap_m), "{gap_m}");
    let again = states(&among(&behind, true), slow);
    assert_eq!(again, reacting);
}

#[test]
fn recording_is_replayed_exactly_where_the_ego_is_not_in_the_way() {
    // Behind the ego in another lane, ahead of it, and behind it far enough.
    let cars = [(80.0, 4.0), (130.0, 0.0), (112.0, 8.0)];
    let fast = |_: f64| 10.0;
    let replayed = states(&among(&cars, false), fast);
    assert_eq!(hits(&replayed), 0);
    assert_eq!(states(&among(&cars, true), fast), replayed);
}

#[test]
fn car_catches_up_with_its_recording_and_is_never_ahead_of_it() {
    let cars = [(70.0, 0.0)];
    let slow_then_fast = |at_s: f64| if at_s < 4.0 { 6.0 } else { 25.0 };
    let states = states(&among(&cars, true), slow_then_fast);
    assert_eq!(hits(&states), 0);
    let behind_m =
        |state: &WorldState| 70.0 + 10.0 * (state.stamp - Time::ZERO).as_secs() - car(state, 0).pose.x_m;
    let most_m = states.iter().map(behind_m).fold(0.0, f64::max);
    assert!(most_m > 1.0, "{most_m}");
    assert!(states.iter().all(|state| behind_m(state) > -1e-6));
    let last_m = behind_m(&states[states.len() - 1]);
    assert!(last_m < most_m - 2.0, "{last_m} of {most_m}");
    // Speeds do not jump.
    let speeds: Vec<f64> = states.iter().map(|state| car(state, 0).velocity_mps.x).collect();
    assert!(speeds.windows(2).all(|two| (two[1] - two[0]).abs() < 0.05), "{speeds:?}");
}
