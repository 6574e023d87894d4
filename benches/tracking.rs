//! Trackers, on one thread: frames of MOT15's detections per second in the image, compared with the program of SORT's
//! authors in the same run; a crowd on the ground; a target tracked by its pixels.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::Path;

use criterion::Criterion;
use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now, python};
use swerve_core::{Rng, Time};
use swerve_geom::{Pose2, math};
use swerve_msg::{ActorKind, DetectedBox, Detections, Extent};
use swerve_perception::image_plane::{Appearance, ByteTrack, DeepSort, ImageDetection, ImageTracker, Sort};
use swerve_perception::{Ab3dMot, GroundTracker, Tracker, ab3dmot, tracker};
use swerve_tests::data_folder;
use swerve_vision::correlation::{Area, Correlation};
use swerve_vision::{Plane, Rgb};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;

/// Folder of the detections among the test data: one file per sequence, of frame,left,top,width,height,score.
const FOLDER: &str = "mot15/det";

/// Frames among the test data in which dlib tracks a target.
const VIDEO: &str = "perception/dlib/examples/video_frames";

/// Required speed relative to the program of SORT's authors.
const TIMES: f64 = 20.0;

/// Passes over all sequences in a round.
const PASSES: usize = 20;

type Frames = Vec<Vec<ImageDetection>>;

/// A tracker's name, its run over all sequences, and the goal in frames per second.
type Row = (&'static str, fn(&[Frames]), Goal);

fn sequence(path: &Path) -> Option<Frames> {
    let mut frames = BTreeMap::<usize, Vec<ImageDetection>>::new();
    for line in std::fs::read_to_string(path).ok()?.lines() {
        let row: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>().ok()?;
        let &[frame, left, top, width, height, score] = row.as_slice() else { return None };
        let found = ImageDetection { box_px: [left, top, left + width, top + height], score };
        frames.entry(frame as usize).or_default().push(found);
    }
    let last = *frames.keys().max()?;
    Some((1..=last).map(|frame| frames.remove(&frame).unwrap_or_default()).collect())
}

fn sequences() -> Vec<Frames> {
    let files = std::fs::read_dir(data_folder().join(FOLDER)).into_iter().flatten();
    files.filter_map(|entry| sequence(&entry.ok()?.path())).collect()
}

/// Tracks all sequences, each with a new tracker.
fn pass<T: ImageTracker + Default>(sequences: &[Frames]) {
    for frames in sequences {
        let mut tracker = T::default();
        for found in frames {
            black_box(tracker.update(found));
        }
    }
}

fn per_second(sequences: &[Frames], pass: fn(&[Frames])) -> f64 {
    let (start, frames) = (now(), sequences.iter().map(Vec::len).sum::<usize>());
    (0..PASSES).for_each(|_| pass(sequences));
    (PASSES * frames) as f64 / start.elapsed().as_secs_f64()
}

/// Frames per second of the program of SORT's authors; `None` if this Python (`SWERVE_PYTHON`) does not have it.
fn of_the_authors() -> Option<f64> {
    python("tracking/sort_speed.py", &[&data_folder().join(FOLDER)]).trim().parse().ok()
}

/// Milliseconds of dlib for a frame of its video; `None` if this Python (`SWERVE_PYTHON`) does not have it.
fn of_dlib() -> Option<f64> {
    python("tracking/dlib_speed.py", &[&data_folder().join(VIDEO)]).trim().parse().ok()
}

/// Fifty cars and fifty people in motion, frame by frame.
fn crowd() -> Vec<Detections> {
    let mut rng = Rng::keyed(1, "crowd", &[]);
    let all: Vec<[f64; 4]> = (0..100)
        .map(|_| [rng.uniform(-50.0, 50.0), rng.uniform(-50.0, 50.0), 3.0 * rng.normal(), 3.0 * rng.normal()])
        .collect();
    let mut found = |k: usize, t: f64| {
        let ([x, y, vx, vy], is_car) = (all[k], k.is_multiple_of(2));
        let [length_m, width_m, height_m] = if is_car { [4.4, 1.8, 1.5] } else { [0.5, 0.5, 1.7] };
        DetectedBox {
            kind: if is_car { ActorKind::Car } else { ActorKind::Pedestrian },
            score: rng.uniform(0.5, 1.0),
            pose: Pose2::new(
                x + vx * t + 0.1 * rng.normal(),
                y + vy * t + 0.1 * rng.normal(),
                math::atan2(vy, vx),
            ),
            bottom_m: 0.0,
            extent: Extent { length_m, width_m, height_m },
            image_px: None,
            covariance_m2: None,
            radial_speed_mps: None,
        }
    };
    let frame = |k: i64| Detections {
        stamp: Time::from_ms(100 * k),
        boxes: (0..100).map(|n| found(n, 0.1 * k as f64)).collect(),
    };
    (0..100).map(frame).collect()
}

/// Makes a tracker with the default parameters.
type Make = fn() -> Box<dyn GroundTracker>;

/// Reason that such trackers exist.
const WITHIN: &str = "the defaults are within their ranges";

/// Milliseconds of each ground-plane tracker for a frame of a hundred boxes.
fn on_the_ground(rows: &mut Rows) {
    let crowd = crowd();
    let trackers: [(&str, Make); 2] = [
        ("sort on the ground", || Box::new(Tracker::new(tracker::Params::default()).expect(WITHIN))),
        ("ab3dmot", || Box::new(Ab3dMot::new(ab3dmot::Params::default()).expect(WITHIN))),
    ];
    for (name, make) in trackers {
        let figures = (0..5).map(|_| {
            let mut tracker = make();
            let start = now();
            for found in &crowd {
                black_box(tracker.update(found, Pose2::default()));
            }
            1e3 * start.elapsed().as_secs_f64() / crowd.len() as f64
        });
        let sample = Sample::new(figures.collect());
        rows.row(&format!("{name}, 100 boxes a frame"), sample.least(), &sample.text(2, "ms"), Goal::None);
    }
}

/// Milliseconds for a frame of dlib's video: tracking a target, and describing its appearance.
fn by_pixels(rows: &mut Rows) {
    let mut paths: Vec<_> = std::fs::read_dir(data_folder().join(VIDEO))
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "jpg"));
    paths.sort();
    if paths.is_empty() {
        return rows.skipped("correlation (DSST), a frame", &format!("no frames in {VIDEO}"));
    }
    let read = |path: &std::path::PathBuf| {
        let mut decoder = JpegDecoder::new(ZCursor::new(std::fs::read(path).expect("it was listed")));
        let bytes = decoder.decode().expect("a picture");
        let info = decoder.info().expect("a picture");
        (usize::from(info.width), usize::from(info.height), bytes)
    };
    let images: Vec<_> = paths.iter().map(read).collect();
    let rgb = |k: usize| Rgb::new(images[k].0, images[k].1, &images[k].2).expect("three colours");
    let gray: Vec<Plane<u8>> = (0..images.len())
        .map(|k| {
            let mut gray = Plane::default();
            rgb(k).gray(&mut gray);
            gray
        })
        .collect();
    let area = Area { middle: [93.0, 110.0], size: [38.0, 86.0] };
    let followed = (0..5).map(|_| {
        let mut target = Correlation::new(&gray[0], area).expect("it is in the image");
        let start = now();
        for image in &gray[1..] {
            black_box(target.follow(image));
        }
        1e3 * start.elapsed().as_secs_f64() / (gray.len() - 1) as f64
    });
    let sample = Sample::new(followed.collect());
    rows.row("correlation (DSST), a frame", sample.least(), &sample.text(2, "ms"), Goal::Most(2.0));
    let what = "correlation (DSST), times as fast as dlib";
    match of_dlib() {
        Some(theirs) => {
            let times = theirs / sample.median();
            rows.row(what, times, &format!("{times:.2} ({theirs:.2} ms)"), Goal::None);
        }
        None => rows.skipped(what, "needs a Python with dlib (SWERVE_PYTHON)"),
    }
    let mut appearance = Appearance::default();
    let looks = (0..5).map(|_| {
        let start = now();
        for k in 0..images.len() {
            black_box(appearance.describe(rgb(k), [74.0, 67.0, 112.0, 153.0]));
        }
        1e3 * start.elapsed().as_secs_f64() / images.len() as f64
    });
    let sample = Sample::new(looks.collect());
    rows.row("deepsort, a look at a box", sample.least(), &sample.text(3, "ms"), Goal::None);
}

