//! Starts from a known state, and standstill without an inertial unit.

use super::faults::{corrected, drive_on};
use super::*;

/// Reflections of 25 m from the first fix on: a filter initialised by them follows them, one with a known position
/// refuses them.
#[test]
fn known_start_refuses_reflections_of_the_first_fixes() {
    for seed in 0..10 {
        let mut drive = corrected(seed);
        let start = Initial::level(&drive.params, [0.0, 0.0, Drive::turn(0.0)[0]], 8.0, [0.3, 0.005]);
        let known = Localizer::starting_at(drive.params, Time::ZERO, &start).unwrap();
        let reflected = |_: f64, what: &mut Sensed| {
            if let Sensed::Fix { at_m, .. } = what {
                at_m[1] += 25.0;
            }
            true
        };
        let (seen, _) = drive_on(&mut drive, known, 4, reflected);
        // 32 m driven with 0.2 % of wheel scale and 0.5 degrees of heading: 0.3 m.
        assert!(seen.largest_m < 0.5, "{seed}: {} m", seen.largest_m);
        let by_fix = drive.localizer();
        let (seen, _) = drive_on(&mut drive, by_fix, 4, reflected);
        assert!(seen.largest_m > 20.0, "{seed}: {} m", seen.largest_m);
    }
}

/// A unit that froze in a bend repeats its turn rate of 0.2 rad/s. The car then stops for 10 s: its heading must not
/// change.
#[test]
fn unit_that_froze_in_a_bend_does_not_turn_a_standing_car() {
    let params = Params { offset_m: 0.0, ..Params::default() };
    let start = Initial::level(&params, [0.0; 3], 2.0, [0.02, 0.005]);
    let mut localizer = Localizer::starting_at(params, Time::ZERO, &start).unwrap();
    let mut rng = Rng::keyed(1, "frozen", &[]);
    let (mut reading, mut stopped_rad) = ([0.0; 2], 0.0);
    for k in 1..=1200 {
        let (stamp, t_s) = (Time::from_ms(10 * k), k as f64 * 0.01);
        if t_s <= 0.5 {
            reading = [9.81 + 0.05 * rng.normal(), 0.2 + 0.005 * rng.normal()];
        }
        let [up, turn] = reading;
        let (accel_mps2, gyro_radps) = ([0.01 * up, 0.4, up], [0.001 * up, 0.0, turn]);
        localizer.take(stamp, Sensed::Imu { accel_mps2, gyro_radps });
        if k % 2 == 0 {
            let speed_mps = (2.0 - 4.0 * (t_s - 0.5).max(0.0)).max(0.0);
            localizer.take(stamp, Sensed::Wheels { speed_mps, curvature_1pm: Some(0.1) });
        }
        if k == 200 {
            stopped_rad = localizer.estimate().unwrap().heading_rad;
            assert_eq!(localizer.unit_health(), UnitHealth::Frozen);
        }
    }
    assert_eq!(localizer.unit_health(), UnitHealth::Frozen, "it still repeats itself");
    let turned_rad = localizer.estimate().unwrap().heading_rad - stopped_rad;
    assert!(turned_rad.abs() < 0.01, "{turned_rad} rad");
}
