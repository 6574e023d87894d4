//! Semantic segmentation: intersection over union of classes (Everingham et al. 2010; Cityscapes).

/// Confusion matrix: pixel counts by true and by predicted class.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Confusion {
    classes: usize,
    ignored: Option<u8>,
    /// Row-major, one row per true class.
    counts: Vec<u64>,
}

/// A label outside the classes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("pixel {pixel}: label {label}, expected one below {classes}")]
pub struct UnknownClass {
    /// Index of the pixel, row-major.
    pub pixel: usize,
    /// Its label.
    pub label: u8,
    /// Number of classes.
    pub classes: usize,
}

impl Confusion {
    /// Creates a matrix for classes 0 to `classes` - 1; pixels with the true label `ignored` (Cityscapes: 255) are left
    /// out.
    pub fn new(classes: u8, ignored: Option<u8>) -> Self {
        let classes = usize::from(classes);
        Self { classes, ignored, counts: vec![0; classes * classes] }
    }

    /// Adds an image with its true and its predicted labels, pixel by pixel. On an error nothing is counted.
    ///
    /// # Errors
    /// A label outside the classes.
    ///
    /// # Panics
    /// If the two have different sizes.
    pub fn image(&mut self, truth: &[u8], found: &[u8]) -> Result<(), UnknownClass> {
        assert_eq!(truth.len(), found.len(), "labels of one image");
        let mut pairs = vec![0_u64; 1 << 16];
        for (&t, &f) in truth.iter().zip(found) {
            pairs[usize::from(t) << 8 | usize::from(f)] += 1;
        }
        let classes = self.classes;
        let is_known = |label: u8| usize::from(label) < classes;
        let counts = |t: u8| Some(t) != self.ignored;
        let odd = |(pixel, (&t, &f)): (usize, (&u8, &u8))| {
            let label = [t, f].into_iter().find(|label| !is_known(*label))?;
            counts(t).then_some(UnknownClass { pixel, label, classes })
        };
        if let Some(unknown) = truth.iter().zip(found).enumerate().find_map(odd) {
            return Err(unknown);
        }
        for t in (0..=u8::MAX).filter(|t| is_known(*t) && counts(*t)) {
            for f in (0..=u8::MAX).filter(|f| is_known(*f)) {
                let (t, f) = (usize::from(t), usize::from(f));
                self.counts[t * classes + f] += pairs[t << 8 | f];
            }
        }
        Ok(())
    }

    /// Number of pixels of a true class that were predicted as `found`.
    pub fn count(&self, truth: u8, found: u8) -> u64 {
        self.counts[usize::from(truth) * self.classes + usize::from(found)]
    }

    /// Intersection over union of a class, 0 to 1; `None` if the class is neither present nor predicted.
    pub fn iou(&self, class: u8) -> Option<f64> {
        let class = usize::from(class);
        let shared = self.counts[class * self.classes + class];
        let there: u64 = self.counts[class * self.classes..][..self.classes].iter().sum();
        let reported: u64 = self.counts.iter().skip(class).step_by(self.classes).sum();
        let union = there + reported - shared;
        (union > 0).then(|| shared as f64 / union as f64)
    }

    /// Mean over the classes present or predicted; `None` if there are none.
    pub fn mean_iou(&self) -> Option<f64> {
        let ious: Vec<f64> = (0..self.classes).filter_map(|class| self.iou(class as u8)).collect();
        (!ious.is_empty()).then(|| ious.iter().sum::<f64>() / ious.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize)]
    struct Case {
        classes: u8,
        truth: Vec<u8>,
        found: Vec<u8>,
        counts: Vec<Vec<u64>>,
        ious: BTreeMap<u8, f64>,
        mean: f64,
    }

    #[test]
    fn iou_matches_scikit_learn() {
        let text = include_str!("../../../tests/reference/perception_metrics/segmentation.json");
        let cases: Vec<Case> = serde_json::from_str(text).unwrap();
        assert!(cases.len() >= 6);
        for case in cases {
            let mut confusion = Confusion::new(case.classes, Some(255));
            // In two parts, to check that images add up.
            let (t, f) = (case.truth.split_at(100), case.found.split_at(100));
            confusion.image(t.0, f.0).unwrap();
            confusion.image(t.1, f.1).unwrap();
            for class in 0..case.classes {
                let expected = &case.counts[usize::from(class)];
                let counts: Vec<u64> = (0..case.classes).map(|f| confusion.count(class, f)).collect();
                assert_eq!(&counts, expected);
                let iou = confusion.iou(class);
                assert_eq!(iou.is_some(), case.ious.contains_key(&class), "{class}");
                assert!(iou.is_none_or(|iou| (iou - case.ious[&class]).abs() < 1e-9));
            }
            assert!((confusion.mean_iou().unwrap() - case.mean).abs() < 1e-9);
        }
    }

    #[test]
    fn labels_outside_the_classes_are_refused_unless_ignored() {
        let mut confusion = Confusion::new(2, Some(255));
        let error = confusion.image(&[0, 1, 1], &[0, 1, 2]).unwrap_err();
        assert_eq!(error, UnknownClass { pixel: 2, label: 2, classes: 2 });
        assert_eq!(confusion.mean_iou(), None);
        confusion.image(&[255, 0], &[9, 0]).unwrap();
        assert_eq!((confusion.iou(0), confusion.iou(1), confusion.mean_iou()), (Some(1.0), None, Some(1.0)));
    }
}
