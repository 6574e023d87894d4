use nalgebra::Vector3;
use proptest::prelude::*;
use swerve_core::Rng;
use swerve_geom::math;

use super::*;

/// A car on a winding path at constant speed, with its inertial unit 1.4 m ahead of the rear axle, read at 100 Hz,
/// and wheels and fixes at 10 Hz.
struct Drive {
    params: Params,
    rng: Rng,
    speed_mps: f64,
    fix_sigma_m: f64,
    offset_m: [f64; 2],
    accel_bias: [f64; 3],
    gyro_bias: [f64; 3],
    scale: f64,
    /// True if the steering angle is measured.
    steers: bool,
}

const LEVER_M: f64 = 1.4;
const TOOTH_M: f64 = 0.02;

impl Drive {
    fn new(seed: u64, params: Params) -> Self {
        let mut rng = Rng::keyed(seed, "drive", &[]);
        let mut draw = |sigma: f64| sigma * rng.normal();
        let offset_m = [draw(params.offset_m), draw(params.offset_m)];
        let accel_bias = [(); 3].map(|()| draw(params.accel_bias_mps2));
        let gyro_bias = [(); 3].map(|()| draw(params.gyro_bias_radps));
        let scale = draw(params.wheel_scale);
        let params = Params { imu_at_m: [LEVER_M, 0.0, 0.0], ..params };
        Self {
            params,
            rng,
            speed_mps: 14.0,
            fix_sigma_m: 0.5,
            offset_m,
            accel_bias,
            gyro_bias,
            scale,
            steers: false,
        }
    }

    /// Heading and its first and second derivative.
    fn turn(t_s: f64) -> [f64; 3] {
        let (amplitude, rate) = (0.4, 0.3);
        let (sin, cos) = math::sin_cos(rate * t_s);
        [amplitude * sin, amplitude * rate * cos, -amplitude * rate * rate * sin]
    }

    /// Positions of the rear axle every 10 ms.
    fn way(&self, seconds: usize) -> Vec<[f64; 2]> {
        let (mut at, dt) = ([0.0; 2], 1e-3);
        let mut way = vec![at];
        for k in 0..1000 * seconds {
            let (sin, cos) = math::sin_cos(Self::turn((k as f64 + 0.5) * dt)[0]);
            at = [at[0] + self.speed_mps * cos * dt, at[1] + self.speed_mps * sin * dt];
            if k % 10 == 9 {
                way.push(at);
            }
        }
        way
    }

    /// Sensor measurements over this time.
    fn measured(&mut self, seconds: usize) -> Vec<(Time, Sensed)> {
        let way = self.way(seconds);
        let (mut all, mut offset_m) = (Vec::new(), self.offset_m);
        for (k, at) in way.into_iter().enumerate() {
            let t_s = k as f64 * 0.01;
            let [_, rate, angular] = Self::turn(t_s);
            let force = [-LEVER_M * rate * rate, self.speed_mps * rate + LEVER_M * angular, 9.81];
            let mut read = |x: f64, bias: f64, density: f64| x + bias + 10.0 * density * self.rng.normal();
            let p = &self.params;
            let accel_mps2 = core::array::from_fn(|i| read(force[i], self.accel_bias[i], p.accel_noise[i]));
            let turn = [0.0, 0.0, rate];
            let gyro_radps = core::array::from_fn(|i| read(turn[i], self.gyro_bias[i], p.gyro_noise[i]));
            let stamp = Time::ZERO + Span::from_ms(10 * k as i64);
            all.push((stamp, Sensed::Imu { accel_mps2, gyro_radps }));
            if k % 10 == 0 {
                let noise = p.wheel_noise_mps * self.rng.normal();
                all.push((stamp, self.wheels(Self::turn(t_s)[1] / self.speed_mps, noise)));
                if p.offset_time_s > 0.0 && k > 0 {
                    let kept = math::exp(-0.1 / p.offset_time_s);
                    let drawn_m = p.offset_m * (1.0 - kept * kept).sqrt();
                    offset_m = offset_m.map(|offset| kept * offset + drawn_m * self.rng.normal());
                }
                let mut fix = |x: f64| x + self.fix_sigma_m * self.rng.normal();
                let at_m = [fix(at[0] + offset_m[0]), fix(at[1] + offset_m[1]), fix(0.0)];
                all.push((stamp, Sensed::Fix { at_m, sigma_m: [self.fix_sigma_m; 3] }));
            }
        }
        all
    }

