//! Features of a cell: scales, positions and the ray.

use crate::channels::CHANNELS;

/// Number of scales, each half of the one before.
pub(super) const LEVELS: usize = 4;

/// Positions around a cell, in cells of the scale.
pub(super) const PLACES: [[isize; 2]; 13] = [
    [0, 0],
    [-1, 0],
    [1, 0],
    [0, -1],
    [0, 1],
    [-2, -2],
    [2, -2],
    [-2, 2],
    [2, 2],
    [-4, 0],
    [4, 0],
    [0, -4],
    [0, 4],
];

/// Padding of each scale, in cells: the farthest position, plus one where a scale was rounded down.
pub(super) const PAD: usize = 5;

/// Values of a ray: slope down, slope to the right, and lateral position where it meets the ground.
pub(super) const RAY: usize = 3;

/// Number of features of a cell.
pub const FEATURES: usize = LEVELS * PLACES.len() * CHANNELS + RAY;
