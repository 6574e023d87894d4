//! Numeric settings: a drive at the minimum and at the maximum of each ends in bounded time and memory.

use std::fmt::Write as _;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

use crate::support::{Bench, Said, alone};

/// Limits of address space and time of a drive.
const MEMORY_MIB: u64 = 4096;
const TIME_S: u32 = 60;

/// Keys of commands other than `swerve run`, and keys that no drive reads.
const NOT_DRIVEN: [&str; 3] = ["clock.", "live.", "localization.stored_pose"];

/// Settings that a key needs to take effect in a drive, by key prefix.
const NEEDED: [(&str, &str); 27] = [
    ("camera.NAME.matrix", "log.sensors = ['any']\ncamera.any = { width_px = 64, height_px = 36 }"),
    ("camera.NAME.width_px", "log.sensors = ['any']\ncamera.any = { height_px = 36 }"),
    ("camera.NAME.height_px", "log.sensors = ['any']\ncamera.any = { width_px = 64 }"),
    (
        "camera.NAME.readout_ms",
        "log.sensors = ['any']\ncamera.any = { width_px = 64, height_px = 36, rolling = true }",
    ),
    (
        "camera.NAME.exposure_ms",
        "log.sensors = ['any']\ncamera.any = { width_px = 64, height_px = 36, blur_samples = 4 }",
    ),
    (
        "camera.NAME.blur_samples",
        "log.sensors = ['any']\ncamera.any = { width_px = 64, height_px = 36, exposure_ms = 20 }",
    ),
    ("camera", "log.sensors = ['any']\ncamera.any = { width_px = 64, height_px = 36 }"),
    (
        "execution.params",
        "execution.model = 'dynamic_deadlines'\nperception = { detector = 'efficientdet-d5@d3', ladder = true }\n\
         planning.ladder = 'fot@d3'",
    ),
    (
        "execution",
        "execution.model = 'periodic'\nperception = { detector = 'efficientdet-d5@d3', ladder = true }\n\
         planning.ladder = 'fot@d3'",
    ),
    (
        "fault.NAME.flip_bits",
        "log.sensors = ['any']\ncamera.any = { width_px = 64, height_px = 36 }\nfault.any.stream = 'any.rgb'",
    ),
    ("fault.NAME.probability", "fault.any = { stream = 'obstacles', noise = 1.0 }"),
    ("fault.NAME.from_ms", "fault.any = { stream = 'obstacles', noise = 1.0, until_ms = 86400000.0 }"),
    ("fault.NAME.until_ms", "fault.any = { stream = 'obstacles', noise = 1.0 }"),
    ("fault", "fault.any.stream = 'obstacles'"),
    ("gate", "gate.enabled = true"),
    ("lidar.NAME.params.columns", "log.sensors = ['any']\nlidar.any = {}"),
    ("lidar", "log.sensors = ['any']\nlidar.any = { params = { columns = 90 } }"),
    ("perception", "perception.detector = 'custom'"),
    ("planning.lane_sigmas", "localization.localizer = 'eskf'"),
    ("planning.rules", "planning.preset = 'paper'"),
    ("planning.slow_by_sigma_m", "localization.localizer = 'eskf'"),
    ("prediction.truth", "prediction.predictor = 'truth'"),
    ("process", "process.any.operators = ['planner']"),
    ("radar", "log.sensors = ['any']\nradar.any = {}"),
    ("resource", "operator.planner.uses = 'any'"),
    ("sensing.mount", "sensing.mount = { x_m = 1.0, y_m = 0.0, z_m = 1.9, yaw_rad = 0.0 }"),
    ("sensing.", "localization.localizer = 'eskf'\nlog.sensors = ['gnss', 'odometry']"),
];

/// Keys set to the same end together, because one narrows the range of the other.
const PAIRS: [[&str; 2]; 5] = [
    ["execution.params.detector_min_s", "execution.params.detector_max_s"],
    ["execution.params.planner_min_s", "execution.params.planner_max_s"],
    ["execution.params.planner_share_empty", "execution.params.planner_share_full"],
    ["gate.enable_at_ms", "gate.release_at_ms"],
    ["planning.params.horizon_min_s", "planning.params.horizon_max_s"],
];

/// A person steps out so late that the car brakes and swerves at its limits.
const SCENARIO: &str = r#"name = "brakes"

[road]
segments = [{ length_m = 80.0 }]
lane_width_m = 4.0
left_m = 6.0
right_m = 2.0

[ego]
target_speed_mps = 12.0
end_m = 70.0

[[actor]]
name = "person"
kind = "pedestrian"
s_m = 22.0
d_m = -1.6
trigger = { distance = { to = "ego", within_m = 18.0 } }
motion = [{ walk = { speed_mps = 2.0, distance_m = 5.0, direction = "left" } }]

[end]
timeout_s = 2.5
"#;

/// One drive: its name in messages, and its configuration.
struct Drive {
    name: String,
    config: String,
}

/// A drive at each end of every numeric key of a configuration.
fn drives(keys: &[Value]) -> Vec<Drive> {
    let text = |key: &Value, field: &str| key[field].as_str().unwrap_or_default().to_owned();
    let mut drives = Vec::new();
    for key in keys {
        let (name, form, with) = (text(key, "key"), text(key, "type"), text(key, "only_with"));
        let range = text(key, "range");
        let words: Vec<&str> = range.split([' ', ',']).collect();
        let [low, "to", high, ..] = words[..] else { continue };
        let is_driven = !NOT_DRIVEN.iter().any(|start| name.starts_with(start)) && !with.starts_with("kind");
        if !is_driven || !form.ends_with("number") || low.parse::<f64>().is_err() {
            continue;
        }
        for end in [low, high] {
            drives.push(Drive {
                name: format!("{name} = {end} {with}"),
                config: config(&name, &form, &with, end),
            });
        }
    }
    drives
}

