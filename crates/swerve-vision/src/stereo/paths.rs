//! Costs summed along straight paths: what makes semi-global matching of single pixels' costs.

use super::census::{self, Census};

/// What a path asks of a change of disparity between neighbours, in bits of the census.
#[derive(Clone, Copy, Debug)]
pub(super) struct Penalties {
    /// For a change by one.
    pub(super) small: u8,
    /// For any larger change: with the largest cost a third of a byte at most, so that three paths' sum is one.
    pub(super) large: u8,
}

/// The paths that come into a row from the row before it, from straight ahead or from a neighbouring column.
///
/// Costs of a pixel lie between two bytes that no minimum takes; before the first and after the last pixel there is
/// one with no costs, where paths begin.
#[derive(Clone, Debug, Default)]
struct FromRow {
    /// Which column of the row before: `x + shift - 1`.
    shift: usize,
    before: Lane,
    here: Lane,
}

#[derive(Clone, Debug, Default)]
struct Lane {
    costs: Vec<u8>,
    least: Vec<u8>,
}

impl Lane {
    fn begin(&mut self, pixels: usize, disparities: usize) {
        let stride = disparities + 2;
        self.costs.clear();
        self.costs.resize((pixels + 2) * stride, 0);
        self.least.clear();
        self.least.resize(pixels + 2, 0);
        for pixel in self.costs.chunks_exact_mut(stride) {
            (pixel[0], pixel[stride - 1]) = (u8::MAX, u8::MAX);
        }
    }
}

/// Paths that go through an image row by row, in either direction; sums of up to three of them are bytes.
#[derive(Clone, Debug, Default)]
pub(super) struct Paths {
    disparities: usize,
    width: usize,
    from_row: Vec<FromRow>,
    along: Lane,
    costs: Vec<u8>,
}

impl Paths {
    /// Begins paths for images of this width; `diagonal` besides those along columns.
    pub(super) fn begin(&mut self, width: usize, disparities: usize, diagonal: bool) {
        (self.width, self.disparities) = (width, disparities);
        let shifts: &[usize] = if diagonal { &[1, 0, 2] } else { &[1] };
        self.from_row.resize_with(shifts.len(), FromRow::default);
        for (path, &shift) in self.from_row.iter_mut().zip(shifts) {
            path.shift = shift;
            path.before.begin(width, disparities);
            path.here.begin(width, disparities);
        }
        self.along.begin(0, disparities);
        self.costs.resize(width * disparities, 0);
    }

    /// Sums the paths that come into row `y` from the row that this was called for before.
    pub(super) fn enter_row(
        &mut self,
        [left, right]: [&Census; 2],
        y: usize,
        penalties: Penalties,
        sums: &mut [u8],
    ) {
        census::costs(left, right, y, &mut self.costs);
        sums.fill(0);
        let (n, stride) = (self.disparities, self.disparities + 2);
        for path in &mut self.from_row {
            let pixels = self.costs.chunks_exact(n).zip(sums.chunks_exact_mut(n));
            let heres = path.here.costs[stride..].chunks_exact_mut(stride);
            let befores = path.before.costs[path.shift * stride..].chunks_exact(stride);
            let leasts = path.here.least[1..].iter_mut().zip(&path.before.least[path.shift..]);
            for ((((costs, sums), here), before), (least, &least_before)) in
                pixels.zip(heres).zip(befores).zip(leasts)
            {
                *least = step(costs, (before, least_before), penalties, here, sums);
            }
            std::mem::swap(&mut path.before, &mut path.here);
        }
    }

    /// Sums the two paths along the row that [`Paths::enter_row`] was called for last.
    pub(super) fn along_row(&mut self, penalties: Penalties, sums: &mut [u8]) {
        sums.fill(0);
        let n = self.disparities;
        let (mut before, mut here) = self.along.costs.split_at_mut(n + 2);
        for backward in [false, true] {
            before[1..=n].fill(0);
            let mut least = 0;
            for index in 0..self.width {
                let x = if backward { self.width - 1 - index } else { index };
                let (costs, sums) = (&self.costs[x * n..][..n], &mut sums[x * n..][..n]);
                least = step(costs, (before, least), penalties, here, sums);
                std::mem::swap(&mut before, &mut here);
            }
        }
    }
}

/// One pixel of a path (Hirschmüller, PAMI 2008, equation 13): its costs, and the cheapest way on from the pixel
/// before, less the least cost there. Adds that to the sums and returns the least of it.
///
/// Bytes alone, so that there are sixteen lanes on any x86-64 machine.
#[inline(always)]
fn step(
    costs: &[u8],
    (before, least_before): (&[u8], u8),
    penalties: Penalties,
    here: &mut [u8],
    sums: &mut [u8],
) -> u8 {
    let n = costs.len();
    let far = least_before.wrapping_add(penalties.large);
    let (below, same, above) = (&before[..n], &before[1..][..n], &before[2..][..n]);
    let here = &mut here[1..][..n];
    let each = costs.iter().zip(below).zip(same).zip(above).zip(here).zip(sums);
    let mut least = u8::MAX;
    for (((((cost, &below), &same), &above), here), sum) in each {
        let near = below.min(above).wrapping_add(penalties.small);
        let path = cost.wrapping_add(same.min(near).min(far).wrapping_sub(least_before));
        *here = path;
        *sum = sum.wrapping_add(path);
        least = least.min(path);
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_by_hand() {
        let before = [255, 4, 0, 9, 255];
        let (mut here, mut sums) = ([255; 5], [100; 3]);
        let least = step(&[1, 2, 3], (&before, 0), Penalties { small: 2, large: 5 }, &mut here, &mut sums);
        // From 0 with a small change, from itself, and from 0 with a small change again.
        assert_eq!((here, sums, least), ([255, 3, 2, 5, 255], [103, 102, 105], 2));
        let before = [255, 0, 9, 9, 255];
        let least = step(&[1, 2, 3], (&before, 0), Penalties { small: 2, large: 5 }, &mut here, &mut sums);
        // The third is out of reach of a small change.
        assert_eq!((here, least), ([255, 1, 4, 8, 255], 1));
    }
}
