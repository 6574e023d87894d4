//! Windows of a level to score: all, or those near given boxes.

use core::ops::Range;

use crate::stack::Stack;

/// Line of cells, and the range of start columns of windows in it.
pub(super) type Run = (usize, Range<usize>);

/// Set of windows of a model on a level.
pub(super) struct Windows<'a> {
    /// Cells of the level.
    pub(super) cells: &'a Stack,
    /// Lines and start columns.
    pub(super) runs: &'a [Run],
    /// Columns between neighbouring windows.
    pub(super) stride: usize,
    /// Only scores above this value are reported.
    pub(super) reject: f32,
}

/// Fills in the runs of all windows that start in these columns and lines, every `stride` lines.
pub(super) fn everywhere([columns, lines]: [Range<usize>; 2], stride: usize, runs: &mut Vec<Run>) {
    runs.clear();
    runs.extend(lines.step_by(stride).map(|line| (line, columns.clone())));
}

/// Fills in the runs of the windows that start in one of the areas (columns, lines). They are a subset of the windows
/// of [`everywhere`], without duplicates.
pub(super) fn within(
    areas: &[[Range<usize>; 2]],
    [columns, lines]: [Range<usize>; 2],
    stride: usize,
    runs: &mut Vec<Run>,
) {
    runs.clear();
    let first = columns.start;
    for line in lines.step_by(stride) {
        let begin = runs.len();
        for [across, _] in areas.iter().filter(|[_, down]| down.contains(&line)) {
            let aligned = first + (across.start.max(first) - first) / stride * stride;
            let cut = aligned..across.end.min(columns.end);
            if !cut.is_empty() {
                runs.push((line, cut));
            }
        }
        runs[begin..].sort_unstable_by_key(|(_, columns)| columns.start);
        let mut kept = begin;
        for k in begin..runs.len() {
            let (_, next) = runs[k].clone();
            match runs[begin..kept].last_mut() {
                Some((_, last)) if next.start <= last.end => last.end = last.end.max(next.end),
                _ => {
                    runs[kept] = (line, next);
                    kept += 1;
                }
            }
        }
        runs.truncate(kept);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Start positions of all windows of the runs.
    fn each(runs: &[Run], stride: usize) -> Vec<[usize; 2]> {
        runs.iter().flat_map(|(line, columns)| columns.clone().step_by(stride).map(|c| [c, *line])).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn within_yields_each_window_of_its_areas_once(
            stride in 1_usize..4, first in 0_usize..3,
            areas in proptest::collection::vec((0_usize..40, 0_usize..12, 0_usize..30, 0_usize..9), 0..6),
        ) {
            let places = [first..33, first..21];
            let area = |&(c, across, l, down): &(usize, usize, usize, usize)| [c..c + across, l..l + down];
            let areas: Vec<_> = areas.iter().map(area).collect();
            let (mut all, mut runs) = (Vec::new(), Vec::new());
            everywhere(places.clone(), stride, &mut all);
            within(&areas, places, stride, &mut runs);
            let found = each(&runs, stride);
            let mut once = found.clone();
            once.dedup();
            prop_assert_eq!(&once, &found);
            for at in each(&all, stride) {
                let is_in = |area: &&[Range<usize>; 2]| area[0].contains(&at[0]) && area[1].contains(&at[1]);
                prop_assert!(areas.iter().find(is_in).is_none() || found.contains(&at), "{:?}", at);
            }
            let all = each(&all, stride);
            prop_assert!(found.iter().all(|at| all.contains(at)), "{:?} {:?}", found, areas);
        }
    }
}