    /// A wheel reading on a curve.
    fn wheels(&self, curvature_1pm: f64, noise_mps: f64) -> Sensed {
        let speed_mps = self.speed_mps * (1.0 + self.scale) + noise_mps;
        Sensed::Wheels { speed_mps, curvature_1pm: self.steers.then_some(curvature_1pm) }
    }

    fn localizer(&mut self) -> Localizer {
        let sigma = 0.05;
        Localizer::new(self.params, Some([Self::turn(0.0)[0] + sigma * self.rng.normal(), sigma])).unwrap()
    }
}

fn wheels(speed_mps: f64) -> Sensed {
    Sensed::Wheels { speed_mps, curvature_1pm: None }
}

fn is_fix(what: &Sensed) -> bool {
    matches!(what, Sensed::Fix { .. })
}

fn error_m(estimate: &Estimate, at: [f64; 2]) -> [f64; 2] {
    [estimate.position_m.x - at[0], estimate.position_m.y - at[1]]
}

/// Parameters without vehicle constraints, which the simulated car satisfies better than the filter may assume.
fn plain() -> Params {
    Params { non_holonomic_mps: 0.0, zero_velocity_mps: 0.0, gate_one_in: 0, ..Params::default() }
}

/// A speed correction by a fix must not be applied again by wheels that were compared with the earlier speed.
#[test]
fn start_at_a_wrong_speed_settles_without_refusals() {
    for seed in 0..100 {
        let mut rng = Rng::keyed(seed, "straight on", &[]);
        let params = Params { offset_m: 0.0, ..Params::default() };
        let mut localizer = Localizer::new(params, Some([0.0, 0.09])).unwrap();
        // Encoders count whole teeth.
        let (phase, mut before) = (rng.uniform(0.0, 1.0), None);
        for ms in (0..3000).step_by(5) {
            let stamp = Time::ZERO + Span::from_ms(ms);
            match ms % 100 {
                _ if ms % 10 == 0 => {
                    let (accel_mps2, gyro_radps) = ([0.0, 0.0, 9.81], [0.0; 3]);
                    localizer.take(stamp, Sensed::Imu { accel_mps2, gyro_radps });
                }
                95 => {
                    let mut fix = |x: f64| x + 0.02 * rng.normal();
                    let at_m = [fix(0.022 * ms as f64), fix(0.0), fix(0.0)];
                    localizer.take(stamp, Sensed::Fix { at_m, sigma_m: [0.02, 0.02, 0.04] });
                }
                _ if ms % 20 == 5 => {
                    let teeth = (0.022 * ms as f64 / TOOTH_M + phase).floor();
                    if let Some(before) = before.replace(teeth) {
                        localizer.take(stamp, wheels((teeth - before) * TOOTH_M / 0.02));
                    }
                }
                _ => {}
            }
        }
        let (estimate, fixes) = (localizer.estimate().unwrap(), localizer.tally(Source::Fix));
        let off_m = estimate.position_m.x - 0.022 * 2995.0;
        assert!(off_m.abs() < 0.1 && (estimate.velocity_mps.x - 22.0).abs() < 0.1, "{seed}: {estimate:?}");
        assert!(fixes.refused <= 1, "{seed}: {fixes:?}");
    }
}

