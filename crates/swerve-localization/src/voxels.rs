//! A map of normal distributions: of each cube of space how many points are in it, their mean and their covariance.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use crate::eigen;
use crate::grid::{Grid, Index};

/// A cube with fewer points says nothing of the surface in it.
pub const POINTS_MIN: u32 = 6;

/// An eigenvalue of a covariance is at least this share of the largest one.
const FLATNESS: f64 = 0.01;

/// A deviation above this share of a cube's edge is how far its points spread, not how well the surface is known: those of
/// a wall through the whole cube have 0.29 along it.
const SPREAD: f64 = 0.2;

/// Sums over the points of a cube, from its middle.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: u32,
    sum: Vector3<f64>,
    squares: Matrix3<f64>,
}

/// What is known of a cube. Numbers of single precision, as a file of the map has them.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Voxel {
    /// Which along x, y and z: it begins at this times the resolution.
    pub index: [i32; 3],
    /// Points.
    pub count: u32,
    /// Their mean from the middle of the cube, metres.
    pub mean_m: [f32; 3],
    /// Their covariance xx, xy, xz, yy, yz, zz, m².
    pub covariance_m2: [f32; 6],
}

/// Points on their way to a map.
#[derive(Clone, Debug)]
pub struct VoxelSums {
    grid: Grid<Moments>,
}

impl VoxelSums {
    /// Without a point, with cubes of this size.
    pub fn new(resolution_m: f64) -> Self {
        Self { grid: Grid::new(resolution_m) }
    }

    /// Adds a point of the map; what is no number is none.
    pub fn add(&mut self, at: &Vector3<f64>) {
        let Some(index) = self.grid.index(at.data.0[0]) else { return };
        let from_middle = at - self.grid.middle(index);
        let moments = self.grid.entry(index, Moments::default);
        moments.count = moments.count.saturating_add(1);
        moments.sum += from_middle;
        moments.squares += from_middle * from_middle.transpose();
    }

    /// The cubes that have enough points, in the order of their indices.
    pub fn voxels(&self) -> Vec<Voxel> {
        let enough = self.grid.cells().iter().filter(|(_, moments)| moments.count >= POINTS_MIN);
        let mut voxels: Vec<_> = enough.map(|(index, moments)| voxel(*index, moments)).collect();
        voxels.sort_unstable_by_key(|voxel| voxel.index);
        voxels
    }
}

fn voxel(index: Index, moments: &Moments) -> Voxel {
    let count = f64::from(moments.count);
    let mean = moments.sum / count;
    let c = (moments.squares - mean * mean.transpose() * count) / (count - 1.0);
    let covariance = [c[(0, 0)], c[(0, 1)], c[(0, 2)], c[(1, 1)], c[(1, 2)], c[(2, 2)]];
    Voxel {
        index,
        count: moments.count,
        mean_m: mean.data.0[0].map(|x| x as f32),
        covariance_m2: covariance.map(|x| x as f32),
    }
}

/// The surface in a cube: its mean in the map, and the inverse of its covariance (xx, xy, xz, yy, yz, zz).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) mean: [f64; 3],
    pub(crate) inverse: [f64; 6],
}

/// A map to match scans with.
#[derive(Clone, Debug)]
pub struct VoxelMap {
    surfaces: Grid<Surface>,
    /// Of each the inverse without directions in which the points only spread.
    known: Vec<[f64; 6]>,
}

