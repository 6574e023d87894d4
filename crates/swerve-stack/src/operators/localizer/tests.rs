use std::sync::Arc;

use swerve_core::{Rng, Span};
use swerve_geom::{Point, Point2, Polyline, Transform, Vector};
use swerve_msg::truth::{EgoTruth, WorldState};
use swerve_msg::{ActorId, Route};
use swerve_sim::sense::{
    GnssParams, GnssReceiver, ImuParams, InertialUnit, WheelOdometer, WheelOdometryParams, Zone,
    rolling_speeds_radps,
};

use super::*;

/// A car on a winding road at constant speed, with the sensors of its configuration.
struct Drive {
    config: Config,
    seed: u64,
    speed_mps: f64,
    /// Amplitude (rad) and angular rate (rad/s) of its heading.
    swing: [f64; 2],
}

impl Drive {
    fn new(seed: u64, gnss: GnssParams, imu: ImuParams) -> Self {
        let odometry = WheelOdometryParams { radius_error: 0.003, ..WheelOdometryParams::default() };
        let mut config = Config { seed, ..Config::default() };
        config.sensing = SensingConfig { gnss, imu, odometry, ..config.sensing };
        Self { config, seed, speed_mps: 12.0, swing: [0.4, 0.3] }
    }

    /// Heading and its first and second derivatives.
    fn turn(&self, t_s: f64) -> [f64; 3] {
        let [amplitude, rate] = self.swing;
        let (sin, cos) = math::sin_cos(rate * t_s);
        [amplitude * sin, amplitude * rate * cos, -amplitude * rate * rate * sin]
    }

    fn world(&self, t_s: f64, [x, y]: [f64; 2]) -> WorldState {
        let ([heading, rate, angular], vehicle) = (self.turn(t_s), &self.config.sim.vehicle);
        let (sin, cos) = math::sin_cos(heading);
        let (ahead_m, speed) = (vehicle.cg_to_rear_m(), self.speed_mps);
        let steering_rad = math::atan2(rate * vehicle.shape.wheelbase_m, speed);
        let state = EgoState {
            pose: Pose2::new(x, y, heading),
            speed_mps: speed,
            yaw_rate_radps: rate,
            steering_rad,
            ..EgoState::default()
        };
        let ego = EgoTruth {
            id: ActorId::EGO,
            map_from_ego: Transform::from_roll_pitch_yaw(Point::new(x, y, 0.0), 0.0, 0.0, heading),
            state,
            velocity_mps: Vector::new(
                speed * cos - rate * ahead_m * sin,
                speed * sin + rate * ahead_m * cos,
                0.0,
            ),
            specific_force_mps2: Vector::new(-ahead_m * rate * rate, speed * rate + ahead_m * angular, 9.81),
            angular_velocity_radps: Vector::new(0.0, 0.0, rate),
        };
        WorldState {
            stamp: Time::ZERO + Span::from_secs(t_s),
            ego,
            actors: Vec::new(),
            collisions: Vec::new(),
            infractions: Vec::new(),
            ended: None,
        }
    }

    /// Drives for a time with a filter that assumes sensor parameters `told`. At each (possible) fix, `each` gets the
    /// time (s), the filter, the position of the rear axle, and the error of the fix (m).
    fn by(
        &self,
        seconds: u32,
        told: Params,
        mut each: impl FnMut(f64, &Localizer, [f64; 2], Option<f64>),
    ) -> Localizer {
        let (sensing, vehicle) = (&self.config.sensing, &self.config.sim.vehicle);
        let mut imu = InertialUnit::new(sensing.imu, vehicle, Span::from_ms(10), "imu", self.seed);
        let mut gnss = GnssReceiver::new(sensing.gnss.clone(), "gnss", self.seed);
        let mut wheels = WheelOdometer::new(sensing.odometry, vehicle, "wheels", self.seed);
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(1.0, 0.0)]).unwrap();
        let mut receiver = Receiver::of(sensing);
        receiver.follow(Some(Arc::new(Route::uniform(line, 1.0, 1.0))));
        let mut rng = Rng::keyed(self.seed, "start", &[]);
        let mut localizer = Localizer::new(told, None).unwrap();
        let (mut at, mut lane_off_rad) = ([0.0; 2], Some(0.05 * rng.normal()));
        for ms in 0..1000 * seconds {
            let t_s = f64::from(ms) * 1e-3;
            if ms % 10 == 0 {
                let world = self.world(t_s, at);
                let Imu { accel_mps2, gyro_radps, .. } = imu.sense(&world);
                localizer.take(world.stamp, Sensed::Imu { accel_mps2, gyro_radps });
                let speeds = rolling_speeds_radps(&world.ego, vehicle);
                if let Some(turned) = (ms % 20 == 0).then(|| wheels.sense(&world, speeds)).flatten() {
                    let curvature_1pm = Some(math::tan(turned.steering_rad) / vehicle.shape.wheelbase_m);
                    let speed_mps = turned.speed_mps;
                    localizer.take(world.stamp, Sensed::Wheels { speed_mps, curvature_1pm });
                }
                if ms % 100 == 0 {
                    let fix = gnss.sense(&world).and_then(|fix| receiver.sensed(&fix, told.offset_m));
                    let mut off_m = None;
                    if let Some(sensed) = fix {
                        if let Some(off_rad) = lane_off_rad.take() {
                            localizer.suppose_heading([self.turn(t_s)[0] + off_rad, 0.05]);
                        }
                        localizer.take(world.stamp, sensed);
                        let Sensed::Fix { at_m, .. } = sensed else { unreachable!("a fix is one") };
                        off_m = Some(math::hypot(at_m[0] - at[0], at_m[1] - at[1]));
                    }
                    each(t_s, &localizer, at, off_m);
                }
            }
            let (sin, cos) = math::sin_cos(self.turn(t_s + 5e-4)[0]);
            at = [at[0] + 1e-3 * self.speed_mps * cos, at[1] + 1e-3 * self.speed_mps * sin];
        }
        localizer
    }
}

