use super::*;

const TICK_MS: i64 = 20;

/// A gate, a car that follows its commands, and a stack that requests 10 m/s and 0.1 rad.
struct Bench {
    gate: SafetyGate,
    now_ms: i64,
    input: GateInput<'static>,
    /// True while the stack and the vehicle send messages.
    stack: bool,
    vehicle: bool,
}

impl Bench {
    fn new() -> Self {
        let gate = SafetyGate::new(GateParams::default()).unwrap();
        Self { gate, now_ms: 0, input: GateInput::default(), stack: true, vehicle: true }
    }

    /// A bench driving at 10 m/s.
    fn driving() -> Self {
        let mut bench = Self::new();
        bench.report().speed_mps = 10.0;
        bench.run(5);
        bench.input.enable = true;
        assert_eq!(bench.run(5).mode, GateMode::Driving);
        bench
    }

    fn report(&mut self) -> &mut VehicleReport {
        self.input.report.get_or_insert_default()
    }

    fn command(&mut self) -> &mut MotionCommand {
        let wish = MotionCommand { stamp: Time::ZERO, steering_rad: 0.1, speed_mps: 10.0, accel_mps2: 0.5 };
        self.input.command.get_or_insert(wish)
    }

    /// Runs one tick; the car follows acceleration and angle while engaged.
    fn tick(&mut self) -> GateOutput {
        self.now_ms += TICK_MS;
        let now = Time::from_ms(self.now_ms);
        self.input.now = now;
        if self.stack {
            self.command().stamp = now;
        }
        if self.vehicle {
            self.report().stamp = now;
        }
        let output = self.gate.step(&self.input);
        if output.engaged && self.vehicle {
            let report = self.report();
            report.steering_rad = output.command.steering_rad;
            let speed = report.speed_mps + 0.001 * TICK_MS as f64 * output.command.accel_mps2;
            // Brakes hold a standing car.
            report.speed_mps = if output.command.speed_mps == 0.0 { speed.max(0.0) } else { speed };
        }
        output
    }

    fn run(&mut self, ticks: usize) -> GateOutput {
        (0..ticks).map(|_| self.tick()).last().expect("some ticks")
    }
}

#[test]
fn transport_alarm_stops_the_car_until_enabled_again() {
    for cause in [StopCause::SecondWriter, StopCause::ClockJump, StopCause::TransportLost] {
        let mut bench = Bench::driving();
        bench.input.alarm = Some(cause);
        let output = bench.run(1);
        assert_eq!(output.mode, GateMode::Stopping(cause));
        assert!(output.command.speed_mps == 0.0 && output.command.accel_mps2 < 0.0, "{output:?}");
        assert_eq!(bench.run(1000).mode, GateMode::Holding(cause));
        bench.input.enable = false;
        bench.run(5);
        bench.input.enable = true;
        assert_eq!(bench.run(5).mode, GateMode::Holding(cause), "nobody drives while there is one");
        (bench.input.enable, bench.input.alarm) = (false, None);
        assert_eq!(bench.run(5).mode, GateMode::Holding(cause), "its end is no act");
        bench.input.enable = true;
        assert_eq!(bench.run(5).mode, GateMode::Driving);
        (bench.input.alarm, bench.input.emergency) = (Some(cause), true);
        assert_eq!(bench.run(1).mode, GateMode::Stopping(StopCause::Emergency), "the harder one");
    }
}

#[test]
fn enabling_needs_a_rising_edge_and_valid_inputs() {
    // Held from the start: not a rising edge.
    let mut held = Bench::new();
    held.input.enable = true;
    assert!(!held.run(50).engaged);
    held.input.enable = false;
    held.run(1);
    held.input.enable = true;
    assert_eq!(held.run(1).mode, GateMode::Driving);

    // Each missing input keeps it in manual mode; restoring it after the rising edge is too late.
    type Lack = fn(&mut Bench, bool);
    let lacks: [(&str, Lack); 5] = [
        ("a command", |b, lack| b.stack = !lack),
        ("a report", |b, lack| b.vehicle = !lack),
        ("a driver at rest", |b, lack| b.report().driver_active = lack),
        ("no emergency", |b, lack| b.input.emergency = lack),
        ("a finite command", |b, lack| b.command().speed_mps = if lack { f64::NAN } else { 1.0 }),
    ];
    for (what, lack) in lacks {
        let mut bench = Bench::new();
        lack(&mut bench, true);
        bench.run(50);
        bench.input.enable = true;
        assert!(!bench.run(1).engaged, "without {what}");
        lack(&mut bench, false);
        assert!(!bench.run(50).engaged, "without {what}, later");
        bench.input.enable = false;
        bench.run(1);
        bench.input.enable = true;
        assert_eq!(bench.run(1).mode, GateMode::Driving, "with {what}");
    }
}

