//! `swerve train`: models that perception is shipped with, learned from simulated drives.

mod lidar;

/// `swerve train`.
#[derive(clap::Args, Debug)]
pub struct TrainArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand, Debug)]
enum What {
    /// Trees that tell objects in the points of a lidar; and how good they are, on streets that they have not seen
    Lidar(lidar::LidarArgs),
}

/// Runs `swerve train`.
///
/// # Errors
/// When a drive is not to be made, or the result not to be written.
pub fn run(args: &TrainArgs) -> anyhow::Result<()> {
    match &args.what {
        What::Lidar(args) => lidar::run(args),
    }
}
