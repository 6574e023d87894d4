//! Matrices, with products in a fixed order of summation.

use serde::{Deserialize, Serialize};

/// A matrix in row-major order.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Matrix {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) values: Vec<f32>,
}

/// Number of columns that are summed at once.
const BLOCK: usize = 16;

impl Matrix {
    /// Creates a matrix of these values; their number must match the shape.
    pub(crate) fn new(rows: usize, columns: usize, values: Vec<f32>) -> Self {
        debug_assert_eq!(values.len(), rows * columns);
        Self { rows, columns, values }
    }

    /// Creates a matrix of zeros.
    pub(crate) fn zeros(rows: usize, columns: usize) -> Self {
        Self::new(rows, columns, vec![0.0; rows * columns])
    }

    /// Row `k`.
    pub(crate) fn row(&self, k: usize) -> &[f32] {
        &self.values[k * self.columns..][..self.columns]
    }

    /// Row `k`, mutable.
    pub(crate) fn row_mut(&mut self, k: usize) -> &mut [f32] {
        &mut self.values[k * self.columns..][..self.columns]
    }

    /// Transposed matrix.
    pub(crate) fn transposed(&self) -> Self {
        let mut out = Self::zeros(self.columns, self.rows);
        for (k, row) in self.values.chunks_exact(self.columns.max(1)).enumerate() {
            for (j, value) in row.iter().enumerate() {
                out.values[j * self.rows + k] = *value;
            }
        }
        out
    }

    /// Applies a function to each element.
    pub(crate) fn map(&self, of: impl Fn(f32) -> f32) -> Self {
        Self::new(self.rows, self.columns, self.values.iter().map(|value| of(*value)).collect())
    }

    /// Combines two matrices element by element.
    pub(crate) fn zip(&self, other: &Self, of: impl Fn(f32, f32) -> f32) -> Self {
        debug_assert_eq!((self.rows, self.columns), (other.rows, other.columns));
        let values = self.values.iter().zip(&other.values).map(|(a, b)| of(*a, *b)).collect();
        Self::new(self.rows, self.columns, values)
    }

    /// Adds a matrix of the same shape.
    pub(crate) fn add(&mut self, other: &Self) {
        self.values.iter_mut().zip(&other.values).for_each(|(a, b)| *a += b);
    }

    /// Matrix product: each element is summed over `self`'s columns from first to last, on every machine.
    pub(crate) fn times(&self, other: &Self) -> Self {
        debug_assert_eq!(self.columns, other.rows);
        let mut out = Self::zeros(self.rows, other.columns);
        let whole = other.columns - other.columns % BLOCK;
        for from in (0..whole).step_by(BLOCK) {
            let mut k = 0;
            while k + 2 <= self.rows {
                block(&mut out, [self, other], k, from);
                k += 2;
            }
            if k < self.rows {
                edge(&mut out, [self, other], k, from..from + BLOCK);
            }
        }
        for k in 0..self.rows {
            edge(&mut out, [self, other], k, whole..other.columns);
        }
        out
    }
}

/// Product of two rows and a block of columns.
fn block(out: &mut Matrix, [a, b]: [&Matrix; 2], k: usize, from: usize) {
    let mut sums = [[0.0_f32; BLOCK]; 2];
    let (first, second) = (a.row(k), a.row(k + 1));
    for ((x, y), row) in first.iter().zip(second).zip(b.values.chunks_exact(b.columns)) {
        let row: &[f32; BLOCK] = row[from..from + BLOCK].try_into().expect("a block of columns");
        for j in 0..BLOCK {
            sums[0][j] += x * row[j];
            sums[1][j] += y * row[j];
        }
    }
    for (i, sums) in sums.iter().enumerate() {
        out.row_mut(k + i)[from..from + BLOCK].copy_from_slice(sums);
    }
}

/// Product of one row and a range of columns.
fn edge(out: &mut Matrix, [a, b]: [&Matrix; 2], k: usize, columns: core::ops::Range<usize>) {
    let to = &mut out.values[k * out.columns..][columns.clone()];
    for (x, row) in a.row(k).iter().zip(b.values.chunks_exact(b.columns)) {
        to.iter_mut().zip(&row[columns.clone()]).for_each(|(sum, value)| *sum += x * value);
    }
}
