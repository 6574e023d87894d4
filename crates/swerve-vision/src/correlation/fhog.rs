//! Histograms of oriented gradients in 31 planes (Felzenszwalb and others, PAMI 2010): 18 signed and 9 unsigned
//! orientations, 4 energies. Cells are of 4 x 4 pixels.

use swerve_geom::math;

use crate::Plane;

/// Pixels of a cell's side.
pub(super) const CELL: usize = 4;
/// Numbers of a cell.
pub(super) const PLANES: usize = 31;

/// The memory for histograms of patches.
#[derive(Clone, Debug)]
pub(super) struct Fhog {
    directions: [[f32; 2]; 9],
    histograms: Vec<[f32; 18]>,
    energies: Vec<f32>,
}

impl Fhog {
    pub(super) fn new() -> Self {
        let directions = std::array::from_fn(|at| {
            let (sin, cos) = math::sin_cos(std::f64::consts::PI * at as f64 / 9.0);
            [cos as f32, sin as f32]
        });
        Self { directions, histograms: Vec::new(), energies: Vec::new() }
    }

    /// Gives each cell of a patch to `take`, with its column and row, but for those on the border.
    pub(super) fn cells(&mut self, patch: &Plane<f32>, mut take: impl FnMut(usize, usize, [f32; PLANES])) {
        let [columns, rows] = [patch.width() / CELL, patch.height() / CELL];
        self.fill(patch, columns, rows);
        let energy = |x: usize, y: usize| self.energies[y * columns + x];
        for y in 1..rows - 1 {
            for x in 1..columns - 1 {
                let norms = [(x - 1, y - 1), (x, y - 1), (x - 1, y), (x, y)].map(|(x, y)| {
                    let sum = energy(x, y) + energy(x + 1, y) + energy(x, y + 1) + energy(x + 1, y + 1);
                    1.0 / (sum + 1e-4).sqrt()
                });
                take(x - 1, y - 1, planes(&self.histograms[y * columns + x], norms));
            }
        }
    }

    fn fill(&mut self, patch: &Plane<f32>, columns: usize, rows: usize) {
        self.histograms.clear();
        self.histograms.resize(columns * rows, [0.0; 18]);
        for y in 1..patch.height() - 1 {
            for x in 1..patch.width() - 1 {
                let dx = patch.row(y)[x + 1] - patch.row(y)[x - 1];
                let dy = patch.row(y + 1)[x] - patch.row(y - 1)[x];
                let bin = self.bin(dx, dy);
                let magnitude = (dx * dx + dy * dy).sqrt();
                let place = |at: usize| (at as f32 + 0.5) / CELL as f32 - 0.5;
                let (px, py) = (place(x), place(y));
                let (fx, fy) = (px - px.floor(), py - py.floor());
                for (ix, wx) in [(px.floor(), 1.0 - fx), (px.floor() + 1.0, fx)] {
                    for (iy, wy) in [(py.floor(), 1.0 - fy), (py.floor() + 1.0, fy)] {
                        if ix >= 0.0 && iy >= 0.0 && (ix as usize) < columns && (iy as usize) < rows {
                            self.histograms[iy as usize * columns + ix as usize][bin] += wx * wy * magnitude;
                        }
                    }
                }
            }
        }
        self.energies.clear();
        self.energies.extend(
            self.histograms
                .iter()
                .map(|h| (0..9).map(|at| (h[at] + h[at + 9]) * (h[at] + h[at + 9])).sum::<f32>()),
        );
    }

    /// Which of 18 directions a gradient has.
    fn bin(&self, dx: f32, dy: f32) -> usize {
        let (mut best, mut found) = (0.0, 0);
        for (at, [cos, sin]) in self.directions.iter().enumerate() {
            let along = cos * dx + sin * dy;
            if along.abs() > best {
                (best, found) = (along.abs(), if along > 0.0 { at } else { at + 9 });
            }
        }
        found
    }
}

fn planes(histogram: &[f32; 18], norms: [f32; 4]) -> [f32; PLANES] {
    let mut planes = [0.0; PLANES];
    for (at, value) in histogram.iter().enumerate() {
        for (norm, n) in norms.iter().zip(27..) {
            let part = (value * norm).min(0.2);
            planes[at] += 0.5 * part;
            planes[n] += 0.2357 * part;
        }
    }
    for at in 0..9 {
        let value = histogram[at] + histogram[at + 9];
        planes[18 + at] = norms.iter().map(|norm| 0.5 * (value * norm).min(0.2)).sum();
    }
    planes
}
