//! An emulated detector and the tracker after it.

use std::path::Path;

use swerve_core::{Span, Time};
use swerve_drive::drive_pipeline;
use swerve_flow::{Event, Observer};
use swerve_msg::truth::WorldState;
use swerve_msg::{Detections, TrackList};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;
use swerve_text::Document;

use crate::common;

/// Boxes with publication times, tracks, and world states.
#[derive(Default)]
struct Recorded {
    boxes: Vec<(Time, Detections)>,
    tracks: Vec<TrackList>,
    worlds: Vec<WorldState>,
}

impl Observer for Recorded {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(boxes) = payload.downcast_ref::<Detections>() {
            self.boxes.push((publication.visible_at, boxes.clone()));
        } else if let Some(tracks) = payload.downcast_ref::<TrackList>() {
            self.tracks.push(tracks.clone());
        } else if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.worlds.push(world.clone());
        }
    }
}

/// The first second with the truck near by, and its observations.
fn drive(detector: &str, sets: &[&str]) -> (Recorded, swerve_core::Digest) {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/person_behind_truck.toml"));
    let text = std::fs::read_to_string(path).unwrap().replace("s_m = 110.0", "s_m = 40.0");
    let scenario = Scenario::parse("near", &text).unwrap();
    let sets = common::sets(sets);
    let text = format!("[perception]\ndetector = \"{detector}\"\n");
    let config = Setup::from_document(&Document::parse("test", text).unwrap(), &sets).unwrap();
    let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
    pipeline.until = Time::from_ms(1000);
    let mut seen = Recorded::default();
    let digest = drive_pipeline(pipeline, config.seed, 1, &mut [&mut seen]).unwrap().digest;
    (seen, digest)
}

/// Parameters of a perfect detector.
const PERFECT: [&str; 9] = [
    "perception.params.recall_best=1",
    "perception.params.half_distance_m=10000",
    "perception.params.half_visibility=-1",
    "perception.params.false_positives_per_frame=0",
    "perception.params.score_separation=20",
    "perception.params.range_noise_share=0",
    "perception.params.bearing_noise_rad=0",
    "perception.params.size_noise_share=0",
    "perception.params.heading_noise_rad=0",
];

#[test]
fn perfect_detector_is_tracked_at_the_true_positions() {
    let (seen, _) = drive("custom", &PERFECT);
    let tracks = seen.tracks.last().unwrap();
    let world = seen.worlds.iter().find(|world| world.stamp >= tracks.stamp).unwrap();
    let truck = &world.actors[0];
    let track = tracks.tracks.iter().find(|track| track.kind == truck.kind).unwrap();
    let off_m = track.pose.point().distance(truck.pose.point());
    assert!(off_m < 0.05 && track.velocity_mps.norm() < 0.2, "{off_m} {:?}", track.velocity_mps);
    assert!(track.history.len() > 3);
    assert!(seen.boxes.iter().all(|(_, frame)| frame.boxes.iter().all(|b| b.image_px.is_some())));
}

#[test]
fn boxes_arrive_after_the_published_or_configured_run_time() {
    for (sets, ms) in [(&[][..], 28), (&["operator.detector.runtime={ fixed_ms = 7 }"][..], 7)] {
        let (seen, digest) = drive("efficientdet-d3@v100", sets);
        assert!(seen.boxes.len() >= 18, "{}", seen.boxes.len());
        assert!(seen.boxes.iter().all(|(at, frame)| *at - frame.stamp == Span::from_ms(ms)));
        assert!(seen.boxes.iter().any(|(_, frame)| !frame.boxes.is_empty()));
        assert_eq!(digest, drive("efficientdet-d3@v100", sets).1);
    }
}

#[test]
fn slow_detector_drops_frames() {
    let (seen, _) = drive("efficientdet-d7x@v100", &[]);
    // 153 ms on frames every 50 ms: a new one every 153 ms.
    assert!((5..=7).contains(&seen.boxes.len()), "{}", seen.boxes.len());
    assert_eq!(seen.boxes.len(), seen.tracks.len());
}

