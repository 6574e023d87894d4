//! Smoothing and resampling of planes.

use swerve_geom::simd::widest;

/// Maps index `k` into `0..n` by repeated mirroring at the borders.
fn mirrored(k: isize, n: usize) -> usize {
    let period = 2 * n as isize;
    let k = k.rem_euclid(period);
    (if k < n as isize { k } else { period - 1 - k }) as usize
}

/// Triangle filter coefficient: 1, 2, ..., R + 1, ..., 2, 1 over their sum.
fn triangle<const R: usize>(tap: usize) -> f32 {
    let weight = R + 1 - tap.abs_diff(R);
    weight as f32 / ((R + 1) * (R + 1)) as f32
}

/// Smooths a plane with a triangle filter of radius `R` pixels, mirrored at the borders; `row` is scratch.
pub fn smooth<const R: usize>(from: &[f32], width: usize, into: &mut [f32], row: &mut Vec<f32>) {
    row.resize(width + 2 * R, 0.0);
    widest(
        #[inline(always)]
        || smooth_rows::<R>(from, width, into, row),
    );
}

#[inline(always)]
fn smooth_rows<const R: usize>(from: &[f32], width: usize, into: &mut [f32], row: &mut [f32]) {
    let height = from.len().checked_div(width).unwrap_or(0);
    for (y, out) in into.chunks_exact_mut(width.max(1)).enumerate() {
        let near = |tap: usize| &from[mirrored((y + tap) as isize - R as isize, height) * width..][..width];
        let inner = &mut row[R..R + width];
        inner.iter_mut().zip(near(R)).for_each(|(sum, value)| *sum = value * triangle::<R>(R));
        for k in 0..R {
            let weight = triangle::<R>(k);
            for ((sum, a), b) in inner.iter_mut().zip(near(k)).zip(near(2 * R - k)) {
                *sum += (a + b) * weight;
            }
        }
        for k in 0..R {
            row[R - 1 - k] = row[R + mirrored(-1 - k as isize, width)];
            row[R + width + k] = row[R + mirrored((width + k) as isize, width)];
        }
        along::<R>(row, out);
    }
}

/// Smooths one row, which is padded by `R` values at each end.
#[inline(always)]
fn along<const R: usize>(row: &[f32], out: &mut [f32]) {
    let width = out.len();
    let middle = &row[R..R + width];
    out.iter_mut().zip(middle).for_each(|(sum, value)| *sum = value * triangle::<R>(R));
    for k in 0..R {
        let weight = triangle::<R>(k);
        for ((sum, a), b) in out.iter_mut().zip(&row[k..k + width]).zip(&row[2 * R - k..2 * R - k + width]) {
            *sum += (a + b) * weight;
        }
    }
}

/// Halves a plane by averaging squares of 2 x 2; an odd last row or column is dropped.
pub fn halve(from: &[f32], width: usize, into: &mut [f32]) {
    let rows = from.chunks_exact(2 * width.max(1)).zip(into.chunks_exact_mut((width / 2).max(1)));
    widest(
        #[inline(always)]
        || {
            for (rows, out) in rows {
                let (upper, lower) = rows.split_at(width);
                for ((out, a), b) in out.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
                    *out = (a[0] + a[1] + b[0] + b[1]) * 0.25;
                }
            }
        },
    );
}

/// Bilinear resampler for planes of one size.
#[derive(Clone, Debug, Default)]
pub struct Resampler {
    from: [usize; 2],
    into: [usize; 2],
    /// Left pixel of each column, and the weight of the right one.
    columns: Vec<(u32, f32)>,
    row: Vec<f32>,
}

impl Resampler {
    /// Sets the sizes (width and height) before and after resampling; does nothing if they are unchanged.
    pub fn set(&mut self, from: [usize; 2], into: [usize; 2]) {
        if (self.from, self.into) != (from, into) {
            (self.from, self.into) = (from, into);
            self.columns.clear();
            self.columns.extend((0..into[0]).map(|x| nearest(x, into[0], from[0])));
        }
    }

    /// Resamples a plane and multiplies it by `gain`.
    pub fn plane(&mut self, from: &[f32], gain: f32, into: &mut [f32]) {
        let [width, height] = self.from;
        if width == 0 || height == 0 {
            return;
        }
        if self.from == self.into {
            into.iter_mut().zip(from).for_each(|(out, value)| *out = value * gain);
            return;
        }
        // One extra value, so that the last column has a right neighbour.
        self.row.resize(width + 1, 0.0);
        widest(
            #[inline(always)]
            || self.lines(from, gain, into),
        );
    }

    #[inline(always)]
    fn lines(&mut self, from: &[f32], gain: f32, into: &mut [f32]) {
        let ([width, height], [columns, lines]) = (self.from, self.into);
        for (y, out) in into.chunks_exact_mut(columns.max(1)).enumerate() {
            let (above, share) = nearest(y, lines, height);
            let below = (above as usize + 1).min(height - 1);
            let (above, below) = (&from[above as usize * width..][..width], &from[below * width..][..width]);
            for ((value, a), b) in self.row.iter_mut().zip(above).zip(below) {
                *value = (a + (b - a) * share) * gain;
            }
            self.row[width] = self.row[width - 1];
            for (out, &(left, share)) in out.iter_mut().zip(&self.columns) {
                let pair = &self.row[left as usize..][..2];
                *out = pair[0] + (pair[1] - pair[0]) * share;
            }
        }
    }
}

/// First of the two source pixels (of `n`) around the centre of pixel `k` (of `of`), and the weight of the second.
fn nearest(k: usize, of: usize, n: usize) -> (u32, f32) {
    let at = ((k as f32 + 0.5) * (n as f32 / of as f32) - 0.5).clamp(0.0, n.saturating_sub(1) as f32);
    let first = at as u32;
    (first, at - first as f32)
}