#[test]
fn silence_of_the_stack_is_a_controlled_stop_after_half_a_second() {
    let mut bench = Bench::driving();
    bench.stack = false;
    let silent_since = bench.now_ms;
    while bench.tick().mode == GateMode::Driving {}
    let after_ms = bench.now_ms - silent_since;
    assert!((500..=540).contains(&after_ms), "{after_ms} ms");
    let stopping = bench.run(50);
    assert_eq!(stopping.mode, GateMode::Stopping(StopCause::CommandTimeout));
    assert_eq!((stopping.command.accel_mps2, stopping.command.speed_mps), (-1.5, 0.0));
    // 10.2 m/s at 1.5 m/s² take 7 s; the stack returns in between, without effect.
    bench.stack = true;
    let at_rest = bench.run(400);
    assert_eq!(at_rest.mode, GateMode::Holding(StopCause::CommandTimeout));
    assert_eq!((at_rest.command.accel_mps2, at_rest.engaged), (-1.5, true));
    // After a new rising edge it drives on.
    bench.input.enable = false;
    bench.run(1);
    bench.input.enable = true;
    assert_eq!(bench.run(1).mode, GateMode::Driving);
}

#[test]
fn repeated_command_is_frozen_if_the_check_is_enabled() {
    let mut bench = Bench::driving();
    assert_eq!(bench.run(500).mode, GateMode::Driving, "no bound by default");

    let mut bench = Bench::driving();
    bench.gate.params.repeat_max_s = 1.0;
    // Values that change by the last bit come from a live controller.
    for _ in 0..200 {
        let accel = bench.command().accel_mps2;
        bench.command().accel_mps2 = accel.next_up();
        assert_eq!(bench.tick().mode, GateMode::Driving);
    }
    let hangs_since = bench.now_ms;
    while bench.tick().mode == GateMode::Driving {}
    let after_ms = bench.now_ms - hangs_since;
    assert!((1000..=1040).contains(&after_ms), "{after_ms} ms");
    assert_eq!(bench.run(1).mode, GateMode::Stopping(StopCause::CommandFrozen));
    // It stands, still repeats its values, and a new rising edge enables it again.
    for _ in 0..50 {
        bench.report().speed_mps = 0.0;
        bench.tick();
    }
    assert_eq!(bench.tick().mode, GateMode::Holding(StopCause::CommandFrozen));
    bench.input.enable = false;
    bench.run(1);
    bench.input.enable = true;
    bench.report().speed_mps = 0.0;
    assert_eq!(bench.tick().mode, GateMode::Driving);
    assert_eq!(bench.gate.refusals(), Refusals::default(), "none of its commands was refused");
    // A standing car may be commanded the same values indefinitely.
    let mut bench = Bench::driving();
    bench.gate.params.repeat_max_s = 2.0;
    for _ in 0..200 {
        bench.report().speed_mps = 0.0;
        assert_eq!(bench.tick().mode, GateMode::Driving);
    }
}

#[test]
fn commands_from_old_sensor_frames_are_refused_if_the_check_is_enabled() {
    let mut bench = Bench::driving();
    bench.gate.params.origin_timeout_s = 1.0;
    // A stack need not state the origin of its commands; a frame of a second ago is recent enough.
    assert_eq!(bench.run(100).mode, GateMode::Driving);
    bench.input.origin = Some(Time::from_ms(bench.now_ms));
    assert_eq!(bench.run(50).mode, GateMode::Driving);
    assert_eq!(bench.gate.refusals(), Refusals::default());
    let refused = bench.run(1);
    assert_eq!((refused.refused, refused.mode), (Some(Refusal::Stale), GateMode::Driving));
    assert_eq!(bench.run(27).mode, GateMode::Stopping(StopCause::CommandTimeout));
}

