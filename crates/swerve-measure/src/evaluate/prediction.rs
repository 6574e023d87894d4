//! `swerve eval prediction`: a predictor on recorded tracks, against the true paths.

mod files;
mod tally;
#[cfg(test)]
mod tests;

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use anyhow::{anyhow, ensure};
use clap::ValueEnum;
use serde::Serialize;
use swerve_drive::problems_error;
use swerve_msg::{PredictionList, TrackList};
use swerve_prediction::learned::Weights;
use swerve_prediction::recorded::{Protocol, Recording};
use swerve_prediction::{Ground, Horizon, Predictor, PredictorName, predict_by};
use swerve_report::files::read_whole;
use swerve_report::output::align;
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_text::{did_you_mean, in_one_line, list, parse_assignments};

use files::Lanes;
pub use files::{File, Format, file, on_lanes};
pub use tally::{Figures, Tally};

/// Recorded tracks, and the predictor to evaluate.
#[derive(clap::Args, Debug)]
pub(super) struct PredictionArgs {
    /// Folder of recordings, or a single file
    dir: PathBuf,
    /// Format of the recordings
    #[arg(long, value_enum)]
    format: Format,
    /// Observed steps, up to the present
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=1000))]
    observe: u16,
    /// Predicted steps after the present
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u16).range(1..=1000))]
    predict: u16,
    /// Steps of a track between the starts of two windows
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1000))]
    stride: u16,
    /// Predictor: all, or one that prediction.predictor can name: `linear`, `constant_velocity`, `kalman`, `ctra`, `imm`,
    /// `social_force`, `orca`, `lane_idm`, `multipath`, `mfp`, `r2p2`
    #[arg(long, value_name = "NAME", default_value = "all")]
    predictor: String,
    /// Set a key of the configuration for a single predictor (prediction.params.KEY=VALUE)
    #[arg(long, value_name = "KEY=VALUE", requires = "predictor")]
    set: Vec<String>,
    /// Neural predictor with these weights, as written by `swerve train prediction`
    #[arg(long, value_name = "FILE", conflicts_with = "predictor")]
    weights: Option<PathBuf>,
    /// Road users that are evaluated
    #[arg(long, value_enum, default_value = "whole")]
    protocol: Who,
    /// Number of modes of which the best counts for `min_ade_m` and `min_fde_m`
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=1000))]
    best_of: u16,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
}

/// Road users that are evaluated.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Who {
    /// Road users present in the whole window (Trajectron++)
    Whole,
    /// The same, in windows with at least two of them (S-GAN)
    Sgan,
    /// Road users present for at least two steps after the present (Schöller et al. 2020)
    Schoeller,
}

/// Predictors of the command line, by name.
fn chosen(
    args: &PredictionArgs,
    registry: &Registry,
) -> anyhow::Result<Vec<(&'static str, Box<dyn Predictor>)>> {
    // The true future is known in simulated drives only.
    let names = registry.predictors().filter(|name| *name != PredictorName::Truth.name());
    let names: Vec<&'static str> = names.collect();
    let word = args.predictor.as_str();
    let is_all = word == "all";
    ensure!(
        is_all || names.contains(&word),
        "--predictor: expected \"all\" or one of {}, found \"{word}\"{}",
        list(&names),
        did_you_mean(word, names.iter().copied())
    );
    let built = |name: &'static str| {
        let mut sets = vec![("prediction.predictor".to_owned(), name.into())];
        sets.extend(parse_assignments(&args.set)?);
        let config = Setup::load_with(registry, None, &sets).map_err(|found| problems_error(&found))?;
        let predictor = config.prediction.built(registry, None);
        Ok((name, predictor.map_err(|found| anyhow!("prediction: {}", in_one_line(&found)))?))
    };
    names.into_iter().filter(|name| is_all || *name == word).map(built).collect()
}

/// Evaluation of one predictor.
#[derive(Serialize)]
struct Report {
    predictor: String,
    files: Vec<FileReport>,
    /// Over the windows of all files.
    all: Figures,
}

#[derive(Serialize)]
struct FileReport {
    file: String,
    /// Number of recordings with and without lanes.
    lanes: Lanes,
    #[serde(flatten)]
    figures: Figures,
}

