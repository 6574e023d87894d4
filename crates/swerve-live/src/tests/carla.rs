//! Drives in an emulated CARLA: its topics, and simulated time at half of real time.

use swerve_geom::Pose2;
use swerve_ros2::convert::carla_steering_from_ros;
use swerve_ros2::msg::builtin_interfaces as builtin;
use swerve_ros2::msg::carla_msgs::{CarlaEgoVehicleControl, CarlaEgoVehicleStatus};
use swerve_ros2::msg::rosgraph_msgs;
use swerve_ros2::msg::std_msgs::Header;
use swerve_vehicle::{Pedals, VehicleParams, accel_for_pedals};

use super::super::intake::{Arrived, Input};
use super::*;

/// Step of the simulator, seconds of simulated time.
const STEP_S: f64 = 0.05;
/// Real time per simulated time.
const SLOWNESS: f64 = 2.0;
/// Simulated time at the start, ns: the simulator has run before.
const BEGIN_NS: i64 = 12_350_000_000;
const WHEELBASE_M: f64 = 2.85;

/// Event in the life of the server.
#[derive(Clone, Copy)]
enum Incident {
    /// It pauses for this real time, seconds.
    Pause(f64),
    /// It stops for ever.
    Stop,
    /// It is reset: its time begins at zero.
    Reset,
    /// The topic of its clock falls silent, the vehicle goes on.
    SilentClock,
}

/// A server with one vehicle. Waiting for messages advances it.
struct Server {
    state: Mutex<ServerState>,
    news: Condvar,
    host: HostClock,
    gear: swerve_ros2::convert::SteeringGear,
    vehicle: VehicleParams,
    ahead_m: f64,
    incident: Option<(f64, Incident)>,
}

#[derive(Default)]
struct ServerState {
    frame: i64,
    clock_ns: i64,
    /// Real time of the next frame; `None` once it has stopped.
    next: Option<Time>,
    is_silent: bool,
    ego: EgoState,
    control: CarlaEgoVehicleControl,
    /// Received controls, with the simulated time since the start, seconds.
    controls: Vec<(f64, CarlaEgoVehicleControl)>,
    waiting: VecDeque<(&'static str, AnyMessage)>,
}

impl Server {
    fn new(drive: &Drive, incident: Option<(f64, Incident)>) -> Self {
        let ego = EgoState { speed_mps: 3.0, ..EgoState::default() };
        let (clock_ns, next) = (BEGIN_NS, Some(Time::ZERO));
        Self {
            state: Mutex::new(ServerState { clock_ns, next, ego, ..ServerState::default() }),
            news: Condvar::new(),
            host: HostClock::start(),
            gear: drive.live.gear(),
            vehicle: drive.config.sim.vehicle.clone(),
            ahead_m: drive.live.pose_ahead_m,
            incident,
        }
    }

    fn advance(&self) {
        let now = self.host.now();
        let mut state = lock(&self.state);
        while let Some(next) = state.next.filter(|next| *next <= now) {
            state.next = Some(next + Span::from_secs(STEP_S * SLOWNESS));
            let frame = state.frame;
            if let Some((at_s, incident)) = self.incident
                && frame == (at_s / STEP_S) as i64
            {
                match incident {
                    Incident::Pause(real_s) => state.next = Some(next + Span::from_secs(real_s)),
                    Incident::Stop => state.next = None,
                    Incident::Reset => state.clock_ns = 0,
                    Incident::SilentClock => state.is_silent = true,
                }
            }
            self.step(&mut state);
        }
    }

