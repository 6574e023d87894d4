//! A bound on what one frame may hold: what pairs boxes with tracks takes time for all against all.

/// Boxes of a frame that count, at most.
pub const BOXES_MAX: usize = 1000;

/// Keeps the surest [`BOXES_MAX`], the earlier ones where scores are equal, in their order.
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
