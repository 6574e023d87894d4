//! Spatial index of nodes: a grid of lists in two arrays.

use swerve_geom::Point2;

const NONE: u32 = u32::MAX;

/// Largest number of cells: the cell side grows if an area would need more.
const CELLS_MAX: f64 = 16_384.0;

/// Spatial index of points in insertion order; positions and distances in metres.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    x_m: f64,
    y_m: f64,
    side_m: f64,
    nx: i64,
    ny: i64,
    /// Latest point of each cell.
    first: Vec<u32>,
    /// Previous point of the same cell.
    before: Vec<u32>,
    points: Vec<Point2>,
    /// Range of cells that contain points, inclusive: x, y, x, y.
    used: [i64; 4],
}

impl Grid {
    /// Removes all points. Cells have about the given side; points outside `bounds` belong to the cells at its edge.
    pub fn begin(&mut self, bounds: [f64; 4], side_m: f64, points_max: usize) {
        let (width_m, height_m) = ((bounds[2] - bounds[0]).max(1e-3), (bounds[3] - bounds[1]).max(1e-3));
        self.side_m = side_m.clamp(0.25, 4.0).max((width_m * height_m / CELLS_MAX).sqrt());
        (self.x_m, self.y_m) = (bounds[0], bounds[1]);
        let count = |length_m: f64| (length_m / self.side_m).ceil().clamp(1.0, CELLS_MAX) as i64;
        (self.nx, self.ny) = (count(width_m), count(height_m));
        self.first.clear();
        self.first.resize((self.nx * self.ny) as usize, NONE);
        self.before.clear();
        self.before.reserve(points_max);
        self.points.clear();
        self.points.reserve(points_max);
        self.used = [i64::MAX, i64::MAX, i64::MIN, i64::MIN];
    }

    fn cell(&self, point: Point2) -> (i64, i64) {
        let clamp = |v: f64, n: i64| ((v / self.side_m).floor() as i64).clamp(0, n - 1);
        (clamp(point.x_m - self.x_m, self.nx), clamp(point.y_m - self.y_m, self.ny))
    }

    /// Adds a point; its index is the number of points before it.
    pub fn push(&mut self, point: Point2) {
        let (ix, iy) = self.cell(point);
        let cell = &mut self.first[(iy * self.nx + ix) as usize];
        self.before.push(*cell);
        *cell = self.points.len() as u32;
        self.points.push(point);
        let u = self.used;
        self.used = [u[0].min(ix), u[1].min(iy), u[2].max(ix), u[3].max(iy)];
    }

    fn each_in(&self, ix: i64, iy: i64, mut visit: impl FnMut(u32, Point2)) {
        if ix < 0 || iy < 0 || ix >= self.nx || iy >= self.ny {
            return;
        }
        let mut at = self.first[(iy * self.nx + ix) as usize];
        while at != NONE {
            visit(at, self.points[at as usize]);
            at = self.before[at as usize];
        }
    }

    /// The nearest point, of equals the oldest. Requires at least one point.
    pub fn nearest(&self, to: Point2) -> u32 {
        let (cx, cy) = self.cell(to);
        let [x0, y0, x1, y1] = self.used;
        let mut best = (f64::INFINITY, NONE);
        // Rings of cells around the one that contains `to`, from the first that meets a used cell.
        let first = (x0 - cx).max(cx - x1).max(y0 - cy).max(cy - y1).max(0);
        for ring in first..=self.nx.max(self.ny) {
            // Lower bound on distances in this ring and further out.
            let beyond_m = (ring - 1).max(0) as f64 * self.side_m;
            if best.0 < beyond_m * beyond_m {
                break;
            }
            let mut look = |ix: i64, iy: i64| {
                self.each_in(ix, iy, |node, point| {
                    let squared = (point - to).norm_squared();
                    if (squared, node) < best {
                        best = (squared, node);
                    }
                });
            };
            let (left, right) = ((cx - ring).max(x0), (cx + ring).min(x1));
            let (low, high) = ((cy - ring + 1).max(y0), (cy + ring - 1).min(y1));
            for iy in [cy - ring, cy + ring] {
                if y0 <= iy && iy <= y1 && (ring > 0 || iy == cy) {
                    (left..=right).for_each(|ix| look(ix, iy));
                }
            }
            for ix in [cx - ring, cx + ring] {
                if x0 <= ix && ix <= x1 {
                    (low..=high).for_each(|iy| look(ix, iy));
                }
            }
        }
        best.1
    }

    /// Calls `visit` with every point within `radius_m`.
    pub fn within(&self, of: Point2, radius_m: f64, mut visit: impl FnMut(u32)) {
        let low = self.cell(Point2::new(of.x_m - radius_m, of.y_m - radius_m));
        let high = self.cell(Point2::new(of.x_m + radius_m, of.y_m + radius_m));
        for iy in low.1..=high.1 {
            for ix in low.0..=high.0 {
                self.each_in(ix, iy, |node, point| {
                    if (point - of).norm_squared() <= radius_m * radius_m {
                        visit(node);
                    }
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_core::Rng;

    #[test]
    fn grid_queries_match_exhaustive_search() {
        let mut rng = Rng::keyed(5, "grid", &[]);
        let mut grid = Grid::default();
        grid.begin([-10.0, -3.0, 40.0, 5.0], 0.7, 500);
        let mut points: Vec<Point2> = Vec::new();
        for k in 0..500 {
            // Some points are outside the bounds.
            let point = Point2::new(rng.uniform(-15.0, 45.0), rng.uniform(-5.0, 7.0));
            grid.push(point);
            points.push(point);
            let to = Point2::new(rng.uniform(-12.0, 42.0), rng.uniform(-5.0, 7.0));
            let nearest = (0..=k).min_by(|&a, &b| {
                let (a, b): (Point2, Point2) = (points[a], points[b]);
                a.distance(to).total_cmp(&b.distance(to))
            });
            let found = grid.nearest(to) as usize;
            let expected = points[nearest.unwrap()].distance(to);
            assert!((points[found].distance(to) - expected).abs() < 1e-12, "{to:?}");
            let mut within = vec![];
            grid.within(to, 2.0, |node| within.push(node as usize));
            within.sort_unstable();
            let all: Vec<usize> = (0..=k).filter(|&i| points[i].distance(to) <= 2.0).collect();
            assert_eq!(within, all);
        }
    }
}
