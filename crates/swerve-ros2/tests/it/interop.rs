//! Interoperability with other DDS implementations, those used by ROS 2 distributions.
//!
//! A peer (`tests/ros2/`) decodes messages with its own types and decoder, encodes them again and sends them back;
//! they must arrive unchanged. One exchange thus covers both directions. Without the peer's tools a test prints a
//! notice and is skipped, unless `SWERVE_CI` is set. Figures are printed (`--nocapture`).

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "all of this is a test, and prints what it measured"
)]

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use swerve_msg::{EgoState, MotionCommand};
use swerve_ros2::bridge::{
    Bridge, Direction, Endpoint, EndpointId, Options, ServiceSide, Stopped, receive_buffer_max,
};
use swerve_ros2::clock::ClockParams;
use swerve_ros2::convert::{AccelLimits, Beside, Dataspeed, Epoch, control_to_ros, ego_from_ros};
use swerve_ros2::env::Network;
use swerve_ros2::mapping::{Mapping, Qos, ServiceMap, Side, Vehicle};
use swerve_ros2::msg::autoware_vehicle_msgs::Engage;
use swerve_ros2::msg::std_msgs::Empty;
use swerve_ros2::samples::{large_cloud, sample};
use swerve_ros2::{AnyMessage, Kind};

const PATIENCE: Duration = Duration::from_secs(15);
/// Time after which an echo is lost.
const LOST: Duration = Duration::from_secs(2);

/// One peer at a time, because latencies are measured.
static ALONE: Mutex<()> = Mutex::new(());

/// Network settings unique to this process and peer.
fn network(peer: u16) -> Network {
    Network { domain: 1 + (std::process::id() % 3) as u16 * 3 + peer, localhost_only: true }
}

#[expect(clippy::disallowed_methods, reason = "round trips are measured, nothing depends on them")]
fn now() -> Instant {
    Instant::now()
}

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/ros2")
}

/// Returns true if the command runs; otherwise prints a notice, or fails in CI.
fn available(what: &str, command: &mut Command) -> bool {
    let ran =
        command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success());
    if !ran {
        swerve_tests::skipped_without_tool(&format!("{what} is not installed"));
    }
    ran
}

