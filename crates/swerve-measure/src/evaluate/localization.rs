//! `swerve eval localization`: a filter on a recorded drive, against the ground truth.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::ValueEnum;
use swerve_localization::recorded::{Preset, Recorded, Report};
use swerve_localization::{Params, npz};
use swerve_report::files::read_whole;
use swerve_text::parse_assignments;

/// Recorded drive and filter settings.
#[derive(clap::Args, Debug)]
pub(super) struct LocalizationArgs {
    /// Arrays of a drive and its ground truth (NumPy .npz)
    log: PathBuf,
    /// Localization filter
    #[arg(long, value_enum, default_value = "eskf")]
    filter: Filter,
    /// Preset of the filter's settings
    #[arg(long, value_enum, default_value = "best")]
    preset: Settings,
    /// Change a key of the settings, as in `degrees_error=true`
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print one JSON object and nothing else
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Filter {
    /// Error-state Kalman filter
    Eskf,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Settings {
    /// All sensors, their actual noise, and vehicle constraints
    Best,
    /// Pylot's settings: position fixes and inertial unit, with its noise; its errors by `--set degrees_error=true` and
    /// `--set gravity_free_jacobian=true`
    Paper,
}

/// Runs the filter on the drive and evaluates it.
///
/// # Errors
/// If a file cannot be read or is not such a drive, or if a key is unknown or out of range.
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

/// Settings with these keys changed.
fn changed(params: &Params, set: &[String]) -> anyhow::Result<Params> {
    let mut table = toml::Table::try_from(params)?;
    for (key, value) in parse_assignments(set)? {
        swerve_text::set(&mut table, &key, value)
            .map_err(|(key, message)| anyhow!("--set: {key}: {message}"))?;
    }
    swerve_text::read(&table).map_err(|problems| anyhow!("--set: {}", swerve_text::in_one_line(&problems)))
}
