//! Aggregation of pixel costs along straight paths in semi-global matching.

use super::census::{self, Census};

/// Penalties for a change of disparity between neighbours on a path, in census bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Penalties {
    /// Penalty of a change by one.
    pub(super) small: u8,
    /// Penalty of any larger change; with the largest cost at most a third of a byte, so that the sum of three paths
    /// fits one.
    pub(super) large: u8,
}

/// Paths that enter a row from the row before it, straight or diagonally.
///
/// Costs of a pixel are enclosed by two bytes of the largest value, which no minimum selects. Before the first and
/// after the last pixel there is one with zero costs, where paths start.
#[derive(Clone, Debug, Default)]
struct FromRow {
    /// Shift of the source column in the row before: `x + shift - 1`.
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

    /// Costs pixel by pixel, without the two padding pixels.
    #[inline(always)]
    fn pixels(&self, stride: usize) -> core::slice::ChunksExact<'_, u8> {
        self.costs[stride..self.costs.len() - stride].chunks_exact(stride)
    }
}

/// Paths that traverse an image row by row, in either direction; sums of up to three of them are bytes.
#[derive(Clone, Debug, Default)]
pub(super) struct Paths {
    disparities: usize,
    width: usize,
    from_row: Vec<FromRow>,
    /// Forward and backward paths.
    along: [Lane; 2],
    costs: Vec<u8>,
}

impl Paths {
    /// Starts paths for images of this width; `diagonal` adds diagonal paths to the vertical ones.
    pub(super) fn begin(&mut self, width: usize, disparities: usize, diagonal: bool) {
        (self.width, self.disparities) = (width, disparities);
        let shifts: &[usize] = if diagonal { &[1, 0, 2] } else { &[1] };
        self.from_row.resize_with(shifts.len(), FromRow::default);
        for (path, &shift) in self.from_row.iter_mut().zip(shifts) {
            path.shift = shift;
            path.before.begin(width, disparities);
            path.here.begin(width, disparities);
        }
        self.along.iter_mut().for_each(|lane| lane.begin(width, disparities));
        self.costs.resize(width * disparities, 0);
    }

    /// Sums the paths that enter row `y` from the row of the previous call.
    #[inline(always)]
    pub(super) fn enter_row(
        &mut self,
        [left, right]: [&Census; 2],
        y: usize,
        penalties: Penalties,
        sums: &mut [u8],
    ) {
        census::costs(left, right, y, &mut self.costs);
        let (n, stride) = (self.disparities, self.disparities + 2);
        for (index, path) in self.from_row.iter_mut().enumerate() {
            let pixels = self.costs.chunks_exact(n).zip(sums.chunks_exact_mut(n));
            let heres = path.here.costs[stride..].chunks_exact_mut(stride);
            let befores = path.before.costs[path.shift * stride..].chunks_exact(stride);
            let leasts = path.here.least[1..].iter_mut().zip(&path.before.least[path.shift..]);
            for ((((costs, sums), here), before), (least, &least_before)) in
                pixels.zip(heres).zip(befores).zip(leasts)
            {
                *least = step(costs, (before, least_before), penalties, here);
                add(&here[1..], sums, index > 0);
            }
            std::mem::swap(&mut path.before, &mut path.here);
        }
    }

    /// Adds the two paths along the row of the last [`Paths::enter_row`] call to its sums and to the sums of the same
    /// row in the opposite direction.
    #[inline(always)]
    pub(super) fn along_row(&mut self, penalties: Penalties, [a, b]: [&[u8]; 2], sums: &mut [i16]) {
        let (n, stride) = (self.disparities, self.disparities + 2);
        let [forward, backward] = &mut self.along;
        let mut leasts = [0; 2];
        // The two directions are independent.
        for index in 0..self.width {
            let (x, back) = (index, self.width - 1 - index);
            let (before, here) = forward.costs[x * stride..].split_at_mut(stride);
            leasts[0] = step(&self.costs[x * n..][..n], (before, leasts[0]), penalties, &mut here[..stride]);
            let (here, before) = backward.costs[(back + 1) * stride..].split_at_mut(stride);
            let before = (&before[..stride], leasts[1]);
            leasts[1] = step(&self.costs[back * n..][..n], before, penalties, here);
        }
        let along = forward.pixels(stride).zip(backward.pixels(stride));
        let entered = a.chunks_exact(n).zip(b.chunks_exact(n));
        for ((sums, (a, b)), (c, d)) in sums.chunks_exact_mut(n).zip(entered).zip(along) {
            sum([a, b, &c[1..=n], &d[1..=n]], sums);
        }
    }
}

