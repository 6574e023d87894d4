//! Trackers in the image: frames of MOT15's detections a second, on one thread.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::Path;

use criterion::Criterion;
use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now};
use swerve_perception::image_plane::{ByteTrack, ImageDetection, ImageTracker, Sort};

/// Where the detections are, if they are there: a file a sequence, of frame,left,top,width,height,score.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/mot15/det");

/// Passes over all sequences in a round.
const PASSES: usize = 20;

type Frames = Vec<Vec<ImageDetection>>;

/// A tracker's name, all sequences tracked by it, and how many frames a second are asked for.
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
    let files = std::fs::read_dir(FOLDER).into_iter().flatten();
    files.filter_map(|entry| sequence(&entry.ok()?.path())).collect()
}

/// Tracks all sequences, a new tracker each.
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

fn main() {
    let trackers: [Row; 2] =
        [("sort", pass::<Sort>, Goal::Least(100_000.0)), ("bytetrack", pass::<ByteTrack>, Goal::None)];
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
    }
    rows.finish();
}