fn run(command: &mut Command) {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A program that sends every message back.
struct Peer {
    child: Child,
    stdin: Option<ChildStdin>,
    /// Kept open so that the peer can continue to print.
    _stdout: BufReader<ChildStdout>,
}

impl Peer {
    fn start(command: &[&Path], network: Network, qos: &str, kinds: &[Kind]) -> Self {
        // Cyclone DDS on this host only, without multicast, as on a machine without a network.
        let cyclone = "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces>\
            <AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>\
            <Peers><Peer Address=\"127.0.0.1\"/></Peers></Discovery></Domain></CycloneDDS>";
        let mut child = Command::new(command[0])
            .args(&command[1..])
            .args([network.domain.to_string().as_str(), qos])
            .env("CYCLONEDDS_URI", cyclone)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap_or_else(|e| panic!("{command:?}: {e}"));
        let mut stdin = child.stdin.take().unwrap();
        for kind in kinds {
            writeln!(stdin, "{}/{}", kind.package(), kind.name()).unwrap();
        }
        writeln!(stdin).unwrap();
        let mut line = String::new();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        stdout.read_line(&mut line).unwrap();
        let peer = Self { child, stdin: Some(stdin), _stdout: stdout };
        assert_eq!(line.trim(), "ready", "{command:?}");
        peer
    }

    /// Kills the peer, as by `kill -9`.
    fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.stdin = None;
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Both directions of every kind: endpoint `2 i` sends kind `i`, `2 i + 1` receives it.
fn bridge(network: Network, qos: Qos, kinds: &[Kind]) -> Bridge {
    let endpoints = kinds.iter().flat_map(|kind| {
        [("in", Direction::Send), ("out", Direction::Receive)].map(|(way, direction)| Endpoint {
            name: format!("{way}/{kind}"),
            topic: format!("/echo/{way}/{}/{}", kind.package(), kind.name()),
            kind: *kind,
            qos,
            direction,
            rate_max_hz: None,
        })
    });
    let mapping = Mapping::of(Vehicle::Plain, network);
    let options = Options { endpoints: endpoints.collect(), ..Options::from_mapping(&mapping, Side::Stack) };
    Bridge::start(&options).unwrap()
}

/// Sends a message and waits for its echo; returns the round-trip time, `None` if it was lost.
fn echo(bridge: &Bridge, i: usize, message: &AnyMessage) -> Option<Duration> {
    // Discard the echoes of earlier messages.
    while bridge.take(EndpointId(2 * i + 1)).is_some() {}
    let start = now();
    bridge.publish(EndpointId(2 * i), message.clone()).ok()?;
    while start.elapsed() < LOST {
        if let Some(back) = bridge.take(EndpointId(2 * i + 1)) {
            if back.message == *message {
                return Some(start.elapsed());
            }
            let older = back.message.stamp() != message.stamp();
            assert!(older, "a {} came back changed: {:?}", message.kind(), back.message);
        }
        bridge.wait(Duration::from_millis(100));
    }
    None
}

fn matched(bridge: &Bridge, n: usize) {
    for i in 0..2 * n {
        assert!(
            bridge.wait_matched(EndpointId(i), 1, PATIENCE),
            "{} found nobody",
            bridge.endpoints()[i].topic
        );
    }
    // We have discovered the peer; the first echo shows that it has discovered us.
}

/// A few messages may be lost until both sides have discovered each other.
fn echo_at_last(bridge: &Bridge, i: usize, message: &AnyMessage) {
    assert!((0..6).any(|_| echo(bridge, i, message).is_some()), "no {} ever came back", message.kind());
}

/// Measures the median and 99th percentile of round trips, and the number of lost messages.
fn measure(peer: &str, what: &str, bridge: &Bridge, message: &AnyMessage, n: usize, lost_max: usize) {
    echo_at_last(bridge, 0, message);
    let mut times: Vec<Duration> = (0..n).filter_map(|k| echo(bridge, 0, &numbered(message, k))).collect();
    times.sort_unstable();
    let lost = n - times.len();
    let at = |share: f64| {
        times.get((times.len().saturating_sub(1) as f64 * share) as usize).copied().unwrap_or_default()
    };
    println!(
        "{peer}: {what}: round trip {:.2?} median, {:.2?} at 99 %; {lost} of {n} lost",
        at(0.5),
        at(0.99)
    );
    assert!(lost <= lost_max, "{peer}: {what}: {lost} of {n} lost");
}

/// The same message with another stamp.
fn numbered(message: &AnyMessage, k: usize) -> AnyMessage {
    let mut message = message.clone();
    match &mut message {
        AnyMessage::Control(control) => control.stamp.nanosec = k as u32,
        AnyMessage::PointCloud2(cloud) => cloud.header.stamp.nanosec = k as u32,
        _ => {}
    }
    message
}

fn cloud(bytes: u32) -> AnyMessage {
    AnyMessage::PointCloud2(large_cloud(bytes / 18))
}

/// Runs all exchanges with a peer.
fn talk(name: &str, command: &[&Path], number: u16) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let network = network(number);
    every_kind(name, command, network);
    let small = sample(Kind::Control);
    for (qos_name, qos) in [("reliable", Qos { depth: 50, ..Qos::DEFAULT }), ("best_effort", Qos::SENSOR)] {
        // On a busy machine a burst may not fit into a buffer: it is lost or takes too long.
        let may_lose = |n: usize, large: bool| if qos.reliable && !large { 0 } else { n / 3 };
        let peer = Peer::start(command, network, qos_name, &[Kind::Control]);
        let one = bridge(network, qos, &[Kind::Control]);
        matched(&one, 1);
        measure(name, &format!("{qos_name}, command"), &one, &small, 200, may_lose(200, false));
        drop((one, peer));
        let peer = Peer::start(command, network, qos_name, &[Kind::PointCloud2]);
        let one = bridge(network, qos, &[Kind::PointCloud2]);
        matched(&one, 1);
        measure(name, &format!("{qos_name}, 64 KiB"), &one, &cloud(64 << 10), 30, may_lose(30, false));
        // With a small receive buffer, a megabyte in fragments of 256 bytes is usually lost.
        if receive_buffer_max().is_some_and(|bytes| bytes >= 4 << 20) {
            measure(name, &format!("{qos_name}, 1 MiB"), &one, &cloud(1 << 20), 10, may_lose(10, true));
        } else {
            println!("{name}: {qos_name}, 1 MiB: left out, net.core.rmem_max is below 4 MiB");
        }
        drop((one, peer));
    }
    late_joiner(name, command, network);
    restart(name, command, network);
}

fn every_kind(name: &str, command: &[&Path], network: Network) {
    let peer = Peer::start(command, network, "reliable", Kind::ALL);
    let all = bridge(network, Qos::DEFAULT, Kind::ALL);
    matched(&all, Kind::ALL.len());
    for (i, kind) in Kind::ALL.iter().enumerate() {
        echo_at_last(&all, i, &sample(*kind));
    }
    for statistics in all.statistics() {
        assert_eq!(statistics.refused.total(), 0, "{statistics:?}");
    }
    println!("{name}: {} kinds of messages came back as they were sent", Kind::ALL.len());
    drop(peer);
    assert_eq!(all.stop(PATIENCE), Stopped::Clean);
}

/// A latched message sent before the peer starts reaches it and comes back.
fn late_joiner(name: &str, command: &[&Path], network: Network) {
    let kinds = [Kind::Tf];
    let first = bridge(network, Qos::LATCHED, &kinds);
    first.publish(EndpointId(0), sample(Kind::Tf)).unwrap();
    let peer = Peer::start(command, network, "latched", &kinds);
    let start = now();
    while start.elapsed() < PATIENCE && !first.wait(Duration::from_millis(100)) {}
    let back = first.take(EndpointId(1)).unwrap_or_else(|| panic!("{name}: nothing reached who came late"));
    assert_eq!(back.message, sample(Kind::Tf));
    println!("{name}: who came late got what was latched");
    drop(peer);
}

/// The peer is killed and restarted; the bridge continues.
fn restart(name: &str, command: &[&Path], network: Network) {
    let kinds = [Kind::Control];
    let peer = Peer::start(command, network, "reliable", &kinds);
    let one = bridge(network, Qos::DEFAULT, &kinds);
    matched(&one, 1);
    let message = sample(Kind::Control);
    echo_at_last(&one, 0, &message);
    peer.kill();
    for _ in 0..20 {
        // Without acknowledgements: no publication may block for long or end the bridge.
        let _ = one.publish(EndpointId(0), message.clone());
    }
    let start = now();
    let peer = Peer::start(command, network, "reliable", &kinds);
    echo_at_last(&one, 0, &message);
    println!("{name}: killed and started again: answers after {:.1?}", start.elapsed());
    drop(peer);
    assert_eq!(one.stop(PATIENCE), Stopped::Clean);
}

/// Build folder for the peers.
fn build_folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
#[ignore = "other makers' DDS"]
fn cyclone_dds_in_python_echoes_every_kind() {
    let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    if !available("Python's package cyclonedds", Command::new(&python).args(["-c", "import cyclonedds"])) {
        return;
    }
    talk("Cyclone DDS, Python", &[Path::new(&python), &sources().join("echo.py")], 0);
    let server = sources().join("service.py");
    service(
        "Cyclone DDS, Python",
        &[Path::new(&python), &server],
        network(0),
        "cyclone",
        ServiceMap::Cyclone,
    );
}

#[test]
#[ignore = "other makers' DDS"]
fn cyclone_dds_in_c_echoes_every_kind() {
    if !available("cyclonedds-tools (idlc)", Command::new("idlc").arg("-v"))
        || !available("a C compiler", Command::new("cc").arg("--version"))
    {
        return;
    }
    let (folder, sources) = (build_folder("cyclone_c"), sources());
    let line = |kind: &Kind| format!("KIND({}, {})\n", kind.package(), kind.name());
    std::fs::write(folder.join("kinds.h"), Kind::ALL.iter().map(line).collect::<String>()).unwrap();
    run(Command::new("idlc").args(["-l", "c"]).arg(sources.join("messages.idl")).current_dir(&folder));
    let mut compile = Command::new("cc");
    compile.args(["-O1", "-I.", "-o", "echo"]).arg(sources.join("echo.c"));
    run(compile.args(["messages.c", "-lddsc"]).current_dir(&folder));
    talk("Cyclone DDS, C", &[&folder.join("echo")], 1);
}

#[test]
#[ignore = "other makers' DDS"]
fn fast_dds_echoes_every_kind() {
    let header =
        "echo '#include <fastdds/dds/domain/DomainParticipant.hpp>' | c++ -std=c++17 -fsyntax-only -xc++ -";
    if !available("libfastrtps-dev with a C++ compiler", Command::new("sh").args(["-c", header])) {
        return;
    }
    let (folder, sources) = (build_folder("fast_dds"), sources());
    let mut compile = Command::new("c++");
    compile.args(["-std=c++17", "-O1", "-o", "echo"]).arg(sources.join("echo.cpp"));
    run(compile.args(["-lfastrtps", "-lfastcdr"]).current_dir(&folder));
    talk("Fast DDS", &[&folder.join("echo")], 2);
    noise(&folder.join("echo"), network(2));
    service("Fast DDS", &[&folder.join("echo")], network(2), "service", ServiceMap::Enhanced);
}

/// The peer accepts the modes 1 and 4 only.
fn service(name: &str, command: &[&Path], network: Network, argument: &str, map: ServiceMap) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let _peer = Peer::start(command, network, argument, &[]);
    let start = |service_map| {
        let mapping = Mapping::of(Vehicle::Plain, network);
        let service = "/control/control_mode_request".to_owned();
        Bridge::start(&Options {
            service_map,
            control_mode_service: Some((ServiceSide::Client, service)),
            endpoints: Vec::new(),
            ..Options::from_mapping(&mapping, Side::Stack)
        })
        .unwrap()
    };
    let right = start(map);
    let brief = Duration::from_millis(500);
    // Requests are lost until both sides have discovered each other.
    let first = (0..20).find_map(|_| right.request_control_mode(1, brief).ok());
    assert_eq!(first, Some(true), "{name} does not answer");
    let answers = [1, 2, 3, 4].map(|mode| right.request_control_mode(mode, PATIENCE));
    assert_eq!(answers, [Ok(true), Ok(false), Ok(false), Ok(true)], "{name}");
    println!("{name}: the service for the control mode answers in its mapping");
}

