//! Trains nets on four of the five sets of ETH and UCY, and evaluates them on the fifth.
//!
//! `cargo run --release -p swerve-prediction --example people -- FOLDER RECIPE 1..5`, with the folder of the eight
//! files, a recipe such as `people_one.toml` beside this file, and the first and last seed. With `pairs`, two sets
//! are left out at once and each is evaluated: a recipe for set A is selected by the results on the other sets of
//! nets trained without A.
#![allow(clippy::print_stdout, reason = "a program that prints figures")]

use std::ops::RangeInclusive;
use std::path::Path;

use serde::Deserialize;
use swerve_msg::Prediction;
use swerve_prediction::learned::{Example, Learning, Shape, Weights, examples, train};
use swerve_prediction::recorded::{Protocol, Recording, Window, eth_ucy};
use swerve_prediction::{Ground, Horizon, predict_by};

const SETS: [(&str, &[&str]); 5] = [
    ("eth", &["biwi_eth"]),
    ("hotel", &["biwi_hotel"]),
    ("univ", &["students001", "students003"]),
    ("zara1", &["crowds_zara01"]),
    ("zara2", &["crowds_zara02"]),
];
const FILES: [&str; 8] = [
    "biwi_eth",
    "biwi_hotel",
    "crowds_zara01",
    "crowds_zara02",
    "crowds_zara03",
    "students001",
    "students003",
    "uni_examples",
];

/// Architecture, training parameters and training data of a net.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Recipe {
    net: Shape,
    learning: Learning,
    /// Largest number of examples per file, by which crowds are thinned out.
    of_each: usize,
    /// Playback speeds of the recordings for training; negative speeds play backwards.
    #[serde(default = "once")]
    played: Vec<f64>,
}

fn once() -> Vec<f64> {
    vec![1.0]
}

fn main() -> Result<(), String> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match &words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [folder, recipe, seeds] => people(Path::new(folder), &read(recipe)?, (seeds, false)),
        [folder, recipe, seeds, "pairs"] => people(Path::new(folder), &read(recipe)?, (seeds, true)),
        _ => Err("expected FOLDER RECIPE FIRST..LAST [pairs]".to_owned()),
    }
}

fn read(path: &str) -> Result<Recipe, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))?;
    toml::from_str(&text).map_err(|error| format!("{path}: {error}"))
}

fn people(folder: &Path, recipe: &Recipe, (seeds, pairs): (&str, bool)) -> Result<(), String> {
    let seeds = seeds.split_once("..").and_then(|(a, b)| Some(a.parse().ok()?..=b.parse().ok()?));
    let seeds: RangeInclusive<u64> = seeds.ok_or("expected seeds as 1..5")?;
    let read = |name: &&'static str| -> Result<(&'static str, Recording), String> {
        let path = folder.join(name).with_extension("txt");
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok((*name, eth_ucy(&text).map_err(|error| format!("{}:{error}", path.display()))?))
    };
    let files = FILES.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let mut sets: Vec<(&str, Vec<Example>)> = Vec::new();
    for (name, recording) in &files {
        let of = |speed: &f64| examples(&[recording.played(*speed)], &recipe.net, 1);
        sets.push((name, recipe.played.iter().flat_map(of).collect()));
    }
    let mut out: Vec<Vec<usize>> = (0..SETS.len()).map(|k| vec![k]).collect();
    if pairs {
        out = (0..SETS.len()).flat_map(|k| (0..k).map(move |j| vec![j, k])).collect();
    }
    println!("without set seed windows ADE FDE minADE minFDE NLL");
    for left_out in out {
        let names: Vec<&str> = left_out.iter().map(|k| SETS[*k].0).collect();
        let tests: Vec<&str> = left_out.iter().flat_map(|k| SETS[*k].1).copied().collect();
        let mut all = Vec::new();
        for (_, examples) in sets.iter().filter(|(name, _)| !tests.contains(name)) {
            let each = (examples.len() as f64 / recipe.of_each as f64).max(1.0);
            all.extend(
                (0..recipe.of_each.min(examples.len())).map(|k| examples[(k as f64 * each) as usize].clone()),
            );
        }
        for seed in seeds.clone() {
            let learning = Learning { seed, ..recipe.learning };
            let weights = train(String::new(), recipe.net, (&all, &learning), &mut |_, _| {})
                .map_err(|error| error.to_string())?;
            for k in &left_out {
                let (set, of) = SETS[*k];
                let of = files.iter().filter(|(name, _)| of.contains(name));
                let (count, figures) = judged(&weights, of.map(|(_, recording)| recording));
                println!("{} {set} {seed} {count} {}", names.join("+"), told(figures));
            }
        }
    }
    Ok(())
}

fn told(figures: [f64; 5]) -> String {
    figures.map(|one| format!("{one:.3}")).join(" ")
}

/// Number of windows, and mean metrics over them.
fn judged<'a>(weights: &Weights, recordings: impl Iterator<Item = &'a Recording>) -> (usize, [f64; 5]) {
    let (mut count, mut sums) = (0, [0.0; 5]);
    for recording in recordings {
        for scene in recording.scenes(&Protocol::whole(8, 12)) {
            let list = predict_by(
                weights,
                &scene.tracks,
                &Horizon { steps: 12, step: recording.step },
                Ground::Open,
            );
            for window in &scene.windows {
                let modes = list.modes_of(window.id);
                if modes.is_empty() {
                    continue;
                }
                sums.iter_mut().zip(figures(modes, window)).for_each(|(sum, figure)| *sum += figure);
                count += 1;
            }
        }
    }
    (count, sums.map(|sum| sum / f64::from(count.max(1) as u32)))
}

fn figures(modes: &[Prediction], window: &Window) -> [f64; 5] {
    let off = |mode: &Prediction| {
        let steps = mode.path[1..].iter().zip(&window.truth);
        let off: Vec<f64> = steps.map(|(at, truth)| at.pose.point().distance(*truth)).collect();
        (off.iter().sum::<f64>() / off.len() as f64, off[off.len() - 1])
    };
    let (ade, fde) = Prediction::likeliest(modes).map_or((f64::NAN, f64::NAN), off);
    let best = |of: fn((f64, f64)) -> f64| modes.iter().map(|m| of(off(m))).fold(f64::INFINITY, f64::min);
    let density = |step: usize| {
        let part = |mode: &Prediction| {
            let at = &mode.path[step + 1];
            let ([xx, xy, yy], to) = (mode.covariances_m2[step + 1], window.truth[step] - at.pose.point());
            let det = xx * yy - xy * xy;
            let squared = (yy * to.x * to.x - 2.0 * xy * to.x * to.y + xx * to.y * to.y) / det;
            mode.probability * libm::exp(-0.5 * squared) / (core::f64::consts::TAU * det.sqrt())
        };
        modes.iter().map(part).sum::<f64>().max(1e-300)
    };
    let steps = window.truth.len();
    let nats = -(0..steps).map(|step| libm::log(density(step))).sum::<f64>() / steps as f64;
    [ade, fde, best(|off| off.0), best(|off| off.1), nats]
}
