//! Drives that use poses estimated from the car's sensors.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::Path;

use mcap::Writer;
use mcap::records::MessageHeader;
use serde_json::Value;
use swerve_core::{Span, Time};
use swerve_geom::{Ego, Map, Point, Pose2, Transform};
use swerve_localization::map_file::MapFile;
use swerve_log::{Log, Record};
use swerve_msg::{EgoState, LidarPoint, PointCloud};
use swerve_ros2::AnyMessage;
use swerve_ros2::cdr;
use swerve_ros2::convert::{Epoch, cloud_to_ros, ego_to_ros};

use crate::support::Bench;

/// A road of 4 s between houses, with a standard GNSS receiver.
const ROAD: &str = r#"name = "road"
description = "A bend."

[road]
segments = [{ length_m = 30.0 }, { length_m = 60.0, curvature_1pm = 0.01 }]
lane_width_m = 3.5
left_m = 5.25
right_m = 1.75

[ego]
target_speed_mps = 9.0
end_m = 40.0

[end]
timeout_s = 10.0
"#;

const LIDAR: &str = r#"[lidar.roof]
preset = "vlp_32"
params = { columns = 900 }

[sensing.imu]
accel_noise_mps2 = 0.05
gyro_noise_radps = 0.002

[localization]
"#;

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("road.toml", ROAD);
    bench.write("lidar.toml", LIDAR);
    bench
}

fn driven(bench: &Bench, set: &[&str], threads: &str) -> Value {
    let mut args = vec!["run", "road.toml", "-c", "lidar.toml", "--json", "--threads", threads];
    args.extend(set.iter().flat_map(|set| ["--set", *set]));
    let metrics: Value = serde_json::from_str(&bench.good(&args)).unwrap();
    assert_eq!((metrics["verdict"].as_str(), metrics["end"].as_str()), (Some("completed"), Some("goal")));
    metrics
}

#[test]
fn lidar_localizes_the_car_where_fixes_do_not() {
    let bench = bench();
    let number = |metrics: &Value, key: &str| {
        metrics.pointer(&format!("/localization/{key}")).unwrap().as_f64().unwrap()
    };
    // With these fixes alone the ego would stop for its pose uncertainty.
    let eskf = driven(&bench, &["localization.localizer=eskf", "planning.lane_sigmas=0"], "1");
    assert!(number(&eskf, "median_m") > 0.2, "fixes with an offset are no better: {eskf}");
    for localizer in ["ndt", "eskf_ndt"] {
        let set = format!("localization.localizer={localizer}");
        let found = driven(&bench, &[&set], "1");
        assert!(number(&found, "median_m") < 0.03 && number(&found, "quality/nees") < 9.0, "{found}");
        assert!(number(&found, "heading_rms_deg") < 0.1 && number(&found, "silent_max_s") < 0.4, "{found}");
        assert_eq!(driven(&bench, &[&set], "3")["digest"], found["digest"], "threads change nothing");
    }
    // Without a map the odometry continues from the first fix and from turns with few features to match. Its error
    // grows along the way until the ego would stop for its pose uncertainty, too.
    let gnss = ["sensing.gnss.noise_m=0.01", "sensing.gnss.bias_m=0", "planning.lane_sigmas=0"];
    let found = driven(&bench, &[&["localization.localizer=odometry"], &gnss[..]].concat(), "1");
    assert!(number(&found, "max_m") < 0.6, "{found}");
}

#[test]
fn lidar_drive_replays_from_its_log() {
    let bench = bench();
    let set = "localization.localizer=eskf_ndt";
    bench.good(&[
        "run",
        "road.toml",
        "-c",
        "lidar.toml",
        "--set",
        set,
        "--out",
        "out",
        "--set",
        "log.sensors=[\"roof\"]",
    ]);
    let said = bench.good(&["replay", "out/log.mcap", "--verify"]);
    for stream in ["scan_matcher", "localizer.state", "localizer.quality"] {
        let row: Vec<&str> =
            said.lines().find(|line| line.starts_with(stream)).unwrap().split_whitespace().collect();
        assert!(row[1].parse::<u32>().unwrap() >= 10, "{said}");
        assert_eq!(row[2..], ["0", "0", "0"], "{said}");
    }
}

/// Two bends with corrected fixes; the IMU fails in the first.
const BENDS: &str = r#"name = "bends"
description = "Two bends."

