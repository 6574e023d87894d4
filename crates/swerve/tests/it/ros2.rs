//! `swerve run --ros2` against Eclipse Cyclone DDS: the topics of a simulated car, and driving it with another stack.
//!
//! The peer programs are in `tests/ros2/`. The tests are skipped with a note without Python's `cyclonedds` package,
//! unless `SWERVE_CI` is set. Measurements are printed (`--nocapture`).

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "all of this is a test, and prints what it measured"
)]

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::alone;

const CONFIG: &str = "
[log]
sensors = ['front', 'roof', 'gnss', 'odometry']
[camera.front]
width_px = 160
height_px = 96
period_ms = 100
[lidar.roof]
preset = 'vlp_32'
params = { columns = 60 }
[ros2]
localhost_only = true
";

/// A straight road with a parked car beside it, and a long time-out.
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
[[actor]]
name = 'parked car'
kind = 'car'
s_m = 60.0
d_m = 5.0
[end]
timeout_s = 9.0
[expect]
verdict = 'timeout'
min_distance_m = { min = 0.5 }
";

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/ros2")
}

/// Interpreter with the package. If there is none, prints a note, or fails in CI.
fn python() -> Option<String> {
    let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let ran = Command::new(&python).args(["-c", "import cyclonedds"]).stderr(Stdio::null()).status();
    if ran.is_ok_and(|status| status.success()) {
        return Some(python);
    }
    swerve_tests::skipped_without_tool("Python's package cyclonedds is not installed");
    None
}

/// A peer program.
struct Peer {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: BufReader<ChildStdout>,
}

impl Peer {
    fn start(python: &str, program: &str, arguments: &[String], lines: &str) -> Self {
        // This host only, without multicast, as on a machine without a network.
        let cyclone = "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces>\
            <AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>\
            <Peers><Peer Address=\"127.0.0.1\"/></Peers></Discovery></Domain></CycloneDDS>";
        let mut child = Command::new(python)
            .arg(sources().join(program))
            .args(arguments)
            .env("CYCLONEDDS_URI", cyclone)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        write!(stdin, "{lines}\n\n").unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        assert_eq!(line.trim(), "ready");
        Self { child, stdin: Some(stdin), stdout }
    }

