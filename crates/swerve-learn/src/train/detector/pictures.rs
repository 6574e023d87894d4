//! Labelled pictures in folders, in place of rendered images: their description in recipes, and their labels.

mod coco;
mod folders;
pub(super) mod kitti;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use anyhow::ensure;
use serde::Deserialize;
use swerve_text::{did_you_mean, list};

use super::labelled::{Labelled, Truth};
use super::recipe::Class;

/// Labelled pictures. Paths are from the folder of the training data (`--data`).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::train) struct Pictures {
    folder: PathBuf,
    format: Format,
    /// COCO's labels; default: `instances.json` in the folder.
    labels: Option<PathBuf>,
    /// Part of the pictures in the order of their names: first and last, as shares of all.
    #[serde(default = "whole")]
    share: [f64; 2],
    /// Share of a cut-out's width left and right of the object, and of its height above and below.
    #[serde(default)]
    margin: [f64; 2],
    /// COCO's categories of a class, in place of the usual ones.
    #[serde(default)]
    categories: BTreeMap<String, Vec<String>>,
}

/// Layout of the folder.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Format {
    /// `image_2` and `label_2`, with a file of labels for each picture.
    Kitti,
    /// Pictures, and one file of labels.
    Coco,
    /// A folder of cut-outs for each class, and `background`.
    Folders,
}

fn whole() -> [f64; 2] {
    [0.0, 1.0]
}

impl Pictures {
    /// Checks the table at `set[k].pictures`.
    pub(in crate::train) fn check(&self, k: usize, ensure: &mut dyn FnMut(bool, String, &str)) {
        let key = |name: &str| format!("set[{k}].pictures.{name}");
        let [from, to] = self.share;
        let is_part = 0.0 <= from && from < to && to <= 1.0;
        ensure(is_part, key("share"), "expected from and to, 0 to 1");
        let is_margin = self.margin.iter().all(|share| (0.0..0.5).contains(share));
        ensure(is_margin, key("margin"), "expected two shares of at least 0 and below 0.5");
        let is = |format: Format| self.format == format;
        ensure(
            is(Format::Coco) || self.labels.is_none(),
            key("labels"),
            "expected only with `format = \"coco\"`",
        );
        let cut_out = is(Format::Folders) || self.margin == [0.0; 2];
        ensure(cut_out, key("margin"), "expected only with `format = \"folders\"`");
        for name in self.categories.keys() {
            let only = "expected only with `format = \"coco\"`";
            ensure(is(Format::Coco), key("categories"), only);
            let names = Class::ALL.map(Class::name);
            let what = format!("expected {}{}", list(&names), did_you_mean(name, names));
            ensure(names.contains(&name.as_str()), key(&format!("categories.{name}")), &what);
        }
    }

    /// True if both have pictures of the same folder and overlapping shares.
    pub(in crate::train) fn shares_with(&self, other: &Self) -> bool {
        let overlap = self.share[0] < other.share[1] && other.share[0] < self.share[1];
        overlap && plain(&self.folder) == plain(&other.folder) && self.labels == other.labels
    }

    /// Reads the labels and decodes each picture once, so that errors are found before training.
    pub(super) fn read(&self, data: &Path) -> anyhow::Result<Vec<Labelled>> {
        let folder = data.join(&self.folder);
        let images = match self.format {
            Format::Kitti => kitti::read(&folder, self.share),
            Format::Coco => {
                let labels = self.labels.as_ref().map(|labels| data.join(labels));
                let labels = labels.unwrap_or_else(|| folder.join("instances.json"));
                coco::read(&folder, &labels, &self.categories, self.share)
            }
            Format::Folders => folders::read(&folder, self.margin, self.share),
        }?;
        let [from, to] = self.share;
        ensure!(
            !images.is_empty(),
            "share: expected at least one picture from {from} to {to} of {}",
            folder.display()
        );
        Ok(images)
    }
}

/// Path without `.`, and without `NAME/..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        let back = part == Component::ParentDir
            && matches!(plain.components().next_back(), Some(Component::Normal(_)));
        if back {
            plain.pop();
        } else if part != Component::CurDir {
            plain.push(part);
        }
    }
    plain
}

/// Part of a list between two shares of its length; neighbouring shares have no element in common.
fn part<T>(mut all: Vec<T>, share: [f64; 2]) -> Vec<T> {
    let [from, to] = share.map(|share| (share * all.len() as f64).round() as usize);
    all.truncate(to);
    all.drain(..from.min(all.len()));
    all
}

/// Problem with a box (left, top, width, height) that is not in its picture.
fn outside([left, top, across, down]: [f64; 4], [width, height]: [usize; 2]) -> Option<String> {
    let is_in = left < width as f64 && top < height as f64 && left + across > 0.0 && top + down > 0.0;
    (!is_in).then(|| format!("expected a box in the picture of {width} x {height} pixels"))
}

/// Region of unlabelled objects that is the whole picture.
fn everywhere(size: [usize; 2]) -> Truth {
    Truth::region(None, [0.0, 0.0, size[0] as f64, size[1] as f64])
}