/// Malformed payloads with valid headers: counted and rejected, and the next valid message is received.
fn noise(peer: &Path, network: Network) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let kinds = [
        Kind::Control,
        Kind::PointCloud2,
        Kind::Image,
        Kind::Imu,
        Kind::Odometry,
        Kind::Trajectory,
        Kind::MarkerArray,
    ];
    let mut peer = Peer::start(&[peer], network, "reliable", &kinds);
    let all = bridge(network, Qos { depth: 1000, ..Qos::DEFAULT }, &kinds);
    matched(&all, kinds.len());
    for (i, kind) in kinds.iter().enumerate() {
        echo_at_last(&all, i, &sample(*kind));
    }
    writeln!(peer.stdin.as_mut().unwrap(), "noise").unwrap();
    let count = |all: &Bridge| all.statistics().iter().map(|s| s.received).sum::<u64>();
    let wanted = 200 * kinds.len() as u64;
    let start = now();
    while count(&all) < wanted && start.elapsed() < PATIENCE {
        all.wait_matched(EndpointId(0), usize::MAX, Duration::from_millis(50));
    }
    let statistics = all.statistics();
    let refused: u64 = statistics.iter().map(|s| s.refused.total()).sum();
    println!("noise: {} payloads, {refused} refused", count(&all));
    assert!(refused > wanted * 9 / 10, "{statistics:#?}");
    for (i, kind) in kinds.iter().enumerate() {
        while let Some(noise) = all.take(EndpointId(2 * i + 1)) {
            assert_eq!(noise.message.check(), Ok(()), "what is handed on passes its check");
        }
        echo_at_last(&all, i, &sample(*kind));
    }
    drop(peer);
    assert_eq!(all.stop(PATIENCE), Stopped::Clean);
}

