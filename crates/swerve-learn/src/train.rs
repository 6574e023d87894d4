//! `swerve train`: trains the built-in models of perception and prediction on simulated drives.

mod by_recipe;
mod detector;
mod images;
mod lidar;
mod prediction;
mod segmentation;
mod street;

use std::path::Path;

use swerve_stack::Registry;

/// `swerve train`.
#[derive(clap::Args, Debug)]
pub struct TrainArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand, Debug)]
enum What {
    /// A camera object detector, on images of random streets or on labelled pictures, by a recipe
    Detector(by_recipe::RecipeArgs),
    /// A camera segmentation, on images of random streets, by a recipe
    Segmentation(by_recipe::RecipeArgs),
    /// A small network that predicts paths of road users, on generated or recorded tracks, by a recipe
    Prediction(by_recipe::RecipeArgs),
    /// Trees that classify objects in lidar points, with their accuracy on unseen streets
    Lidar(lidar::LidarArgs),
}

/// Accuracy of the built-in models on held-out streets, as reported by `swerve train`: a detector's average precision
/// by rung, set and class; a segmentation's intersection over union by set and class.
///
/// # Errors
/// If a recipe, its weights or its images are missing and cannot be created.
pub fn held_out(what: HeldOut, recipe: &Path, data: &Path) -> anyhow::Result<Vec<Vec<String>>> {
    let registry = Registry::default();
    match what {
        HeldOut::Detector => by_recipe::held_out::<detector::Recipe>(recipe, data, &registry),
        HeldOut::Segmentation => by_recipe::held_out::<segmentation::Recipe>(recipe, data, &registry),
    }
}

/// Model to evaluate on held-out streets.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum HeldOut {
    /// Camera detector.
    Detector,
    /// Camera segmentation.
    Segmentation,
}

/// Average precision of cars detected by lidar on this many held-out streets (overlap 0.5 in bird's-eye view, at least
/// 20 points, within 40 m, mean of 40 recalls): of single sweeps, with SORT on the ground, with AB3DMOT.
///
/// # Errors
/// If a street cannot be driven.
pub fn lidar_cars(streets: usize) -> anyhow::Result<[f64; 3]> {
    lidar::shipped_cars(streets)
}

/// Runs `swerve train`.
///
/// # Errors
/// If a drive fails, or the result cannot be written.
pub fn run(args: &TrainArgs, registry: &Registry) -> anyhow::Result<()> {
    match &args.what {
        What::Detector(args) => by_recipe::run::<detector::Recipe>(args, registry),
        What::Segmentation(args) => by_recipe::run::<segmentation::Recipe>(args, registry),
        What::Prediction(args) => by_recipe::run::<prediction::Recipe>(args, registry),
        What::Lidar(args) => lidar::run(args),
    }
}
