//! `swerve eval`: what a detector, a tracker, a localizer or a predictor reports, from files of the usual forms, against the truth.

mod coco;
mod kitti;
mod localization;
pub(crate) mod mot;
pub(crate) mod prediction;
mod registration;
#[cfg(test)]
mod tests;
mod timely;

use std::fmt::Display;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::ValueEnum;
use serde::Serialize;
use serde_json::Value;
use swerve_report::files::read_whole;
use swerve_report::output::align;

use localization::LocalizationArgs;
use prediction::PredictionArgs;
use registration::RegistrationArgs;
use timely::TimelyArgs;

/// `swerve eval`.
#[derive(clap::Args, Debug)]
pub struct EvalArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand, Debug)]
enum What {
    /// Boxes of a detector: COCO's twelve numbers, or KITTI's average precision
    Detection(DetectionArgs),
    /// Tracks in the image: CLEAR MOT, IDF1, HOTA
    Tracking(Compared),
    /// A localizer on a recorded drive: errors in metres and degrees, and whether it knows how good it is (NEES, NIS)
    Localization(LocalizationArgs),
    /// A predictor on recorded tracks: distances in metres, densities, and whether its spread is the true one
    Prediction(PredictionArgs),
    /// Scan matching on two point clouds: the pose of one in the other, and what it took to find
    Registration(RegistrationArgs),
}

#[derive(clap::Args, Debug)]
struct DetectionArgs {
    /// How both are written
    #[arg(long, value_enum)]
    format: Format,
    #[command(flatten)]
    compared: Compared,
}

/// Two sides, and how the result is told.
#[derive(clap::Args, Debug)]
struct Compared {
    /// What is there: of objects COCO's annotations (JSON) or a folder of KITTI's labels, of tracks MOTChallenge's rows
    truth: PathBuf,
    /// What is reported: of objects COCO's results (JSON) or KITTI's labels with scores, of tracks MOTChallenge's rows
    found: PathBuf,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    timely: TimelyArgs,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Format {
    /// One file each
    Coco,
    /// A folder each, with a file for every frame
    Kitti,
}

/// Runs `swerve eval`.
///
/// # Errors
/// When a file cannot be read or is not of its form: file, line, and what was expected.
pub fn run(args: &EvalArgs) -> anyhow::Result<()> {
    let (text, problem) = match &args.what {
        What::Registration(args) => registration::told(args)?,
        _ => (result(args)?, None),
    };
    swerve_report::output::print(&text)?;
    problem.map_or(Ok(()), |problem| Err(anyhow!(problem)))
}

/// What is printed.
fn result(args: &EvalArgs) -> anyhow::Result<String> {
    match &args.what {
        What::Detection(DetectionArgs { format: Format::Coco, compared }) => {
            told(compared, &coco::evaluate(compared)?, coco::table)
        }
        What::Detection(DetectionArgs { format: Format::Kitti, compared }) => {
            told(compared, &kitti::evaluate(compared)?, kitti::table)
        }
        What::Tracking(compared) => {
            told(compared, &mot::evaluate(compared)?, |metrics| numbers(&[("", metrics)]))
        }
        What::Localization(args) => {
            let report = localization::evaluate(args)?;
            if args.json {
                Ok(serde_json::to_string_pretty(&report)? + "\n")
            } else {
                numbers(&[("", &report)])
            }
        }
        What::Prediction(args) => prediction::told(args),
        What::Registration(args) => Ok(registration::told(args)?.0),
    }
}

fn told<M: Serialize>(
    compared: &Compared,
    metrics: &M,
    table: fn(&M) -> anyhow::Result<String>,
) -> anyhow::Result<String> {
    if compared.json { Ok(serde_json::to_string_pretty(metrics)? + "\n") } else { table(metrics) }
}

/// A row for each number, a column for each of `of`; numbers within numbers are named by their path.
fn numbers<M: Serialize>(of: &[(&str, &M)]) -> anyhow::Result<String> {
    let columns: Vec<Vec<(String, String)>> = of
        .iter()
        .map(|(_, metrics)| Ok(flat("", &serde_json::to_value(metrics)?)))
        .collect::<anyhow::Result<_>>()?;
    let mut lines = Vec::new();
    if of.len() > 1 {
        lines.push(std::iter::once("").chain(of.iter().map(|(name, _)| *name)).map(str::to_owned).collect());
    }
    for (k, (name, _)) in columns.first().into_iter().flatten().enumerate() {
        let cells = columns.iter().map(|column| column[k].1.clone());
        lines.push(std::iter::once(name.clone()).chain(cells).collect());
    }
    Ok(align(&lines))
}

fn flat(within: &str, value: &Value) -> Vec<(String, String)> {
    match value {
        Value::Object(object) => {
            let name = |key: &str| if within.is_empty() { key.to_owned() } else { format!("{within}.{key}") };
            object.iter().flat_map(|(key, value)| flat(&name(key), value)).collect()
        }
        count if count.is_u64() => vec![(within.to_owned(), count.to_string())],
        share => vec![(within.to_owned(), cell(share.as_f64()))],
    }
}

/// A share of one, for people.
fn cell(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_owned(), |share| format!("{share:.4}"))
}

/// What is wrong with a line of a file.
fn wrong(path: &Path, line: usize, what: impl Display) -> anyhow::Error {
    anyhow!("{}:{line}: {what}", path.display())
}

/// A file's text, of up to 1 GiB: results for a whole data set have hundreds of megabytes.
fn text(path: &Path) -> anyhow::Result<String> {
    swerve_text::decoded(read_whole(path)?).map_err(|error| wrong(path, error.line, error))
}

/// The number of a column.
fn number(name: &str, word: &str) -> Result<f64, String> {
    match word.trim().parse() {
        Ok(number) if f64::is_finite(number) => Ok(number),
        _ => Err(format!("{name}: expected a finite number, found `{}`", word.trim())),
    }
}
