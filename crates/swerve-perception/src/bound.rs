//! Limit on the number of boxes per frame: pairing boxes with tracks takes time for all combinations.

/// Largest number of boxes per frame that are used.
pub const BOXES_MAX: usize = 1000;

/// Keeps the [`BOXES_MAX`] elements with the highest scores in their original order; earlier ones win ties.
pub(crate) fn surest<T>(all: &mut Vec<T>, score: impl Fn(&T) -> f64) {
    if all.len() <= BOXES_MAX {
        return;
    }
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&a, &b| score(&all[b]).total_cmp(&score(&all[a])));
    let mut stays = vec![false; all.len()];
    order[..BOXES_MAX].iter().for_each(|&k| stays[k] = true);
    let mut stays = stays.into_iter();
    all.retain(|_| stays.next().unwrap_or(false));
}
