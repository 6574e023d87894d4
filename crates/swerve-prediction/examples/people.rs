//! Nets that are trained on four of the five sets of ETH and UCY and judged on the fifth.
//!
//! `cargo run --release -p swerve-prediction --example people -- FOLDER multipath MODES SEEDS`, with the folder of the
//! eight files.
#![allow(clippy::print_stdout, reason = "a program that tells figures")]

use std::path::Path;

use swerve_msg::{Forecast, Mode};
use swerve_prediction::learned::{Learning, Model, Shape, Weights, examples, train};
use swerve_prediction::recorded::{Protocol, Recording, Window, eth_ucy};
use swerve_prediction::{Horizon, forecast_by};

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
/// About so many examples of each file, so that crowds do not outweigh all else.
const OF_EACH: usize = 3000;

fn main() -> Result<(), String> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match &words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [folder, model, modes, seeds] => {
            let (modes, seeds) = (modes.parse().map_err(|_| "MODES")?, seeds.parse().map_err(|_| "SEEDS")?);
            let (model, hidden, steps, batch) = match *model {
                "multipath" => (Model::Multipath, 32, 800, 128),
                "mfp" => (Model::Mfp, 32, 600, 48),
                "r2p2" => (Model::R2p2, 32, 800, 64),
                other => return Err(format!("expected multipath, mfp or r2p2, found {other}")),
            };
            let shape = Shape { model, modes, hidden, steps: 12, step_ms: 400 };
            let distance = if modes == 1 { 1.0 } else { 0.0 };
            let learning =
                Learning { seed: 1, steps, batch, rate: 1e-3, stretch: 0.35, noise: 0.02, distance };
            people(Path::new(folder), shape, learning, seeds)
        }
        _ => Err("expected FOLDER MODEL MODES SEEDS".to_owned()),
    }
}

fn people(folder: &Path, shape: Shape, learning: Learning, seeds: u64) -> Result<(), String> {
    let read = |name: &&'static str| -> Result<(&'static str, Recording), String> {
        let path = folder.join(name).with_extension("txt");
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok((*name, eth_ucy(&text).map_err(|error| format!("{}:{error}", path.display()))?))
    };
    let files = FILES.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    println!("set seed windows ADE FDE minADE minFDE NLL");
    let mut means = [0.0; 5];
    for (set, tests) in SETS {
        let mut all = Vec::new();
        for (_, recording) in files.iter().filter(|(name, _)| !tests.contains(name)) {
            let some = examples(std::slice::from_ref(recording), &shape, 1);
            let each = (some.len() / OF_EACH).max(1);
            all.extend(some.into_iter().step_by(each));
        }
        for seed in 1..=seeds {
            let learning = Learning { seed, ..learning };
            let weights = train(String::new(), shape, (&all, &learning), &mut |_, _| {})
                .map_err(|error| error.to_string())?;
            let of = files.iter().filter(|(name, _)| tests.contains(name));
            let (count, figures) = judged(&weights, of.map(|(_, recording)| recording));
            println!("{set} {seed} {count} {}", told(figures));
            means.iter_mut().zip(figures).for_each(|(sum, one)| *sum += one / (5 * seeds) as f64);
        }
    }
    println!("mean - - {}", told(means));
    Ok(())
}

fn told(figures: [f64; 5]) -> String {
    figures.map(|one| format!("{one:.3}")).join(" ")
}

/// How many windows, and means over them.
fn judged<'a>(weights: &Weights, recordings: impl Iterator<Item = &'a Recording>) -> (usize, [f64; 5]) {
    let (mut count, mut sums) = (0, [0.0; 5]);
    for recording in recordings {
        for scene in recording.scenes(&Protocol::whole(8, 12)) {
            let list = forecast_by(weights, &scene.tracks, &Horizon { steps: 12, step: recording.step });
            for window in &scene.windows {
                let Some(one) = list.forecasts.iter().find(|one| one.id == window.id) else { continue };
                sums.iter_mut().zip(figures(one, window)).for_each(|(sum, figure)| *sum += figure);
                count += 1;
            }
        }
    }
    (count, sums.map(|sum| sum / f64::from(count.max(1) as u32)))
}

fn figures(one: &Forecast, window: &Window) -> [f64; 5] {
    let off = |mode: &Mode| {
        let steps = mode.path[1..].iter().zip(&window.truth);
        let off: Vec<f64> = steps.map(|(at, truth)| at.pose.point().distance(*truth)).collect();
        (off.iter().sum::<f64>() / off.len() as f64, off[off.len() - 1])
    };
    let (ade, fde) = one.likeliest().map_or((f64::NAN, f64::NAN), off);
    let best = |of: fn((f64, f64)) -> f64| one.modes.iter().map(|m| of(off(m))).fold(f64::INFINITY, f64::min);
    let density = |step: usize| {
        let part = |mode: &Mode| {
            let at = &mode.path[step + 1];
            let ([xx, xy, yy], to) = (at.covariance_m2, window.truth[step] - at.pose.point());
            let det = xx * yy - xy * xy;
            let squared = (yy * to.x * to.x - 2.0 * xy * to.x * to.y + xx * to.y * to.y) / det;
            mode.probability * libm::exp(-0.5 * squared) / (core::f64::consts::TAU * det.sqrt())
        };
        one.modes.iter().map(part).sum::<f64>().max(1e-300)
    };
    let steps = window.truth.len();
    let nats = -(0..steps).map(|step| libm::log(density(step))).sum::<f64>() / steps as f64;
    [ade, fde, best(|off| off.0), best(|off| off.1), nats]
}
