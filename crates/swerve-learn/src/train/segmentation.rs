//! `swerve train segmentation`: a forest that classifies pixels, trained on images of random streets, by a recipe.

mod learn;
mod recipe;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use rayon::prelude::*;
use swerve_eval::Confusion;
use swerve_measure::picture::read_png;
use swerve_report::files::entries;
use swerve_report::progress::Progress;
use swerve_stack::Registry;
use swerve_vision::Rgb;
use swerve_vision::acf::Ground;
use swerve_vision::segmentation::{Segmenter, Weights, grow};

use super::by_recipe::{RecipeArgs, Trained};
use super::images::{Purpose, rendered};
pub(super) use recipe::Recipe;

impl Trained for Recipe {
    const NAME: &str = "segmentation";
    type Weights = Weights;

    fn recipe(path: &Path) -> anyhow::Result<(Self, String)> {
        Self::read(path)
    }

    fn read(bytes: &[u8]) -> anyhow::Result<Weights> {
        Ok(Weights::read(bytes)?)
    }

    fn write(weights: &Weights) -> Vec<u8> {
        weights.write()
    }

    fn train(&self, source: String, args: &RecipeArgs, registry: &Registry) -> anyhow::Result<Weights> {
        let paths: Vec<PathBuf> =
            sets(self, Purpose::Training, args, registry)?.into_iter().flat_map(|(_, paths)| paths).collect();
        let progress = Progress::learning(self.learning.trees, "trees grown");
        let samples = learn::samples(self, &paths)?;
        progress.tell(&format!("{} cells of {} images to train on", samples.len(), paths.len()));
        let one = |number| {
            let tree = grow(&samples, self.class.len() + 1, &self.learning.forest(self.seed), number);
            progress.one_done();
            tree
        };
        let trees = (0..self.learning.trees).into_par_iter().map(one).collect();
        progress.finish();
        Ok(Weights { trees, ..learn::untrained(self, source) })
    }

    fn test(
        &self,
        weights: &Weights,
        args: &RecipeArgs,
        registry: &Registry,
    ) -> anyhow::Result<Vec<Vec<String>>> {
        let names = weights.classes.iter().map(|class| class.name.clone());
        let mut lines: Vec<Vec<String>> =
            vec![["set".into(), "mean IoU".into()].into_iter().chain(names).collect()];
        for (name, paths) in sets(self, Purpose::Test, args, registry)? {
            let confusion = score(self, weights, &paths)?;
            let cell = |iou: Option<f64>| iou.map_or_else(|| "-".to_owned(), |iou| format!("{iou:.3}"));
            // The class of all other pixels is left out of the mean; confusions with it count as errors of the named
            // classes.
            let named = weights.classes.len() - 1;
            let ious: Vec<f64> = (0..named).filter_map(|class| confusion.iou(class as u8)).collect();
            let mean = ious.iter().sum::<f64>() / ious.len().max(1) as f64;
            let of_class = (0..=named).map(|class| cell(confusion.iou(class as u8)));
            lines.push([name, cell(Some(mean))].into_iter().chain(of_class).collect());
        }
        Ok(lines)
    }
}

/// Sets of a purpose, with their image files.
fn sets(
    recipe: &Recipe,
    purpose: Purpose,
    args: &RecipeArgs,
    registry: &Registry,
) -> anyhow::Result<Vec<(String, Vec<PathBuf>)>> {
    let of = recipe.set.iter().filter(|set| set.purpose == purpose);
    of.map(|set| {
        let folder = rendered(&recipe.camera, set, &args.data, registry)?.join("image_2");
        let paths = entries(&folder).with_context(|| format!("reading {}", folder.display()))?;
        Ok((set.name.clone(), paths))
    })
    .collect()
}

/// Image and the classes of its pixels.
struct Labelled {
    size: [usize; 2],
    rgb: Vec<u8>,
    classes: Vec<u8>,
}

impl Labelled {
    /// Reads an image of a data set and its labels.
    fn read(recipe: &Recipe, path: &Path) -> anyhow::Result<Self> {
        let (size, rgb) = read_png(path)?;
        let labels = path.to_string_lossy().replace("image_2", "semantic");
        let (labelled, ids) = read_png(Path::new(&labels))?;
        ensure!(size == labelled, "{labels}: expected labels of {} x {} pixels", size[0], size[1]);
        let class_of = recipe.class_of();
        // Labels are grey, read as three equal channels.
        let classes = ids.chunks_exact(3).map(|id| class_of[usize::from(id[0])]).collect();
        Ok(Self { size, rgb, classes })
    }

    fn rgb(&self) -> Rgb<'_> {
        Rgb::new(self.size[0], self.size[1], &self.rgb).expect("the size was that of the file")
    }
}

/// Ground plane seen by the recipe's camera with an additional tilt.
fn ground(recipe: &Recipe, [_, height]: [usize; 2], tilt_rad: f64) -> Ground {
    let focal_px = recipe.camera.focal_px();
    let horizon_px = 0.5 * height as f64 + tilt_rad * focal_px;
    Ground { horizon_px, focal_px, height_m: recipe.camera.height_m }
}

/// Confusion of true and predicted classes over the pixels of all images.
fn score(recipe: &Recipe, weights: &Weights, paths: &[PathBuf]) -> anyhow::Result<Confusion> {
    let classes = weights.classes.len() as u8;
    let mut class_of = [classes - 1; 256];
    for (class, known) in weights.classes.iter().enumerate() {
        class_of[usize::from(known.id)] = class as u8;
    }
    let seen = |path: &PathBuf| -> anyhow::Result<(Vec<u8>, Vec<u8>)> {
        let image = Labelled::read(recipe, path)?;
        let mut found = vec![0; image.classes.len()];
        let ground = ground(recipe, image.size, 0.0);
        Segmenter::new(weights.clone(), image.size, ground).segment(image.rgb(), &mut found)?;
        found.iter_mut().for_each(|id| *id = class_of[usize::from(*id)]);
        Ok((image.classes, found))
    };
    let mut confusion = Confusion::new(classes.max(recipe.class.len() as u8 + 1), None);
    for some in paths.chunks(16) {
        let seen: Vec<_> = some.par_iter().map(seen).collect::<anyhow::Result<_>>()?;
        seen.iter().try_for_each(|(truth, found)| confusion.image(truth, found))?;
    }
    Ok(confusion)
}