[road]
segments = [{ length_m = 20.0 }, { length_m = 90.0, curvature_1pm = 0.025 }, { length_m = 40.0, curvature_1pm = -0.02 }, { length_m = 30.0 }]
lane_width_m = 4.0

[ego]
target_speed_mps = 8.0
end_m = 165.0

[end]
timeout_s = 40.0
"#;

/// IMU silent, frozen or noisy for three seconds: steering angle, wheels and fixes carry the pose, the reported mode is
/// never good and wrong for longer than a second, and the car stays in its lane.
#[test]
fn drive_continues_through_an_imu_failure() {
    let bench = Bench::new();
    bench.write("bends.toml", BENDS);
    for harm in ["drop = true", "freeze_ms = 3000", "noise = 20"] {
        let until_ms = if harm.starts_with("freeze") { 6010 } else { 9000 };
        let fault =
            format!("fault.unit={{ stream = \"imu\", {harm}, from_ms = 6000, until_ms = {until_ms} }}");
        let said = bench.good(&["run", "bends.toml", "-c", "localizer", "--set", &fault, "--json"]);
        let metrics: Value = serde_json::from_str(&said).unwrap();
        let number = |key: &str| metrics.pointer(&format!("/localization/{key}")).unwrap().as_f64().unwrap();
        println!("{harm}: {}", metrics["localization"]);
        assert_eq!(metrics["verdict"].as_str(), Some("completed"), "{harm}: {metrics}");
        assert!(number("quality/false_good_max_s") <= 1.0, "{harm}");
        // A corrected fix is off by 2 cm; a yaw rate wrong by a tenth for three seconds turns a path of 24 m by 3.4
        // degrees.
        assert!(number("max_m") < 0.5 && number("heading_rms_deg") < 3.4, "{harm}");
        assert!((0.03..0.3).contains(&number("quality/coasting_share")), "{harm}");
    }
}

/// A receiver whose fixes are 0.06 to 1 m worse than they report, from the start or after 6 s: the filter measures the
/// noise, and the car stays in its lane.
#[test]
fn drive_continues_with_fixes_of_understated_noise() {
    let bench = Bench::new();
    bench.write("bends.toml", BENDS);
    for (noise_m, from_ms) in [(0.06, 0), (0.3, 0), (0.3, 6000), (1.0, 0), (1.0, 6000)] {
        let fault = format!("fault.worse={{ stream = \"gnss\", noise = {noise_m}, from_ms = {from_ms} }}");
        let said = bench.good(&["run", "bends.toml", "-c", "localizer", "--set", &fault, "--json"]);
        let metrics: Value = serde_json::from_str(&said).unwrap();
        let number = |key: &str| metrics.pointer(&format!("/localization/{key}")).unwrap().as_f64().unwrap();
        println!("{noise_m} m: {}", metrics["localization"]);
        assert_eq!(metrics["verdict"].as_str(), Some("completed"), "{noise_m}, {from_ms}: {metrics}");
        assert!(number("quality/false_good_max_s") <= 1.0, "{noise_m}, {from_ms}");
        assert!(
            number("quality/nees") < 6.0 && number("max_m") < 0.3 + 0.7 * noise_m,
            "{noise_m}, {from_ms}"
        );
    }
}

/// A lead car that brakes with 5 m/s² in a bend.
const BRAKES: &str = r#"name = "brakes"
description = "A lead car brakes in a bend."

[road]
segments = [{ length_m = 40.0 }, { length_m = 200.0, curvature_1pm = 0.0125 }, { length_m = 100.0 }]
lane_width_m = 3.5
left_m = 1.75
right_m = 1.75

[ego]
target_speed_mps = 12.0
end_m = 300.0

[[actor]]
name = "lead"
kind = "car"
s_m = 24.7
d_m = 0.0
motion = [{ drive = { along = "road", speeds = [[0.0, 12.0], [6.0, 12.0], [8.4, 0.0]] } }]

[end]
timeout_s = 20.0
standstill = { near = "lead", within_m = 14.0, for_s = 2.0 }
"#;

