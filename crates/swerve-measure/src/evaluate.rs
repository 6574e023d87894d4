//! `swerve eval`: compares the results of a detector, tracker, localizer or predictor, in common file formats, with the
//! ground truth; driving scores from the records of routes; the check of CommonRoad's solutions.

mod coco;
mod commonroad;
mod input;
mod kitti;
mod localization;
pub(crate) mod mot;
pub mod prediction;
mod registration;
mod score;
#[cfg(test)]
mod tests;
mod timely;

use std::path::PathBuf;

use anyhow::anyhow;
use clap::ValueEnum;
use serde::Serialize;
use serde_json::Value;
use swerve_report::output::align;
use swerve_stack::Registry;

use commonroad::CommonroadArgs;
use localization::LocalizationArgs;
use prediction::PredictionArgs;
use registration::RegistrationArgs;
use score::ScoreArgs;
pub use score::VersionName;
use timely::TimelyArgs;

/// `swerve eval`.
#[derive(clap::Args, Debug)]
pub struct EvalArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand, Debug)]
enum What {
    /// Boxes of a detector: COCO's twelve metrics, or KITTI's average precision
    Detection(DetectionArgs),
    /// Tracks in the image: CLEAR MOT, IDF1, HOTA
    Tracking(Compared),
    /// A localizer on a recorded drive: errors in metres and degrees, and consistency (NEES, NIS)
    Localization(LocalizationArgs),
    /// A predictor on recorded tracks: distances in metres, densities, and calibration of its spread
    Prediction(PredictionArgs),
    /// Scan matching of two point clouds: the pose of one in the other, and the cost of finding it
    Registration(RegistrationArgs),
    /// Driving scores of the CARLA Leaderboard 1.0, 2.0 and 2.1 from the records of routes
    Score(ScoreArgs),
    /// Solutions of CommonRoad's scenarios: validity with step and amount of each failure, and costs
    Commonroad(CommonroadArgs),
}

#[derive(clap::Args, Debug)]
struct DetectionArgs {
    /// Format of both sides
    #[arg(long, value_enum)]
    format: Format,
    #[command(flatten)]
    compared: Compared,
}

/// Ground truth, results and output format.
#[derive(clap::Args, Debug)]
struct Compared {
    /// Ground truth: COCO annotations (JSON) or a folder of KITTI labels for objects, MOTChallenge rows for tracks
    truth: PathBuf,
    /// Results: COCO results (JSON) or KITTI labels with scores for objects, MOTChallenge rows for tracks
    found: PathBuf,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    timely: TimelyArgs,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Format {
    /// One file per side
    Coco,
    /// One folder per side, with a file for every frame
    Kitti,
}

/// Runs `swerve eval`.
///
/// # Errors
/// If a file cannot be read or has another format; the error names file, line and the expected content.
pub fn run(args: &EvalArgs, registry: &Registry) -> anyhow::Result<()> {
    let (text, problem) = output(args, registry)?;
    swerve_report::output::print(&text)?;
    problem.map_or(Ok(()), |problem| Err(anyhow!(problem)))
}

/// Text to print, and a problem with which the command ends after it.
fn output(args: &EvalArgs, registry: &Registry) -> anyhow::Result<(String, Option<String>)> {
    let text = match &args.what {
        What::Registration(args) => return registration::told(args),
        What::Score(args) => return score::outcome(args),
        What::Commonroad(args) => return commonroad::outcome(args),
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
        What::Prediction(args) => prediction::text(args, registry),
    };
    Ok((text?, None))
}

fn told<M: Serialize>(
    compared: &Compared,
    metrics: &M,
    table: fn(&M) -> anyhow::Result<String>,
) -> anyhow::Result<String> {
    if compared.json { Ok(serde_json::to_string_pretty(metrics)? + "\n") } else { table(metrics) }
}

/// A row for each number, a column for each of `of`; nested numbers are named by their path.
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

/// A share with four decimals, `-` if missing.
fn cell(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_owned(), |share| format!("{share:.4}"))
}
