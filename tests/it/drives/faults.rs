//! Faults on streams of a drive.

use std::collections::BTreeMap;
use std::path::Path;

use swerve_core::Time;
use swerve_drive::{Outcome, drive_pipeline, read_scenario};
use swerve_flow::{Event, Observer};
use swerve_msg::{EgoState, FaultInjection, Image, Pixels};
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;
use swerve_text::Document;

/// Messages of each stream: stamp, publication, and payload where needed.
#[derive(Default)]
struct Recorded {
    times: BTreeMap<String, Vec<(Time, Time)>>,
    poses: BTreeMap<String, Vec<EgoState>>,
    images: BTreeMap<String, Vec<Image>>,
    injected: Vec<FaultInjection>,
}

impl Observer for Recorded {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let (Some(stamp), Some(payload)) = (publication.stamp, publication.payload) else { return };
        let stream = publication.stream.to_owned();
        self.times.entry(stream.clone()).or_default().push((stamp, publication.visible_at));
        let any = payload;
        if let Some(pose) = any.downcast_ref::<EgoState>() {
            self.poses.entry(stream).or_default().push(*pose);
        } else if let Some(image) = any.downcast_ref::<Image>() {
            self.images.entry(stream).or_default().push(image.clone());
        } else if let Some(injected) = any.downcast_ref::<FaultInjection>() {
            self.injected.push(injected.clone());
        }
    }
}

/// Drives the first 0.6 s.
fn drive(text: &str) -> (Recorded, Outcome) {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/person_behind_truck.toml");
    let document = Document::parse("test", text).unwrap();
    let config = Setup::from_document(&document, &[]).unwrap();
    let mut pipeline = Pipeline::build(&config, &read_scenario(Path::new(file)).unwrap()).unwrap();
    pipeline.until = Time::from_ms(600);
    let mut seen = Recorded::default();
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut [&mut seen]).unwrap();
    (seen, outcome)
}

fn fault(stream: &str, keys: &str) -> String {
    format!("[sim]\ndraws = false\n[fault.harm]\nstream = \"{stream}\"\n{keys}\n")
}

#[test]
fn dropped_messages_reach_no_reader_and_are_reported() {
    let (seen, _) = drive(&fault("obstacles", "drop = true\nfrom_ms = 100\nuntil_ms = 200"));
    let (sent, got) = (&seen.times["obstacles"], &seen.times["harm.message"]);
    assert_eq!(sent.len() - got.len(), 3, "those of 100, 150 and 200 ms");
    assert_eq!(seen.times["tracker"].len(), got.len());
    let told: Vec<_> = seen.injected.iter().map(|i| (i.stamp.ns() / 1_000_000, &*i.harm)).collect();
    assert_eq!(told, [(100, "drop"), (150, "drop"), (200, "drop")]);
    assert!(seen.injected.iter().all(|i| i.stream == "obstacles" && i.later_s == 0.0));
}

#[test]
fn delayed_messages_arrive_as_configured_and_in_order() {
    let (seen, _) = drive(&fault("obstacles", "delay_ms = 70\nuntil_ms = 100"));
    let late: Vec<i64> = seen.times["harm.message"].iter().map(|(s, v)| (*v - *s).ns() / 1_000_000).collect();
    // The one delayed by 150 ms would arrive before the one delayed by 100 ms, which waits for it.
    assert_eq!(late[..6], [70, 70, 70, 20, 0, 0]);
    let (seen, _) = drive(&fault("pose", "jitter_ms = 30"));
    let times = &seen.times["harm.message"];
    assert!(times.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 <= w[1].1));
    assert!(times.iter().all(|(stamp, at)| (*at - *stamp).ns() <= 30_000_000));
    assert!(times.iter().any(|(stamp, at)| (*at - *stamp).ns() > 15_000_000));
}

