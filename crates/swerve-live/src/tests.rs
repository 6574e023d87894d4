//! Drives over a wire that is made here, with a car at its other end: what happens when something breaks.

use core::time::Duration;
use std::collections::VecDeque;
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

use super::intake::{TopicSummary, lock};
use super::wire::{Sent, Taken};
use super::*;

/// A car with Autoware's interface and the wire to it. It is moved by whoever waits for messages.
struct Lane {
    state: Mutex<LaneState>,
    news: Condvar,
    clock: HostClock,
    sent: AtomicU64,
    /// The change that is made to the messages of each round before they are there.
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
    /// Commands that came, with the speed that the car had.
    commands: Vec<(Time, MotionCommand, f64)>,
}

/// Between two rounds of messages.
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

    /// Moves the car on to the present and has it say how it is.
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
        // Without commands it brakes by itself, without an engagement it rolls.
        let (steering_rad, accel) = match (self.engaged, young) {
            (false, _) => (self.ego.steering_rad, 0.0),
            (true, Some((_, command))) => (command.steering_rad, command.accel_mps2),
            (true, None) => (self.ego.steering_rad, -3.0),
        };
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

/// Says nothing.
struct Quiet;

impl StatusSink for Quiet {
    fn progress(&mut self, _: &str) {}
    fn note(&mut self, _: Time, _: &str) {}
}

fn configuration() -> Drive {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live/autoware.toml"));
    Drive::load(&Registry::standard(), file, &[("live.enable".into(), "at_start".into())]).unwrap()
}

/// Panics at a tick.
struct Bomb(Time);

impl Operator for Bomb {
    type In = Every;
    type Out = ();
    fn step(&mut self, cx: &mut Context<'_>, _: &Every, _: &mut ()) {
        assert!(cx.stamp() < self.0, "on purpose");
    }
}

/// Drives for some seconds, beginning at 3 m/s.
fn ride(seconds: f64, bomb_s: Option<f64>, spoil: Spoil) -> (Driven, LaneState) {
    let drive = configuration();
    let mut graph = LiveGraph::build(&drive.config, &drive.scenario).unwrap();
    if let Some(at_s) = bomb_s {
        let bomb = Bomb(Time::ZERO + Span::from_secs(at_s));
        graph.pipeline.graph.add("bomb", bomb, every(Span::from_ms(50))).out();
    }
    let clock = HostClock::start();
    let lane = Lane::new(clock, 3.0, spoil);
    let until = Some(Time::ZERO + Span::from_secs(seconds));
    let flags = ControlFlags::default();
    let options = DriveOptions { until, threads: 2, status_sink: Box::new(Quiet), flags: &flags };
    let driven = drive_graph(&drive, graph, &lane, options, &mut [], clock).unwrap();
    lane.advance();
    (driven, lane.state.into_inner().unwrap())
}

/// All commands are numbers, within what a car can do.
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
fn a_sound_drive_ends_at_rest_and_released() {
    let (driven, lane) = ride(3.0, None, |_, _| {});
    assert!(driven.report.is_ok());
    assert_sane(&lane);
    assert_eq!(driven.feed.why, "the time limit was reached");
    let released = StopCause::Released;
    let expected =
        [GateMode::Manual, GateMode::Driving, GateMode::Stopping(released), GateMode::Holding(released)];
    assert_eq!(modes(&driven), expected);
    assert_eq!((lane.ego.speed_mps, lane.engaged), (0.0, false));
    assert!(driven.figures.driven_m > 5.0 && driven.figures.beside_max_m < 0.2, "{:?}", driven.figures);
    assert_eq!(driven.figures.refused.total(), 0);
}

#[test]
#[ignore = "real clock"]
fn a_panic_in_the_stack_is_a_stop_and_not_the_last_command() {
    let (driven, lane) = ride(20.0, Some(2.0), |_, _| {});
    let error = driven.report.expect_err("it panics").to_string();
    assert!(error.contains("operator `bomb` panicked: on purpose"), "{error}");
    assert_sane(&lane);
    assert_eq!(driven.sink.stood_at_end, Some(true), "{:?}", driven.sink);
    assert_eq!((lane.ego.speed_mps, lane.engaged), (0.0, false));
    // The car was commanded to stop all the way: its own time-out had nothing to do.
    let gaps = lane.commands.windows(2).map(|pair| pair[1].0 - pair[0].0);
    assert!(gaps.max().unwrap() < Span::from_ms(200));
    let mut braking =
        lane.commands.iter().filter(|(_, command, speed)| command.speed_mps == 0.0 && *speed > 0.5);
    assert!(braking.clone().count() > 20);
    assert!(braking.next_back().unwrap().1.accel_mps2 <= -1.4);
}