/// Over 50 seeds, with fix offset, biases and wheel scale drawn as the filter assumes; the offset is constant or
/// drifts.
#[test]
fn filter_is_consistent_over_many_drives() {
    for offset_time_s in [0.0, 5.0] {
        let (mut nees, mut nis, mut square) = (0.0, [0.0; 2], 0.0);
        for seed in 0..50 {
            let mut drive = Drive::new(seed, Params { offset_time_s, ..plain() });
            let (measured, mut localizer) = (drive.measured(15), drive.localizer());
            for (stamp, what) in measured {
                localizer.take(stamp, what);
            }
            let estimate = localizer.estimate().unwrap();
            let [x, y] = error_m(&estimate, *drive.way(15).last().unwrap());
            let c = estimate.covariance.fixed_view::<2, 2>(0, 0).try_inverse().unwrap();
            nees += (x * x * c[(0, 0)] + 2.0 * x * y * c[(0, 1)] + y * y * c[(1, 1)]) / 50.0;
            square += (x * x + y * y) / 50.0;
            for (sum, source) in nis.iter_mut().zip([Source::Fix, Source::Wheels]) {
                let tally = localizer.tally(source);
                *sum += tally.nis_sum / tally.taken as f64 / 50.0;
            }
        }
        let ([fixes, wheels], rms_m) = (nis, square.sqrt());
        println!(
            "{offset_time_s} s: NEES {nees:.2} of 2, NIS of fixes {fixes:.2} of 3, of wheels {wheels:.2} of 1, {rms_m:.3} m"
        );
        assert!((1.48..=2.59).contains(&nees), "{nees}");
        assert!((fixes - 3.0).abs() < 0.1 && (wheels - 1.0).abs() < 0.1, "{nis:?}");
    }
}

/// Without a fix offset: within a tenth of the limit for fixes with 0.5 m and accelerometers with 0.05 m/s² at 100
/// Hz, 0.079 m along each axis; the filter converges within 8 s.
#[test]
fn filter_is_as_accurate_as_its_sensors_allow() {
    let params = Params {
        offset_m: 0.0,
        wheel_noise_mps: 0.0,
        accel_noise: [0.005; 3],
        accel_bias_mps2: 0.0,
        accel_bias_walk: 0.0,
        gyro_bias_radps: 0.0,
        gyro_bias_walk: 0.0,
        gyro_noise: [1e-5; 3],
        level_rad: 1e-4,
        ..plain()
    };
    let (mut square, mut count) = (0.0, 0.0);
    for seed in 0..50 {
        let mut drive = Drive::new(seed, params);
        let (measured, way) = (drive.measured(40), drive.way(40));
        let yaw = Drive::turn(0.0)[0];
        let mut localizer = Localizer::new(drive.params, Some([yaw, 1e-4])).unwrap();
        for (stamp, what) in measured {
            localizer.take(stamp, what);
            let k = (stamp.ns() / 10_000_000) as usize;
            if k > 2000 && is_fix(&what) {
                let [x, y] = error_m(&localizer.estimate().unwrap(), way[k]);
                (square, count) = (square + x * x + y * y, count + 2.0);
            }
        }
    }
    let rms = f64::sqrt(square / count);
    println!("{rms:.4} m along each axis, limit 0.079");
    assert!(rms < 1.1 * 0.079, "{rms}");
}

/// 10 s and 30 s without fixes at 14 m/s: root mean square of the errors at the end over seeds.
#[test]
fn wheels_and_gyroscopes_bridge_an_outage_of_fixes() {
    for (gap_s, most_m) in [(10, 0.6), (30, 2.0)] {
        let mut square = 0.0;
        for seed in 0..20 {
            let mut drive = Drive::new(seed, Params { offset_m: 0.0, ..Params::default() });
            drive.fix_sigma_m = 0.1;
            let seconds = 40 + gap_s;
            let (measured, way, mut localizer) =
                (drive.measured(seconds), drive.way(seconds), drive.localizer());
            let mut modes = Vec::new();
            for (stamp, what) in measured {
                if stamp > Time::ZERO + Span::from_secs(40.0) && is_fix(&what) {
                    modes.push(localizer.mode());
                    continue;
                }
                localizer.take(stamp, what);
            }
            assert_eq!((modes[0], modes[30]), (Mode::Good, Mode::Coasting));
            let [x, y] = error_m(&localizer.estimate().unwrap(), *way.last().unwrap());
            square += (x * x + y * y) / 20.0;
        }
        println!("after {gap_s} s without fixes: {:.2} m", square.sqrt());
        assert!(square.sqrt() <= most_m, "{gap_s} s: {}", square.sqrt());
    }
}