/// Boxes of the fusion: the only ones in its pipeline with a radar measurement.
fn fused(seen: &Recorded) -> Vec<&Detections> {
    let is_fused = |boxes: &Detections| boxes.boxes.iter().any(|b| b.radial_speed_mps.is_some());
    seen.boxes.iter().map(|(_, boxes)| boxes).filter(|boxes| is_fused(boxes)).collect()
}

/// A drive towards the truck near by with `configs/fusion.toml`.
fn drive_fused(sets: &[&str], until: Time) -> Recorded {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/person_behind_truck.toml"));
    let text = std::fs::read_to_string(path).unwrap().replace("s_m = 110.0", "s_m = 40.0");
    let scenario = Scenario::parse("near", &text).unwrap();
    let config = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/fusion.toml"));
    let config = Setup::from_document(&Document::read(config).unwrap(), &common::sets(sets)).unwrap();
    let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
    pipeline.until = until;
    let mut seen = Recorded::default();
    drive_pipeline(pipeline, config.seed, 1, &mut [&mut seen]).unwrap();
    seen
}

/// Sensors that find objects after 300 ms give the fusion old boxes only.
#[test]
fn late_objects_are_fused_and_tracked() {
    let late =
        ["operator.detector.runtime={ fixed_ms = 300 }", "operator.lidar_objects.runtime={ fixed_ms = 300 }"];
    let seen = drive_fused(&late, Time::from_ms(1600));
    let tracks = seen.tracks.last().expect("there are lists");
    let world = seen.worlds.iter().find(|world| world.stamp >= tracks.stamp).unwrap();
    let truck = world.actors[0].pose.point();
    assert!(tracks.tracks.iter().any(|track| track.pose.point().distance(truck) < 0.7), "{tracks:?}");
    // The echoes of the boxes' instant, not the newest, which are 300 ms younger.
    let speeds = fused(&seen).into_iter().flat_map(|list| &list.boxes).filter_map(|b| b.radial_speed_mps);
    let worst_mps = speeds.map(f64::abs).fold(0.0, f64::max);
    assert!(worst_mps > 0.0 && worst_mps < 1.0, "the truck stands: {worst_mps}");
}

/// A car stands in view of camera, lidar and radar. If either of the first two is blind, it is still tracked: with the
/// camera's class and the lidar's position if both see it, else with those of the remaining sensor.
#[test]
fn fused_object_persists_when_a_sensor_is_blind() {
    for (blind, off_max_m) in [(None, 0.7), (Some("detector"), 0.7), (Some("lidar_objects"), 4.0)] {
        let fault = blind.map(|stream| format!("fault.blind={{ stream = \"{stream}\", drop = true }}"));
        let sets: Vec<&str> = fault.iter().map(String::as_str).collect();
        let seen = drive_fused(&sets, Time::from_ms(1000));
        let (lists, tracks) = (fused(&seen), seen.tracks.last().unwrap());
        assert!(lists.len() > 5, "{blind:?}: {}", lists.len());
        // Each sensor's position is published once, when new, so the known state of the truck is spread over the lists
        // of one lidar scan. False positives of the emulated detector score low.
        let newest = lists.last().unwrap().stamp;
        let of_turn = lists.iter().rev().take_while(|list| newest - list.stamp < Span::from_ms(100));
        let sure = of_turn.flat_map(|list| list.boxes.iter().map(|b| (list.stamp, b)));
        let sure: Vec<_> = sure.filter(|(_, b)| b.score > 0.4).collect();
        let variance_m2 = |b: &swerve_msg::DetectedBox| {
            let [xx, _, yy] = b.covariance_m2.unwrap();
            xx.max(yy)
        };
        let surest = sure.iter().min_by(|a, b| variance_m2(a.1).total_cmp(&variance_m2(b.1)));
        let (stamp, found) = *surest.expect("it is told");
        let world = seen.worlds.iter().find(|world| world.stamp >= stamp).unwrap();
        let (truck, ego) = (&world.actors[0], world.ego.state.pose);
        let off_m = ego.from_local(found.pose.point()).distance(truck.pose.point());
        assert!(off_m < off_max_m && found.kind == truck.kind, "{blind:?}: {found:?}");
        assert_eq!(variance_m2(found) < 0.5, blind != Some("lidar_objects"), "{blind:?}: {found:?}");
        let is_in_picture = sure.iter().any(|(_, b)| b.image_px.is_some());
        assert_eq!(is_in_picture, blind != Some("detector"), "{blind:?}");
        let speed_mps = found.radial_speed_mps.expect("the radar sees a truck");
        assert!(speed_mps.abs() < 1.0, "{blind:?}: it stands: {speed_mps}");
        assert!(
            tracks.tracks.iter().any(|t| t.pose.point().distance(truck.pose.point()) < off_max_m),
            "{blind:?}"
        );
    }
}

