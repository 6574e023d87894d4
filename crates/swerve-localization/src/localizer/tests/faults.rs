//! Sensor faults, each with its signature, on drives with known truth.

use super::*;

/// Start of each fault, seconds; the filter has converged by then.
const FROM_S: f64 = 20.0;

/// Observations of a drive.
#[derive(Default)]
pub(super) struct Seen {
    /// Longest time in mode `Good` with a position error of more than five standard deviations, seconds.
    deceived_s: f64,
    /// Largest position error after initialisation, metres.
    pub(super) largest_m: f64,
    /// Errors of position and heading at the end, metres and radians.
    end: [f64; 2],
    /// Modes and unit conditions at each reading, with the instant in seconds.
    modes: Vec<(f64, Mode)>,
    health: Vec<(f64, UnitHealth)>,
}

impl Seen {
    fn modes_in(&self, from_s: f64, until_s: f64) -> impl Iterator<Item = Mode> {
        self.modes.iter().filter(move |(t_s, _)| (from_s..until_s).contains(t_s)).map(|(_, mode)| *mode)
    }

    fn was(&self, health: UnitHealth) -> bool {
        self.health.iter().any(|(_, seen)| *seen == health)
    }
}

/// A car with steering angle, wheels and corrected fixes, and typical noise.
pub(super) fn corrected(seed: u64) -> Drive {
    let params = Params { offset_m: 0.0, gyro_noise: [5e-4; 3], accel_noise: [0.02; 3], ..Params::default() };
    Drive { fix_sigma_m: 0.02, steers: true, speed_mps: 8.0, ..Drive::new(seed, params) }
}

/// Runs a drive with a localizer; `fault` may modify a measurement, or drop it by returning false.
pub(super) fn drive_on(
    drive: &mut Drive,
    mut localizer: Localizer,
    seconds: usize,
    mut fault: impl FnMut(f64, &mut Sensed) -> bool,
) -> (Seen, Localizer) {
    let (measured, way) = (drive.measured(seconds), drive.way(seconds));
    let (mut seen, mut since) = (Seen::default(), None);
    for (stamp, mut what) in measured {
        let t_s = stamp.ns() as f64 * 1e-9;
        if fault(t_s, &mut what) {
            localizer.take(stamp, what);
        }
        let Some(estimate) = localizer.estimate_at(stamp) else { continue };
        let [x, y] = error_m(&estimate, way[(stamp.ns() / 10_000_000) as usize]);
        let c = estimate.covariance.fixed_view::<2, 2>(0, 0).try_inverse().unwrap();
        let square = x * x * c[(0, 0)] + 2.0 * x * y * c[(0, 1)] + y * y * c[(1, 1)];
        let is_deceived = estimate.mode == Mode::Good && square > 25.0;
        let since_s = *since.get_or_insert(t_s);
        match is_deceived {
            true => seen.deceived_s = seen.deceived_s.max(t_s - since_s),
            false => since = None,
        }
        let turned = estimate.heading_rad - Drive::turn(t_s)[0];
        seen.end = [math::hypot(x, y), swerve_geom::wrap_angle(turned).abs()];
        seen.largest_m = seen.largest_m.max(seen.end[0]);
        seen.modes.push((t_s, estimate.mode));
        seen.health.push((t_s, localizer.unit_health()));
    }
    (seen, localizer)
}

/// Runs a drive that is initialised correctly.
fn driven(seed: u64, seconds: usize, fault: impl FnMut(f64, &mut Sensed) -> bool) -> Seen {
    let mut drive = corrected(seed);
    let localizer = drive.localizer();
    drive_on(&mut drive, localizer, seconds, fault).0
}

/// Asserts that the pose is correct at the end, and was never in mode `Good` and wrong for more than a second.
fn assert_mended(seen: &Seen, name: &str) {
    assert!(seen.deceived_s <= 1.0, "{name}: good and wrong for {} s", seen.deceived_s);
    assert!(seen.end[0] < 0.1 && seen.end[1] < 0.02, "{name}: {:?} off at the end", seen.end);
    assert_eq!(seen.modes.last().map(|(_, mode)| *mode), Some(Mode::Good), "{name}");
}

/// Without a fault, none is detected.
#[test]
fn sound_units_are_reported_as_sound() {
    for seed in 0..20 {
        let seen = driven(seed, 40, |_, _| true);
        assert!(seen.health.iter().skip(1).all(|(_, health)| *health == UnitHealth::Sound), "{seed}");
        assert!(seen.modes.iter().skip(1).all(|(_, mode)| *mode == Mode::Good), "{seed}");
        assert_mended(&seen, "sound");
    }
}