fn main() {
    let trackers: [Row; 3] = [
        ("sort", pass::<Sort>, Goal::Least(100_000.0)),
        ("bytetrack", pass::<ByteTrack>, Goal::None),
        ("deepsort by motion", pass::<DeepSort>, Goal::None),
    ];
    let sequences = sequences();
    let mut criterion = Criterion::default().configure_from_args();
    for (name, pass, _) in trackers {
        criterion.bench_function(&format!("tracking/{name}"), |b| b.iter(|| pass(&sequences)));
    }
    if !is_asked_to_measure() {
        return;
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "tracking");
    for (name, pass, goal) in trackers {
        let what = format!("{name}, MOT15, frames a second");
        if sequences.is_empty() {
            rows.skipped(&what, &format!("no detections in {FOLDER}"));
            continue;
        }
        let sample = Sample::new((0..11).map(|_| per_second(&sequences, pass)).collect());
        rows.row(&what, sample.median(), &sample.text(0, "1/s"), goal);
        let authors = if name == "sort" { of_the_authors() } else { continue };
        let what = "sort, times the frames a second of its authors' program";
        match authors {
            Some(theirs) => {
                let times = sample.median() / theirs;
                rows.row(what, times, &format!("{times:.0} x ({theirs:.0} 1/s)"), Goal::Least(TIMES));
            }
            None => rows.skipped(what, "needs a Python with sort-tracker-py (SWERVE_PYTHON)"),
        }
    }
    on_the_ground(&mut rows);
    by_pixels(&mut rows);
    rows.finish();
}
