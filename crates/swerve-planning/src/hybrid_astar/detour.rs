//! Distance to the goal around the obstacles, for a point on a grid.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use swerve_geom::{Point2, math};

use crate::path::ground::{Ground, Outline};

/// Side of a cell, metres.
const CELL_M: f64 = 1.0;

/// Largest ratio of a path over the eight neighbours to the straight one: 1 / cos(22.5 degrees).
const OCTILE: f64 = 1.082_392_200_292_394;

/// Largest number of cells per side; beyond it the grid gives no estimate.
const SIDE_MAX: usize = 256;

#[derive(Clone, Copy, PartialEq, Debug)]
struct Open {
    length_m: f64,
    cell: usize,
}
impl Eq for Open {}
impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.length_m.total_cmp(&self.length_m).then(other.cell.cmp(&self.cell))
    }
}

/// Dijkstra's algorithm from the goal outwards, expanded on demand.
///
/// The moving body is the disc inscribed in the car around the planned point: where it does not fit, no pose of the car
/// does. Only for static obstacles. The estimate is a lower bound of that disc's path on the grid; as cells are
/// represented by their centres, it may exceed the true length by up to a cell's side.
#[derive(Clone, Debug, Default)]
pub(crate) struct Detour {
    x_m: f64,
    y_m: f64,
    nx: usize,
    ny: usize,
    length_m: Vec<f64>,
    closed: Vec<bool>,
    open: BinaryHeap<Open>,
}

impl Detour {
    /// Resets the search to start at `goal`; unless `wanted`, every estimate is zero.
    pub(crate) fn begin(&mut self, goal: Point2, bounds: [f64; 4], wanted: bool) {
        let side = |length: f64| (length / CELL_M).ceil() as usize + 1;
        (self.x_m, self.y_m) = (bounds[0], bounds[1]);
        (self.nx, self.ny) = (side(bounds[2] - bounds[0]), side(bounds[3] - bounds[1]));
        self.open.clear();
        self.length_m.clear();
        self.closed.clear();
        if !wanted || self.nx > SIDE_MAX || self.ny > SIDE_MAX {
            (self.nx, self.ny) = (0, 0);
            return;
        }
        self.length_m.resize(self.nx * self.ny, f64::INFINITY);
        self.closed.resize(self.nx * self.ny, false);
        self.open.reserve(8 * self.nx * self.ny);
        let cell = self.cell(goal);
        self.length_m[cell] = 0.0;
        self.open.push(Open { length_m: 0.0, cell });
    }

    /// Lower bound of the distance from `point` to the goal, metres; infinite if there is no path.
    pub(crate) fn length_m(&mut self, ground: &Ground<'_>, point: Point2) -> f64 {
        if self.nx == 0 {
            return 0.0;
        }
        let wanted = self.cell(point);
        while !self.closed[wanted] {
            let Some(Open { length_m, cell }) = self.open.pop() else { return f64::INFINITY };
            if self.closed[cell] {
                continue;
            }
            self.closed[cell] = true;
            self.reach(ground, cell, length_m);
        }
        // Both ends may be anywhere in their cells.
        (self.length_m[wanted] / OCTILE - 2.0 * CELL_M).max(0.0)
    }

    fn reach(&mut self, ground: &Ground<'_>, cell: usize, length_m: f64) {
        let (ix, iy) = (cell % self.nx, cell / self.nx);
        for dy in -1_i64..=1 {
            for dx in -1_i64..=1 {
                let (x, y) = (ix as i64 + dx, iy as i64 + dy);
                if (dx, dy) == (0, 0) || x < 0 || y < 0 || x >= self.nx as i64 || y >= self.ny as i64 {
                    continue;
                }
                let next = y as usize * self.nx + x as usize;
                let there_m = length_m + CELL_M * math::hypot(dx as f64, dy as f64);
                if there_m >= self.length_m[next] || !self.fits(ground, x, y) {
                    continue;
                }
                self.length_m[next] = there_m;
                self.open.push(Open { length_m: there_m, cell: next });
            }
        }
    }

    /// Returns true if the disc fits somewhere around a cell's centre, with a tolerance of half the cell's diagonal.
    fn fits(&self, ground: &Ground<'_>, x: i64, y: i64) -> bool {
        let center = Point2::new(self.x_m + x as f64 * CELL_M, self.y_m + y as f64 * CELL_M);
        let need_m = ground.outline.half_width_m + ground.clearance_m - 0.71 * CELL_M;
        let solid = Outline::POINT.at(center, [1.0, 0.0]);
        ground.obstacles.solid_free(&solid, ground.clock.start, need_m)
    }

    fn cell(&self, point: Point2) -> usize {
        let clamp = |v: f64, n: usize| (v / CELL_M).round().clamp(0.0, (n - 1) as f64) as usize;
        clamp(point.y_m - self.y_m, self.ny) * self.nx + clamp(point.x_m - self.x_m, self.nx)
    }
}