/// The stack's part at each pose of the car: sends a command through the car's interface.
type Send = fn(&Bridge, MotionCommand);

fn send_autoware(stack: &Bridge, wish: MotionCommand) {
    let endpoint = |name| stack.endpoint(name).unwrap();
    let epoch = Epoch::default();
    stack.publish(endpoint("command"), AnyMessage::Control(control_to_ros(&wish, epoch))).unwrap();
    let engage = Engage { stamp: epoch.stamp(wish.stamp), engage: true };
    stack.publish(endpoint("enable"), AnyMessage::Engage(engage)).unwrap();
}

fn send_dataspeed(stack: &Bridge, wish: MotionCommand) {
    let endpoint = |name| stack.endpoint(name).unwrap();
    let car = Dataspeed::default();
    let steering = car.steering(wish.stamp, wish.steering_rad, true, false);
    stack.publish(endpoint("steering_command"), AnyMessage::DataspeedSteeringCmd(steering)).unwrap();
    let speed = car.speed(&wish, AccelLimits { accel_mps2: 2.0, decel_mps2: 3.0 }, true, false);
    stack.publish(endpoint("speed_command"), AnyMessage::DataspeedUlcCmd(speed)).unwrap();
    stack.publish(endpoint("enable"), AnyMessage::Empty(Empty::default())).unwrap();
}

