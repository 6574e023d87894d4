//! Gradients of an image and their shares in two of nine orientations.

use super::BINS;

/// Pixels that the image is continued by on each side, mirrored at its outermost ones.
pub(super) const PADDING_PX: usize = 8;

/// A pixel's gradient.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gradient {
    /// Its length, as far as it is of `bin`, and of the next.
    pub(super) share: [f32; 2],
    pub(super) bin: u8,
}

/// The gradients of an image, padded.
#[derive(Clone, Debug, Default)]
pub(super) struct Gradients {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<Gradient>,
    roots: Roots,
    horizontal: Vec<f32>,
    vertical: Vec<f32>,
    /// Three rows of roots, padded by one more pixel on each side.
    rows: [Vec<f32>; 3],
}

/// The square root of each byte.
#[derive(Clone, Debug)]
struct Roots([f32; 256]);

impl Default for Roots {
    fn default() -> Self {
        Self(core::array::from_fn(|k| (k as f32).sqrt()))
    }
}

/// Where index `k` lies in `0..n` when the picture is mirrored at its first and last pixel.
fn mirrored(k: isize, n: usize) -> usize {
    let last = n as isize - 1;
    if last == 0 {
        return 0;
    }
    let k = k.rem_euclid(2 * last);
    k.min(2 * last - k) as usize
}

impl Gradients {
    /// Of an image of this width and height, three bytes a pixel.
    pub(super) fn compute(&mut self, rgb: &[u8], [width, height]: [usize; 2]) {
        (self.width, self.height) = (width + 2 * PADDING_PX, height + 2 * PADDING_PX);
        self.pixels.resize(self.width * self.height, Gradient::default());
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
            self.differences();
            let out = &mut self.pixels[y * self.width..][..self.width];
            for ((out, dx), dy) in out.iter_mut().zip(&self.horizontal).zip(&self.vertical) {
                *out = shared(*dx, *dy);
            }
        }
    }

    /// Fills one of the three rows, colour after colour.
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

    /// The differences across each pixel of the row in the middle, of the colour where they are longest.
    fn differences(&mut self) {
        let (width, padded) = (self.width, self.width + 2);
        let colour = |row: usize, k: usize| &self.rows[row][k * padded..][..padded];
        let [above, at, below]: [[&[f32]; 3]; 3] =
            core::array::from_fn(|row| core::array::from_fn(|k| colour(row, k)));
        let (horizontal, vertical) = (&mut self.horizontal[..width], &mut self.vertical[..width]);
        for x in 0..width {
            let (mut most, mut best) = (-1.0, [0.0; 2]);
            for k in 0..3 {
                let [dx, dy] = [at[k][x + 2] - at[k][x], below[k][x + 1] - above[k][x + 1]];
                let square = dx * dx + dy * dy;
                let more = square > most;
                best = if more { [dx, dy] } else { best };
                most = if more { square } else { most };
            }
            [horizontal[x], vertical[x]] = best;
        }
    }
}

/// Splits a gradient's length between the two orientations nearest to it, whichever way it points along them.
#[inline(always)]
fn shared(dx: f32, dy: f32) -> Gradient {
    let length = (dx * dx + dy * dy).sqrt();
    // Six to half a turn there, nine here; the first is centred half a bin from the axis.
    let at = crate::channels::orientation(dx, dy) * (BINS as f32 / 6.0) - 0.5;
    let below = at < 0.0;
    let whole = if below { -1.0 } else { at.trunc() };
    let rest = at - whole;
    let bin = if below { BINS as u8 - 1 } else { whole as u8 };
    Gradient { share: [length * (1.0 - rest), length * rest], bin: bin.min(BINS as u8 - 1) }
}
