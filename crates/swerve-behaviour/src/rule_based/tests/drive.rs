//! Drives of the ego by its decisions alone, among cars that keep their speed.

use swerve_geom::Obb;

use super::posed::Posed;
use super::*;

/// Distance of the ego's front before a place to stop at which it comes to rest, metres.
const BEFORE_M: f64 = 0.5;

/// A car on a way.
struct Car {
    way: Posed,
    s_m: f64,
    speed_mps: f64,
}

impl Car {
    fn new(file: &str, [from, to]: [i32; 2], ahead_m: f64, speed_mps: f64) -> Self {
        let way = Posed::on(file).route(on_arm(from, -140.0), on_arm(to, 140.0));
        let s_m = way.route.project(on_arm(from, -11.0).point()).s_m + ahead_m;
        Self { way, s_m, speed_mps }
    }

    fn pose(&self) -> Pose2 {
        self.way.route.line().at(self.s_m).pose
    }
}

/// Result of a drive.
#[derive(Debug)]
struct Outcome {
    /// Number of changes between stopping and going.
    changes: usize,
    /// Least distance from another car, metres, and largest deceleration, m/s².
    closest_m: f64,
    brake_mps2: f64,
    took_s: f64,
}

fn drive(file: &str, way: [i32; 2], before_m: f64, mut cars: Vec<Car>) -> Outcome {
    let mut posed = Posed::on(file).route(on_arm(way[0], -140.0), on_arm(way[1], 120.0));
    posed = posed.ego(on_arm(way[0], -11.0), before_m, 9.0);
    for car in &cars {
        posed = posed.car(car.pose(), car.speed_mps);
    }
    let end_m = posed.front_m + before_m + 60.0;
    let mut outcome = Outcome { changes: 0, closest_m: f64::INFINITY, brake_mps2: 0.0, took_s: 0.0 };
    let mut stopped = false;
    while posed.front_m < end_m && outcome.took_s < 90.0 {
        let decision = posed.decide();
        let stop = decision.stops.first();
        outcome.changes += usize::from(stop.is_some() != stopped);
        stopped = stop.is_some();
        // Brakes as late as 2.5 m/s² suffices, and keeps to 5.5 m/s in bends.
        let bend_1pm = posed.route.line().at(posed.front_m).curvature_1pm.abs();
        let top_mps = if bend_1pm > 0.02 { 5.5 } else { 9.0 };
        let v = posed.speed_mps;
        let to_m = stop.map_or(f64::INFINITY, |stop| stop.s_m - BEFORE_M - posed.front_m).max(0.01);
        let needed_mps2 = v * v / (2.0 * to_m);
        let gain_mps2 = match needed_mps2 {
            needed if needed > 2.2 || (stop.is_some() && to_m < 0.3) => -needed.min(8.0),
            _ if v > top_mps => -2.0,
            _ if stop.is_some() && to_m < 5.0 => 0.0,
            _ => 1.5f64.min((top_mps - v) / 0.1),
        };
        posed.speed_mps = (v + 0.1 * gain_mps2).max(0.0);
        outcome.brake_mps2 = outcome.brake_mps2.max((v - posed.speed_mps) / 0.1);
        posed.front_m += 0.1 * posed.speed_mps;
        outcome.took_s += 0.1;
        let (shape, s_m) = (swerve_vehicle::Shape::default(), posed.front_m);
        let own =
            Obb::new(posed.route.line().at(s_m - 0.5 * shape.length_m).pose, shape.length_m, shape.width_m);
        for (k, car) in cars.iter_mut().enumerate() {
            car.s_m += 0.1 * car.speed_mps;
            posed.aim(k as u32 + 1, car.pose(), car.speed_mps);
            outcome.closest_m = outcome.closest_m.min(own.distance(&Obb::new(car.pose(), 4.5, 1.8)));
        }
    }
    outcome
}

#[test]
fn ego_lets_cars_from_the_right_pass_without_wavering() {
    for k in 0..24 {
        let file = "crossing_right_first.xodr";
        let car = Car::new(file, [FROM_SOUTH; 2], -120.0 + 5.0 * f64::from(k), 9.0);
        let outcome = drive(file, [FROM_WEST; 2], 70.0, vec![car]);
        let is_fine = outcome.changes <= 2 && outcome.closest_m > 1.0 && outcome.took_s < 30.0;
        assert!(is_fine && outcome.brake_mps2 < 3.5, "{k}: {outcome:?}");
    }
}

#[test]
fn left_turn_finds_a_gap_in_oncoming_traffic() {
    for k in 0..12 {
        let file = "crossing_right_first.xodr";
        let (shift_m, gap_m) = (4.0 * f64::from(k), 25.0 + 4.0 * f64::from(k));
        let car = |n: i32| Car::new(file, [FROM_EAST; 2], shift_m - 40.0 - gap_m * f64::from(n), 9.0);
        let outcome = drive(file, [FROM_WEST, FROM_SOUTH], 50.0, (0..3).map(car).collect());
        let is_fine = outcome.changes <= 4 && outcome.closest_m > 0.8 && outcome.took_s < 45.0;
        assert!(is_fine && outcome.brake_mps2 < 4.5, "{k}: {outcome:?}");
    }
}

#[test]
fn ego_on_the_priority_road_drives_through_and_from_the_side_road_it_waits() {
    let file = "crossing_priority.xodr";
    let stands = || Car { speed_mps: 0.0, ..Car::new(file, [FROM_SOUTH; 2], -4.0, 0.0) };
    let outcome = drive(file, [FROM_WEST; 2], 60.0, vec![stands()]);
    assert!(outcome.changes == 0 && outcome.brake_mps2 == 0.0, "{outcome:?}");
    let car = |n: i32| Car::new(file, [FROM_WEST; 2], -30.0 - 25.0 * f64::from(n), 9.0);
    let outcome = drive(file, [FROM_SOUTH; 2], 50.0, (0..4).map(car).collect());
    assert!(outcome.changes <= 2 && outcome.closest_m > 1.0 && outcome.took_s < 40.0, "{outcome:?}");
}
