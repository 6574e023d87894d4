//! Malicious ROS 2 peers against `swerve run --ros2=drive` and `swerve live`: the attacks listed in `SECURITY.md`. The
//! other stack is a bridge in this process.

#![expect(clippy::print_stdout, reason = "prints what it measured")]

mod local;
mod packets;
mod stamps;

use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::Value;
use swerve_geom::math;
use swerve_ros2::AnyMessage;
use swerve_ros2::bridge::{Bridge, EndpointId, Options, WriterGuid};
use swerve_ros2::env::Network;
use swerve_ros2::mapping::{Mapping, Side, Vehicle};
use swerve_ros2::msg::autoware_control_msgs::Control;
use swerve_ros2::msg::autoware_vehicle_msgs::{ControlModeReport, Engage};
use swerve_ros2::msg::nav_msgs::Odometry;

use crate::support::{Bench, alone};

const SCENARIO: &str = "
name = 'straight'
description = 'A straight road.'
[road]
segments = [{ length_m = 400.0 }]
lane_width_m = 4.0
left_m = 6.0
right_m = 2.0
[ego]
target_speed_mps = 8.0
end_m = 380.0
[end]
timeout_s = SECONDS
[expect]
verdict = 'timeout'
";

/// Memory limit of the transport process in these tests, MiB.
const MEMORY_MIB: u64 = 512;
/// Polls of 10 ms before giving up.
const PATIENCE: usize = 2000;
const WHEELBASE_M: f64 = 2.85;

fn network(number: u32) -> Network {
    let domain = 20 + 10 * (std::process::id() % 20) + number;
    Network { domain: u16::try_from(domain).unwrap(), localhost_only: true }
}

fn options(network: Network, side: Side, node: &str, endpoints: &[&str]) -> Options {
    let mapping = Mapping::of(Vehicle::Autoware, network);
    let mut options = Options { node: node.to_owned(), ..Options::from_mapping(&mapping, side) };
    options.endpoints.retain(|endpoint| endpoints.contains(&endpoint.name.as_str()));
    assert_eq!(options.endpoints.len(), endpoints.len());
    options
}

fn pause() {
    std::thread::park_timeout(Duration::from_millis(10));
}

/// A simulated car driven by another stack.
struct Car {
    child: Child,
    bench: Bench,
    network: Network,
}

impl Car {
    fn start(number: u32, seconds: &str) -> Self {
        let (bench, network) = (Bench::new(), network(number));
        let Network { domain, .. } = network;
        bench.write("scenario.toml", &SCENARIO.replace("SECONDS", seconds));
        let config = format!(
            "[ros2]\nlocalhost_only = true\ndomain = {domain}\ntransport_memory_mib = {MEMORY_MIB}\n"
        );
        bench.write("config.toml", &config);
        let words = ["run", "scenario.toml", "-c", "config.toml", "--ros2=drive", "--out", "out"];
        let told = std::fs::File::create(bench.path("told")).unwrap();
        let mut command = bench.command(&words);
        let child = command.stdout(told.try_clone().unwrap()).stderr(told).spawn().unwrap();
        let car = Self { child, bench, network };
        // The first participant of the domain has the first ports.
        for _ in 0..PATIENCE {
            if is_bound(packets::ports(domain)[1]) {
                break;
            }
            pause();
        }
        car
    }

    fn transport(&self) -> u32 {
        let look = |_| {
            pause();
            transport_of(self.child.id())
        };
        (0..PATIENCE).find_map(look).expect("it has a process for its transport")
    }

    /// Waits for the end of the run; returns its metrics and its output.
    fn end(mut self) -> (Value, String) {
        let ended = self.child.wait().unwrap();
        let told = self.bench.read("told");
        println!("{told}");
        assert!(ended.success(), "{ended}");
        (serde_json::from_str(&self.bench.read("out/metrics.json")).unwrap(), told)
    }
}

impl Drop for Car {
    fn drop(&mut self) {
        let _ended_before = self.child.kill();
        let _ended_before = self.child.wait();
    }
}

fn is_bound(port: u16) -> bool {
    let table = std::fs::read_to_string("/proc/net/udp").unwrap_or_default();
    table
        .lines()
        .any(|line| line.split_whitespace().nth(1).is_some_and(|at| at.ends_with(&format!(":{port:04X}"))))
}

