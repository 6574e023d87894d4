use super::*;
use proptest::prelude::*;

const CAR: Extent = Extent { length_m: 4.4, width_m: 1.8, height_m: 1.5 };
const PERSON: Extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.7 };

fn found(kind: ActorKind, x_m: f64, y_m: f64, heading_rad: f64) -> DetectedBox {
    DetectedBox {
        kind,
        score: 0.9,
        pose: Pose2::new(x_m, y_m, heading_rad),
        bottom_m: 0.0,
        extent: if kind == ActorKind::Car { CAR } else { PERSON },
        image_px: None,
        covariance_m2: None,
        radial_speed_mps: None,
    }
}

fn origin() -> Pose2<Map> {
    Pose2::new(0.0, 0.0, 0.0)
}

fn frame(ms: i64, boxes: Vec<DetectedBox>) -> Detections {
    Detections { stamp: Time::from_ms(ms), boxes }
}

fn tracker() -> Ab3dMot {
    Ab3dMot::new(Params::default()).unwrap()
}

/// Boxes (x, y, z, heading, length, width, height) and track states of a stored case, frame by frame:
/// `tests/reference/tracking/ab3dmot.py`.
#[derive(serde::Deserialize)]
struct Case {
    frames: Vec<Vec<[f64; 7]>>,
    tracks: Vec<Vec<[f64; 11]>>,
}

#[test]
fn ab3dmot_matches_the_reference_implementation() {
    let text = include_str!("../../../../tests/reference/tracking/ab3dmot.json");
    let cases: Vec<Case> = serde_json::from_str(text).unwrap();
    let mut states = 0;
    for (number, case) in cases.iter().enumerate() {
        let mut tracker = tracker();
        for (k, (boxes, expected)) in case.frames.iter().zip(&case.tracks).enumerate() {
            let car = |&[x, y, z, heading, length_m, width_m, height_m]: &[f64; 7]| DetectedBox {
                bottom_m: z - 0.5 * height_m,
                extent: Extent { length_m, width_m, height_m },
                ..found(ActorKind::Car, x, y, heading)
            };
            let ours =
                tracker.update(&frame(100 * k as i64, boxes.iter().map(car).collect()), origin()).tracks;
            let ids: Vec<u32> = ours.iter().map(|track| track.id.0).collect();
            let expected_ids: Vec<u32> = expected.iter().map(|row| row[0] as u32).collect();
            assert_eq!(ids, expected_ids, "scene {number}, frame {k}");
            for (track, row) in ours.iter().zip(expected) {
                let Extent { length_m, width_m, height_m } = track.extent;
                let (pose, v) = (track.pose, track.velocity_mps);
                let same = [
                    (pose.x_m, row[1]),
                    (pose.y_m, row[2]),
                    (angle_between(row[4], pose.heading_rad), 0.0),
                    (length_m, row[5]),
                    (width_m, row[6]),
                    (height_m, row[7]),
                    (0.1 * v.x, row[8]),
                    (0.1 * v.y, row[9]),
                ];
                assert!(
                    same.iter().all(|(a, b)| (a - b).abs() < 1e-4),
                    "scene {number}, frame {k}: {same:?}"
                );
                states += 1;
            }
        }
    }
    assert!(states > 500, "{states}");
}

#[test]
fn tracks_are_born_and_die_by_the_rules_of_their_kind() {
    for (kind, birth, death) in
        [(ActorKind::Car, 3, 2), (ActorKind::Pedestrian, 1, 4), (ActorKind::Cyclist, 3, 4)]
    {
        let (mut tracker, mut ms) = (tracker(), 0);
        let mut told = |boxes: Vec<DetectedBox>| {
            ms += 100;
            tracker.update(&frame(ms, boxes), origin()).tracks.len()
        };
        let seen: Vec<usize> = (0..5).map(|_| told(vec![found(kind, 10.0, 1.0, 0.0)])).collect();
        let expected: Vec<usize> = (1..=5).map(|hits| usize::from(hits >= birth)).collect();
        assert_eq!(seen, expected, "{kind:?}");
        let unseen: Vec<usize> = (0..5).map(|_| told(Vec::new())).collect();
        let expected: Vec<usize> = (1..=5).map(|frames| usize::from(frames < death)).collect();
        assert_eq!(unseen, expected, "{kind:?}");
    }
}

#[test]
fn tracks_estimate_velocity_history_and_heading() {
    let mut tracker = tracker();
    let mut tracks = TrackList::default();
    for k in 0..31 {
        // Frames of 50 ms, half of the period to which the noises refer. Every third box points backwards, but not the
        // last: a track has the direction of its latest box.
        let t = f64::from(k) * 0.05;
        let ego = Pose2::new(5.0 * t, 0.0, 0.1 * t);
        let at = ego.to_local::<Ego>(Point2::new(30.0 + 6.0 * t, 3.0 - 2.0 * t));
        let turned = if k % 3 == 2 { core::f64::consts::PI } else { 0.0 };
        let seen = found(ActorKind::Car, at.x_m, at.y_m, -0.32 + turned - ego.heading_rad);
        tracks = tracker.update(&frame(50 * i64::from(k), vec![seen]), ego);
    }
    let track = &tracks.tracks[0];
    let v = track.velocity_mps;
    assert!((v.x - 6.0).abs() < 0.05 && (v.y + 2.0).abs() < 0.05, "{v:?}");
    assert!(angle_between(track.pose.heading_rad, -0.32).abs() < 0.01, "{}", track.pose.heading_rad);
    assert_eq!(track.history.len(), Params::default().sightings_max);
    let last = track.history.last().unwrap();
    assert_eq!((last.at, last.point), (tracks.stamp, track.pose.point()));
    assert!((tracker.score(track.id).unwrap() - 0.9).abs() < 1e-12);
}