/// Prediction function: tracks, horizon and ground to predictions.
pub type Foretells<'a> = &'a dyn Fn(&TrackList, &Horizon, Ground<'_>) -> PredictionList;

/// Evaluates the predictors and returns the text to print.
///
/// # Errors
/// If the folder has no such files, or a file cannot be read or has another format; the error names file, line and the
/// expected content.
pub(super) fn text(args: &PredictionArgs, registry: &Registry) -> anyhow::Result<String> {
    let predictors = match &args.weights {
        None => chosen(args, registry)?,
        Some(_) => Vec::new(),
    };
    let files = files::files(&args.dir, args.format)?;
    let protocol = protocol(args);
    let best_of = usize::from(args.best_of);
    let reports: Vec<Report> = match &args.weights {
        Some(path) => {
            let weights = weights(path)?;
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let by = |tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>| {
                predict_by(&weights, tracks, horizon, ground)
            };
            vec![report(name, &by, &files, (&protocol, best_of))]
        }
        None => {
            let one = |(name, predictor): (&str, Box<dyn Predictor>)| {
                let predictor = RefCell::new(predictor);
                let by = |tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>| {
                    predictor.borrow_mut().predict(tracks, horizon, ground)
                };
                report(name.to_owned(), &by, &files, (&protocol, best_of))
            };
            predictors.into_iter().map(one).collect()
        }
    };
    if args.json {
        return Ok(match &reports[..] {
            [one] => serde_json::to_string_pretty(one)?,
            all => serde_json::to_string_pretty(all)?,
        } + "\n");
    }
    Ok(table(&reports))
}

fn protocol(args: &PredictionArgs) -> Protocol {
    let whole = Protocol {
        stride: usize::from(args.stride),
        ..Protocol::whole(usize::from(args.observe), usize::from(args.predict))
    };
    match args.protocol {
        Who::Whole => whole,
        Who::Sgan => Protocol { actors_min: 2, ..whole },
        Who::Schoeller => Protocol { predict_min: whole.predict.min(2), ..whole },
    }
}

fn weights(path: &Path) -> anyhow::Result<Weights> {
    let at = path.display();
    let bytes = read_whole(path)?;
    Weights::read(&bytes).map_err(|error| anyhow!("{at}: {error}"))
}

fn report(
    predictor: String,
    by: Foretells<'_>,
    files: &[File],
    (protocol, best_of): (&Protocol, usize),
) -> Report {
    let mut all = Tally::new(best_of, protocol.predict);
    let of_file = |file: &File| {
        let tally = judged(file.each(), by, (protocol, best_of));
        all.join(&tally);
        FileReport { file: file.name.clone(), lanes: file.lanes, figures: tally.figures() }
    };
    let files = files.iter().map(of_file).collect();
    Report { predictor, files, all: all.figures() }
}

/// Accumulates errors over recordings, each with its own time.
pub fn judged<'a>(
    recordings: impl IntoIterator<Item = &'a Recording>,
    by: Foretells<'_>,
    (protocol, best_of): (&Protocol, usize),
) -> Tally {
    let mut tally = Tally::new(best_of, protocol.predict);
    for recording in recordings {
        let horizon = Horizon { steps: protocol.predict, step: recording.step };
        let ground = Ground::lanes(recording.lanes.as_deref());
        tally.begin();
        for scene in recording.scenes(protocol) {
            tally.add(&scene, &by(&scene.tracks, &horizon, ground));
        }
    }
    tally
}

fn table(reports: &[Report]) -> String {
    let head = [
        "predictor",
        "file",
        "windows",
        "ADE",
        "FDE",
        "minADE",
        "minFDE",
        "brier",
        "missed",
        "collide",
        "NLL",
        "in 90 %",
        "recalibrated",
    ];
    let row = |predictor: &str, file: &str, figures: &Figures| {
        let cells = [
            Some(figures.ade_m),
            Some(figures.fde_m),
            Some(figures.min_ade_m),
            Some(figures.min_fde_m),
            Some(figures.brier_min_fde_m),
            Some(figures.missed),
            Some(figures.collisions),
            Some(figures.nll).filter(|nll| !nll.is_nan()),
            figures.coverage.map(|shares| shares[2]),
            figures.recalibrated_90,
        ];
        let cells = cells.map(|cell| match figures.windows {
            0 => "-".to_owned(),
            _ => cell.map_or("-".to_owned(), |value| format!("{value:.3}")),
        });
        [predictor.to_owned(), file.to_owned(), figures.windows.to_string()]
            .into_iter()
            .chain(cells)
            .collect()
    };
    let mut rows: Vec<Vec<String>> = vec![head.map(str::to_owned).to_vec()];
    for report in reports {
        rows.extend(report.files.iter().map(|one| row(&report.predictor, &one.file, &one.figures)));
        if report.files.len() > 1 {
            rows.push(row(&report.predictor, "all", &report.all));
        }
    }
    align(&rows)
}
