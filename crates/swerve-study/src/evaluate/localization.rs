//! `swerve eval localization`: a filter on a recorded drive, against its truth.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::ValueEnum;
use swerve_localization::recorded::{Preset, Recorded, Report};
use swerve_localization::{Params, npz};
use swerve_report::files::read_whole;

/// A recorded drive, and what is to find its way on it.
#[derive(clap::Args, Debug)]
pub(super) struct LocalizationArgs {
    /// The arrays of a drive and its truth, as NumPy writes them (.npz)
    log: PathBuf,
    /// What localizes
    #[arg(long, value_enum, default_value = "eskf")]
    filter: Filter,
    /// Its settings
    #[arg(long, value_enum, default_value = "best")]
    preset: Settings,
    /// Changes a key of the settings, as in `degrees_error=true`
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print one JSON object and nothing else
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Filter {
    /// The error-state Kalman filter
    Eskf,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Settings {
    /// Every sensor, noises as they are, and what is known of a car
    Best,
    /// Pylot's: fixes and inertial unit, its noises; its errors by `--set degrees_error=true` and `--set gravity_free_jacobian=true`
    Paper,
}

/// How well it did.
///
/// # Errors
/// A file that cannot be read or is no such drive; a key that is unknown or out of its range.
pub(super) fn evaluate(args: &LocalizationArgs) -> anyhow::Result<Report> {
    let LocalizationArgs { log, filter: Filter::Eskf, preset, set, .. } = args;
    let at = log.display();
    let bytes = read_whole(log)?;
    let arrays = npz::read(&bytes).map_err(|error| anyhow!("{at}: {error}"))?;
    let drive = Recorded::new(&arrays).map_err(|error| anyhow!("{at}: {error}"))?;
    let preset = match preset {
        Settings::Best => Preset::Best,
        Settings::Paper => Preset::Paper,
    };
    let params = changed(&drive.params(preset), set)?;
    drive.run(params, preset).map_err(|error| anyhow!("--set: {error}"))
}

/// The settings with these keys changed.
fn changed(params: &Params, set: &[String]) -> anyhow::Result<Params> {
    let mut table = toml::Table::try_from(params)?;
    for change in set {
        let one = toml::from_str::<toml::Table>(change)
            .map_err(|error| anyhow!("--set {change}: {}: expected KEY=VALUE", error.message()))?;
        table.extend(one);
    }
    swerve_text::read(&table).map_err(|problems| anyhow!("--set: {}", swerve_text::in_one_line(&problems)))
}
