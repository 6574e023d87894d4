//! Sensors of all kinds during a short drive.

use std::path::Path;

use swerve::replay::replay;
use swerve_core::{Span, Time};
use swerve_drive::{Outcome, drive_pipeline, left_out_of_logs, read_scenario, run_start};
use swerve_flow::{Event, Observer};
use swerve_log::{Log, Recorder};
use swerve_msg::truth::{PointInstances, RadarSources, WorldState};
use swerve_msg::{ActorId, Lanes, PointCloud};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;
use swerve_text::{Document, parse_assignment};

use crate::common;

const SCENARIO: &str = "person_behind_truck";

const SENSORS: &str = r#"
[log]
sensors = ["eye", "roof", "front", "gnss", "odometry", "collisions", "lane_invasions", "red_lights"]

[camera.eye]
width_px = 64
height_px = 48
outputs = ["rgb", "depth", "semantic", "instance"]
exposure_ms = 10
blur_samples = 2
readout_ms = 6
transfer_ms = 9

[lidar.roof]
beams_deg = [[-15, 0], [-8, 1], [-3, 0], [0, 0]]
rate_hz = 20
readout_ms = 2
transfer_ms = 10
params = { columns = 123 }

[radar.front]
period_ms = 40
exposure_ms = 20
transfer_ms = 45
"#;

fn config(text: &str, sets: &[&str]) -> Setup {
    let sets = common::sets(sets);
    let document = Document::parse("test", text).unwrap();
    Setup::from_document(&document, &sets).unwrap()
}

/// Drives the first 0.3 s.
fn drive(config: &Setup, observers: &mut [&mut dyn Observer]) -> Outcome {
    drive_in(&read_scenario(&common::scenario_file(SCENARIO)).unwrap(), config, observers)
}

fn drive_in(scenario: &Scenario, config: &Setup, observers: &mut [&mut dyn Observer]) -> Outcome {
    let mut pipeline = Pipeline::build(config, scenario).unwrap();
    pipeline.until = Time::from_ms(300);
    drive_pipeline(pipeline, config.seed, 2, observers).unwrap()
}

/// Publications needed by the tests.
#[derive(Default)]
struct Recorded {
    /// Stream, stamp, publication time.
    times: Vec<(String, Time, Time)>,
    clouds: Vec<(PointCloud, PointInstances)>,
    sources: Vec<RadarSources>,
    last: Option<PointCloud>,
}

impl Recorded {
    /// Starts with the truck near by.
    fn of(config: &Setup) -> Self {
        let text = std::fs::read_to_string(common::scenario_file(SCENARIO)).unwrap();
        let scenario = Scenario::parse("near", &text.replace("s_m = 110.0", "s_m = 25.0")).unwrap();
        let mut seen = Self::default();
        drive_in(&scenario, config, &mut [&mut seen]);
        seen
    }

    /// Stamps and publication times of a stream.
    fn stream(&self, name: &str) -> Vec<(Time, Time)> {
        self.times.iter().filter(|(stream, ..)| stream == name).map(|&(_, stamp, at)| (stamp, at)).collect()
    }
}

impl Observer for Recorded {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(stamp) = publication.stamp else { return };
        self.times.push((publication.stream.to_owned(), stamp, publication.visible_at));
        let Some(payload) = publication.payload else { return };
        if let Some(cloud) = payload.downcast_ref::<PointCloud>() {
            self.last = Some(cloud.clone());
        } else if let Some(truth) = payload.downcast_ref::<PointInstances>() {
            self.clouds.push((self.last.take().unwrap(), truth.clone()));
        } else if let Some(sources) = payload.downcast_ref::<RadarSources>() {
            self.sources.push(sources.clone());
        }
    }
}

#[test]
fn unused_sensor_is_not_in_the_graph() {
    let scenario = read_scenario(&common::scenario_file(SCENARIO)).unwrap();
    let operators = |config: &Setup| -> Vec<String> {
        let graph = Pipeline::build(config, &scenario).unwrap().graph;
        graph.describe().unwrap().operators.iter().map(|operator| operator.name.to_string()).collect()
    };
    let none = operators(&config(SENSORS, &["log.sensors=[]"]));
    assert_eq!(none, operators(&Setup::default()));
    let one = operators(&config(SENSORS, &["log.sensors=[\"roof\"]"]));
    assert_eq!(one.len(), none.len() + 1);
    let all = operators(&config(SENSORS, &[]));
    for name in ["eye", "roof", "front", "gnss", "odometry", "collisions", "lane_invasions", "red_lights"] {
        assert!(all.iter().any(|operator| operator == name), "{name} in {all:?}");
    }
}