    /// Closes its input; returns its final output.
    fn end(mut self) -> Value {
        self.stdin = None;
        let mut told = String::new();
        self.stdout.read_to_string(&mut told).unwrap();
        serde_json::from_str(&told).unwrap()
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A folder with a configuration and a scenario, and a DDS domain used only by this run.
fn folder(config: &str, scenario: &str, number: u32) -> (TempDir, u32) {
    let folder = tempfile::tempdir().unwrap();
    let domain = 20 + 8 * (std::process::id() % 20) + number;
    std::fs::write(folder.path().join("config.toml"), format!("{config}domain = {domain}\n")).unwrap();
    std::fs::write(folder.path().join("scenario.toml"), scenario).unwrap();
    (folder, domain)
}

fn swerve(folder: &TempDir, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_swerve"));
    // Tests that use the same folder again do so on purpose.
    command.args(words).args(words.contains(&"--out").then_some("--overwrite"));
    command.current_dir(folder.path()).output().unwrap()
}

fn ok(output: &Output) -> String {
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{told}{}", String::from_utf8_lossy(&output.stderr));
    told
}

fn seconds(header: &Value) -> f64 {
    header["stamp"]["sec"].as_f64().unwrap() + 1e-9 * header["stamp"]["nanosec"].as_f64().unwrap()
}

const RUN: [&str; 6] = ["run", "scenario.toml", "-c", "config.toml", "--out", "out"];

/// Each topic with its type and nominal rate, Hz.
const TOPICS: [(&str, &str, f64); 21] = [
    ("/clock", "rosgraph_msgs/Clock", 100.0),
    ("/tf", "tf2_msgs/TFMessage", 100.0),
    ("/tf_static", "tf2_msgs/TFMessage", 0.0),
    ("/sensing/camera/camera0/image_raw", "sensor_msgs/Image", 10.0),
    ("/sensing/camera/camera0/image_raw/compressed", "sensor_msgs/CompressedImage", 10.0),
    ("/sensing/camera/camera0/camera_info", "sensor_msgs/CameraInfo", 10.0),
    ("/sensing/lidar/top/pointcloud_raw", "sensor_msgs/PointCloud2", 10.0),
    ("/sensing/imu/imu_raw", "sensor_msgs/Imu", 100.0),
    ("/sensing/gnss/nav_sat_fix", "sensor_msgs/NavSatFix", 10.0),
    ("/localization/kinematic_state", "nav_msgs/Odometry", 100.0),
    ("/localization/acceleration", "geometry_msgs/AccelWithCovarianceStamped", 100.0),
    ("/perception/object_recognition/objects", "autoware_perception_msgs/PredictedObjects", 10.0),
    ("/vehicle/status/velocity_status", "autoware_vehicle_msgs/VelocityReport", 50.0),
    ("/vehicle/status/steering_status", "autoware_vehicle_msgs/SteeringReport", 50.0),
    ("/vehicle/status/control_mode", "autoware_vehicle_msgs/ControlModeReport", 50.0),
    ("/vehicle/status/gear_status", "autoware_vehicle_msgs/GearReport", 50.0),
    ("/vehicle/status/turn_indicators_status", "autoware_vehicle_msgs/TurnIndicatorsReport", 50.0),
    ("/planning/trajectory", "autoware_planning_msgs/Trajectory", 20.0),
    ("/swerve/path", "nav_msgs/Path", 20.0),
    ("/swerve/markers", "visualization_msgs/MarkerArray", 30.0),
    ("/swerve/lanes", "visualization_msgs/MarkerArray", 0.0),
];

#[test]
#[ignore = "real clock, Cyclone DDS"]
fn third_party_reader_receives_every_topic_of_a_simulated_car() {
    let Some(python) = python() else { return };
    let _alone = alone();
    let (folder, domain) = folder(CONFIG, SCENARIO, 0);
    let lines: Vec<String> = TOPICS.iter().map(|(topic, kind, _)| format!("{topic} {kind}")).collect();
    let peer = Peer::start(&python, "watch.py", &[domain.to_string(), "20".into()], &lines.join("\n"));
    let told = ok(&swerve(&folder, &[&RUN[..], &["--ros2"]].concat()));
    println!("{told}");
    let seen = peer.end();
    let metrics = metrics(&folder, "out");
    let topics = metrics["ros2"]["topics"].as_array().unwrap();
    for (topic, _, hz) in TOPICS {
        let one = &seen[topic];
        let (n, from, to) = (one["n"].as_f64().unwrap(), &one["first_s"], &one["last_s"]);
        assert!(n > 0.0, "{topic} is silent");
        let rate = (n - 1.0) / (to.as_f64().unwrap() - from.as_f64().unwrap()).max(1e-3);
        let sent = topics.iter().find(|t| t["topic"] == topic).unwrap()["sent"].as_f64().unwrap();
        println!("{topic}: {n} messages of {sent}, {rate:.1} a second");
        // On a busy machine fewer messages are sent and some are lost, but none are invented.
        assert!(hz == 0.0 || rate < 1.2 * hz, "{topic}: {rate} Hz");
        assert!(n <= sent && n > 0.5 * sent, "{topic}: {n} of {sent}");
    }
    check_sensors(&seen);
    check_car(&seen);
    // Topics that are not requested do not exist.
    assert!(topics.iter().all(|t| t["dropped"] == 0 && t["refused"] == 0), "{topics:#?}");
    assert!(topics.iter().all(|t| t["topic"] != "/control/command/control_cmd"), "nobody is to drive it");
}

fn check_sensors(seen: &Value) {
    let last = |topic: &str| seen[topic]["last"].clone();
    let image = last("/sensing/camera/camera0/image_raw");
    assert_eq!(
        (&image["width"], &image["height"], &image["encoding"]),
        (&160.into(), &96.into(), &"rgb8".into())
    );
    assert_eq!(image["data"]["len"], 160 * 96 * 3);
    assert_eq!(image["header"]["frame_id"], "camera0/camera_optical_link");
    let file = last("/sensing/camera/camera0/image_raw/compressed");
    assert_eq!((&file["data"]["head"][0], &file["data"]["head"][1]), (&0xff.into(), &0xd8.into()), "no JPEG");
    let info = last("/sensing/camera/camera0/camera_info");
    // Image centre, relative to the centre of the first pixel.
    assert_eq!((&info["k"]["head"][2], &info["k"]["head"][5]), (&79.5.into(), &47.5.into()));
    let cloud = last("/sensing/lidar/top/pointcloud_raw");
    assert!(cloud["width"].as_u64().unwrap() > 500 && cloud["header"]["frame_id"] == "lidar_top", "{cloud}");
    assert_eq!(cloud["row_step"], cloud["data"]["len"]);
    let imu = last("/sensing/imu/imu_raw");
    assert!((imu["linear_acceleration"]["z"].as_f64().unwrap() - 9.81).abs() < 1.0, "{imu}");
    assert_eq!(imu["header"]["frame_id"], "imu_link");
    assert!(last("/sensing/gnss/nav_sat_fix")["latitude"].as_f64().unwrap().abs() > 1e-6);
}

fn check_car(seen: &Value) {
    let last = |topic: &str| seen[topic]["last"].clone();
    let first = &seen["/localization/kinematic_state"]["first"];
    let odometry = last("/localization/kinematic_state");
    let x = |odometry: &Value| odometry["pose"]["pose"]["position"]["x"].as_f64().unwrap();
    let passed = seconds(&odometry["header"]) - seconds(&first["header"]);
    let (way, speed) = (x(&odometry) - x(first), odometry["twist"]["twist"]["linear"]["x"].as_f64().unwrap());
    assert!(
        (way / passed - 8.0).abs() < 1.5 && (speed - 8.0).abs() < 1.5,
        "{way} m in {passed} s, {speed} m/s"
    );
    assert_eq!(
        (&odometry["header"]["frame_id"], &odometry["child_frame_id"]),
        (&"map".into(), &"base_link".into())
    );
    let velocity = last("/vehicle/status/velocity_status");
    assert!((velocity["longitudinal_velocity"].as_f64().unwrap() - speed).abs() < 0.5);
    assert_eq!(last("/vehicle/status/control_mode")["mode"], 1);
    let objects = last("/perception/object_recognition/objects");
    assert_eq!((&objects["objects"]["len"], &objects["header"]["frame_id"]), (&1.into(), &"map".into()));
    let place =
        &objects["objects"]["head"][0]["kinematics"]["initial_pose_with_covariance"]["pose"]["position"];
    assert!((place["x"].as_f64().unwrap() - 60.0).abs() < 1.5, "{place}");
    let edges = last("/tf_static");
    let frames: Vec<&str> =
        (0..4).map(|i| edges["transforms"]["head"][i]["child_frame_id"].as_str().unwrap()).collect();
    assert_eq!(frames, ["camera0/camera_optical_link", "lidar_top", "imu_link", "gnss_link"]);
    assert_eq!(last("/tf")["transforms"]["head"][0]["child_frame_id"], "base_link");
    assert!(last("/planning/trajectory")["points"]["len"].as_u64().unwrap() > 5);
    let clock = last("/clock");
    let clock = clock["clock"]["sec"].as_f64().unwrap();
    assert!((1.0..20.0).contains(&clock), "{clock}");
}

/// The other stack drives half a metre to the left of the lane centre at 5 m/s for 6 s, then falls silent.
#[test]
#[ignore = "real clock, Cyclone DDS"]
fn other_stack_drives_the_simulated_car_which_stops_without_commands() {
    let Some(python) = python() else { return };
    let _alone = alone();
    let scenario = SCENARIO.replace("timeout_s = 9.0", "timeout_s = 14.0");
    let (folder, domain) = folder("[ros2]\nlocalhost_only = true\n", &scenario, 1);
    let words = [domain.to_string(), "6".into(), "0.5".into(), "5.0".into()];
    let peer = Peer::start(&python, "drive.py", &words, "");
    let told = ok(&swerve(&folder, &[&RUN[..], &["--ros2=drive"]].concat()));
    println!("{told}");
    let seen = peer.end();
    let began = seen["began_s"].as_f64().expect("the car was never engaged");
    let way: Vec<[f64; 5]> = serde_json::from_value(seen["way"].clone()).unwrap();
    let at = |t: f64| way.iter().rfind(|row| row[0] <= t).unwrap();
    let [_, x_m, y_m, _, speed_mps] = *at(began + 5.9);
    println!("engaged at {began:.2} s; after 5.9 s {x_m:.1} m on, {y_m:+.2} m, {speed_mps:.2} m/s");
    assert!((speed_mps - 5.0).abs() < 0.5 && (y_m - 0.5).abs() < 0.3, "{:?}", at(began + 5.9));
    assert!(way.iter().take_while(|row| row[0] < began - 0.1).all(|row| row[4].abs() < 0.05), "it rolled");
    let stopped = way.last().unwrap();
    assert!(stopped[4].abs() < 0.05, "it did not stop: {stopped:?}");
    // Replayed from the log, without the peer.
    let replayed = ok(&swerve(&folder, &["replay", "out/log.mcap", "--verify"]));
    println!("{replayed}");
    assert!(replayed.contains(", as logged"), "{replayed}");
}

/// This stack in another process, over the network, in place of the other one.
#[test]
#[ignore = "real clock"]
fn own_stack_drives_the_simulated_car_from_another_process() {
    let _alone = alone();
    let scenario = SCENARIO.replace("timeout_s = 9.0", "timeout_s = 16.0");
    let (folder, domain) = folder("[ros2]\nlocalhost_only = true\n", &scenario, 2);
    let live = format!("{LIVE}enable = 'at_start'\n[ros2]\nlocalhost_only = true\ndomain = {domain}\n");
    std::fs::write(folder.path().join("live.toml"), live).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_swerve"));
    command.args(["live", "live.toml", "--seconds", "10", "--out", "live"]).current_dir(folder.path());
    let mut stack = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let told = ok(&swerve(&folder, &[&RUN[..], &["--ros2=drive"]].concat()));
    let ended = stack.wait().unwrap();
    let mut said = String::new();
    stack.stdout.take().unwrap().read_to_string(&mut said).unwrap();
    stack.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    println!("{told}\n{said}");
    assert!(ended.success(), "{said}");
    let [car, stack] = ["out", "live"].map(|out| metrics(&folder, out));
    let (driven_m, beside_m) = (&stack["drive"]["driven_m"], &stack["drive"]["beside_max_m"]);
    // Plans keep clear of the parked car within the lane.
    assert!(driven_m.as_f64().unwrap() > 25.0 && beside_m.as_f64().unwrap() < 1.0, "{}", stack["drive"]);
    assert!(car["gate"]["driving_s"].as_f64().unwrap() > 5.0, "{}", car["gate"]);
    assert!(
        car["drive"]["speed_end_mps"].as_f64().unwrap().abs() < 0.05,
        "it did not stop: {}",
        car["drive"]
    );
    ok(&swerve(&folder, &["replay", "out/log.mcap", "--verify"]));
}

/// A stack for a vehicle; the table `[live]` is left open at the end.
const LIVE: &str = "
[control]
controller = 'stanley'
[live]
route = 'scenario.toml'
";

fn metrics(folder: &TempDir, out: &str) -> Value {
    serde_json::from_slice(&std::fs::read(folder.path().join(out).join("metrics.json")).unwrap()).unwrap()
}

/// Drives on a recording; returns the metrics.
fn drive_recorded(folder: &TempDir, bag: &str, out: &str, threads: &str) -> Value {
    let text = format!("{LIVE}[source]\nrosbag = '{bag}'\n");
    std::fs::write(folder.path().join("recorded.toml"), text).unwrap();
    let told = ok(&swerve(folder, &["live", "recorded.toml", "--out", out, "--threads", threads]));
    println!("{told}");
    metrics(folder, out)
}

fn topic<'a>(metrics: &'a Value, name: &str) -> &'a Value {
    metrics["topics"].as_array().unwrap().iter().find(|topic| topic["topic"] == name).unwrap()
}

