//! Trajectory errors as computed by `evo` (Grupp 2017): absolute pose error after Umeyama alignment (1991), and
//! relative pose error over a number of frames.
//!
//! The poses of both trajectories are at equal instants. Results are for display; the last bits may differ between
//! machines.

use serde::Serialize;
use swerve_geom::math;

type Vector = [f64; 3];
type Matrix = [Vector; 3];

/// A 3D pose.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SpacePose {
    /// Rotation from body axes to map axes, row-major.
    pub rotation: Matrix,
    /// Position in the map, metres.
    pub position_m: Vector,
}

/// Alignment of an estimate before the comparison.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Alignment {
    /// No alignment.
    None,
    /// Least-squares rotation and translation.
    Rigid,
    /// Rotation, translation and scale: for monocular estimates.
    Scaled,
}

/// Statistics of the errors of all poses.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct TrajectoryErrors {
    /// Root mean square.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Standard deviation.
    pub std: f64,
    /// Minimum.
    pub min: f64,
    /// Maximum.
    pub max: f64,
}

/// Errors in position and attitude.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct PoseErrors {
    /// Position error, metres.
    pub position_m: TrajectoryErrors,
    /// Attitude error, degrees.
    pub angle_deg: TrajectoryErrors,
}

impl SpacePose {
    /// Parses poses in KITTI's format: 12 numbers per line, the upper three rows of the pose matrix.
    ///
    /// # Errors
    /// The number of the invalid line, starting at 1.
    pub fn from_kitti(text: &str) -> Result<Vec<Self>, usize> {
        let pose = |line: &str| -> Option<Self> {
            let numbers: Vec<f64> =
                line.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
            let rows: [f64; 12] = numbers.try_into().ok()?;
            rows.iter().all(|x| x.is_finite()).then(|| Self {
                rotation: core::array::from_fn(|i| core::array::from_fn(|j| rows[4 * i + j])),
                position_m: core::array::from_fn(|i| rows[4 * i + 3]),
            })
        };
        text.lines().enumerate().map(|(k, line)| pose(line).ok_or(k + 1)).collect()
    }

    /// Pose of `other` relative to this one.
    fn to(&self, other: &Self) -> Self {
        let back = transposed(&self.rotation);
        let apart = less(other.position_m, self.position_m);
        Self { rotation: product(&back, &other.rotation), position_m: turned(&back, apart) }
    }

    fn angle_deg(&self) -> f64 {
        let r = &self.rotation;
        let axis = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]];
        math::atan2(dot(axis, axis).sqrt(), r[0][0] + r[1][1] + r[2][2] - 1.0).to_degrees()
    }
}

impl TrajectoryErrors {
    /// Statistics of these errors; zeros if there are none.
    pub fn of(mut errors: Vec<f64>) -> Self {
        errors.sort_by(f64::total_cmp);
        let (Some(&min), Some(&max)) = (errors.first(), errors.last()) else { return Self::default() };
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let middle = errors.len() / 2;
        let median = 0.5 * (errors[middle] + errors[(errors.len() - 1) / 2]);
        let rmse = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        let std = (errors.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / n).sqrt();
        Self { rmse, mean, median, std, min, max }
    }
}

/// Absolute pose error: each estimate against its truth, in the map.
pub fn absolute_errors(truth: &[SpacePose], found: &[SpacePose]) -> PoseErrors {
    let pairs = || truth.iter().zip(found);
    let apart = |(t, f): (&SpacePose, &SpacePose)| norm(less(f.position_m, t.position_m));
    PoseErrors {
        position_m: TrajectoryErrors::of(pairs().map(apart).collect()),
        angle_deg: TrajectoryErrors::of(pairs().map(|(t, f)| f.to(t).angle_deg()).collect()),
    }
}

/// Relative pose error: of the motions over successive intervals of `delta` frames.
pub fn relative_errors(truth: &[SpacePose], found: &[SpacePose], delta: usize) -> PoseErrors {
    let n = truth.len().min(found.len());
    let starts = (0..n).step_by(delta.max(1)).filter(|i| i + delta < n);
    let between = |i: usize| truth[i].to(&truth[i + delta]).to(&found[i].to(&found[i + delta]));
    let errors: Vec<SpacePose> = starts.map(between).collect();
    PoseErrors {
        position_m: TrajectoryErrors::of(errors.iter().map(|e| norm(e.position_m)).collect()),
        angle_deg: TrajectoryErrors::of(errors.iter().map(SpacePose::angle_deg).collect()),
    }
}

/// Aligns the estimate's positions with the truth by least squares.
pub fn aligned(truth: &[SpacePose], found: &[SpacePose], alignment: Alignment) -> Vec<SpacePose> {
    let n = truth.len().min(found.len());
    if alignment == Alignment::None || n == 0 {
        return found.to_vec();
    }
    let middle = |of: &[SpacePose]| {
        core::array::from_fn(|i| of[..n].iter().map(|p| p.position_m[i]).sum::<f64>() / n as f64)
    };
    let (to, from): (Vector, Vector) = (middle(truth), middle(found));
    let mut together = Matrix::default();
    for (t, f) in truth.iter().zip(found) {
        let (t, f) = (less(t.position_m, to), less(f.position_m, from));
        for i in 0..3 {
            for j in 0..3 {
                together[i][j] += f[i] * t[j];
            }
        }
    }
    let turn = best_turn(&together);
    let spread: f64 = found[..n].iter().map(|f| less(f.position_m, from)).map(|f| dot(f, f)).sum();
    let along: f64 = (0..3).map(|i| (0..3).map(|j| turn[i][j] * together[j][i]).sum::<f64>()).sum();
    let scale = if alignment == Alignment::Scaled && spread > 0.0 { along / spread } else { 1.0 };
    let moved = |f: &SpacePose| {
        let at = turned(&turn, less(f.position_m, from));
        SpacePose {
            rotation: product(&turn, &f.rotation),
            position_m: core::array::from_fn(|i| to[i] + scale * at[i]),
        }
    };
    found.iter().map(moved).collect()
}

/// Best rotation from the first to the second vectors of all pairs, from their products: Horn 1987, its quaternion is
/// the eigenvector of the largest eigenvalue.
fn best_turn(s: &Matrix) -> Matrix {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = *s;
    let [w, x, y, z] = largest_eigenvector([
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ]);
    [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
}

/// Eigenvector of the largest eigenvalue of a symmetric matrix, by Jacobi rotations.
fn largest_eigenvector(mut a: [[f64; 4]; 4]) -> [f64; 4] {
    let mut vectors: [[f64; 4]; 4] = core::array::from_fn(|i| core::array::from_fn(|j| f64::from(i == j)));
    for _sweep in 0..20 {
        for p in 0..3 {
            for q in p + 1..4 {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in a.iter_mut().chain(&mut vectors) {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let (above, below) = (a[p], a[q]);
                a[p] = core::array::from_fn(|k| c * above[k] - s * below[k]);
                a[q] = core::array::from_fn(|k| s * above[k] + c * below[k]);
            }
        }
    }
    let largest = (0..4).max_by(|&i, &j| a[i][i].total_cmp(&a[j][j])).unwrap_or(0);
    vectors.map(|row| row[largest])
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

fn less(a: Vector, b: Vector) -> Vector {
    core::array::from_fn(|i| a[i] - b[i])
}

fn turned(m: &Matrix, v: Vector) -> Vector {
    m.map(|row| dot(row, v))
}

fn transposed(m: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| m[j][i]))
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b);
    a.map(|row| columns.map(|column| dot(row, column)))
}

#[cfg(test)]
mod tests;
