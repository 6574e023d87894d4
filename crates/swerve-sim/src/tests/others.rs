//! Collisions between two actors.

use std::sync::Arc;

use super::*;
use crate::sense::collisions;
use swerve_geom::Pose2;
use swerve_msg::truth::Collision;
use swerve_scenario::{Motion, Track};

/// A wide road on which the ego drives past the actors.
fn beside(actors: &str) -> Scenario {
    scenario(&format!(
        "name = \"x\"\n[road]\nsegments = [{{ length_m = 300.0 }}]\nleft_m = 12.0\n\
         [ego]\ntarget_speed_mps = 10.0\nend_m = 120.0\n{actors}\
         [expect]\nverdict = \"avoided\"\nduration_s = {{ max = 60.0 }}\n"
    ))
}

/// Collisions of a drive, which reaches its goal whatever happens beside it.
fn of_a_drive(scenario: &Scenario) -> Vec<Collision> {
    let mut sim = exact(scenario, 200);
    let mut hits = Vec::new();
    drive(
        &mut sim,
        |state| keep(state, 10.0),
        |state| {
            assert_eq!(collisions(state).events, []);
            assert_eq!(state.collisions_of_ego().count(), 0);
            hits.extend(state.collisions_of_others().cloned());
        },
    );
    assert_eq!(sim.state().ended, Some(EndReason::Goal));
    println!("{hits:?}");
    hits
}

const CAR: &str = "[[actor]]\nname = \"car\"\nkind = \"car\"\nsize = { length_m = 4.0, width_m = 2.0, height_m = 1.5 }\n\
                   s_m = 60.0\nd_m = 6.0\n";

fn walker(name: &str, d_m: f64, speed_mps: f64, direction: &str) -> String {
    format!(
        "[[actor]]\nname = \"{name}\"\nkind = \"pedestrian\"\nsize = {{ radius_m = 0.25, height_m = 1.8 }}\n\
         s_m = 90.0\nd_m = {d_m:.1}\n\
         motion = [{{ walk = {{ speed_mps = {speed_mps:.1}, distance_m = 4.0, direction = \"{direction}\" }} }}]\n"
    )
}

#[test]
fn collision_of_others_names_both_and_does_not_end_the_run() {
    let parked = CAR.replace("\"car\"\nkind", "\"parked\"\nkind").replace("60.0", "100.0");
    let moving = format!("{CAR}motion = [{{ drive = {{ along = \"heading\", speed_mps = 8.0 }} }}]\n");
    let [hit] = &of_a_drive(&beside(&(moving + &parked)))[..] else { panic!("one collision") };
    assert_eq!((hit.parties, hit.other_than(ActorId::EGO)), ([ActorId(1), ActorId(2)], None));
    // 36 m between rear and front at 8 m/s. Drivers do not feel impulses.
    assert!((hit.stamp.as_secs() - 4.5).abs() < 0.0051, "{hit:?}");
    assert!((hit.closing_speed_mps - 8.0).abs() < 1e-6 && hit.speeds_mps == [8.0, 0.0], "{hit:?}");
    assert_eq!(hit.impulse_n_s, 0.0);
}

#[test]
fn people_collide_with_cars_but_not_with_each_other() {
    let people = walker("a", 5.0, 1.0, "left") + &walker("b", 9.0, 1.5, "right");
    assert_eq!(of_a_drive(&beside(&people)), []);
    let by_car = CAR.replace("60.0", "90.0") + &walker("b", 9.0, 1.5, "right");
    let [hit] = &of_a_drive(&beside(&by_car))[..] else { panic!("one collision") };
    assert!((hit.stamp.as_secs() - 1.75 / 1.5).abs() < 0.0051, "{hit:?}");
    assert!((hit.closing_speed_mps - 1.5).abs() < 1e-6, "{hit:?}");
    assert_eq!((hit.parties, hit.speeds_mps), ([ActorId(1), ActorId(2)], [0.0, 1.5]));
}

#[test]
fn contact_from_the_start_is_no_collision() {
    let next = CAR.replace("\"car\"\nkind", "\"next\"\nkind").replace("60.0", "70.0");
    // A scenario file may not state it; random draws and other programs may.
    let mut touching = beside(&format!("{CAR}{next}{}", walker("out", 6.0, 1.0, "left")));
    (touching.actors[1].s_m, touching.actors[2].s_m) = (64.0, 64.5);
    assert_eq!(of_a_drive(&touching), [], "two stand bumper to bumper, and one walks out of one of them");
}

#[test]
fn state_is_the_same_but_for_collisions_of_others() {
    let parked = CAR.replace("\"car\"\nkind", "\"parked\"\nkind").replace("60.0", "64.5");
    let moving = format!("{CAR}motion = [{{ drive = {{ along = \"heading\", speed_mps = 8.0 }} }}]\n");
    let end = |actors: &str| {
        let mut sim = exact(&beside(actors), 200);
        drive(&mut sim, |state| keep(state, 10.0), |_| {});
        sim.state().clone()
    };
    let (alone, through) = (end(&moving), end(&format!("{moving}{parked}")));
    assert_eq!(
        (alone.stamp, &alone.ego, &alone.actors[0]),
        (through.stamp, &through.ego, &through.actors[0])
    );
}

/// A car that is there from 1 s to 2 s, beside the ego or ahead of it in its lane.
fn recorded(x_m: f64, y_m: f64) -> Scenario {
    let mut scenario = beside(CAR);
    let poses: Arc<[Pose2]> = (0..=10).map(|k| Pose2::new(x_m + f64::from(k), y_m, 0.0)).collect();
    scenario.actors[0].motion = vec![Motion::Track(Track { from_s: 1.0, step_s: 0.1, poses, reacts: false })];
    scenario
}

#[test]
fn recorded_road_user_is_in_the_state_only_while_it_is_there() {
    let mut sim = exact(&recorded(30.0, 6.0), 200);
    assert!(sim.state().actors.is_empty());
    let mut seen = Vec::new();
    drive(
        &mut sim,
        |state| keep(state, 10.0),
        |state| seen.extend(state.actors.iter().map(|car| (state.stamp, car.pose, car.velocity_mps.x))),
    );
    assert_eq!(sim.state().ended, Some(EndReason::Goal));
    let (first, last) = (seen[0], seen[seen.len() - 1]);
    assert_eq!((first.0, last.0, seen.len()), (Time::from_ms(1000), Time::from_ms(2000), 201));
    assert!((first.1.x_m - 30.0).abs() < 1e-6 && (last.1.x_m - 40.0).abs() < 1e-6);
    assert!(seen.iter().all(|(.., speed_mps)| (speed_mps - 10.0).abs() < 1e-6));
}

#[test]
fn road_user_that_appears_inside_the_ego_is_a_collision() {
    let mut sim = exact(&recorded(11.0, 0.0), 200);
    let mut hits = Vec::new();
    drive(
        &mut sim,
        |state| keep(state, 10.0),
        |state| hits.extend(state.collisions_of_ego().map(|(_, hit)| hit.clone())),
    );
    assert!((hits[0].stamp.as_secs() - 1.0).abs() < 0.02, "{hits:?}");
}
