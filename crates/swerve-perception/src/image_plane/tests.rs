use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::*;

fn at(x: f64, score: f64) -> ImageDetection {
    ImageDetection { box_px: [x, 100.0, x + 40.0, 200.0], score }
}

fn ids(tracks: &[ImageTrack]) -> Vec<u64> {
    tracks.iter().map(|track| track.id).collect()
}

/// Rows of numbers by their first column, the frame.
type Rows = BTreeMap<u64, Vec<Vec<f64>>>;

fn rows(path: &Path) -> Rows {
    let mut rows = Rows::new();
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let row: Vec<f64> = line.split(',').map(|word| word.parse().unwrap()).collect();
        rows.entry(row[0] as u64).or_default().push(row[1..].to_vec());
    }
    rows
}

/// What the authors' program makes of their detections: the share of its boxes that ours has too, under one identity
/// for one of theirs, and no other boxes.
#[test]
fn sort_makes_the_tracks_of_its_authors() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/mot15"));
    let sequences = std::fs::read_dir(folder.join("det"));
    let Ok(sequences) = sequences else {
        eprintln!("skipped: no {}", folder.display());
        return;
    };
    let (mut boxes, mut equal) = (0, 0);
    for entry in sequences {
        let (found, expected) = (entry.unwrap().path(), folder.join("tracks"));
        let expected = rows(&expected.join(found.file_name().unwrap()));
        let found = rows(&found);
        let (mut tracker, mut pairs) = (Sort::default(), BTreeSet::new());
        for frame in 1..=*found.keys().max().unwrap() {
            let detection = |row: &Vec<f64>| ImageDetection {
                box_px: [row[0], row[1], row[0] + row[2], row[1] + row[3]],
                score: row[4],
            };
            let found: Vec<_> = found.get(&frame).into_iter().flatten().map(detection).collect();
            let ours = tracker.update(&found);
            let theirs = expected.get(&frame).cloned().unwrap_or_default();
            boxes += theirs.len().max(ours.len());
            for track in &ours {
                let [left, top, right, bottom] = track.box_px;
                let size = [left, top, right - left, bottom - top];
                let same = |row: &&Vec<f64>| row[1..].iter().zip(size).all(|(a, b)| (a - b).abs() < 1.1e-3);
                if let Some(row) = theirs.iter().find(same) {
                    pairs.insert((row[0] as u64, track.id));
                    equal += 1;
                }
            }
        }
        let one_to_one = |of: fn(&(u64, u64)) -> u64| pairs.iter().map(of).collect::<BTreeSet<_>>().len();
        assert_eq!(one_to_one(|p| p.0), pairs.len(), "{found:?}: an identity of theirs is two of ours");
        assert_eq!(one_to_one(|p| p.1), pairs.len(), "{found:?}: an identity of ours is two of theirs");
    }
    assert!(boxes > 10_000, "{boxes}");
    assert_eq!(equal, boxes);
}

#[test]
fn sort_reports_after_three_sightings_and_forgets_after_two_frames() {
    let mut tracker = Sort::default();
    for _ in 0..3 {
        assert_eq!(tracker.update(&[]), []);
    }
    // The first sighting founds a track; the three after it are its streak.
    let told: Vec<_> = (0..4).map(|k| ids(&tracker.update(&[at(f64::from(k), 0.9)]))).collect();
    assert_eq!(told, [vec![], vec![], vec![], vec![1]]);
    assert_eq!(tracker.update(&[]), []);
    assert_eq!(ids(&tracker.update(&[at(5.0, 0.9)])), [0; 0], "its streak begins anew");
    for _ in 0..2 {
        tracker.update(&[]);
    }
    let told: Vec<_> = (0..4).map(|_| ids(&tracker.update(&[at(8.0, 0.9)]))).collect();
    assert_eq!(told.last().unwrap(), &[2]);
}

#[test]
fn byte_track_keeps_by_low_scores_whom_it_would_not_found_by_them() {
    let mut tracker = ByteTrack::default();
    assert_eq!(ids(&tracker.update(&[at(0.0, 0.9), at(300.0, 0.3)])), [1]);
    for k in 1..5 {
        let told = tracker.update(&[at(f64::from(k), 0.2), at(300.0, 0.3)]);
        assert_eq!(ids(&told), [1], "frame {k}");
    }
    // Out of sight for as long as is allowed, and back under the old identity; one frame more, under a new one.
    for (unseen, expected) in [(30, vec![1]), (31, vec![])] {
        let mut tracker = tracker.clone();
        for _ in 0..unseen {
            assert_eq!(tracker.update(&[]), []);
        }
        assert_eq!(ids(&tracker.update(&[at(5.0, 0.9)])), expected, "{unseen}");
    }
}

#[test]
fn byte_track_confirms_who_is_seen_twice_and_drops_doubles() {
    let mut tracker = ByteTrack::default();
    tracker.update(&[]);
    assert_eq!(tracker.update(&[at(0.0, 0.9), at(200.0, 0.55)]), [], "0.55 is high, but founds nothing");
    assert_eq!(ids(&tracker.update(&[at(0.0, 0.9)])), [1]);
    // A single sighting is forgotten at once.
    tracker.update(&[at(0.0, 0.9), at(400.0, 0.9)]);
    tracker.update(&[at(0.0, 0.9)]);
    tracker.update(&[at(0.0, 0.9), at(400.0, 0.9)]);
    assert_eq!(ids(&tracker.update(&[at(0.0, 0.9), at(400.0, 0.9)])), [1, 3]);
}

#[test]
fn boxes_without_number_or_area_are_passed_over() {
    let odd = [
        [f64::NAN, 0.0, 1.0, 1.0],
        [0.0, 0.0, f64::INFINITY, 1.0],
        [5.0, 5.0, 5.0, 9.0],
        [9.0, 0.0, 1.0, 5.0],
    ];
    let odd = odd.map(|box_px| ImageDetection { box_px, score: 0.9 });
    assert_eq!(Sort::default().update(&odd), []);
    assert_eq!(ByteTrack::default().update(&odd), []);
}
