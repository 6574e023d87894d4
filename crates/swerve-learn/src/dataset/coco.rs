//! Samples in COCO's `instances.json` (Lin et al., "Microsoft COCO", 2014): boxes and masks of the visible pixels. The
//! images are those of the KITTI folder.

use std::path::Path;

use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use swerve_msg::{ActorKind, Image, Pixels};
use swerve_text::{FILE_MAX, read_string};

use super::kitti::PIXELS_MIN;
use super::sample::{Object, Sample};

/// Content of the file.
#[derive(Serialize, Deserialize)]
pub(super) struct Coco {
    images: Vec<Listed>,
    annotations: Vec<Annotation>,
    #[serde(skip_deserializing)]
    categories: Vec<Category>,
}

#[derive(Serialize, Deserialize)]
struct Listed {
    id: usize,
    file_name: String,
    width: u32,
    height: u32,
}

#[derive(Serialize, Deserialize)]
struct Annotation {
    id: usize,
    image_id: usize,
    category_id: u8,
    /// Left, top, width, height.
    bbox: [f64; 4],
    area: usize,
    segmentation: Mask,
    iscrowd: u8,
    /// Identity of the actor in the scenario.
    track_id: u32,
}

/// Mask as run lengths of pixels, alternately outside and inside, column by column.
#[derive(Serialize, Deserialize)]
struct Mask {
    counts: Vec<u32>,
    size: [u32; 2],
}

#[derive(Serialize, Clone)]
struct Category {
    id: u8,
    name: &'static str,
    supercategory: &'static str,
}

/// COCO's ids and names, extended by a category for kinds that COCO lacks.
fn category(kind: ActorKind) -> Category {
    let (id, name, supercategory) = match kind {
        ActorKind::Pedestrian => (1, "person", "person"),
        ActorKind::Cyclist => (2, "bicycle", "vehicle"),
        ActorKind::Car => (3, "car", "vehicle"),
        ActorKind::Motorcycle => (4, "motorcycle", "vehicle"),
        ActorKind::Truck => (8, "truck", "vehicle"),
        ActorKind::Static => (91, "obstacle", "outdoor"),
    };
    Category { id, name, supercategory }
}

fn categories() -> Vec<Category> {
    let kinds = [
        ActorKind::Pedestrian,
        ActorKind::Cyclist,
        ActorKind::Car,
        ActorKind::Motorcycle,
        ActorKind::Truck,
        ActorKind::Static,
    ];
    kinds.map(category).into()
}

impl Default for Coco {
    fn default() -> Self {
        Self { images: Vec::new(), annotations: Vec::new(), categories: categories() }
    }
}

impl Coco {
    pub(super) fn add(&mut self, name: &str, id: usize, sample: &Sample<'_>) {
        let (width, height) = (sample.rgb.width_px, sample.rgb.height_px);
        let file_name = format!("../kitti/training/image_2/{name}.png");
        self.images.push(Listed { id, file_name, width, height });
        for object in sample.objects.iter().filter(|object| object.pixels >= PIXELS_MIN) {
            let [left, top, right, bottom] = object.visible_px;
            self.annotations.push(Annotation {
                id: self.annotations.len() + 1,
                image_id: id,
                category_id: category(object.actor.kind).id,
                bbox: [left, top, right - left, bottom - top],
                area: object.pixels,
                segmentation: mask(object, sample.instance),
                iscrowd: 0,
                track_id: object.actor.id.0,
            });
        }
    }

    /// Reads a file and keeps its first `samples` images.
    pub(super) fn read(path: &Path, samples: usize) -> anyhow::Result<Self> {
        let reading = || format!("reading {}", path.display());
        let text = read_string(path, FILE_MAX).with_context(reading)?;
        let mut coco: Self = serde_json::from_str(&text).with_context(reading)?;
        coco.images.retain(|image| image.id < samples);
        coco.annotations.retain(|annotation| annotation.image_id < samples);
        anyhow::ensure!(coco.images.len() == samples, "{}: expected {samples} images", path.display());
        coco.categories = categories();
        Ok(coco)
    }

    pub(super) fn json(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string(self)? + "\n")
    }
}

fn mask(object: &Object<'_>, image: &Image) -> Mask {
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    let size = [image.height_px, image.width_px];
    let Pixels::InstanceU32(ids) = &image.pixels else { return Mask { counts: Vec::new(), size } };
    let (mut counts, mut run, mut inside) = (Vec::new(), 0, false);
    for column in 0..width {
        for row in 0..height {
            if (ids[row * width + column] == object.actor.id.0) != inside {
                counts.push(core::mem::take(&mut run));
                inside = !inside;
            }
            run += 1;
        }
    }
    counts.push(run);
    Mask { counts, size }
}
