use serde::Deserialize;
use serde_json::Value;

use super::*;

#[derive(Deserialize)]
struct Case {
    frames: Vec<Frame>,
    expected: Value,
    #[serde(default)]
    motmetrics: Value,
}

#[derive(Deserialize)]
struct Frame {
    /// Id; left, top, width, height.
    truth: Vec<(u64, [f64; 4])>,
    found: Vec<(u64, [f64; 4])>,
}

fn cases() -> Vec<Case> {
    let text = include_str!("../../../../tests/reference/perception_metrics/tracking.json");
    serde_json::from_str(text).unwrap()
}

/// Many equal boxes; the first case has no truth, the second no tracks.
fn ties() -> Vec<Case> {
    let text = include_str!("../../../../tests/reference/perception_metrics/ties.json");
    serde_json::from_str(text).unwrap()
}

fn metrics(case: &Case) -> TrackingMetrics {
    let edges = |of: &[(u64, [f64; 4])]| -> Vec<(u64, [f64; 4])> {
        of.iter().map(|&(id, [x, y, w, h])| (id, [x, y, x + w, y + h])).collect()
    };
    let frames: Vec<TrackingFrame> =
        case.frames.iter().map(|f| TrackingFrame::of_boxes(&edges(&f.truth), &edges(&f.found))).collect();
    TrackingMetrics::of(&frames)
}

#[test]
fn tracking_metrics_match_trackeval() {
    let (cases, ties) = (cases(), ties());
    assert!(cases.len() >= 12 && ties.len() >= 24);
    for (k, case) in ties.iter().chain(&cases).enumerate() {
        let ours = serde_json::to_value(metrics(case)).unwrap();
        for (part, numbers) in case.expected.as_object().unwrap() {
            for (name, expected) in numbers.as_object().unwrap() {
                let value = &ours[part][name];
                // TrackEval returns 0 for a quotient by zero.
                assert!(k < 2 || !value.is_null(), "case {k}, {part}.{name}");
                let off = (value.as_f64().unwrap_or(0.0) - expected.as_f64().unwrap()).abs();
                let allowed = if value.is_u64() { 0.0 } else { 1e-9 };
                assert!(off <= allowed, "case {k}, {part}.{name}: {value}, expected {expected}");
            }
        }
    }
}

#[test]
fn identity_scores_match_motmetrics() {
    for (k, case) in cases().iter().enumerate() {
        let ours = metrics(case);
        let identity = [("idf1", ours.identity.idf1), ("idp", ours.identity.idp), ("idr", ours.identity.idr)];
        for (name, value) in identity {
            let expected = case.motmetrics[name].as_f64().unwrap();
            assert!((value.unwrap() - expected).abs() < 1e-9, "case {k}, {name}: {value:?}, {expected}");
        }
    }
}

/// Object 1 is present in five frames: matched by 7, unmatched, by 7, by 8 (although 7 is near, farther), by 8.
#[test]
fn tracking_metrics_match_hand_computation() {
    let frame = |found: &[u64], alike: &[(usize, usize, f64)]| TrackingFrame {
        truth: vec![1],
        found: found.to_vec(),
        alike: alike.to_vec(),
    };
    let frames = [
        frame(&[7], &[(0, 0, 0.8)]),
        frame(&[7], &[(0, 0, 0.4)]),
        frame(&[7, 8], &[(0, 0, 0.6), (0, 1, 0.9)]),
        frame(&[7, 8], &[(0, 0, 0.5), (0, 1, 0.9)]),
        frame(&[8], &[(0, 0, 1.0)]),
    ];
    let clear = ClearMot::of(&frames, 0.5);
    // Nothing was matched in the second frame, so the third may take the nearest.
    let counts = [clear.true_positives, clear.false_positives, clear.false_negatives, clear.id_switches];
    assert_eq!(counts, [4, 3, 1, 1]);
    assert_eq!((clear.fragmentations, clear.mostly_tracked, clear.partly_tracked), (1, 0, 1));
    assert!((clear.mota.unwrap() - (4.0 - 3.0 - 1.0) / 5.0).abs() < 1e-12);
    assert!((clear.motp.unwrap() - 3.6 / 4.0).abs() < 1e-12);
    let identity = IdentityScore::of(&frames, 0.5);
    assert_eq!([identity.true_positives, identity.false_positives, identity.false_negatives], [3, 4, 2]);
}

#[test]
fn ratios_are_none_without_boxes() {
    let nothing = TrackingMetrics::of(&[TrackingFrame::default()]);
    assert_eq!((nothing.clear.mota, nothing.clear.motp, nothing.identity.idf1), (None, None, None));
    let only_ghosts = TrackingMetrics::of(&[TrackingFrame::of_boxes(&[], &[(1, [0.0, 0.0, 1.0, 1.0])])]);
    assert_eq!((only_ghosts.clear.mota, only_ghosts.clear.false_positives), (None, 1));
    assert_eq!((only_ghosts.identity.idp, only_ghosts.identity.idr), (Some(0.0), None));
    assert_eq!(only_ghosts.hota.hota, 0.0);
}

#[test]
fn ten_thousand_boxes_per_frame_are_evaluated_quickly() {
    let boxes = |off: f64| -> Vec<(u64, [f64; 4])> {
        let at = |k: u64| {
            let (x, y) = ((k % 100) as f64 * 10.0 + off, (k / 100) as f64 * 10.0);
            (k, [x, y, x + 12.0, y + 12.0])
        };
        (0..10_000).map(at).collect()
    };
    let metrics = TrackingMetrics::of(&[TrackingFrame::of_boxes(&boxes(0.0), &boxes(0.5))]);
    assert_eq!(metrics.clear.true_positives, 10_000);
    assert_eq!(metrics.identity.idf1, Some(1.0));
}
