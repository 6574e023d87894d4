use std::collections::VecDeque;

use swerve_core::Time;
use swerve_geom::math;
use swerve_msg::{GateMode, MotionCommand, StopCause, VehicleReport};
use swerve_vehicle::VehicleParams;

use super::super::{GateInput, GateParams, SafetyGate};

const TICK_S: f64 = 0.02;

/// A car with dead time, lag and a slope, whose actuators can fail.
#[derive(Clone)]
struct Car {
    speed_mps: f64,
    steering_rad: f64,
    accel_mps2: f64,
    dead_ticks: usize,
    lag_s: f64,
    /// Acceleration by the slope of the road, m/s².
    slope_mps2: f64,
    /// Largest acceleration and deceleration by grip or power, m/s².
    most_mps2: [f64; 2],
    /// From this time on the car does not react; it keeps its acceleration and angle.
    ignores_from_s: f64,
    /// From this time on the steering does not move.
    stuck_from_s: f64,
    /// Amplitude of the alternating error of the reported speed, m/s.
    noise_mps: f64,
    queue: VecDeque<(f64, f64)>,
}

impl Default for Car {
    fn default() -> Self {
        Self {
            speed_mps: 6.0,
            steering_rad: 0.0,
            accel_mps2: 0.0,
            dead_ticks: 5,
            lag_s: 0.1,
            slope_mps2: 0.0,
            most_mps2: [3.0, 9.0],
            ignores_from_s: f64::INFINITY,
            stuck_from_s: f64::INFINITY,
            noise_mps: 0.0,
            queue: VecDeque::new(),
        }
    }
}

impl Car {
    fn step(&mut self, t_s: f64, command: &MotionCommand) {
        self.queue.push_back((command.steering_rad, command.accel_mps2));
        let late = if self.queue.len() > self.dead_ticks { self.queue.pop_front() } else { None };
        if let Some((steering_rad, accel_mps2)) = late.filter(|_| t_s < self.ignores_from_s) {
            let share = if self.lag_s > 0.0 { 1.0 - math::exp(-TICK_S / self.lag_s) } else { 1.0 };
            if t_s < self.stuck_from_s {
                self.steering_rad += share * (steering_rad - self.steering_rad);
            }
            let [power, grip] = self.most_mps2;
            self.accel_mps2 += share * (accel_mps2.clamp(-grip, power) - self.accel_mps2);
        }
        let sum_mps2 = self.accel_mps2 + self.slope_mps2;
        let speed_mps = self.speed_mps + sum_mps2 * TICK_S;
        // Brakes stop a car, and hold it.
        self.speed_mps = if self.accel_mps2 < 0.0 { speed_mps.max(0.0) } else { speed_mps };
    }
}

/// Wish of a stack at a time and a speed: steering angle and acceleration.
type Wish = fn(f64, f64) -> [f64; 2];

/// Drives for `seconds`; returns the first stop with its time, and the car.
fn drive(p: GateParams, mut car: Car, seconds: f64, wish: Wish) -> (Option<(f64, StopCause)>, Car) {
    let mut gate = SafetyGate::new(p).unwrap();
    let mut stop = None;
    for tick in 0..(seconds / TICK_S) as i64 {
        let t_s = tick as f64 * TICK_S;
        let now = Time::from_ms(20 * tick);
        let noise_mps = if tick % 2 == 0 { car.noise_mps } else { -car.noise_mps };
        let report = VehicleReport {
            stamp: now,
            speed_mps: car.speed_mps + noise_mps,
            steering_rad: car.steering_rad,
            driver_active: false,
        };
        let [steering_rad, accel_mps2] = wish(t_s, car.speed_mps);
        let command = MotionCommand { stamp: now, steering_rad, speed_mps: 6.0 + 1e-9 * t_s, accel_mps2 };
        let output = gate.step(&GateInput {
            now,
            command: Some(command),
            report: Some(report),
            enable: tick > 2,
            ..GateInput::default()
        });
        if let (GateMode::Stopping(cause), None) = (output.mode, stop) {
            stop = Some((t_s, cause));
        }
        let sent = if output.engaged { output.command } else { MotionCommand::default() };
        car.step(t_s, &sent);
    }
    (stop, car)
}

/// Parameters of the default car, at most 8 m/s.
fn params() -> GateParams {
    GateParams { speed_max_mps: 8.0, ..GateParams::new(&VehicleParams::default()) }
}

