use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::*;

fn at(x: f64, score: f64) -> ImageDetection {
    ImageDetection { box_px: [x, 100.0, x + 40.0, 200.0], score }
}

fn ids(tracks: &[ImageTrack]) -> Vec<u64> {
    tracks.iter().map(|track| track.id).collect()
}

/// Rows of values, grouped by their first column, the frame.
type Rows = BTreeMap<u64, Vec<Vec<f64>>>;

fn rows(path: &Path) -> Rows {
    let mut rows = Rows::new();
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let row: Vec<f64> = line.split(',').map(|word| word.parse().unwrap()).collect();
        rows.entry(row[0] as u64).or_default().push(row[1..].to_vec());
    }
    rows
}

/// Compares with the authors' program on their detections: the share of its boxes that we report too, with one identity
/// for each of theirs, and no other boxes.
#[test]
fn sort_makes_the_tracks_of_its_authors() {
    let Some(folder) = swerve_tests::data_or_skip("mot15") else { return };
    let sequences = std::fs::read_dir(folder.join("det")).unwrap();
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
    println!(
        "floor: SORT on MOT15, share of its authors' boxes: {:.4} >= 0.999",
        equal as f64 / boxes as f64
    );
    assert!(boxes > 10_000, "{boxes}");
    assert_eq!(equal, boxes);
}

