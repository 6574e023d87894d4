//! Soft cascade of trees over windows.

use super::Trees;
use super::windows::Windows;
use crate::channels::select;
use crate::stack::Stack;

/// Node of a tree, placed on one pyramid level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Offset of its feature from the window's first cell.
    offset: u32,
    threshold: f32,
}

/// Windows of a line that are scored together.
const LANES: usize = 8;
/// Deepest tree evaluated for several windows at once, which visits every node; deeper trees are traversed per window.
const DEEPEST: usize = 3;

/// Reports the windows that the cascade does not reject, with their scores. `D` is the trees' depth, 0 for any.
#[inline(always)]
pub(super) fn scan<const D: usize>(
    trees: &Trees,
    nodes: &[Node],
    windows: &Windows<'_>,
    report: &mut impl FnMut([usize; 2], f32),
) {
    let depth = if D == 0 { trees.depth } else { D };
    let (inner, reject, cells) = ((1 << depth) - 1, windows.reject, windows.cells);
    let all = || nodes.chunks_exact(inner).zip(trees.leaves.chunks_exact(inner + 1));
    for (line, columns) in windows.runs {
        let mut rest = columns.clone();
        if (1..=DEEPEST).contains(&D) && windows.stride <= 2 {
            let stride = windows.stride;
            while rest.len() >= LANES * stride {
                let first = &cells.numbers()[line * cells.width() + rest.start..];
                let mut report = |lane, score| report([rest.start + lane * stride, *line], score);
                match stride {
                    1 => side_by_side::<D, 1>(first, all(), reject, &mut report),
                    _ => side_by_side::<D, 2>(first, all(), reject, &mut report),
                }
                rest.start += LANES * stride;
            }
        }
        for column in rest.step_by(windows.stride) {
            let window = &cells.numbers()[line * cells.width() + column..];
            let score = climb(window, all(), depth, (0.0, reject));
            if score > reject {
                report([column, *line], score);
            }
        }
    }
}

/// Sums the trees' scores for one window; stops as soon as the sum is at most `reject`.
#[inline(always)]
fn climb<'a>(
    window: &[f32],
    trees: impl Iterator<Item = (&'a [Node], &'a [f32])>,
    depth: usize,
    (mut score, reject): (f32, f32),
) -> f32 {
    for (nodes, leaves) in trees {
        let mut k = 0;
        for _ in 0..depth {
            let node = nodes[k];
            k = 2 * k + if window[node.offset as usize] < node.threshold { 1 } else { 2 };
        }
        score += leaves[k - nodes.len()];
        if score <= reject {
            break;
        }
    }
    score
}

/// Scores windows `S` columns apart, tree by tree, and reports those that are not rejected. Each sum has the same terms
/// in the same order as when a window is scored alone.
#[inline(always)]
fn side_by_side<'a, const D: usize, const S: usize>(
    windows: &[f32],
    trees: impl Iterator<Item = (&'a [Node], &'a [f32])>,
    reject: f32,
    report: &mut impl FnMut(usize, f32),
) {
    let mut scores = [0.0_f32; LANES];
    for (nodes, leaves) in trees {
        let values = leaves_of::<D, S>(nodes, leaves, windows);
        // A rejected window's score is negative infinity, so that later trees do not change it.
        scores = core::array::from_fn(|lane| {
            let score = scores[lane] + values[lane];
            select(score > reject, score, f32::NEG_INFINITY)
        });
        // Folding over all lanes is one vector comparison; an early exit would branch for each lane.
        if !scores.iter().fold(false, |any, score| any | (*score > reject)) {
            return;
        }
    }
    for (lane, score) in scores.into_iter().enumerate().filter(|(_, score)| *score > reject) {
        report(lane, score);
    }
}

/// Leaf values of one tree for all windows: from the leaves up to the root, each node selects one of two values.
#[inline(always)]
fn leaves_of<const D: usize, const S: usize>(
    nodes: &[Node],
    leaves: &[f32],
    windows: &[f32],
) -> [f32; LANES] {
    let mut values = [[0.0; LANES]; 1 << DEEPEST];
    values.iter_mut().zip(leaves).for_each(|(value, leaf)| *value = [*leaf; LANES]);
    for level in (0..D).rev() {
        for k in 0..1 << level {
            let node = nodes[(1 << level) - 1 + k];
            let first = node.offset as usize;
            let row = &windows[first..first + LANES * S];
            values[k] = core::array::from_fn(|lane| {
                select(row[lane * S] < node.threshold, values[2 * k][lane], values[2 * k + 1][lane])
            });
        }
    }
    values[0]
}

/// Computes the nodes of the first `most` trees for a level: feature offsets for windows of this size in cells.
pub(super) fn placed(
    trees: &Trees,
    [columns, lines]: [usize; 2],
    cells: &Stack,
    most: usize,
    into: &mut Vec<Node>,
) {
    let plane = cells.width() * cells.height();
    let inner = (1 << trees.depth) - 1;
    let nodes = trees.features.iter().zip(&trees.thresholds).take(most.saturating_mul(inner));
    into.clear();
    into.extend(nodes.map(|(feature, &threshold)| {
        let feature = usize::from(*feature);
        let (line, column) = (feature / columns % lines, feature % columns);
        let offset = feature / (columns * lines) * plane + line * cells.width() + column;
        Node { offset: offset as u32, threshold }
    }));
}
