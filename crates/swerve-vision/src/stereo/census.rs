//! Census codes: a description of a neighbourhood that is invariant to brightness and contrast differences between two
//! cameras.
//!
//! Centre-symmetric (Spangenberg, Langner and Rojas, CAIP 2013): each of the 24 pairs of opposite pixels of a 7 x 7
//! window gives one bit, set if the first is brighter. This is half of the bits of a plain census of that window, and
//! no pixel influences all of them.

use swerve_geom::simd::widest;

use crate::Plane;

/// Columns of the window.
pub(super) const WIDTH: usize = 7;
/// Rows of the window.
pub(super) const HEIGHT: usize = 7;
/// Bits of a code, and therefore the largest distance of two codes.
pub(super) const BITS: u8 = 24;
/// Bytes of a code; each is stored in a separate array, so that sixteen are compared at once.
const BYTES: usize = 3;

const REACH_X: usize = WIDTH / 2;
const REACH_Y: usize = HEIGHT / 2;

/// Codes of an image, row by row.
#[derive(Clone, Debug, Default)]
pub(super) struct Census {
    stride: usize,
    planes: [Vec<u8>; BYTES],
    framed: Plane<u8>,
}

impl Census {
    /// Computes the codes of the left image, in column order.
    pub(super) fn left(&mut self, image: &Plane<u8>) {
        self.compute(image, 0);
    }

    /// Computes the codes of the right image: each row from its last column to its first, then `more` copies of the
    /// first, so that candidates of growing disparity are contiguous.
    pub(super) fn right(&mut self, image: &Plane<u8>, more: usize) {
        self.compute(image, more);
        let width = image.width();
        for row in self.planes.iter_mut().flat_map(|plane| plane.chunks_exact_mut(width + more)) {
            row[..width].reverse();
            let first = row[width - 1];
            row[width..].fill(first);
        }
    }

    fn compute(&mut self, image: &Plane<u8>, more: usize) {
        let (width, height) = (image.width(), image.height());
        self.stride = width + more;
        self.frame(image);
        for plane in &mut self.planes {
            plane.clear();
            plane.resize(self.stride * height, 0);
        }
        widest(
            #[inline(always)]
            || {
                for y in 0..height {
                    self.compare(y, width);
                }
            },
        );
    }

    /// Computes the codes of one row.
    #[inline(always)]
    fn compare(&mut self, y: usize, width: usize) {
        for bit in 0..usize::from(BITS) {
            let (dx, dy) = (bit % WIDTH, bit / WIDTH);
            let one = &self.framed.row(y + dy)[dx..][..width];
            let other = &self.framed.row(y + HEIGHT - 1 - dy)[WIDTH - 1 - dx..][..width];
            let codes = &mut self.planes[bit / 8][y * self.stride..][..width];
            for ((code, one), other) in codes.iter_mut().zip(one).zip(other) {
                *code |= u8::from(one > other) << (bit % 8);
            }
        }
    }

    /// Copies the image with its border repeated, so that every pixel has a full window.
    fn frame(&mut self, image: &Plane<u8>) {
        let (width, height) = (image.width(), image.height());
        self.framed.reset(width + WIDTH - 1, height + HEIGHT - 1);
        for y in 0..height + HEIGHT - 1 {
            let from = image.row(y.saturating_sub(REACH_Y).min(height - 1));
            let row = self.framed.row_mut(y);
            row[..REACH_X].fill(from[0]);
            row[REACH_X..][..width].copy_from_slice(from);
            row[REACH_X + width..].fill(from[width - 1]);
        }
    }

    fn row(&self, y: usize) -> [&[u8]; BYTES] {
        self.planes.each_ref().map(|plane| &plane[y * self.stride..][..self.stride])
    }
}

/// Writes the Hamming distances of each pixel of row `y` of the left image to its candidates: contiguous, one per
/// disparity for each pixel.
#[inline(always)]
pub(super) fn costs(left: &Census, right: &Census, y: usize, costs: &mut [u8]) {
    let (left_row, right_row, width) = (left.row(y), right.row(y), left.stride);
    for (x, costs) in costs.chunks_exact_mut(costs.len() / width).enumerate() {
        let code = left_row.map(|plane| plane[x]);
        let candidates = right_row.map(|plane| &plane[width - 1 - x..][..costs.len()]);
        distances(code, candidates, costs);
    }
}

#[inline(always)]
fn distances(code: [u8; BYTES], candidates: [&[u8]; BYTES], distances: &mut [u8]) {
    let (whole, rest) = distances.as_chunks_mut::<32>();
    let end = 32 * whole.len();
    lanes(code, candidates.map(|bytes| bytes[..end].as_chunks().0), whole);
    lanes(code, candidates.map(|bytes| bytes[end..].as_chunks().0), rest.as_chunks_mut::<16>().0);
}

#[inline(always)]
fn lanes<const N: usize>(code: [u8; BYTES], [p, q, r]: [&[[u8; N]]; BYTES], distances: &mut [[u8; N]]) {
    for (((distances, p), q), r) in distances.iter_mut().zip(p).zip(q).zip(r) {
        let mut new = [0; N];
        (0..N).for_each(|k| new[k] = count([p[k] ^ code[0], q[k] ^ code[1], r[k] ^ code[2]]));
        *distances = new;
    }
}

/// Number of set bits of three bytes: a bitwise full adder, then the weighted bit counts of both sums. Uses bytes only,
/// which have the most vector lanes.
#[inline(always)]
fn count([a, b, c]: [u8; BYTES]) -> u8 {
    let (ones, twos) = (a ^ b ^ c, (a & b) | (c & (a ^ b)));
    let nibbles = |bits: u8| {
        let pairs = bits - ((bits >> 1) & 0x55);
        (pairs & 0x33) + ((pairs >> 2) & 0x33)
    };
    let sums = nibbles(ones) + 2 * nibbles(twos);
    (sums & 0x0f) + (sums >> 4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn count_matches_the_number_of_set_bits() {
        let mut word = 1_u32;
        for _ in 0..20_000 {
            word = word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let [a, b, c, _] = word.to_le_bytes();
            assert_eq!(u32::from(count([a, b, c])), a.count_ones() + b.count_ones() + c.count_ones());
        }
        assert_eq!(count([255; 3]), BITS);
    }

    #[test]
    fn codes_are_invariant_to_brightness_and_contrast() {
        let at = |x: usize, y: usize| ((x * 37 + y * 91 + x * y * 13) % 100) as u8;
        let pixels = |change: &dyn Fn(u8) -> u8| {
            let all = (0..20 * 12).map(|at_pixel| change(at(at_pixel % 20, at_pixel / 20))).collect();
            Plane::from_pixels(20, 12, all).unwrap()
        };
        let (mut plain, mut changed) = (Census::default(), Census::default());
        plain.left(&pixels(&|v| v));
        changed.left(&pixels(&|v| 2 * v + 30));
        assert_eq!(plain.planes, changed.planes);
        let mut other = Census::default();
        other.left(&pixels(&|v| 99 - v));
        assert_ne!(plain.planes, other.planes);
    }
}
