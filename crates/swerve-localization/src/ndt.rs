//! Scan matching with a map of normal distributions (NDT): finds the pose at which a scan is most likely.
//!
//! The score of a pose is `Σ -d₁ exp(-d₂/2 rᵀ Σ⁻¹ r)` over the points, with `r` relative to the mean of the cube that
//! contains the point (DIRECT1), or of that cube and its six neighbours (DIRECT7). It is maximised by Newton steps
//! with the positive part of the Hessian, with Levenberg damping when a step fails. Source: Magnusson, "The
//! three-dimensional normal-distributions transform", 2009, chapter 6.

mod score;

pub use nalgebra::{Isometry3, Vector3};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use crate::eigen;
use crate::eskf::{exp, unit};
use crate::voxels::VoxelMap;
use score::{DOF, Score, Shape, Vector6};
pub use score::{Matrix6, Neighbours};

/// Lever arm by which radians are converted to metres for comparison.
const LEVER_M: f64 = 10.0;
/// Directions with less information per point than this, 1/m², are unobservable.
const UNSEEN_PER_M2: f64 = 0.25;
/// Standard deviation along unobservable directions, metres.
const UNSEEN_M: f64 = 10.0;
/// Approximate number of points matched on all maps but the last, and the convergence limit there as a share of the
/// edge of a cube.
const ROUGH_POINTS: usize = 1500;
const ROUGH_END: f64 = 0.01;
/// Largest factor by which a Newton step is lengthened.
const STRIDE_MOST: f64 = 2.5;
/// Errors of neighbouring points are correlated: this many count as one.
const ALIKE: f64 = 30.0;

/// Limits of the optimisation.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Limits {
    /// Cubes that a point is compared with.
    pub neighbours: Neighbours,
    /// Largest number of steps on each map.
    pub iterations: u32,
    /// Largest translation of a step, metres; in radians, a tenth of it.
    pub step_m: f64,
    /// Convergence limit of a step, metres; in radians, a tenth of it.
    pub end_m: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { neighbours: Neighbours::Direct1, iterations: 30, step_m: 0.5, end_m: 1e-3 }
    }
}

/// Result of a registration.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Matched {
    /// Transform from the scan's frame to the map's.
    pub map_from_scan: Isometry3<f64>,
    /// Number of evaluations of the score.
    pub iterations: u32,
    /// True if it converged before the largest number of steps.
    pub converged: bool,
    /// Share of the points in cubes with a surface.
    pub overlap: f64,
    /// Mean likelihood of these points, at most 1.
    pub likelihood: f64,
    /// Covariance of translation (m) and rotation (rad) along the map's axes.
    pub covariance: Matrix6,
    /// Smallest eigenvalue of the Hessian per point, 1/m², with rotations as metres on a lever of 10 m.
    pub min_eigenvalue_per_m2: f64,
    /// Number of unobservable directions, of six.
    pub degenerate: u32,
}

/// Agreement of a scan with a map at a pose.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Agreement {
    /// Number of points in cubes with a surface.
    pub hits: u32,
    /// Their share of all points.
    pub overlap: f64,
    /// Their mean likelihood, at most 1.
    pub likelihood: f64,
    /// Smallest eigenvalue of the Hessian per point, 1/m², with rotations as metres on a lever of 10 m.
    pub min_eigenvalue_per_m2: f64,
    /// Number of directions of the pose that the surfaces do not constrain, of six.
    pub degenerate: u32,
    /// Smallest share, over all directions of the pose, of the information that the scan has about itself, restricted
    /// to points above or below surfaces of the map. At a wrong place much of a scan can be on surfaces, such as its
    /// ground points, but not on the surfaces that determine the place.
    pub informed: f64,
}

/// Agreement of a scan with a map at a pose from any source; `None` if no point is on a surface.
pub fn agreement(map: &VoxelMap, scan: &[Vector3<f64>], pose: &Isometry3<f64>) -> Option<Agreement> {
    let score_on = |map: &VoxelMap, scan: &[Vector3<f64>], pose: &Isometry3<f64>| {
        Shape::new(map.resolution_m()).score::<true>(map, scan, 1, pose, Neighbours::Direct1)
    };
    let score = score_on(map, scan, pose);
    let hits = f64::from(score.hits);
    let (_, min_eigenvalue_per_m2, degenerate) = spread(&score.hessian, hits)?;
    // Same axes and levers as on the map. Points outside the columns of the map are ignored.
    let turned: Vec<_> = scan.iter().map(|point| pose.rotation * point).collect();
    let own_map = VoxelMap::of_points(map.resolution_m(), &turned);
    let columns = map.columns();
    let is_in_column = |point: &Vector3<f64>| {
        let index = map.index((point + pose.translation.vector).data.0[0]);
        index.is_some_and(|[x, y, _]| columns.contains(&[x, y]))
    };
    let within: Vec<_> = turned.into_iter().filter(is_in_column).collect();
    let own = score_on(&own_map, &within, &Isometry3::identity());
    Some(Agreement {
        hits: score.hits,
        overlap: hits / scan.len() as f64,
        likelihood: score.likelihood / hits,
        min_eigenvalue_per_m2,
        degenerate,
        informed: informed(&score.hessian, &own.hessian, scan.len() as f64),
    })
}

