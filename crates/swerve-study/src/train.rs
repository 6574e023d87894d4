//! `swerve train`: models that perception is shipped with, learned from simulated drives.

mod detector;
mod lidar;

pub use detector::read_png;
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
    Detector(detector::DetectorArgs),
    /// Trees that tell objects in the points of a lidar; and how good they are, on streets that they have not seen
    Lidar(lidar::LidarArgs),
}

/// Runs `swerve train`.
///
/// # Errors
/// When a drive is not to be made, or the result not to be written.
pub fn run(args: &TrainArgs, registry: &Registry) -> anyhow::Result<()> {
    match &args.what {
        What::Detector(args) => detector::run(args, registry),
        What::Lidar(args) => lidar::run(args),
    }
}
