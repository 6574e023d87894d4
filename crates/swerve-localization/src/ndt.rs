//! Scan matching with a map of normal distributions: the pose at which a scan's points are the likeliest.
//!
//! The score of a pose is `Σ -d₁ exp(-d₂/2 rᵀ Σ⁻¹ r)` over the points, `r` from the mean of the cube that the point is
//! in (DIRECT1), or of that and the six beside it (DIRECT7). It is climbed by Newton's steps with the positive part of the
//! Hessian, damped after Levenberg where a step does not climb. Source: Magnusson, "The three-dimensional
//! normal-distributions transform", 2009, chapter 6.

mod score;

pub use nalgebra::{Isometry3, Vector3};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion};

use crate::eigen;
use crate::eskf::{exp, unit};
use crate::voxels::VoxelMap;
use score::{Score, Shape};

/// Numbers of a pose: place, then turn, both along the map's axes.
const DOF: usize = 6;
/// A matrix over them.
pub type Matrix6 = SMatrix<f64, DOF, DOF>;
type Vector6 = SVector<f64, DOF>;

/// Lever that makes metres of radians where both are compared.
const LEVER_M: f64 = 10.0;
/// A direction of which the points together say less than this per point, 1/m², is not seen.
const UNSEEN_PER_M2: f64 = 0.25;
/// Deviation along a direction that is not seen, metres.
const UNSEEN_M: f64 = 10.0;
/// On all maps but the last about so many points are matched, to this share of a cube's edge.
const ROUGH_POINTS: usize = 1500;
const ROUGH_END: f64 = 0.01;
/// A step is so many times as long as Newton's at most.
const STRIDE_MOST: f64 = 2.5;
/// Neighbouring points err together: as many count as one.
const ALIKE: f64 = 30.0;

/// Which cubes a point is compared with.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Neighbours {
    /// The one that it is in.
    #[default]
    Direct1,
    /// That and the six that share a side with it.
    Direct7,
}

/// How long it goes on.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Limits {
    /// Which cubes a point is compared with.
    pub neighbours: Neighbours,
    /// Most steps on each map.
    pub iterations: u32,
    /// Longest step, metres, and ten times that many radians.
    pub step_m: f64,
    /// A shorter step is the last, metres, and a tenth of that many radians.
    pub end_m: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { neighbours: Neighbours::Direct1, iterations: 30, step_m: 0.5, end_m: 1e-3 }
    }
}

/// What came of a match.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Matched {
    /// From the scan's frame to the map's.
    pub map_from_scan: Isometry3<f64>,
    /// Times that the score was computed.
    pub iterations: u32,
    /// Whether the last step was a short one.
    pub converged: bool,
    /// Share of the points that lie in a cube with a surface.
    pub overlap: f64,
    /// Mean likelihood of those, 1 at most.
    pub likelihood: f64,
    /// Covariance of place (m) and turn (rad) along the map's axes.
    pub covariance: Matrix6,
    /// Smallest eigenvalue of the Hessian per point, 1/m², turns as metres on a lever of 10 m.
    pub min_eigenvalue_per_m2: f64,
    /// Directions that are not seen, of six.
    pub degenerate: u32,
}

/// Agreement of a scan with a map at a pose.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Agreement {
    /// Points in a cube with a surface.
    pub hits: u32,
    /// Their share of all points.
    pub overlap: f64,
    /// Their mean likelihood, at most 1.
    pub likelihood: f64,
    /// Smallest eigenvalue of the Hessian per point, 1/m², with rotations as metres on a lever of 10 m.
    pub min_eigenvalue_per_m2: f64,
    /// Directions of the pose that the surfaces leave open, of six.
    pub degenerate: u32,
    /// Least share, over all directions of the pose, of the information that the scan has on itself, as far as it is above
    /// or below any surface of the map. At a wrong place much of a scan may be on surfaces, as its ground is, but not the
    /// surfaces that determine the place.
    pub informed: f64,
}