#[test]
fn car_faster_than_its_command_is_not_accelerated() {
    let mut bench = Bench::driving();
    bench.command().speed_mps = 10.0;
    bench.command().accel_mps2 = 2.0;
    bench.report().speed_mps = 11.9;
    assert!(bench.run(1).command.accel_mps2 > 0.0);
    bench.report().speed_mps = 12.1;
    assert_eq!(bench.run(1).command.accel_mps2, 0.0);
    bench.command().accel_mps2 = -2.0;
    assert_eq!(bench.run(10).command.accel_mps2, -2.0);
}

#[test]
fn several_commands_of_one_state_are_in_order() {
    let mut bench = Bench::driving();
    bench.stack = false;
    bench.command().steering_rad = 0.11;
    let output = bench.run(10);
    assert_eq!((output.refused, output.command.steering_rad), (None, 0.11));
}

#[test]
fn silence_of_the_vehicle_is_a_stop() {
    let mut bench = Bench::driving();
    bench.vehicle = false;
    assert_eq!(bench.run(30).mode, GateMode::Stopping(StopCause::ReportTimeout));
    // Without reports, standstill cannot be detected.
    assert_eq!(bench.run(500).mode, GateMode::Stopping(StopCause::ReportTimeout));
}

#[test]
fn driver_takes_over_at_once_and_permanently() {
    let modes: [fn(&mut Bench); 3] = [|_| {}, |b| b.stack = false, |b| b.input.emergency = true];
    for prepare in modes {
        let mut bench = Bench::driving();
        prepare(&mut bench);
        bench.run(40);
        bench.report().driver_active = true;
        let taken = bench.tick();
        assert_eq!((taken.mode, taken.engaged), (GateMode::Manual, false));
        bench.report().driver_active = false;
        (bench.stack, bench.input.emergency) = (true, false);
        assert!(!bench.run(100).engaged, "the switch was never released");
        bench.input.enable = false;
        bench.run(1);
        bench.input.enable = true;
        assert_eq!(bench.run(1).mode, GateMode::Driving);
    }
}

#[test]
fn emergency_brakes_at_once_and_is_not_cancelled() {
    let mut bench = Bench::driving();
    bench.input.emergency = true;
    assert_eq!(bench.run(400).mode, GateMode::Holding(StopCause::Emergency), "held as long as it is pressed");
    let mut bench = Bench::driving();
    bench.input.emergency = true;
    let first = bench.tick();
    assert_eq!(first.mode, GateMode::Stopping(StopCause::Emergency));
    assert_eq!((first.command.accel_mps2, first.command.speed_mps), (-5.0, 0.0));
    bench.input.emergency = false;
    bench.input.enable = false;
    bench.run(1);
    bench.input.enable = true;
    assert_eq!(bench.run(1).mode, GateMode::Stopping(StopCause::Emergency));
    assert_eq!(bench.run(200).mode, GateMode::Holding(StopCause::Emergency));
}

#[test]
fn releasing_the_switch_is_a_stop() {
    let mut bench = Bench::driving();
    bench.input.enable = false;
    assert_eq!(bench.run(1).mode, GateMode::Stopping(StopCause::Released));
}

#[test]
fn stop_never_brakes_less_than_commanded() {
    let mut bench = Bench::driving();
    bench.report().speed_mps = 20.0;
    bench.command().accel_mps2 = -6.0;
    assert_eq!(bench.run(20).command.accel_mps2, -6.0);
    bench.stack = false;
    let stopping = bench.run(40);
    assert_eq!(stopping.mode, GateMode::Stopping(StopCause::CommandTimeout));
    assert_eq!(stopping.command.accel_mps2, -6.0);
}

