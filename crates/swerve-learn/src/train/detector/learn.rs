//! Rounds of training: samples windows from the images, trains trees or templates on them, and repeats with the false
//! positives of the previous round.

use anyhow::anyhow;
use rayon::prelude::*;
use swerve_core::Rng;
use swerve_report::progress::Progress;
use swerve_vision::acf::{Candidate, Model, Overlap, Rung, Scanner, Scorer, Template, Trees, Weights, iou};
use swerve_vision::boosting::{BoostParams, Samples, boost};
use swerve_vision::svm::{self, SvmParams};

use super::labelled::Labelled;
use super::recipe::{Growing, Method, Recipe, Svm, Window};
use super::scanners::Scanners;

/// Exponents by which colour, magnitude and orientations fall with scale (Dollár et al. 2014, table 2).
const DECAY: [f32; 3] = [0.0, 0.11, 0.11];
/// Maximum number of passes of a support vector machine over its windows.
const PASSES: usize = 200;
/// Maximum overlap of a negative window with an object: in the first round, and for false positives.
const APART: [f64; 2] = [0.1, 0.3];

/// Untrained weights: a template of zeros, or no trees.
pub(super) fn untrained(recipe: &Recipe, source: String) -> Weights {
    let mut classes: Vec<_> = recipe.window.iter().map(|window| window.class).collect();
    classes.sort_unstable();
    classes.dedup();
    let model = |window: &Window| Model {
        class: classes.iter().position(|class| *class == window.class).unwrap_or(0),
        cells: window.cells,
        object_px: window.object_px,
        heights_m: window.heights_m,
        scorer: match &recipe.learning.method {
            Method::Trees(growing) => Scorer::Trees(Trees { depth: growing.depth, ..Trees::default() }),
            Method::Svm(_) => Scorer::Template(Template::default()),
        },
    };
    Weights {
        source,
        shrink: recipe.learning.shrink,
        decay: DECAY,
        filters: Vec::new(),
        classes: classes.iter().map(|class| class.name().to_owned()).collect(),
        models: recipe.window.iter().map(model).collect(),
        rungs: recipe.rung.iter().map(|rung| rung.rung()).collect(),
        overlap: (recipe.learning.overlap, Overlap::Union),
    }
}

/// Windows of one model, one byte per feature.
#[derive(Clone, Default)]
struct Windows {
    positive: Vec<u8>,
    negative: Vec<u8>,
}

/// Trains the scorers of all windows; the result does not depend on the number of threads.
///
/// # Errors
/// If an image cannot be decoded, or a window has no examples to learn from.
pub(super) fn learn(
    recipe: &Recipe,
    images: &[Labelled],
    weights: &mut Weights,
    progress: &Progress,
) -> anyhow::Result<()> {
    // Templates reject no window early, so fewer windows are scanned.
    let (per_octave, stride) = match &recipe.learning.method {
        Method::Trees(_) => (8, 1),
        Method::Svm(_) => (4, 2),
    };
    let looking = Rung {
        name: String::new(),
        first_octave: recipe.rung.iter().map(|rung| rung.rung().first_octave).max().unwrap_or(0),
        per_octave,
        stride,
        trees: usize::MAX,
        reject: -1.0,
        whole_every: 1,
        tolerance_rad: None,
        calibrations: Vec::new(),
    };
    let [of_image, in_total] = recipe.learning.negatives;
    // Of many images each adds fewer windows, so that a round adds at most about twice the number kept.
    let most = of_image.min((2 * in_total).div_ceil(images.len().max(1)).max(1));
    let mut kept = vec![Windows::default(); weights.models.len()];
    for round in 0..recipe.learning.rounds() {
        let scanners = Scanners::new(weights.clone(), looking.clone(), None);
        let mined = images.par_iter().enumerate().map_init(
            || scanners.clone(),
            |scanners, (k, image)| mine(recipe, scanners.of(image.size()), image, [round, k, most]),
        );
        let mined: Vec<Vec<Windows>> = mined.collect::<anyhow::Result<_>>()?;
        for (model, kept) in kept.iter_mut().enumerate() {
            let features = features(weights, &recipe.window[model]);
            let fresh: Vec<u8> = mined.iter().flat_map(|windows| &windows[model].negative).copied().collect();
            kept.positive.extend(mined.iter().flat_map(|windows| &windows[model].positive));
            let room = (recipe.learning.negatives[1] * features).saturating_sub(fresh.len()) / features;
            thin(
                &mut kept.negative,
                features,
                room,
                &mut Rng::keyed(recipe.seed, "kept", &[round as i64, model as i64]),
            );
            kept.negative.extend(&fresh);
            progress.tell(&format!(
                "{} {model}, round {round}: {} windows with, {} without, {} of them new",
                recipe.window[model].class.name(),
                kept.positive.len() / features,
                kept.negative.len() / features,
                fresh.len() / features,
            ));
        }
        if round == 0 {
            check_windows(recipe, &kept)?;
        }
        let learn_one = |(model, kept): (usize, &Windows)| {
            let seed = recipe.seed + model as u64;
            match &recipe.learning.method {
                Method::Trees(growing) => Scorer::Trees(grow(weights, model, kept, (growing, round, seed))),
                Method::Svm(svm) => Scorer::Template(separate(weights, model, kept, (svm, seed))),
            }
        };
        let learnt: Vec<Scorer> = kept.par_iter().enumerate().map(learn_one).collect();
        weights.models.iter_mut().zip(learnt).for_each(|(model, scorer)| model.scorer = scorer);
        progress.one_done();
    }
    Ok(())
}

