//! The car body against closed forms.

use super::*;

mod commonroad;

const G: f64 = 9.81;

/// A physics world with gravity and a fixed step, and the car in it.
struct Drive {
    world: PhysicsWorld,
    ego: EgoCar,
    friction: f64,
    dt_s: f64,
}

impl Drive {
    fn new(params: &VehicleParams, speed_mps: f64, rate_hz: f64) -> Self {
        Self::on_slope(params, speed_mps, rate_hz, [0.0, 0.0])
    }

    /// The ground stays the plane z = 0; a slope is modelled by tilting gravity (`lean`: sines along x and y).
    fn on_slope(params: &VehicleParams, speed_mps: f64, rate_hz: f64, lean: [f64; 2]) -> Self {
        let mut world = PhysicsWorld::new();
        let upright = (1.0 - lean[0] * lean[0] - lean[1] * lean[1]).sqrt();
        world.gravity = to_vec(nalgebra::Vector3::new(lean[0], lean[1], -upright) * G);
        world.integration_parameters.dt = convert::narrow(1.0 / rate_hz);
        let ego = EgoCar::spawn(&mut world, ActorId::EGO, params, Pose2::new(0.0, 0.0, 0.0), speed_mps);
        Self { world, ego, friction: 0.9, dt_s: 1.0 / rate_hz }
    }

    fn step(&mut self, command: Command) -> EgoTruth {
        let friction = self.ego.car().params().tyre.friction_on(self.friction);
        self.ego.apply(&mut self.world, &command, |_| friction, self.dt_s);
        self.world.step();
        self.ego.truth(&self.world)
    }

    /// Drives for `duration_s` with commands given by the time since the start; returns the last state.
    fn run(&mut self, duration_s: f64, command: impl Fn(f64) -> Command) -> EgoTruth {
        self.watch(duration_s, command, |_, _| {})
    }

    fn watch(
        &mut self,
        duration_s: f64,
        command: impl Fn(f64) -> Command,
        mut see: impl FnMut(&EgoCar, &EgoTruth),
    ) -> EgoTruth {
        let steps = (duration_s / self.dt_s).round() as u32;
        for i in 0..steps {
            let truth = self.step(command(f64::from(i) * self.dt_s));
            see(&self.ego, &truth);
        }
        self.ego.truth(&self.world)
    }
}

fn steer(steering_rad: f64) -> Command {
    Command { steering_rad, ..Command::default() }
}

/// Left, right, straight: an evasive swerve and back.
fn swerve(t: f64, angle_rad: f64) -> Command {
    steer(match t {
        t if t < 0.6 => angle_rad,
        t if t < 1.6 => -angle_rad,
        t if t < 2.2 => angle_rad,
        _ => 0.0,
    })
}

fn car() -> VehicleParams {
    VehicleParams::default()
}

#[test]
fn car_starts_settled_and_a_standing_car_stands() {
    for rate_hz in [200.0, 1000.0] {
        let mut drive = Drive::new(&car(), 0.0, rate_hz);
        drive.watch(
            3.0,
            |_| Command::default(),
            |_, truth| {
                assert!(truth.map_from_ego.origin().coords.norm() < 1e-4, "{truth:?}");
                assert!((truth.specific_force_mps2.coords.z - G).abs() < 0.02);
            },
        );
        let mut drive = Drive::new(&car(), 20.0, rate_hz);
        drive.watch(
            0.5,
            |_| Command::default(),
            |_, truth| {
                let z_m = truth.map_from_ego.origin().coords.z;
                assert!(z_m.abs() < 3e-3 && truth.state.pose.y_m.abs() < 1e-3, "{truth:?}");
                assert!((truth.state.speed_mps - 20.0).abs() < 0.15);
            },
        );
    }
}

