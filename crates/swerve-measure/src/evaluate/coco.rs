//! COCO annotations and results.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::bail;
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use swerve_eval::{CocoClass, CocoFound, CocoMetrics, CocoTruth};
use swerve_text::from_json;

use super::input::text;
use super::{Compared, numbers};

#[derive(Deserialize)]
#[serde(expecting = "an object with `images`, `categories` and `annotations`")]
struct Truth {
    images: Vec<Named>,
    categories: Vec<Named>,
    annotations: Vec<Annotation>,
}

#[derive(Deserialize)]
#[serde(expecting = "an object with `id`")]
struct Named {
    id: u64,
    #[serde(default)]
    name: Option<String>,
}

#[derive(Deserialize)]
#[serde(expecting = "an object with `image_id`, `category_id` and `bbox`")]
struct Annotation {
    image_id: u64,
    category_id: u64,
    #[serde(deserialize_with = "box_px")]
    bbox: [f64; 4],
    area: Option<f64>,
    #[serde(default)]
    iscrowd: u8,
}

#[derive(Deserialize)]
#[serde(expecting = "an object with `image_id`, `category_id`, `bbox` and `score`")]
struct Report {
    image_id: u64,
    category_id: u64,
    #[serde(deserialize_with = "box_px")]
    bbox: [f64; 4],
    score: f64,
}

/// Deserialises a box: left, top, width, height, pixels.
fn box_px<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 4], D::Error> {
    let edges = <[f64; 4]>::deserialize(from)?;
    if edges[2] < 0.0 || edges[3] < 0.0 {
        let what =
            format!("expected a width and a height of at least 0, found {} and {}", edges[2], edges[3]);
        return Err(D::Error::custom(what));
    }
    Ok(edges)
}

/// Metrics over all classes, and of each class.
#[derive(Serialize)]
pub(super) struct CocoReport {
    all: CocoMetrics,
    classes: BTreeMap<String, CocoMetrics>,
    /// Notes on results that do not count or look wrong.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
}

/// Objects of one class in each image, by the image's identity.
type Images<T> = BTreeMap<u64, Vec<T>>;

pub(super) fn evaluate(compared: &Compared) -> anyhow::Result<CocoReport> {
    let truth: Truth = read(&compared.truth)?;
    let found: Vec<Report> = read(&compared.found)?;
    let images: BTreeSet<u64> = truth.images.iter().map(|image| image.id).collect();
    let classes: BTreeMap<u64, String> = truth.categories.iter().map(|c| (c.id, name(c))).collect();
    let of = compared.truth.display();
    let check_image = |path: &Path, key: &str, image: u64| {
        if !images.contains(&image) {
            bail!("{}: {key}.image_id: expected an image of {of}, found {image}", path.display());
        }
        Ok(())
    };
    let mut there = BTreeMap::<u64, Images<CocoTruth>>::new();
    for (k, a) in truth.annotations.iter().enumerate() {
        let (path, key, class) = (&compared.truth, format!("annotations[{k}]"), a.category_id);
        check_image(path, &key, a.image_id)?;
        if !classes.contains_key(&class) {
            bail!("{}: {key}.category_id: expected a category of {of}, found {class}", path.display());
        }
        let area_px2 = a.area.unwrap_or(a.bbox[2] * a.bbox[3]);
        let one = CocoTruth { box_px: a.bbox, area_px2, is_crowd: a.iscrowd != 0 };
        there.entry(a.category_id).or_default().entry(a.image_id).or_default().push(one);
    }
    let mut reported = BTreeMap::<u64, Images<CocoFound>>::new();
    let (mut passed_over, mut out_of_range) = (BTreeMap::<u64, usize>::new(), Vec::new());
    for (k, r) in found.iter().enumerate() {
        check_image(&compared.found, &format!("[{k}]"), r.image_id)?;
        if !classes.contains_key(&r.category_id) {
            // As in pycocotools, only categories of the ground truth are evaluated.
            *passed_over.entry(r.category_id).or_default() += 1;
            continue;
        }
        if !(0.0..=1.0).contains(&r.score) {
            out_of_range.push((k, r.score));
        }
        let one = CocoFound { box_px: r.bbox, score: r.score };
        reported.entry(r.category_id).or_default().entry(r.image_id).or_default().push(one);
    }
    let images: Vec<u64> = images.into_iter().collect();
    let judged = compared.timely.judged(images.len());
    let mut metrics = BTreeMap::new();
    for (id, name) in classes {
        let (there, reported) =
            (there.remove(&id).unwrap_or_default(), reported.remove(&id).unwrap_or_default());
        let mut class = CocoClass::default();
        for &(t, r) in &judged {
            let truth = there.get(&images[t]).map_or(&[][..], Vec::as_slice);
            let found = r.and_then(|r| reported.get(&images[r])).map_or(&[][..], Vec::as_slice);
            class.image(truth, found);
        }
        metrics.insert(name, class.metrics());
    }
    let each: Vec<CocoMetrics> = metrics.values().copied().collect();
    let notes = notes(compared, &passed_over, &out_of_range);
    Ok(CocoReport { all: CocoMetrics::mean(&each), classes: metrics, notes })
}

/// Notes on results of categories missing in the ground truth, by category, and on scores out of range, by index.
fn notes(
    compared: &Compared,
    passed_over: &BTreeMap<u64, usize>,
    out_of_range: &[(usize, f64)],
) -> Vec<String> {
    let (truth, found) = (compared.truth.display(), compared.found.display());
    let mut notes = Vec::new();
    if !passed_over.is_empty() {
        let categories: Vec<String> =
            passed_over.iter().map(|(category, count)| format!("{category} ({count})")).collect();
        notes.push(format!(
            "{found}: results of categories that {truth} does not have are not evaluated: {}",
            categories.join(", ")
        ));
    }
    if let [(k, score), ..] = out_of_range {
        let count = out_of_range.len();
        notes.push(format!(
            "{found}: [{k}].score: expected 0 to 1, found {score} ({count} such scores, used as they are)"
        ));
    }
    notes
}

fn name(class: &Named) -> String {
    class.name.clone().unwrap_or_else(|| class.id.to_string())
}

fn read<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    Ok(from_json(&path.display().to_string(), &text(path)?)?)
}

pub(super) fn table(report: &CocoReport) -> anyhow::Result<String> {
    let mut columns = vec![("all", &report.all)];
    columns.extend(report.classes.iter().map(|(name, metrics)| (name.as_str(), metrics)));
    let notes = report.notes.iter().map(|note| format!("{note}\n")).collect::<String>();
    Ok(numbers(&columns)? + &notes)
}
