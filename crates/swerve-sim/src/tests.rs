//! The world as a whole, against closed forms.

use swerve_core::{Span, Time, digest_of};
use swerve_msg::truth::{EndReason, WorldState};
use swerve_msg::{ActorId, Command};
use swerve_scenario::Scenario;

use crate::sense::{SensorMount, SensorParams, visible_obstacles};
use crate::{SimParams, Simulator};

pub(crate) const PERSON_BEHIND_TRUCK: &str = include_str!("../../../scenarios/person_behind_truck.toml");

pub(crate) fn scenario(text: &str) -> Scenario {
    Scenario::parse("test.toml", text).unwrap_or_else(|problems| panic!("{problems:#?}"))
}

pub(crate) fn at_hz(hz: i64) -> SimParams {
    SimParams { dt: Span::from_ns(1_000_000_000 / hz), ..SimParams::default() }
}

pub(crate) fn exact(scenario: &Scenario, hz: i64) -> Simulator {
    Simulator::exact(scenario.clone(), &at_hz(hz)).unwrap()
}

/// A pedal that keeps the speed, and straight wheels.
pub(crate) fn keep(state: &WorldState, speed_mps: f64) -> Command {
    let wish = 0.8 * (speed_mps - state.ego.state.speed_mps);
    Command { steering_rad: 0.0, throttle: wish.clamp(0.0, 1.0), brake: (-wish).clamp(0.0, 1.0) }
}

/// Steps until the run is over; every state goes to `see`.
pub(crate) fn drive(
    sim: &mut Simulator,
    command: impl Fn(&WorldState) -> Command,
    mut see: impl FnMut(&WorldState),
) {
    while sim.state().ended.is_none() {
        let command = command(sim.state());
        see(sim.step(command));
    }
}

fn at_speed(speed_mps: f64) -> Scenario {
    let mut scenario = scenario(PERSON_BEHIND_TRUCK);
    scenario.ego.target_speed_mps = speed_mps;
    scenario
}

#[test]
fn the_person_starts_at_26_m_to_the_tick() {
    for speed_mps in [16.0, 22.0] {
        let mut sim = exact(&at_speed(speed_mps), 200);
        let mut within_since = None;
        let mut last = sim.state().clone();
        let shape = sim.params().vehicle.shape;
        let mut first_moved = None;
        drive(
            &mut sim,
            |state| keep(state, speed_mps),
            |state| {
                let person = &state.actors[1];
                let distance = shape.center(last.ego.state.pose).distance(last.actors[1].pose.point());
                if distance <= 26.0 && within_since.is_none() {
                    within_since = Some(last.stamp);
                }
                if person.pose != last.actors[1].pose && first_moved.is_none() {
                    first_moved = Some(last.stamp);
                    assert!((last.actors[1].pose.y_m - person.pose.y_m - 2.75 * 0.005).abs() < 1e-12);
                }
                last = state.clone();
            },
        );
        assert!(within_since.is_some() && within_since == first_moved, "{within_since:?} {first_moved:?}");
    }
}

#[test]
fn the_person_ends_on_the_lane_centre_after_its_way() {
    let mut scenario = at_speed(20.0);
    scenario.actors[1].trigger = None;
    let mut sim = exact(&scenario, 200);
    let arrival = Time::ZERO + Span::from_secs(4.5 / 2.75);
    while sim.state().stamp < Time::from_ms(3000) {
        let command = keep(sim.state(), 20.0);
        let state = sim.step(command);
        let person = &state.actors[1];
        if state.stamp >= arrival {
            assert!(person.pose.y_m.abs() < 1e-12 && person.velocity_mps.norm() == 0.0, "{person:?}");
        } else {
            let want = 4.5 - 2.75 * state.stamp.as_secs();
            assert!((person.pose.y_m - want).abs() < 1e-9, "{person:?}");
        }
    }
}

/// Distance from the sensor to the person along the road when the person is first seen behind the truck.
///
/// Closed form: the eye is at height 1.9 on y = 0, the truck's near rear corner (towards the lane, far end)
/// at x = 112.6, y = 2.7. A point of the person at (x, y) is seen once it is below the line from the eye through
/// that corner. The person's foremost points when walking to the right: behind (x - 0.25), at y; and ahead
/// of the walk (the point at y - 0.25).
fn sight_opens_at(speed_mps: f64) -> f64 {
    let (corner_x, corner_y) = (110.0 + 2.6, 4.0 - 1.3);
    let eye_at = |t: f64| 117.0 - (26.0_f64.powi(2) - 4.5_f64.powi(2)).sqrt() + speed_mps * t;
    let seen = |t: f64| {
        let eye = eye_at(t);
        let y = 4.5 - 2.75 * t;
        let slope = corner_y / (corner_x - eye);
        [(0.0, -0.25), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.25)]
            .into_iter()
            .any(|(dx, dy)| y + dy < slope * (117.0 + dx - eye))
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if seen(middle) { high = middle } else { low = middle }
    }
    117.0 - eye_at(high)
}

#[test]
fn sight_of_the_person_opens_where_geometry_says() {
    for (speed_mps, centre_only) in [(16.0, 19.6), (18.0, 19.0), (20.0, 18.5), (22.0, 18.1)] {
        let want = sight_opens_at(speed_mps);
        let mut sim = exact(&at_speed(speed_mps), 1000);
        let shape = sim.params().vehicle.shape;
        let mount = SensorMount::roof(&shape);
        let mut first = None;
        drive(
            &mut sim,
            |state| keep(state, speed_mps),
            |state| {
                let seen = visible_obstacles(state, &mount, &SensorParams::default());
                let person = seen.obstacles.iter().find(|o| o.id == ActorId(2));
                if first.is_none() && state.stamp > Time::from_ms(1000) && person.is_some() {
                    first = Some(117.0 - shape.center(state.ego.state.pose).x_m);
                }
            },
        );
        let first = first.unwrap();
        println!("{speed_mps} m/s: sight opens {first:.2} m before the person, closed form {want:.2}");
        assert!((first - want).abs() < 0.06, "{speed_mps}: {first} {want}");
        assert!((first - centre_only).abs() < 1.5, "{speed_mps}: {first}");
    }
}