/// Stop from 20 m/s with full brake: distance, and the lowest slip of any wheel above 3 m/s.
fn full_stop(params: &VehicleParams, friction: f64, rate_hz: f64) -> (f64, f64) {
    let mut drive = Drive::new(params, 20.0, rate_hz);
    drive.friction = friction;
    let mut slip_min = 0.0f64;
    let end = drive.watch(
        3.0 + 20.0 / (friction * G),
        |_| Command::FULL_BRAKE,
        |ego, truth| {
            if truth.state.speed_mps > 3.0 {
                slip_min = ego.car().wheels().iter().fold(slip_min, |low, wheel| low.min(wheel.slip));
            }
        },
    );
    assert!(end.state.speed_mps.abs() < 0.01, "{end:?}");
    (end.state.pose.x_m, slip_min)
}

#[test]
fn full_brake_stops_at_mu_g_after_the_build_up() {
    for friction in [0.9, 0.5, 0.3] {
        for rate_hz in [200.0, 1000.0] {
            let (distance_m, slip_min) = full_stop(&car(), friction, rate_hz);
            let mu_g = friction * G;
            // The torque rises linearly, until the share of full pedal that the ground can take. Until then half the
            // deceleration is missing.
            let build_up_s = 0.15 * (mu_g * 1800.0 * 0.335 / 7100.0).min(1.0);
            let ideal_m = 20.0 * 0.5 * build_up_s + 20.0 * 20.0 / (2.0 * mu_g);
            let share = ideal_m / distance_m;
            println!(
                "friction {friction} at {rate_hz} Hz: {distance_m:.2} m, ideal {ideal_m:.2} m, slip {slip_min:.2}"
            );
            assert!((0.92..1.01).contains(&share), "{distance_m} m, ideal {ideal_m} m");
            assert!(slip_min > -0.4, "a wheel nearly locked: {slip_min}");
        }
    }
}

#[test]
fn wheels_lock_without_abs_and_the_distance_is_longer() {
    let mut plain = car();
    plain.brakes.abs.enabled = false;
    let (with_m, _) = full_stop(&car(), 0.9, 200.0);
    let (without_m, slip_min) = full_stop(&plain, 0.9, 200.0);
    assert!(slip_min < -0.99 && without_m > 1.05 * with_m, "{without_m} m, {with_m} m, {slip_min}");
}

#[test]
fn turning_at_walking_pace_matches_the_kinematic_geometry() {
    for steering_rad in [0.1, -0.3] {
        let mut drive = Drive::new(&car(), 5.0, 200.0);
        let params = car();
        let pedals = swerve_vehicle::pedals_for_accel(&params, 5.0, 0.0);
        let end = drive.run(4.0, |_| Command { throttle: 4.0 * pedals.throttle, ..steer(steering_rad) });
        let kinematic = end.state.speed_mps * math::tan(steering_rad) / params.shape.wheelbase_m;
        let ratio = end.state.yaw_rate_radps / kinematic;
        println!("speed {:.2} m/s, yaw rate / kinematic {ratio:.4}", end.state.speed_mps);
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    }
}

/// The excess of the steering angle over the kinematic one, per lateral acceleration, is the understeer gradient.
#[test]
fn understeer_matches_the_axle_parameters() {
    let gradient = |params: &VehicleParams, steering_rad: f64| {
        let pedals = swerve_vehicle::pedals_for_accel(params, 20.0, 0.0);
        let mut drive = Drive::new(params, 20.0, 200.0);
        let end = drive.run(4.0, |_| Command { throttle: pedals.throttle, ..steer(steering_rad) });
        let (v, r) = (end.state.speed_mps, end.state.yaw_rate_radps);
        (steering_rad - math::atan(params.shape.wheelbase_m * r / v)) / (v * r)
    };
    let mut nose_heavy = car();
    nose_heavy.body.front_weight_share = 0.62;
    nose_heavy.tyre.stiffness_load_sensitivity = 0.5;
    let mut tail_heavy = nose_heavy.clone();
    tail_heavy.body.front_weight_share = 0.45;
    for mut params in [car(), nose_heavy, tail_heavy] {
        // Rolling resistance and the force against it also turn the car; the closed form contains neither.
        params.wheel.rolling_resistance = 0.0;
        params.aero.drag_area_m2 = 0.0;
        let (measured, expected) = (gradient(&params, 0.006), params.understeer_gradient_rads2pm());
        println!("understeer gradient {measured:.6}, from the axles {expected:.6} rad s²/m");
        assert!((measured - expected).abs() < 1e-5 + 0.03 * expected.abs());
    }
    let params = car();
    // Near the limit the front axle slides first.
    let mut drive = Drive::new(&params, 30.0, 200.0);
    let end = drive.run(2.0, |_| steer(0.03));
    let ratio = end.state.yaw_rate_radps / (end.state.speed_mps * 0.03 / params.shape.wheelbase_m);
    println!("30 m/s at 0.03 rad: yaw rate / kinematic {ratio:.3}");
    assert!((0.6..0.95).contains(&ratio), "{ratio}");
}

