//! Draws are keyed by seed and actor.

use swerve_geom::{Obb, Pose2};

use super::run::{drive, lights, scenario_map};
use crate::{Traffic, TrafficSetup};

fn traffic(vehicles: usize, pedestrians: usize, cyclists: usize, reserved: &[Obb]) -> Traffic {
    let setup = TrafficSetup { vehicles, pedestrians, cyclists, ..TrafficSetup::default() };
    let map = scenario_map("roundabout.xodr");
    let lights = lights(&map);
    Traffic::new(map, &setup, lights, 7, reserved)
}

#[test]
fn one_actor_more_changes_no_draw_of_the_others() {
    let ways = |traffic: &Traffic| -> Vec<_> {
        let cars = traffic.cars.iter();
        cars.map(|car| (car.cycles, car.key, car.extent, car.idm, car.share, car.way.clone(), car.x_m))
            .collect()
    };
    let few = traffic(8, 5, 2, &[]);
    let cars: Vec<_> = ways(&few).into_iter().filter(|car| !car.0).collect();
    for more in [traffic(9, 5, 2, &[]), traffic(8, 6, 2, &[]), traffic(8, 5, 3, &[])] {
        let more_cars: Vec<_> = ways(&more).into_iter().filter(|car| !car.0).take(8).collect();
        assert_eq!(more_cars, cars);
        let people = |traffic: &Traffic| traffic.walkers.draws();
        assert_eq!(people(&more)[..5], people(&few)[..5]);
    }
}

#[test]
fn drives_with_equal_seeds_are_equal_to_the_bit() {
    let run = || {
        let mut traffic = traffic(15, 10, 3, &[]);
        let sums = drive(&mut traffic, 60.0, |_| Vec::new());
        let actors = traffic.actors().iter();
        let movements: Vec<_> = actors.map(|actor| traffic.movement(actor.id, traffic.tick)).collect();
        (sums, movements)
    };
    assert_eq!(run(), run());
}

#[test]
fn nobody_begins_near_reserved_ground() {
    let map = scenario_map("roundabout.xodr");
    let lane = map.lanes().iter().find(|lane| lane.line.length() > 40.0).unwrap();
    let reserved = Obb::new(lane.line.at(20.0).pose, 4.5, 1.8);
    let with = traffic(25, 20, 5, &[reserved]);
    let without = traffic(25, 20, 5, &[]);
    let gap_m = |traffic: &Traffic| {
        let boxes = traffic.actors().iter().map(|actor| {
            let pose: Pose2 = traffic.movement(actor.id, traffic.tick).unwrap().pose;
            reserved.distance(&actor.extent.footprint(pose))
        });
        boxes.fold(f64::INFINITY, f64::min)
    };
    assert!(gap_m(&with) >= 20.0 && gap_m(&without) < 20.0, "{} {}", gap_m(&with), gap_m(&without));
}

#[test]
fn movement_between_ticks_is_smooth() {
    let mut traffic = traffic(10, 5, 2, &[]);
    let step = swerve_core::Span::from_ms(5);
    let mut now = traffic.tick;
    let place = |traffic: &Traffic, now| -> Vec<_> {
        let movements = traffic.actors().iter().filter_map(|actor| traffic.movement(actor.id, now));
        movements.map(|movement| (movement.pose.point(), movement.velocity_mps.norm())).collect()
    };
    let entries = |traffic: &Traffic, id| traffic.cars.iter().find(|car| car.id == id).map(|car| car.entries);
    let mut before = place(&traffic, now);
    for _ in 0..4000 {
        now += step;
        let ids: Vec<_> = traffic.actors().iter().map(|actor| actor.id).collect();
        let entered: Vec<_> = ids.iter().map(|id| entries(&traffic, *id)).collect();
        traffic.advance_alone(now);
        let next = place(&traffic, now);
        for (k, ((from, from_mps), (to, to_mps))) in before.iter().zip(&next).enumerate() {
            // One that leaves enters elsewhere: the only jump. Where lanes join at an angle of 1 degree, a cyclist beside
            // the middle moves by 2 cm.
            let along_m = from.distance(*to);
            let due_m = 0.5 * (from_mps + to_mps) * step.as_secs();
            assert!(
                (along_m - due_m).abs() < 0.02 || entries(&traffic, ids[k]) != entered[k],
                "{along_m} m, {due_m} m"
            );
        }
        before = next;
    }
}