/// Transport process started by a process.
pub(crate) fn transport_of(parent: u32) -> Option<u32> {
    child_of(parent, "transport")
}

/// Child of a process that runs this subcommand.
pub(crate) fn child_of(parent: u32, command: &str) -> Option<u32> {
    let is_ours = |pid: &u32| {
        let read = |file: &str| std::fs::read_to_string(format!("/proc/{pid}/{file}")).unwrap_or_default();
        let by = read("stat").rsplit(") ").next().and_then(|rest| rest.split(' ').nth(1)?.parse().ok());
        by == Some(parent) && read("cmdline").trim_end_matches('\0').ends_with(command)
    };
    let all = std::fs::read_dir("/proc")
        .unwrap()
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    all.into_iter().find(is_ours)
}

/// Peak memory of a process, MiB.
fn memory_mib(pid: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? / 1024)
}

fn signal(pid: u32, signal: &str) {
    assert!(Command::new("kill").args([signal, &pid.to_string()]).status().unwrap().success());
}

/// A stack that follows the lane centre at 5 m/s.
struct Stack {
    bridge: Arc<Bridge>,
    command: EndpointId,
    enable: EndpointId,
    odometry: Option<Odometry>,
    mode: u8,
    /// Offset of its clock ahead of the run's, s.
    ahead_s: i32,
    /// Largest lateral deviation of the car from its lane, m.
    beside_m: f64,
}

impl Stack {
    fn start(network: Network) -> Self {
        let topics = ["command", "enable", "odometry", "control_mode"];
        let bridge = Arc::new(Bridge::start(&options(network, Side::Stack, "other", &topics)).unwrap());
        let [command, enable] = ["command", "enable"].map(|name| bridge.endpoint(name).unwrap());
        Self { bridge, command, enable, odometry: None, mode: 0, ahead_s: 0, beside_m: 0.0 }
    }

    fn writer(&self) -> WriterGuid {
        self.bridge.writer(self.command).unwrap()
    }

    /// Time of the run, s.
    fn now_s(&self) -> f64 {
        self.odometry
            .as_ref()
            .map_or(0.0, |o| f64::from(o.header.stamp.sec) + 1e-9 * f64::from(o.header.stamp.nanosec))
    }

    fn speed_mps(&self) -> f64 {
        self.odometry.as_ref().map_or(0.0, |o| o.twist.twist.linear.x)
    }

    fn publish(&self, control: Control) {
        // Slow readers are irrelevant here.
        let _counted = self.bridge.publish(self.command, AnyMessage::Control(control));
    }

    fn press(&self, engage: bool) {
        let engage = Engage { engage, ..Engage::default() };
        self.bridge.publish(self.enable, AnyMessage::Engage(engage)).unwrap();
    }

    fn wish(&self, odometry: &Odometry) -> Control {
        let (pose, speed) = (&odometry.pose.pose, odometry.twist.twist.linear.x);
        let yaw = 2.0 * math::atan2(pose.orientation.z, pose.orientation.w);
        let ahead = math::atan2(-pose.position.y, 8.0) - yaw;
        let mut control = Control { stamp: odometry.header.stamp, ..Control::default() };
        control.stamp.sec += self.ahead_s;
        control.lateral.steering_tire_angle = math::atan(2.0 * WHEELBASE_M * math::sin(ahead) / 8.0) as f32;
        control.longitudinal.velocity = 5.0;
        control.longitudinal.acceleration = (5.0 - speed).clamp(-2.0, 2.0) as f32;
        control.longitudinal.is_defined_acceleration = true;
        control
    }

    /// Drives for a duration, calling `beside` at each step. Also ends after 5 s without a message.
    fn drive(&mut self, seconds: f64, beside: impl FnMut(&Self, Control)) {
        let mut from = Some(self.now_s()).filter(|from| *from > 0.0);
        let goes_on = |stack: &Self| {
            from = from.or(stack.odometry.as_ref().map(|_| stack.now_s()));
            from.is_none_or(|from| stack.now_s() - from < seconds)
        };
        self.drive_while(goes_on, beside);
    }

    /// Drives until the run of the car ends. Also ends after 5 s without a message.
    fn drive_to_end(&mut self, car: &mut Car) {
        self.drive_while(|_| car.child.try_wait().unwrap().is_none(), |_, _| {});
    }