/// Keeps 6 m/s straight ahead.
fn cruise(_: f64, speed_mps: f64) -> [f64; 2] {
    [0.0, (0.7 * (6.0 - speed_mps)).clamp(-4.6, 1.5)]
}

/// Turns by 0.22 rad from 9 s on.
fn turn(t_s: f64, speed_mps: f64) -> [f64; 2] {
    [if t_s < 9.0 { 0.0 } else { 0.22 }, cruise(t_s, speed_mps)[1]]
}

/// Brakes at 3 m/s² from 5 s on.
fn brake(t_s: f64, speed_mps: f64) -> [f64; 2] {
    if t_s < 5.0 { cruise(t_s, speed_mps) } else { [0.0, -3.0] }
}

#[test]
fn car_that_ignores_commands_while_it_accelerates_is_stopped() {
    // It keeps the acceleration of 0.7 m/s² at which it stopped to listen.
    let car = Car { ignores_from_s: 0.0, accel_mps2: 0.7, ..Car::default() };
    let p = GateParams { speed_excess_mps: 0.0, ..params() };
    let (stop, _) = drive(p, car.clone(), 14.0, cruise);
    let (at_s, cause) = stop.unwrap();
    assert_eq!(cause, StopCause::AccelDeviation);
    // The command is 2 m/s² below that from 7.9 m/s on, that is, after 2.7 s, and has to be for 1.9 s.
    assert!((4.5..4.8).contains(&at_s), "{at_s}");
    // Where the permitted speed is lower, its excess comes first: 7.5 m/s after 2.1 s, for 1 s.
    let (stop, _) = drive(GateParams { speed_max_mps: 6.5, ..params() }, car, 14.0, cruise);
    let (at_s, cause) = stop.unwrap();
    assert_eq!(cause, StopCause::SpeedExcess);
    assert!((3.1..3.3).contains(&at_s), "{at_s}");
}

#[test]
fn car_that_does_not_brake_is_stopped_and_one_on_ice_is_not() {
    let car = Car { ignores_from_s: 4.0, speed_mps: 6.0, ..Car::default() };
    let (at_s, cause) = drive(params(), car, 14.0, brake).0.unwrap();
    assert_eq!(cause, StopCause::AccelDeviation);
    // 1 s and the response of 0.9 s after the command.
    assert!((6.9..7.1).contains(&at_s), "{at_s}");
    let ice = Car { most_mps2: [0.5, 0.8], ..Car::default() };
    let (stop, car) = drive(params(), ice, 16.0, brake);
    assert_eq!((stop, car.speed_mps), (None, 0.0));
}

#[test]
fn unrequested_braking_is_a_deviation() {
    // Its brakes drag with 3 m/s² at 24 m/s.
    let car = Car { slope_mps2: -3.0, speed_mps: 24.0, ..Car::default() };
    let p = GateParams { speed_max_mps: 30.0, ..params() };
    let (stop, _) = drive(p, car, 8.0, |_, _| [0.0, 0.0]);
    let (at_s, cause) = stop.unwrap();
    assert_eq!(cause, StopCause::AccelDeviation);
    assert!((1.9..2.1).contains(&at_s), "{at_s}");
}

#[test]
fn stuck_steering_is_stopped() {
    let car = Car { stuck_from_s: 8.0, ..Car::default() };
    let (at_s, cause) = drive(params(), car.clone(), 14.0, turn).0.unwrap();
    assert_eq!(cause, StopCause::SteeringDeviation);
    // 0.05 rad is reached at once, leaves the last 0.9 s after 0.9 s, and has to last for 1 s.
    assert!((10.9..11.2).contains(&at_s), "{at_s}");
    // Steering that returns in time is no reason.
    let (stop, _) = drive(params(), car.clone(), 14.0, |t_s, v| {
        [if (9.0..10.5).contains(&t_s) { 0.22 } else { 0.0 }, 0.1 * (6.0 - v)]
    });
    assert_eq!(stop, None);
    // A stationary car need not turn its wheels.
    let (stop, _) = drive(params(), Car { speed_mps: 0.0, ..car }, 14.0, |t_s, _| [turn(t_s, 0.0)[0], -1.0]);
    assert_eq!(stop, None);
}

