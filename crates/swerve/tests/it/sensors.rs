//! Sensors from a file: run, omitted from the log and recomputed; and their errors.

use serde_json::Value;

use crate::support::{Bench, SHORT};

const SENSORS: &str = r#"[log]
sensors = ["eye", "roof", "front", "odometry", "collisions"]

[camera.eye]
width_px = 64
height_px = 48
outputs = ["rgb", "depth"]
transfer_ms = 10

[lidar.roof]
beams_deg = [[-10, 0], [-3, 0], [0, 0]]
params = { columns = 180 }

[radar.front]
params = { range_max_m = 60 }
"#;

#[test]
fn sensor_drive_replays_from_its_log_on_any_number_of_threads() {
    let bench = Bench::new();
    bench.write("start.toml", &SHORT.replace("timeout_s = 10.0", "timeout_s = 0.4"));
    bench.write("sensors.toml", SENSORS);
    let digest = |out: &str, threads: &str| {
        let args = ["run", "start.toml", "-c", "sensors.toml", "--json", "--out", out, "--threads", threads];
        let metrics: Value = serde_json::from_str(&bench.good(&args)).unwrap();
        metrics["digest"].as_str().unwrap().to_owned()
    };
    let one = digest("one", "1");
    assert_eq!(digest("three", "3"), one);
    assert_eq!(digest("two", "2"), one);
    let said = bench.good(&["replay", "two/log.mcap", "--verify"]);
    for stream in ["eye.rgb", "eye.depth", "roof.points", "roof.truth", "front.scan", "front.truth"] {
        let row: Vec<&str> =
            said.lines().find(|line| line.starts_with(stream)).unwrap().split_whitespace().collect();
        assert!(row[1].parse::<u32>().unwrap() >= 2, "{said}");
        assert_eq!(row[2..], ["0", "0", "0"], "{said}");
    }
    assert!(said.contains(&format!("digest {one}, as logged")), "{said}");
}

#[test]
fn impossible_sensors_are_refused_with_all_their_errors() {
    let bench = Bench::new();
    let rig = "[log]\nsensors = [\"rof\"]\n[camera.eye]\nfov_deg = 180\n[lidar.roof]\nat_m = [1, 0, 0.5]\n\
               beams_deg = [[1, 0], [1, 0]]\n[radar.eye]\nperiod_ms = nan\n";
    bench.write("rig.toml", rig);
    for args in [&["check", "rig.toml"][..], &["run", "short.toml", "-c", "rig.toml"]] {
        let said = bench.swerve(args);
        assert_eq!(said.code, Some(1), "{said:?}");
        for start in [
            "rig.toml:2: log.sensors[0]: unknown sensor `rof`, expected one of ",
            "rig.toml:4: camera.eye.fov_deg: expected 0.1 to 179.9, found 180",
            "rig.toml:6: lidar.roof.at_m: expected a place outside the car's body",
            "rig.toml:7: lidar.roof.beams_deg[1]: expected beams that differ",
            "rig.toml:8: radar.eye: expected a unique name, found that of `[camera.eye]`",
            "rig.toml:9: radar.eye.period_ms: expected 1 to 60000, found NaN",
        ] {
            assert!(said.stderr.contains(start), "{start}: {}", said.stderr);
        }
        assert!(said.stderr.contains("; did you mean `roof`?"), "{}", said.stderr);
    }
}
