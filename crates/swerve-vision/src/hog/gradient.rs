//! Image gradients, split between the nearest two of nine orientations.

use swerve_geom::simd::widest;

use crate::channels::{orientation, select};

pub(super) const BINS: usize = 9;

/// Padding of the image on each side, pixels, mirrored at the border pixels.
pub(super) const PADDING_PX: usize = 8;

/// Gradients of an image, padded.
#[derive(Clone, Debug, Default)]
pub(super) struct Gradients {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Lower of the two orientation bins of each pixel.
    pub(super) bins: Vec<u8>,
    /// Shares of the gradient magnitude in the lower bin and the next one.
    pub(super) shares: [Vec<f32>; 2],
    roots: Roots,
    horizontal: Vec<f32>,
    vertical: Vec<f32>,
    /// Square roots of three rows, padded by one more pixel on each side.
    rows: [Vec<f32>; 3],
}

/// Square root of each byte value.
#[derive(Clone, Debug)]
struct Roots([f32; 256]);

impl Default for Roots {
    fn default() -> Self {
        Self(core::array::from_fn(|k| (k as f32).sqrt()))
    }
}

/// Maps index `k` into `0..n` by mirroring at the first and last pixel.
fn mirrored(k: isize, n: usize) -> usize {
    let last = n as isize - 1;
    if last == 0 {
        return 0;
    }
    let k = k.rem_euclid(2 * last);
    k.min(2 * last - k) as usize
}

impl Gradients {
    /// Computes the gradients of an image of this width and height, three bytes per pixel.
    pub(super) fn compute(&mut self, rgb: &[u8], [width, height]: [usize; 2]) {
        (self.width, self.height) = (width + 2 * PADDING_PX, height + 2 * PADDING_PX);
        self.bins.resize(self.width * self.height, 0);
        self.shares.iter_mut().for_each(|shares| shares.resize(self.width * self.height, 0.0));
        self.horizontal.resize(self.width, 0.0);
        self.vertical.resize(self.width, 0.0);
        for y in 0..self.height {
            let source = |dy: isize| mirrored(y as isize + dy - PADDING_PX as isize, height);
            if y == 0 {
                self.roots(rgb, width, source(-1), 0);
                self.roots(rgb, width, source(0), 1);
            } else {
                self.rows.rotate_left(1);
            }
            self.roots(rgb, width, source(1), 2);
            widest(
                #[inline(always)]
                || self.row(y),
            );
        }
    }

    /// Computes orientations and shares of one row from the three rows of roots around it.
    #[inline(always)]
    fn row(&mut self, y: usize) {
        self.differences();
        let row = y * self.width..(y + 1) * self.width;
        let [first, second] = &mut self.shares;
        let out = self.bins[row.clone()].iter_mut().zip(&mut first[row.clone()]).zip(&mut second[row]);
        for (((bin, first), second), (dx, dy)) in out.zip(self.horizontal.iter().zip(&self.vertical)) {
            (*bin, *first, *second) = shared(*dx, *dy);
        }
    }

    /// Fills one of the three rows of roots, colour by colour.
    fn roots(&mut self, rgb: &[u8], width: usize, row: usize, place: usize) {
        let padded = self.width + 2;
        self.rows[place].resize(3 * padded, 0.0);
        let row = &rgb[row * width * 3..][..width * 3];
        for (colour, out) in self.rows[place].chunks_exact_mut(padded).enumerate() {
            let inner = &mut out[PADDING_PX + 1..][..width];
            for (out, pixel) in inner.iter_mut().zip(row.chunks_exact(3)) {
                *out = self.roots.0[usize::from(pixel[colour])];
            }
            for k in 0..=PADDING_PX {
                for x in [k, padded - 1 - k] {
                    let from = mirrored(x as isize - PADDING_PX as isize - 1, width);
                    out[x] = self.roots.0[usize::from(row[3 * from + colour])];
                }
            }
        }
    }

    /// Computes the horizontal and vertical differences of the middle row for the colour with the longest gradient.
    #[inline(always)]
    fn differences(&mut self) {
        let (width, padded) = (self.width, self.width + 2);
        self.horizontal.fill(0.0);
        self.vertical.fill(0.0);
        for colour in 0..3 {
            let part = |row: usize, first: usize| &self.rows[row][colour * padded + first..][..width];
            let across = part(1, 0).iter().zip(part(1, 2));
            let down = part(0, 1).iter().zip(part(2, 1));
            let longest = self.horizontal.iter_mut().zip(&mut self.vertical);
            for (((left, right), (above, below)), (x, y)) in across.zip(down).zip(longest) {
                let (dx, dy) = (right - left, below - above);
                let more = dx * dx + dy * dy > *x * *x + *y * *y;
                (*x, *y) = (select(more, dx, *x), select(more, dy, *y));
            }
        }
    }
}

/// Splits a gradient's magnitude between the two nearest unsigned orientations: the lower bin, and both shares.
#[inline(always)]
fn shared(dx: f32, dy: f32) -> (u8, f32, f32) {
    let length = (dx * dx + dy * dy).sqrt();
    // `orientation` returns six units per half turn, here there are nine; the first bin is centred half a bin from the
    // axis.
    let at = orientation(dx, dy) * (BINS as f32 / 6.0) + 0.5;
    // At this magnitude the last mantissa bit is one, so adding rounds to integers and the low bits hold the number.
    const ONES: f32 = 8_388_608.0;
    let snapped = (at - 0.5) + ONES;
    let rest = at - (snapped - ONES);
    let whole = snapped.to_bits() as u8;
    let bin = if whole == 0 { BINS as u8 } else { whole } - 1;
    (bin, length * (1.0 - rest), length * rest)
}
