//! Grid over the bounding boxes of lanes.

use swerve_geom::Point2;

use super::Bounds;

/// Smallest edge of a cell, metres.
const CELL_M: f64 = 16.0;
/// Most cells along each axis, and most entries of lanes in cells, per lane; above, cells grow. Bounds the memory of maps
/// that are large and sparse.
const CELLS_MAX: f64 = 256.0;
const PER_LANE: usize = 64;

/// Lanes whose bounding boxes reach into each cell.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Cells {
    low: Point2,
    cell_m: f64,
    columns: usize,
    /// Indices of lanes, row by row, each cell in order.
    lanes: Vec<Vec<u32>>,
}

impl Cells {
    pub(super) fn new(bounds: &[Bounds]) -> Self {
        let low = |of: fn(&Bounds) -> f64| bounds.iter().map(of).fold(f64::INFINITY, f64::min);
        let high = |of: fn(&Bounds) -> f64| bounds.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let from = Point2::new(low(|b| b.low.x_m), low(|b| b.low.y_m));
        let [x_m, y_m] = [high(|b| b.high.x_m) - from.x_m, high(|b| b.high.y_m) - from.y_m];
        let mut cell_m = CELL_M.max(x_m / CELLS_MAX).max(y_m / CELLS_MAX);
        let count = |extent_m: f64, cell_m: f64| (extent_m / cell_m).max(0.0) as usize + 1;
        let entries = |cell_m: f64| -> usize {
            let of = |b: &Bounds| {
                let [x_m, y_m] = [b.high.x_m - b.low.x_m, b.high.y_m - b.low.y_m];
                (count(x_m, cell_m) + 1) * (count(y_m, cell_m) + 1)
            };
            bounds.iter().map(of).sum()
        };
        while entries(cell_m) > PER_LANE * bounds.len() && cell_m < x_m.max(y_m) {
            cell_m *= 2.0;
        }
        let (columns, rows) = (count(x_m, cell_m), count(y_m, cell_m));
        let mut cells = Self { low: from, cell_m, columns, lanes: vec![Vec::new(); columns * rows] };
        for (k, one) in (0..).zip(bounds) {
            let (Some(first), Some(last)) = (cells.place(one.low), cells.place(one.high)) else { continue };
            for row in first[1]..=last[1] {
                for column in first[0]..=last[0] {
                    cells.lanes[row * columns + column].push(k);
                }
            }
        }
        cells
    }

    /// Indices of the lanes that may contain a point, in order.
    pub(super) fn at(&self, point: Point2) -> &[u32] {
        self.place(point).map_or(&[], |[column, row]| &self.lanes[row * self.columns + column])
    }

    /// Column and row of a point on the grid.
    fn place(&self, point: Point2) -> Option<[usize; 2]> {
        let [x, y] = [point.x_m - self.low.x_m, point.y_m - self.low.y_m].map(|m| m / self.cell_m);
        let rows = self.lanes.len() / self.columns;
        let is_on = x >= 0.0 && y >= 0.0 && (x as usize) < self.columns && (y as usize) < rows;
        is_on.then_some([x as usize, y as usize])
    }
}
