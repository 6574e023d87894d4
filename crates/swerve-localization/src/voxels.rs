//! Map of normal distributions: number, mean and covariance of the points in each cube.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use crate::eigen;
use crate::grid::{Grid, Index};

/// Smallest number of points for which a cube has a surface.
pub const POINTS_MIN: u32 = 6;

/// Smallest eigenvalue of a covariance, as a share of the largest one.
const FLATNESS: f64 = 0.01;

/// Standard deviation, as a share of a cube's edge, above which it reflects the extent of the points rather than the
/// accuracy of the surface: along a wall through the whole cube it is 0.29.
const SPREAD: f64 = 0.2;

/// Sums over the points of a cube, relative to its centre.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: u32,
    sum: Vector3<f64>,
    squares: Matrix3<f64>,
}

/// Statistics of a cube, in single precision as in map files.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Voxel {
    /// Indices along x, y and z: the cube starts at this times the resolution.
    pub index: [i32; 3],
    /// Number of points.
    pub count: u32,
    /// Mean relative to the centre of the cube, metres.
    pub mean_m: [f32; 3],
    /// Covariance xx, xy, xz, yy, yz, zz, m².
    pub covariance_m2: [f32; 6],
}

/// Accumulates points for a map.
#[derive(Clone, Debug)]
pub struct VoxelSums {
    grid: Grid<Moments>,
}

impl VoxelSums {
    /// Creates an empty map with cubes of this size.
    pub fn new(resolution_m: f64) -> Self {
        Self { grid: Grid::new(resolution_m) }
    }

    /// Adds a point in map coordinates; points that are not finite are ignored.
    pub fn add(&mut self, at: &Vector3<f64>) {
        let Some(index) = self.grid.index(at.data.0[0]) else { return };
        let from_middle = at - self.grid.middle(index);
        let moments = self.grid.entry(index, Moments::default);
        moments.count = moments.count.saturating_add(1);
        moments.sum += from_middle;
        moments.squares += from_middle * from_middle.transpose();
    }

    /// Cubes with enough points, sorted by index.
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

/// Surface in a cube: mean in the map, and inverse of the covariance (xx, xy, xz, yy, yz, zz).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) mean: [f64; 3],
    pub(crate) inverse: [f64; 6],
}

/// A map for scan matching.
#[derive(Clone, Debug)]
pub struct VoxelMap {
    surfaces: Grid<Surface>,
    /// Inverse covariance of each surface without the directions in which the points only spread.
    known: Vec<[f64; 6]>,
}

impl VoxelMap {
    /// Creates a map from cubes of this size, from [`VoxelSums::voxels`] or a file.
    pub fn new<'a>(resolution_m: f64, voxels: impl IntoIterator<Item = &'a Voxel>) -> Self {
        let mut map = Self { surfaces: Grid::new(resolution_m), known: Vec::new() };
        voxels.into_iter().for_each(|voxel| map.add(voxel));
        map
    }

    /// Adds a cube unless it is present already or all of its points coincide.
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

    /// Creates a map from points.
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

    /// Returns true if there is no surface.
    pub fn is_empty(&self) -> bool {
        self.surfaces.cells().is_empty()
    }

    /// Columns along z with a surface, as indices along x and y.
    pub(crate) fn columns(&self) -> BTreeSet<[i32; 2]> {
        self.surfaces.cells().iter().map(|([x, y, _], _)| [*x, *y]).collect()
    }

    #[inline(always)]
    pub(crate) fn index(&self, at: [f64; 3]) -> Option<Index> {
        self.surfaces.index(at)
    }

    /// Index of the surface in a cube.
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

/// Merges cubes into cubes with edges `factor` times as long.
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

/// Inverse of a covariance with clamped eigenvalues, and its part along directions with a standard deviation below
/// `spread_m`; `None` if all points coincide.
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