/// Frozen, noisy or silent for three seconds in a bend: wheels, steering angle and fixes maintain the pose. 0.2 m are
/// ten standard deviations of a fix.
#[test]
fn failing_units_are_identified_by_their_signature_and_bridged() {
    for seed in 0..10 {
        for (name, health) in
            [("frozen", UnitHealth::Frozen), ("noisy", UnitHealth::Noisy), ("silent", UnitHealth::Silent)]
        {
            let mut rng = Rng::keyed(seed, "fault", &[]);
            let mut kept = None;
            let seen = driven(seed, 26, |t_s, what| {
                let Sensed::Imu { accel_mps2, gyro_radps } = what else { return true };
                if !(FROM_S..FROM_S + 3.0).contains(&t_s) {
                    return true;
                }
                match name {
                    "frozen" => *what = *kept.get_or_insert(*what),
                    "noisy" => {
                        *accel_mps2 = accel_mps2.map(|x| x + 20.0 * rng.normal());
                        *gyro_radps = gyro_radps.map(|x| x + 0.35 * rng.normal());
                    }
                    _ => return false,
                }
                true
            });
            assert!(seen.was(health), "{name}, seed {seed}");
            assert!(seen.modes_in(FROM_S + 0.3, FROM_S + 3.0).all(|mode| mode == Mode::Coasting), "{name}");
            assert!(seen.largest_m < 0.2, "{name}: {} m", seen.largest_m);
            assert_mended(&seen, name);
        }
    }
}

/// The same without a steering angle: the heading is unobservable, so the pose is lost within a second, and recovers.
#[test]
fn pose_without_steering_is_lost_during_a_unit_failure_and_recovers() {
    for seed in 0..10 {
        let mut drive = Drive { steers: false, ..corrected(seed) };
        let localizer = drive.localizer();
        let is_read = |t_s: f64, what: &Sensed| {
            !(FROM_S..FROM_S + 3.0).contains(&t_s) || !matches!(what, Sensed::Imu { .. })
        };
        let (seen, _) = drive_on(&mut drive, localizer, 26, |t_s, what| is_read(t_s, what));
        assert!(seen.modes_in(FROM_S + 0.3, FROM_S + 3.0).all(|mode| mode == Mode::Lost), "{seed}");
        assert_mended(&seen, "silent without steering");
    }
}

/// A gyroscope with a bias of 0.3 rad/s has no signature in its readings: the filter diverges, while the fixes
/// continue without a jump and agree with wheels and steering angle.
#[test]
fn biased_unit_is_detected_by_fixes() {
    for seed in 0..10 {
        let seen = driven(seed, 32, |t_s, what| {
            if let Sensed::Imu { gyro_radps, .. } = what
                && (FROM_S..FROM_S + 4.0).contains(&t_s)
            {
                gyro_radps[2] += 0.3;
            }
            true
        });
        assert!(seen.largest_m < 1.0, "{} m", seen.largest_m);
        assert_mended(&seen, "biased");
    }
}

/// A heading that is 56 degrees off with a standard deviation of one: correct fixes are refused, and then realign the
/// filter by the path that they form.
#[test]
fn refused_fixes_correct_a_filter_with_a_wrong_heading() {
    for seed in 0..10 {
        let mut drive = corrected(seed);
        let yaw = Drive::turn(0.0)[0] + 56.0_f64.to_radians();
        let attitude = crate::eskf::from_euler(0.0, 0.0, yaw);
        let initial = Initial {
            position_m: Vector3::new(LEVER_M * math::cos(0.0), 0.0, 0.0),
            velocity_mps: attitude * Vector3::new(drive.speed_mps, 0.0, 0.0),
            attitude,
            sigma: [0.02, 0.1, 0.017],
        };
        let localizer = Localizer::starting_at(drive.params, Time::ZERO, &initial).unwrap();
        let (seen, _) = drive_on(&mut drive, localizer, 6, |_, _| true);
        assert!(seen.modes_in(1.0, 1.5).next().is_some());
        assert_mended(&seen, "heading");
    }
}

/// Fixes that all shift by 25 m and stay there are refused at first; the mode is not `Good` within a second, and the
/// new position is accepted after ten.
#[test]
fn lasting_step_of_fixes_is_doubted_then_accepted() {
    for seed in 0..10 {
        let (step_m, mut localizer) = (25.0, None);
        let mut drive = corrected(seed);
        let started = drive.localizer();
        let (seen, _) = drive_on(&mut drive, started, 34, |t_s, what| {
            if let Sensed::Fix { at_m, .. } = what
                && t_s >= FROM_S
            {
                at_m[1] += step_m;
                localizer.get_or_insert(t_s);
            }
            true
        });
        assert!(seen.modes_in(FROM_S + 1.0, FROM_S + 9.9).all(|mode| mode == Mode::Coasting), "{seed}");
        assert!((seen.end[0] - step_m).abs() < 0.2, "{seed}: {:?}", seen.end);
    }
}