impl VoxelMap {
    /// Of cubes of this size, as [`VoxelSums::voxels`] tells them or a file does.
    pub fn new<'a>(resolution_m: f64, voxels: impl IntoIterator<Item = &'a Voxel>) -> Self {
        let mut map = Self { surfaces: Grid::new(resolution_m), known: Vec::new() };
        voxels.into_iter().for_each(|voxel| map.add(voxel));
        map
    }

    /// Adds a cube that is not there yet; not one whose points are all one.
    fn add(&mut self, voxel: &Voxel) {
        let middle = self.surfaces.middle(voxel.index);
        let mean = (middle + Vector3::from(voxel.mean_m.map(f64::from))).data.0[0];
        let covariance = voxel.covariance_m2.map(f64::from);
        let Some([inverse, known]) = inverses(covariance, SPREAD * self.resolution_m()) else { return };
        if mean.iter().all(|x| x.is_finite()) && self.surfaces.place(voxel.index).is_none() {
            self.surfaces.entry(voxel.index, || Surface { mean, inverse });
            self.known.push(known);
        }
    }

    /// Of points.
    pub fn of_points<'a>(resolution_m: f64, points: impl IntoIterator<Item = &'a Vector3<f64>>) -> Self {
        let mut sums = VoxelSums::new(resolution_m);
        points.into_iter().for_each(|point| sums.add(point));
        Self::new(resolution_m, &sums.voxels())
    }

    /// Edge of a cube, metres.
    pub fn resolution_m(&self) -> f64 {
        self.surfaces.size_m()
    }

    /// Number of cubes with a surface.
    pub fn len(&self) -> usize {
        self.surfaces.cells().len()
    }

    /// Whether there is nothing to match with.
    pub fn is_empty(&self) -> bool {
        self.surfaces.cells().is_empty()
    }

    /// Columns along z in which there is a surface, as indices along x and y.
    pub(crate) fn columns(&self) -> BTreeSet<[i32; 2]> {
        self.surfaces.cells().iter().map(|([x, y, _], _)| [*x, *y]).collect()
    }

    #[inline(always)]
    pub(crate) fn index(&self, at: [f64; 3]) -> Option<Index> {
        self.surfaces.index(at)
    }

    /// Which surface a cube has.
    #[inline(always)]
    pub(crate) fn surface(&self, index: Index) -> Option<usize> {
        self.surfaces.place(index)
    }

    #[inline(always)]
    pub(crate) fn at(&self, which: usize) -> &Surface {
        &self.surfaces.cells()[which].1
    }

    #[inline(always)]
    pub(crate) fn known(&self, which: usize) -> &[f64; 6] {
        &self.known[which]
    }
}

/// Cubes `factor` times as long, of those of a finer map.
pub fn coarser(voxels: &[Voxel], resolution_m: f64, factor: i32) -> Vec<Voxel> {
    let (fine, mut grid) =
        (Grid::<()>::new(resolution_m), Grid::<Moments>::new(resolution_m * f64::from(factor)));
    for voxel in voxels {
        let index = voxel.index.map(|i| i.div_euclid(factor));
        let mean = fine.middle(voxel.index) + Vector3::from(voxel.mean_m.map(f64::from)) - grid.middle(index);
        let count = f64::from(voxel.count);
        let [xx, xy, xz, yy, yz, zz] = voxel.covariance_m2.map(f64::from);
        let covariance = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let moments = grid.entry(index, Moments::default);
        moments.count = moments.count.saturating_add(voxel.count);
        moments.sum += mean * count;
        moments.squares += covariance * (count - 1.0) + mean * mean.transpose() * count;
    }
    VoxelSums { grid }.voxels()
}

/// The inverse of a covariance whose eigenvalues are clamped, and what of it is of directions with less than a deviation;
/// none where all points are one.
fn inverses([xx, xy, xz, yy, yz, zz]: [f64; 6], spread_m: f64) -> Option<[[f64; 6]; 2]> {
    let (values, vectors) = eigen::symmetric(&Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz));
    let largest = values[0].max(values[1]).max(values[2]);
    if !(largest > 1e-8 && largest.is_finite()) {
        return None;
    }
    let all = values.map(|value| 1.0 / value.max(FLATNESS * largest));
    let known = all.map(|x| if x * spread_m * spread_m > 1.0 { x } else { 0.0 });
    Some([all, known].map(|values| {
        let i = eigen::composed(&values, &vectors);
        [i[(0, 0)], i[(0, 1)], i[(0, 2)], i[(1, 1)], i[(1, 2)], i[(2, 2)]]
    }))
}