/// Checks that each window has an object of its class and aspect among the labels.
pub(super) fn check_examples(recipe: &Recipe, images: &[Labelled]) -> anyhow::Result<()> {
    for (k, window) in recipe.window.iter().enumerate() {
        let has = |image: &Labelled| image.examples(window, &recipe.learning).next().is_some();
        if !images.iter().any(has) {
            let [from, to] = window.aspects;
            let error = anyhow!(
                "expected a {} with a width of {from} to {to} heights in the sets for training, found none in {} images",
                window.class.name(),
                images.len()
            );
            return Err(recipe.error_at(&format!("window[{k}]"), &error));
        }
    }
    Ok(())
}

/// Checks the windows of the first round.
fn check_windows(recipe: &Recipe, kept: &[Windows]) -> anyhow::Result<()> {
    for (k, (window, kept)) in recipe.window.iter().zip(kept).enumerate() {
        let (name, [width, height]) = (window.class.name(), window.object_px);
        let error = if kept.positive.is_empty() {
            anyhow!(
                "expected a {name} that can be scaled to {width} x {height} pixels: the labelled ones are too small"
            )
        } else if kept.negative.is_empty() {
            anyhow!("expected images for training with room for windows without a {name}")
        } else {
            continue;
        };
        return Err(recipe.error_at(&format!("window[{k}]"), &error));
    }
    Ok(())
}

/// Number of features of a window.
fn features(weights: &Weights, window: &Window) -> usize {
    weights.planes() * window.cells[0] * window.cells[1]
}

/// Keeps `room` rows, drawn at random, in their order.
fn thin(rows: &mut Vec<u8>, width: usize, room: usize, rng: &mut Rng) {
    let count = rows.len() / width;
    let mut chosen: Vec<usize> = (0..count).collect();
    for k in 0..room.min(count) {
        let other = k + rng.below(count - k);
        chosen.swap(k, other);
    }
    chosen.truncate(room);
    chosen.sort_unstable();
    *rows = chosen.iter().flat_map(|k| &rows[k * width..][..width]).copied().collect();
}

/// Trains boosted trees, with thresholds in the features' own units.
fn grow(
    weights: &Weights,
    model: usize,
    windows: &Windows,
    (growing, round, seed): (&Growing, usize, u64),
) -> Trees {
    let [columns, lines] = weights.models[model].cells;
    let plane = columns * lines;
    let params =
        BoostParams { depth: growing.depth, trees: growing.rounds[round], one_of: growing.one_of, seed };
    let features = weights.planes() * plane;
    let samples = Samples { features, positive: &windows.positive, negative: &windows.negative };
    let mut trees = boost(samples, &params);
    for (feature, threshold) in trees.features.iter().zip(&mut trees.thresholds) {
        *threshold *= weights.feature_step(usize::from(*feature) / plane);
    }
    trees
}