/// Fixes that are 60 m off for 8 s are refused, and later ones accepted.
#[test]
fn spike_of_fixes_is_refused() {
    let mut largest_m: f64 = 0.0;
    for seed in 0..10 {
        let mut drive = Drive::new(seed, Params { offset_m: 0.0, ..Params::default() });
        let (measured, way, mut localizer) = (drive.measured(40), drive.way(40), drive.localizer());
        for (stamp, mut what) in measured {
            let t_s = stamp.ns() as f64 * 1e-9;
            if let Sensed::Fix { at_m, .. } = &mut what
                && (20.0..28.0).contains(&t_s)
            {
                at_m[1] += 60.0;
            }
            localizer.take(stamp, what);
            if t_s > 10.0 {
                let [x, y] = error_m(&localizer.estimate().unwrap(), way[(stamp.ns() / 10_000_000) as usize]);
                largest_m = largest_m.max(math::hypot(x, y));
            }
        }
        assert_eq!(localizer.mode(), Mode::Good);
    }
    println!("largest error {largest_m:.2} m");
    assert!(largest_m <= 2.0, "{largest_m}");
}

/// Drives whose fixes have this many times the noise that they report, from this second on.
fn with_understated_noise(ratio: f64, from_s: f64, mut each: impl FnMut(u64, f64, &Estimate, [f64; 2])) {
    for seed in 0..20 {
        let params = Params { offset_m: 0.0, antenna_at_m: [LEVER_M, 0.0, 0.0], ..Params::default() };
        let mut drive = Drive { fix_sigma_m: 0.02, ..Drive::new(seed, params) };
        let (measured, way, mut localizer) = (drive.measured(20), drive.way(20), drive.localizer());
        let extra_m = drive.fix_sigma_m * (ratio * ratio - 1.0).sqrt();
        for (stamp, mut what) in measured {
            let t_s = stamp.as_secs();
            if let Sensed::Fix { at_m, .. } = &mut what {
                // The rear axle is driven; the antenna is above the inertial unit.
                let (sin, cos) = math::sin_cos(Drive::turn(t_s)[0]);
                *at_m = [at_m[0] + LEVER_M * cos, at_m[1] + LEVER_M * sin, at_m[2]];
                if t_s >= from_s {
                    *at_m = at_m.map(|x| x + extra_m * drive.rng.normal());
                }
            }
            localizer.take(stamp, what);
            if let Some(estimate) = localizer.estimate() {
                each(seed, t_s, &estimate, error_m(&estimate, way[(stamp.ns() / 10_000_000) as usize]));
            }
        }
    }
}

/// A receiver that reports 0.02 m and has 0.05 to 2 m: the noise is measured, and the filter stays consistent with it.
#[test]
fn noise_of_fixes_is_measured_where_it_is_understated() {
    for (ratio, from_s) in
        [(2.5, 0.0), (2.5, 8.0), (5.0, 0.0), (5.0, 8.0), (25.0, 0.0), (25.0, 8.0), (100.0, 0.0)]
    {
        let (mut nees, mut count, mut largest_m) = (0.0, 0.0, 0.0_f64);
        with_understated_noise(ratio, from_s, |_, t_s, estimate, [x, y]| {
            if t_s < from_s + 3.0 {
                return;
            }
            let c = estimate.covariance.fixed_view::<2, 2>(0, 0).try_inverse().unwrap();
            nees += x * x * c[(0, 0)] + 2.0 * x * y * c[(0, 1)] + y * y * c[(1, 1)];
            count += 1.0;
            largest_m = largest_m.max(math::hypot(x, y));
        });
        let (nees, sigma_m) = (nees / count, 0.02 * ratio);
        println!(
            "{ratio} times, from {from_s} s: NEES {nees:.2} of 2, largest error {:.2} sigma",
            largest_m / sigma_m
        );
        assert!(nees < 4.0, "{ratio}, {from_s}: {nees}");
        assert!(largest_m < 3.5 * sigma_m, "{ratio}, {from_s}: {largest_m}");
    }
}