#[test]
#[ignore = "real clock"]
fn silence_of_the_reports_is_a_stop_and_commands_go_on() {
    let (driven, lane) = ride(5.0, None, |t, round| {
        if t > 2.0 {
            round.retain(|(name, _)| *name == "odometry");
        }
    });
    assert!(modes(&driven).contains(&GateMode::Stopping(StopCause::ReportTimeout)), "{:?}", modes(&driven));
    assert_eq!(lane.ego.speed_mps, 0.0);
    assert!(lane.commands.iter().any(|(at, ..)| *at > Time::from_ms(4500)), "somebody goes on commanding");
    // Nobody knows that it stands: it is not released, its own time-out holds it.
    assert_eq!((driven.sink.stood_at_end, lane.engaged), (Some(false), true));
}

#[test]
#[ignore = "real clock"]
fn silence_of_localization_is_a_stop() {
    let (driven, lane) = ride(5.0, None, |t, round| {
        if t > 2.0 {
            round.retain(|(name, _)| *name != "odometry");
        }
    });
    let stopping = GateMode::Stopping(StopCause::CommandTimeout);
    assert!(modes(&driven).contains(&stopping), "{:?}", modes(&driven));
    let at_s = driven.figures.modes.iter().find(|change| change.mode == stopping).unwrap().at_s;
    assert!((2.0..3.0).contains(&at_s), "{at_s}");
    assert_eq!((lane.ego.speed_mps, lane.engaged), (0.0, false));
}