#[test]
fn a_stop_brakes_as_hard_as_the_plan_before_it() {
    let mut bench = Bench::driving();
    (bench.report().speed_mps, bench.report().steering_rad) = (20.0, 0.0);
    (bench.command().accel_mps2, bench.command().steering_rad) = (0.0, 0.0);
    let silent_ms = bench.now_ms;
    // Constant speed for 2 s, then 6 m/s² and, near standstill, 2 m/s².
    let point = |k: i64| swerve_msg::PlanPoint {
        at: Time::from_ms(silent_ms + 100 * k),
        pose: swerve_geom::Pose2::new(2.0 * k as f64, 0.0, 0.0),
        accel_mps2: match k {
            ..20 => 0.0,
            20..50 => -6.0,
            _ => -2.0,
        },
        ..swerve_msg::PlanPoint::default()
    };
    bench.input.plan =
        Some(Box::leak(Box::new(Plan { points: (0..80).map(point).collect(), ..Plan::default() })));
    bench.input.pose =
        Some(EgoState { stamp: Time::from_ms(silent_ms), speed_mps: 20.0, ..EgoState::default() });
    bench.stack = false;
    let stopping = bench.run(80);
    assert_eq!(stopping.mode, GateMode::Stopping(StopCause::CommandTimeout));
    assert_eq!(stopping.command.accel_mps2, -1.5, "by itself");
    assert_eq!(bench.run(60).command.accel_mps2, -6.0, "as planned");
    assert_eq!(bench.run(80).command.accel_mps2, -6.0, "and no less");
    bench.input.emergency = true;
    assert_eq!(
        bench.tick().command.accel_mps2,
        -6.0,
        "an emergency stop brakes with 5, and no less than before"
    );
}

#[test]
fn unsound_commands_are_refused_and_counted() {
    type Spoil = fn(&mut MotionCommand, Time);
    let spoils: [(Refusal, Spoil); 6] = [
        (Refusal::NotFinite, |c, _| c.steering_rad = f64::NAN),
        (Refusal::NotFinite, |c, _| c.speed_mps = f64::INFINITY),
        (Refusal::NotFinite, |c, _| c.accel_mps2 = f64::NEG_INFINITY),
        (Refusal::OutOfOrder, |c, now| c.stamp = now - Span::from_ms(300)),
        (Refusal::Ahead, |c, now| c.stamp = now + Span::from_ms(300)),
        (Refusal::Ahead, |c, _| c.stamp = Time::MAX),
    ];
    for (wanted, spoil) in spoils {
        let mut bench = Bench::driving();
        let before = bench.run(30).command;
        bench.stack = false;
        bench.now_ms += TICK_MS;
        let now = Time::from_ms(bench.now_ms);
        (bench.input.now, bench.report().stamp, bench.command().stamp) = (now, now, now);
        bench.command().steering_rad = -0.3;
        spoil(bench.command(), now);
        let output = bench.gate.step(&bench.input);
        assert_eq!((output.refused, output.mode), (Some(wanted), GateMode::Driving));
        assert_eq!(output.command.steering_rad, before.steering_rad, "the command before it counts");
        // The repeated command is not counted again, and times out like silence.
        let later = bench.run(30);
        assert_eq!(later.mode, GateMode::Stopping(StopCause::CommandTimeout));
        let counts = bench.gate.refusals();
        assert_eq!(counts.not_finite + counts.out_of_order + counts.stale + counts.ahead, 1, "{wanted:?}");
    }
    // Too old on arrival.
    let mut bench = Bench::new();
    bench.stack = false;
    bench.command().stamp = Time::from_ms(100);
    bench.now_ms = 1000;
    assert_eq!(bench.tick().refused, Some(Refusal::Stale));
}

#[test]
fn commands_beyond_the_limits_are_clamped() {
    let mut bench = Bench::driving();
    *bench.command() =
        MotionCommand { stamp: Time::ZERO, steering_rad: 3.0, speed_mps: 90.0, accel_mps2: 30.0 };
    let first = bench.tick();
    assert!(first.limited);
    // 0.7 rad/s for 20 ms, from 0.1 rad; 40 m/s³ for 20 ms, from 0.5 m/s².
    let before = 0.7 * 0.02 * 5.0;
    assert!(
        first.command.steering_rad <= before + 0.7 * 0.02 + 1e-9 && first.command.accel_mps2 <= 1.3 + 1e-9
    );
    assert_eq!(first.command.speed_mps, 25.0);
    bench.report().speed_mps = 10.0;
    let later = bench.run(60);
    assert_eq!(later.command.accel_mps2, 3.0);
    // At speed v, a car without slip may turn by atan(a L / v²).
    let v = bench.report().speed_mps;
    let most = math::atan(5.0 * 2.85 / (v * v));
    assert!((later.command.steering_rad / most - 1.0).abs() < 0.02, "{} {most}", later.command.steering_rad);
    bench.report().speed_mps = 26.0;
    assert!(bench.run(1).command.accel_mps2 <= 0.0, "it is too fast already");
}

