//! Overlap of boxes: intersection over union.

use swerve_geom::{Obb, image_iou};
use swerve_msg::DetectedBox;

pub use swerve_geom::shared_area_m2;

/// Intersection over union on the ground (bird's eye view), 0 to 1.
pub fn ground_iou(a: &DetectedBox, b: &DetectedBox) -> f64 {
    over_union(shared_area_m2(&footprint(a), &footprint(b)), area_m2(a), area_m2(b))
}

/// Intersection over union of upright boxes, 0 to 1.
pub fn volume_iou(a: &DetectedBox, b: &DetectedBox) -> f64 {
    let top = |x: &DetectedBox| x.bottom_m + x.extent.height_m;
    let height_m = (top(a).min(top(b)) - a.bottom_m.max(b.bottom_m)).max(0.0);
    let shared = shared_area_m2(&footprint(a), &footprint(b)) * height_m;
    over_union(shared, area_m2(a) * a.extent.height_m, area_m2(b) * b.extent.height_m)
}

/// Overlapping pairs of image rectangles (left, top, right, bottom): index in `a`, index in `b`, intersection over
/// union above 0; sorted by index in `a`, then in `b`. Its cost is that of the pairs and of sorting, not of all pairs.
pub fn overlapping(a: &[[f64; 4]], b: &[[f64; 4]]) -> Vec<(usize, usize, f64)> {
    let mut by_left: Vec<usize> = (0..b.len()).collect();
    by_left.sort_by(|&i, &k| b[i][0].total_cmp(&b[k][0]));
    let widest = b.iter().map(|x| x[2] - x[0]).fold(0.0, f64::max);
    let mut pairs = Vec::new();
    for (i, &box_a) in a.iter().enumerate() {
        let first = by_left.partition_point(|&k| b[k][0] < box_a[0] - widest);
        let begun = pairs.len();
        for &k in by_left[first..].iter().take_while(|&&k| b[k][0] < box_a[2]) {
            let iou = image_iou(box_a, b[k]);
            if iou > 0.0 {
                pairs.push((i, k, iou));
            }
        }
        pairs[begun..].sort_unstable_by_key(|&(_, k, _)| k);
    }
    pairs
}

fn footprint(x: &DetectedBox) -> Obb<swerve_geom::Ego> {
    Obb::new(x.pose, x.extent.length_m, x.extent.width_m)
}

fn area_m2(x: &DetectedBox) -> f64 {
    x.extent.length_m * x.extent.width_m
}

fn over_union(shared: f64, a: f64, b: f64) -> f64 {
    let union = a + b - shared;
    if union > 0.0 { (shared / union).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_core::Rng;
    use swerve_geom::{Map, Point2, Pose2};
    use swerve_msg::{ActorKind, Extent};

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }

    #[test]
    fn shared_area_matches_sampled_points() {
        let mut rng = Rng::keyed(2, "overlap", &[]);
        for k in 0..60 {
            let mut rectangle = || {
                let pose =
                    Pose2::<Map>::new(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-4.0, 4.0));
                Obb::new(pose, rng.uniform(0.5, 3.0), rng.uniform(0.5, 3.0))
            };
            let (a, b) = (rectangle(), rectangle());
            let n = 300;
            let mut both = 0;
            for i in 0..n * n {
                let at = |m: usize| -3.5 + 7.0 * (m as f64 + 0.5) / n as f64;
                let p = Point2::new(at(i % n), at(i / n));
                both += usize::from(a.contains(p) && b.contains(p));
            }
            let counted = both as f64 * (7.0 / n as f64) * (7.0 / n as f64);
            let area = shared_area_m2(&a, &b);
            assert!((area - counted).abs() < 0.02, "{k}: {area} {counted}");
            near(area, shared_area_m2(&b, &a));
        }
    }

    #[test]
    fn overlap_of_squares_matches_hand_computation() {
        let square = |x: f64, y: f64, turn: f64| Obb::<Map>::new(Pose2::new(x, y, turn), 2.0, 2.0);
        near(shared_area_m2(&square(0.0, 0.0, 0.0), &square(0.0, 0.0, 0.0)), 4.0);
        near(shared_area_m2(&square(0.0, 0.0, 0.0), &square(1.0, 1.0, 0.0)), 1.0);
        near(shared_area_m2(&square(0.0, 0.0, 0.0), &square(2.0, 0.0, 0.0)), 0.0);
        // Turned by 45 degrees, the intersection is an octagon: 8 (sqrt 2 - 1) for squares of side 2.
        let eighth = core::f64::consts::FRAC_PI_4;
        near(
            shared_area_m2(&square(0.0, 0.0, 0.0), &square(0.0, 0.0, eighth)),
            8.0 * (core::f64::consts::SQRT_2 - 1.0),
        );
        near(shared_area_m2(&square(0.0, 0.0, 0.0), &square(f64::NAN, 0.0, 0.0)), 0.0);
    }

    #[test]
    fn overlapping_pairs_match_exhaustive_search() {
        let mut rng = Rng::keyed(3, "overlapping", &[]);
        for _ in 0..50 {
            let mut boxes = |n: usize| -> Vec<[f64; 4]> {
                let mut one = || {
                    let (x, y) = (rng.uniform(0.0, 9.0), rng.uniform(0.0, 9.0));
                    [x, y, x + rng.uniform(0.0, 3.0), y + rng.uniform(0.0, 3.0)]
                };
                (0..n).map(|_| one()).collect()
            };
            let (a, b) = (boxes(12), boxes(15));
            let all = (0..a.len()).flat_map(|i| (0..b.len()).map(move |k| (i, k)));
            let expected: Vec<_> =
                all.map(|(i, k)| (i, k, image_iou(a[i], b[k]))).filter(|(_, _, iou)| *iou > 0.0).collect();
            assert_eq!(overlapping(&a, &b), expected);
        }
    }

    #[test]
    fn overlap_of_boxes_matches_hand_computation() {
        let cube = |x: f64, bottom_m: f64| DetectedBox {
            kind: ActorKind::Car,
            score: 1.0,
            pose: Pose2::new(x, 0.0, 0.0),
            bottom_m,
            extent: Extent { length_m: 2.0, width_m: 2.0, height_m: 2.0 },
            image_px: None,
            covariance_m2: None,
            radial_speed_mps: None,
        };
        near(ground_iou(&cube(0.0, 0.0), &cube(1.0, 5.0)), 2.0 / 6.0);
        near(volume_iou(&cube(0.0, 0.0), &cube(1.0, 0.0)), 2.0 / 6.0);
        near(volume_iou(&cube(0.0, 0.0), &cube(1.0, 1.0)), 2.0 / 14.0);
        near(volume_iou(&cube(0.0, 0.0), &cube(1.0, 5.0)), 0.0);
        near(image_iou([0.0, 0.0, 2.0, 2.0], [1.0, 1.0, 3.0, 3.0]), 1.0 / 7.0);
        near(image_iou([0.0, 0.0, 2.0, 2.0], [2.0, 0.0, 3.0, 3.0]), 0.0);
        near(image_iou([5.0, 5.0, 5.0, 5.0], [5.0, 5.0, 5.0, 5.0]), 0.0);
    }
}