#[test]
fn frozen_stream_repeats_its_content_with_new_stamps() {
    let (seen, _) = drive(&fault("pose", "freeze_ms = 100\nfrom_ms = 200\nuntil_ms = 200"));
    let (sent, got) = (&seen.poses["pose"], &seen.poses["harm.message"]);
    assert_eq!(sent.len(), got.len());
    for (sent, got) in sent.iter().zip(got) {
        let ms = sent.stamp.ns() / 1_000_000;
        let old = sent.stamp.min(Time::from_ms(200));
        let expected = if (200..300).contains(&ms) { sent_at(&seen, old) } else { *sent };
        assert_eq!(*got, EgoState { stamp: sent.stamp, ..expected }, "{ms} ms");
    }
    assert_eq!(seen.injected.len(), 10);
}

fn sent_at(seen: &Recorded, stamp: Time) -> EgoState {
    *seen.poses["pose"].iter().find(|pose| pose.stamp == stamp).unwrap()
}

#[test]
fn noise_has_its_configured_deviation_and_nan_is_one_number() {
    let (seen, _) = drive(&fault("pose", "noise = 0.5"));
    let pairs = seen.poses["pose"].iter().zip(&seen.poses["harm.message"]);
    let squares: Vec<f64> = pairs.map(|(sent, got)| (got.pose.x_m - sent.pose.x_m).powi(2)).collect();
    let deviation = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!(squares.len() > 50 && (0.35..0.65).contains(&deviation), "{deviation}");
    let (seen, outcome) = drive(&fault("pose", "nan = true\nprobability = 0.3"));
    let wrong = |pose: &&EgoState| format!("{pose:?}").matches("NaN").count() == 1;
    assert_eq!(seen.poses["harm.message"].iter().filter(wrong).count(), seen.injected.len());
    assert!((5..40).contains(&seen.injected.len()), "{}", seen.injected.len());
    let again = drive(&fault("pose", "nan = true\nprobability = 0.3")).1;
    assert_eq!(outcome.report.digest, again.report.digest);
    let other = drive(&fault("pose", "nan = true\nprobability = 0.3\nseed = 7")).1;
    assert_ne!(outcome.report.digest, other.report.digest);
}

#[test]
fn bits_of_images_flip() {
    let camera = "[log]\nsensors = [\"eye\"]\n[camera.eye]\nwidth_px = 32\nheight_px = 24\noutputs = [\"rgb\", \"depth\"]\nperiod_ms = 200\n";
    let (seen, _) = drive(&format!("{camera}{}", fault("eye.rgb", "flip_bits = 1")));
    for (sent, got) in seen.images["eye.rgb"].iter().zip(&seen.images["harm.message"]) {
        let (Pixels::Rgb8(sent), Pixels::Rgb8(got)) = (&sent.pixels, &got.pixels) else { panic!("colours") };
        let differing: u32 = sent.iter().zip(got.iter()).map(|(a, b)| (a ^ b).count_ones()).sum();
        assert_eq!(differing, 1);
    }
    let (seen, _) = drive(&format!("{camera}{}", fault("eye.depth", "nan = true")));
    assert!(!seen.injected.is_empty());
    for got in &seen.images["harm.message"] {
        let Pixels::DepthF32M(metres) = &got.pixels else { panic!("distances") };
        assert_eq!(metres.iter().filter(|x| x.is_nan()).count(), 1);
    }
}

/// All streams that drive the car, with NaN: whatever the effect, the program continues.
#[test]
fn nan_in_any_stream_does_not_stop_the_program() {
    for stream in ["obstacles", "pose", "imu", "tracker", "predictor", "planner", "controller"] {
        for keys in ["nan = true", "noise = 1e6", "drop = true", "freeze_ms = 100"] {
            let (seen, _) = drive(&fault(stream, keys));
            assert!(!seen.injected.is_empty(), "{stream} {keys}");
        }
    }
    for keys in ["nan = true", "noise = 1e6", "freeze_ms = 100"] {
        let detector = "[perception]\ndetector = \"efficientdet-d3@v100\"\n";
        assert!(!drive(&format!("{detector}{}", fault("detector", keys))).0.injected.is_empty(), "{keys}");
    }
}
