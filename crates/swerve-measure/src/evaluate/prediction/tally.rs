//! Prediction errors, accumulated window by window.

use std::collections::VecDeque;

use serde::Serialize;
use swerve_core::Time;
use swerve_eval::forecast::{
    BestOf, Coverage, Gaussian, MISS_M, ModeErrors, Recalibration, collide, joint, joint_probabilities, nll,
};
use swerve_geom::{Obb, Point2, Pose2, Vector2};
use swerve_msg::{Prediction, PredictionList};
use swerve_prediction::recorded::{Scene, Window};

/// Latencies of the timely error, ms.
const LATENCIES_MS: [u32; 6] = [0, 20, 50, 100, 200, 500];
/// Minimum movement from which a heading is derived, metres; below it the previous heading is kept.
const LEAST_M: f64 = 0.1;
/// Adaptation rate of the recalibrated regions after a miss.
const RECALIBRATION_RATE: f64 = 0.02;

/// Means over windows.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Figures {
    /// Number of evaluated windows.
    pub windows: usize,
    /// Average displacement error of the likeliest mode, metres.
    pub ade_m: f64,
    /// Final displacement error of the likeliest mode, metres.
    pub fde_m: f64,
    /// Average displacement error of the best of the K likeliest modes, metres.
    pub min_ade_m: f64,
    /// Final displacement error of the best of them, metres.
    pub min_fde_m: f64,
    pub(crate) brier_min_fde_m: f64,
    /// Share of windows in which all of these modes end more than 2 m off.
    pub(crate) missed: f64,
    /// Negative log-likelihood per step, nats, with positions in metres; NaN without covariances.
    pub nll: f64,
    /// Shares of final positions within the regions of 50, 80, 90 and 95 %.
    pub(crate) coverage: Option<[f64; 4]>,
    /// Mean areas of these regions, m².
    pub(crate) areas_m2: Option<[f64; 4]>,
    /// Share of final positions within the 90 % region that is recalibrated during the recording.
    pub(crate) recalibrated_90: Option<f64>,
    /// Share of windows whose likeliest mode collides with that of another road user.
    pub(crate) collisions: f64,
    /// Share of windows whose recorded path collides with that of another: outlines of recorded actors touch, too.
    pub(crate) collisions_in_truth: f64,
    /// Share of windows with a predicted collision but no recorded one.
    pub(crate) collisions_alone: f64,
    /// Joint metrics over all actors of a scene, in which mode `k` of one belongs to mode `k` of the others.
    pub(crate) world: Option<World>,
    /// Per step: time ahead, mean and root mean square distance of the likeliest mode, share missed.
    pub(crate) by_step: Vec<Step>,
    /// Error of late predictions by latency and time ahead.
    pub(crate) timely: Vec<Timely>,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub(crate) struct Step {
    ahead_s: f64,
    mean_m: f64,
    rms_m: f64,
    /// Share of windows in which all of the K likeliest modes are more than 2 m off at this step.
    missed: f64,
}