/// The pose is not `good` while the noise of its fixes is far above what they report.
#[test]
fn pose_of_noisy_fixes_is_not_good() {
    for ratio in [5.0, 25.0, 100.0] {
        with_understated_noise(ratio, 8.0, |seed, t_s, estimate, _| {
            if t_s > 9.0 {
                assert_ne!(estimate.mode, Mode::Good, "{ratio}, {seed}: {t_s} s");
            }
        });
    }
    with_understated_noise(1.0, 8.0, |seed, t_s, estimate, _| {
        if t_s > 5.0 {
            assert_eq!(estimate.mode, Mode::Good, "{seed}: {t_s} s");
        }
    });
}

#[test]
fn localizer_starts_in_motion_from_the_course() {
    let mut drive = Drive::new(3, Params { offset_m: 0.0, ..Params::default() });
    let mut localizer = Localizer::new(drive.params, None).unwrap();
    for (stamp, what) in drive.measured(20) {
        localizer.take(stamp, what);
    }
    let estimate = localizer.estimate().unwrap();
    let [x, y] = error_m(&estimate, *drive.way(20).last().unwrap());
    assert!(
        math::hypot(x, y) < 0.5 && (estimate.heading_rad - Drive::turn(20.0)[0]).abs() < 0.02,
        "{estimate:?}"
    );
}

#[test]
fn localizer_starts_at_rest_on_a_slope_and_stays_there() {
    let params = Params { imu_at_m: [LEVER_M, 0.0, 0.0], ..Params::default() };
    let mut localizer = Localizer::new(params, Some([0.5, 0.05])).unwrap();
    let up = from_euler_inverse(0.02, -0.05) * 9.81;
    for k in 0..1000 {
        let stamp = Time::ZERO + Span::from_ms(10 * k);
        localizer.take(stamp, Sensed::Imu { accel_mps2: up.into(), gyro_radps: [0.0, 0.0, 0.001] });
        localizer.take(stamp, wheels(0.0));
        if k % 100 == 50 {
            localizer.take(stamp, Sensed::Fix { at_m: [5.0, 6.0, 0.0], sigma_m: [0.5; 3] });
        }
    }
    let estimate = localizer.estimate().unwrap();
    let level = crate::eskf::from_euler(0.02, -0.05, estimate.heading_rad);
    assert!(crate::eskf::angle_between(&level, &estimate.attitude) < 0.003);
    assert!((estimate.heading_rad - 0.5).abs() < 0.005, "its bias is learnt: {}", estimate.heading_rad);
    assert!(estimate.velocity_mps.norm() < 0.01 && (estimate.position_m.x - 5.0).abs() < 0.1);
}

/// Upward direction in the frame of a car with this roll and pitch.
fn from_euler_inverse(roll: f64, pitch: f64) -> Vector3<f64> {
    crate::eskf::from_euler(roll, pitch, 0.0).inverse() * Vector3::z()
}

/// A first fix that is 100 km away is refuted by those after it.
#[test]
fn wrong_start_causes_a_restart() {
    let mut drive = Drive::new(5, Params::default());
    let mut localizer = drive.localizer();
    let mut first = true;
    for (stamp, mut what) in drive.measured(10) {
        if let Sensed::Fix { at_m, .. } = &mut what
            && std::mem::take(&mut first)
        {
            *at_m = [80_000.0, -70_000.0, 0.0];
        }
        localizer.take(stamp, what);
    }
    let [x, y] = error_m(&localizer.estimate().unwrap(), *drive.way(10).last().unwrap());
    assert!(math::hypot(x, y) < 3.0 && localizer.mode() == Mode::Good);
}

