//! Labels in COCO's `instances.json` (Lin et al., "Microsoft COCO", 2014).

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use rayon::prelude::*;
use serde::Deserialize;
use swerve_text::{FILE_MAX, did_you_mean, from_json, read_string};

use super::{outside, part};
use crate::train::detector::labelled::{Labelled, Truth};
use crate::train::detector::recipe::Class;

#[derive(Deserialize)]
#[serde(expecting = "an object with `images`, `categories` and `annotations`")]
struct Instances {
    images: Vec<Image>,
    categories: Vec<Category>,
    annotations: Vec<Annotation>,
}

#[derive(Deserialize)]
#[serde(expecting = "an object with `id`, `file_name`, `width` and `height`")]
struct Image {
    id: u64,
    file_name: String,
    width: usize,
    height: usize,
}

#[derive(Deserialize)]
#[serde(expecting = "an object with `id` and `name`")]
struct Category {
    id: u64,
    name: String,
}

#[derive(Deserialize)]
#[serde(expecting = "an object with `image_id`, `category_id` and `bbox`")]
struct Annotation {
    image_id: u64,
    category_id: u64,
    /// Left, top, width, height.
    bbox: [f64; 4],
    #[serde(default)]
    iscrowd: u8,
}

/// KITTI's type of a category's objects; `None` if they are background. A bicycle, for COCO, is one without its rider.
fn usual(category: &str) -> Option<&'static str> {
    match category.to_lowercase().as_str() {
        "person" | "pedestrian" => Some("Pedestrian"),
        "car" => Some("Car"),
        "van" => Some("Van"),
        "truck" => Some("Truck"),
        "bus" => Some("Bus"),
        "cyclist" | "rider" => Some("Cyclist"),
        "bicycle" | "motorcycle" => Some("Misc"),
        _ => None,
    }
}

/// Pictures of a folder with the labels of a file, in the order of their names.
pub(super) fn read(
    folder: &Path,
    labels: &Path,
    categories: &BTreeMap<String, Vec<String>>,
    share: [f64; 2],
) -> anyhow::Result<Vec<Labelled>> {
    let file = labels.display().to_string();
    let text = read_string(labels, FILE_MAX).with_context(|| format!("reading {file}"))?;
    let Instances { mut images, categories: known, annotations } = from_json(&file, &text)?;
    drop(text);
    let kinds = kinds(&file, &known, categories)?;
    let mut boxes = BTreeMap::new();
    for image in &images {
        let is_new = boxes.insert(image.id, Vec::new()).is_none();
        ensure!(is_new, "{file}: images: expected different `id`, found {} twice", image.id);
    }
    for (k, annotation) in annotations.iter().enumerate() {
        let (image, category) = (annotation.image_id, annotation.category_id);
        let Some(kind) = kinds.get(&category) else {
            bail!("{file}: annotations[{k}].category_id: expected one of `categories`, found {category}");
        };
        let Some(of_image) = boxes.get_mut(&image) else {
            bail!("{file}: annotations[{k}].image_id: expected one of `images`, found {image}");
        };
        let [_, _, width, height] = annotation.bbox;
        ensure!(
            width >= 0.0 && height >= 0.0,
            "{file}: annotations[{k}].bbox: expected a width and a height of at least 0, found {width} and {height}"
        );
        // COCO has a few boxes without an area.
        if let Some(kind) = kind.filter(|_| width > 0.0 && height > 0.0) {
            let region = annotation.iscrowd != 0;
            let bbox = annotation.bbox;
            of_image
                .push((k, if region { Truth::region(Some(kind), bbox) } else { Truth::visible(kind, bbox) }));
        }
    }
    images.sort_by(|a, b| a.file_name.cmp(&b.file_name));
    let images: Vec<_> = part(images, share)
        .into_iter()
        .map(|image| (boxes.remove(&image.id).unwrap_or_default(), image))
        .collect();
    let one = |(truths, image): (Vec<(usize, Truth)>, Image)| {
        let path = folder.join(&image.file_name);
        Labelled::checked(path.clone(), |size| {
            ensure!(
                size == [image.width, image.height],
                "{}: expected {} x {} pixels as in {file}, found {} x {}",
                path.display(),
                image.width,
                image.height,
                size[0],
                size[1]
            );
            let inside = |(k, truth): (usize, Truth)| match outside(truth.bbox, size) {
                Some(what) => bail!("{file}: annotations[{k}].bbox: {what}, found {:?}", truth.bbox),
                None => Ok(truth),
            };
            truths.into_iter().map(inside).collect()
        })
    };
    images.into_par_iter().map(one).collect()
}

/// KITTI's type of each category, by its identity.
fn kinds(
    file: &str,
    known: &[Category],
    named: &BTreeMap<String, Vec<String>>,
) -> anyhow::Result<BTreeMap<u64, Option<&'static str>>> {
    for name in named.values().flatten() {
        let near = did_you_mean(name, known.iter().map(|category| category.name.as_str()));
        let exists = known.iter().any(|category| category.name == *name);
        ensure!(exists, "categories: expected categories of {file}, found `{name}`{near}");
    }
    let kind = |category: &Category| {
        let is_of =
            |class: &Class| named.get(class.name()).is_some_and(|names| names.contains(&category.name));
        let given = Class::ALL.into_iter().find(is_of).map(Class::kind);
        let replaced = |kind: &&str| {
            Class::ALL.iter().any(|class| class.kind() == *kind && named.contains_key(class.name()))
        };
        (category.id, given.or_else(|| usual(&category.name).filter(|kind| !replaced(kind))))
    };
    Ok(known.iter().map(kind).collect())
}
