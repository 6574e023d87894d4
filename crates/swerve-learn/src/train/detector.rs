//! `swerve train detector`: trains detectors on images of random streets, by a recipe.

mod labelled;
mod learn;
mod recipe;
mod score;
#[cfg(test)]
mod tests;

use std::path::Path;

use swerve_report::progress::Progress;
use swerve_stack::Registry;
use swerve_vision::acf::Weights;

use super::by_recipe::{RecipeArgs, Trained};
use super::images::{Purpose, rendered};
use labelled::Labelled;
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

fn all(
    recipe: &Recipe,
    purpose: Purpose,
    args: &RecipeArgs,
    registry: &Registry,
) -> anyhow::Result<Vec<(String, Vec<Labelled>)>> {
    let sets = recipe.set.iter().filter(|set| set.purpose == purpose);
    sets.map(|set| {
        Ok((set.name.clone(), labelled::read(&rendered(&recipe.camera, set, &args.data, registry)?)?))
    })
    .collect()
}

fn train(recipe: &Recipe, source: String, args: &RecipeArgs, registry: &Registry) -> anyhow::Result<Weights> {
    let of = |purpose| -> anyhow::Result<Vec<Labelled>> {
        Ok(all(recipe, purpose, args, registry)?.into_iter().flat_map(|(_, images)| images).collect())
    };
    let (training, held_out) = (of(Purpose::Training)?, of(Purpose::Calibration)?);
    let progress = Progress::learning(recipe.learning.rounds(), "rounds of learning");
    progress.tell(&format!("{} images to train on, {} to calibrate by", training.len(), held_out.len()));
    let mut weights = learn::untrained(recipe, source);
    learn::learn(recipe, &training, &mut weights, &progress);
    let classes = classes(recipe);
    for k in 0..weights.rungs.len() {
        let found = score::detect(recipe, &weights, &weights.rungs[k], &held_out);
        let judged = |class| score::judged(&found, &held_out, class, recipe.learning.within_m);
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
            let found = score::detect(recipe, weights, rung, images);
            for (k, class) in classes(recipe).into_iter().enumerate() {
                let (ap, count) =
                    score::average_precision(&found, images, (k, class), recipe.learning.within_m);
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
