//! Fault tests: drives over a test wire with a simulated car at its other end.

use core::time::Duration;
use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::AtomicU64;
use std::sync::{Condvar, MutexGuard};

use swerve_flow::{Context, Every, Operator, every};
use swerve_geom::{Point2, Vector2, math};
use swerve_msg::{
    ActorId, ActorKind, EgoState, Extent, GateMode, Gnss, Imu, MotionCommand, Plan, PredictionList,
    SensorHealth, StopCause, Track, TrackList,
};
use swerve_ros2::bridge::TopicStatistics;
use swerve_ros2::convert::{Epoch, control_from_ros, ego_to_ros, gnss_to_ros, imu_to_ros, objects_to_ros};
use swerve_ros2::mapping::Role;
use swerve_ros2::msg::autoware_vehicle_msgs::{ControlModeReport, SteeringReport, VelocityReport};
use swerve_ros2::msg::std_msgs::Bool;
use swerve_ros2::samples::sample;
use swerve_ros2::{AnyMessage, Kind};

use super::intake::TopicSummary;
use super::shared::lock;
use super::wire::{Sent, Taken};
use super::*;

mod carla;
mod played;

/// A car with Autoware's interface, and the wire to it. Waiting for messages advances it.
struct Lane {
    state: Mutex<LaneState>,
    news: Condvar,
    clock: HostClock,
    sent: AtomicU64,
    /// Modifies the messages of each round before they are delivered.
    spoil: Spoil,
}

