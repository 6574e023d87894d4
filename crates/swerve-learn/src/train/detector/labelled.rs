//! Labelled images.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use swerve_measure::picture::{MEGAPIXELS_MAX, Picture};
use swerve_vision::acf::iou;

use super::recipe::{Class, Learning, Window};

/// Maximum occlusion (KITTI's level) and truncation of an object that counts.
const OCCLUDED_MAX: u32 = 1;
const TRUNCATED_MAX: f64 = 0.3;
/// Share of a detection inside a region above which it does not count.
const COVERED: f64 = 0.5;

/// Image file with its labels. Its pixels are decoded when they are needed: a large set does not fit in memory.
pub(super) struct Labelled {
    path: PathBuf,
    size: [usize; 2],
    truths: Vec<Truth>,
}

/// Labelled box.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    pub(super) extent: Extent,
    pub(super) truncated: f64,
    /// KITTI's level: 0 visible, 1 partly occluded, 2 largely, 3 unknown.
    pub(super) occluded: u32,
    /// Left, top, width, height.
    pub(super) bbox: [f64; 4],
    /// Depth along the optical axis, metres, if known.
    pub(super) depth_m: Option<f64>,
}

/// Content of a labelled box.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Extent {
    /// One object of this type, in KITTI's words.
    Object(String),
    /// Unlabelled objects of one type, or of any: COCO's crowds, KITTI's `DontCare`.
    Region(Option<String>),
}

impl Truth {
    /// Box of a fully visible object at an unknown distance.
    pub(super) fn visible(kind: &str, bbox: [f64; 4]) -> Self {
        Self { extent: Extent::Object(kind.to_owned()), truncated: 0.0, occluded: 0, bbox, depth_m: None }
    }

    pub(super) fn region(kind: Option<&str>, bbox: [f64; 4]) -> Self {
        Self { extent: Extent::Region(kind.map(str::to_owned)), ..Self::visible("", bbox) }
    }

    /// True if the object is of a class; `None` if it is similar enough to be ignored.
    fn is(&self, class: Class) -> Option<bool> {
        match &self.extent {
            Extent::Object(kind) => class.is(kind),
            Extent::Region(_) => Some(false),
        }
    }

    /// Share of a box inside this region of unlabelled objects of a class; 0 for objects.
    fn covers(&self, class: Class, [left, top, width, height]: [f64; 4]) -> f64 {
        let of_class = match &self.extent {
            Extent::Object(_) => false,
            Extent::Region(kind) => kind.as_ref().is_none_or(|kind| class.is(kind) != Some(false)),
        };
        let shared = |k: usize, from: f64, long: f64| {
            ((from + long).min(self.bbox[k] + self.bbox[k + 2]) - from.max(self.bbox[k])).max(0.0)
        };
        let area = width * height;
        if of_class && area > 0.0 { shared(0, left, width) * shared(1, top, height) / area } else { 0.0 }
    }

    /// True if the distance and the height are those of objects that are learnt and counted.
    fn is_within(&self, learning: &Learning) -> bool {
        self.depth_m.is_none_or(|depth_m| depth_m <= learning.within_m)
            && self.bbox[3] >= learning.height_min_px
    }
}

impl Labelled {
    /// Decodes an image to check it. `labels` receives its width and height.
    pub(super) fn checked(
        path: PathBuf,
        labels: impl FnOnce([usize; 2]) -> anyhow::Result<Vec<Truth>>,
    ) -> anyhow::Result<Self> {
        let size = Picture::read(&path, MEGAPIXELS_MAX)?.size;
        Ok(Self { truths: labels(size)?, path, size })
    }

    /// Decodes the image.
    pub(super) fn picture(&self) -> anyhow::Result<Picture> {
        let picture = Picture::read(&self.path, MEGAPIXELS_MAX)?;
        ensure!(picture.size == self.size, "{}: the file has changed during training", self.path.display());
        Ok(picture)
    }

    pub(super) fn size(&self) -> [usize; 2] {
        self.size
    }

    #[cfg(test)]
    pub(super) fn truths(&self) -> &[Truth] {
        &self.truths
    }

    /// Boxes of a class, and true for those to be found: near and sufficiently visible. Boxes of similar types are
    /// included as not to be found.
    pub(super) fn wanted(&self, class: Class, learning: &Learning) -> Vec<([f64; 4], bool)> {
        let one = |truth: &Truth| {
            let visible = truth.occluded <= OCCLUDED_MAX && truth.truncated <= TRUNCATED_MAX;
            match truth.is(class) {
                Some(false) => None,
                Some(true) => Some((truth.bbox, visible && truth.is_within(learning))),
                None => Some((truth.bbox, false)),
            }
        };
        self.truths.iter().filter_map(one).collect()
    }

    /// True if a detection is in a region of unlabelled objects, where it is neither right nor wrong.
    pub(super) fn is_ignored(&self, class: Class, bbox: [f64; 4]) -> bool {
        self.truths.iter().any(|truth| truth.covers(class, bbox) >= COVERED)
    }

    /// Boxes to train a window on: occluded by at most `occluded_max`, truncated by at most a tenth.
    pub(super) fn examples(&self, window: &Window, learning: &Learning) -> impl Iterator<Item = [f64; 4]> {
        let ([from, to], class, occluded_max) = (window.aspects, window.class, window.occluded_max);
        let clean = move |truth: &&Truth| {
            let visible = truth.occluded <= occluded_max && truth.truncated <= 0.1;
            let aspect = truth.bbox[2] / truth.bbox[3];
            truth.is(class) == Some(true)
                && visible
                && truth.is_within(learning)
                && (from..to).contains(&aspect)
        };
        self.truths.iter().filter(clean).map(|truth| truth.bbox)
    }

    /// Largest overlap of a box with any object of a class or of a similar type, or share of the box in a region of
    /// unlabelled objects.
    pub(super) fn overlap(&self, class: Class, bbox: [f64; 4]) -> f64 {
        let one = |truth: &Truth| match truth.is(class) {
            Some(false) => truth.covers(class, bbox),
            _ => iou(truth.bbox, bbox),
        };
        self.truths.iter().map(one).fold(0.0, f64::max)
    }
}

/// Refuses images that are both trained on and held out.
pub(super) fn check_apart<'a>(
    training: impl IntoIterator<Item = &'a Labelled>,
    held_out: impl IntoIterator<Item = &'a Labelled>,
) -> anyhow::Result<()> {
    let real = |path: &Path| path.canonicalize().with_context(|| format!("reading {}", path.display()));
    let files: BTreeSet<PathBuf> =
        training.into_iter().map(|image| real(&image.path)).collect::<anyhow::Result<_>>()?;
    for image in held_out {
        if files.contains(&real(&image.path)?) {
            bail!("{}: expected an image that is not both trained on and held out", image.path.display());
        }
    }
    Ok(())
}