/// A person runs into the lane from behind a truck and stops abruptly in it, while another truck comes the other way.
const RUNNER: &str = r#"
name = "runner"
[road]
segments = [{ length_m = 220.0 }]
left_m = 6.0
[ego]
target_speed_mps = 14.0
end_m = 180.0
[[actor]]
name = "oncoming"
kind = "truck"
s_m = 150.0
d_m = 4.0
heading_rad = 3.14159
motion = [{ drive = { speed_mps = 10.0 } }]
[[actor]]
name = "parked"
kind = "truck"
s_m = 110.0
d_m = -3.5
[[actor]]
name = "runner"
kind = "pedestrian"
s_m = 117.0
d_m = -4.0
trigger = { distance = { to = "ego", within_m = 30 } }
motion = [{ walk = { speed_mps = 4.0, distance_m = 4.0, direction = "left" } }]
[expect]
verdict = "avoided"
min_distance_m = { min = 0.2 }
"#;

#[test]
fn stopped_person_is_not_predicted_to_walk_on() {
    let scenario = Scenario::parse("runner", RUNNER).unwrap();
    for seed in 1..=4 {
        let text = format!(
            "seed = {seed}\n[perception]\ndetector = \"efficientdet-d3@v100\"\n[planning]\ncollision = \"time_indexed\"\n\
             [operator.detector]\nruntime = {{ fixed_ms = 120 }}\npolicy = \"pipelined(8)\"\n"
        );
        let config = Setup::from_document(&Document::parse("test", text).unwrap(), &[]).unwrap();
        let pipeline = Pipeline::build(&config, &scenario).unwrap();
        let mut seen = Recorded::default();
        let outcome = drive_pipeline(pipeline, config.seed, 1, &mut [&mut seen]).unwrap();
        let broken = outcome.broken(&scenario.expect[0]);
        assert!(broken.is_empty(), "seed {seed}: {broken:?}");
        let runner = |world: &&WorldState| world.actors[2].pose.y_m > -1e-6;
        let stopped = seen.worlds.iter().find(runner).unwrap().stamp;
        let since = |tracks: &&TrackList| tracks.stamp > stopped + Span::from_ms(300);
        let mut people = 0;
        for tracks in seen.tracks.iter().filter(since).take(10) {
            let near = tracks.tracks.iter().filter(|track| {
                track.kind.is_person() && (track.pose.x_m - 117.0).abs() < 4.0 && track.pose.y_m.abs() < 4.0
            });
            for track in near {
                people += 1;
                let (y_m, across_mps) = (track.pose.y_m, track.velocity_mps.y);
                let at = tracks.stamp - stopped;
                assert!(
                    across_mps.abs() < 1.5 && y_m.abs() < 0.5,
                    "seed {seed}: {across_mps} m/s after {at:?}"
                );
            }
        }
        assert!(people > 0, "seed {seed}: nobody followed");
    }
}
