//! Non-maximum suppression of overlapping boxes.

use super::Detection;

/// Reference area of an overlap.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize, serde::Deserialize)]
pub enum Overlap {
    /// Union of the two boxes.
    Union,
    /// Smaller of the two boxes.
    Smaller,
}

/// Boxes kept before suppression, by score; far more than there are objects.
const KEPT_MAX: usize = 1000;

/// Sorts by falling score and removes boxes that overlap a better one of their class by more than `most`.
pub fn suppress(found: &mut Vec<Detection>, most: f64, of: Overlap) {
    found.sort_unstable_by(|a, b| {
        let boxes = a.bbox.iter().zip(&b.bbox).map(|(a, b)| a.total_cmp(b));
        let place = boxes.fold(core::cmp::Ordering::Equal, core::cmp::Ordering::then);
        b.score.total_cmp(&a.score).then(place).then(a.class.cmp(&b.class))
    });
    found.truncate(KEPT_MAX);
    let mut kept = 0;
    for k in 0..found.len() {
        let one = found[k];
        let hides = |other: &Detection| other.class == one.class && share(other.bbox, one.bbox, of) > most;
        if !found[..kept].iter().any(hides) {
            found[kept] = one;
            kept += 1;
        }
    }
    found.truncate(kept);
}

/// Moves each kept box to the mean of the boxes of its class whose intersection over union with it is above `least`,
/// weighted by score (a probability).
///
/// Gidaris, Komodakis: "Object detection via a multi-region and semantic segmentation-aware CNN model", ICCV 2015,
/// section 4 (box voting).
pub fn vote(kept: &mut [Detection], all: &[Detection], least: f64) {
    for one in kept {
        let near = all.iter().filter(|other| other.class == one.class && iou(other.bbox, one.bbox) > least);
        let (mut sum, mut weight) = ([0.0; 4], 0.0);
        for other in near {
            weight += other.score;
            sum.iter_mut().zip(other.bbox).for_each(|(sum, px)| *sum += other.score * px);
        }
        if weight > 0.0 {
            one.bbox = sum.map(|sum| sum / weight);
        }
    }
}

/// Intersection over union of two boxes.
pub fn iou(a: [f64; 4], b: [f64; 4]) -> f64 {
    share(a, b, Overlap::Union)
}

/// Intersection of two boxes as a fraction of their union or of the smaller one.
pub fn share(a: [f64; 4], b: [f64; 4], of: Overlap) -> f64 {
    let side = |k: usize| (a[k] + a[k + 2]).min(b[k] + b[k + 2]) - a[k].max(b[k]);
    let shared = side(0).max(0.0) * side(1).max(0.0);
    let (first, second) = (a[2] * a[3], b[2] * b[3]);
    let whole = match of {
        Overlap::Union => first + second - shared,
        Overlap::Smaller => first.min(second),
    };
    if shared > 0.0 { shared / whole } else { 0.0 }
}