/// The fixes of the first five seconds are reflections, which cannot be detected before correct ones arrive. Then the
/// mode is not `Good` for longer than another second, and the pose is correct after ten.
#[test]
fn start_from_reflected_fixes_is_corrected() {
    for seed in 0..10 {
        let seen = driven(seed, 20, |t_s, what| {
            if let Sensed::Fix { at_m, .. } = what
                && t_s < 5.0
            {
                at_m[0] += 25.0;
            }
            true
        });
        assert!(seen.modes_in(6.0, 14.5).all(|mode| mode != Mode::Good), "{seed}");
        assert!(seen.end[0] < 0.1 && seen.modes.last().unwrap().1 == Mode::Good, "{seed}: {:?}", seen.end);
    }
}

/// Reflections of various sizes while the filter is correct: it keeps its position.
#[test]
fn steps_of_any_size_do_not_move_the_filter() {
    for (seed, step_m) in [1.0, 2.0, 5.0, 15.0, 60.0].into_iter().cycle().enumerate().take(20) {
        let seen = driven(seed as u64, 32, |t_s, what| {
            if let Sensed::Fix { at_m, .. } = what
                && (FROM_S..FROM_S + 8.0).contains(&t_s)
            {
                at_m[1] += step_m;
            }
            true
        });
        assert!(seen.largest_m < 0.5, "step of {step_m} m: {} m", seen.largest_m);
        assert_mended(&seen, "step");
    }
}

/// Reflections of five seconds that begin while the inertial unit is noisy: the last turn rate of the unit must not
/// be used to align the fixes, and the filter keeps its position by wheels and steering angle.
#[test]
fn reflections_while_the_unit_is_noisy_do_not_move_the_filter() {
    for seed in 0..20 {
        let mut drive = Drive { fix_sigma_m: 0.3, ..corrected(seed) };
        let localizer = drive.localizer();
        let mut rng = Rng::keyed(seed, "fault", &[]);
        let (seen, _) = drive_on(&mut drive, localizer, 27, |t_s, what| {
            match what {
                Sensed::Imu { accel_mps2, gyro_radps } if (FROM_S..FROM_S + 2.0).contains(&t_s) => {
                    *accel_mps2 = accel_mps2.map(|x| x + 20.0 * rng.normal());
                    *gyro_radps = gyro_radps.map(|x| x + 0.35 * rng.normal());
                }
                Sensed::Fix { at_m, .. } if (FROM_S + 1.0..FROM_S + 6.0).contains(&t_s) => at_m[1] += 25.0,
                _ => {}
            }
            true
        });
        assert!(seen.largest_m < 1.5, "{seed}: {} m", seen.largest_m);
        assert!(seen.deceived_s <= 1.0, "{seed}: good and wrong for {} s", seen.deceived_s);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Any fault of one sensor, at any time and of any duration: never in mode `Good` for longer than a second with a
    /// position error of more than five standard deviations. Steps of fixes within their noise are undetectable, and
    /// the time to detect a biased gyroscope depends on the accuracy of fixes: it is tested with corrected ones.
    #[test]
    fn filter_is_never_good_and_wrong_for_long(
        seed in 0_u64..1000,
        kind in 0_u8..5,
        (from_s, lasts_s) in (6.0_f64..12.0, 0.3_f64..4.0),
        usual in any::<bool>(),
        size in 0.2_f64..1.0,
    ) {
        let mut drive = Drive { fix_sigma_m: if usual && kind != 3 { 0.3 } else { 0.02 }, ..corrected(seed) };
        let localizer = drive.localizer();
        let (mut rng, mut kept) = (Rng::keyed(seed, "fault", &[]), None);
        let (seen, _) = drive_on(&mut drive, localizer, 20, |t_s, what| {
            if !(from_s..from_s + lasts_s).contains(&t_s) {
                return true;
            }
            match (kind, what) {
                (0, what @ Sensed::Imu { .. }) => *what = *kept.get_or_insert(*what),
                (1, Sensed::Imu { .. }) => return false,
                (2, Sensed::Imu { accel_mps2, gyro_radps }) => {
                    *accel_mps2 = accel_mps2.map(|x| x + 30.0 * size * rng.normal());
                    *gyro_radps = gyro_radps.map(|x| x + size * rng.normal());
                }
                (3, Sensed::Imu { gyro_radps, .. }) => gyro_radps[2] += size,
                (4, Sensed::Fix { at_m, .. }) => at_m[0] += 40.0 * size,
                _ => {}
            }
            true
        });
        prop_assert!(seen.deceived_s <= 1.0, "kind {}: good and wrong for {} s", kind, seen.deceived_s);
    }
}
