use super::*;
use crate::image_box::tests::camera;
use swerve_geom::{Map, Vector2};
use swerve_msg::{ActorId, ActorKind};

const PERSON: Extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.7 };
const TRUCK: Extent = Extent { length_m: 8.0, width_m: 2.5, height_m: 3.4 };

fn obstacle(id: u32, x_m: f64, y_m: f64, extent: Extent, visible_share: f64) -> Obstacle {
    let kind = if extent == PERSON { ActorKind::Pedestrian } else { ActorKind::Truck };
    let pose = Pose2::new(x_m, y_m, 0.4);
    Obstacle { id: ActorId(id), kind, pose, extent, velocity_mps: Vector2::default(), visible_share }
}

fn seen(ms: i64, ego: Pose2<Map>, obstacles: Vec<Obstacle>) -> Surroundings {
    Surroundings { stamp: Time::from_ms(ms), ego, obstacles }
}

fn origin() -> Pose2<Map> {
    Pose2::new(0.0, 0.0, 0.0)
}

fn quiet() -> Params {
    Params { false_positives_per_frame: 0.0, ..Params::of_error_level(Sensing::Camera, 1.5) }
}

fn detector(params: Params) -> Detector {
    Detector::new(params, None, 7, "detector").unwrap()
}

#[test]
fn detector_without_errors_reports_the_truth() {
    let detector =
        Detector::new(Params::of_error_level(Sensing::Camera, 0.0), Some(camera()), 7, "detector").unwrap();
    let ego = Pose2::new(100.0, 50.0, 1.0);
    let at = ego.from_local(Point2::<Ego>::new(20.0, -1.0));
    for ms in 0..100 {
        let found = detector.detect(&seen(ms, ego, vec![obstacle(1, at.x_m, at.y_m, PERSON, 1.0)])).boxes;
        assert_eq!(found.len(), 1);
        let b = found[0];
        assert!((b.pose.x_m - 20.0).abs() < 1e-9 && (b.pose.y_m + 1.0).abs() < 1e-9, "{b:?}");
        assert!((b.pose.heading_rad - (0.4 - 1.0)).abs() < 1e-9 && b.extent == PERSON);
        assert!(b.score > 0.99 && b.image_px.is_some());
    }
}

#[test]
fn detector_misses_at_the_specified_rate() {
    let detector = detector(quiet());
    for (x_m, extent, share) in
        [(20.0, PERSON, 1.0), (45.0, PERSON, 1.0), (45.0, TRUCK, 1.0), (20.0, PERSON, 1.0 / 9.0)]
    {
        let stated = detector.recall(x_m, extent, share);
        let n = 4000;
        let found: usize = (0..n)
            .map(|id| detector.detect(&seen(330, origin(), vec![obstacle(id, x_m, 0.0, extent, share)])))
            .map(|found| found.boxes.len())
            .sum();
        let found = found as f64 / f64::from(n);
        assert!((found - stated).abs() < 0.025, "{x_m} {share}: {found}, stated {stated}");
    }
    assert!(detector.recall(45.0, PERSON, 1.0) < detector.recall(20.0, PERSON, 1.0));
    assert!(detector.recall(45.0, PERSON, 1.0) < detector.recall(45.0, TRUCK, 1.0));
    assert!(detector.recall(20.0, PERSON, 0.1) < detector.recall(20.0, PERSON, 0.9));
}

#[test]
fn misses_are_correlated_over_time() {
    let detector = detector(quiet());
    let p = detector.recall(45.0, PERSON, 1.0);
    let is_found = |id, ms| {
        !detector.detect(&seen(ms, origin(), vec![obstacle(id, 45.0, 0.0, PERSON, 1.0)])).boxes.is_empty()
    };
    let (mut missed, mut both) = (0.0, 0.0);
    for id in 0..4000 {
        if !is_found(id, 400) {
            missed += 1.0;
            both += if is_found(id, 450) { 0.0 } else { 1.0 };
        }
    }
    assert!(both / missed > 1.0 - p + 0.15, "{} {}", both / missed, 1.0 - p);
}

#[test]
fn position_errors_match_the_parameters() {
    let params = Params { recall_best: 1.0, half_distance_m: 1e4, ..quiet() };
    let detector = detector(params);
    for distance_m in [10.0, 40.0] {
        let (mut range, mut bearing, n) = (0.0, 0.0, 4000);
        for id in 0..n {
            let found =
                detector.detect(&seen(770, origin(), vec![obstacle(id, distance_m, 0.0, PERSON, 1.0)]));
            let at = found.boxes[0].pose.point();
            range += (math::hypot(at.x_m, at.y_m) - distance_m).powi(2) / f64::from(n);
            bearing += math::atan2(at.y_m, at.x_m).powi(2) / f64::from(n);
        }
        let stated = params.range_noise_m + params.range_noise_share * distance_m;
        assert!((range.sqrt() / stated - 1.0).abs() < 0.05, "{} {stated}", range.sqrt());
        assert!((bearing.sqrt() / params.bearing_noise_rad - 1.0).abs() < 0.05);
    }
}

