//! `swerve train detector`: trains detectors on images of random streets or on labelled pictures, by a recipe.

mod labelled;
mod learn;
mod pictures;
mod recipe;
mod scanners;
mod score;
#[cfg(test)]
mod tests;

use std::path::Path;

use anyhow::Context as _;
use swerve_report::progress::Progress;
use swerve_stack::Registry;
use swerve_vision::acf::Weights;

use super::by_recipe::{RecipeArgs, Trained};
use super::images::{ImageSet, Purpose, rendered};
use labelled::Labelled;
pub(super) use pictures::Pictures;
use pictures::kitti;
use recipe::Class;
pub(super) use recipe::Recipe;

impl Trained for Recipe {
    const NAME: &str = "detector";
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
        train(self, source, args, registry)
    }

    fn test(
        &self,
        weights: &Weights,
        args: &RecipeArgs,
        registry: &Registry,
    ) -> anyhow::Result<Vec<Vec<String>>> {
        test(self, weights, args, registry)
    }
}

/// Images of the sets of a purpose, set by set.
fn all(
    recipe: &Recipe,
    purpose: Purpose,
    args: &RecipeArgs,
    registry: &Registry,
) -> anyhow::Result<Vec<(String, Vec<Labelled>)>> {
    let sets = recipe.set.iter().enumerate().filter(|(_, set)| set.purpose == purpose);
    sets.map(|(k, set)| Ok((set.name.clone(), images(recipe, (k, set), args, registry)?))).collect()
}

/// Images of a set: pictures, or rendered.
fn images(
    recipe: &Recipe,
    (k, set): (usize, &ImageSet),
    args: &RecipeArgs,
    registry: &Registry,
) -> anyhow::Result<Vec<Labelled>> {
    if let Some(pictures) = &set.pictures {
        let failed = |error: anyhow::Error| recipe.error_at(&format!("set[{k}].pictures"), &error);
        return pictures.read(&args.data).map_err(failed);
    }
    let camera = recipe.camera.as_ref().context("expected the table `[camera]`: streets are rendered")?;
    kitti::read(&rendered(camera, set, &args.data, registry)?, [0.0, 1.0])
}

fn train(recipe: &Recipe, source: String, args: &RecipeArgs, registry: &Registry) -> anyhow::Result<Weights> {
    let of = |purpose| -> anyhow::Result<Vec<Labelled>> {
        Ok(all(recipe, purpose, args, registry)?.into_iter().flat_map(|(_, images)| images).collect())
    };
    let (training, held_out) = (of(Purpose::Training)?, of(Purpose::Calibration)?);
    // Errors in pictures to test by are found before training too.
    let tests = recipe.set.iter().enumerate();
    let tests = tests.filter(|(_, set)| set.purpose == Purpose::Test && set.pictures.is_some());
    let tests: Vec<Vec<Labelled>> =
        tests.map(|set| images(recipe, set, args, registry)).collect::<anyhow::Result<_>>()?;
    labelled::check_apart(&training, held_out.iter().chain(tests.iter().flatten()))?;
    learn::check_examples(recipe, &training)?;
    let progress = Progress::learning(recipe.learning.rounds(), "rounds of learning");
    progress.tell(&format!("{} images to train on, {} to calibrate by", training.len(), held_out.len()));
    let mut weights = learn::untrained(recipe, source);
    learn::learn(recipe, &training, &mut weights, &progress)?;
    let classes = classes(recipe);
    for class in &classes {
        let counts =
            |image: &Labelled| image.wanted(*class, &recipe.learning).iter().any(|(_, counts)| *counts);
        if !held_out.iter().any(counts) {
            progress.tell(&format!("no {} to calibrate by: its probabilities have no meaning", class.name()));
        }
    }
    for k in 0..weights.rungs.len() {
        let found = score::detect(recipe, &weights, &weights.rungs[k], &held_out)?;
        let judged = |class| score::judged(&found, &held_out, class, &recipe.learning);
        let calibrations =
            classes.iter().enumerate().map(|(k, class)| score::calibrate(&judged((k, *class))));
        weights.rungs[k].calibrations = calibrations.collect();
    }
    progress.finish();
    Ok(weights)
}

/// Classes in the order of the weights.
fn classes(recipe: &Recipe) -> Vec<Class> {
    let mut classes: Vec<Class> = recipe.window.iter().map(|window| window.class).collect();
    classes.sort_unstable();
    classes.dedup();
    classes
}

/// Table of rung, set, class, average precision and number of objects.
fn test(
    recipe: &Recipe,
    weights: &Weights,
    args: &RecipeArgs,
    registry: &Registry,
) -> anyhow::Result<Vec<Vec<String>>> {
    let sets = all(recipe, Purpose::Test, args, registry)?;
    let mut lines = vec![["rung", "set", "class", "AP50", "of"].map(str::to_owned).to_vec()];
    for rung in &weights.rungs {
        for (name, images) in &sets {
            let found = score::detect(recipe, weights, rung, images)?;
            for (k, class) in classes(recipe).into_iter().enumerate() {
                let (ap, count) = score::average_precision(&found, images, (k, class), &recipe.learning);
                let ap = ap.map_or_else(|| "-".to_owned(), |ap| format!("{ap:.3}"));
                lines.push(vec![
                    rung.name.clone(),
                    name.clone(),
                    class.name().to_owned(),
                    ap,
                    count.to_string(),
                ]);
            }
        }
    }
    Ok(lines)
}
