//! `swerve train`: models that perception is shipped with, learned from simulated drives.

mod by_recipe;
mod detector;
mod images;
mod lidar;
mod segmentation;
mod street;

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
    /// Trees that tell objects in the points of a lidar; and how good they are, on streets that they have not seen
    Lidar(lidar::LidarArgs),
}

/// Runs `swerve train`.
///
/// # Errors
/// When a drive is not to be made, or the result not to be written.
pub fn run(args: &TrainArgs, registry: &Registry) -> anyhow::Result<()> {
    match &args.what {
        What::Detector(args) => by_recipe::run::<detector::Recipe>(args, registry),
        What::Segmentation(args) => by_recipe::run::<segmentation::Recipe>(args, registry),
        What::Lidar(args) => lidar::run(args),
    }
}