#[test]
fn false_positives_match_their_rate_and_persist_with_low_scores() {
    let params = Params { false_positives_per_frame: 2.0, ..quiet() };
    let detector = detector(params);
    let at = |ms: i64| detector.detect(&seen(ms, Pose2::new(ms as f64 * 0.01, 3.0, 0.3), vec![])).boxes;
    let n = 1000;
    let all: Vec<DetectedBox> = (0..n).flat_map(|k| at(1000 * k)).collect();
    let rate = all.len() as f64 / n as f64;
    assert!((rate - 2.0).abs() < 0.15, "{rate}");
    let low = all.iter().filter(|b| b.score < 0.5).count() as f64 / all.len() as f64;
    assert!(low > 0.9, "{low}");
    assert!(all.iter().all(|b| b.pose.x_m > 5.0 && b.pose.y_m.abs() < 12.0));
    // In the map, most are where one was 20 ms earlier; the ego drives at 10 m/s.
    let map = |ms: i64| -> Vec<Point2<Map>> {
        at(ms).iter().map(|b| Pose2::new(ms as f64 * 0.01, 3.0, 0.3).from_local(b.pose.point())).collect()
    };
    let (mut stays, mut counted) = (0.0, 0.0);
    for k in 0..300 {
        let before = map(1000 * k + 100);
        for now in map(1000 * k + 120) {
            counted += 1.0;
            stays += if before.iter().any(|b| b.distance(now) < 1e-6) { 1.0 } else { 0.0 };
        }
    }
    assert!(stays / counted > 0.3, "{}", stays / counted);
}

#[test]
fn detections_are_independent_of_order_and_of_other_actors() {
    let detector = detector(Params { recall_best: 1.0, half_distance_m: 1e4, ..quiet() });
    let (a, b) = (obstacle(1, 20.0, 2.0, PERSON, 1.0), obstacle(2, 30.0, -3.0, TRUCK, 1.0));
    let both = detector.detect(&seen(100, origin(), vec![a.clone(), b.clone()]));
    assert_eq!(both, detector.detect(&seen(100, origin(), vec![b.clone(), a.clone()])));
    let alone = detector.detect(&seen(100, origin(), vec![b]));
    assert!(both.boxes.contains(&alone.boxes[0]));
    assert!(both.boxes.windows(2).all(|w| w[0].score >= w[1].score));
    let other_seed = Detector::new(quiet(), None, 8, "detector").unwrap();
    assert_ne!(both, other_seed.detect(&seen(100, origin(), vec![a.clone()])));
    let other_name = Detector::new(quiet(), None, 7, "other").unwrap();
    assert_ne!(other_name.detect(&seen(100, origin(), vec![a.clone()])), {
        Detector::new(quiet(), None, 7, "detector").unwrap().detect(&seen(100, origin(), vec![a]))
    });
}

#[test]
fn detector_rejects_or_ignores_non_finite_values() {
    let broken = Params { recall_best: f64::NAN, ..Params::default() };
    assert_eq!(Detector::new(broken, None, 1, "d").unwrap_err().key, "recall_best");
    let ego = Pose2::new(f64::NAN, 0.0, 0.0);
    let found = detector(Params { false_positives_per_frame: 3.0, ..quiet() }).detect(&seen(
        0,
        ego,
        vec![obstacle(1, f64::INFINITY, 0.0, PERSON, 1.0)],
    ));
    assert!(found.boxes.len() <= 1);
}

#[test]
fn size_and_heading_errors_grow_with_distance() {
    let params = Params { recall_best: 1.0, half_distance_m: 1e4, ..quiet() };
    let detector = detector(params);
    for distance_m in [6.0, 30.0] {
        let (mut size, mut heading, n) = (0.0, 0.0, 4000);
        for id in 0..n {
            let truck = obstacle(id, distance_m, 0.0, TRUCK, 1.0);
            let found = detector.detect(&seen(770, origin(), vec![truck])).boxes[0];
            size += (found.extent.length_m / TRUCK.length_m - 1.0).powi(2) / f64::from(n);
            heading += (found.pose.heading_rad - 0.4).powi(2) / f64::from(n);
        }
        let grown = 1.0 + distance_m / 30.0;
        assert!((size.sqrt() / (params.size_noise_share * grown) - 1.0).abs() < 0.05, "{}", size.sqrt());
        assert!((heading.sqrt() / (params.heading_noise_rad * grown) - 1.0).abs() < 0.05);
    }
}