#[test]
#[ignore = "real clock"]
fn what_is_not_plausible_is_counted_and_the_commands_stay_sane() {
    let (driven, lane) = ride(4.0, None, |t, round| {
        if t < 1.0 {
            return;
        }
        for (name, message) in round.clone() {
            match message {
                // Beside each message one with a number that is none, one of another sensor, one of yesterday, and
                // one of tomorrow.
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
fn a_flood_is_lived_through() {
    // 1,000 messages a second of a topic that has 50, each a little newer.
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
fn a_clock_that_is_set_is_followed_and_the_car_stays_on_its_lane() {
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
    // Four rounds without a message are 80 ms: nobody has to stop for that.
    assert!(driven.figures.driving_s > 3.0, "{:?}", driven.figures);
}

/// Runs a recorded drive with the configuration of this name, in virtual time.
fn recorded(name: &str, messages: &[(i64, &str, AnyMessage)], until: Time) -> Seen {
    recorded_with(name, &[], messages, until)
}

/// The same with a key set.
fn recorded_with(
    name: &str,
    sets: &[(String, toml::Value)],
    messages: &[(i64, &str, AnyMessage)],
    until: Time,
) -> Seen {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live"));
    let drive = Drive::load(&Registry::standard(), &folder.join(name).with_extension("toml"), sets).unwrap();
    let interface = vehicle::interface(drive.mapping.vehicle, &drive.config);
    let mut intake = Intake::new(&drive.mapping, interface, &drive.config, EPOCH_NS);
    let mut arrived = Vec::new();
    for (ms, name, message) in messages {
        intake.take(name, message, Time::from_ms(*ms), &mut arrived);
    }
    for TopicSummary { name, tally, .. } in intake.tallies() {
        assert_eq!(tally.refused.total(), 0, "{name}: {:?}", tally.last_refusal);
    }
    let LiveGraph { pipeline: Pipeline { mut graph, .. }, .. } =
        LiveGraph::build(&drive.config, &drive.scenario).unwrap();
    for source in graph.sources().map(str::to_owned).collect::<Vec<_>>() {
        let own = arrived.iter().filter(|arrived| arrived.source() == source);
        graph.playback(&source, own.cloned().map(intake::Arrived::record).collect()).unwrap();
    }
    let mut seen = Seen::default();
    swerve_flow::run_virtual(graph, &RunOptions::until(until), vec![&mut seen]).unwrap();
    seen
}

#[derive(Default)]
struct Seen {
    health: Vec<(String, SensorHealth)>,
    commands: Vec<MotionCommand>,
    plans: Vec<Plan>,
    poses: Vec<EgoState>,
}

impl Observer for Seen {
    fn event(&mut self, event: &swerve_flow::Event<'_>) {
        let swerve_flow::Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(health) = payload.downcast_ref::<SensorHealth>() {
            self.health.push((publication.operator.to_owned(), *health));
        } else if let Some(plan) = payload.downcast_ref::<Plan>() {
            self.plans.push(plan.clone());
        } else if let Some(ego) = payload.downcast_ref::<EgoState>() {
            self.poses.push(*ego);
        } else if publication.operator == "fresh" {
            self.commands.extend(payload.downcast_ref::<MotionCommand>());
        }
    }
}

const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

/// The ego at 8 m/s along x as inertial unit, satellite receiver and the vehicle's reports tell it: no pose.
fn sensed(until_ms: i64) -> Vec<(i64, &'static str, AnyMessage)> {
    let epoch = Epoch { ns: EPOCH_NS };
    let mut messages = Vec::new();
    for ms in (0..until_ms).step_by(10) {
        let stamp = Time::from_ms(ms);
        let imu = Imu { stamp, accel_mps2: [0.0, 0.0, 9.81], gyro_radps: [0.0; 3] };
        messages.push((ms, "imu", AnyMessage::Imu(imu_to_ros(&imu, epoch, "imu"))));
        if ms % 20 == 0 {
            let velocity = VelocityReport {
                header: epoch.header(stamp, "base_link"),
                longitudinal_velocity: 8.0,
                ..VelocityReport::default()
            };
            messages.push((ms, "velocity", AnyMessage::VelocityReport(velocity)));
            let (stamp, mode) = (epoch.stamp(stamp), ControlModeReport::AUTONOMOUS);
            let steering = SteeringReport { stamp, ..SteeringReport::default() };
            messages.push((ms, "steering", AnyMessage::SteeringReport(steering)));
            let mode = ControlModeReport { stamp, mode };
            messages.push((ms, "control_mode", AnyMessage::ControlModeReport(mode)));
        }
        if ms % 100 == 0 {
            // 37.4° north, 122° west is the map's origin; a degree of longitude there has 88,550 m.
            let longitude_deg = -122.0 + 8.0e-3 * ms as f64 / 88_550.1;
            let fix = Gnss { stamp, latitude_deg: 37.4, longitude_deg, altitude_m: 0.0, deviation_m: 0.1 };
            messages.push((ms, "gnss", AnyMessage::NavSatFix(gnss_to_ros(&fix, epoch, "gnss"))));
        }
    }
    messages
}

#[test]
fn a_vehicle_without_a_pose_is_driven_by_its_sensors() {
    let (until, messages) = (Time::from_ms(3500), sensed(3500));
    let seen = recorded("autoware", &messages, until);
    assert!(seen.poses.is_empty() && seen.plans.is_empty(), "nobody tells the pose");
    let sets = [("localization.localizer".to_owned(), toml::Value::from("eskf"))];
    let seen = recorded_with("autoware", &sets, &messages, until);
    let off = |ego: &EgoState| ego.pose.point().distance(Point2::new(8.0 * ego.stamp.as_secs(), 0.0));
    assert!(seen.poses.len() > 300, "{}", seen.poses.len());
    let worst = seen.poses.iter().map(off).fold(0.0, f64::max);
    assert!(worst < 0.3 && (seen.poses[300].speed_mps - 8.0).abs() < 0.1, "{worst}");
    assert!(seen.commands.len() > 100, "it is driven by them: {}", seen.commands.len());
}

#[test]
fn a_map_of_a_real_road_has_to_be_given() {
    let config = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live/autoware.toml"));
    let set = |key: &str, value: &str| (key.to_owned(), toml::Value::from(value));
    let sets = [set("localization.localizer", "ndt"), set("lidar.roof.preset", "vlp_32")];
    let said = Drive::load(&Registry::standard(), config, &sets).map(|_| ()).unwrap_err().to_string();
    assert!(said.contains("localization.map: is missing: expected a map of the road"), "{said}");
}

/// The ego at 8 m/s along x, every 20 ms.
fn poses(until_ms: i64) -> Vec<(i64, &'static str, AnyMessage)> {
    let pose = |ms: i64| {
        let mut ego = EgoState { stamp: Time::from_ms(ms), speed_mps: 8.0, ..EgoState::default() };
        ego.pose.x_m = 8.0e-3 * ms as f64;
        let odometry = ego_to_ros(&ego, Epoch { ns: EPOCH_NS }, "map", "base_link");
        (ms, "odometry", AnyMessage::Odometry(odometry))
    };
    (0..until_ms / 20).map(|i| pose(20 * i)).collect()
}

#[test]
fn images_and_clouds_are_watched() {
    let stamp = |ms: i64| Epoch { ns: EPOCH_NS }.stamp(Time::from_ms(ms));
    let mut messages = poses(1000);
    for ms in [100, 200, 300] {
        let AnyMessage::Image(mut image) = sample(Kind::Image) else { panic!("an image") };
        image.header.stamp = stamp(ms);
        // The third is the second again.
        image.data[0] = (ms / 200) as u8;
        messages.push((ms, "camera", AnyMessage::Image(image)));
        let mut cloud = swerve_ros2::samples::large_cloud(500);
        cloud.header.stamp = stamp(ms);
        messages.push((ms, "lidar", AnyMessage::PointCloud2(cloud)));
    }
    messages.sort_by_key(|(ms, ..)| *ms);
    let seen = recorded("plain", &messages, Time::from_ms(1000));
    let of = |name: &str| -> Vec<SensorHealth> {
        seen.health.iter().filter(|(monitor, _)| monitor == name).map(|(_, health)| *health).collect()
    };
    let (camera, lidar) = (of("camera_watch"), of("lidar_watch"));
    assert_eq!(camera.iter().map(|health| health.frozen).collect::<Vec<_>>(), [false, false, true]);
    assert_eq!(lidar.iter().map(|health| health.frozen).collect::<Vec<_>>(), [false, true, true]);
    assert!(camera.iter().all(|health| health.invalid == 0 && health.numbers == 18), "{camera:?}");
    assert!(lidar.iter().all(|health| health.invalid == 0 && health.numbers == 500), "{lidar:?}");
}

#[test]
fn objects_are_driven_by_and_their_silence_is_no_empty_road() {
    // Something that stands in the lane 30 m ahead, from 200 ms on, until 1,500 ms.
    let pose = swerve_geom::Pose2::new(30.0, 0.0, 0.0);
    let track = Track {
        id: ActorId(7),
        kind: ActorKind::Static,
        pose,
        extent: Extent { length_m: 2.0, width_m: 3.5, height_m: 2.0 },
        velocity_mps: Vector2::new(0.0, 0.0),
        history: Vec::new(),
    };
    let objects = |ms: i64| {
        let tracks = TrackList { stamp: Time::from_ms(ms), tracks: vec![track.clone()] };
        let none = PredictionList::default();
        (
            ms,
            "objects",
            AnyMessage::PredictedObjects(objects_to_ros(&tracks, &none, Epoch { ns: EPOCH_NS }, "map")),
        )
    };
    let until = Time::from_ms(3500);
    let free = recorded("autoware", &poses(3500), until);
    let mut messages = poses(3500);
    messages.extend((2..15).map(|i| objects(100 * i)));
    messages.sort_by_key(|(ms, ..)| *ms);
    let blocked = recorded("autoware", &messages, until);
    let slowest = |seen: &Seen| {
        let before = |command: &&MotionCommand| command.stamp < Time::from_ms(1500);
        seen.commands.iter().filter(before).map(|command| command.accel_mps2).fold(f64::INFINITY, f64::min)
    };
    assert!(slowest(&free) > -0.5 && slowest(&blocked) < -1.0, "{} {}", slowest(&free), slowest(&blocked));
    // 500 ms after the last objects no plan is made any more, and 500 ms after the last plan nothing is asked for.
    let last_plan = |seen: &Seen| seen.plans.last().unwrap().stamp;
    assert!((1900..=2000).contains(&(last_plan(&blocked).ns() / 1_000_000)), "{:?}", last_plan(&blocked));
    assert!(last_plan(&free) > Time::from_ms(3400));
    let last_command = |seen: &Seen| seen.commands.last().unwrap().stamp;
    assert!(last_command(&blocked) < Time::from_ms(2550) && last_command(&free) > Time::from_ms(3400));
}

#[test]
fn the_shipped_vehicles_name_a_route_that_is_there() {
    let names: Vec<_> = swerve_drive::shipped::Kind::Live.all().map(|(name, _)| name).collect();
    assert!(names.len() >= 4);
    for name in names {
        let drive = Drive::load(&Registry::standard(), Path::new(name), &[]).unwrap();
        assert!(drive.scenario.road.length_m() > drive.scenario.ego.end_m);
        assert_eq!(Path::new(name).file_stem().unwrap(), drive.mapping.vehicle.name());
    }
}