#[test]
fn tracker_ignores_non_finite_boxes_and_old_stamps() {
    let mut tracker = tracker();
    let person = || found(ActorKind::Pedestrian, 5.0, 0.0, 0.0);
    assert_eq!(tracker.update(&frame(0, vec![]), origin()).tracks, []);
    let odd = [
        DetectedBox { score: f64::NAN, ..person() },
        DetectedBox { bottom_m: f64::INFINITY, ..person() },
        DetectedBox { extent: Extent::default(), ..person() },
        DetectedBox { covariance_m2: Some([1.0, 2.0, 1.0]), ..person() },
        found(ActorKind::Pedestrian, f64::NAN, 0.0, 0.0),
    ];
    assert_eq!(tracker.update(&frame(100, odd.to_vec()), origin()).tracks, []);
    let first = tracker.update(&frame(200, vec![person()]), origin());
    for late in [200, 150, -100] {
        let far = frame(late, vec![found(ActorKind::Pedestrian, 50.0, 0.0, 0.0)]);
        assert_eq!(tracker.update(&far, origin()), first, "{late}");
    }
    assert_eq!(tracker.update(&frame(300, vec![person()]), Pose2::new(f64::NAN, 0.0, 0.0)), first);
}

#[test]
fn tracker_uses_only_the_highest_scoring_boxes() {
    let mut tracker = tracker();
    let at = |k: u32| found(ActorKind::Pedestrian, f64::from(k % 100) * 2.0, f64::from(k / 100) * 2.0, 0.0);
    let boxes: Vec<DetectedBox> =
        (0..10_000).map(|k| DetectedBox { score: if k % 10 == 3 { 0.9 } else { 0.7 }, ..at(k) }).collect();
    let mut told = TrackList::default();
    for k in 0..3 {
        told = tracker.update(&frame(100 * k, boxes.clone()), origin());
    }
    assert_eq!(told.tracks.len(), crate::image_plane::BOXES_MAX);
    assert!(told.tracks.iter().all(|track| tracker.score(track.id) == Some(0.9)));
}

#[test]
fn validate_rejects_parameters_out_of_range() {
    let params = Params { vehicle: Rules { limit: -2.0, ..Params::default().vehicle }, ..Params::default() };
    let told = Ab3dMot::new(params).unwrap_err().to_string();
    assert!(told.contains("vehicle.limit") && told.contains("-2"), "{told}");
}

fn solid(x: f64, y: f64, heading: f64, [length, width, height]: [f64; 3]) -> Solid {
    Solid { footprint: Obb::new(Pose2::new(x, y, heading), length, width), bottom_m: 0.0, height_m: height }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    /// The generalised IoU is at most the IoU, at least -1 and symmetric, and `is_far` has no false positives.
    #[test]
    fn overlaps_are_bounded_and_symmetric(
        (x, y) in (-20.0..20.0, -20.0..20.0), (g, h) in (-3.0..3.0, -3.0..3.0),
        a in prop::array::uniform3(0.3..8.0), b in prop::array::uniform3(0.3..8.0), least in -0.9..0.5,
    ) {
        let (a, b) = (solid(0.0, 0.0, g, a), solid(x, y, h, b));
        let giou = a.giou(&b);
        prop_assert!((giou - b.giou(&a)).abs() < 1e-9 && (a.iou(&b) - b.iou(&a)).abs() < 1e-9);
        prop_assert!((-1.0..=a.iou(&b) + 1e-9).contains(&giou), "{} {}", giou, a.iou(&b));
        prop_assert!((a.giou(&a) - 1.0).abs() < 1e-9);
        prop_assert!(!a.is_far(&b, least) || giou < least, "{} {}", giou, least);
    }

    #[test]
    fn greedy_pairs_are_one_to_one_and_include_the_cheapest(
        costs in prop::collection::vec(prop::collection::vec(0.0..1.0, 5), 0..6),
    ) {
        let pairs = nearest_first(costs.len(), 5, 0.6, |r, c| costs[r][c]);
        let rows: std::collections::BTreeSet<usize> = pairs.iter().map(|p| p.0).collect();
        let columns: std::collections::BTreeSet<usize> = pairs.iter().map(|p| p.1).collect();
        prop_assert_eq!((rows.len(), columns.len()), (pairs.len(), pairs.len()));
        let least = costs.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        prop_assert_eq!(least < 0.6, pairs.iter().any(|&(r, c)| costs[r][c] == least));
    }
}
