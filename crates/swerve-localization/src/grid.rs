//! A grid of cubes over space in which only those that hold something have a place.
//!
//! Cubes are found by a hash of their indices, and are never walked through in its order: they stand in the order in which
//! they were first met, or in that of their indices.

use nalgebra::Vector3;

/// Indices of a cube along x, y and z.
pub(crate) type Index = [i32; 3];

/// Largest index: cubes of 1 cm reach as far as coordinates anywhere on Earth (UTM's northings are below 10,000 km), and an
/// index beside it still fits its type.
pub(crate) const REACH: i32 = (1 << 30) - 1;

/// Content of the cubes that have one.
#[derive(Clone, Debug)]
pub(crate) struct Grid<T> {
    size_m: f64,
    per_m: f64,
    cells: Vec<(Index, T)>,
    /// Places in `cells` plus 1, 0 for none; its length is a power of two.
    table: Vec<u32>,
}

impl<T> Grid<T> {
    pub(crate) fn new(size_m: f64) -> Self {
        Self { size_m, per_m: 1.0 / size_m, cells: Vec::new(), table: vec![0; 1024] }
    }

    pub(crate) fn size_m(&self) -> f64 {
        self.size_m
    }

    /// The cube of a point; none of one that is no number or too far away.
    #[inline(always)]
    pub(crate) fn index(&self, at: [f64; 3]) -> Option<Index> {
        let [x, y, z] = [at[0] * self.per_m, at[1] * self.per_m, at[2] * self.per_m];
        let reach = f64::from(REACH);
        let is_within = x.abs() < reach && y.abs() < reach && z.abs() < reach;
        is_within.then(|| [floor(x), floor(y), floor(z)])
    }

    /// The middle of a cube.
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

    /// What a cube holds.
    pub(crate) fn get(&self, index: Index) -> Option<&T> {
        Some(&self.cells[self.place(index)?].1)
    }

    /// Where a cube that holds something stands in [`cells`](Self::cells).
    #[inline(always)]
    pub(crate) fn place(&self, index: Index) -> Option<usize> {
        (self.table[self.slot(index)] as usize).checked_sub(1)
    }

    /// What a cube holds, made now where it held nothing.
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

    /// Those that hold something, in the order in which they were met.
    pub(crate) fn cells(&self) -> &[(Index, T)] {
        &self.cells
    }

    /// Keeps those that are wanted.
    pub(crate) fn retain(&mut self, mut wanted: impl FnMut(Index, &T) -> bool) {
        let before = self.cells.len();
        self.cells.retain(|(index, what)| wanted(*index, what));
        if self.cells.len() != before {
            self.rehash(self.table.len());
        }
    }
}

/// The whole number below, of one that an `i32` holds.
#[inline(always)]
fn floor(x: f64) -> i32 {
    let towards_0 = x as i32;
    towards_0 - i32::from(f64::from(towards_0) > x)
}

/// Points with at most one in each cube of `size_m`: the mean of those that are in it. Points that are no numbers are none.
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