/// Means over scenes, each a mean over its actors (Argoverse 2's world metrics).
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub(crate) struct World {
    scenes: usize,
    /// Final displacement error of the scene's likeliest joint mode, metres.
    fde_m: f64,
    /// Final displacement error of the best joint mode of the scene, metres.
    min_fde_m: f64,
    brier_min_fde_m: f64,
    /// Share of actors whose path in that mode ends more than 2 m off.
    missed: f64,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub(crate) struct Timely {
    latency_ms: u32,
    ahead_s: f64,
    error_m: f64,
}

/// Sums from which the means are computed.
#[derive(Clone, Debug)]
pub struct Tally {
    best_of: usize,
    step_s: f64,
    windows: usize,
    sums: [f64; 7],
    collisions: usize,
    collisions_in_truth: usize,
    collisions_alone: usize,
    scenes: usize,
    world: [f64; 4],
    coverage: Coverage,
    recalibration: Recalibration,
    held: [usize; 2],
    /// Scores to be learnt once their prediction has ended: end time, squared distance, and true if within the region.
    to_come: VecDeque<(Time, f64, bool)>,
    /// Count, sum of distances, sum of squares and misses, by step.
    steps: Vec<[f64; 4]>,
}

impl Tally {
    pub(crate) fn new(best_of: usize, steps: usize) -> Self {
        Self {
            best_of,
            step_s: 0.0,
            windows: 0,
            sums: [0.0; 7],
            collisions: 0,
            collisions_in_truth: 0,
            collisions_alone: 0,
            scenes: 0,
            world: [0.0; 4],
            coverage: Coverage::default(),
            recalibration: Recalibration::new(0.9, RECALIBRATION_RATE),
            held: [0; 2],
            to_come: VecDeque::new(),
            steps: vec![[0.0; 4]; steps],
        }
    }

    /// Starts another recording, whose time starts anew.
    pub(crate) fn begin(&mut self) {
        self.to_come.clear();
    }

    /// Adds all evaluated road users of a scene.
    pub(crate) fn add(&mut self, scene: &Scene, list: &PredictionList) {
        let now = scene.tracks.stamp;
        while let Some((_, squared, held)) = self.to_come.pop_front_if(|(at, ..)| *at <= now) {
            self.recalibration.learn(squared, held);
        }
        let found = scene.windows.iter().map(|window| (window, list.modes_of(window.id)));
        let found: Vec<(&Window, &[Prediction])> = found.filter(|(_, modes)| !modes.is_empty()).collect();
        let errors: Vec<Vec<ModeErrors>> =
            found.iter().map(|(window, modes)| errors(modes, window)).collect();
        let predicted: Vec<Vec<Obb>> = found.iter().map(|(_, modes)| outlines(modes)).collect();
        let happened: Vec<Vec<Obb>> =
            found.iter().map(|(window, modes)| outlines_in_truth(modes, window)).collect();
        for (k, (window, modes)) in found.iter().enumerate() {
            self.add_one(window, modes, &errors[k]);
            let hits = |of: &[Vec<Obb>]| (0..of.len()).any(|j| j != k && collide(&of[k], &of[j]));
            let [foretold, happened] = [hits(&predicted), hits(&happened)];
            self.collisions += usize::from(foretold);
            self.collisions_in_truth += usize::from(happened);
            self.collisions_alone += usize::from(foretold && !happened);
        }
        if list.joint || found.iter().all(|(_, modes)| modes.len() == 1) {
            self.add_world(&errors);
        }
    }

    /// Adds the joint errors of all actors of a scene.
    fn add_world(&mut self, errors: &[Vec<ModeErrors>]) {
        let worlds = joint(errors, &joint_probabilities(errors));
        let by_fde = |a: &&ModeErrors, b: &&ModeErrors| a.fde_m.total_cmp(&b.fde_m);
        let Some(best) = worlds.iter().min_by(by_fde) else { return };
        let likeliest =
            worlds.iter().reduce(|best, one| if one.probability > best.probability { one } else { best });
        let k = worlds.iter().position(|one| one == best).unwrap_or(0);
        let missed = errors.iter().filter(|modes| modes[k].missed()).count() as f64 / errors.len() as f64;
        let one = [likeliest.map_or(best.fde_m, |one| one.fde_m), best.fde_m, best.brier_fde_m(), missed];
        self.world.iter_mut().zip(one).for_each(|(sum, one)| *sum += one);
        self.scenes += 1;
    }

    fn add_one(&mut self, window: &Window, modes: &[Prediction], errors: &[ModeErrors]) {
        let steps = window.truth.len();
        let Some(best) = BestOf::of(errors, self.best_of) else { return };
        let mixture = |k: usize| -> Vec<Gaussian> {
            let part = |mode: &Prediction| Gaussian {
                weight: mode.probability,
                mean: mode.path[k + 1].pose.point(),
                covariance_m2: mode.covariances_m2[k + 1],
            };
            modes.iter().map(part).collect()
        };
        let has_spread = modes.iter().all(|mode| mode.covariances_m2.len() == mode.path.len());
        let nats = match has_spread {
            true => (0..steps).map(|k| nll(&mixture(k), window.truth[k])).sum::<f64>() / steps as f64,
            false => f64::NAN,
        };
        self.windows += 1;
        let missed = f64::from(u8::from(best.missed));
        let one =
            [best.ade_m, best.fde_m, best.min_ade_m, best.min_fde_m, best.brier_min_fde_m, missed, nats];
        self.sums.iter_mut().zip(one).for_each(|(sum, one)| *sum += one);
        if has_spread && let Some(region) = Gaussian::of_mixture(&mixture(steps - 1)) {
            let ends = modes[0].path[steps].at;
            self.judge_region(&region, window.truth[steps - 1], ends);
        }
        let Some(likeliest) = Prediction::likeliest(modes) else { return };
        self.step_s = (likeliest.path[1].at - likeliest.path[0].at).as_secs();
        let mut order: Vec<&Prediction> = modes.iter().collect();
        order.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        order.truncate(self.best_of);
        for (k, (sums, truth)) in self.steps.iter_mut().zip(&window.truth).enumerate() {
            let off_m = |mode: &Prediction| mode.path[k + 1].pose.point().distance(*truth);
            let missed = order.iter().all(|mode| off_m(mode) > MISS_M);
            let off_m = off_m(likeliest);
            let one = [1.0, off_m, off_m * off_m, f64::from(u8::from(missed))];
            sums.iter_mut().zip(one).for_each(|(sum, one)| *sum += one);
        }
    }

    fn judge_region(&mut self, region: &Gaussian, place: Point2, ends: Time) {
        self.coverage.add(region, place);
        let squared = region.mahalanobis_squared(place);
        let held = squared <= self.recalibration.squared();
        self.held[0] += usize::from(held);
        self.held[1] += 1;
        self.to_come.push_back((ends, squared, held));
    }

    /// Adds the sums of another file, except the state of recalibration.
    pub(crate) fn join(&mut self, other: &Self) {
        self.windows += other.windows;
        self.step_s = other.step_s.max(self.step_s);
        self.collisions += other.collisions;
        self.collisions_in_truth += other.collisions_in_truth;
        self.collisions_alone += other.collisions_alone;
        self.scenes += other.scenes;
        self.world.iter_mut().zip(other.world).for_each(|(sum, one)| *sum += one);
        self.coverage.join(&other.coverage);
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, one)| *sum += one);
        self.held.iter_mut().zip(other.held).for_each(|(sum, one)| *sum += one);
        for (sums, others) in self.steps.iter_mut().zip(&other.steps) {
            sums.iter_mut().zip(others).for_each(|(sum, one)| *sum += one);
        }
    }

    /// Means over the windows so far.
    pub fn figures(&self) -> Figures {
        let n = self.windows.max(1) as f64;
        let [ade_m, fde_m, min_ade_m, min_fde_m, brier_min_fde_m, missed, nll] = self.sums.map(|sum| sum / n);
        let step = |(k, [count, off, squares, missed]): (usize, &[f64; 4])| Step {
            ahead_s: self.step_s * (k + 1) as f64,
            mean_m: off / count,
            rms_m: (squares / count).sqrt(),
            missed: missed / count,
        };
        let seen = self.steps.iter().enumerate().filter(|(_, sums)| sums[0] > 0.0);
        let by_step: Vec<Step> = seen.map(step).collect();
        let [world_fde_m, world_min_fde_m, world_brier_min_fde_m, world_missed] =
            self.world.map(|sum| sum / self.scenes.max(1) as f64);
        let world = World {
            scenes: self.scenes,
            fde_m: world_fde_m,
            min_fde_m: world_min_fde_m,
            brier_min_fde_m: world_brier_min_fde_m,
            missed: world_missed,
        };
        Figures {
            windows: self.windows,
            ade_m,
            fde_m,
            min_ade_m,
            min_fde_m,
            brier_min_fde_m,
            missed,
            nll,
            coverage: self.coverage.shares(),
            areas_m2: self.coverage.areas_m2(),
            recalibrated_90: (self.held[1] > 0).then(|| self.held[0] as f64 / self.held[1] as f64),
            collisions: self.collisions as f64 / n,
            collisions_in_truth: self.collisions_in_truth as f64 / n,
            collisions_alone: self.collisions_alone as f64 / n,
            world: (self.scenes > 0).then_some(world),
            timely: timely(&by_step, self.step_s),
            by_step,
        }
    }
}