#[test]
fn step_length_hardly_matters() {
    for angle_rad in [0.03, 0.06, 0.12] {
        let [coarse, fine] = [200.0, 1000.0].map(|rate_hz| {
            let mut drive = Drive::new(&car(), 20.0, rate_hz);
            let (mut yaw_rate, mut lateral) = (0.0f64, 0.0f64);
            let end = drive.watch(
                3.0,
                |t| swerve(t + 1e-9, angle_rad),
                |_, truth| {
                    yaw_rate = yaw_rate.max(truth.state.yaw_rate_radps.abs());
                    lateral = lateral.max(truth.state.lateral_accel_mps2.abs());
                },
            );
            (yaw_rate, lateral, end.state.pose)
        });
        println!("{angle_rad} rad: {coarse:?} at 200 Hz, {fine:?} at 1 kHz");
        assert!((coarse.0 / fine.0 - 1.0).abs() < 0.02 && (coarse.1 / fine.1 - 1.0).abs() < 0.02);
        if angle_rad < 0.1 {
            assert!((coarse.2.y_m - fine.2.y_m).abs() < 0.15);
        }
    }
}

#[test]
fn car_stays_upright_and_within_friction_in_the_hardest_swerve() {
    for (friction, rate_hz) in [(0.9, 200.0), (0.9, 1000.0), (0.4, 200.0)] {
        let mut drive = Drive::new(&car(), 22.0, rate_hz);
        drive.friction = friction;
        drive.watch(
            4.0,
            |t| swerve(t, 0.25),
            |_, truth| {
                let (roll, pitch, _) = truth.map_from_ego.roll_pitch_yaw();
                assert!(roll.abs() < 0.09 && pitch.abs() < 0.06, "roll {roll}, pitch {pitch}");
                let state = &truth.state;
                assert!(state.lateral_accel_mps2.abs() < 1.06 * friction * G, "{state:?}");
                assert!(truth.map_from_ego.origin().coords.z.abs() < 0.05);
            },
        );
    }
}

#[test]
fn power_limit_sets_the_acceleration() {
    let params = car();
    let mut drive = Drive::new(&params, 25.0, 200.0);
    let mut checked = 0;
    let full = Command { throttle: 1.0, ..Command::default() };
    drive.watch(
        5.0,
        |_| full,
        |ego, truth| {
            let v = truth.state.speed_mps;
            let power: f64 = ego.car().wheels().iter().map(|w| w.fx_n.max(0.0) * v).sum();
            assert!(power < 1.02 * params.drivetrain.power_max_w, "{power}");
            if truth.state.stamp.as_secs() > 2.0 {
                let most =
                    (params.drivetrain.power_max_w / v - params.resistance_n(v)) / params.effective_mass_kg();
                assert!((truth.state.accel_mps2 / most - 1.0).abs() < 0.05, "{v} m/s: {truth:?}");
                checked += 1;
            }
        },
    );
    assert!(checked > 500);
}

#[test]
fn pedals_give_the_requested_acceleration() {
    let params = car();
    for wanted in [-6.0, -3.0, -0.2, 0.0, 1.0, 2.5] {
        let mut drive = Drive::new(&params, 15.0, 200.0);
        let mut pedals = swerve_vehicle::pedals_for_accel(&params, 15.0, wanted);
        let mut sum = 0.0;
        for i in 0..260 {
            let command = Command { steering_rad: 0.0, throttle: pedals.throttle, brake: pedals.brake };
            let truth = drive.step(command);
            pedals = swerve_vehicle::pedals_for_accel(&params, truth.state.speed_mps, wanted);
            if i >= 200 {
                sum += truth.state.accel_mps2 / 60.0;
            }
        }
        assert!((sum - wanted).abs() < 0.05 + 0.02 * wanted.abs(), "wanted {wanted}, got {sum}");
    }
}