fn error_m(estimate: &Estimate, at: [f64; 2]) -> [f64; 2] {
    [estimate.position_m.x - at[0], estimate.position_m.y - at[1]]
}

/// Root mean square of position errors on the ground after 10 s, over seeds, where there is an estimate.
fn rms_m(drive: impl Fn(u64) -> Drive, told: impl Fn(&Config) -> Params) -> f64 {
    let (mut square, mut count) = (0.0, 0.0);
    for seed in 0..20 {
        let drive = drive(seed);
        drive.by(20, told(&drive.config), |t_s, localizer, at, _| {
            if let Some(estimate) = localizer.estimate().filter(|_| t_s > 10.0) {
                let [x, y] = error_m(&estimate, at);
                (square, count) = (square + x * x + y * y, count + 1.0);
            }
        });
    }
    f64::sqrt(square / count)
}

/// An automotive inertial unit, off the centre of gravity.
fn unit() -> ImuParams {
    ImuParams {
        accel_noise_density: 0.01,
        accel_bias_mps2: 0.03,
        accel_bias_walk: 2e-3,
        accel_scale_error: 0.002,
        gyro_noise_density: 5e-4,
        gyro_bias_radps: 1e-3,
        gyro_bias_walk: 5e-5,
        gyro_scale_error: 0.002,
        at_m: Some([0.4, -0.5, 0.8]),
        ..ImuParams::default()
    }
}

fn corrected() -> GnssParams {
    GnssParams { noise_m: 0.02, bias_m: 0.0, ..GnssParams::default() }
}

/// Over 24 seeds, with all permanent sensor errors: the filter's covariance is consistent if it knows how fixes wander.
#[test]
fn filter_is_consistent_with_wandering_fixes() {
    let gnss = || GnssParams {
        bias_m: 1.0,
        bias_time_s: 10.0,
        antenna_at_m: [1.0, 0.3, 1.5],
        ..GnssParams::default()
    };
    let nees = |told: fn(&Config) -> Params| {
        let (mut nees, mut nis) = (0.0, 0.0);
        for seed in 0..24 {
            let drive = Drive::new(seed, gnss(), unit());
            let mut end = 0.0;
            let localizer = drive.by(40, told(&drive.config), |_, localizer, at, _| {
                let Some(estimate) = localizer.estimate() else { return };
                let [x, y] = error_m(&estimate, at);
                let c = estimate.covariance.fixed_view::<2, 2>(0, 0).try_inverse().unwrap();
                end = x * x * c[(0, 0)] + 2.0 * x * y * c[(0, 1)] + y * y * c[(1, 1)];
            });
            nees += end / 24.0;
            let tally = localizer.tally(Source::Fix);
            nis += tally.nis_sum / tally.taken as f64 / 24.0;
        }
        println!("NEES {nees:.2} of 2, NIS of fixes {nis:.2} of 3");
        [nees, nis]
    };
    let [right, nis] = nees(known);
    assert!((1.28..=2.88).contains(&right), "{right}");
    // The height error, modelled as noise, has less than its share.
    assert!((2.0..=3.1).contains(&nis), "{nis}");
    let [left_out, _] = nees(|config| Params { offset_m: 0.0, offset_time_s: 0.0, ..known(config) });
    assert!(left_out > 10.0 * right, "{left_out}");
}