/// The emulated car is engaged, driven to 3 m/s along its lane, and left without commands: it stops by itself.
fn drive_emulated(interface: &str, vehicle: Vehicle, endpoints: &[&str], send: Send) {
    let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    if !available("Python's package cyclonedds", Command::new(&python).args(["-c", "import cyclonedds"])) {
        return;
    }
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let network = network(0);
    let emulator = sources().join("vehicle_emulator.py");
    let _car = Peer::start(&[Path::new(&python), &emulator], network, interface, &[]);
    let mapping = Mapping::of(vehicle, network);
    let options = Options {
        judge_stamps: Some(ClockParams::default()),
        ..Options::from_mapping(&mapping, Side::Stack)
    };
    let stack = Bridge::start(&options).unwrap();
    for name in endpoints {
        assert!(stack.wait_matched(stack.endpoint(name).unwrap(), 1, PATIENCE), "{name} found nobody");
    }
    let odometry = stack.endpoint("odometry").unwrap();
    let drive = |until: &mut dyn FnMut(&EgoState) -> bool, speed_mps: Option<f64>| {
        let start = now();
        while start.elapsed() < PATIENCE {
            stack.wait(Duration::from_millis(100));
            let Some((id, received)) = stack.take_any() else { continue };
            if id != odometry {
                continue;
            }
            let AnyMessage::Odometry(message) = received.message else { unreachable!() };
            let ego =
                ego_from_ros(&message, Epoch::default(), "map", "base_link", Beside::default()).unwrap();
            if until(&ego) {
                return ego;
            }
            if let Some(speed_mps) = speed_mps {
                let steering_rad =
                    (-0.2 * (ego.pose.y_m - 0.5) - 0.8 * ego.pose.heading_rad).clamp(-0.2, 0.2);
                let accel_mps2 = (2.0 * (speed_mps - ego.speed_mps)).clamp(-2.0, 2.0);
                send(&stack, MotionCommand { stamp: ego.stamp, steering_rad, speed_mps, accel_mps2 });
            }
        }
        panic!("the car does not follow its commands");
    };
    // The lane is 0.5 m to the left.
    let driving = drive(&mut |ego| ego.pose.x_m > 8.0, Some(3.0));
    assert!((driving.speed_mps - 3.0).abs() < 0.2, "{driving:?}");
    assert!((driving.pose.y_m - 0.5).abs() < 0.3, "{driving:?}");
    let stopped = drive(&mut |ego| ego.speed_mps == 0.0, None);
    println!(
        "emulated car, {interface}: stood {:.1} m after the last command",
        stopped.pose.x_m - driving.pose.x_m
    );
    let report = stack.statistics().remove(odometry.0);
    assert!(report.refused.total() == 0 && report.clock.unwrap().offset.as_ms().abs() < 100.0, "{report:?}");
}

#[test]
#[ignore = "other makers' DDS"]
fn emulated_autoware_car_follows_commands_and_stops_without() {
    let endpoints = ["command", "enable", "odometry", "control_mode", "velocity", "steering"];
    drive_emulated("autoware", Vehicle::Autoware, &endpoints, send_autoware);
}

#[test]
#[ignore = "other makers' DDS"]
fn emulated_dataspeed_car_follows_commands_and_stops_without() {
    let endpoints =
        ["steering_command", "speed_command", "enable", "odometry", "steering", "brake", "enabled"];
    drive_emulated("dataspeed", Vehicle::Dataspeed, &endpoints, send_dataspeed);
}