/// Agreement of a scan with a map at a pose, however the pose was found; `None` without a point on a surface.
pub fn agreement(map: &VoxelMap, scan: &[Vector3<f64>], pose: &Isometry3<f64>) -> Option<Agreement> {
    let score_on = |map: &VoxelMap, scan: &[Vector3<f64>], pose: &Isometry3<f64>| {
        Shape::new(map.resolution_m()).score::<true>(map, scan, 1, pose, Neighbours::Direct1)
    };
    let score = score_on(map, scan, pose);
    let hits = f64::from(score.hits);
    let (_, min_eigenvalue_per_m2, degenerate) = spread(&score.hessian, hits)?;
    // The same axes and levers as on the map. What lies beyond the map is not missed there.
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

/// Least eigenvalue of a Hessian over another one of `points`, without directions in which that other one has nothing; 0
/// where it has nothing at all.
fn informed(hessian: &Matrix6, own: &Matrix6, points: f64) -> f64 {
    let [hessian, own] = [hessian, own].map(|of| scaled(of, points));
    let (values, vectors) = eigen::symmetric(&own);
    let whitening =
        Matrix6::from_fn(
            |i, j| {
                if values[j] < UNSEEN_PER_M2 { 0.0 } else { vectors[(i, j)] / values[j].sqrt() }
            },
        );
    // Sums in one order on every machine.
    let product = |a: &Matrix6, b: &Matrix6| {
        Matrix6::from_fn(|i, j| (0..DOF).fold(0.0, |sum, k| sum + a[(i, k)] * b[(k, j)]))
    };
    let whitened = product(&whitening.transpose(), &product(&hessian, &whitening));
    let (shares, at) = eigen::symmetric(&whitened);
    let is_seen = |k: usize| (0..DOF).any(|j| values[j] >= UNSEEN_PER_M2 && at[(j, k)].abs() > 1e-9);
    (0..DOF).filter(|k| is_seen(*k)).map(|k| shares[k]).reduce(f64::min).unwrap_or(0.0)
}

/// A Hessian per point, 1/m², turns as metres on a lever.
fn scaled(hessian: &Matrix6, points: f64) -> Matrix6 {
    let scale = |i: usize| if i < 3 { 1.0 } else { 1.0 / LEVER_M };
    Matrix6::from_fn(|i, j| hessian[(i, j)] * scale(i) * scale(j) / points)
}

/// Matches a scan with maps, the coarsest first, from a guess of the pose. Points that are no numbers count as none;
/// nothing matches an empty scan or map.
///
/// Turns are about the scan's origin, so that is to be near the points, as a lidar is; [`crate::centred`] moves clouds of
/// other origins.
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

/// How likely a scan is at a pose: a sum over its points, of which only comparisons mean something.
pub(crate) fn likelihood(map: &VoxelMap, scan: &[Vector3<f64>], pose: &Isometry3<f64>) -> f64 {
    Shape::new(map.resolution_m()).score::<false>(map, scan, 1, pose, Neighbours::Direct1).value
}

/// One map of several, and what of the scan is matched with it how well.
struct Level<'a> {
    map: &'a VoxelMap,
    scan: &'a [Vector3<f64>],
    /// Every so many points one is taken.
    every: usize,
    /// A shorter step is the last.
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
            // Short of the top by less, what steps up or down is points that go over to another cube.
            let is_near = length_m(&step) < if climbs { self.end_m } else { 10.0 * self.end_m };
            if is_near || damping > 100.0 || (climbs && gain < 1e-5 * score.value) {
                return Some((pose, score, true));
            }
        }
        (score.hits > 0).then_some((pose, score, false))
    }
}

/// How much longer than Newton's a step is made. The positive part of the Hessian is too large a one, so that each step
/// ends short of the top by the same share; what the step before left of itself says by how much.
#[derive(Default)]
struct Stride {
    /// The step before: Newton's, and what was made of it.
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

/// Product of two steps, turns as metres on a lever.
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

/// Covariance by the Hessian, its least eigenvalue per point, and how many directions are not seen.
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

/// The pose of a matrix of four rows; none where that turns nothing by a rotation.
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