/// Smallest eigenvalue of a Hessian relative to another one of `points`, without directions in which the other has no
/// information; 0 if it has none at all.
fn informed(hessian: &Matrix6, own: &Matrix6, points: f64) -> f64 {
    let [hessian, own] = [hessian, own].map(|of| scaled(of, points));
    let (values, vectors) = eigen::symmetric(&own);
    let whitening =
        Matrix6::from_fn(
            |i, j| {
                if values[j] < UNSEEN_PER_M2 { 0.0 } else { vectors[(i, j)] / values[j].sqrt() }
            },
        );
    // Fixed order of summation on every machine.
    let product = |a: &Matrix6, b: &Matrix6| {
        Matrix6::from_fn(|i, j| (0..DOF).fold(0.0, |sum, k| sum + a[(i, k)] * b[(k, j)]))
    };
    let whitened = product(&whitening.transpose(), &product(&hessian, &whitening));
    let (shares, at) = eigen::symmetric(&whitened);
    let is_seen = |k: usize| (0..DOF).any(|j| values[j] >= UNSEEN_PER_M2 && at[(j, k)].abs() > 1e-9);
    (0..DOF).filter(|k| is_seen(*k)).map(|k| shares[k]).reduce(f64::min).unwrap_or(0.0)
}

/// Hessian per point, 1/m², with rotations as metres on a lever.
fn scaled(hessian: &Matrix6, points: f64) -> Matrix6 {
    let scale = |i: usize| if i < 3 { 1.0 } else { 1.0 / LEVER_M };
    Matrix6::from_fn(|i, j| hessian[(i, j)] * scale(i) * scale(j) / points)
}

/// Registers a scan on maps, the coarsest first, from an initial pose. Points that are not finite are ignored;
/// returns `None` for an empty scan or map.
///
/// Rotations are about the scan's origin, which should therefore be near the points, as for a lidar;
/// [`crate::centred`] prepares clouds with other origins.
pub fn align(
    maps: &[&VoxelMap],
    scan: &[Vector3<f64>],
    guess: &Isometry3<f64>,
    limits: &Limits,
) -> Option<Matched> {
    let (mut pose, mut iterations, mut end) = (*guess, 0, None);
    for (k, map) in maps.iter().enumerate() {
        let level = if k + 1 == maps.len() {
            Level { map, scan, every: 1, end_m: limits.end_m }
        } else {
            let every = (scan.len() / ROUGH_POINTS).max(1);
            Level { map, scan, every, end_m: limits.end_m.max(ROUGH_END * map.resolution_m()) }
        };
        let (at, score, converged) = level.climb(pose, limits, &mut iterations)?;
        pose = at;
        end = Some((score, converged));
    }
    let (score, converged) = end?;
    let hits = f64::from(score.hits);
    let surface = {
        let map = maps.last()?;
        Shape::new(map.resolution_m()).score::<true>(map, scan, 1, &pose, limits.neighbours)
    };
    let (covariance, min_eigenvalue_per_m2, degenerate) = spread(&surface.hessian, hits)?;
    Some(Matched {
        map_from_scan: pose,
        iterations,
        converged,
        overlap: hits / scan.len() as f64,
        likelihood: score.likelihood / hits,
        covariance,
        min_eigenvalue_per_m2,
        degenerate,
    })
}

/// Likelihood of a scan at a pose, as a sum over its points: only comparisons are meaningful.
pub(crate) fn likelihood(map: &VoxelMap, scan: &[Vector3<f64>], pose: &Isometry3<f64>) -> f64 {
    Shape::new(map.resolution_m()).score::<false>(map, scan, 1, pose, Neighbours::Direct1).value
}

/// One resolution of the map, with the points and the convergence limit used on it.
struct Level<'a> {
    map: &'a VoxelMap,
    scan: &'a [Vector3<f64>],
    /// One of this many points is used.
    every: usize,
    /// Convergence limit of a step, metres.
    end_m: f64,
}