    fn step(&self, state: &mut ServerState) {
        const PARTS: u32 = 5;
        let (control, dt) = (state.control.clone(), STEP_S / f64::from(PARTS));
        let pedals = Pedals { throttle: f64::from(control.throttle), brake: f64::from(control.brake) };
        let ego = &mut state.ego;
        ego.steering_rad = carla_steering_from_ros(&control, &self.gear);
        for _ in 0..PARTS {
            let accel = accel_for_pedals(&self.vehicle, ego.speed_mps, pedals);
            ego.speed_mps = (ego.speed_mps + accel * dt).max(0.0);
            ego.yaw_rate_radps = ego.speed_mps * math::tan(ego.steering_rad) / WHEELBASE_M;
            let (sin, cos) = math::sin_cos(ego.pose.heading_rad);
            ego.pose.x_m += ego.speed_mps * cos * dt;
            ego.pose.y_m += ego.speed_mps * sin * dt;
            ego.pose.heading_rad += ego.yaw_rate_radps * dt;
        }
        state.frame += 1;
        state.clock_ns += (STEP_S * 1e9) as i64;
        let stamp = builtin::Time {
            sec: (state.clock_ns / 1_000_000_000) as i32,
            nanosec: (state.clock_ns % 1_000_000_000) as u32,
        };
        let (sin, cos) = math::sin_cos(state.ego.pose.heading_rad);
        let Pose2 { x_m, y_m, heading_rad, .. } = state.ego.pose;
        let centre = Pose2::new(x_m + self.ahead_m * cos, y_m + self.ahead_m * sin, heading_rad);
        let reported = EgoState { pose: centre, ..state.ego };
        let mut odometry = ego_to_ros(&reported, Epoch::default(), "map", "hero");
        odometry.header.stamp = stamp;
        let status = CarlaEgoVehicleStatus {
            header: Header { stamp, frame_id: "map".to_owned() },
            velocity: state.ego.speed_mps as f32,
            control,
            ..CarlaEgoVehicleStatus::default()
        };
        let mut news = vec![
            ("odometry", AnyMessage::Odometry(odometry)),
            ("velocity", AnyMessage::CarlaEgoVehicleStatus(status)),
        ];
        if !state.is_silent {
            // Topics have no common order: every other time, the clock comes last.
            let place = if state.frame % 2 == 0 { 0 } else { news.len() };
            news.insert(place, ("clock", AnyMessage::Clock(rosgraph_msgs::Clock { clock: stamp })));
        }
        state.waiting.extend(news);
    }
}

impl Wire for Server {
    fn wait(&self, timeout: Duration) -> bool {
        self.advance();
        let state = lock(&self.state);
        let left = self.news.wait_timeout_while(state, timeout, |state| state.waiting.is_empty());
        left.is_ok_and(|(_, result)| !result.timed_out())
    }

    fn take(&self) -> Option<Taken<'_>> {
        let (name, message) = lock(&self.state).waiting.pop_front()?;
        Some(Taken { name, message, received_ns: self.host.epoch_ns() + self.host.now().ns() })
    }

    fn send(&self, role: Role, message: AnyMessage) -> Sent {
        let AnyMessage::CarlaEgoVehicleControl(control) = message else { panic!("{role:?}: {message:?}") };
        let mut state = lock(&self.state);
        let at_s = state.frame as f64 * STEP_S;
        state.controls.push((at_s, control.clone()));
        state.control = control;
        Sent::Done
    }

    fn ask_mode(&self, _: u8, _: Duration) -> Result<bool, String> {
        Ok(true)
    }

    fn statistics(&self) -> Vec<TopicStatistics> {
        Vec::new()
    }
}

fn carla(sets: &[(&str, f64)]) -> Drive {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live/carla.toml"));
    let sets: Vec<_> = sets.iter().map(|(key, value)| ((*key).to_owned(), (*value).into())).collect();
    Drive::load(&Registry::standard(), file, &sets).unwrap()
}

/// Drives for some seconds of simulated time.
fn ride_in_carla(drive: &Drive, seconds: f64, incident: Option<(f64, Incident)>) -> (Driven, ServerState) {
    let server = Server::new(drive, incident);
    let until = Some(Time::ZERO + Span::from_secs(seconds));
    let flags = ControlFlags::default();
    let options = DriveOptions { until, threads: 2, status_sink: Box::new(Quiet), flags: &flags };
    let driven = super::super::drive(drive, &server, options, &mut []).unwrap();
    (driven, server.state.into_inner().unwrap())
}