#[test]
fn pose_is_lost_while_the_inertial_unit_is_silent_and_recovers() {
    let mut drive = Drive::new(6, Params::default());
    let mut localizer = drive.localizer();
    for (stamp, what) in drive.measured(12) {
        let t_s = stamp.ns() as f64 * 1e-9;
        if (8.0..9.0).contains(&t_s) && matches!(what, Sensed::Imu { .. }) {
            continue;
        }
        localizer.take(stamp, what);
        if (8.35..9.0).contains(&t_s) {
            assert_eq!(localizer.mode(), Mode::Lost, "{t_s}");
        }
    }
    assert_eq!(localizer.mode(), Mode::Good);
}

/// Bits of all numbers of a localizer's latest state.
fn bits(localizer: &Localizer) -> Vec<u64> {
    let filter = localizer.filter().expect("it has started");
    let n = &filter.nominal;
    let numbers = n.position_m.iter().chain(&n.velocity_mps).chain(n.attitude.coords.iter());
    let numbers = numbers.chain(&n.gyro_bias_radps).chain(filter.covariance.iter());
    numbers.map(|x| x.to_bits()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Each measurement arrives up to half a second late, and equal stamps in any order: the same bits as in order.
    #[test]
    fn order_of_arrival_does_not_change_the_state(seed in 0_u64..1000, late_ms in 1_i64..490) {
        let mut drive = Drive::new(seed, Params::default());
        let measured = drive.measured(3);
        let mut in_order = drive.localizer();
        let mut mixed = in_order.clone();
        let mut rng = Rng::keyed(seed, "delays", &[]);
        let mut arriving: Vec<(Time, u64, (Time, Sensed))> = measured
            .iter()
            .map(|m| (m.0 + Span::from_ms(rng.below(late_ms as usize) as i64), rng.bits(), *m))
            .collect();
        arriving.sort_by_key(|(at, tie, _)| (*at, *tie));
        for (stamp, what) in measured {
            in_order.take(stamp, what);
        }
        for (_, _, (stamp, what)) in arriving {
            prop_assert!(mixed.take(stamp, what) != Taken::TooLate);
        }
        prop_assert_eq!(bits(&in_order), bits(&mixed));
        prop_assert_eq!(in_order.tally(Source::Fix), mixed.tally(Source::Fix));
    }

    /// Arbitrary sensor values and stamps: the estimate is finite, or its mode is `Lost`.
    #[test]
    fn localizer_survives_arbitrary_measurements(
        events in proptest::collection::vec((0_u8..5, -2_000_i64..20_000, any::<[f64; 6]>(), any::<bool>()), 1..80),
    ) {
        let mut drive = Drive::new(1, Params::default());
        let mut localizer = drive.localizer();
        for (stamp, what) in drive.measured(1) {
            localizer.take(stamp, what);
        }
        for (kind, ms, wild, tame) in events {
            let of = |i: usize| if tame { wild[i] % 50.0 } else { wild[i] };
            let (a, b) = ([of(0), of(1), of(2)], [of(3), of(4), of(5)]);
            let what = match kind {
                0 => Sensed::Imu { accel_mps2: a, gyro_radps: b },
                1 => Sensed::Fix { at_m: a, sigma_m: b.map(f64::abs) },
                2 => Sensed::Place { at_m: a, sigma_m: b.map(f64::abs) },
                3 => Sensed::Pose { at_m: a, heading_rad: b[0], covariance_m2: b, sigma: [b[1], b[2]] },
                _ => Sensed::Wheels { speed_mps: a[0], curvature_1pm: Some(a[1]) },
            };
            localizer.take(Time::ZERO + Span::from_ms(ms), what);
            if let Some(estimate) = localizer.estimate() && estimate.mode != Mode::Lost {
                prop_assert!(estimate.position_m.iter().chain(estimate.covariance.iter()).all(|x| x.is_finite()));
            }
        }
    }
}

mod faults;
mod known;
mod matched;