#[test]
fn command_acts_after_the_dead_time_to_the_tick() {
    for (rate_hz, dead_time_s, ticks) in [(200.0, 0.1, 20), (1000.0, 0.1, 100), (200.0, 0.0, 0)] {
        let mut params = car();
        params.dead_time_s = dead_time_s;
        let mut drive = Drive::new(&params, 10.0, rate_hz);
        for _ in 0..7 {
            drive.step(Command::default());
        }
        let mut waited = 0;
        while drive.step(steer(0.1)).state.steering_rad == 0.0 {
            waited += 1;
        }
        assert_eq!(waited, ticks, "{rate_hz} Hz");
    }
}

#[test]
fn braked_car_holds_on_a_slope_and_a_free_one_rolls() {
    let params = car();
    for lean in [[-0.15, 0.0], [0.15, 0.0], [0.0, 0.15]] {
        for rate_hz in [200.0, 1000.0] {
            let mut drive = Drive::on_slope(&params, 0.0, rate_hz, lean);
            let hold = Command { brake: 0.5, ..Command::default() };
            // The brake builds up, then the car settles on its springs and tyres.
            let settled = drive.run(3.0, |_| hold);
            let end = drive.run(7.0, |_| hold);
            let crept_m = (end.state.pose.point() - settled.state.pose.point()).norm();
            assert!(settled.state.pose.point().distance(swerve_geom::Point2::new(0.0, 0.0)) < 0.1);
            assert!(crept_m < 1e-3, "crept {crept_m} m at {lean:?}");
        }
    }
    let mut drive = Drive::on_slope(&params, 0.0, 200.0, [0.15, 0.0]);
    let end = drive.run(2.0, |_| Command::default());
    let rolling = params.wheel.rolling_resistance * params.body.mass_kg * G;
    let expected = 2.0 * (0.15 * G * params.body.mass_kg - rolling) / params.effective_mass_kg();
    assert!((end.state.speed_mps / expected - 1.0).abs() < 0.05, "{expected}, {end:?}");
}

#[test]
fn stopped_car_stays_in_place() {
    let mut drive = Drive::new(&car(), 10.0, 200.0);
    let stopped = drive.run(3.0, |_| Command::FULL_BRAKE);
    let later = drive.run(5.0, |_| Command::FULL_BRAKE);
    assert!((later.state.pose.point() - stopped.state.pose.point()).norm() < 1e-3);
    assert!(later.state.speed_mps.abs() < 1e-3);
    let released = drive.run(5.0, |_| Command::default());
    assert!((released.state.pose.point() - later.state.pose.point()).norm() < 1e-3);
}

#[test]
fn absurd_commands_are_clamped_and_non_finite_ones_refused() {
    let absurd = [f64::NAN, f64::INFINITY, -1e300, 1e300, -5.0, 17.0];
    let mut drive = Drive::new(&car(), 15.0, 200.0);
    let limits = car().limits;
    for i in 0..600usize {
        let pick = |n: usize| absurd[(i / 7 + n * i) % absurd.len()];
        let truth = drive.step(Command { steering_rad: pick(0), throttle: pick(1), brake: pick(2) });
        assert!(truth.state.pose.is_finite() && truth.velocity_mps.norm() < 40.0, "{truth:?}");
        assert!(truth.state.steering_rad.abs() <= limits.steering_max_rad);
    }
    assert!(drive.ego.car().commands_refused() > 100);
    // A refused command leaves the previous one in force.
    let mut drive = Drive::new(&car(), 15.0, 200.0);
    drive.run(1.0, |_| steer(0.05));
    let end = drive.run(0.5, |_| Command { steering_rad: f64::NAN, throttle: 0.0, brake: 1.0 });
    assert!((end.state.steering_rad - 0.05).abs() < 1e-6);
}