#[test]
fn a_car_that_rolls_backwards_is_stopped_by_the_brake() {
    let mut bench = Bench::driving();
    bench.stack = false;
    for _ in 0..40 {
        bench.report().speed_mps = -3.0;
        bench.tick();
    }
    bench.report().speed_mps = -3.0;
    let stopping = bench.tick();
    assert_eq!(stopping.mode, GateMode::Stopping(StopCause::CommandTimeout));
    assert_eq!((stopping.command.accel_mps2, stopping.command.speed_mps), (-1.5, 0.0));
    // The same pedals as forwards: a brake acts against the rotation of the wheels.
    let vehicle = VehicleParams::default();
    assert_eq!(pedals(&vehicle, &stopping, -3.0), pedals(&vehicle, &stopping, 3.0));
}

#[test]
fn the_heartbeat_counts_every_call_and_wraps() {
    let mut bench = Bench::new();
    assert_eq!((bench.tick().heartbeat, bench.tick().heartbeat), (1, 2));
    assert_eq!((bench.run(65_533).heartbeat, bench.tick().heartbeat), (65_535, 0));
}

#[test]
fn parameters_out_of_range_are_named() {
    let wrong = GateParams { stop_decel_mps2: f64::NAN, ..GateParams::default() };
    let error = SafetyGate::new(wrong).unwrap_err();
    assert_eq!(error.to_string(), "`stop_decel_mps2` is NaN, expected 0.1 to 20");
    assert!(SafetyGate::new(GateParams { command_timeout_s: 0.0, ..GateParams::default() }).is_err());
}

#[test]
fn a_lost_pose_stops_the_car_at_once() {
    let mut bench = Bench::driving();
    let quality = |mode| Some(PoseQuality { mode, ..PoseQuality::default() });
    for mode in [PoseMode::Good, PoseMode::Coasting] {
        bench.input.quality = quality(mode);
        assert_eq!(bench.run(50).mode, GateMode::Driving, "{mode:?}");
    }
    bench.input.quality = quality(PoseMode::Lost);
    let stopping = bench.run(1);
    assert_eq!(stopping.mode, GateMode::Stopping(StopCause::PoseLost));
    assert!(stopping.command.accel_mps2 < 0.0);
    // After recovery it still comes to a standstill; the switch lets it drive on.
    bench.input.quality = quality(PoseMode::Good);
    assert_eq!(bench.run(500).mode, GateMode::Holding(StopCause::PoseLost));
    bench.input.enable = false;
    bench.run(1);
    bench.input.enable = true;
    assert_eq!(bench.run(1).mode, GateMode::Driving);
}

#[test]
fn pose_that_moves_unlike_the_wheels_stops_the_car() {
    let mut bench = Bench::driving();
    bench.gate.params.lane_margin_m = 0.8;
    bench.report().steering_rad = 0.0;
    bench.command().steering_rad = 0.0;
    bench.command().accel_mps2 = 0.0;
    let pose = |bench: &Bench, x_m: f64| {
        let stamp = Time::from_ms(bench.now_ms + TICK_MS);
        Some(EgoState { stamp, pose: swerve_geom::Pose2::new(x_m, 0.0, 0.0), ..EgoState::default() })
    };
    for tick in 0..100 {
        bench.input.pose = pose(&bench, 0.2 * f64::from(tick));
        assert_eq!(bench.tick().mode, GateMode::Driving, "{tick}");
    }
    bench.input.pose = pose(&bench, 22.0);
    assert_eq!(bench.tick().mode, GateMode::Stopping(StopCause::PoseImplausible), "2 m further");
}
