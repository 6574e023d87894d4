//! `swerve train`: models that perception and prediction are shipped with, learned from simulated drives.

mod by_recipe;
mod detector;
mod images;
mod lidar;
mod prediction;
pub(crate) mod segmentation;
mod street;

use std::path::Path;

pub(crate) use images::decode_png;
pub use images::read_png;
use swerve_stack::Registry;

/// `swerve train`.
#[derive(clap::Args, Debug)]
pub struct TrainArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand, Debug)]
enum What {
    /// A camera's object detector, on images of random streets, by a recipe
    Detector(by_recipe::RecipeArgs),
    /// A camera's labels of pixels, on images of random streets, by a recipe
    Segmentation(by_recipe::RecipeArgs),
    /// A small net that predicts where others go, on tracks that are made or recorded, by a recipe
    Prediction(by_recipe::RecipeArgs),
    /// Trees that tell objects in the points of a lidar; and how good they are, on streets that they have not seen
    Lidar(lidar::LidarArgs),
}

/// How good what the program is shipped with is on streets that were held out from training, as `swerve train` tells it:
/// a detector's average precision by rung, set and class; a segmentation's overlaps by set and class.
///
/// # Errors
/// When a recipe, its weights or its images are not there and not to be made.
pub fn held_out(what: HeldOut, recipe: &Path, data: &Path) -> anyhow::Result<Vec<Vec<String>>> {
    let registry = Registry::default();
    match what {
        HeldOut::Detector => by_recipe::held_out::<detector::Recipe>(recipe, data, &registry),
        HeldOut::Segmentation => by_recipe::held_out::<segmentation::Recipe>(recipe, data, &registry),
    }
}

/// What is held against streets that it has not learnt from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum HeldOut {
    /// A camera's detector.
    Detector,
    /// A camera's labels of pixels.
    Segmentation,
}

/// Average precision of cars by lidar on so many streets that were held out (overlap 0.5 from above, at least 20 points,
/// within 40 m, mean of 40 recalls): of single sweeps, behind SORT on the ground, behind AB3DMOT.
///
/// # Errors
/// When a street is not to be driven.
pub fn lidar_cars(streets: usize) -> anyhow::Result<[f64; 3]> {
    lidar::shipped_cars(streets)
}

/// Runs `swerve train`.
///
/// # Errors
/// When a drive is not to be made, or the result not to be written.
pub fn run(args: &TrainArgs, registry: &Registry) -> anyhow::Result<()> {
    match &args.what {
        What::Detector(args) => by_recipe::run::<detector::Recipe>(args, registry),
        What::Segmentation(args) => by_recipe::run::<segmentation::Recipe>(args, registry),
        What::Prediction(args) => by_recipe::run::<prediction::Recipe>(args, registry),
        What::Lidar(args) => lidar::run(args),
    }
}