#[test]
fn configured_lever_arms_reduce_errors() {
    let aside = |seed| {
        let antenna_at_m = [1.2, 0.4, 1.5];
        Drive::new(seed, GnssParams { antenna_at_m, ..corrected() }, unit())
    };
    let told = rms_m(aside, known);
    let left_out = rms_m(aside, |config| Params { antenna_at_m: [0.0; 3], ..known(config) });
    println!("antenna: told {told:.3} m, left out {left_out:.3} m");
    assert!(told < 0.03 && left_out > 0.5, "{told} {left_out}");
    // A slalom with a unit in the boot.
    let slalom = |seed| {
        let imu = ImuParams { at_m: Some([-1.0, 0.6, 0.5]), ..unit() };
        Drive { speed_mps: 8.0, swing: [0.5, 1.0], ..Drive::new(seed, corrected(), imu) }
    };
    let told = rms_m(slalom, known);
    let at_cg =
        |config: &Config| known(&Config { sensing: SensingConfig::default(), ..config.clone() }).imu_at_m;
    let left_out = rms_m(slalom, |config| Params { imu_at_m: at_cg(config), ..known(config) });
    println!("inertial unit: told {told:.3} m, left out {left_out:.3} m");
    assert!(told < 0.03 && left_out > 1.5 * told, "{told} {left_out}");
}

/// Lost before the first fix, coasting two seconds into a tunnel, lost if that is too long, good again after it.
#[test]
fn filter_coasts_gets_lost_and_recovers_without_fixes() {
    let tunnel = Zone { from_m: [260.0, 0.0], to_m: Some([340.0, 0.0]), radius_m: 60.0 };
    let gnss = GnssParams { first_fix_s: 2.0, outages: vec![tunnel], ..corrected() };
    for seed in 0..20 {
        let drive = Drive::new(seed, gnss.clone(), unit());
        for (lost_sigma_m, is_lost) in [(2.0, false), (0.2, true)] {
            let told = Params { lost_sigma_m, ..known(&drive.config) };
            let (mut modes, mut last_fix_s) = (Vec::new(), None);
            drive.by(50, told, |t_s, localizer, _, fix| {
                last_fix_s = fix.map(|_| t_s).or(last_fix_s);
                match last_fix_s {
                    None => assert!(t_s < 2.0 && localizer.estimate().is_none()),
                    Some(last_s) if t_s - last_s > 2.05 => modes.push(localizer.mode()),
                    Some(last_s) if t_s - last_s < 1.95 => assert_eq!(localizer.mode(), Mode::Good, "{t_s}"),
                    Some(_) => {}
                }
            });
            assert!(modes.len() > 100, "the tunnel is there: {}", modes.len());
            assert_eq!(modes[0], Mode::Coasting);
            let end = if is_lost { Mode::Lost } else { Mode::Coasting };
            assert_eq!(modes.last(), Some(&end), "seed {seed}");
        }
    }
}

/// Reflections that move fixes by 60 m for 8 s, once the filter has run for 10 s.
#[test]
fn filter_refuses_a_step_by_reflections() {
    let gnss = GnssParams {
        noise_m: 0.3,
        bias_m: 0.3,
        bias_time_s: 30.0,
        multipath_per_min: 2.0,
        multipath_m: 60.0,
        multipath_s: 8.0,
        ..GnssParams::default()
    };
    let (mut largest_m, mut seeds) = (0.0_f64, 0);
    for seed in 0..80 {
        let drive = Drive::new(seed, gnss.clone(), unit());
        let (mut first_s, mut worst_m) = (None, 0.0_f64);
        drive.by(40, known(&drive.config), |t_s, localizer, at, fix| {
            if fix.is_some_and(|off_m| off_m > 30.0) {
                first_s = first_s.or(Some(t_s));
            }
            if first_s.is_some() {
                let [x, y] = error_m(&localizer.estimate().expect("it has started"), at);
                worst_m = worst_m.max(math::hypot(x, y));
            }
        });
        if first_s.is_some_and(|s| s > 10.0) {
            (largest_m, seeds) = (largest_m.max(worst_m), seeds + 1);
        }
        if seeds == 20 {
            break;
        }
    }
    println!("largest error {largest_m:.2} m");
    assert!(seeds == 20 && largest_m <= 2.0, "{seeds} {largest_m}");
}