fn assert_nominal(driven: &Driven, server: &ServerState) {
    let released = StopCause::Released;
    let expected =
        [GateMode::Manual, GateMode::Driving, GateMode::Stopping(released), GateMode::Holding(released)];
    assert_eq!(modes(driven), expected);
    assert!(driven.report.is_ok() && driven.feed.clock_failure.is_none());
    let refused: u64 = driven.feed.intake.tallies().map(|topic| topic.tally.refused.total()).sum();
    assert_eq!((refused, driven.feed.not_taken), (0, 0));
    assert!(driven.figures.beside_max_m < 0.2, "{:?}", driven.figures);
    assert!(server.ego.speed_mps < 0.1 && server.control.brake > 0.1, "{:?}", server.control);
    // All commands have the simulator's time.
    let last = server.controls.last().unwrap().1.header.stamp.ns();
    assert!((BEGIN_NS..=server.clock_ns).contains(&last), "{last} {}", server.clock_ns);
}

/// A car at the place (10, 20) of CARLA, which heads to negative y, is at (10, -20) of the map and heads north. Its rear
/// axle is 1.4 m to the south of its centre. Yaw of -90 degrees and a turn to the right arrive with ROS's signs.
#[test]
fn pose_of_the_bridge_is_converted_to_the_rear_axle() {
    let drive = carla(&[]);
    let interface = vehicle::interface(drive.mapping.vehicle, &drive.config);
    let mut intake = Intake::new(&drive.mapping, interface, &drive.config, BEGIN_NS);
    let half = 0.5_f64.sqrt();
    let mut odometry = ego_to_ros(&EgoState::default(), Epoch { ns: BEGIN_NS }, "map", "hero");
    (odometry.pose.pose.position.x, odometry.pose.pose.position.y) = (10.0, -20.0);
    (odometry.pose.pose.orientation.z, odometry.pose.pose.orientation.w) = (half, half);
    (odometry.twist.twist.linear.x, odometry.twist.twist.angular.z) = (6.0, -0.25);
    let mut out = Vec::new();
    intake.take("odometry", &AnyMessage::Odometry(odometry.clone()), Time::from_ms(20), &mut out);
    let [Arrived { input: Input::Pose(ego), .. }] = &out[..] else { panic!("{}", out.len()) };
    assert!((ego.pose.x_m - 10.0).abs() < 1e-9 && (ego.pose.y_m + 21.4).abs() < 1e-9, "{ego:?}");
    assert!((ego.pose.heading_rad - core::f64::consts::FRAC_PI_2).abs() < 1e-9, "{ego:?}");
    assert_eq!((ego.speed_mps, ego.yaw_rate_radps), (6.0, -0.25));
    // Another vehicle's odometry is not used.
    odometry.child_frame_id = "ego_vehicle".to_owned();
    odometry.header.stamp = Epoch { ns: BEGIN_NS }.stamp(Time::from_ms(30));
    intake.take("odometry", &AnyMessage::Odometry(odometry), Time::from_ms(50), &mut out);
    assert_eq!(out.len(), 1);
}

#[test]
fn native_interface_of_carla_differs_in_the_topics_of_two_sensors() {
    let file = |name: &str| {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live"));
        Drive::load(&Registry::standard(), &folder.join(name), &[]).unwrap()
    };
    let (bridge, native) = (file("carla.toml"), file("carla_native.toml"));
    assert_eq!(bridge.live, native.live);
    let differ: Vec<_> = native
        .mapping
        .topics
        .iter()
        .filter(|topic| bridge.mapping.topic(&topic.name) != Some(topic))
        .map(|topic| topic.topic.as_str())
        .collect();
    let sensors = ["/carla/hero/rgb/image", "/carla/hero/rgb/camera_info", "/carla/hero/lidar/point_cloud"];
    assert_eq!(differ, sensors);
}