    fn drive_while(
        &mut self,
        mut goes_on: impl FnMut(&Self) -> bool,
        mut beside: impl FnMut(&Self, Control),
    ) {
        let mut idle = 0;
        while idle < 500 && goes_on(self) {
            idle = if self.bridge.wait(Duration::from_millis(10)) { 0 } else { idle + 1 };
            while let Some((_, received)) = self.bridge.take_any() {
                match received.message {
                    AnyMessage::ControlModeReport(report) => self.mode = report.mode,
                    AnyMessage::Odometry(odometry) => {
                        self.beside_m = self.beside_m.max(odometry.pose.pose.position.y.abs());
                        let control = self.wish(&odometry);
                        self.odometry = Some(odometry);
                        self.publish(control);
                        beside(self, control);
                    }
                    _ => {}
                }
            }
        }
    }

    /// Requests engagement until the car drives, then drives until it is at speed.
    fn engage(&mut self) {
        for _ in 0..40 {
            if self.mode == ControlModeReport::AUTONOMOUS && self.speed_mps() > 3.0 {
                return;
            }
            if self.mode != ControlModeReport::AUTONOMOUS && self.odometry.is_some() {
                self.press(true);
            }
            self.drive(0.25, |_, _| {});
        }
        panic!("the car is not driven: {} m/s", self.speed_mps());
    }

    /// As the documentation describes: disengages and engages again; the car continues.
    fn let_in_again(&mut self) {
        self.press(false);
        self.drive(0.5, |_, _| {});
        self.press(true);
        self.drive(3.0, |_, _| {});
        assert!(self.speed_mps() > 1.0, "it was not let in again: {} m/s", self.speed_mps());
    }
}

/// Causes of the gate's stops.
fn causes(metrics: &Value) -> Vec<&str> {
    metrics["gate"]["stops"].as_array().unwrap().iter().map(|stop| stop["cause"].as_str().unwrap()).collect()
}

#[test]
#[ignore = "real clock"]
fn second_writer_is_refused_and_the_car_stops_until_re_engaged() {
    let _alone = alone();
    let mut car = Car::start(0, "24.0");
    let mut stack = Stack::start(car.network);
    stack.engage();
    let other = Stack::start(car.network);
    assert!(other.bridge.wait_matched(other.command, 1, Duration::from_secs(5)));
    stack.drive(5.0, |_, mut control| {
        control.lateral.steering_tire_angle = 0.3;
        control.longitudinal.velocity = 20.0;
        control.longitudinal.acceleration = 2.0;
        other.publish(control);
    });
    assert!(stack.speed_mps().abs() < 0.1, "it drives on: {} m/s", stack.speed_mps());
    drop(other);
    stack.let_in_again();
    stack.drive_to_end(&mut car);
    println!("at most {:.2} m beside its lane", stack.beside_m);
    assert!(stack.beside_m < 0.5, "it was steered: {} m", stack.beside_m);
    let (metrics, told) = car.end();
    assert_eq!(causes(&metrics)[0], "second_writer");
    assert!(metrics["ros2"]["driver"]["of_others"].as_u64().unwrap() > 50, "{}", metrics["ros2"]["driver"]);
    assert!(told.contains("commands on /control/command/control_cmd of a second writer, "), "{told}");
    assert!(told.contains("commands of a second writer refused: the car was stopped"), "{told}");
    assert!(told.contains(": commands of a second writer\n"), "{told}");
}

#[test]
#[ignore = "real clock"]
fn forged_fragment_ends_the_transport_and_the_gate_stops_the_car() {
    let _alone = alone();
    let mut car = Car::start(1, "26.0");
    let mut stack = Stack::start(car.network);
    stack.engage();
    let before = car.transport();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let forged = packets::fragment(stack.writer(), 1_000_000, 0xffff_fff0);
    for port in packets::ports(car.network.domain) {
        socket.send_to(&forged, ("127.0.0.1", port)).unwrap();
    }
    stack.drive(6.0, |_, _| {});
    assert!(stack.speed_mps().abs() < 0.1, "it drives on: {} m/s", stack.speed_mps());
    assert_ne!(car.transport(), before, "the transport took it");
    stack.let_in_again();
    stack.drive_to_end(&mut car);
    assert!(stack.beside_m < 0.5, "it was steered: {} m", stack.beside_m);
    let (metrics, told) = car.end();
    // On a busy machine the missing commands are seen before the end of the process.
    assert!(["command_timeout", "transport_lost"].contains(&causes(&metrics)[0]), "{}", metrics["gate"]);
    assert_eq!(metrics["ros2"]["transports_lost"], 1);
    assert!(told.contains("the process of ROS 2's transport ended (signal: 6 (SIGABRT)"), "{told}");
    assert!(told.contains("transport_memory_mib = 512"), "{told}");
}