/// Trains a support vector machine on the windows, with features scaled as in images.
fn separate(weights: &Weights, model: usize, windows: &Windows, (svm, seed): (&Svm, u64)) -> Template {
    let [columns, lines] = weights.models[model].cells;
    let plane = columns * lines;
    let steps: Vec<f32> =
        (0..weights.planes() * plane).map(|feature| weights.feature_step(feature / plane)).collect();
    // A byte is a truncated feature, half a unit below it on average.
    let value = |(byte, step): (&u8, &f32)| (f32::from(*byte) + 0.5) * step;
    let rows = windows.positive.chunks_exact(steps.len()).chain(windows.negative.chunks_exact(steps.len()));
    let samples: Vec<f32> = rows.flat_map(|row| row.iter().zip(&steps).map(value)).collect();
    let counts = [&windows.positive, &windows.negative].map(|bytes| bytes.len() / steps.len());
    let is_positive: Vec<bool> = (0..counts[0] + counts[1]).map(|k| k < counts[0]).collect();
    let params = SvmParams { cost: svm.cost, passes: PASSES, seed, ..SvmParams::default() };
    let linear = svm::train(steps.len(), &samples, &is_positive, &params);
    Template { weights: linear.weights.iter().map(|w| *w as f32).collect(), offset: linear.offset as f32 }
}

/// Windows from one image; at most `most` without an object.
fn mine(
    recipe: &Recipe,
    scanner: &mut Scanner,
    image: &Labelled,
    [round, number, most]: [usize; 3],
) -> anyhow::Result<Vec<Windows>> {
    let mut windows = vec![Windows::default(); recipe.window.len()];
    scanner.fill(image.picture()?.rgb()?)?;
    let mut candidates = Vec::new();
    scanner.candidates(&mut candidates);
    candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut rng = Rng::keyed(recipe.seed, "windows", &[number as i64]);
    for (model, (window, out)) in recipe.window.iter().zip(&mut windows).enumerate() {
        if round == 0 {
            for bbox in image.examples(window, &recipe.learning) {
                example(scanner, window, (model, bbox), &mut out.positive);
            }
        }
        let mut chosen: Vec<[f64; 4]> = Vec::new();
        let mut add = |candidate: &Candidate, chosen: &mut Vec<[f64; 4]>| {
            let bbox = scanner.bbox(candidate);
            let own = image.overlap(window.class, bbox) < APART[round.min(1)];
            if own && !chosen.iter().any(|other| iou(*other, bbox) > 0.5) {
                scanner.features(candidate, &mut out.negative);
                chosen.push(bbox);
            }
        };
        if round == 0 {
            for _ in 0..most {
                if let Some(candidate) = anywhere(scanner, model, &mut rng) {
                    add(&candidate, &mut chosen);
                }
            }
        }
        for candidate in candidates.iter().filter(|candidate| candidate.model == model) {
            if chosen.len() >= most {
                break;
            }
            add(candidate, &mut chosen);
        }
    }
    Ok(windows)
}

/// Random window.
fn anywhere(scanner: &Scanner, model: usize, rng: &mut Rng) -> Option<Candidate> {
    if scanner.levels() == 0 {
        return None;
    }
    let level = rng.below(scanner.levels());
    let [columns, lines] = scanner.places(model, level);
    let at = [columns.start + rng.below(columns.len()), lines.start + rng.below(lines.len())];
    let fits = !columns.is_empty() && !lines.is_empty();
    fits.then_some(Candidate { model, level, at, score: 0.0 })
}

/// Features of the windows nearest to a box, and of their mirror images.
fn example(scanner: &Scanner, window: &Window, (model, bbox): (usize, [f64; 4]), into: &mut Vec<u8>) {
    for candidate in scanner.around(model, bbox) {
        let start = into.len();
        scanner.features(&candidate, into);
        let mirrored = mirror(scanner.weights(), &into[start..], window.cells);
        into.extend(mirrored);
    }
}

/// Features of a mirrored window.
fn mirror(weights: &Weights, features: &[u8], [columns, lines]: [usize; 2]) -> Vec<u8> {
    let plane = |k: usize| &features[k * columns * lines..][..columns * lines];
    let planes = (0..weights.planes()).map(|k| plane(weights.mirrored(k)));
    planes.flat_map(|plane| plane.chunks_exact(columns).flat_map(|row| row.iter().rev().copied())).collect()
}
