//! Storage of a search: pairs of end time and speed, and ranges of offsets in search order.

use core::cmp::Ordering;

use super::super::poly::Quintic;

/// One pair of end time and end speed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lon {
    pub(super) motion: Quintic,
    /// End speed, m/s.
    pub(super) v_mps: f64,
    pub(super) cost: f64,
    /// Number of samples before the line's end; zero if no candidate of the pair is valid.
    pub(super) count: usize,
    /// Index of its first place in the arena; `NONE` until needed.
    pub(super) places: usize,
}

/// Marks a pair without places.
pub(super) const NONE: usize = usize::MAX;

/// A range of offsets of one pair, or one evaluated candidate.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Entry {
    /// Lower bound of the cost; the exact cost of a leaf.
    pub(super) bound: f64,
    pub(super) leaf: bool,
    /// True if the bound includes obstacles.
    pub(super) refined: bool,
    pub(super) low: u32,
    pub(super) high: u32,
    pub(super) lon: u32,
}

impl Eq for Entry {}

impl Ord for Entry {
    /// The heap returns the greatest: lowest bound, then ranges before leaves, then the original's order.
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .bound
            .total_cmp(&self.bound)
            .then(other.leaf.cmp(&self.leaf))
            .then(other.low.cmp(&self.low))
            .then(other.lon.cmp(&self.lon))
            .then(other.high.cmp(&self.high))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Places of the line at the samples of a pair: position and normal.
#[derive(Clone, Debug, Default)]
pub(super) struct Arena {
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) normal_x: Vec<f64>,
    pub(super) normal_y: Vec<f64>,
}
