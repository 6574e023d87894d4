//! Training of nets on recorded tracks.

use serde::Deserialize;
use swerve_core::Rng;
use swerve_msg::TrackList;

use super::example::Example;
use super::shape::{Model, Shape, Weights};
use super::{Net, PAST, mfp, multipath, r2p2, sights};
use crate::net::{Adam, Matrix, Shapes, drawn};
use crate::predictor::seen;
use crate::recorded::{Protocol, Recording, Scene};

/// Training parameters.
#[derive(Clone, Copy, PartialEq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Learning {
    /// Seed of weights, order and augmentation.
    pub seed: u64,
    /// Number of Adam steps.
    pub steps: usize,
    /// Number of examples per step.
    pub batch: usize,
    /// Initial learning rate; it decays to zero by a cosine schedule.
    pub rate: f32,
    /// Standard deviation of the logarithm of the scale by which an example is augmented.
    pub stretch: f32,
    /// Standard deviation of the noise added to each past step, in scaled units (1 m for pedestrians, 5 m on wheels).
    pub noise: f32,
    /// Weight of distance rather than density in the gradient of a mode's path, 0 to 1; for `multipath` only.
    #[serde(default)]
    pub distance: f32,
    /// Weight of the density under all modes, which is the evaluation metric, rather than that of the mode with the
    /// nearest anchor, 0 to 1; for `multipath` only.
    #[serde(default)]
    pub mixed: f32,
    /// Standard deviation of the logarithm of a factor on `noise`, drawn per example: sensor quality differs between
    /// recordings.
    #[serde(default)]
    pub noise_spread: f32,
    /// Decay of the exponential moving average of the weights per step, 0 to 1; the average is the result. 0 uses the
    /// weights of the last step.
    #[serde(default)]
    pub average: f32,
    /// Share by which the learned offsets from the baseline are shrunk at the end, 0 to 1, because they generalise
    /// only in part to other places; for `multipath` only.
    #[serde(default)]
    pub shrink: f32,
}

/// Error of training.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum LearningError {
    /// A parameter is out of range.
    #[error("{0}")]
    Number(String),
    /// There are no examples.
    #[error("expected tracks that are as long as the past and the steps ahead, found none")]
    Empty,
}

impl Example {
    /// Augments the example: random scale, mirroring, and noise on the past.
    fn changed(&self, rng: &mut Rng, learning: &Learning) -> Self {
        let by = libm::expf(learning.stretch * rng.normal() as f32);
        let side = if rng.unit() < 0.5 { by } else { -by };
        let changed = |[x, y]: [f32; 2]| [by * x, side * y];
        let noise = match learning.noise_spread {
            0.0 => learning.noise,
            spread => learning.noise * libm::expf(spread * rng.normal() as f32),
        };
        let mut one = self.clone();
        for step in one.sight.own.chunks_exact_mut(2) {
            let [x, y] = changed([step[0], step[1]]);
            step[0] = x + noise * rng.normal() as f32;
            step[1] = y + noise * rng.normal() as f32;
        }
        for near in &mut one.sight.near {
            (near.at, near.pace) = (changed(near.at), changed(near.pace));
        }
        let places = one.truth.iter_mut().chain(&mut one.sight.expected);
        places.chain(one.others.iter_mut().flatten()).for_each(|at| *at = changed(*at));
        one
    }
}

/// Examples of all actors in recordings that are observed for long enough, at every `stride`-th sighting.
pub fn examples(recordings: &[Recording], shape: &Shape, stride: usize) -> Vec<Example> {
    let mut all = Vec::new();
    for recording in recordings {
        let each = (shape.step_s() / recording.step.as_secs()).round().max(1.0) as usize;
        let protocol = Protocol { stride, ..Protocol::whole((PAST - 1) * each + 1, shape.steps * each) };
        for scene in recording.scenes(&protocol) {
            of_scene(&scene, shape, each, &mut all);
        }
    }
    all
}

fn of_scene(scene: &Scene, shape: &Shape, each: usize, all: &mut Vec<Example>) {
    let tracks: &TrackList = &scene.tracks;
    let seen = seen(tracks);
    let sights = sights(&seen, tracks.stamp, shape);
    let truth = |k: usize| {
        let window = scene.windows.binary_search_by_key(&seen[k].track.id, |window| window.id).ok()?;
        Some(scene.windows[window].truth.iter().skip(each - 1).step_by(each))
    };
    for (k, sight) in sights.iter().enumerate() {
        let Some(own) = truth(k) else { continue };
        // Actors that are not observed to the end are extrapolated.
        let other = |near: &super::sight::Near| match truth(near.who) {
            Some(places) => places.map(|at| sight.frame.place(*at)).collect(),
            None => (1..=shape.steps)
                .map(|step| [0, 1].map(|i| near.at[i] + near.pace[i] * step as f32))
                .collect(),
        };
        all.push(Example {
            truth: own.map(|at| sight.frame.place(*at)).collect(),
            others: sight.near.iter().map(other).collect(),
            sight: sight.clone(),
        });
    }
}

