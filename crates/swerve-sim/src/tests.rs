//! The simulated world against closed forms.

mod drivers;
mod egos;
mod others;
mod outside;
mod reacting;
mod scenarios;
mod traffic;

use swerve_core::{Span, Time, digest_of};
use swerve_msg::truth::{EndReason, WorldState};
use swerve_msg::{ActorId, Command};
use swerve_scenario::{Scenario, Standstill};

use crate::sense::{SensorMount, SensorParams, visible_obstacles};
use crate::{SimError, SimParams, Simulator};

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

/// Command that keeps the speed with straight wheels.
pub(crate) fn keep(state: &WorldState, speed_mps: f64) -> Command {
    let wish = 0.8 * (speed_mps - state.ego.state.speed_mps);
    Command { steering_rad: 0.0, throttle: wish.clamp(0.0, 1.0), brake: (-wish).clamp(0.0, 1.0) }
}

/// Steps until the run ends; passes every state to `see`.
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
fn person_starts_at_26_m_to_the_tick() {
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
fn person_ends_on_the_lane_centre() {
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

/// Distance along the road from the sensor to the person's centre when the first of the given points of the person
/// (relative to the centre) becomes visible past the truck.
///
/// Closed form: the eye is on y = 0 and below the truck's roof; the occluding corner is the far one on the lane's side,
/// at x = 112.6, y = 2.7. A point is visible once it is on the lane's side of the line from the eye through that
/// corner. The ego keeps its speed after the trigger at 26 m.
fn sight_opens_at(speed_mps: f64, points: &[(f64, f64)]) -> f64 {
    let (corner_x, corner_y) = (110.0 + 2.6, 4.0 - 1.3);
    let eye_at = |t: f64| 117.0 - (26.0_f64 * 26.0 - 4.5 * 4.5).sqrt() + speed_mps * t;
    let seen = |t: f64| {
        let (eye, y) = (eye_at(t), 4.5 - 2.75 * t);
        let slope = corner_y / (corner_x - eye);
        points.iter().any(|(dx, dy)| y + dy < slope * (117.0 + dx - eye))
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if seen(middle) { high = middle } else { low = middle }
    }
    117.0 - eye_at(high)
}

#[test]
fn person_becomes_visible_as_geometry_requires() {
    let rim = [(0.0, -0.25), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.25)];
    for (speed_mps, of_the_centre) in [(16.0, 19.6), (18.0, 19.0), (20.0, 18.5), (22.0, 18.1)] {
        // The known figures of this scenario are for the person's centre; with nine points the first one counts.
        assert!((sight_opens_at(speed_mps, &[(0.0, 0.0)]) - of_the_centre).abs() < 0.2);
        let want = sight_opens_at(speed_mps, &rim);
        let mut sim = exact(&at_speed(speed_mps), 1000);
        let shape = sim.params().vehicle.shape;
        let mount = SensorMount::roof(&shape);
        let mut first = None;
        drive(
            &mut sim,
            |state| keep(state, speed_mps),
            |state| {
                let seen = visible_obstacles(state, &mount, &SensorParams::default());
                let set_off = state.actors[1].velocity_mps.norm() > 0.0;
                if first.is_none() && set_off && seen.obstacles.iter().any(|o| o.id == ActorId(2)) {
                    first = Some(117.0 - shape.center(state.ego.state.pose).x_m);
                }
            },
        );
        let first = first.unwrap();
        println!("{speed_mps} m/s: sight opens {first:.2} m before the person, closed form {want:.2}");
        assert!((first - want).abs() < 0.06, "{speed_mps}: {first} {want}");
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
fn empty_street_ends_at_the_goal() {
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
fn car_hit_head_on_is_pushed_and_reported_once() {
    let (collisions, start, end) = run_into(PARKED, 200, 15.0);
    assert_eq!(collisions.len(), 1, "{collisions:?}");
    let hit = &collisions[0];
    println!("{hit:?}");
    assert_eq!(hit.parties, [ActorId::EGO, ActorId(1)]);
    assert!((hit.closing_speed_mps - 15.0).abs() < 0.1 && (hit.speeds_mps[0] - 15.0).abs() < 0.1, "{hit:?}");
    // Inelastic: m1 m2 / (m1 + m2) times the closing speed.
    let want = 1800.0 * 1500.0 / 3300.0 * 15.0;
    assert!((hit.impulse_n_s - want).abs() < 0.15 * want, "{} {want}", hit.impulse_n_s);
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
    assert!((hit.speeds_mps[0] - 15.0).abs() < 0.1, "{hit:?}");
}

#[test]
fn wall_does_not_move() {
    let wall = "[[actor]]\nname = \"wall\"\nkind = \"static\"\nsize = { length_m = 1.0, width_m = 6.0, height_m = 2.0 }\ns_m = 60.0\nd_m = 0.0\n";
    let (collisions, start, end) = run_into(wall, 200, 15.0);
    assert_eq!(collisions.len(), 1, "{collisions:?}");
    assert_eq!(start.actors[0], end.actors[0]);
    let want = 1800.0 * 15.0;
    assert!((collisions[0].impulse_n_s - want).abs() < 0.15 * want, "{:?}", collisions[0]);
}

#[test]
fn car_from_the_side_closes_with_its_own_speed() {
    // At 6 s the ego's centre passes s = 60 and the other's nose reaches the ego's left side.
    let side = "[[actor]]\nname = \"side\"\nkind = \"car\"\ns_m = 60.0\nd_m = 11.18\nheading_rad = -1.5707963267948966\n\
                trigger = { time = { at_s = 5.0 } }\nmotion = [{ drive = { along = \"heading\", speed_mps = 8.0 } }]\n";
    let mut scenario = scenario(&street(side));
    scenario.ego.target_speed_mps = 10.0;
    let mut sim = exact(&scenario, 200);
    let mut hits = Vec::new();
    drive(&mut sim, |state| keep(state, 10.0), |state| hits.extend(state.collisions.iter().cloned()));
    println!("{hits:?}");
    assert_eq!(hits.len(), 1);
    assert!((hits[0].stamp.as_secs() - 6.0).abs() < 0.02, "{hits:?}");
    assert!((hits[0].closing_speed_mps - 8.0).abs() < 0.05, "{hits:?}");
    assert!((hits[0].speeds_mps[0] - 10.0).abs() < 0.1, "{hits:?}");
    assert!(hits[0].impulse_n_s > 1000.0);
}

/// Drives at constant speed past the truck, ignoring the person.
fn ignore_the_person(speed_mps: f64) -> (swerve_msg::truth::Collision, WorldState) {
    let mut sim = exact(&at_speed(speed_mps), 200);
    let mut hits = Vec::new();
    drive(&mut sim, |state| keep(state, speed_mps), |state| hits.extend(state.collisions.iter().cloned()));
    println!("{hits:?}");
    assert_eq!(hits.len(), 1);
    assert_eq!(hits[0].parties, [ActorId::EGO, ActorId(2)]);
    assert!((hits[0].speeds_mps[0] - speed_mps).abs() < 0.1);
    (hits.remove(0), sim.state().clone())
}

#[test]
fn person_is_hit_by_the_front_and_thrown_at_16_mps() {
    let (hit, end) = ignore_the_person(16.0);
    assert!((hit.closing_speed_mps - 16.0).abs() < 0.2, "{hit:?}");
    // 75 kg accelerated to the common speed of 15.4 m/s or somewhat more.
    assert!(hit.impulse_n_s > 900.0 && hit.impulse_n_s < 1700.0, "{hit:?}");
    // Still in front of the car two seconds later, which has lost some speed.
    let front_m = end.ego.state.pose.x_m + 3.8;
    assert!(end.actors[1].pose.x_m > front_m, "{end:?}");
    assert!(end.ego.state.speed_mps > 10.0 && end.ego.state.speed_mps < 15.5, "{end:?}");
}

#[test]
fn person_walks_into_the_side_at_20_mps() {
    // The front passes 1.15 s after the trigger; the person is then at y = 1.33, 0.15 m from the side.
    let (hit, _) = ignore_the_person(20.0);
    assert!((hit.closing_speed_mps - 2.75).abs() < 0.05, "{hit:?}");
    assert!(hit.impulse_n_s > 100.0 && hit.impulse_n_s < 400.0, "{hit:?}");
}

#[test]
fn pushed_car_pushes_the_next() {
    let row = format!("{PARKED}[[actor]]\nname = \"next\"\nkind = \"car\"\ns_m = 65.5\nd_m = 0.0\n");
    let (collisions, start, end) = run_into(&row, 200, 15.0);
    let parties: Vec<_> = collisions.iter().map(|hit| hit.parties).collect();
    assert_eq!(
        parties,
        [[ActorId::EGO, ActorId(1)], [ActorId(1), ActorId(2)]],
        "the ego hits only the first"
    );
    let next = &collisions[1];
    assert!(next.impulse_n_s > 1000.0 && next.closing_speed_mps > 1.0, "{next:?}");
    assert!(
        (next.speeds_mps[0] - next.closing_speed_mps).abs() < 0.1 && next.speeds_mps[1] < 0.1,
        "{next:?}"
    );
    assert!(end.actors[1].pose.x_m > start.actors[1].pose.x_m + 0.5, "{:?}", end.actors[1]);
}

#[test]
fn closely_passed_actor_keeps_to_its_script() {
    let walker = "[[actor]]\nname = \"walker\"\nkind = \"pedestrian\"\ns_m = 60.0\nd_m = 1.2\n\
                  motion = [{ walk = { speed_mps = 1.0, distance_m = 20.0, direction = \"ahead\" } }]\n";
    let mut sim = exact(&scenario(&street(walker)), 200);
    let outline = sim.params().vehicle.shape;
    let mut closest = f64::INFINITY;
    drive(
        &mut sim,
        |state| keep(state, 15.0),
        |state| {
            assert!(state.collisions.is_empty());
            let actor = &state.actors[0];
            closest = closest.min(actor.gap_m(&outline.footprint(state.ego.state.pose)));
            let want = 60.0 + state.stamp.as_secs();
            assert!(
                (actor.pose.x_m - want).abs() < 1e-9 && (actor.pose.y_m - 1.2).abs() < 1e-12,
                "{actor:?}"
            );
            assert_eq!(actor.z_m, 0.0);
        },
    );
    assert!(closest > 0.0 && closest < 0.03, "{closest}");
    assert_eq!(sim.state().ended, Some(EndReason::Goal));
}

#[test]
fn leaving_the_road_is_recorded_at_the_first_tick_with_a_corner_outside() {
    let mut scenario = scenario(&street(""));
    scenario.ego.heading_rad = -0.05;
    let mut sim = exact(&scenario, 200);
    let shape = sim.params().vehicle.shape;
    let (mut outside_since, mut noted) = (None, Vec::new());
    while sim.state().stamp < Time::from_ms(4000) {
        let command = keep(sim.state(), 15.0);
        let state = sim.step(command);
        // Independent computation: the front right corner leads.
        let center = shape.center(state.ego.state.pose);
        let (sin, cos) = swerve_geom::math::sin_cos(state.ego.state.pose.heading_rad);
        let corner_y = center.y_m + 0.5 * shape.length_m * sin - 0.5 * shape.width_m * cos;
        if corner_y < -2.0 && outside_since.is_none() {
            outside_since = Some(state.stamp);
        }
        noted.extend(state.infractions.iter().map(|i| i.stamp));
    }
    assert!(outside_since.is_some_and(|t| t > Time::from_ms(500)));
    assert_eq!(noted, [outside_since.unwrap()]);
}

#[test]
fn standstill_and_timeout_end_a_run() {
    let mut scenario = scenario(&street(""));
    scenario.ego.start_speed_mps = Some(0.0);
    scenario.end.timeout_s = 3.0;
    let stand = |_: &WorldState| Command::FULL_BRAKE;
    let mut sim = exact(&scenario, 200);
    drive(&mut sim, stand, |_| {});
    assert_eq!((sim.state().ended, sim.state().stamp), (Some(EndReason::Timeout), Time::from_ms(3000)));
    scenario.end.standstill = Some(Standstill { near: None, within_m: 1e5, for_s: 2.0 });
    let mut sim = exact(&scenario, 200);
    drive(&mut sim, stand, |_| {});
    assert_eq!(sim.state().ended, Some(EndReason::Stopped));
    assert!((sim.state().stamp.as_secs() - 2.0).abs() < 0.2, "{}", sim.state().stamp);
}

#[test]
fn invalid_simulations_are_refused() {
    let try_with = |change: &dyn Fn(&mut Scenario, &mut SimParams)| {
        let (mut scenario, mut params) = (scenario(&street(PARKED)), SimParams::default());
        change(&mut scenario, &mut params);
        Simulator::new(&scenario, &params, 1).map(|_| ()).unwrap_err()
    };
    assert_eq!(try_with(&|_, params| params.dt = Span::ZERO), SimError::Step(Span::ZERO));
    assert_eq!(try_with(&|_, params| params.dt = Span::from_ms(50)), SimError::Step(Span::from_ms(50)));
    assert_eq!(try_with(&|s, _| s.ego.s_m = 58.0), SimError::EgoInside("parked".to_owned()));
    assert!(matches!(try_with(&|s, _| s.ego.d_m = -2.0), SimError::OffRoad(by) if (by - 0.93).abs() < 1e-9));
    assert!(matches!(try_with(&|_, p| p.vehicle.shape.width_m = 4.2), SimError::OffRoad(_)));
}

#[test]
fn seed_is_drawn_once_and_reported() {
    let scenario = scenario(PERSON_BEHIND_TRUCK);
    let sim = Simulator::new(&scenario, &SimParams::default(), 4).unwrap();
    assert_eq!(*sim.scenario(), scenario.drawn(4));
    let start = sim.state().ego.state;
    let draws = sim.scenario().draws.clone().unwrap();
    let center = sim.params().vehicle.shape.center(start.pose).x_m;
    assert!((center - draws.ego_start_m).abs() < 1e-5 && draws.ego_start_m != 0.0, "{center}");
    assert!((start.speed_mps - 20.0 - draws.ego_speed_mps).abs() < 1e-5);
}

#[test]
fn nan_command_changes_nothing() {
    let mut sim = exact(&scenario(&street("")), 200);
    for _ in 0..200 {
        sim.step(Command { steering_rad: f64::NAN, throttle: f64::INFINITY, brake: f64::NAN });
    }
    let pose = sim.state().ego.state.pose;
    assert!(pose.is_finite() && pose.y_m.abs() < 0.01, "{pose:?}");
}

#[test]
fn runs_are_bit_identical_and_the_rate_does_not_change_the_outcome() {
    let run = |hz: i64| {
        let mut sim = exact(&scenario(&street(PARKED)), hz);
        let (mut digests, mut hits) = (Vec::new(), Vec::new());
        while sim.state().ended.is_none() {
            let command = if hits.is_empty() { keep(sim.state(), 15.0) } else { Command::FULL_BRAKE };
            let state = sim.step(command);
            digests.push(digest_of(state));
            hits.extend(state.collisions.iter().cloned());
        }
        (digests, hits, sim.state().clone())
    };
    let (a, hits, end) = run(200);
    assert_eq!(a, run(200).0);
    let (_, fine_hits, fine) = run(1000);
    assert_eq!((hits.len(), fine_hits.len()), (1, 1));
    assert!((hits[0].stamp - fine_hits[0].stamp).as_secs().abs() <= 0.01, "{hits:?} {fine_hits:?}");
    assert!((hits[0].closing_speed_mps - fine_hits[0].closing_speed_mps).abs() < 0.1);
    assert_eq!(end.ended, fine.ended);
    let moved = end.actors[0].pose.point().distance(fine.actors[0].pose.point());
    println!("after the crash the cars differ by {moved:.2} m between 200 Hz and 1 kHz");
    assert!(moved < 1.0, "{moved}");
}
