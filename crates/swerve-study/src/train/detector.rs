//! `swerve train detector`: detectors trained on images of random streets, by a recipe.

mod labelled;
mod learn;
mod recipe;
mod score;
mod street;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use anyhow::Context as _;
use swerve_report::files::{refuse_unwritable, write_whole};
use swerve_report::output;
use swerve_report::progress::Progress;
use swerve_stack::Registry;
use swerve_vision::acf::Weights;

pub use labelled::read_png;
use labelled::{Labelled, images};
use recipe::{Class, Purpose, Recipe};

/// `swerve train detector`.
#[derive(clap::Args, Debug)]
pub(super) struct DetectorArgs {
    /// Recipe (TOML): streets, weathers, windows, rounds, rungs
    recipe: PathBuf,
    /// Folder of the labelled images; those that are not there are made
    #[arg(long, default_value = "out/training")]
    data: PathBuf,
    /// Write the weights to this file [default: the recipe's, with the ending .weights]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Images looked at at once; the weights are the same for any number
    #[arg(long, default_value_t = 1, value_parser = swerve_drive::threads::parser())]
    threads: usize,
    /// Test these weights instead of training
    #[arg(long, value_name = "FILE", conflicts_with = "out")]
    test: Option<PathBuf>,
}

/// Runs `swerve train detector`.
pub(super) fn run(args: &DetectorArgs, registry: &Registry) -> anyhow::Result<()> {
    let (recipe, text) = Recipe::read(&args.recipe)?;
    let out = args.out.clone().unwrap_or_else(|| args.recipe.with_extension("weights"));
    if args.test.is_none() {
        refuse_unwritable(&out)?;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let weights = match &args.test {
        Some(path) => {
            let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
            Weights::read(&bytes).with_context(|| path.display().to_string())?
        }
        None => {
            let name = args.recipe.file_name().unwrap_or_default().to_string_lossy();
            let source = format!("swerve train detector {name} (recipe {})", swerve_core::digest_of(&text));
            let weights = pool.install(|| train(&recipe, source, args, registry))?;
            write_whole(&out, &weights.write())?;
            weights
        }
    };
    let lines = pool.install(|| test(&recipe, &weights, args, registry))?;
    output::print(&output::align(&lines))
}

fn all(
    recipe: &Recipe,
    purpose: Purpose,
    args: &DetectorArgs,
    registry: &Registry,
) -> anyhow::Result<Vec<(String, Vec<Labelled>)>> {
    let sets = recipe.set.iter().filter(|set| set.purpose == purpose);
    sets.map(|set| Ok((set.name.clone(), images(recipe, set, &args.data, registry)?))).collect()
}

fn train(
    recipe: &Recipe,
    source: String,
    args: &DetectorArgs,
    registry: &Registry,
) -> anyhow::Result<Weights> {
    let of = |purpose| -> anyhow::Result<Vec<Labelled>> {
        Ok(all(recipe, purpose, args, registry)?.into_iter().flat_map(|(_, images)| images).collect())
    };
    let (training, held_out) = (of(Purpose::Training)?, of(Purpose::Calibration)?);
    let progress = Progress::fits(recipe.learning.rounds.len());
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

/// In the order of the weights' classes.
fn classes(recipe: &Recipe) -> Vec<Class> {
    let mut classes: Vec<Class> = recipe.window.iter().map(|window| window.class).collect();
    classes.sort_unstable();
    classes.dedup();
    classes
}

/// A table: rung, set, class, average precision, how many there were.
fn test(
    recipe: &Recipe,
    weights: &Weights,
    args: &DetectorArgs,
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
