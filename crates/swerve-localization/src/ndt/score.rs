//! Score of a pose with gradient and Hessian: points are looked up one by one, and their terms summed in lanes.
//!
//! The number of lanes is the same on all processors, and each sum has a fixed order: the same bits everywhere.

use nalgebra::{Isometry3, Matrix3, SMatrix, SVector, Vector3};
use swerve_geom::math;
use swerve_geom::simd::widest;

use crate::lanes::{LANES, Lanes};
use crate::voxels::VoxelMap;

/// Degrees of freedom of a pose: translation, then rotation, both along the map's axes.
pub(super) const DOF: usize = 6;

/// Matrix over the degrees of freedom.
pub type Matrix6 = SMatrix<f64, DOF, DOF>;

pub(super) type Vector6 = SVector<f64, DOF>;

/// Assumed share of outliers among the points.
const OUTLIERS: f64 = 0.55;
/// Exponents from here down are taken as zero weight.
const LEAST_EXPONENT: f64 = -20.0;
/// Number of pairs of point and surface that are processed together, and largest number of pairs per point.
const BLOCK: usize = 64;
const OF_ONE: usize = 7;
/// Offsets of the cubes that share a side with a cube.
const BESIDE: [[i32; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

/// Score and derivatives at a pose.
pub(super) struct Score {
    pub(super) value: f64,
    pub(super) gradient: Vector6,
    pub(super) hessian: Matrix6,
    pub(super) hits: u32,
    pub(super) likelihood: f64,
}

/// Parameters of a point's score, which depend on the size of the cubes.
pub(super) struct Shape {
    height: f64,
    width: f64,
}

impl Shape {
    pub(super) fn new(resolution_m: f64) -> Self {
        let inside = 10.0 * (1.0 - OUTLIERS);
        let outside = OUTLIERS / (resolution_m * resolution_m * resolution_m);
        let floor = -math::ln(outside);
        let height = -math::ln(inside + outside) - floor;
        let half = -math::ln(inside * math::exp(-0.5) + outside) - floor;
        Self { height: -height, width: -2.0 * math::ln(half / height) }
    }

    /// Score and derivatives over every `every`-th point. With `KNOWN`, the Hessian only includes directions in which
    /// the position of the surfaces is known.
    pub(super) fn score<const KNOWN: bool>(
        &self,
        map: &VoxelMap,
        scan: &[Vector3<f64>],
        every: usize,
        pose: &Isometry3<f64>,
        neighbours: Neighbours,
    ) -> Score {
        let mut sums = Sums { half_width: -0.5 * self.width, ..Sums::default() };
        widest(
            #[inline(always)]
            || sums.add_scan::<KNOWN>(map, scan, every, pose, neighbours),
        );
        sums.score(self)
    }
}

/// A point of a scan.
struct Point {
    /// Position in the map, metres.
    at: [f64; 3],
    /// Offset from the scan's origin, along the map's axes.
    lever: [f64; 3],
}

/// Pairs of a point and a surface, as structure of arrays.
struct Pairs {
    len: usize,
    /// Offset of the point from the mean of the surface, metres.
    off: [[f64; BLOCK]; 3],
    /// Offset of the point from the scan's origin, along the map's axes.
    lever: [[f64; BLOCK]; 3],
    inverse: [[f64; BLOCK]; 6],
    /// Matrix for the Hessian, if that is not the inverse.
    known: [[f64; BLOCK]; 6],
    weight: [f64; BLOCK],
    /// True if the point is the same as in the previous pair.
    is_same: [bool; BLOCK],
}

impl Pairs {
    const EMPTY: Self = Self {
        len: 0,
        off: [[0.0; BLOCK]; 3],
        lever: [[0.0; BLOCK]; 3],
        inverse: [[0.0; BLOCK]; 6],
        known: [[0.0; BLOCK]; 6],
        weight: [0.0; BLOCK],
        is_same: [false; BLOCK],
    };

    /// Adds the pair of a point and the surface in a cube. Returns false if the cube has none.
    #[inline(always)]
    fn push<const KNOWN: bool>(
        &mut self,
        point: &Point,
        map: &VoxelMap,
        cube: [i32; 3],
        is_same: bool,
    ) -> bool {
        let Some(which) = map.surface(cube) else { return false };
        let (surface, k) = (map.at(which), self.len);
        for axis in 0..3 {
            self.off[axis][k] = point.at[axis] - surface.mean[axis];
            self.lever[axis][k] = point.lever[axis];
        }
        self.inverse.iter_mut().zip(surface.inverse).for_each(|(row, x)| row[k] = x);
        if KNOWN {
            self.known.iter_mut().zip(map.known(which)).for_each(|(row, x)| row[k] = *x);
        }
        self.is_same[k] = is_same;
        self.len = k + 1;
        true
    }

    /// Pads the last lanes with pairs of zero weight.
    #[inline(always)]
    fn fill(&mut self) {
        for k in self.len..self.len.next_multiple_of(LANES) {
            for axis in 0..3 {
                (self.off[axis][k], self.lever[axis][k]) = (1e3, 0.0);
            }
            for i in 0..6 {
                (self.inverse[i][k], self.known[i][k]) =
                    (if matches!(i, 0 | 3 | 5) { 1.0 } else { 0.0 }, 0.0);
            }
        }
    }
}

/// Sums over the pairs, in their order lane by lane, and over the points.
#[derive(Default)]
struct Sums {
    half_width: f64,
    value: Lanes,
    force: [Lanes; 3],
    torque: [Lanes; 3],
    /// xx, xy, xz, yy, yz, zz.
    place: [Lanes; 6],
    mixed: [[Lanes; 3]; 3],
    turn: [Lanes; 6],
    hits: u32,
    likelihood: f64,
    /// Largest weight so far of the current point.
    best: f64,
}

impl Sums {
    #[inline(always)]
    fn add_scan<const KNOWN: bool>(
        &mut self,
        map: &VoxelMap,
        scan: &[Vector3<f64>],
        every: usize,
        pose: &Isometry3<f64>,
        neighbours: Neighbours,
    ) {
        let rows = pose.rotation.to_rotation_matrix().into_inner().transpose().data.0;
        let place = pose.translation.vector.data.0[0];
        let mut pairs = Pairs::EMPTY;
        for point in scan.iter().step_by(every) {
            let [x, y, z] = point.data.0[0];
            let turned = |row: [f64; 3]| row[0] * x + row[1] * y + row[2] * z;
            let lever = [turned(rows[0]), turned(rows[1]), turned(rows[2])];
            let at = [lever[0] + place[0], lever[1] + place[1], lever[2] + place[2]];
            let Some(cube) = map.index(at) else { continue };
            let point = Point { at, lever };
            let mut is_same = pairs.push::<KNOWN>(&point, map, cube, false);
            if neighbours == Neighbours::Direct7 {
                for [x, y, z] in BESIDE {
                    let beside = [cube[0] + x, cube[1] + y, cube[2] + z];
                    is_same |= pairs.push::<KNOWN>(&point, map, beside, is_same);
                }
            }
            if pairs.len > BLOCK - OF_ONE {
                self.add::<KNOWN>(&mut pairs);
            }
        }
        self.add::<KNOWN>(&mut pairs);
        self.hits += u32::from(self.best > 0.0);
        self.likelihood += self.best;
    }

    /// Adds the terms of the pairs, and clears them.
    #[inline(always)]
    fn add<const KNOWN: bool>(&mut self, pairs: &mut Pairs) {
        pairs.fill();
        for from in (0..pairs.len).step_by(LANES) {
            self.add_lanes::<KNOWN>(pairs, from);
        }
        let (mut hits, mut likelihood, mut best) = (self.hits, self.likelihood, self.best);
        for (weight, is_same) in pairs.weight.iter().zip(&pairs.is_same).take(pairs.len) {
            if !is_same {
                hits += u32::from(best > 0.0);
                likelihood += best;
                best = 0.0;
            }
            best = best.max(*weight);
        }
        (self.hits, self.likelihood, self.best) = (hits, likelihood, best);
        pairs.len = 0;
    }

    #[inline(always)]
    fn add_lanes<const KNOWN: bool>(&mut self, pairs: &mut Pairs, from: usize) {
        let lanes = |of: &[f64; BLOCK]| Lanes::of(of, from);
        let [rx, ry, rz] = [lanes(&pairs.off[0]), lanes(&pairs.off[1]), lanes(&pairs.off[2])];
        let [ux, uy, uz] = [lanes(&pairs.lever[0]), lanes(&pairs.lever[1]), lanes(&pairs.lever[2])];
        let i = &pairs.inverse;
        let [xx, xy, xz] = [lanes(&i[0]), lanes(&i[1]), lanes(&i[2])];
        let [yy, yz, zz] = [lanes(&i[3]), lanes(&i[4]), lanes(&i[5])];
        let bx = xx * rx + xy * ry + xz * rz;
        let by = xy * rx + yy * ry + yz * rz;
        let bz = xz * rx + yz * ry + zz * rz;
        let exponent = (rx * bx + ry * by + rz * bz) * Lanes::all(self.half_width);
        let weight = exponent.exp_above(LEAST_EXPONENT);
        weight.put(&mut pairs.weight, from);
        self.value += weight;
        let [bx, by, bz] = [bx * weight, by * weight, bz * weight];
        self.force[0] += bx;
        self.force[1] += by;
        self.force[2] += bz;
        self.torque[0] += uy * bz - uz * by;
        self.torque[1] += uz * bx - ux * bz;
        self.torque[2] += ux * by - uy * bx;
        let [xx, xy, xz, yy, yz, zz] = if KNOWN {
            let k = &pairs.known;
            [lanes(&k[0]), lanes(&k[1]), lanes(&k[2]), lanes(&k[3]), lanes(&k[4]), lanes(&k[5])]
        } else {
            [xx, xy, xz, yy, yz, zz]
        };
        let [xx, xy, xz] = [xx * weight, xy * weight, xz * weight];
        let [yy, yz, zz] = [yy * weight, yz * weight, zz * weight];
        self.place[0] += xx;
        self.place[1] += xy;
        self.place[2] += xz;
        self.place[3] += yy;
        self.place[4] += yz;
        self.place[5] += zz;
        // A times the derivative of the point by the rotation, -[lever]×, row by row; then [lever]× times its
        // columns.
        let row = |p: Lanes, q: Lanes, s: Lanes| [s * uy - q * uz, p * uz - s * ux, q * ux - p * uy];
        let mixed = [row(xx, xy, xz), row(xy, yy, yz), row(xz, yz, zz)];
        let [x, y, z] = mixed;
        for j in 0..3 {
            self.mixed[0][j] += x[j];
            self.mixed[1][j] += y[j];
            self.mixed[2][j] += z[j];
        }
        self.turn[0] += uy * z[0] - uz * y[0];
        self.turn[1] += uy * z[1] - uz * y[1];
        self.turn[2] += uy * z[2] - uz * y[2];
        self.turn[3] += uz * x[1] - ux * z[1];
        self.turn[4] += uz * x[2] - ux * z[2];
        self.turn[5] += ux * y[2] - uy * x[2];
    }

    fn score(&self, shape: &Shape) -> Score {
        let scale = shape.height * shape.width;
        let symmetric = |of: &[Lanes; 6]| {
            let [xx, xy, xz, yy, yz, zz] = of.map(|sum| scale * sum.sum());
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        };
        let mixed = Matrix3::from_fn(|i, j| scale * self.mixed[i][j].sum());
        let mut hessian = Matrix6::zeros();
        hessian.fixed_view_mut::<3, 3>(0, 0).copy_from(&symmetric(&self.place));
        hessian.fixed_view_mut::<3, 3>(0, 3).copy_from(&mixed);
        hessian.fixed_view_mut::<3, 3>(3, 0).copy_from(&mixed.transpose());
        hessian.fixed_view_mut::<3, 3>(3, 3).copy_from(&symmetric(&self.turn));
        let [fx, fy, fz] = self.force.map(|sum| -scale * sum.sum());
        let [tx, ty, tz] = self.torque.map(|sum| -scale * sum.sum());
        Score {
            value: self.value.sum() * shape.height,
            gradient: Vector6::new(fx, fy, fz, tx, ty, tz),
            hessian,
            hits: self.hits,
            likelihood: self.likelihood,
        }
    }
}

/// Cubes that a point is compared with.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Neighbours {
    /// The cube that contains the point.
    #[default]
    Direct1,
    /// That cube and the six that share a side with it.
    Direct7,
}