/// Wheels that repeat their reading from 3 s on while the car brakes behind a lead car are not used: the error stays
/// that of a sound drive, and the ego stops in its lane.
#[test]
fn frozen_wheels_do_not_move_the_pose_of_a_car_that_brakes() {
    let bench = Bench::new();
    bench.write("brakes.toml", BRAKES);
    let fault = r#"fault.frozen={ stream = "odometry", freeze_ms = 60000, from_ms = 3000 }"#;
    for seed in ["806", "807"] {
        let run = ["run", "brakes.toml", "-c", "localizer", "--seed", seed, "--set", fault, "--json"];
        let metrics: Value = serde_json::from_str(&bench.good(&run)).unwrap();
        let number = |key: &str| metrics.pointer(&format!("/localization/{key}")).unwrap().as_f64().unwrap();
        assert_eq!(metrics["verdict"].as_str(), Some("avoided"), "{seed}: {metrics}");
        assert!(number("max_m") < 0.3 && number("quality/nees") < 6.0, "{seed}: {}", metrics["localization"]);
    }
}

/// A lidar that is blind for three seconds is matched to the map again within a second of its first scan.
#[test]
fn blind_lidar_is_relocalized_at_the_filters_pose() {
    let bench = bench();
    let fault = "fault.blind={ stream = \"roof.points\", drop = true, from_ms = 3000, until_ms = 6000 }";
    let set = ["--set", "localization.localizer=eskf_ndt", "--set", fault, "--out", "out"];
    bench.good(&[&["run", "street", "-c", "lidar.toml"], &set[..]].concat());
    let log = Log::read(&bench.path("out/log.mcap")).unwrap();
    let matched: Vec<i64> = log
        .records
        .iter()
        .filter_map(|record| match record {
            Record::Publication(of) if of.stream.stream == "scan_matcher" => Some(of.header.stamp),
            _ => None,
        })
        .map(|stamp| (stamp - Time::ZERO).ns() / 1_000_000)
        .collect();
    let within =
        |from_ms: i64, until_ms: i64| matched.iter().filter(|ms| (from_ms..until_ms).contains(ms)).count();
    assert!(within(2000, 3000) >= 9, "{matched:?}");
    assert_eq!(within(3200, 6000), 0, "{matched:?}");
    assert!(within(6000, 7000) >= 8 && within(7000, 8000) >= 9, "{matched:?}");
}

#[test]
fn map_from_a_file_is_used_or_refused() {
    let bench = bench();
    bench.good(&["map", "build", "road.toml", "-o", "road.map"]);
    let set = ["localization.localizer=ndt", "localization.map=road.map"];
    let found = driven(&bench, &set, "1");
    assert!(found.pointer("/localization/median_m").unwrap().as_f64().unwrap() < 0.05, "{found}");
    let bytes = std::fs::read(bench.path("road.map")).unwrap();
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    let mut other = bytes.clone();
    other[8] = 7;
    for (name, bytes, why) in [
        ("cut.map", &bytes[..bytes.len() / 2], "truncated or damaged"),
        ("flipped.map", &flipped[..], "its digest is"),
        ("other.map", &other[..], "found version 7"),
        ("text.map", &b"not a map"[..], "it begins otherwise"),
    ] {
        std::fs::write(bench.path(name), bytes).unwrap();
        let map = format!("localization.map={name}");
        let said = bench.swerve(&["run", "road.toml", "-c", "lidar.toml", "--set", set[0], "--set", &map]);
        assert_eq!(said.code, Some(1), "{said:?}");
        assert!(said.stderr.contains("localization.map: ") && said.stderr.contains(name), "{said:?}");
        assert!(said.stderr.contains(why), "{said:?}");
    }
    let said = bench.swerve(&[
        "run",
        "road.toml",
        "-c",
        "lidar.toml",
        "--set",
        set[0],
        "--set",
        "localization.map=none.map",
    ]);
    assert!(said.code == Some(1) && said.stderr.contains("there is no such file"), "{said:?}");
}