/// Configuration with a key at one end of its range.
fn config(name: &str, form: &str, with: &str, end: &str) -> String {
    let place = name.replace("planning.cost.NAME.NAME", "planning.cost.fot.fast");
    let place = place.replace("operator.NAME", "operator.planner").replace("NAME", "any");
    let needed = NEEDED.iter().find(|(start, _)| name.starts_with(start)).map_or("", |(_, needed)| needed);
    let mut config: toml::Table = needed.parse().unwrap();
    let mut set = |key: &str, value: toml::Value| swerve_text::set(&mut config, key, value).unwrap();
    let section = if name.starts_with("perception") { "perception.tracker" } else { "planning" };
    for setting in with.split(", ").filter(|setting| !setting.is_empty()) {
        let (key, value) = setting.split_once(" = ").unwrap();
        set(&format!("{section}.{key}"), value.trim_matches('"').into());
    }
    if let Some((tyre, _)) = place.rsplit_once('.').filter(|(tyre, _)| tyre.starts_with("sim.vehicle.tyre.l"))
    {
        for (key, value) in [("stiffness", 22.0), ("shape", 1.4), ("curvature", 0.0)] {
            set(&format!("{tyre}.{key}"), value.into());
        }
    }
    if let Some(work) = place.strip_suffix(".base_ms") {
        set(&format!("{work}.per_unit_us"), 1.0.into());
    }
    let mut value = match form.contains("whole") {
        true => toml::Value::Integer(end.parse().unwrap()),
        false => toml::Value::Float(end.parse().unwrap()),
    };
    for array in form.split("array of ").skip(1) {
        let count = array.split_once(" x ").and_then(|(count, _)| count.parse().ok()).unwrap_or(1);
        value = toml::Value::Array(vec![value; count]);
    }
    let partner =
        PAIRS.iter().find(|pair| pair.contains(&name)).into_iter().flatten().find(|other| **other != name);
    if let Some(partner) = partner {
        set(partner, value.clone());
    }
    set(&place, value);
    toml::to_string(&config).unwrap()
}

/// Result of a drive.
enum Outcome {
    Driven,
    /// One error, caused by another key or the scenario.
    Refused,
    /// A signal, a panic, a time-out, or more than one error.
    Fault(String),
}

fn outcome(bench: &Bench, number: usize, drive: &Drive) -> Outcome {
    let (config, out) = (format!("{number}.toml"), format!("out{number}"));
    bench.write(&config, &drive.config);
    let limit = MEMORY_MIB << 10;
    let seconds = if drive.name.starts_with("camera") { 0.5 } else { 2.5 };
    let line = format!(
        "ulimit -v {limit}; ulimit -c 0; exec timeout -k 1 {TIME_S} swerve run brakes.toml -c {config} \
         --set end.timeout_s={seconds} --out {out} --threads 1"
    );
    let Said { code, stderr: error, .. } = bench.shell(&line);
    std::fs::remove_dir_all(bench.path(&out)).ok();
    let errors = error.lines().filter(|line| line.starts_with("error")).count();
    let first = error.lines().take(3).collect::<Vec<_>>().join(" / ");
    match code {
        Some(124 | 137) => Outcome::Fault(format!("no end within {TIME_S} s: {first}")),
        // Exit 1 without an error: the result is not as the scenario expects.
        Some(0 | 1) if errors == 0 && !error.contains("panicked") => Outcome::Driven,
        Some(1) if errors == 1 && !error.contains("panicked") => Outcome::Refused,
        code => Outcome::Fault(format!("exit {code:?}: {first}")),
    }
}

/// Computes for a minute or more: `.ci/run` runs it beside the tests with the real clock.
mod long {
    use super::*;

    #[test]
    #[ignore = "minutes"]
    fn drive_at_either_end_of_every_numeric_setting_ends() {
        let _alone = alone();
        let bench = Bench::new();
        bench.write("brakes.toml", SCENARIO);
        let keys: Vec<Value> = serde_json::from_str(&bench.good(&["keys", "--json"])).unwrap();
        let drives = drives(&keys);
        assert!(drives.len() > 700, "{}", drives.len());
        let (next, refused, faults) = (AtomicUsize::new(0), AtomicUsize::new(0), Mutex::new(String::new()));
        let workers = std::thread::available_parallelism().map_or(2, std::num::NonZero::get);
        let work = || {
            while let Some((number, drive)) = {
                let number = next.fetch_add(1, Ordering::Relaxed);
                drives.get(number).map(|drive| (number, drive))
            } {
                match outcome(&bench, number, drive) {
                    Outcome::Driven => {}
                    Outcome::Refused => {
                        refused.fetch_add(1, Ordering::Relaxed);
                    }
                    Outcome::Fault(fault) => {
                        let mut faults = faults.lock().unwrap_or_else(PoisonError::into_inner);
                        let _written = writeln!(faults, "{}: {fault}", drive.name);
                    }
                }
            }
        };
        std::thread::scope(|scope| (0..workers).for_each(|_| drop(scope.spawn(work))));
        let faults = faults.into_inner().unwrap();
        assert!(faults.is_empty(), "of {} drives:\n{faults}", drives.len());
        // Without the settings a key needs, nothing would be driven.
        let refused = refused.into_inner();
        assert!(refused < 40, "{refused} of {} drives are refused", drives.len());
    }
}