#[test]
fn cars_that_respond_as_declared_are_not_stopped() {
    // A slalom of 0.2 rad with a period of 4 s, and accelerations of ±2 m/s² with a period of 5 s.
    let slalom: Wish = |t_s, _| {
        let sin = |period_s: f64| math::sin(std::f64::consts::TAU * t_s / period_s);
        [0.2 * sin(4.0), 2.0 * sin(5.0)]
    };
    let slow = VehicleParams { dead_time_s: 0.6, ..VehicleParams::default() };
    let slow = GateParams { speed_max_mps: 30.0, ..GateParams::new(&slow) };
    let usual = GateParams { speed_max_mps: 30.0, ..params() };
    let fast = Car { speed_mps: 15.0, ..Car::default() };
    let cases = [
        ("nominal", usual, fast.clone()),
        ("dead time of 300 ms", usual, Car { dead_ticks: 15, ..fast.clone() }),
        ("slow actuators", slow, Car { dead_ticks: 30, lag_s: 0.3, ..fast.clone() }),
        ("10 % uphill", usual, Car { slope_mps2: -1.0, speed_mps: 30.0, ..fast.clone() }),
        (
            "10 % downhill",
            GateParams { speed_max_mps: 60.0, ..usual },
            Car { slope_mps2: 1.0, ..fast.clone() },
        ),
        ("no power", usual, Car { most_mps2: [0.2, 9.0], speed_mps: 25.0, ..fast.clone() }),
        ("noisy speed", usual, Car { noise_mps: 0.5, ..fast }),
    ];
    for (name, p, car) in cases {
        assert_eq!(drive(p, car, 20.0, slalom).0, None, "{name}");
    }
    // Hard braking, standstill, and a start.
    let stop_and_go: Wish = |t_s, v| match t_s {
        3.0..8.0 => [0.0, -6.0],
        _ => cruise(t_s, v),
    };
    for slope_mps2 in [-1.0, 0.0, 1.0] {
        assert_eq!(drive(params(), Car { slope_mps2, ..Car::default() }, 20.0, stop_and_go).0, None);
    }
}

#[test]
fn car_taken_over_above_the_permitted_speed_may_slow_down() {
    let car = Car { speed_mps: 12.0, ..Car::default() };
    assert_eq!(drive(params(), car.clone(), 14.0, cruise).0, None);
    // It slows down to 10 m/s within 2 s, and is then faster again: 11 m/s after 1.7 s, for 1 s.
    let faster: Wish = |t_s, _| [0.0, if t_s < 2.0 { -1.6 } else { 0.0 }];
    let (at_s, cause) = drive(params(), Car { slope_mps2: 0.6, ..car }, 14.0, faster).0.unwrap();
    assert_eq!(cause, StopCause::SpeedExcess);
    assert!((4.5..5.2).contains(&at_s), "{at_s}");
}

#[test]
fn zero_disables_each_check() {
    let ignores = Car { ignores_from_s: 4.0, ..Car::default() };
    let stuck = Car { stuck_from_s: 8.0, ..Car::default() };
    let fast = Car { ignores_from_s: 0.0, accel_mps2: 0.7, ..Car::default() };
    let coast: Wish = |_, _| [0.0, 0.0];
    type Off = fn(&mut GateParams);
    let cases: [(Car, Wish, Off); 3] = [
        (ignores, brake, |p| p.accel_error_mps2 = 0.0),
        (stuck, turn, |p| p.steering_error_rad = 0.0),
        (fast, coast, |p| p.speed_excess_mps = 0.0),
    ];
    for (car, wish, off) in cases {
        assert!(drive(params(), car.clone(), 14.0, wish).0.is_some());
        let mut p = params();
        off(&mut p);
        assert_eq!(drive(p, car.clone(), 14.0, wish).0, None);
        let p = GateParams { ignored_after_s: 0.0, ..params() };
        assert_eq!(drive(p, car, 14.0, wish).0, None);
    }
}

#[test]
fn tolerances_follow_from_the_vehicle() {
    let usual = VehicleParams::default();
    let p = GateParams::new(&usual);
    // Reserve of 0.3 s, and three time constants of the drivetrain.
    assert!((p.response_s - 0.9).abs() < 1e-9 && (p.steering_error_rad - 0.05).abs() < 1e-9, "{p:?}");
    let mut slow = VehicleParams { dead_time_s: 0.4, ..usual };
    (slow.steering.lag_s, slow.steering.curve[3][1]) = (0.5, 0.7);
    let p = GateParams::new(&slow);
    assert!((p.response_s - 2.2).abs() < 1e-9, "{}", p.response_s);
    let expected_rad = 0.05 + 0.3 * slow.limits.steering_max_rad;
    assert!((p.steering_error_rad - expected_rad).abs() < 1e-9, "{}", p.steering_error_rad);
}