impl Level<'_> {
    fn climb(
        &self,
        mut pose: Isometry3<f64>,
        limits: &Limits,
        iterations: &mut u32,
    ) -> Option<(Isometry3<f64>, Score, bool)> {
        let shape = Shape::new(self.map.resolution_m());
        let mut score_at = |pose: &Isometry3<f64>| {
            *iterations += 1;
            shape.score::<false>(self.map, self.scan, self.every, pose, limits.neighbours)
        };
        let mut score = score_at(&pose);
        let (mut damping, mut stride) = (1e-4, Stride::default());
        for _ in 0..limits.iterations {
            if score.hits == 0 {
                return None;
            }
            let mut damped = score.hessian;
            for i in 0..DOF {
                damped[(i, i)] *= 1.0 + damping;
                damped[(i, i)] += 1e-9 * f64::from(score.hits);
            }
            let newton = eigen::solved(&damped, &score.gradient)?;
            let step = stride.step(&newton, limits.step_m);
            let next = moved(&pose, &step);
            let found = score_at(&next);
            let gain = found.value - score.value;
            let climbs = gain > 0.0;
            if climbs {
                (pose, score) = (next, found);
                damping = (damping * 0.1_f64).max(1e-7);
            } else {
                damping = (100.0 * damping).max(0.1);
                stride = Stride::default();
            }
            // Below this limit, changes of the score are due to points that move to another cube.
            let is_near = length_m(&step) < if climbs { self.end_m } else { 10.0 * self.end_m };
            if is_near || damping > 100.0 || (climbs && gain < 1e-5 * score.value) {
                return Some((pose, score, true));
            }
        }
        (score.hits > 0).then_some((pose, score, false))
    }
}

/// Lengthening of Newton steps. The positive part of the Hessian overestimates it, so that each step covers only a
/// share of the distance to the maximum; that share is estimated from the previous step.
#[derive(Default)]
struct Stride {
    /// Previous Newton step, and the step that was taken.
    before: Option<(Vector6, Vector6)>,
}

impl Stride {
    fn step(&mut self, newton: &Vector6, longest_m: f64) -> Vector6 {
        let times = self.before.map_or(1.0, |(before, made)| {
            let share = inner(&(before - newton), &made) / inner(&made, &made);
            if share > 0.0 { (1.0 / share).clamp(1.0, STRIDE_MOST) } else { 1.0 }
        });
        let length_m = times * length_m(newton);
        let step = newton * if length_m > longest_m { times * longest_m / length_m } else { times };
        self.before = Some((*newton, step));
        step
    }
}

/// Scalar product of two steps, with rotations as metres on a lever.
fn inner(a: &Vector6, b: &Vector6) -> f64 {
    let of = |from: usize| a[from] * b[from] + a[from + 1] * b[from + 1] + a[from + 2] * b[from + 2];
    of(0) + LEVER_M * LEVER_M * of(3)
}

fn length_m(step: &Vector6) -> f64 {
    inner(step, step).sqrt()
}

fn moved(pose: &Isometry3<f64>, step: &Vector6) -> Isometry3<f64> {
    let place = pose.translation.vector + Vector3::new(step[0], step[1], step[2]);
    let turn = exp(&Vector3::new(step[3], step[4], step[5])) * pose.rotation;
    Isometry3::from_parts(Translation3::from(place), unit(turn))
}

/// Covariance from the Hessian, its smallest eigenvalue per point, and the number of unobservable directions.
fn spread(hessian: &Matrix6, hits: f64) -> Option<(Matrix6, f64, u32)> {
    let scale = |i: usize| if i < 3 { 1.0 } else { 1.0 / LEVER_M };
    let (values, vectors) = eigen::symmetric(&scaled(hessian, hits));
    let (mut least, mut degenerate) = (f64::INFINITY, 0);
    let variances = values.map(|value| {
        least = least.min(value);
        if value < UNSEEN_PER_M2 {
            degenerate += 1;
            return UNSEEN_M * UNSEEN_M;
        }
        ALIKE / (value * hits)
    });
    let covariance = eigen::composed(&variances, &vectors);
    let covariance = Matrix6::from_fn(|i, j| covariance[(i, j)] * scale(i) * scale(j));
    (least.is_finite() && covariance.iter().all(|x| x.is_finite())).then_some((covariance, least, degenerate))
}

/// Pose of a 4x4 matrix by rows; `None` if it is not a rigid transform.
pub fn pose_of(rows: &[f64; 16]) -> Option<Isometry3<f64>> {
    let turn = Matrix3::from_fn(|i, j| rows[4 * i + j]);
    let place = Vector3::new(rows[3], rows[7], rows[11]);
    let is_rotation =
        (turn * turn.transpose() - Matrix3::identity()).abs().max() < 1e-3 && turn.determinant() > 0.0;
    let is_pose = is_rotation && rows[12..] == [0.0, 0.0, 0.0, 1.0] && place.iter().all(|x| x.abs() < 1e9);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    is_pose.then(|| Isometry3::from_parts(Translation3::from(place), turn))
}

#[cfg(test)]
pub(crate) mod tests;