/// Advances a path by one pixel (Hirschmüller, PAMI 2008, equation 13): its cost plus the cheapest transition from the
/// pixel before, minus the lowest cost there. Returns the lowest new cost.
///
/// Uses bytes only, which have the most vector lanes, in arrays that are whole vectors.
#[inline(always)]
fn step(costs: &[u8], (before, least_before): (&[u8], u8), penalties: Penalties, here: &mut [u8]) -> u8 {
    let n = costs.len();
    let (below, same, above) = (&before[..n], &before[1..][..n], &before[2..][..n]);
    let here = &mut here[1..][..n];
    let (whole, end) = (n / WIDE, n / WIDE * WIDE);
    let mut least = [u8::MAX; WIDE];
    for at in 0..whole {
        let part = |from| array::<WIDE>(from, at * WIDE);
        let path = lanes(part(costs), [below, same, above].map(part), least_before, penalties);
        here[at * WIDE..][..WIDE].copy_from_slice(&path);
        (0..WIDE).for_each(|k| least[k] = least[k].min(path[k]));
    }
    let mut all = u8::MAX;
    (0..WIDE).for_each(|k| all = all.min(least[k]));
    for at in (end..n).step_by(NARROW) {
        let part = |from| array::<NARROW>(from, at);
        let path = lanes(part(costs), [below, same, above].map(part), least_before, penalties);
        here[at..][..NARROW].copy_from_slice(&path);
        (0..NARROW).for_each(|k| all = all.min(path[k]));
    }
    all
}

/// Disparities per step; the remainder is processed in sixteens.
const WIDE: usize = 32;
const NARROW: usize = 16;

#[inline(always)]
fn array<const N: usize>(from: &[u8], at: usize) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(&from[at..][..N]);
    array
}

#[inline(always)]
fn lanes<const N: usize>(
    costs: [u8; N],
    [below, same, above]: [[u8; N]; 3],
    least_before: u8,
    penalties: Penalties,
) -> [u8; N] {
    let far = least_before.wrapping_add(penalties.large);
    let mut path = [0; N];
    for k in 0..N {
        let near = below[k].min(above[k]).wrapping_add(penalties.small);
        path[k] = costs[k].wrapping_add(same[k].min(near).min(far).wrapping_sub(least_before));
    }
    path
}

/// Adds a path to the sums of a pixel, or initialises them.
#[inline(always)]
fn add(path: &[u8], sums: &mut [u8], more: bool) {
    for (sums, path) in sums.as_chunks_mut::<NARROW>().0.iter_mut().zip(path.as_chunks::<NARROW>().0) {
        let mut new = *path;
        if more {
            (0..NARROW).for_each(|k| new[k] = new[k].wrapping_add(sums[k]));
        }
        *sums = new;
    }
}

/// Sums of a pixel; the first two inputs sum up to three paths each, the others one.
#[inline(always)]
fn sum([a, b, c, d]: [&[u8]; 4], sums: &mut [i16]) {
    let [a, b, c, d] = [a, b, c, d].map(|part| part.as_chunks::<NARROW>().0);
    for ((((sums, a), b), c), d) in sums.as_chunks_mut::<NARROW>().0.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        let mut new = [0; NARROW];
        for k in 0..NARROW {
            new[k] = i16::from(a[k]) + i16::from(b[k]) + i16::from(c[k].wrapping_add(d[k]));
        }
        *sums = new;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_matches_a_hand_calculation() {
        let penalties = Penalties { small: 2, large: 5 };
        let padded = |before: [u8; 3], least| {
            let (mut all, mut here) = ([99; 18], [255; 18]);
            (all[0], all[17]) = (255, 255);
            all[1..4].copy_from_slice(&before);
            let costs = std::array::from_fn::<u8, 16, _>(|at| (at + 1).min(3) as u8);
            let found = step(&costs, (&all, least), penalties, &mut here);
            assert_eq!((here[0], here[17]), (255, 255));
            ([here[1], here[2], here[3]], found)
        };
        // From 0 by a small change, from itself, and from 0 by a small change again.
        assert_eq!(padded([4, 0, 9], 0), ([3, 2, 5], 2));
        // A small change does not reach the third.
        assert_eq!(padded([0, 9, 9], 0), ([1, 4, 8], 1));
    }
}
