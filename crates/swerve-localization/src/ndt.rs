//! Scan matching with a map of normal distributions: the pose at which a scan's points are the likeliest.
//!
//! The score of a pose is `Σ -d₁ exp(-d₂/2 rᵀ Σ⁻¹ r)` over the points, `r` from the mean of the cube that the point is
//! in (DIRECT1), or of that and the six beside it (DIRECT7). It is climbed by Newton's steps with the positive part of the
//! Hessian, damped after Levenberg where a step does not climb. Source: Magnusson, "The three-dimensional
//! normal-distributions transform", 2009, chapter 6.

pub use nalgebra::{Isometry3, Vector3};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion};
use swerve_geom::math;

use crate::eigen;
use crate::eskf::{exp, unit};
use crate::voxels::{Normal, VoxelMap};

/// Numbers of a pose: place, then turn, both along the map's axes.
const DOF: usize = 6;
/// A matrix over them.
pub type Matrix6 = SMatrix<f64, DOF, DOF>;
type Vector6 = SVector<f64, DOF>;

/// Share of points that are of nothing in the map.
const OUTLIERS: f64 = 0.55;
/// Lever that makes metres of radians where both are compared.
const LEVER_M: f64 = 10.0;
/// A direction of which the points together say less than this per point, 1/m², is not seen.
const UNSEEN_PER_M2: f64 = 0.25;
/// Deviation along a direction that is not seen, metres.
const UNSEEN_M: f64 = 10.0;
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

/// Score and derivatives at a pose.
struct Score {
    value: f64,
    gradient: Vector6,
    hessian: Matrix6,
    hits: u32,
    likelihood: f64,
}

