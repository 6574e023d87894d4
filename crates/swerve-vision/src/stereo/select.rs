//! The disparity of each pixel of a row from its sums, as far as it can be told.

/// What is asked of a disparity.
#[derive(Clone, Copy, Debug)]
pub(super) struct Demands {
    /// Any other disparity, but for the two beside it, costs more by this share at least, percent.
    pub(super) uniqueness_percent: i32,
    /// What the two images may differ by, pixels.
    pub(super) left_right_px: usize,
}

/// What pixels of a row have in common with their counterparts.
#[derive(Clone, Debug, Default)]
pub(super) struct Matches {
    /// The best disparity of each pixel of the left image, and its sum.
    left: Vec<(usize, i16)>,
    /// Of those that lead to a pixel of the right image the one of the least sum.
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

/// Writes the disparities of a row, NaN where there is none that meets the demands.
#[inline(always)]
pub(super) fn row(sums: &[i16], matches: &mut Matches, demands: Demands, into: &mut [f32]) {
    let disparities = sums.len() / into.len();
    matches.gather(sums, disparities);
    for (x, (sums, into)) in sums.chunks_exact(disparities).zip(into).enumerate() {
        let best = matches.left[x].0;
        let seen = best <= x && matches.right[x - best].0.abs_diff(best) <= demands.left_right_px;
        // At either end nobody knows what lies beyond.
        let inside = best > 0 && best + 1 < disparities;
        *into = match seen && inside && is_unique(sums, best, demands.uniqueness_percent) {
            true => best as f32 + between([sums[best - 1], sums[best], sums[best + 1]]),
            false => f32::NAN,
        };
    }
}

/// Where the first of the least sums is, and that sum.
#[inline(always)]
fn least_at(sums: &[i16]) -> (usize, i16) {
    // The sum, and then the disparity, in one number.
    let mut key = i32::MAX;
    for (disparity, &sum) in (0..).zip(sums) {
        key = key.min(i32::from(sum) << 8 | disparity);
    }
    ((key & 0xff) as usize, (key >> 8) as i16)
}

/// Whether none but the best and the two beside it comes near to the best sum: as many are below the limit as of these
/// three.
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

/// Where between two pixels the least cost lies, from -0.5 to 0.5: two lines of opposite slope through three costs.
///
/// Off by up to 0.2 px all the same (a test shows it). Costs that count bits fall and rise like lines; a parabola would draw the result to whole pixels (Shimizu and
/// Okutomi, ICCV 2001).
fn between([before, least, after]: [i16; 3]) -> f32 {
    let steeper = before.max(after) - least;
    if steeper == 0 { 0.0 } else { 0.5 * f32::from(before - after) / f32::from(steeper) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_meet_between_pixels() {
        for (costs, expected) in
            [([5, 3, 5], 0.0), ([5, 3, 3], 0.5), ([3, 3, 5], -0.5), ([7, 3, 5], 0.25), ([3, 3, 3], 0.0)]
        {
            assert_eq!(between(costs), expected, "{costs:?}");
        }
    }

    #[test]
    fn only_what_is_unique_inside_and_seen_by_both_is_told() {
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
        // Another as good, at an end of the range, beyond the image's border.
        assert!(told(&[blank, blank, blank, [FAR, 1, FAR, 1]])[3].is_nan());
        assert!(told(&[blank, blank, [1, FAR, FAR, FAR], blank])[2].is_nan());
        assert!(told(&[clear, blank, blank, blank])[0].is_nan());
        // Two that lead to one pixel of the right image: the better one has it.
        let both = told(&[blank, blank, [FAR, FAR, 9, FAR], [FAR, FAR, FAR, FAR]]);
        assert_eq!(both[2], 2.0);
        let sums = [[FAR; 5], [FAR; 5], [FAR, FAR, 9, FAR, FAR], [FAR, FAR, FAR, 1, FAR]].concat();
        let mut row_px = [0.0; 4];
        row(&sums, &mut matches, Demands { uniqueness_percent: 10, left_right_px: 0 }, &mut row_px);
        assert!(row_px[2].is_nan() && row_px[3] == 3.0, "{row_px:?}");
    }
}