#[test]
fn sensor_data_is_visible_after_exposure_readout_and_transfer() {
    let config = config(SENSORS, &[]);
    let seen = Recorded::of(&config);
    // Half of the exposure, readout, transfer; and the frame period.
    for (stream, after_ms, every_ms) in [
        ("eye.rgb", 20, 50),
        ("eye.instance", 20, 50),
        ("roof.points", 12, 50),
        ("roof.truth", 12, 50),
        ("front.scan", 55, 40),
        ("front.truth", 55, 40),
    ] {
        let times = seen.stream(stream);
        let wanted = (300 - every_ms - after_ms) / every_ms;
        assert!(times.len() as i64 >= wanted, "{stream}: {times:?}");
        assert!(
            times.iter().all(|(stamp, at)| *at - *stamp == Span::from_ms(after_ms)),
            "{stream}: {times:?}"
        );
        let even = times.windows(2).all(|pair| pair[1].0 - pair[0].0 == Span::from_ms(every_ms));
        assert!(even, "{stream} loses none: {times:?}");
    }
    // A configured run time is added before the transfer, which then becomes a delay of the stream.
    let slow = self::config(SENSORS, &["operator.eye.runtime={ fixed_ms = 3 }"]);
    let times = Recorded::of(&slow).stream("eye.rgb");
    assert!(times.iter().all(|(stamp, at)| *at - *stamp == Span::from_ms(3)), "{times:?}");
}

#[test]
fn event_sensors_publish_at_every_simulation_step() {
    let seen = Recorded::of(&config(SENSORS, &[]));
    let world = seen.stream("world");
    assert!(world.len() >= 60);
    for stream in ["collisions", "lane_invasions", "red_lights"] {
        assert_eq!(seen.stream(stream), world, "{stream}");
    }
    let odometry = seen.stream("odometry");
    assert!(odometry.len() >= 13 && odometry.windows(2).all(|p| p[1].0 - p[0].0 == Span::from_ms(20)));
}

#[test]
fn lidar_scan_holds_the_surroundings_with_the_time_of_each_point() {
    let seen = Recorded::of(&config(SENSORS, &[]));
    assert!(seen.clouds.len() >= 4);
    let truck = ActorId(1);
    for (cloud, truth) in &seen.clouds {
        assert_eq!((cloud.check(), cloud.stamp, truth.instance.len()), (Ok(()), truth.stamp, cloud.len()));
        assert!(cloud.len() > 123, "{cloud:?}");
        let offsets = &cloud.time_offset_s;
        assert!(offsets.iter().all(|s| (-0.0501..=0.0).contains(s)), "{offsets:?}");
        assert!(offsets.windows(2).all(|pair| pair[0] <= pair[1]));
        assert!(offsets.last().unwrap() - offsets[0] > 0.04, "a whole turn");
        // The lowest beams meet the road, 1.9 m below.
        let ground: Vec<f32> =
            (0..cloud.len()).filter(|&k| cloud.ring[k] == 0).map(|k| cloud.z_m[k]).collect();
        assert!(
            ground.len() > 50 && ground.iter().filter(|z| (*z + 1.9).abs() < 0.3).count() * 2 > ground.len()
        );
        assert!(truth.instance.contains(&truck.0), "the truck is seen");
        assert!(!truth.instance.contains(&swerve_stack::street::EGO_INSTANCE));
    }
    assert!(seen.sources.iter().any(|scan| scan.sources.contains(&Some(truck))), "{:?}", seen.sources);
}

#[test]
fn lidar_scan_fires_every_column_once_wherever_steps_end() {
    // A scan of whole steps; one that ends between two; and simulation steps that the lidar skips.
    for (rate_hz, sets) in [
        (20.0, &["lidar.roof.rate_hz=20"][..]),
        (17.0, &["lidar.roof.rate_hz=17"]),
        (17.0, &["lidar.roof.rate_hz=17", "operator.roof.runtime={ fixed_ms = 12 }"]),
    ] {
        let seen = Recorded::of(&config(SENSORS, &[sets, &["lidar.roof.params.dropout=0"]].concat()));
        assert!(seen.clouds.len() >= 3, "{sets:?}");
        let mut begins = Vec::new();
        for (cloud, _) in &seen.clouds {
            // The lowest beam meets the road in every column, evenly in time.
            let at: Vec<f64> = (0..cloud.len())
                .filter(|&k| cloud.ring[k] == 0)
                .map(|k| cloud.stamp.as_secs() + f64::from(cloud.time_offset_s[k]))
                .collect();
            assert_eq!(at.len(), 123, "{sets:?}");
            let even = |pair: &[f64]| (pair[1] - pair[0] - 1.0 / rate_hz / 123.0).abs() < 1e-6;
            assert!(at.windows(2).all(even), "{sets:?}: {at:?}");
            begins.push(at[0]);
        }
        let follow = |pair: &[f64]| (pair[1] - pair[0] - 1.0 / rate_hz).abs() < 1e-6;
        assert!(begins.windows(2).all(follow), "{sets:?}: {begins:?}");
    }
}