/// Matches a scan with maps, the coarsest first, from a guess of the pose. Points that are no numbers count as none;
/// nothing matches an empty scan or map.
pub fn align(
    maps: &[&VoxelMap],
    scan: &[Vector3<f64>],
    guess: &Isometry3<f64>,
    limits: &Limits,
) -> Option<Matched> {
    let (mut pose, mut iterations, mut end) = (*guess, 0, None);
    for map in maps {
        let (at, score, converged) = climb(map, scan, pose, limits, &mut iterations)?;
        pose = at;
        end = Some((score, converged));
    }
    let (score, converged) = end?;
    let hits = f64::from(score.hits);
    let surface = {
        let map = maps.last()?;
        Shape::new(map.resolution_m()).score::<true>(map, scan, &pose, limits.neighbours)
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
    Shape::new(map.resolution_m()).score::<false>(map, scan, pose, Neighbours::Direct1).value
}

fn climb(
    map: &VoxelMap,
    scan: &[Vector3<f64>],
    mut pose: Isometry3<f64>,
    limits: &Limits,
    iterations: &mut u32,
) -> Option<(Isometry3<f64>, Score, bool)> {
    let shape = Shape::new(map.resolution_m());
    let mut score = shape.score::<false>(map, scan, &pose, limits.neighbours);
    *iterations += 1;
    let mut damping = 1e-4;
    for _ in 0..limits.iterations {
        if score.hits == 0 {
            return None;
        }
        let mut damped = score.hessian;
        for i in 0..DOF {
            damped[(i, i)] *= 1.0 + damping;
            damped[(i, i)] += 1e-9 * f64::from(score.hits);
        }
        let mut step = eigen::solved(&damped, &score.gradient)?;
        let length_m = length_m(&step);
        if length_m > limits.step_m {
            step *= limits.step_m / length_m;
        }
        let next = moved(&pose, &step);
        let found = shape.score::<false>(map, scan, &next, limits.neighbours);
        *iterations += 1;
        let gain = found.value - score.value;
        let climbs = gain > 0.0;
        if climbs {
            (pose, score) = (next, found);
            damping = (damping * 0.1_f64).max(1e-7);
        } else {
            // Points that go over to another cube make steps in the score: near the top there is nothing to climb for long.
            damping = (100.0 * damping).max(0.1);
        }
        if length_m < limits.end_m || damping > 100.0 || (climbs && gain < 1e-5 * score.value) {
            return Some((pose, score, true));
        }
    }
    (score.hits > 0).then_some((pose, score, false))
}

fn length_m(step: &Vector6) -> f64 {
    let square = |from: usize| {
        step[from] * step[from] + step[from + 1] * step[from + 1] + step[from + 2] * step[from + 2]
    };
    (square(0) + LEVER_M * LEVER_M * square(3)).sqrt()
}

fn moved(pose: &Isometry3<f64>, step: &Vector6) -> Isometry3<f64> {
    let place = pose.translation.vector + Vector3::new(step[0], step[1], step[2]);
    let turn = exp(&Vector3::new(step[3], step[4], step[5])) * pose.rotation;
    Isometry3::from_parts(Translation3::from(place), unit(turn))
}

/// The shape of a point's score, which goes with the size of the cubes.
struct Shape {
    height: f64,
    width: f64,
}

impl Shape {
    fn new(resolution_m: f64) -> Self {
        let inside = 10.0 * (1.0 - OUTLIERS);
        let outside = OUTLIERS / (resolution_m * resolution_m * resolution_m);
        let floor = -math::ln(outside);
        let height = -math::ln(inside + outside) - floor;
        let half = -math::ln(inside * math::exp(-0.5) + outside) - floor;
        Self { height: -height, width: -2.0 * math::ln(half / height) }
    }

    /// Score and derivatives; the Hessian of what is known of the surfaces alone where `KNOWN`.
    fn score<const KNOWN: bool>(
        &self,
        map: &VoxelMap,
        scan: &[Vector3<f64>],
        pose: &Isometry3<f64>,
        neighbours: Neighbours,
    ) -> Score {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let place = pose.translation.vector;
        let mut sums = Sums::default();
        for point in scan {
            let lever = rotation * point;
            let at = lever + place;
            let Some(index) = map.index(&at) else { continue };
            let mut best = 0.0_f64;
            let mut take =
                |normal: &Normal| best = best.max(self.add::<KNOWN>(&mut sums, normal, &at, &lever));
            if let Some(normal) = map.normal(index) {
                take(normal);
            }
            if neighbours == Neighbours::Direct7 {
                for axis in 0..3 {
                    for side in [-1, 1] {
                        let mut beside = index;
                        beside[axis] += side;
                        if let Some(normal) = map.normal(beside) {
                            take(normal);
                        }
                    }
                }
            }
            if best > 0.0 {
                sums.hits += 1;
                sums.likelihood += best;
            }
        }
        sums.score(self)
    }

    /// Adds what a point says by a surface; its likelihood.
    #[inline]
    fn add<const KNOWN: bool>(
        &self,
        sums: &mut Sums,
        normal: &Normal,
        at: &Vector3<f64>,
        lever: &Vector3<f64>,
    ) -> f64 {
        let r = at - normal.mean;
        let [xx, xy, xz, yy, yz, zz] = normal.inverse;
        let b = Vector3::new(
            xx * r.x + xy * r.y + xz * r.z,
            xy * r.x + yy * r.y + yz * r.z,
            xz * r.x + yz * r.y + zz * r.z,
        );
        let exponent = -0.5 * self.width * r.dot(&b);
        if exponent.is_nan() || exponent <= -20.0 {
            return 0.0;
        }
        let weight = math::exp(exponent);
        sums.value += weight;
        sums.force -= b * weight;
        sums.torque -= lever.cross(&b) * weight;
        let a = if KNOWN { normal.surface } else { normal.inverse }.map(|x| x * weight);
        for (sum, x) in sums.place.iter_mut().zip(a) {
            *sum += x;
        }
        // A times the derivative of the point by the turn, -[lever]×, row by row.
        let rows = [[a[0], a[1], a[2]], [a[1], a[3], a[4]], [a[2], a[4], a[5]]];
        let u = lever;
        let mixed = rows.map(|[p, q, s]| [s * u.y - q * u.z, p * u.z - s * u.x, q * u.x - p * u.y]);
        let mixed: [[f64; 3]; 3] = mixed;
        for (sum, x) in sums.mixed.iter_mut().flatten().zip(mixed.iter().flatten()) {
            *sum += x;
        }
        // [lever]× of the columns of that.
        for (j, sum) in sums.turn.iter_mut().enumerate() {
            let [p, q, s] = mixed.map(|row| row[j]);
            let column = [u.y * s - u.z * q, u.z * p - u.x * s, u.x * q - u.y * p];
            for (sum, x) in sum.iter_mut().zip(column) {
                *sum += x;
            }
        }
        weight
    }
}

/// Sums over the points, in their order.
#[derive(Default)]
struct Sums {
    value: f64,
    force: Vector3<f64>,
    torque: Vector3<f64>,
    place: [f64; 6],
    mixed: [[f64; 3]; 3],
    turn: [[f64; 3]; 3],
    hits: u32,
    likelihood: f64,
}

impl Sums {
    fn score(&self, shape: &Shape) -> Score {
        let scale = shape.height * shape.width;
        let [xx, xy, xz, yy, yz, zz] = self.place;
        let place = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let mut hessian = Matrix6::zeros();
        for i in 0..3 {
            for j in 0..3 {
                hessian[(i, j)] = scale * place[(i, j)];
                hessian[(i, 3 + j)] = scale * self.mixed[i][j];
                hessian[(3 + j, i)] = scale * self.mixed[i][j];
                hessian[(3 + i, 3 + j)] = 0.5 * scale * (self.turn[i][j] + self.turn[j][i]);
            }
        }
        let [f, t] = [self.force * scale, self.torque * scale];
        Score {
            value: self.value * shape.height,
            gradient: Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z),
            hessian,
            hits: self.hits,
            likelihood: self.likelihood,
        }
    }
}

/// Covariance by the Hessian, its least eigenvalue per point, and how many directions are not seen.
fn spread(hessian: &Matrix6, hits: f64) -> Option<(Matrix6, f64, u32)> {
    let scale = |i: usize| if i < 3 { 1.0 } else { 1.0 / LEVER_M };
    let scaled = Matrix6::from_fn(|i, j| hessian[(i, j)] * scale(i) * scale(j) / hits);
    let (values, vectors) = eigen::symmetric(&scaled);
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