/// Fixes are late, drift, jump and are missing for a hundred metres. The filter's uncertainty is consistent with its
/// error; where it is too large for the lane, the car stops and reports it.
#[test]
fn city_receiver_guides_the_car_until_its_uncertainty_stops_it() {
    let bench = Bench::new();
    let drive = |threads: &str| -> Value {
        let said = bench.good(&["run", "lane", "-c", "urban_gnss", "--json", "--threads", threads]);
        serde_json::from_str(&said).unwrap()
    };
    let metrics = drive("1");
    let number = |key: &str| metrics.pointer(&format!("/localization/{key}")).unwrap().as_f64().unwrap();
    println!("{}", metrics["localization"]);
    assert_eq!(metrics["verdict"].as_str(), Some("stopped"), "{metrics}");
    // The zone without fixes begins at 150 m.
    let way_m = metrics.pointer("/drive/path_length_m").unwrap().as_f64().unwrap();
    let uncertain_s = metrics.pointer("/plans/pose_uncertain_since_s").unwrap().as_f64();
    assert!(way_m > 150.0 && uncertain_s.is_some() && metrics["left_road_at_s"].is_null(), "{metrics}");
    assert!(number("silent_max_s") < 0.1, "the stored pose is carried on until the first fix");
    assert!(number("quality/coasting_share") > 0.5, "it stands in the zone without fixes");
    assert!(number("quality/lost_share") < 0.04 && number("quality/nees") < 9.0);
    assert!(number("max_m") < 1.5);
    assert_eq!(drive("3")["digest"], metrics["digest"], "threads change nothing");
}

/// A map of the street built from a drive's log is the same whether the log holds the clouds or they are recomputed,
/// and a lidar localizes in it.
#[test]
fn map_of_a_log_equals_that_of_the_scenario() {
    let bench = bench();
    let lidar = ["street", "-c", "lidar.toml", "--set", "lidar.roof.params.columns=450"];
    let drive = |out: &str, images: &str| {
        let set = ["--set", "log.sensors=[\"roof\"]", "--set", images, "--out", out];
        bench.good(&[&["run"], &lidar[..], &set[..]].concat());
    };
    drive("none", "log.images=none");
    drive("all", "log.images=lossless");
    bench.good(&["map", "build", "none/log.mcap", "-o", "none.map"]);
    bench.good(&["map", "build", "all/log.mcap", "-o", "all.map", "--lidar", "roof"]);
    let [none, all] = ["none.map", "all.map"].map(|map| std::fs::read(bench.path(map)).unwrap());
    assert!(none == all && none.len() > 100_000, "{} {}", none.len(), all.len());
    let said = bench.good(&[&["map", "check"], &lidar[..], &["--map", "none.map", "--json"]].concat());
    let found: Value = serde_json::from_str(&said).unwrap();
    println!("{found}");
    assert!(
        found["ndt_rms_2d_m"].as_f64().unwrap() < 0.05 && found["ndt_unmatched"].as_u64() == Some(0),
        "{found}"
    );

    let refused = |args: &[&str], why: &str| {
        let said = bench.swerve(&[&["map", "build"], args, &["-o", "x.map"]].concat());
        assert!(said.code == Some(1) && said.stderr.contains(why), "{said:?}");
        assert_eq!(said.stderr.lines().count(), 1, "{said:?}");
    };
    bench.good(&["run", "road.toml", "-c", "lidar.toml", "--out", "blind"]);
    refused(&["blind/log.mcap"], "blind/log.mcap: expected a log with a lidar's clouds");
    refused(
        &["none/log.mcap", "--lidar", "eye"],
        "expected --lidar with one of the lidars that it has clouds of: roof",
    );
    refused(&["none/log.mcap", "--set", "seed=2"], "expected none with logs");
    refused(&["absent.mcap"], "absent.mcap");
}

/// A vehicle that reports its pose, with a lidar that faces left.
const VEHICLE: &str = r#"live = { route = "road.toml" }
ros2 = { vehicle = "plain" }
source = { rosbag = "bag.mcap" }
lidar.lidar = { at_m = [1.4, 0.2, 1.9], yaw_deg = 90.0 }
"#;