/// Callback for training progress: step and loss.
pub type Progress<'a> = &'a mut dyn FnMut(usize, f32);

/// Trains a net; the same examples, shape and parameters give the same bytes. `source` describes its origin.
///
/// # Errors
/// If a parameter is out of range, or there are no examples.
pub fn train(
    source: String,
    shape: Shape,
    (examples, learning): (&[Example], &Learning),
    told: Progress<'_>,
) -> Result<Weights, LearningError> {
    learning.check().and(shape.check()).map_err(LearningError::Number)?;
    if examples.is_empty() {
        return Err(LearningError::Empty);
    }
    let mut shapes = Shapes::default();
    let net = Net::of(&shape, &mut shapes);
    let mut matrices = drawn(&shapes.list(), learning.seed);
    let mut adam = Adam::new(&matrices);
    let mut rng = Rng::keyed(learning.seed, "order", &[]);
    let mut anchors = match shape.model {
        Model::Multipath => multipath::anchors(&shape, examples, learning.seed),
        _ => Vec::new(),
    };
    let mut order: Vec<usize> = Vec::new();
    let mut mean = matrices.clone();
    for step in 0..learning.steps {
        let batch: Vec<Example> = (0..learning.batch)
            .map(|_| {
                if order.is_empty() {
                    order = shuffled(examples.len(), &mut rng);
                }
                examples[order.pop().expect("there are examples")].changed(&mut rng, learning)
            })
            .collect();
        let (loss, gradients) =
            loss(&net, (&shape, &anchors), &matrices, (&batch, [learning.distance, learning.mixed]));
        let share = step as f32 / learning.steps as f32;
        let rate = learning.rate * 0.5 * (1.0 + libm::cosf(core::f32::consts::PI * share));
        adam.step(&mut matrices, &gradients, rate);
        let kept = learning.average.min(step as f32 / (step + 10) as f32);
        for (mean, now) in mean.iter_mut().zip(&matrices) {
            mean.values
                .iter_mut()
                .zip(&now.values)
                .for_each(|(mean, now)| *mean = kept * *mean + (1.0 - kept) * now);
        }
        told(step, loss);
    }
    if shape.model == Model::Multipath && learning.shrink > 0.0 {
        multipath::shrink(&mut anchors, &mut mean, learning.shrink);
    }
    Ok(Weights { source, shape, anchors, matrices: mean })
}

/// Loss of a batch, and gradients of the weights.
pub(super) fn loss(
    net: &Net,
    (shape, anchors): (&Shape, &[Vec<f32>]),
    matrices: &[Matrix],
    (batch, of_multipath): (&[Example], [f32; 2]),
) -> (f32, Vec<Matrix>) {
    match net {
        Net::Multipath(layers) => multipath::loss(layers, (shape, anchors), matrices, (batch, of_multipath)),
        Net::Mfp(layers) => mfp::loss(layers, shape, matrices, batch),
        Net::R2p2(layers) => r2p2::loss(layers, shape, matrices, batch),
    }
}

/// Random permutation of the numbers below `n` (Fisher and Yates).
fn shuffled(n: usize, rng: &mut Rng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    for k in (1..n).rev() {
        order.swap(k, rng.below(k + 1));
    }
    order
}

impl Learning {
    fn check(&self) -> Result<(), String> {
        let within = |name: &str, found: f64, [low, high]: [f64; 2]| {
            let fits = (low..=high).contains(&found);
            fits.then_some(()).ok_or_else(|| format!("`{name}` is {found}, expected {low} to {high}"))
        };
        within("steps", self.steps as f64, [1.0, 1e6])?;
        within("batch", self.batch as f64, [1.0, 4096.0])?;
        within("rate", self.rate.into(), [1e-6, 0.1])?;
        within("stretch", self.stretch.into(), [0.0, 1.0])?;
        within("noise", self.noise.into(), [0.0, 1.0])?;
        within("distance", self.distance.into(), [0.0, 1.0])?;
        within("mixed", self.mixed.into(), [0.0, 1.0])?;
        within("shrink", self.shrink.into(), [0.0, 1.0])?;
        within("noise_spread", self.noise_spread.into(), [0.0, 3.0])?;
        within("average", self.average.into(), [0.0, 0.9999])
    }
}