#[test]
#[ignore = "real clock"]
fn malformed_packets_end_nothing_and_respect_the_memory_limit() {
    let _alone = alone();
    let mut car = Car::start(2, "16.0");
    let mut stack = Stack::start(car.network);
    stack.engage();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let (ports, writer, pid) = (packets::ports(car.network.domain), stack.writer(), car.child.id());
    let noise = std::thread::spawn(move || {
        let (mut noise, mut sent, mut most_mib) = (packets::Noise::new(), 0, 0);
        for _ in 0..400 {
            for port in ports.into_iter().cycle().take(40) {
                sent += u64::from(socket.send_to(&noise.packet(writer, sent), ("127.0.0.1", port)).is_ok());
            }
            most_mib = most_mib.max(transport_of(pid).and_then(memory_mib).unwrap_or(0));
            pause();
        }
        (sent, most_mib)
    });
    stack.drive_to_end(&mut car);
    let (sent, most_mib) = noise.join().unwrap();
    assert!(stack.beside_m < 0.5, "it was steered: {} m", stack.beside_m);
    assert!(car.child.wait().unwrap().success());
    let (metrics, _) = car.end();
    println!(
        "{sent} packets, {most_mib} MiB at most, {} transports lost",
        metrics["ros2"]["transports_lost"]
    );
    assert!(sent > 10_000 && (1..=MEMORY_MIB).contains(&most_mib), "{sent} packets, {most_mib} MiB");
    // Either it drove on or the gate stopped it for a missing message.
    let known = ["transport_lost", "second_writer", "command_timeout", "report_timeout"];
    assert!(causes(&metrics).iter().all(|cause| known.contains(cause)), "{}", metrics["gate"]);
}

#[test]
#[ignore = "real clock"]
fn floods_nans_and_old_stamps_change_nothing() {
    let _alone = alone();
    let car = Car::start(3, "16.0");
    let mut stack = Stack::start(car.network);
    stack.engage();
    // Thousands of valid commands per second.
    let (newest, done) = (Arc::new(Mutex::new(Control::default())), Arc::new(AtomicBool::new(false)));
    let flooding = std::thread::spawn({
        let (bridge, command) = (Arc::clone(&stack.bridge), stack.command);
        let (newest, done) = (Arc::clone(&newest), Arc::clone(&done));
        stack.drive(0.1, |_, control| *newest.lock().unwrap() = control);
        move || {
            let mut flood = 0_u64;
            while !done.load(Ordering::Relaxed) {
                let control = *newest.lock().unwrap();
                flood += u64::from(bridge.publish(command, AnyMessage::Control(control)).is_ok());
                std::thread::park_timeout(Duration::from_micros(100));
            }
            flood
        }
    });
    stack.drive(2.0, |_, control| *newest.lock().unwrap() = control);
    done.store(true, Ordering::Relaxed);
    let flood = flooding.join().unwrap();
    // The queue holds only the newest command. One of several is bad, so that good ones get through.
    let mut n = 0;
    stack.drive(2.0, |stack, mut control| {
        n += 1;
        control.lateral.steering_tire_angle = f32::NAN;
        if n % 5 == 0 {
            stack.publish(control);
        }
    });
    stack.drive(2.0, |stack, mut control| {
        n += 1;
        control.stamp.sec -= 5;
        control.lateral.steering_tire_angle = 0.5;
        if n % 5 == 0 {
            stack.publish(control);
        }
    });
    let speed = stack.speed_mps();
    assert!((speed - 5.0).abs() < 0.5 && stack.beside_m < 0.5, "{speed} m/s, {} m beside", stack.beside_m);
    let until_s = stack.now_s();
    drop(stack);
    let (metrics, _) = car.end();
    let (ros2, stop) = (&metrics["ros2"], &metrics["gate"]["stops"][0]);
    println!("{flood} commands in 2 s; {}", ros2["driver"]);
    assert!(flood > 2_000 && stop["at_s"].as_f64().unwrap() >= until_s, "{}", metrics["gate"]);
    assert_eq!((causes(&metrics), &ros2["transports_lost"]), (vec!["command_timeout"], &0.into()));
    assert!(ros2["driver"]["implausible"].as_u64().unwrap() > 5, "{}", ros2["driver"]);
    let topics = ros2["topics"].as_array().unwrap();
    let command = topics.iter().find(|topic| topic["topic"] == "/control/command/control_cmd").unwrap();
    assert!(command["refused"].as_u64().unwrap() > 5, "{command}");
}

