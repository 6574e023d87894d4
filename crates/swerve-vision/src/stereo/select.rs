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
    fn gather(&mut self, sums: &[i16], disparities: usize) {
        self.left.clear();
        self.left.extend(sums.chunks_exact(disparities).map(least_at));
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
pub(super) fn row(sums: &mut [i16], matches: &mut Matches, demands: Demands, into: &mut [f32]) {
    let disparities = sums.len() / into.len();
    matches.gather(sums, disparities);
    for (x, (sums, into)) in sums.chunks_exact_mut(disparities).zip(into).enumerate() {
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

fn least(sums: &[i16]) -> i16 {
    sums.iter().fold(i16::MAX, |least, &sum| least.min(sum))
}

/// Where the first of the least sums is, and that sum.
fn least_at(sums: &[i16]) -> (usize, i16) {
    let least = least(sums);
    // Sixteen at once, then that one: a search that may end at every number is not made into wide steps.
    let holds = |part: &[i16]| part.iter().fold(false, |holds, &sum| holds | (sum == least));
    let part = sums.chunks(16).position(holds).unwrap_or(0) * 16;
    (part + sums[part..].iter().position(|&sum| sum == least).unwrap_or(0), least)
}

fn is_unique(sums: &mut [i16], best: usize, percent: i32) -> bool {
    let around = &mut sums[best - 1..=best + 1];
    let kept = [around[0], around[1], around[2]];
    around.fill(i16::MAX);
    let second = i32::from(least(sums));
    sums[best - 1..=best + 1].copy_from_slice(&kept);
    second * (100 - percent) >= i32::from(kept[1]) * 100
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
            let (mut sums, mut row_px) = (sums.concat(), [0.0; 4]);
            row(&mut sums, &mut matches, Demands { uniqueness_percent: 10, left_right_px: 1 }, &mut row_px);
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
        let mut sums = [[FAR; 5], [FAR; 5], [FAR, FAR, 9, FAR, FAR], [FAR, FAR, FAR, 1, FAR]].concat();
        let mut row_px = [0.0; 4];
        row(&mut sums, &mut matches, Demands { uniqueness_percent: 10, left_right_px: 0 }, &mut row_px);
        assert!(row_px[2].is_nan() && row_px[3] == 3.0, "{row_px:?}");
    }
}
