//! Training by a recipe: weights of a detector, a segmentation or a predictor.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_report::files::{read_whole, write_whole};
use swerve_report::output;
use swerve_stack::Registry;

/// `swerve train detector`, `swerve train segmentation`, `swerve train prediction`.
#[derive(clap::Args, Debug)]
pub(super) struct RecipeArgs {
    /// Recipe (TOML): training data and parameters
    recipe: PathBuf,
    /// Folder of the training data: images, of which missing ones are rendered; labelled pictures; recorded tracks
    #[arg(long, default_value = "out/training")]
    pub(super) data: PathBuf,
    /// Write the weights to this file [default: the recipe's path with the ending .weights]
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
    /// Number of images and trees processed at the same time; the weights do not depend on it
    #[arg(long, default_value_t = 1, value_parser = swerve_drive::threads::parser())]
    threads: usize,
    /// Test these weights instead of training
    #[arg(long, value_name = "FILE", conflicts_with = "out")]
    test: Option<PathBuf>,
}

impl RecipeArgs {
    pub(super) fn of(recipe: &Path, data: &Path) -> Self {
        Self {
            recipe: recipe.to_owned(),
            data: data.to_owned(),
            out: None,
            overwrite: OverwriteArgs::default(),
            threads: 1,
            test: None,
        }
    }
}

/// Recipe of one kind, and the weights that it trains.
pub(super) trait Trained: Sized + Send + Sync {
    /// Name of the subcommand of `swerve train`.
    const NAME: &str;
    type Weights: Send + Sync;

    /// Reads and checks a recipe. Returns it with its text.
    fn recipe(path: &Path) -> anyhow::Result<(Self, String)>;
    fn read(bytes: &[u8]) -> anyhow::Result<Self::Weights>;
    fn write(weights: &Self::Weights) -> Vec<u8>;
    /// Trains the weights; `source` describes their origin.
    fn train(&self, source: String, args: &RecipeArgs, registry: &Registry) -> anyhow::Result<Self::Weights>;
    /// Table of the weights' accuracy on the test sets of the recipe.
    fn test(
        &self,
        weights: &Self::Weights,
        args: &RecipeArgs,
        registry: &Registry,
    ) -> anyhow::Result<Vec<Vec<String>>>;
}

/// Description of the origin of a recipe's weights.
pub(super) fn source<T: Trained>(recipe: &Path, text: &str) -> String {
    let name = recipe.file_name().unwrap_or_default().to_string_lossy();
    format!("swerve train {} {name} (recipe {})", T::NAME, swerve_core::digest_of(text))
}

/// Table of the accuracy of the weights beside a recipe on its held-out images, which are rendered if missing in this
/// folder.
pub(super) fn held_out<T: Trained>(
    recipe: &Path,
    data: &Path,
    registry: &Registry,
) -> anyhow::Result<Vec<Vec<String>>> {
    let weights = weights::<T>(&recipe.with_extension("weights"))?;
    T::recipe(recipe)?.0.test(&weights, &RecipeArgs::of(recipe, data), registry)
}

fn weights<T: Trained>(path: &Path) -> anyhow::Result<T::Weights> {
    let bytes = read_whole(path)?;
    T::read(&bytes).with_context(|| path.display().to_string())
}

/// Trains and tests, or only tests.
pub(super) fn run<T: Trained>(args: &RecipeArgs, registry: &Registry) -> anyhow::Result<()> {
    let (recipe, text) = T::recipe(&args.recipe)?;
    let out = args.out.clone().unwrap_or_else(|| args.recipe.with_extension("weights"));
    if args.test.is_none() {
        args.overwrite.check([out.as_path()])?;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let weights = match &args.test {
        Some(path) => weights::<T>(path)?,
        None => {
            let weights = pool.install(|| recipe.train(source::<T>(&args.recipe, &text), args, registry))?;
            write_whole(&out, &T::write(&weights))?;
            weights
        }
    };
    let lines = pool.install(|| recipe.test(&weights, args, registry))?;
    output::print(&output::align(&lines))
}
