//! Sparse grid of cubes.
//!
//! Cubes are found by a hash of their indices but never iterated in hash order: they are stored in the order of
//! insertion, or sorted by index.

use nalgebra::Vector3;

/// Cube indices along x, y and z.
pub(crate) type Index = [i32; 3];

/// Largest index: cubes of 1 cm cover coordinates anywhere on Earth (UTM northings are below 10,000 km), and indices
/// of neighbours still fit the type.
pub(crate) const REACH: i32 = (1 << 30) - 1;

/// Sparse grid: content of the occupied cubes.
#[derive(Clone, Debug)]
pub(crate) struct Grid<T> {
    size_m: f64,
    per_m: f64,
    cells: Vec<(Index, T)>,
    /// Indices into `cells` plus 1, 0 for empty slots; the length is a power of two.
    table: Vec<u32>,
}

impl<T> Grid<T> {
    pub(crate) fn new(size_m: f64) -> Self {
        Self { size_m, per_m: 1.0 / size_m, cells: Vec::new(), table: vec![0; 1024] }
    }

    pub(crate) fn size_m(&self) -> f64 {
        self.size_m
    }

    /// Cube of a point; `None` if the point is not finite or too far away.
    #[inline(always)]
    pub(crate) fn index(&self, at: [f64; 3]) -> Option<Index> {
        let [x, y, z] = [at[0] * self.per_m, at[1] * self.per_m, at[2] * self.per_m];
        let reach = f64::from(REACH);
        let is_within = x.abs() < reach && y.abs() < reach && z.abs() < reach;
        is_within.then(|| [floor(x), floor(y), floor(z)])
    }

    /// Centre of a cube.
    pub(crate) fn middle(&self, index: Index) -> Vector3<f64> {
        Vector3::from(index.map(|i| (f64::from(i) + 0.5) * self.size_m))
    }

    #[inline(always)]
    fn slot(&self, index: Index) -> usize {
        let word = |i: i32| u64::from(i as u32);
        let [x, y, z] = [word(index[0]), word(index[1]), word(index[2])];
        let hash = (x ^ y << 21 ^ z << 42).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mask = self.table.len() - 1;
        let mut slot = (hash >> 32) as usize & mask;
        while let Some(place) = (self.table[slot] as usize).checked_sub(1) {
            if self.cells[place].0 == index {
                break;
            }
            slot = (slot + 1) & mask;
        }
        slot
    }

    /// Content of a cube.
    pub(crate) fn get(&self, index: Index) -> Option<&T> {
        Some(&self.cells[self.place(index)?].1)
    }

    /// Index of an occupied cube in [`cells`](Self::cells).
    #[inline(always)]
    pub(crate) fn place(&self, index: Index) -> Option<usize> {
        (self.table[self.slot(index)] as usize).checked_sub(1)
    }

    /// Content of a cube, created if the cube was empty.
    pub(crate) fn entry(&mut self, index: Index, make: impl FnOnce() -> T) -> &mut T {
        let mut slot = self.slot(index);
        if self.table[slot] == 0 {
            if 2 * self.cells.len() >= self.table.len() {
                self.rehash(2 * self.table.len());
                slot = self.slot(index);
            }
            self.cells.push((index, make()));
            self.table[slot] = self.cells.len() as u32;
        }
        let place = self.table[slot] as usize - 1;
        &mut self.cells[place].1
    }

    fn rehash(&mut self, len: usize) {
        self.table = vec![0; len];
        for place in 0..self.cells.len() {
            let slot = self.slot(self.cells[place].0);
            self.table[slot] = place as u32 + 1;
        }
    }

    /// Occupied cubes, in the order of insertion.
    pub(crate) fn cells(&self) -> &[(Index, T)] {
        &self.cells
    }

    /// Keeps only the cubes for which `wanted` returns true.
    pub(crate) fn retain(&mut self, mut wanted: impl FnMut(Index, &T) -> bool) {
        let before = self.cells.len();
        self.cells.retain(|(index, what)| wanted(*index, what));
        if self.cells.len() != before {
            self.rehash(self.table.len());
        }
    }
}

/// Floor of a number within the range of `i32`.
#[inline(always)]
fn floor(x: f64) -> i32 {
    let towards_0 = x as i32;
    towards_0 - i32::from(f64::from(towards_0) > x)
}

/// Downsamples a cloud to at most one point per cube of edge `size_m`: the mean of the points in it. Points that are
/// not finite are dropped.
pub fn downsampled(points: &[Vector3<f64>], size_m: f64) -> Vec<Vector3<f64>> {
    let mut grid = Grid::<(Vector3<f64>, f64)>::new(size_m);
    for point in points {
        let Some(index) = grid.index(point.data.0[0]) else { continue };
        let (sum, count) = grid.entry(index, || (Vector3::zeros(), 0.0));
        *sum += point;
        *count += 1.0;
    }
    grid.cells().iter().map(|(_, (sum, count))| sum / *count).collect()
}