#[test]
fn threads_do_not_affect_the_data() {
    let scenario = read_scenario(&common::scenario_file("person_crossing")).unwrap();
    // Without transfer, images are published at their stamp and read at once.
    let at_once = [
        "camera.eye.exposure_ms=0",
        "camera.eye.readout_ms=0",
        "camera.eye.transfer_ms=0",
        "camera.eye.width_px=160",
        "camera.eye.height_px=120",
        "operator.lines={ kind = 'lanes', reads = { image = 'eye.rgb' }, runtime = { fixed_ms = 20 } }",
    ];
    for sets in [&[][..], &at_once] {
        let config = config(SENSORS, sets);
        let drive = |threads: usize, config: &Setup| {
            let mut pipeline = Pipeline::build(config, &scenario).unwrap();
            pipeline.until = Time::from_ms(400);
            let mut seen = Recorded::default();
            let outcome = drive_pipeline(pipeline, config.seed, threads, &mut [&mut seen]).unwrap();
            (outcome.digest, seen.times)
        };
        let one = drive(1, &config);
        for threads in [2, 3] {
            assert_eq!(drive(threads, &config), one, "{sets:?} on {threads}");
        }
        let other = self::config(SENSORS, &[sets, &["lidar.roof.params.columns=122"]].concat());
        assert_ne!(drive(2, &other).0, one.0);
    }
}

#[test]
fn sensors_are_recomputed_from_a_log_without_their_data() {
    let folder = tempfile::tempdir().unwrap();
    let config = config(SENSORS, &["operator.planner.runtime={ fixed_ms = 60 }"]);
    let record = |file: &str, config: &Setup| {
        let path = folder.path().join(file);
        let scenario = common::scenario_file(SCENARIO);
        let start = run_start(config, &read_scenario(&scenario).unwrap(), &scenario);
        let mut recorder = Recorder::create(&path, &start).unwrap();
        if let Some(data) = left_out_of_logs(config.log.images) {
            recorder.leave_out(data);
        }
        let digest = drive(config, &mut [&mut recorder]).digest;
        recorder.finish().unwrap();
        (path, digest)
    };
    let (path, digest) = record("without.mcap", &config);
    let log = Log::read(&path).unwrap();
    let tracker = "tracker";
    assert!(replay(&log, tracker, &[], 1).unwrap().is_same());
    for other in [
        "lidar.roof.params.range_sigma_m=0.2",
        "radar.front.params.range_noise_m=1",
        "render.weather=hard_rain_noon",
    ] {
        let set = parse_assignment(other).unwrap();
        assert!(!replay(&log, tracker, &[set], 1).unwrap().is_same(), "{other}");
    }
    let mut all = config.clone();
    all.log.images = swerve_stack::config::Images::Lossless;
    let (with_data, same) = record("with.mcap", &all);
    assert_eq!(same, digest);
    let size = |path: &Path| std::fs::metadata(path).unwrap().len();
    assert!(size(&with_data) > 2 * size(&path), "{} {}", size(&with_data), size(&path));
    assert!(replay(&Log::read(&with_data).unwrap(), tracker, &[], 1).unwrap().is_same());
}

#[test]
fn world_of_a_run_is_independent_of_its_sensors() {
    let poses = |config: &Setup| {
        struct Poses(Vec<WorldState>);
        impl Observer for Poses {
            fn event(&mut self, event: &Event<'_>) {
                if let Event::Publication(publication) = event
                    && let Some(payload) = publication.payload
                    && let Some(world) = payload.downcast_ref::<WorldState>()
                {
                    self.0.push(world.clone());
                }
            }
        }
        let mut poses = Poses(Vec::new());
        drive(config, &mut [&mut poses]);
        poses.0
    };
    assert_eq!(poses(&config(SENSORS, &[])), poses(&Setup::default()));
}

/// Lane lines found by an operator, and the ego's offset at that time, metres to the left of the lane centre.
#[derive(Default)]
struct LanesSeen {
    worlds: Vec<(Time, f64)>,
    lanes: Vec<Lanes>,
}

impl Observer for LanesSeen {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.worlds.push((world.stamp, world.ego.state.pose.y_m));
        } else if let Some(lanes) = payload.downcast_ref::<Lanes>() {
            self.lanes.push(lanes.clone());
        }
    }
}

#[test]
fn detected_lane_lines_match_the_markings() {
    let camera = "[camera.front]\nat_m = [1.75, 0.0, 1.35]\npitch_deg = 1.7\nwidth_px = 640\nheight_px = 480\n\
        fov_deg = 70\nperiod_ms = 100\n[operator.lanes]\nkind = \"lanes\"\nruntime = { fixed_ms = 15 }\n";
    let mut seen = LanesSeen::default();
    drive(&config(camera, &[]), &mut [&mut seen]);
    assert!(seen.lanes.len() >= 2, "{:?}", seen.lanes);
    for lanes in &seen.lanes {
        let (_, d_m) = seen.worlds.iter().find(|(stamp, _)| *stamp == lanes.stamp).unwrap();
        // Between the lanes, and a quarter of a metre from the edge.
        for (line, truth_m) in [(lanes.left, 2.0), (lanes.right, -1.75)] {
            let [x_m, y_m] = line.unwrap().places().find(|[x_m, _]| *x_m > 15.0).unwrap();
            assert!((y_m + d_m - truth_m).abs() < 0.15, "{y_m} at {x_m} ahead, {truth_m}: {lanes:?}");
        }
    }
}