type Spoil = fn(f64, &mut Vec<(&'static str, AnyMessage)>);

#[derive(Default)]
struct LaneState {
    ego: EgoState,
    engaged: bool,
    command: Option<(Time, MotionCommand)>,
    waiting: VecDeque<(&'static str, AnyMessage, i64)>,
    moved: Time,
    /// Received commands, with the car's speed at that instant.
    commands: Vec<(Time, MotionCommand, f64)>,
    /// Instant from which it ignores commands, and its acceleration then, m/s².
    ignores: Option<(f64, f64)>,
}

/// Period of rounds of messages.
const ROUND: Span = Span::from_ms(20);

impl Lane {
    fn new(clock: HostClock, speed_mps: f64, spoil: Spoil) -> Self {
        let ego = EgoState { speed_mps, ..EgoState::default() };
        let state = LaneState { ego, ..LaneState::default() };
        Self { state: Mutex::new(state), news: Condvar::new(), clock, sent: AtomicU64::new(0), spoil }
    }

    fn lock(&self) -> MutexGuard<'_, LaneState> {
        lock(&self.state)
    }

    /// Advances the car to the present and publishes its reports.
    fn advance(&self) {
        let now = self.clock.now();
        let mut state = self.lock();
        while state.moved.saturating_add(ROUND) <= now {
            state.moved += ROUND;
            state.step(self.clock.epoch_ns(), self.spoil);
        }
    }
}

impl LaneState {
    fn step(&mut self, epoch_ns: i64, spoil: Spoil) {
        let (dt, now) = (ROUND.as_secs(), self.moved);
        let young = self.command.filter(|(at, _)| now - *at < Span::from_ms(200));
        // Without commands it brakes by itself; when not engaged it rolls.
        let (steering_rad, accel) = match (self.engaged, young) {
            (false, _) => (self.ego.steering_rad, 0.0),
            (true, Some((_, command))) => (command.steering_rad, command.accel_mps2),
            (true, None) => (self.ego.steering_rad, -3.0),
        };
        let ignores = self.ignores.filter(|(from_s, _)| now.as_secs() >= *from_s);
        let accel = ignores.map_or(accel, |(_, accel)| accel);
        let ego = &mut self.ego;
        ego.stamp = now;
        ego.steering_rad = steering_rad;
        ego.speed_mps = (ego.speed_mps + accel * dt).max(0.0);
        ego.yaw_rate_radps = ego.speed_mps * math::tan(steering_rad) / 2.85;
        let (sin, cos) = math::sin_cos(ego.pose.heading_rad);
        ego.pose.x_m += ego.speed_mps * cos * dt;
        ego.pose.y_m += ego.speed_mps * sin * dt;
        ego.pose.heading_rad += ego.yaw_rate_radps * dt;
        let epoch = Epoch { ns: epoch_ns };
        let stamp = epoch.stamp(now);
        let velocity = VelocityReport {
            header: epoch.header(now, "base_link"),
            longitudinal_velocity: ego.speed_mps as f32,
            lateral_velocity: 0.0,
            heading_rate: ego.yaw_rate_radps as f32,
        };
        let steering = SteeringReport { stamp, steering_tire_angle: steering_rad as f32 };
        let mode = if self.engaged { ControlModeReport::AUTONOMOUS } else { ControlModeReport::MANUAL };
        let mut round = vec![
            ("odometry", AnyMessage::Odometry(ego_to_ros(ego, epoch, "map", "base_link"))),
            ("velocity", AnyMessage::VelocityReport(velocity)),
            ("steering", AnyMessage::SteeringReport(steering)),
            ("control_mode", AnyMessage::ControlModeReport(ControlModeReport { stamp, mode })),
        ];
        spoil(now.as_secs(), &mut round);
        let received_ns = epoch_ns + now.ns();
        self.waiting.extend(round.into_iter().map(|(name, message)| (name, message, received_ns)));
    }
}

impl Wire for Lane {
    fn wait(&self, timeout: Duration) -> bool {
        self.advance();
        let state = self.lock();
        let left = self.news.wait_timeout_while(state, timeout, |state| state.waiting.is_empty());
        left.is_ok_and(|(_, result)| !result.timed_out())
    }

    fn take(&self) -> Option<Taken<'_>> {
        let (name, message, received_ns) = self.lock().waiting.pop_front()?;
        Some(Taken { name, message, received_ns })
    }

    fn send(&self, _: Role, message: AnyMessage) -> Sent {
        self.sent.fetch_add(1, Ordering::Relaxed);
        let now = self.clock.now();
        let mut state = self.lock();
        match message {
            AnyMessage::Engage(engage) => state.engaged = engage.engage,
            AnyMessage::Control(control) => {
                let epoch = Epoch { ns: self.clock.epoch_ns() };
                let command = control_from_ros(&control, epoch);
                let speed_mps = state.ego.speed_mps;
                state.command = Some((now, command));
                state.commands.push((now, command, speed_mps));
            }
            _ => {}
        }
        Sent::Done
    }

    fn ask_mode(&self, _: u8, _: Duration) -> Result<bool, String> {
        Ok(true)
    }

    fn statistics(&self) -> Vec<TopicStatistics> {
        Vec::new()
    }
}

/// Ignores all reports.
struct Quiet;

impl StatusSink for Quiet {
    fn progress(&mut self, _: &str) {}
    fn note(&mut self, _: Time, _: &str) {}
}

fn configuration() -> Drive {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live/autoware.toml"));
    Drive::load(&Registry::standard(), file, &[("live.enable".into(), "at_start".into())]).unwrap()
}

#[test]
fn vehicle_that_only_observes_need_not_follow_commands() {
    let ignored_after_s = |name: &str| {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live"));
        let file = folder.join(name).with_extension("toml");
        let drive = Drive::load(&Registry::standard(), &file, &[]).unwrap();
        let assembly = LiveGraph::build(&drive.config, &drive.scenario).unwrap().pipeline.assembly;
        let gate = assembly.publisher::<GateOutput>().and_then(|gate| assembly.operator(gate));
        gate.unwrap().resolved.gate.ignored_after_s
    };
    assert_eq!(["plain", "autoware", "dataspeed"].map(ignored_after_s), [0.0, 1.0, 1.0]);
}

/// Panics at this instant.
struct Bomb(Time);

impl Operator for Bomb {
    type In = Every;
    type Out = ();
    fn step(&mut self, cx: &mut Context<'_>, _: &Every, _: &mut ()) {
        assert!(cx.stamp() < self.0, "on purpose");
    }
}

/// Drives for some seconds, starting at 3 m/s.
fn ride(seconds: f64, bomb_s: Option<f64>, spoil: Spoil) -> (Driven, LaneState) {
    ride_with(seconds, bomb_s, spoil, None)
}

/// As `ride`, with a car that ignores commands from an instant on and keeps an acceleration.
fn ride_with(
    seconds: f64,
    bomb_s: Option<f64>,
    spoil: Spoil,
    ignores: Option<(f64, f64)>,
) -> (Driven, LaneState) {
    let drive = configuration();
    let mut graph = LiveGraph::build(&drive.config, &drive.scenario).unwrap();
    if let Some(at_s) = bomb_s {
        let bomb = Bomb(Time::ZERO + Span::from_secs(at_s));
        graph.pipeline.graph.add("bomb", bomb, every(Span::from_ms(50))).out();
    }
    let clock = HostClock::start();
    let lane = Lane::new(clock, 3.0, spoil);
    lane.lock().ignores = ignores;
    let until = Some(Time::ZERO + Span::from_secs(seconds));
    let flags = ControlFlags::default();
    let options = DriveOptions { until, threads: 2, status_sink: Box::new(Quiet), flags: &flags };
    let driven = drive_graph(&drive, graph, &lane, options, &mut [], clock.into()).unwrap();
    lane.advance();
    (driven, lane.state.into_inner().unwrap())
}

/// Asserts that all commands are finite and within the car's capabilities.
fn assert_sane(lane: &LaneState) {
    for (at, command, _) in &lane.commands {
        let MotionCommand { steering_rad, speed_mps, accel_mps2, .. } = *command;
        let sane =
            steering_rad.abs() <= 0.62 && (0.0..=30.0).contains(&speed_mps) && accel_mps2.abs() <= 13.0;
        assert!(sane, "{at:?}: {command:?}");
    }
}

fn modes(driven: &Driven) -> Vec<GateMode> {
    driven.figures.modes.iter().map(|change| change.mode).collect()
}

#[test]
#[ignore = "real clock"]
fn nominal_drive_ends_at_rest_and_released() {
    let (driven, lane) = ride(3.0, None, |_, _| {});
    assert!(driven.report.is_ok());
    assert_sane(&lane);
    assert_eq!(driven.feed.why, "the time limit was reached");
    let released = StopCause::Released;
    let expected =
        [GateMode::Manual, GateMode::Driving, GateMode::Stopping(released), GateMode::Holding(released)];
    assert_eq!(modes(&driven), expected);
    assert_eq!((lane.ego.speed_mps, lane.engaged), (0.0, false));
    assert_eq!(driven.feed.reasons[0].2, "the time limit was reached");
    assert!(driven.figures.driven_m > 5.0 && driven.figures.beside_max_m < 0.2, "{:?}", driven.figures);
    assert_eq!(driven.figures.refused.total(), 0);
}

#[test]
#[ignore = "real clock"]
fn takeover_by_the_driver_silences_the_commands() {
    let (driven, lane) = ride(4.0, None, |t, round| {
        for (_, message) in round {
            if let AnyMessage::ControlModeReport(report) = message
                && t > 2.0
            {
                report.mode = ControlModeReport::MANUAL;
            }
        }
    });
    assert_eq!(modes(&driven), [GateMode::Manual, GateMode::Driving, GateMode::Manual]);
    let last = lane.commands.last().unwrap().0;
    assert!(last > Time::from_ms(1900) && last < Time::from_ms(2200), "{last:?}");
}

#[test]
#[ignore = "real clock"]
fn car_that_ignores_commands_is_noticed_and_a_person_is_asked_to_take_over() {
    let (driven, lane) = ride_with(12.0, None, |_, _| {}, Some((2.0, 2.5)));
    let stopping = |mode: &GateMode| match mode {
        GateMode::Stopping(cause) => Some(*cause),
        _ => None,
    };
    assert_eq!(
        modes(&driven).iter().find_map(stopping),
        Some(StopCause::AccelDeviation),
        "{:?}",
        modes(&driven)
    );
    let (at, _, reason) = &driven.feed.reasons[0];
    assert!(
        reason.contains("m/s² commanded, 2.5 m/s² measured at") && reason.ends_with("take over"),
        "{reason}"
    );
    // It is braked from then on, without effect.
    let later = lane.commands.iter().filter(|(sent, ..)| *sent > *at + Span::from_ms(1500));
    assert!(later.clone().count() > 100 && later.clone().all(|(_, c, _)| c.accel_mps2 <= -2.9), "{at:?}");
}

#[test]
#[ignore = "real clock"]
fn car_beside_the_ground_is_not_taken_over() {
    let (driven, lane) = ride(3.0, None, |_, round| {
        for (_, message) in round {
            if let AnyMessage::Odometry(odometry) = message {
                odometry.pose.pose.position.y += 12.0;
            }
        }
    });
    assert_eq!(modes(&driven), [GateMode::Manual]);
    assert!(driven.feed.was_ready && !lane.engaged);
}

#[test]
#[ignore = "real clock"]
fn panic_in_the_stack_leads_to_a_stop() {
    let (driven, lane) = ride(20.0, Some(2.0), |_, _| {});
    let error = driven.report.expect_err("it panics").to_string();
    assert!(error.contains("operator `bomb` panicked: on purpose"), "{error}");
    assert_sane(&lane);
    assert_eq!(driven.sink.stood_at_end, Some(true), "{:?}", driven.sink);
    assert_eq!((lane.ego.speed_mps, lane.engaged), (0.0, false));
    // The car was commanded to stop throughout: its own time-out never acted.
    let gaps = lane.commands.windows(2).map(|pair| pair[1].0 - pair[0].0);
    assert!(gaps.max().unwrap() < Span::from_ms(200));
    let mut braking =
        lane.commands.iter().filter(|(_, command, speed)| command.speed_mps == 0.0 && *speed > 0.5);
    assert!(braking.clone().count() > 20);
    assert!(braking.next_back().unwrap().1.accel_mps2 <= -1.4);
}

#[test]
#[ignore = "real clock"]
fn silent_vehicle_reports_lead_to_a_commanded_stop() {
    let (driven, lane) = ride(5.0, None, |t, round| {
        if t > 2.0 {
            round.retain(|(name, _)| *name == "odometry");
        }
    });
    assert!(modes(&driven).contains(&GateMode::Stopping(StopCause::ReportTimeout)), "{:?}", modes(&driven));
    assert_eq!(lane.ego.speed_mps, 0.0);
    assert!(lane.commands.iter().any(|(at, ..)| *at > Time::from_ms(4500)), "somebody goes on commanding");
    // Its standstill is unknown, so it is not released; its own time-out holds it.
    assert_eq!((driven.sink.stood_at_end, lane.engaged), (Some(false), true));
}

#[test]
#[ignore = "real clock"]
fn silent_localization_leads_to_a_stop() {
    let (driven, lane) = ride(5.0, None, |t, round| {
        if t > 2.0 {
            round.retain(|(name, _)| *name != "odometry");
        }
    });
    let stopping = GateMode::Stopping(StopCause::CommandTimeout);
    assert!(modes(&driven).contains(&stopping), "{:?}", modes(&driven));
    let reason = &driven.feed.reasons[0].2;
    assert!(reason.starts_with("no sound command: no odometry for 0."), "{reason}");
    let at_s = driven.figures.modes.iter().find(|change| change.mode == stopping).unwrap().at_s;
    assert!((2.0..3.0).contains(&at_s), "{at_s}");
    assert_eq!((lane.ego.speed_mps, lane.engaged), (0.0, false));
}

#[test]
#[ignore = "real clock"]
fn implausible_messages_are_counted_and_commands_stay_sane() {
    let (driven, lane) = ride(4.0, None, |t, round| {
        if t < 1.0 {
            return;
        }
        for (name, message) in round.clone() {
            match message {
                // In addition to each message: one with a NaN, one of another sensor, one from yesterday, and one
                // from tomorrow.
                AnyMessage::VelocityReport(mut velocity) => {
                    let own = velocity.header.stamp;
                    for seconds in [-86_400, 86_400] {
                        velocity.header.stamp.sec = own.sec + seconds;
                        round.push((name, AnyMessage::VelocityReport(velocity.clone())));
                    }
                    velocity.header.stamp = own;
                    velocity.longitudinal_velocity = f32::NAN;
                    round.push((name, AnyMessage::VelocityReport(velocity)));
                }
                AnyMessage::Odometry(mut odometry) => {
                    odometry.pose.pose.position.x = 5.0e180;
                    round.push((name, AnyMessage::Odometry(odometry.clone())));
                    odometry.pose.pose.position.x = 1.0;
                    odometry.header.frame_id = "odom".into();
                    round.push((name, AnyMessage::Odometry(odometry)));
                    round.push((name, AnyMessage::Bool(Bool::default())));
                }
                _ => {}
            }
        }
    });
    assert_sane(&lane);
    assert_eq!((lane.ego.speed_mps, lane.engaged), (0.0, false));
    let tally =
        |wanted: &str| driven.feed.intake.tallies().find(|topic| topic.name == wanted).unwrap().tally.clone();
    let (velocity, odometry) = (tally("velocity").refused, tally("odometry").refused);
    assert!(velocity.implausible > 100 && velocity.behind > 100 && velocity.ahead > 100, "{velocity:?}");
    assert!(odometry.implausible > 100 && odometry.not_usable > 100, "{odometry:?}");
    assert!(driven.figures.driving_s > 2.5 && driven.figures.beside_max_m < 0.3, "{:?}", driven.figures);
}

#[test]
#[ignore = "real clock"]
fn message_flood_does_not_stop_the_drive() {
    // 1,000 messages per second on a topic with a nominal 50, each slightly newer.
    let (driven, lane) = ride(3.0, None, |t, round| {
        let AnyMessage::Odometry(odometry) = round[0].1.clone() else { return };
        if t > 1.0 {
            for _ in 0..20 {
                let mut more = odometry.clone();
                more.header.stamp.nanosec = more.header.stamp.nanosec.saturating_sub(1);
                round.push(("odometry", AnyMessage::Odometry(more)));
            }
        }
    });
    assert!(driven.report.is_ok());
    assert_sane(&lane);
    assert_eq!((lane.ego.speed_mps, lane.engaged, driven.feed.not_taken), (0.0, false, 0));
    let odometry = driven.feed.intake.tallies().find(|topic| topic.name == "odometry").unwrap().tally;
    assert!(odometry.refused.backwards > 1000, "{odometry:?}");
}

#[test]
#[ignore = "real clock"]
fn clock_jump_is_followed_and_the_car_keeps_its_lane() {
    let (driven, lane) = ride(4.0, None, |t, round| {
        if t > 2.0 {
            for (_, message) in round {
                match message {
                    AnyMessage::VelocityReport(m) => m.header.stamp.sec += 3600,
                    AnyMessage::SteeringReport(m) => m.stamp.sec += 3600,
                    AnyMessage::ControlModeReport(m) => m.stamp.sec += 3600,
                    AnyMessage::Odometry(m) => m.header.stamp.sec += 3600,
                    _ => {}
                }
            }
        }
    });
    assert_sane(&lane);
    let heard = driven.feed.intake.tallies().filter(|topic| topic.tally.received > 0);
    for TopicSummary { name, tally, clock, .. } in heard {
        assert_eq!((tally.refused.ahead, clock.offset().unwrap().jumps), (4, 1), "{name}");
    }
    // Four rounds without a message are 80 ms, which is no reason to stop.
    assert!(driven.figures.driving_s > 3.0, "{:?}", driven.figures);
}