#[test]
fn identical_drives_are_bit_identical() {
    let drive = || {
        let mut drive = Drive::new(&car(), 22.0, 200.0);
        let end = drive.run(3.0, |t| Command { brake: if t > 2.0 { 1.0 } else { 0.0 }, ..swerve(t, 0.1) });
        serde_json::to_string(&end).unwrap()
    };
    assert_eq!(drive(), drive());
}

#[test]
fn truth_is_consistent() {
    let mut drive = Drive::new(&car(), 15.0, 200.0);
    let pedals = swerve_vehicle::pedals_for_accel(&car(), 15.0, 0.0);
    let end = drive.run(4.0, |_| Command { throttle: pedals.throttle, ..steer(0.05) });
    let state = end.state;
    assert_eq!(state.stamp.as_secs(), 4.0);
    let speed = end.velocity_mps.norm();
    // Steady turn: the acceleration at the centre of gravity is speed times yaw rate, to the left.
    assert!((state.lateral_accel_mps2 - speed * state.yaw_rate_radps).abs() < 0.05, "{state:?}");
    let (roll, pitch, yaw) = end.map_from_ego.roll_pitch_yaw();
    assert!(roll > 0.01 && roll < 0.04, "a left turn leans the car to the right: {roll}");
    // An accelerometer that leans with the body also measures gravity.
    let felt = end.specific_force_mps2.coords;
    let expected_y = state.lateral_accel_mps2 * math::cos(roll) + G * math::sin(roll) * math::cos(pitch);
    assert!((felt.y - expected_y).abs() < 0.05, "{felt:?} {expected_y}");
    assert!((felt.norm() - math::hypot(G, speed * state.yaw_rate_radps)).abs() < 0.1);
    assert!((end.angular_velocity_radps.coords.z - state.yaw_rate_radps).abs() < 0.01);
    assert!((state.pose.heading_rad - yaw).abs() < 1e-9);
    // Positions are the integral of velocities.
    let next = drive.step(Command { throttle: pedals.throttle, ..steer(0.05) });
    let moved = next.state.pose.point() - state.pose.point();
    assert!((moved.dot(state.pose.direction()) / 0.005 - state.speed_mps).abs() < 0.05);
}

#[test]
fn car_starts_at_the_given_pose_in_the_map() {
    let mut world = PhysicsWorld::new();
    let pose = Pose2::new(40.0, -3.0, 2.5);
    let truth = EgoCar::spawn(&mut world, ActorId::EGO, &car(), pose, 7.0).truth(&world);
    assert!(truth.state.pose.point().distance(pose.point()) < 1e-5);
    assert!((truth.state.pose.heading_rad - 2.5).abs() < 1e-6);
    assert!((truth.state.speed_mps - 7.0).abs() < 1e-5);
}

#[test]
fn parameters_are_parsed_and_unknown_ones_refused() {
    let text = r#"{"body": {"mass_kg": 2000.0}, "dead_time_s": 0.1}"#;
    let params: VehicleParams = serde_json::from_str(text).unwrap();
    assert_eq!((params.body.mass_kg, params.body.cg_height_m, params.dead_time_s), (2000.0, 0.55, 0.1));
    for wrong in [r#"{"bdoy": {}}"#, r#"{"body": {"mass_lb": 1.0}}"#, r#"{"brakes": {"abs": {"on": true}}}"#]
    {
        assert!(serde_json::from_str::<VehicleParams>(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn car_collides_with_an_obstacle() {
    let mut drive = Drive::new(&car(), 15.0, 200.0);
    let wall =
        ColliderBuilder::cuboid(0.5, 5.0, 1.0).translation(to_vec(nalgebra::Vector3::new(20.0, 0.0, 1.0)));
    drive.world.insert_collider(wall, None);
    let mut harshest = 0.0f64;
    let end = drive.watch(
        3.0,
        |_| Command::default(),
        |_, truth| harshest = harshest.min(truth.specific_force_mps2.coords.x),
    );
    assert!(harshest < -100.0, "{harshest}");
    // The bumper stops at the wall's face.
    assert!(end.state.pose.x_m + 3.89 < 19.55 && end.velocity_mps.norm() < 3.0, "{end:?}");
}