#[test]
#[ignore = "real clock"]
fn hanging_transport_is_detected_within_a_second_and_replaced() {
    let _alone = alone();
    let car = Car::start(4, "18.0");
    let mut stack = Stack::start(car.network);
    stack.engage();
    let hung = car.transport();
    signal(hung, "-STOP");
    // No message from the car until the transport is replaced.
    for _ in 0..PATIENCE {
        if transport_of(car.child.id()).is_some_and(|pid| pid != hung) {
            break;
        }
        pause();
    }
    stack.drive(5.0, |_, _| {});
    assert!(stack.speed_mps().abs() < 0.1, "it drives on: {} m/s", stack.speed_mps());
    stack.let_in_again();
    let (metrics, told) = car.end();
    assert!(told.contains("the process of ROS 2's transport was silent for 1 s and was killed"), "{told}");
    assert!(["command_timeout", "transport_lost"].contains(&causes(&metrics)[0]), "{}", metrics["gate"]);
}

/// `swerve live` drives the car; its transport is killed, and the braking commands arrive through the next one.
#[test]
#[ignore = "real clock"]
fn live_drive_brakes_through_a_new_transport() {
    let _alone = alone();
    let car = Car::start(5, "40.0"); // time for a busy machine to engage it
    let Network { domain, .. } = car.network;
    let live = format!(
        "[control]\ncontroller = 'stanley'\n[live]\nroute = 'scenario.toml'\nenable = 'at_start'\n\
         [ros2]\nlocalhost_only = true\ndomain = {domain}\n"
    );
    car.bench.write("live.toml", &live);
    let mut command = car.bench.command(&["live", "live.toml", "--seconds", "26", "--out", "live"]);
    let mut stack = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let listener = Bridge::start(&options(car.network, Side::Vehicle, "listener", &["command"])).unwrap();
    let mut heard: Vec<(WriterGuid, i64, Control)> = Vec::new();
    let mut killed = None;
    for _ in 0..2 * PATIENCE {
        listener.wait(Duration::from_millis(10));
        while let Some((_, received)) = listener.take_any() {
            let AnyMessage::Control(control) = received.message else { continue };
            heard.push((received.writer, received.received_ns, control));
        }
        let drives = heard.iter().filter(|(.., control)| control.longitudinal.velocity > 4.0).count();
        if killed.is_none() && drives > 100 {
            let transport = transport_of(stack.id()).unwrap();
            signal(transport, "-KILL");
            killed = Some(transport);
        }
        if killed.is_some() && stack.try_wait().unwrap().is_some() {
            break;
        }
    }
    let output = stack.wait_with_output().unwrap();
    let told =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    println!("{told}");
    assert!(output.status.success());
    let (first, ..) = heard[0];
    let next = heard.iter().position(|(writer, ..)| *writer != first).expect("commands through the next one");
    let gap_ms = (heard[next].1 - heard[next - 1].1) as f64 * 1e-6;
    println!("no command reached a listener for {gap_ms:.0} ms");
    let braking = &heard[next].2.longitudinal;
    assert!(braking.velocity == 0.0 && braking.acceleration < 0.0, "{braking:?}");
    assert!(gap_ms < 5000.0, "{gap_ms} ms");
    let metrics: Value = serde_json::from_str(&car.bench.read("live/metrics.json")).unwrap();
    assert_eq!(metrics["transports_lost"], 1);
    let modes = metrics["drive"]["modes"].to_string();
    assert!(modes.contains("{\"stopping\":\"transport_lost\"}"), "{modes}");
    assert!(told.contains("the process of ROS 2's transport ended (signal: 9 (SIGKILL))"), "{told}");
    let (metrics, _) = car.end();
    assert!(["second_writer", "command_timeout"].contains(&causes(&metrics)[0]), "{}", metrics["gate"]);
}
