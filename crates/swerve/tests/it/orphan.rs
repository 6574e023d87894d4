//! A vehicle whose program is killed is stopped by the DDS process. The vehicle is simulated by this program.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use crate::hostile::{child_of, transport_of};
use crate::support::{Bench, alone};

/// Interval and number of polls.
const LOOK_EVERY: Duration = Duration::from_millis(50);
const LOOKS: usize = 600;

const SCENARIO: &str = r#"name = "straight"

[road]
segments = [{ length_m = 600.0 }]
lane_width_m = 4.0
left_m = 6.0
right_m = 2.0

[ego]
target_speed_mps = 8.0
end_m = 580.0

[end]
timeout_s = 20.0
"#;

/// A worker process for a planner, as in a run.
const WORKER: &str = "process.far.operators=[\"planner\"]";

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ended_before = self.0.kill();
        let _ended_before = self.0.wait();
    }
}

fn is_there(process: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    stat.rsplit(") ").next().is_some_and(|rest| !rest.is_empty() && !rest.starts_with(['Z', 'X']))
}

fn wait_until(what: &str, mut reached: impl FnMut() -> bool) {
    for _ in 0..LOOKS {
        if reached() {
            return;
        }
        std::thread::park_timeout(LOOK_EVERY);
    }
    panic!("{what}: not in time");
}

/// Drives for a while and ends the program with `end`; returns the vehicle's metrics.
fn driven_until(domain: u32, end: impl FnOnce(&mut Child)) -> Value {
    let bench = Bench::new();
    bench.write("road.toml", SCENARIO);
    bench.write("car.toml", &format!("[ros2]\nlocalhost_only = true\ndomain = {domain}\n"));
    let quiet = |mut command: Command| {
        command.env("ROS_DOMAIN_ID", domain.to_string()).env("ROS_LOCALHOST_ONLY", "1");
        Killed(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    };
    let words = ["run", "road.toml", "-c", "car.toml", "--ros2=drive", "--out", "car"];
    let mut car = quiet(bench.command(&words));
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/live/autoware.toml");
    let route = format!("live.route=\"{}\"", bench.path("road.toml").display());
    let words = [
        "live",
        config.to_str().unwrap(),
        "--enable",
        "at-start",
        "--set",
        &route,
        "--set",
        WORKER,
        "--out",
        "live",
    ];
    let mut live = quiet(bench.command(&words));
    wait_until("the transport is started", || transport_of(live.0.id()).is_some());
    let transport = transport_of(live.0.id()).unwrap();
    wait_until("the worker is started", || child_of(live.0.id(), "worker").is_some());
    // At 150 kB/s, some seconds of driving.
    let log = bench.path("live/log.partial.mcap");
    wait_until("the car drives", || std::fs::metadata(&log).is_ok_and(|log| log.len() > 600_000));
    end(&mut live.0);
    wait_until("the transport ends", || !is_there(transport));
    assert!(car.0.wait().unwrap().success());
    serde_json::from_str(&bench.read("car/metrics.json")).unwrap()
}

/// Both ends at the same time, each in a separate domain: a drive mostly waits. Without commands for half a second the
/// vehicle's own time-out brakes it, which the gate records as a cause.
#[test]
#[ignore = "real clock"]
fn killed_or_twice_interrupted_program_leaves_a_vehicle_that_its_transport_stops_and_releases() {
    let _alone = alone();
    let killed = || stops_and_releases(&driven_until(210, |live| live.kill().unwrap()));
    let interrupted = || {
        stops_and_releases(&driven_until(211, |live| {
            for _ in 0..2 {
                let interrupt = format!("kill -s INT {}", live.id());
                Command::new("sh").args(["-c", &interrupt]).status().unwrap();
                std::thread::park_timeout(LOOK_EVERY);
            }
            assert_eq!(live.wait().unwrap().code(), Some(130));
        }));
    };
    std::thread::scope(|scope| {
        scope.spawn(killed);
        scope.spawn(interrupted);
    });
}

fn stops_and_releases(metrics: &Value) {
    let gate = &metrics["gate"];
    assert!(gate["driving_s"].as_f64() > Some(2.0), "{gate}");
    assert_eq!(gate["end"]["holding"], "released", "{gate}");
    let causes: Vec<&Value> = gate["stops"].as_array().unwrap().iter().map(|stop| &stop["cause"]).collect();
    assert_eq!(causes, ["released"], "{gate}");
}