fn street(extra: &str) -> String {
    format!(
        "name = \"street\"\n[road]\nsegments = [{{ length_m = 300.0 }}]\nleft_m = 6.0\nright_m = 2.0\n\
         [ego]\ntarget_speed_mps = 15.0\nend_m = 200.0\n\
         [expect]\nverdict = \"avoided\"\nduration_s = {{ max = 60.0 }}\n{extra}"
    )
}

#[test]
fn an_empty_street_ends_at_the_goal() {
    let mut sim = exact(&scenario(&street("")), 200);
    drive(&mut sim, |state| keep(state, 15.0), |state| assert!(state.collisions.is_empty()));
    assert_eq!(sim.state().ended, Some(EndReason::Goal));
    assert!((sim.state().stamp.as_secs() - 200.0 / 15.0).abs() < 0.2, "{}", sim.state().stamp);
}

fn run_into(
    extra: &str,
    hz: i64,
    speed_mps: f64,
) -> (Vec<swerve_msg::truth::Collision>, WorldState, WorldState) {
    let mut sim = exact(&scenario(&street(extra)), hz);
    let start = sim.state().clone();
    let mut collisions = Vec::new();
    let mut hit = false;
    while sim.state().ended.is_none() {
        let command = if hit { Command::FULL_BRAKE } else { keep(sim.state(), speed_mps) };
        let state = sim.step(command);
        hit |= !state.collisions.is_empty();
        collisions.extend(state.collisions.iter().cloned());
    }
    assert_eq!(sim.state().ended, Some(EndReason::Collision));
    (collisions, start, sim.state().clone())
}

const PARKED: &str = "[[actor]]\nname = \"parked\"\nkind = \"car\"\ns_m = 60.0\nd_m = 0.0\n";

#[test]
fn a_car_hit_head_on_is_pushed_and_reported_once() {
    let (collisions, start, end) = run_into(PARKED, 200, 15.0);
    assert_eq!(collisions.len(), 1, "{collisions:?}");
    let hit = &collisions[0];
    println!("{hit:?}");
    assert_eq!(hit.actor, ActorId(1));
    assert!((hit.closing_speed_mps - 15.0).abs() < 0.1 && (hit.ego_speed_mps - 15.0).abs() < 0.1, "{hit:?}");
    // Inelastic: m1 m2 / (m1 + m2) of the closing speed.
    let want = 1800.0 * 1500.0 / 3300.0 * 15.0;
    assert!((hit.impulse_ns - want).abs() < 0.15 * want, "{} {want}", hit.impulse_ns);
    assert!(end.actors[0].pose.x_m > start.actors[0].pose.x_m + 1.0, "{:?}", end.actors[0]);
}

#[test]
fn an_oncoming_car_closes_with_both_speeds() {
    let oncoming = "[[actor]]\nname = \"oncoming\"\nkind = \"car\"\ns_m = 120.0\nd_m = 0.0\nheading_rad = 3.14159265358979\n\
                    motion = [{ drive = { along = \"road\", speed_mps = 10.0 } }]\n";
    let (collisions, _, _) = run_into(oncoming, 200, 15.0);
    assert_eq!(collisions.len(), 1);
    let hit = &collisions[0];
    println!("{hit:?}");
    assert!((hit.closing_speed_mps - 25.0).abs() < 0.1, "{hit:?}");
    assert!((hit.ego_speed_mps - 15.0).abs() < 0.1, "{hit:?}");
}

#[test]
fn a_wall_does_not_move() {
    let wall = "[[actor]]\nname = \"wall\"\nkind = \"static\"\nsize = { length_m = 1.0, width_m = 6.0, height_m = 2.0 }\ns_m = 60.0\nd_m = 0.0\n";
    let (collisions, start, end) = run_into(wall, 200, 15.0);
    assert_eq!(collisions.len(), 1, "{collisions:?}");
    assert_eq!(start.actors[0], end.actors[0]);
    let want = 1800.0 * 15.0;
    assert!((collisions[0].impulse_ns - want).abs() < 0.15 * want, "{:?}", collisions[0]);
}

#[test]
fn two_runs_share_every_bit_and_the_rate_does_not_change_the_outcome() {
    let run = |hz: i64| {
        let mut sim = exact(&scenario(&street(PARKED)), hz);
        let (mut digests, mut hits) = (Vec::new(), Vec::new());
        drive(
            &mut sim,
            |state| keep(state, 15.0),
            |state| {
                digests.push(digest_of(state));
                hits.extend(state.collisions.iter().cloned());
            },
        );
        (digests, hits, sim.state().clone())
    };
    let (a, hits, end) = run(200);
    assert_eq!(a, run(200).0);
    let (_, fine_hits, fine) = run(1000);
    assert_eq!(fine_hits.len(), 1);
    assert!((hits[0].stamp - fine_hits[0].stamp).as_secs().abs() <= 0.01, "{hits:?} {fine_hits:?}");
    assert!((hits[0].closing_speed_mps - fine_hits[0].closing_speed_mps).abs() < 0.1);
    assert_eq!(end.ended, fine.ended);
    let moved = end.actors[0].pose.point().distance(fine.actors[0].pose.point());
    println!("after the crash the cars differ by {moved:.2} m between 200 Hz and 1 kHz");
    assert!(moved < 1.0, "{moved}");
}
