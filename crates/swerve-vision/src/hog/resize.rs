//! Bilinear resizing of bytes in integers: weights of 1/256, rounded once.

use swerve_geom::simd::widest;

use crate::image::Rgb;

/// Resizes images of at least two pixels along each side; reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Resizer {
    columns: Vec<(u32, u16)>,
    /// Two source rows resampled to the new width, in 1/256, and their row indices.
    rows: [Vec<u16>; 2],
    held: [usize; 2],
}

impl Resizer {
    pub(super) fn resize(&mut self, image: Rgb<'_>, [width, height]: [usize; 2], into: &mut Vec<u8>) {
        self.columns.clear();
        self.columns.extend((0..width).map(|x| {
            let (first, share) = nearest(x, width, image.width());
            (first as u32, share)
        }));
        self.held = [usize::MAX; 2];
        into.resize(width * height * 3, 0);
        for (y, out) in into.chunks_exact_mut(width * 3).enumerate() {
            let (above, share) = nearest(y, height, image.height());
            let below = above + 1;
            if self.held[1] == above {
                self.rows.swap(0, 1);
                self.held.swap(0, 1);
            }
            self.hold(0, above, image);
            self.hold(1, below, image);
            let (share, [a, b]) = (u32::from(share), &self.rows);
            widest(
                #[inline(always)]
                || {
                    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
                        *out =
                            ((u32::from(*a) * (256 - share) + u32::from(*b) * share + (1 << 15)) >> 16) as u8;
                    }
                },
            );
        }
    }

    /// Ensures that a slot holds a source row.
    fn hold(&mut self, place: usize, row: usize, image: Rgb<'_>) {
        if self.held[place] == row {
            return;
        }
        self.held[place] = row;
        let (from, into) = (image.row(row), &mut self.rows[place]);
        into.resize(self.columns.len() * 3, 0);
        for (out, &(first, share)) in into.as_chunks_mut::<3>().0.iter_mut().zip(&self.columns) {
            let pair = &from[3 * first as usize..][..6];
            for k in 0..3 {
                // The first weight is 256 minus the second.
                let [one, other] = [pair[k], pair[k + 3]].map(u16::from);
                out[k] = (one << 8).wrapping_add(share.wrapping_mul(other.wrapping_sub(one)));
            }
        }
    }
}

/// First of the two source pixels (of `n`) around the centre of pixel `k` (of `of`), and the weight of the second in
/// 1/256.
fn nearest(k: usize, of: usize, n: usize) -> (usize, u16) {
    let at = (k as f64 + 0.5) * (n as f64 / of as f64) - 0.5;
    if at <= 0.0 {
        return (0, 0);
    }
    let first = at.floor();
    if first >= (n - 1) as f64 {
        return (n - 2, 256);
    }
    (first as usize, ((at - first) * 256.0).round_ties_even() as u16)
}