#[test]
#[ignore = "real clock"]
fn simulator_at_half_speed_is_driven_in_its_own_time() {
    let (begin, drive) = (HostClock::start(), carla(&[]));
    let (driven, server) = ride_in_carla(&drive, 6.0, None);
    assert_nominal(&driven, &server);
    assert_eq!(driven.feed.why, "the time limit was reached");
    // More real time than simulated time has passed.
    assert!(begin.now() > Time::from_ms(12_000), "{:?}", begin.now());
    assert!((4.0..8.0).contains(&driven.figures.driving_s), "{:?}", driven.figures);
    assert!(driven.figures.driven_m > 12.0, "{:?}", driven.figures);
}

#[test]
#[ignore = "real clock"]
fn simulator_may_pause() {
    let (driven, server) = ride_in_carla(&carla(&[]), 4.0, Some((2.0, Incident::Pause(3.0))));
    assert_nominal(&driven, &server);
}

#[test]
#[ignore = "real clock"]
fn simulator_that_stops_ends_the_drive_with_an_error_and_a_braking_command() {
    let drive = carla(&[("live.clock_timeout_s", 1.5), ("live.stop_timeout_s", 2.0)]);
    let (driven, server) = ride_in_carla(&drive, 20.0, Some((2.0, Incident::Stop)));
    let failure = driven.feed.clock_failure.unwrap();
    let expected = "simulated time stood still at 14.400 s for 1.5 s (live.clock_timeout_s)";
    assert_eq!((failure.as_str(), driven.feed.why), (expected, "simulated time failed"));
    assert!(server.control.brake > 0.1 && server.control.throttle == 0.0, "{:?}", server.control);
    // The standstill is not reported.
    assert_eq!(driven.sink.stood_at_end, Some(false));
}

#[test]
#[ignore = "real clock"]
fn simulator_that_is_reset_ends_the_drive_with_an_error_and_a_standstill() {
    let (driven, server) = ride_in_carla(&carla(&[]), 20.0, Some((2.0, Incident::Reset)));
    let failure = driven.feed.clock_failure.unwrap();
    assert!(failure.starts_with("simulated time jumped back from 14.3"), "{failure}");
    assert!(server.control.brake > 0.1 && server.control.throttle == 0.0, "{:?}", server.control);
}

#[test]
#[ignore = "real clock"]
fn vehicle_of_a_simulator_whose_clock_falls_silent_is_stopped() {
    let (driven, server) = ride_in_carla(&carla(&[]), 20.0, Some((2.0, Incident::SilentClock)));
    let failure = driven.feed.clock_failure.unwrap();
    // Half a second of simulated time later, not after the time-out of a pause.
    assert!(failure.starts_with("simulated time stood still at 14.350 s while the stamps of"), "{failure}");
    assert_eq!((driven.sink.stood_at_end, server.ego.speed_mps), (Some(true), 0.0));
    assert!(server.frame < 20 * 8, "{}", server.frame);
}

#[test]
#[ignore = "real clock"]
fn drive_without_simulated_time_reports_the_missing_topic() {
    let drive = carla(&[("live.clock_timeout_s", 0.5)]);
    let server = Server::new(&drive, Some((0.0, Incident::SilentClock)));
    let flags = ControlFlags::default();
    let options = DriveOptions { until: None, threads: 2, status_sink: Box::new(Quiet), flags: &flags };
    let error = super::super::drive(&drive, &server, options, &mut []).err().unwrap().to_string();
    let expected = "live.clock: no message on the topic `clock` within 0.5 s: start the simulator first";
    assert!(error.starts_with(expected), "{error}");
}

/// `SWERVE_LIVE_SECONDS=60` sets the simulated time.
#[test]
#[ignore = "real clock"]
fn simulator_at_half_speed_with_a_pause_is_driven_for_long() {
    let seconds = std::env::var("SWERVE_LIVE_SECONDS").map_or(12.0, |s| s.parse().unwrap());
    let (driven, server) = ride_in_carla(&carla(&[]), seconds, Some((seconds / 2.0, Incident::Pause(2.0))));
    println!("{:?}, {} controls", driven.figures, server.controls.len());
    assert_nominal(&driven, &server);
    assert!(driven.figures.driven_m > 4.0 * (seconds - 4.0), "{:?}", driven.figures);
}