/// Error of late predictions. A path is read at its instants, so latency extends the time ahead: the result is the mean
/// error at the sum of both, linearly interpolated between steps.
fn timely(by_step: &[Step], step_s: f64) -> Vec<Timely> {
    let error_m = |after_s: f64| {
        let at = after_s / step_s;
        let (below, share) = (at.floor() as usize, at.fract());
        let mean_m = |k: usize| if k == 0 { Some(0.0) } else { by_step.get(k - 1).map(|step| step.mean_m) };
        match share < 1e-9 {
            true => mean_m(below),
            false => Some(mean_m(below)? * (1.0 - share) + mean_m(below + 1)? * share),
        }
    };
    let one = |latency_ms: u32, ahead_s: u32| {
        let ahead_s = f64::from(ahead_s);
        let error_m = error_m(f64::from(latency_ms) * 1e-3 + ahead_s)?;
        Some(Timely { latency_ms, ahead_s, error_m })
    };
    let seconds = (by_step.len() as f64 * step_s) as u32;
    (0..=seconds)
        .flat_map(|ahead_s| LATENCIES_MS.into_iter().filter_map(move |ms| one(ms, ahead_s)))
        .collect()
}

/// Errors of each mode.
fn errors(modes: &[Prediction], window: &Window) -> Vec<ModeErrors> {
    let steps = window.truth.len();
    let of = |mode: &Prediction| {
        let path: Vec<Point2> = mode.path[1..=steps].iter().map(|at| at.pose.point()).collect();
        ModeErrors::of(mode.probability, &path, &window.truth)
    };
    modes.iter().filter_map(of).collect()
}

/// Outlines along the likeliest mode.
fn outlines(modes: &[Prediction]) -> Vec<Obb> {
    let outline = |mode: &Prediction| mode.path.iter().map(|at| mode.extent.footprint(at.pose)).collect();
    Prediction::likeliest(modes).map_or(Vec::new(), outline)
}

/// Outlines along the recorded path, headed along the motion; a standing road user keeps its previous heading.
fn outlines_in_truth(modes: &[Prediction], window: &Window) -> Vec<Obb> {
    let Some(likeliest) = Prediction::likeliest(modes) else { return Vec::new() };
    let (now, extent) = (likeliest.path[0], likeliest.extent);
    let (mut at, mut heading_rad) = (now.pose.point(), now.pose.heading_rad);
    let outline = |to: &Point2| {
        let on: Vector2 = *to - at;
        if on.norm() > LEAST_M {
            (at, heading_rad) = (*to, on.heading());
        }
        extent.footprint(Pose2::new(to.x_m, to.y_m, heading_rad))
    };
    std::iter::once(extent.footprint(now.pose)).chain(window.truth.iter().map(outline)).collect()
}
