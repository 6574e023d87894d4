//! Traffic among road users that it does not drive.

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Pose2, Transform, Vector, Vector2};
use swerve_msg::truth::{Actor, EgoTruth, WorldState};
use swerve_msg::{ActorId, ActorKind, EgoState};
use swerve_world::{Driver, View};

use super::run::{put, scenario_map, ways};
use crate::scene::Other;
use crate::{Lights, Traffic, TrafficSetup};

fn traffic(vehicles: usize) -> Traffic {
    let setup = TrafficSetup { vehicles, ..TrafficSetup::default() };
    let lights = Lights::new(|_, _| swerve_map::Aspect::Off);
    Traffic::new(scenario_map("crossing_right_first.xodr"), &setup, lights, 1, &[])
}

fn other(pose: Pose2, speed_mps: f64) -> Other {
    let velocity_mps = pose.direction() * speed_mps;
    Other { body: Obb::new(pose, 4.5, 1.8), velocity_mps, kind: ActorKind::Car, is_ego: true }
}

#[test]
fn cars_stop_behind_an_ego_at_rest() {
    let mut traffic = traffic(1);
    let way = ways(&traffic, 0.0).remove(0);
    put(&mut traffic, 0, &way, 5.0, 10.0);
    let lane = traffic.net.lane(traffic.cars[0].lane()).clone();
    let ego = other(lane.line.at(45.0).pose, 0.0);
    traffic.advance(Time::ZERO + Span::from_secs(20.0), &[ego]);
    let car = &traffic.cars[0];
    let gap_m = 45.0 - 2.25 - car.s_m() - car.half_m();
    assert!(car.speed_mps < 0.1 && (1.5..3.0).contains(&gap_m), "{gap_m} m at {} m/s", car.speed_mps);
}

/// Largest deceleration of a car at 30 m/s in front of which an ego moves in at 10 m/s, and whether they touch.
fn cut_off(gap_m: f64) -> (f64, bool) {
    let setup = TrafficSetup { vehicles: 1, ..TrafficSetup::default() };
    let lights = Lights::new(|_, _| swerve_map::Aspect::Off);
    let mut traffic = Traffic::new(scenario_map("ramp.xodr"), &setup, lights, 1, &[]);
    let motorway = traffic.net.lanes.iter().position(|lane| lane.length_m > 240.0 && lane.limit_mps > 30.0);
    let lane = traffic.net.lane(motorway.unwrap()).clone();
    put(&mut traffic, 0, &[lane.id], 60.0, 30.0);
    let (mut brakes_mps2, mut touches) = (0.0_f64, false);
    for k in 1..50 {
        let now = Time::ZERO + Span::from_ms(100) * k;
        let s_m = 60.0 + traffic.cars[0].half_m() + gap_m + 2.25 + 10.0 * now.as_secs();
        let ego = other(lane.line.at(s_m).pose, 10.0);
        let before_mps = traffic.cars[0].speed_mps;
        traffic.advance(now, &[ego]);
        let car = &traffic.cars[0];
        brakes_mps2 = brakes_mps2.max((before_mps - car.speed_mps) / 0.1);
        touches |= ego.body.overlaps(&car.extent.footprint(car.movement(&traffic.net, 0.0).0));
    }
    (brakes_mps2, touches)
}

#[test]
fn car_that_is_cut_off_brakes_as_hard_as_cars_can_and_hits_the_other_if_that_is_not_enough() {
    // 20 m/s of difference take 22 m at 9 m/s², and 2 to 3 m for the first decision.
    assert!(cut_off(10.0).1);
    assert!(!cut_off(30.0).1);
    for gap_m in [2.0, 10.0, 20.0, 30.0, 60.0] {
        let (brakes_mps2, _) = cut_off(gap_m);
        assert!(brakes_mps2 < 9.001, "{gap_m} m: {brakes_mps2} m/s²");
        assert!(gap_m > 20.0 || brakes_mps2 > 8.9, "{gap_m} m: {brakes_mps2} m/s²");
    }
}

#[test]
fn car_behind_a_slow_ego_begins_at_a_speed_from_which_it_follows() {
    let map = scenario_map("ramp.xodr");
    let setup = TrafficSetup { vehicles: 20, ..TrafficSetup::default() };
    let lane = map.lanes().iter().find(|lane| lane.line.length() > 240.0).unwrap().clone();
    let ego = other(lane.line.at(200.0).pose, 5.0);
    for seed in 0..5 {
        let lights = Lights::new(|_, _| swerve_map::Aspect::Off);
        let mut traffic = Traffic::among(map.clone(), &setup, lights, seed, &[(ego.body, ego.velocity_mps)]);
        for k in 1..200 {
            let now = Time::ZERO + Span::from_ms(100) * k;
            let mut ego = ego;
            let ahead = ego.body.center.direction() * (5.0 * now.as_secs());
            (ego.body.center.x_m, ego.body.center.y_m) =
                (ego.body.center.x_m + ahead.x, ego.body.center.y_m + ahead.y);
            traffic.advance(now, &[ego]);
            assert!(traffic.cars.iter().all(|car| car.gain_mps2 > -6.0), "seed {seed}, {now:?}");
        }
    }
}

