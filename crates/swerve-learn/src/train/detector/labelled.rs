//! Labelled images as read from a data set.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use swerve_measure::picture::read_png;
use swerve_report::files::entries;
use swerve_text::{FILE_MAX, read_string};
use swerve_vision::Rgb;
use swerve_vision::acf::iou;

use super::recipe::Class;

/// Maximum occlusion (KITTI's level) and truncation of an object that counts.
const OCCLUDED_MAX: u32 = 1;
const TRUNCATED_MAX: f64 = 0.3;

/// Image with its labels.
pub(super) struct Labelled {
    pub(super) size: [usize; 2],
    rgb: Vec<u8>,
    truths: Vec<Truth>,
}

/// Line of KITTI labels.
struct Truth {
    kind: String,
    truncated: f64,
    occluded: u32,
    /// Left, top, width, height.
    bbox: [f64; 4],
    /// Depth along the optical axis, metres.
    depth_m: f64,
}

impl Labelled {
    /// A noisy image of cars, all fully visible: grey boxes with dark wheels.
    #[cfg(test)]
    pub(super) fn drawn(size: [usize; 2], seed: u64) -> Self {
        let mut rng = swerve_core::Rng::keyed(seed, "drawn", &[]);
        let mut rgb: Vec<u8> = (0..3 * size[0] * size[1]).map(|_| 90 + rng.below(40) as u8).collect();
        let mut truths = Vec::new();
        for k in 0..3 {
            let [left, top] = [10 + 50 * k + rng.below(8), 20 + rng.below(30)];
            for (x, y) in (0..23).flat_map(|x| (0..20).map(move |y| (x, y))) {
                let shade = if y > 15 && x % 16 < 7 { 10 } else { 200 };
                rgb[3 * ((top + y) * size[0] + left + x)..][..3].fill(shade);
            }
            let bbox = [left as f64, top as f64, 23.0, 20.0];
            truths.push(Truth { kind: "Car".into(), truncated: 0.0, occluded: 0, bbox, depth_m: 20.0 });
        }
        Self { size, rgb, truths }
    }

    pub(super) fn rgb(&self) -> Rgb<'_> {
        Rgb::new(self.size[0], self.size[1], &self.rgb).expect("the size was that of the file")
    }

    /// Boxes of a class, and true for those to be found: near and sufficiently visible. Boxes of similar types are
    /// included as not to be found.
    pub(super) fn wanted(&self, class: Class, within_m: f64) -> Vec<([f64; 4], bool)> {
        let one = |truth: &Truth| {
            let visible = truth.occluded <= OCCLUDED_MAX && truth.truncated <= TRUNCATED_MAX;
            match class.is(&truth.kind) {
                Some(false) => None,
                Some(true) => Some((truth.bbox, visible && truth.depth_m <= within_m)),
                None => Some((truth.bbox, false)),
            }
        };
        self.truths.iter().filter_map(one).collect()
    }

    /// Boxes of a class to train on: occluded by at most `occluded_max`, truncated by at most a tenth.
    pub(super) fn examples(
        &self,
        class: Class,
        occluded_max: u32,
        within_m: f64,
    ) -> impl Iterator<Item = [f64; 4]> {
        let clean = move |truth: &&Truth| {
            let visible = truth.occluded <= occluded_max && truth.truncated <= 0.1;
            class.is(&truth.kind) == Some(true) && visible && truth.depth_m <= within_m
        };
        self.truths.iter().filter(clean).map(|truth| truth.bbox)
    }

    /// Largest overlap of a box with any object of a class or of a similar type.
    pub(super) fn overlap(&self, class: Class, bbox: [f64; 4]) -> f64 {
        let own = self.truths.iter().filter(|truth| class.is(&truth.kind) != Some(false));
        own.map(|truth| iou(truth.bbox, bbox)).fold(0.0, f64::max)
    }
}

/// All samples of a folder in KITTI format, sorted by name.
pub(super) fn read(folder: &Path) -> anyhow::Result<Vec<Labelled>> {
    let labels = folder.join("label_2");
    let paths = entries(&labels).with_context(|| format!("reading {}", labels.display()))?;
    let sample = |path: &PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let image = folder.join("image_2").join(name + ".png");
        let ([width, height], rgb) = read_png(&image)?;
        let text = read_string(path, FILE_MAX).with_context(|| format!("reading {}", path.display()))?;
        let line = |(k, line): (usize, &str)| {
            truth(line)
                .ok_or_else(|| anyhow!("{}:{}: expected a label as KITTI has them", path.display(), k + 1))
        };
        let truths = text.lines().enumerate().map(line).collect::<anyhow::Result<_>>()?;
        Ok(Labelled { size: [width, height], rgb, truths })
    };
    paths.iter().map(sample).collect()
}

fn truth(line: &str) -> Option<Truth> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let number = |k: usize| fields.get(k).and_then(|field| field.parse::<f64>().ok());
    let [left, top, right, bottom] = [number(4)?, number(5)?, number(6)?, number(7)?];
    Some(Truth {
        kind: (*fields.first()?).to_owned(),
        truncated: number(1)?,
        occluded: fields.get(2)?.parse().ok()?,
        bbox: [left, top, right - left, bottom - top],
        depth_m: number(13)?,
    })
}
