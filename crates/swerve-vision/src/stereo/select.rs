//! Selection of the disparity of each pixel of a row from its sums.

/// Acceptance criteria of a disparity.
#[derive(Clone, Copy, Debug)]
pub(super) struct Demands {
    /// Margin by which the sum of any other disparity, except the two neighbours, must be larger, percent.
    pub(super) uniqueness_percent: i32,
    /// Largest difference between both images' disparities, pixels.
    pub(super) left_right_px: usize,
}

/// Best matches of the pixels of a row in both images.
#[derive(Clone, Debug, Default)]
pub(super) struct Matches {
    /// Best disparity of each pixel of the left image, and its sum.
    left: Vec<(usize, i16)>,
    /// Disparity with the least sum of those that lead to each pixel of the right image.
    right: Vec<(usize, i16)>,
}

impl Matches {
    #[inline(always)]
    fn gather(&mut self, sums: &[i16], disparities: usize) {
        self.left.clear();
        for sums in sums.chunks_exact(disparities) {
            self.left.push(least_at(sums));
        }
        self.right.clear();
        self.right.resize(self.left.len(), (usize::MAX, i16::MAX));
        for (x, &(best, sum)) in self.left.iter().enumerate().filter(|(x, (best, _))| best <= x) {
            if sum < self.right[x - best].1 {
                self.right[x - best] = (best, sum);
            }
        }
    }
}

/// Writes the disparities of a row, NaN where no disparity meets the criteria.
#[inline(always)]
pub(super) fn row(sums: &[i16], matches: &mut Matches, demands: Demands, into: &mut [f32]) {
    let disparities = sums.len() / into.len();
    matches.gather(sums, disparities);
    for (x, (sums, into)) in sums.chunks_exact(disparities).zip(into).enumerate() {
        let best = matches.left[x].0;
        let seen = best <= x && matches.right[x - best].0.abs_diff(best) <= demands.left_right_px;
        // The costs beyond either end of the range are unknown.
        let inside = best > 0 && best + 1 < disparities;
        *into = match seen && inside && is_unique(sums, best, demands.uniqueness_percent) {
            true => best as f32 + between([sums[best - 1], sums[best], sums[best + 1]]),
            false => f32::NAN,
        };
    }
}

/// Index of the first of the least sums, and that sum.
#[inline(always)]
fn least_at(sums: &[i16]) -> (usize, i16) {
    // Sum and disparity are packed into one integer.
    let mut key = i32::MAX;
    for (disparity, &sum) in (0..).zip(sums) {
        key = key.min(i32::from(sum) << 8 | disparity);
    }
    ((key & 0xff) as usize, (key >> 8) as i16)
}

/// Returns true if only the best disparity and its two neighbours are near the best sum: as many sums are below the
/// limit as among these three.
#[inline(always)]
fn is_unique(sums: &[i16], best: usize, percent: i32) -> bool {
    let least = i32::from(sums[best]) * 100;
    let limit = ((least + 99 - percent) / (100 - percent)).min(i32::from(i16::MAX)) as i16;
    let count = |sums: &[i16]| {
        let mut below = 0_i16;
        for &sum in sums {
            below += i16::from(sum < limit);
        }
        below
    };
    count(sums) == count(&sums[best - 1..=best + 1])
}

/// Sub-pixel position of the least cost, from -0.5 to 0.5: two lines of opposite slope through three costs.
///
/// The error is still up to 0.2 px, as a test shows. Costs that count bits change linearly; a parabola would pull the
/// result towards whole pixels (Shimizu and Okutomi, ICCV 2001).
fn between([before, least, after]: [i16; 3]) -> f32 {
    let steeper = before.max(after) - least;
    if steeper == 0 { 0.0 } else { 0.5 * f32::from(before - after) / f32::from(steeper) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_interpolates_linearly() {
        for (costs, expected) in
            [([5, 3, 5], 0.0), ([5, 3, 3], 0.5), ([3, 3, 5], -0.5), ([7, 3, 5], 0.25), ([3, 3, 3], 0.0)]
        {
            assert_eq!(between(costs), expected, "{costs:?}");
        }
    }

    #[test]
    fn row_keeps_unique_consistent_disparities_inside_the_range() {
        const FAR: i16 = 100;
        let mut matches = Matches::default();
        let mut told = |sums: &[[i16; 4]; 4]| {
            let (sums, mut row_px) = (sums.concat(), [0.0; 4]);
            row(&sums, &mut matches, Demands { uniqueness_percent: 10, left_right_px: 1 }, &mut row_px);
            row_px
        };
        let blank = [FAR; 4];
        let clear = [FAR, 1, FAR, FAR];
        assert!(told(&[blank; 4]).iter().all(|d| d.is_nan()));
        assert_eq!(told(&[blank, blank, clear, blank])[2], 1.0);
        // Another one as good, at an end of the range, or beyond the image border.
        assert!(told(&[blank, blank, blank, [FAR, 1, FAR, 1]])[3].is_nan());
        assert!(told(&[blank, blank, [1, FAR, FAR, FAR], blank])[2].is_nan());
        assert!(told(&[clear, blank, blank, blank])[0].is_nan());
        // Two that lead to the same pixel of the right image: only the better one is kept.
        let both = told(&[blank, blank, [FAR, FAR, 9, FAR], [FAR, FAR, FAR, FAR]]);
        assert_eq!(both[2], 2.0);
        let sums = [[FAR; 5], [FAR; 5], [FAR, FAR, 9, FAR, FAR], [FAR, FAR, FAR, 1, FAR]].concat();
        let mut row_px = [0.0; 4];
        row(&sums, &mut matches, Demands { uniqueness_percent: 10, left_right_px: 0 }, &mut row_px);
        assert!(row_px[2].is_nan() && row_px[3] == 3.0, "{row_px:?}");
    }
}
