//! Labels of the KITTI object benchmark: `label_2` has a file for each picture in `image_2`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use rayon::prelude::*;
use swerve_eval::KittiKind;
use swerve_measure::picture::images_in;
use swerve_report::files::entries;
use swerve_text::{FILE_MAX, did_you_mean, read_string};

use super::{outside, part};
use crate::train::detector::labelled::{Extent, Labelled, Truth};

/// Columns of a label; results have a score as one more.
const COLUMNS: [&str; 15] = [
    "type",
    "truncated",
    "occluded",
    "alpha",
    "left",
    "top",
    "right",
    "bottom",
    "height",
    "width",
    "length",
    "x",
    "y",
    "z",
    "rotation_y",
];

/// Samples of a folder, in the order of their names.
pub(in crate::train::detector) fn read(folder: &Path, share: [f64; 2]) -> anyhow::Result<Vec<Labelled>> {
    let by_stem = |path: PathBuf| (path.file_stem().unwrap_or_default().to_owned(), path);
    let labels = folder.join("label_2");
    let mut files = entries(&labels).with_context(|| format!("reading {}", labels.display()))?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "txt"));
    ensure!(!files.is_empty(), "{}: expected files of labels (.txt)", labels.display());
    let mut pictures: BTreeMap<_, _> = images_in(&folder.join("image_2"))?.into_iter().map(by_stem).collect();
    let mut pairs = Vec::new();
    for file in files {
        let (stem, file) = by_stem(file);
        let Some(picture) = pictures.remove(&stem) else {
            bail!("{}: expected a picture of this name in image_2", file.display());
        };
        pairs.push((file, picture));
    }
    if let Some(picture) = pictures.into_values().next() {
        bail!("{}: expected a file of labels in label_2; it may be empty", picture.display());
    }
    let sample = |(file, picture): (PathBuf, PathBuf)| {
        Labelled::checked(picture, |size| {
            let text = read_string(&file, FILE_MAX).with_context(|| format!("reading {}", file.display()))?;
            let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
            let truth = |(k, line)| {
                truth(line, size).map_err(|what| anyhow::anyhow!("{}:{}: {what}", file.display(), k + 1))
            };
            lines.map(truth).collect()
        })
    };
    part(pairs, share).into_par_iter().map(sample).collect()
}

/// Parses a label of a picture of this size.
fn truth(line: &str, size: [usize; 2]) -> Result<Truth, String> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    if fields.len() < COLUMNS.len() {
        let columns = COLUMNS.join(" ");
        return Err(format!("expected {} columns ({columns}), found {}", COLUMNS.len(), fields.len()));
    }
    let number = |k: usize| match fields[k].parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("{}: expected a number, found `{}`", COLUMNS[k], fields[k])),
    };
    let kind = fields[0];
    let Some((_, known)) = KittiKind::ALL.into_iter().find(|(name, _)| *name == kind) else {
        let near = did_you_mean(kind, KittiKind::ALL.into_iter().map(|(name, _)| name));
        return Err(format!("type: expected one of KITTI's, found `{kind}`{near}"));
    };
    let [left, top, right, bottom] = [number(4)?, number(5)?, number(6)?, number(7)?];
    let bbox = [left, top, right - left, bottom - top];
    if bbox[2] <= 0.0 || bbox[3] <= 0.0 {
        return Err(format!(
            "left top right bottom: expected edges in order, found {left} {top} {right} {bottom}"
        ));
    }
    if known == KittiKind::DontCare {
        return Ok(Truth::region(None, bbox));
    }
    if let Some(what) = outside(bbox, size) {
        return Err(format!("left top right bottom: {what}, found {left} {top} {right} {bottom}"));
    }
    let occluded = number(2)?;
    if !(0.0..=3.0).contains(&occluded) {
        return Err(format!("occluded: expected 0 to 3, found `{}`", fields[2]));
    }
    Ok(Truth {
        extent: Extent::Object(kind.to_owned()),
        truncated: number(1)?,
        occluded: occluded as u32,
        bbox,
        depth_m: Some(number(13)?),
    })
}