/// True if a car touches an ego that drives through the junction from its right, `to_m` before it at the start.
fn touches(to_m: f64, is_seen: bool) -> bool {
    let mut traffic = traffic(1);
    let ways = ways(&traffic, 0.0);
    let lane = |id| traffic.net.lanes.iter().find(|lane| lane.id == id).unwrap().clone();
    let [own, ego, inside] = [ways[0][0], ways[1][0], ways[1][1]].map(lane);
    put(&mut traffic, 0, &ways[0], own.length_m - 25.0, 5.0);
    let mut touches = false;
    for k in 1..120 {
        let now = Time::ZERO + Span::from_ms(100) * k;
        let along_m = 7.0 * now.as_secs() - to_m;
        let pose = if along_m < 0.0 {
            ego.line.at(ego.length_m + along_m).pose
        } else {
            inside.line.at(along_m).pose
        };
        let other = other(pose, 7.0);
        let others = if is_seen { vec![other] } else { Vec::new() };
        traffic.advance(now, &others);
        let car = &traffic.cars[0];
        let body = car.extent.footprint(car.movement(&traffic.net, 0.0).0);
        touches |= other.body.overlaps(&body);
    }
    touches
}

#[test]
fn cars_give_way_to_an_ego_that_comes_towards_the_junction() {
    let starts = || (10..40).map(|k| 2.0 * f64::from(k));
    let unseen: Vec<f64> = starts().filter(|to_m| touches(*to_m, false)).collect();
    let seen: Vec<f64> = starts().filter(|to_m| touches(*to_m, true)).collect();
    assert!(unseen.len() >= 3 && seen.is_empty(), "unseen from {unseen:?} m, seen from {seen:?} m");
}

/// State with an ego far away and the actors where the traffic has them, one of them moved aside.
fn state(traffic: &Traffic, now: Time, aside: Option<ActorId>) -> WorldState {
    let pose = Pose2::new(1e4, 1e4, 0.0);
    let ego = EgoTruth {
        id: ActorId::EGO,
        map_from_ego: Transform::new(swerve_geom::Point::new(1e4, 1e4, 0.0), Default::default()),
        state: EgoState { stamp: now, pose, ..EgoState::default() },
        velocity_mps: Vector::new(0.0, 0.0, 0.0),
        specific_force_mps2: Vector::new(0.0, 0.0, 0.0),
        angular_velocity_radps: Vector::new(0.0, 0.0, 0.0),
    };
    let actors = traffic.actors().iter().map(|actor| {
        let movement = traffic.movement(actor.id, now);
        let mut pose = movement.map_or(Pose2::new(0.0, 0.0, 0.0), |movement| movement.pose);
        pose.x_m += if aside == Some(actor.id) { 0.5 } else { 0.0 };
        let velocity_mps = movement.map_or(Vector2::default(), |movement| movement.velocity_mps);
        Actor { id: actor.id, kind: actor.kind, pose, z_m: 0.0, extent: actor.extent, velocity_mps }
    });
    WorldState {
        stamp: now,
        ego,
        actors: actors.collect(),
        collisions: Vec::new(),
        infractions: Vec::new(),
        ended: None,
    }
}

#[test]
fn drivers_share_the_traffic_and_give_up_an_actor_that_was_hit() {
    let (shared, mut drivers) = traffic(3).drivers();
    let map = scenario_map("crossing_right_first.xodr");
    let mut alone = traffic(3);
    for k in 0..400 {
        let (now, step) = (Time::ZERO + Span::from_ms(5) * k, Span::from_ms(5));
        let world = state(&shared.lock().unwrap(), now, (k == 300).then_some(ActorId(2)));
        let ego = Obb::new(world.ego.state.pose, 4.5, 1.8);
        // In any order.
        for (own, driver) in drivers.iter_mut().rev() {
            driver.observe(&View { own: *own, world: &world, ego, map: &map });
        }
        alone.advance_alone(now);
        for (id, driver) in &drivers {
            let movement = driver.movement(now, now + step);
            if k < 300 {
                assert_eq!(movement, alone.movement(*id, now + step), "{id:?} at {now:?}");
            } else {
                assert_eq!(movement.is_some(), *id != ActorId(2), "{id:?} at {now:?}");
            }
        }
    }
}