fn steps(metrics: &Value, name: &str) -> u64 {
    let operators = metrics["operators"].as_array().unwrap();
    operators.iter().find(|operator| operator["operator"] == name).unwrap()["steps"].as_u64().unwrap()
}

/// Python with the `mcap` package. If there is none, prints a note, or fails in CI.
fn python_with_mcap() -> Option<String> {
    let python = python()?;
    let ran =
        Command::new(&python).args(["-c", "import mcap, lz4, zstandard"]).stderr(Stdio::null()).status();
    if ran.is_ok_and(|status| status.success()) {
        return Some(python);
    }
    swerve_tests::skipped_without_tool("Python's package mcap with lz4 and zstandard is not installed");
    None
}

#[test]
#[ignore = "Python's package mcap"]
fn recorded_drive_is_computed_identically_each_time() {
    let Some(python) = python_with_mcap() else { return };
    let (folder, _) = folder("[ros2]\n", SCENARIO, 3);
    let mut digests = Vec::new();
    for compression in ["none", "lz4", "zstd"] {
        let bag = format!("{compression}.mcap");
        let mut write = Command::new(&python);
        write.arg(sources().join("bag.py")).args(["drive", &bag, compression, "10"]);
        ok(&write.current_dir(folder.path()).output().unwrap());
        for threads in ["1", "3"] {
            let metrics = drive_recorded(&folder, &bag, compression, threads);
            digests.push(metrics["digest"].as_str().unwrap().to_owned());
            check_recorded(&metrics);
        }
    }
    assert!(digests.iter().all(|digest| *digest == digests[0]), "{digests:?}");
    let replayed = ok(&swerve(&folder, &["replay", "zstd/log.mcap", "--verify"]));
    assert!(replayed.contains(", as logged"), "{replayed}");
    // In a folder as `ros2 bag record` writes it, and truncated as by a crash.
    let bag = std::fs::read(folder.path().join("zstd.mcap")).unwrap();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    std::fs::write(folder.path().join("bag/metadata.yaml"), "rosbag2_bagfile_information:\n").unwrap();
    std::fs::write(folder.path().join("bag/bag_0.mcap"), &bag[..bag.len() / 2]).unwrap();
    let metrics = drive_recorded(&folder, "bag", "cut", "1");
    assert!(metrics["cut_off"][0].as_str().unwrap().contains("ends or is damaged after"), "{metrics}");
    assert!((2.0..9.0).contains(&metrics["seconds"].as_f64().unwrap()), "{metrics}");
    // A file that is not a recording.
    std::fs::write(folder.path().join("none.mcap"), "no recording").unwrap();
    let output = swerve(&folder, &["live", "recorded.toml", "--set", "source.rosbag=none.mcap"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success()
            && told.contains("source.rosbag: no messages that can be read: none.mcap: ends or is"),
        "{told}"
    );
}

fn check_recorded(metrics: &Value) {
    let [pose, velocity] = ["/localization/kinematic_state", "/vehicle/status/velocity_status"];
    assert_eq!(
        (&topic(metrics, pose)["messages"], &topic(metrics, pose)["used"]),
        (&500.into(), &500.into())
    );
    // The recorder's clock is 1.5 s ahead, and the fastest messages had no latency.
    let offset = topic(metrics, pose)["clock_offset_ms"].as_f64().unwrap();
    assert!((offset - 1500.0).abs() < 1e-6, "{offset}");
    let velocity = topic(metrics, velocity);
    assert_eq!((&velocity["used"], &velocity["behind"]), (&500.into(), &10.into()), "{velocity}");
    assert_eq!(topic(metrics, "/vehicle/status/steering_status")["malformed"], 10);
    assert_eq!(topic(metrics, "/sensing/imu/imu_raw")["wrong_type"], 10);
    let weather = topic(metrics, "/weather");
    assert_eq!((&weather["messages"], &weather["name"]), (&10.into(), &Value::Null));
    assert!((180..=200).contains(&steps(metrics, "planner")), "{}", metrics["operators"]);
    assert_eq!(steps(metrics, "tracker"), 200, "{}", metrics["operators"]);
    assert!(metrics["drive"]["driving_s"].as_f64().unwrap() > 9.0, "{}", metrics["drive"]);
}

/// The simulator's topics are recorded by a third-party reader and then driven on.
#[test]
#[ignore = "real clock, Cyclone DDS"]
fn recorded_topics_of_a_simulated_car_can_be_driven_on() {
    let Some(python) = python_with_mcap() else { return };
    let _alone = alone();
    let (folder, domain) = folder(CONFIG, SCENARIO, 4);
    let lines: Vec<String> = TOPICS.iter().map(|(topic, kind, _)| format!("{topic} {kind}")).collect();
    let file = folder.path().join("drive.mcap").display().to_string();
    let words = ["record".to_owned(), file, "zstd".into(), domain.to_string()];
    let peer = Peer::start(&python, "bag.py", &words, &lines.join("\n"));
    ok(&swerve(&folder, &[&RUN[..], &["--ros2"]].concat()));
    assert!(peer.end().as_u64().unwrap() > 1000);
    let [one, again] = ["1", "2"].map(|threads| drive_recorded(&folder, "drive.mcap", "again", threads));
    assert_eq!(one["digest"], again["digest"]);
    for name in ["/localization/kinematic_state", "/vehicle/status/velocity_status"] {
        let topic = topic(&one, name);
        let (messages, used) = (topic["messages"].as_f64().unwrap(), topic["used"].as_f64().unwrap());
        assert!(messages > 200.0 && used > 0.9 * messages, "{topic}");
    }
    assert!(steps(&one, "planner") > 50 && one["drive"]["driving_s"].as_f64().unwrap() > 3.0, "{one:#}");
}