/// Writes a rosbag2 log of messages in order: topic, stamp, message.
fn write_bag(path: &Path, epoch: Epoch, messages: &[(&str, Time, AnyMessage)]) {
    let mut writer = Writer::new(File::create(path).unwrap()).unwrap();
    let mut channels = BTreeMap::new();
    for (topic, stamp, message) in messages {
        let channel_id = *channels.entry(*topic).or_insert_with(|| {
            let schema = writer.add_schema(&message.kind().type_name(), "ros2msg", b"").unwrap();
            writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let time = (epoch.ns + stamp.ns()) as u64;
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &cdr::encode(message)).unwrap();
    }
    writer.finish().unwrap();
}

/// Two walls along x, six metres to each side of the vehicle's start.
fn walls() -> Vec<Point<Map>> {
    let along = (-10..50).flat_map(|x| [0.2, 0.5, 0.8].map(|part| f64::from(x) + part));
    let point =
        |x| [-6.5, 6.5].into_iter().flat_map(move |y| [0.4, 0.6, 1.4, 1.6].map(|z| Point::new(x, y, z)));
    along.flat_map(point).collect()
}

/// Builds a map from recorded poses and clouds, with each point placed at its own instant.
#[test]
fn map_of_a_vehicle_log_holds_the_surroundings() {
    let bench = bench();
    bench.write("vehicle.toml", VEHICLE);
    let epoch = Epoch { ns: 1_700_000_000_000_000_000 };
    let ego = |stamp: Time| {
        let pose = Pose2::new(0.0, 0.0, 0.1).ahead(8.0 * stamp.as_secs());
        EgoState { stamp, pose, speed_mps: 8.0, ..EgoState::default() }
    };
    let mount = Point::new(1.4, 0.2, 1.9);
    let ego_from_lidar =
        Transform::<Ego, swerve_geom::Lidar>::from_roll_pitch_yaw(mount, 0.0, 0.0, 90.0_f64.to_radians());
    let walls = walls();
    let mut messages = Vec::new();
    for ms in (0..4000).step_by(20) {
        let state = ego(Time::from_ms(ms));
        let odometry = AnyMessage::Odometry(ego_to_ros(&state, epoch, "map", "base_link"));
        messages.push(("/odometry", state.stamp, odometry));
        if ms % 100 != 0 || ms == 0 {
            continue;
        }
        let mut cloud = PointCloud { stamp: state.stamp, ..PointCloud::default() };
        for (k, wall) in walls.iter().enumerate() {
            let ago = Span::from_ns(-100_000_000 + (k * 100_000_000 / walls.len()) as i64);
            let Pose2 { x_m, y_m, heading_rad, .. } = ego(state.stamp + ago).pose;
            let at = Point::new(x_m, y_m, 0.0);
            let map_from_ego = Transform::<Map, Ego>::from_roll_pitch_yaw(at, 0.0, 0.0, heading_rad);
            let there = ((map_from_ego * ego_from_lidar).inverse() * *wall).coords;
            let place_m = [there.x, there.y, there.z].map(|x| x as f32);
            cloud.push(LidarPoint { place_m, intensity: 0.5, ring: 0, time_offset_s: ago.as_secs() as f32 });
        }
        // The vehicle's own roof is excluded from the map.
        cloud.push(LidarPoint { place_m: [1.0, 0.0, -0.5], intensity: 0.5, ring: 0, time_offset_s: 0.0 });
        messages.push((
            "/points",
            state.stamp,
            AnyMessage::PointCloud2(cloud_to_ros(&cloud, epoch, "lidar")),
        ));
    }
    write_bag(&bench.path("bag.mcap"), epoch, &messages);

    let lossless = ["live", "vehicle.toml", "--out", "drive", "--set", "log.images=lossless"];
    bench.good(&lossless);
    let said = bench.good(&["map", "build", "drive/log.mcap", "-o", "drive.map"]);
    assert!(said.contains(&format!("of {} points of 39 turns", 39 * walls.len())), "{said}");
    let map = MapFile::read(&std::fs::read(bench.path("drive.map")).unwrap()).unwrap();
    let expected: BTreeSet<[i32; 3]> = walls
        .iter()
        .map(|wall| [wall.coords.x, wall.coords.y, wall.coords.z].map(|x| x.floor() as i32))
        .collect();
    let found: BTreeSet<[i32; 3]> = map.voxels().iter().map(|voxel| voxel.index).collect();
    assert_eq!(found, expected);
    let off = map.voxels().iter().flat_map(|voxel| voxel.mean_m).fold(0.0, |most: f32, x| most.max(x.abs()));
    assert!(off < 0.02, "{off} m off the middle");

    // Without recorded clouds there is no map: a real vehicle's cannot be recomputed.
    bench.good(&["live", "vehicle.toml", "--out", "bare"]);
    let said = bench.swerve(&["map", "build", "bare/log.mcap", "-o", "bare.map"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.stderr.contains("record it with log.images = \"lossless\""), "{said:?}");
}