#[test]
fn sort_reports_after_three_sightings_and_forgets_after_two_frames() {
    let mut tracker = Sort::default();
    for _ in 0..3 {
        assert_eq!(tracker.update(&[]), []);
    }
    // The first sighting starts a track; the three after it are its streak.
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
fn byte_track_continues_but_does_not_start_tracks_with_low_scores() {
    let mut tracker = ByteTrack::default();
    assert_eq!(ids(&tracker.update(&[at(0.0, 0.9), at(300.0, 0.3)])), [1]);
    for k in 1..5 {
        let told = tracker.update(&[at(f64::from(k), 0.2), at(300.0, 0.3)]);
        assert_eq!(ids(&told), [1], "frame {k}");
    }
    // Unseen for as long as allowed: the old identity is kept; one frame longer: a new one.
    for (unseen, expected) in [(30, vec![1]), (31, vec![])] {
        let mut tracker = tracker.clone();
        for _ in 0..unseen {
            assert_eq!(tracker.update(&[]), []);
        }
        assert_eq!(ids(&tracker.update(&[at(5.0, 0.9)])), expected, "{unseen}");
    }
}

#[test]
fn byte_track_confirms_tracks_seen_twice_and_drops_duplicates() {
    let mut tracker = ByteTrack::default();
    tracker.update(&[]);
    assert_eq!(tracker.update(&[at(0.0, 0.9), at(200.0, 0.55)]), [], "0.55 is high, but founds nothing");
    assert_eq!(ids(&tracker.update(&[at(0.0, 0.9)])), [1]);
    // A track seen once is dropped after one frame without a box.
    tracker.update(&[at(0.0, 0.9), at(400.0, 0.9)]);
    tracker.update(&[at(0.0, 0.9)]);
    tracker.update(&[at(0.0, 0.9), at(400.0, 0.9)]);
    assert_eq!(ids(&tracker.update(&[at(0.0, 0.9), at(400.0, 0.9)])), [1, 3]);
}

#[test]
fn trackers_ignore_non_finite_and_empty_boxes() {
    let odd = [
        [f64::NAN, 0.0, 1.0, 1.0],
        [0.0, 0.0, f64::INFINITY, 1.0],
        [5.0, 5.0, 5.0, 9.0],
        [9.0, 0.0, 1.0, 5.0],
    ];
    let odd = odd.map(|box_px| ImageDetection { box_px, score: 0.9 });
    assert_eq!(Sort::default().update(&odd), []);
    assert_eq!(ByteTrack::default().update(&odd), []);
    let mut tracker = DeepSort::new(DeepSortParams { hits_min: 1, ..DeepSortParams::default() });
    assert_eq!(tracker.update(&odd), []);
    assert_eq!(ids(&tracker.update(&[at(0.0, 0.9)])), [1]);
}

#[test]
fn trackers_use_only_the_highest_scoring_boxes() {
    let place = |k: usize| [(k % 100) as f64 * 50.0, (k / 100) as f64 * 50.0];
    let crowd: Vec<ImageDetection> = (0..10_000)
        .map(|k| {
            let [x, y] = place(k);
            ImageDetection { box_px: [x, y, x + 60.0, y + 60.0], score: if k % 10 == 3 { 0.9 } else { 0.7 } }
        })
        .collect();
    fn told(tracker: &mut impl ImageTracker, crowd: &[ImageDetection]) -> Vec<ImageTrack> {
        (0..4).map(|_| tracker.update(crowd)).last().unwrap()
    }
    let trackers: [&dyn Fn() -> Vec<ImageTrack>; 3] =
        [&|| told(&mut Sort::default(), &crowd), &|| told(&mut ByteTrack::default(), &crowd), &|| {
            told(&mut DeepSort::default(), &crowd)
        }];
    for tracks in trackers.map(|run| run()) {
        assert_eq!(tracks.len(), BOXES_MAX);
        assert!(tracks.iter().all(|track| track.score == 0.9));
    }
}

/// Boxes and tracks of a stored case, frame by frame: `tests/reference/tracking/deep_sort.py`.
#[derive(serde::Deserialize)]
struct Case {
    frames: Vec<Vec<[f64; 5]>>,
    tracks: Vec<Vec<[f64; 5]>>,
}

#[test]
fn deep_sort_by_motion_matches_the_reference_implementation() {
    let text = include_str!("../../../../tests/reference/tracking/deep_sort.json");
    let cases: Vec<Case> = serde_json::from_str(text).unwrap();
    let mut boxes = 0;
    for (number, case) in cases.iter().enumerate() {
        let mut tracker = DeepSort::default();
        for (frame, (found, expected)) in case.frames.iter().zip(&case.tracks).enumerate() {
            let detection = |&[left, top, right, bottom, score]: &[f64; 5]| ImageDetection {
                box_px: [left, top, right, bottom],
                score,
            };
            let found: Vec<_> = found.iter().map(detection).collect();
            let ours = tracker.update(&found);
            let expected_ids: Vec<u64> = expected.iter().map(|row| row[0] as u64).collect();
            assert_eq!(ids(&ours), expected_ids, "scene {number}, frame {frame}");
            for (track, row) in ours.iter().zip(expected) {
                let same = track.box_px.iter().zip(&row[1..]).all(|(a, b)| (a - b).abs() < 1e-3);
                assert!(same, "scene {number}, frame {frame}: {track:?} {row:?}");
                boxes += 1;
            }
        }
    }
    assert!(boxes > 900, "{boxes}");
}

/// Image of 400 x 200 pixels with people of 30 x 90 pixels in clothes of two colours in front of a wall.
fn street(people: &[(f64, [[u8; 3]; 2])]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (y, x) in (0..200).flat_map(|y| (0..400).map(move |x| (y, x))) {
        let wall = [90 + (x * 7 + y * 3) as u8 % 30; 3];
        let inside =
            |(left, _): &&(f64, _)| (50..140).contains(&y) && (0.0..30.0).contains(&(f64::from(x) - left));
        let on = people.iter().rev().find(inside);
        bytes.extend(on.map_or(wall, |(_, [shirt, trousers])| if y < 95 { *shirt } else { *trousers }));
    }
    bytes
}

const RED: [[u8; 3]; 2] = [[190, 30, 40], [30, 30, 90]];
const GREEN: [[u8; 3]; 2] = [[40, 150, 60], [120, 110, 90]];

fn person(left: f64) -> ImageDetection {
    ImageDetection { box_px: [left, 50.0, left + 30.0, 140.0], score: 0.9 }
}

#[test]
fn descriptors_of_the_same_person_are_closer_than_of_others() {
    let mut appearance = Appearance::default();
    let bytes = street(&[(20.0, RED), (120.0, GREEN), (250.3, RED)]);
    let image = swerve_vision::Rgb::new(400, 200, &bytes).unwrap();
    let mut look = |left: f64| appearance.describe(image, person(left).box_px).unwrap();
    let [red, green, other] = [look(20.0), look(120.0), look(250.3)];
    assert!(red.distance(&red).abs() < 1e-5, "{}", red.distance(&red));
    assert!(red.distance(&other) < 0.15, "{}", red.distance(&other));
    assert!(red.distance(&green) > 0.4, "{}", red.distance(&green));
    assert_eq!(red.distance(&green), green.distance(&red));
    for none in [[-50.0, 0.0, 2.0, 90.0], [398.0, 0.0, 500.0, 90.0], [f64::NAN; 4], [9.0, 9.0, 9.0, 9.0]] {
        assert_eq!(appearance.describe(image, none), None, "{none:?}");
    }
    assert!(appearance.describe(image, [-1e300, -1e300, 1e300, 1e300]).is_some());
}

/// Two people who walk behind a pillar and turn back there: motion confuses them, appearance does not.
#[test]
fn deep_sort_identifies_people_by_appearance_after_occlusion() {
    let run = |with_looks: bool| {
        let (mut tracker, mut appearance) = (DeepSort::default(), Appearance::default());
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for k in 0..40_i32 {
            let step = f64::from(k);
            // They meet in the middle between frames 14 and 22, and turn back there.
            let way = if k < 18 { 5.0 * step } else { 5.0 * (36.0 - step) };
            let people = [(90.0 + way, RED), (280.0 - way, GREEN)];
            let bytes = street(&people);
            let image = swerve_vision::Rgb::new(400, 200, &bytes).unwrap();
            let found: Vec<ImageDetection> = match k {
                14..=22 => Vec::new(),
                _ => people.iter().map(|(left, _)| person(*left)).collect(),
            };
            let looks: Vec<Option<Look>> = found
                .iter()
                .map(|found| with_looks.then(|| appearance.describe(image, found.box_px)).flatten())
                .collect();
            let told = tracker.update_seen(&found, &looks);
            let left_first = |told: &[ImageTrack]| {
                let mut told = told.to_vec();
                told.sort_by(|a, b| a.box_px[0].total_cmp(&b.box_px[0]));
                ids(&told)
            };
            match k {
                13 => before = left_first(&told),
                39 => after = left_first(&told),
                _ => {}
            }
        }
        (before, after)
    };
    let (before, after) = run(true);
    assert_eq!((before.len(), &before), (2, &after));
    let (before, after) = run(false);
    assert_ne!(before, after, "by motion alone they go on as they went");
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), cases: 64, ..Default::default() })]
    /// For any input: each identity has at most one box per frame, and boxes are finite.
    #[test]
    fn identities_are_unique_within_a_frame(
        frames in proptest::collection::vec(proptest::collection::vec((0.0..300.0, 1.0..200.0, 0.0..1.0), 0..8), 1..30),
    ) {
        let mut tracker = DeepSort::default();
        let (mut newest, mut boxes_so_far) = (0, 0);
        for boxes in frames {
            let found: Vec<ImageDetection> = boxes
                .iter()
                .map(|&(x, size, score)| ImageDetection { box_px: [x, 2.0 * x, x + 0.4 * size, 2.0 * x + size], score })
                .collect();
            let told = tracker.update(&found);
            boxes_so_far += found.len() as u64;
            let ids = ids(&told);
            proptest::prop_assert!(ids.windows(2).all(|pair| pair[0] < pair[1]), "{ids:?}");
            proptest::prop_assert!(told.len() <= found.len());
            proptest::prop_assert!(told.iter().all(|t| t.box_px.iter().all(|x| x.is_finite())));
            newest = newest.max(ids.last().copied().unwrap_or(0));
        }
        proptest::prop_assert!(newest <= boxes_so_far);
    }
}
