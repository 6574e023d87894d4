//! `swerve train prediction`: a small network that predicts the paths of road users, trained on generated or recorded
//! tracks, by a recipe.

#[cfg(test)]
mod tests;

use std::path::Path;

use anyhow::Context as _;
use serde::Deserialize;
use swerve_measure::evaluate::prediction::{Foretells, Format, file, judged};
use swerve_msg::TrackList;
use swerve_prediction::learned::{Learning, Shape, Weights, examples, train};
use swerve_prediction::recorded::{Protocol, Recording, made};
use swerve_prediction::{Ground, Horizon, PredictorName, predict, predict_by};
use swerve_report::progress::Progress;
use swerve_stack::Registry;
use swerve_text::{Document, Problem};

use super::by_recipe::{RecipeArgs, Trained};
use super::images::{Purpose, read};

/// Number of modes of which the best counts.
const BEST_OF: usize = 6;

/// Recipe of a predictor.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Recipe {
    net: Shape,
    learning: Learning,
    /// Track sets, each with its purpose.
    set: Vec<Tracks>,
}

/// Set of tracks.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tracks {
    name: String,
    purpose: Purpose,
    /// Generated recordings.
    made: Option<Made>,
    /// Recordings in files of `--data`.
    recorded: Option<Recorded>,
    /// Steps of a track between the starts of two windows.
    #[serde(default = "one")]
    stride: usize,
    /// Playback speeds; each gives another training recording, backwards if negative.
    #[serde(default = "as_recorded")]
    played: Vec<f64>,
}

/// Generated recordings of a crossing, one minute each.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Made {
    /// First and last seed.
    seeds: [u64; 2],
    /// Number of pedestrians at the same time.
    people: usize,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Recorded {
    format: Format,
    files: Vec<String>,
}

fn one() -> usize {
    1
}

fn as_recorded() -> Vec<f64> {
    vec![1.0]
}

impl Recipe {
    fn problems(&self, document: &Document) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut ensure = |holds: bool, key: String, expected: &str| {
            if !holds {
                problems.push(document.problem(&key, expected));
            }
        };
        for purpose in [Purpose::Training, Purpose::Test] {
            let any = self.set.iter().any(|set| set.purpose == purpose);
            ensure(any, "set".into(), "expected a set for training and one to test by");
        }
        for (k, set) in self.set.iter().enumerate() {
            let key = |key: &str| format!("set[{k}].{key}");
            let either = set.made.is_some() != set.recorded.is_some();
            ensure(either, key("name"), "expected either `made` or `recorded`");
            ensure(set.purpose != Purpose::Calibration, key("purpose"), "expected training or test");
            ensure((1..=1000).contains(&set.stride), key("stride"), "expected 1 to 1000");
            let plays = |speed: &f64| (0.1..=10.0).contains(&speed.abs());
            let some = (1..=20).contains(&set.played.len()) && set.played.iter().all(plays);
            ensure(some, key("played"), "expected 1 to 20 speeds of 0.1 to 10, or of -10 to -0.1");
            if let Some(made) = &set.made {
                let [first, last] = made.seeds;
                let some = first <= last && last - first < 10_000;
                ensure(some, key("made.seeds"), "expected the first and the last of at most 10000");
                ensure(made.people <= 200, key("made.people"), "expected at most 200");
            }
        }
        problems
    }

    /// Recordings of a purpose, set by set.
    fn recordings(&self, purpose: Purpose, data: &Path) -> anyhow::Result<Vec<(&Tracks, Vec<Recording>)>> {
        let of = self.set.iter().filter(|set| set.purpose == purpose);
        of.map(|set| Ok((set, set.recordings(data)?))).collect()
    }
}

impl Tracks {
    fn recordings(&self, data: &Path) -> anyhow::Result<Vec<Recording>> {
        let minutes = |made_by: &Made| -> Vec<Recording> {
            let [first, last] = made_by.seeds;
            (first..=last).map(|seed| made(seed, made_by.people)).collect()
        };
        let mut all = self.made.as_ref().map_or_else(Vec::new, minutes);
        if let Some(recorded) = &self.recorded {
            for name in &recorded.files {
                all.extend(file(&data.join(name), recorded.format)?.recordings());
            }
        }
        let played = |speed: &f64| all.iter().map(|one| one.played(*speed)).collect::<Vec<_>>();
        Ok(self.played.iter().flat_map(played).collect())
    }
}

impl Trained for Recipe {
    const NAME: &str = "prediction";
    type Weights = Weights;

    fn recipe(path: &Path) -> anyhow::Result<(Self, String)> {
        read(path, Self::problems)
    }

    fn read(bytes: &[u8]) -> anyhow::Result<Weights> {
        Ok(Weights::read(bytes)?)
    }

    fn write(weights: &Weights) -> Vec<u8> {
        weights.write()
    }

    fn train(&self, source: String, args: &RecipeArgs, _: &Registry) -> anyhow::Result<Weights> {
        let mut all = Vec::new();
        for (set, recordings) in self.recordings(Purpose::Training, &args.data)? {
            all.extend(examples(&recordings, &self.net, set.stride));
        }
        let progress = Progress::learning(self.learning.steps, "steps of learning");
        progress.tell(&format!("{} examples to train on", all.len()));
        let weights = train(source, self.net, (&all, &self.learning), &mut |_, _| progress.one_done());
        progress.finish();
        weights.context("the recipe")
    }

    fn test(&self, weights: &Weights, args: &RecipeArgs, _: &Registry) -> anyhow::Result<Vec<Vec<String>>> {
        let head = ["set", "predictor", "windows", "ADE", "FDE", "minADE", "minFDE", "NLL"];
        let mut lines = vec![head.map(str::to_owned).to_vec()];
        let name = format!("{:?}", self.net.model).to_lowercase();
        for (set, recordings) in self.recordings(Purpose::Test, &args.data)? {
            let step_s = f64::from(self.net.step_ms) * 1e-3;
            let Some(first) = recordings.first() else { continue };
            let each = (step_s / first.step.as_secs()).round().max(1.0) as usize;
            let protocol =
                Protocol { stride: set.stride, ..Protocol::whole(7 * each + 1, self.net.steps * each) };
            let straight = |tracks: &TrackList, horizon: &Horizon, _: Ground<'_>| {
                predict(PredictorName::ConstantVelocity, tracks, horizon, Ground::Open)
            };
            let learnt = |tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>| {
                predict_by(weights, tracks, horizon, ground)
            };
            let both: [(&str, Foretells<'_>); 2] = [("constant_velocity", &straight), (&name, &learnt)];
            for (name, by) in both {
                let found = judged(&recordings, by, (&protocol, BEST_OF)).figures();
                let cells = [found.ade_m, found.fde_m, found.min_ade_m, found.min_fde_m, found.nll];
                let first = [set.name.clone(), name.to_owned(), found.windows.to_string()];
                lines.push(first.into_iter().chain(cells.map(|cell| format!("{cell:.3}"))).collect());
            }
        }
        Ok(lines)
    }
}
