//! Histograms of oriented gradients in 31 planes (Felzenszwalb and others, PAMI 2010): 18 signed and 9 unsigned
//! orientations, 4 energies. Cells have 4 x 4 pixels.

use swerve_geom::math;
use swerve_geom::simd::widest;

use crate::Plane;

/// Side of a cell, pixels.
pub(super) const CELL: usize = 4;
/// Values per cell; the last is 0.
pub(super) const PLANES: usize = 32;
/// Number of signed orientations.
const BINS: usize = 18;

/// Contributions of the pixels between four cell centres to those cells (top left, top right, bottom left, bottom
/// right), by orientation.
type Square = [[f32; 4]; BINS];

/// Magnitudes of a cell by orientation; zero beyond the 18 orientations.
type Histogram = [f32; PLANES];

/// Buffers for computing the histograms of patches.
#[derive(Clone, Debug)]
pub(super) struct Fhog {
    directions: [[f32; 2]; BINS / 2],
    /// Weights of each pixel of a square for the four cells.
    weights: [[[f32; 4]; CELL]; CELL],
    /// Magnitude and orientation of the pixels of a row.
    gradients: (Vec<f32>, Vec<u32>),
    squares: Vec<Square>,
    histograms: Vec<Histogram>,
    energies: Vec<f32>,
}

impl Fhog {
    pub(super) fn new() -> Self {
        let directions = std::array::from_fn(|at| {
            let (sin, cos) = math::sin_cos(std::f64::consts::PI * at as f64 / 9.0);
            [cos as f32, sin as f32]
        });
        let share = |at: usize| (at as f32 + 0.5) / CELL as f32;
        let weight = |x: usize, y: usize| {
            let ([left, right], [above, below]) = ([1.0 - share(x), share(x)], [1.0 - share(y), share(y)]);
            [left * above, right * above, left * below, right * below]
        };
        Self {
            directions,
            weights: std::array::from_fn(|y| std::array::from_fn(|x| weight(x, y))),
            gradients: Default::default(),
            squares: Vec::new(),
            histograms: Vec::new(),
            energies: Vec::new(),
        }
    }

    /// Passes each cell of a patch to `take`, with its column and row, except for the border cells.
    pub(super) fn cells(&mut self, patch: &Plane<f32>, mut take: impl FnMut(usize, usize, &[f32; PLANES])) {
        widest(
            #[inline(always)]
            || {
                let [columns, rows] = [patch.width() / CELL, patch.height() / CELL];
                self.fill(patch, columns);
                self.gather(columns, rows);
                let energy = |x: usize, y: usize| self.energies[y * columns + x];
                for y in 1..rows - 1 {
                    for x in 1..columns - 1 {
                        let norms = [(x - 1, y - 1), (x, y - 1), (x - 1, y), (x, y)].map(|(x, y)| {
                            let sum =
                                energy(x, y) + energy(x + 1, y) + energy(x, y + 1) + energy(x + 1, y + 1);
                            1.0 / (sum + 1e-4).sqrt()
                        });
                        take(x - 1, y - 1, &planes(&self.histograms[y * columns + x], norms));
                    }
                }
            },
        );
    }

    /// Sums the pixels of each square; the first square starts half a cell before the patch.
    #[inline(always)]
    fn fill(&mut self, patch: &Plane<f32>, columns: usize) {
        const HALF: usize = CELL / 2;
        let (width, height) = (patch.width(), patch.height());
        self.squares.clear();
        self.squares.resize((columns + 1) * (height / CELL + 1), [[0.0; 4]; BINS]);
        let (magnitudes, bins) = &mut self.gradients;
        magnitudes.resize(width - 2, 0.0);
        bins.resize(width - 2, 0);
        for y in 1..height - 1 {
            let across = patch.row(y)[2..].iter().zip(patch.row(y));
            let down = patch.row(y + 1)[1..].iter().zip(&patch.row(y - 1)[1..]);
            let found = magnitudes.iter_mut().zip(bins.iter_mut());
            for (((right, left), (below, above)), found) in across.zip(down).zip(found) {
                let (dx, dy) = (right - left, below - above);
                *found.0 = (dx * dx + dy * dy).sqrt();
                *found.1 = bin(&self.directions, dx, dy);
            }
            let weights = &self.weights[(y + HALF) % CELL];
            let squares = &mut self.squares[(y + HALF) / CELL * (columns + 1)..][..=columns];
            for (x, (&magnitude, &bin)) in (1 + HALF..).zip(magnitudes.iter().zip(&*bins)) {
                let sums = &mut squares[x / CELL][bin as usize % BINS];
                let weights = &weights[x % CELL];
                let [a, b, c, d] = weights.map(|weight| weight * magnitude);
                *sums = [sums[0] + a, sums[1] + b, sums[2] + c, sums[3] + d];
            }
        }
    }

    /// Combines the four squares around each cell centre into the cell's histogram.
    #[inline(always)]
    fn gather(&mut self, columns: usize, rows: usize) {
        self.histograms.resize(columns * rows, [0.0; PLANES]);
        self.energies.resize(columns * rows, 0.0);
        let cells = self.histograms.iter_mut().zip(&mut self.energies);
        for (at, (histogram, energy)) in cells.enumerate() {
            let first = at / columns * (columns + 1) + at % columns;
            let [a, b] = [&self.squares[first], &self.squares[first + 1]];
            let [c, d] = [&self.squares[first + columns + 1], &self.squares[first + columns + 2]];
            for bin in 0..BINS {
                histogram[bin] = (a[bin][3] + b[bin][2]) + (c[bin][1] + d[bin][0]);
            }
            *energy = 0.0;
            for at in 0..BINS / 2 {
                let both = histogram[at] + histogram[at + BINS / 2];
                *energy += both * both;
            }
        }
    }
}

/// Index of a gradient's direction, of 18.
#[inline(always)]
fn bin(directions: &[[f32; 2]; BINS / 2], dx: f32, dy: f32) -> u32 {
    let (mut best, mut found) = (0.0_f32, 0);
    for (at, [cos, sin]) in (0..).zip(directions) {
        let along = cos * dx + sin * dy;
        let better = along.abs() > best.abs();
        (best, found) = if better { (along, at) } else { (best, found) };
    }
    if best < 0.0 { found + BINS as u32 / 2 } else { found }
}

/// Values of a cell, normalised by the energies around its corners. Arrays are padded to whole vectors.
#[inline(always)]
fn planes(histogram: &Histogram, norms: [f32; 4]) -> [f32; PLANES] {
    const HALF: usize = BINS / 2;
    let cut = |value: f32| if value < 0.2 { value } else { 0.2 };
    let mut both = [0.0; 16];
    (0..16).for_each(|at| both[at] = histogram[at] + histogram[at + HALF]);
    let (mut signed, mut unsigned, mut planes) = ([0.0; 24], [0.0; 16], [0.0; PLANES]);
    for (norm, n) in norms.into_iter().zip(BINS + HALF..) {
        let mut parts = [0.0; 24];
        (0..24).for_each(|at| parts[at] = cut(histogram[at] * norm));
        (0..24).for_each(|at| signed[at] += parts[at]);
        (0..16).for_each(|at| unsigned[at] += cut(both[at] * norm));
        let mut sums = [0.0; 8];
        (0..8).for_each(|at| sums[at] = parts[at] + parts[at + 8] + parts[at + 16]);
        planes[n] = 0.2357 * sums.iter().sum::<f32>();
    }
    (0..BINS).for_each(|at| planes[at] = 0.5 * signed[at]);
    (0..HALF).for_each(|at| planes[BINS + at] = 0.5 * unsigned[at]);
    planes
}
