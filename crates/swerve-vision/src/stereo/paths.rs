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

    /// Pixel by pixel, without the first and the last, which are none.
    #[inline(always)]
    fn pixels(&self, stride: usize) -> core::slice::ChunksExact<'_, u8> {
        self.costs[stride..self.costs.len() - stride].chunks_exact(stride)
    }
}

/// Paths that go through an image row by row, in either direction; sums of up to three of them are bytes.
#[derive(Clone, Debug, Default)]
pub(super) struct Paths {
    disparities: usize,
    width: usize,
    from_row: Vec<FromRow>,
    /// Forward and backward.
    along: [Lane; 2],
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
        self.along.iter_mut().for_each(|lane| lane.begin(width, disparities));
        self.costs.resize(width * disparities, 0);
    }

    /// Sums the paths that come into row `y` from the row that this was called for before.
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

    /// Adds the two paths along the row that [`Paths::enter_row`] was called for last to what it gave, and to what it
    /// gave for the row the other way.
    #[inline(always)]
    pub(super) fn along_row(&mut self, penalties: Penalties, [a, b]: [&[u8]; 2], sums: &mut [i16]) {
        let (n, stride) = (self.disparities, self.disparities + 2);
        let [forward, backward] = &mut self.along;
        let mut leasts = [0; 2];
        // Neither waits for the other.
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

/// One pixel of a path (Hirschmüller, PAMI 2008, equation 13): its costs, and the cheapest way on from the pixel
/// before, less the least cost there. Returns the least of it.
///
/// Bytes alone, of which a vector has the most, in arrays, which are vectors without a rest.
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

/// Disparities at once; the rest are sixteens.
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

/// Adds a path to the sums of a pixel, or begins them with it.
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

/// Sums of a pixel. The first two are of up to three paths each, the others of one.
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
    fn a_step_by_hand() {
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
        // From 0 with a small change, from itself, and from 0 with a small change again.
        assert_eq!(padded([4, 0, 9], 0), ([3, 2, 5], 2));
        // The third is out of reach of a small change.
        assert_eq!(padded([0, 9, 9], 0), ([1, 4, 8], 1));
    }
}
