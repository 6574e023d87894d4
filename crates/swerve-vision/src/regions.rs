//! Connected regions of an image.

use crate::{Plane, Rgb};

/// Region of 8-connected pixels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Region {
    /// Label of its pixels.
    pub(crate) label: u32,
    /// First column.
    pub(crate) left: usize,
    /// First row.
    pub(crate) top: usize,
    /// One past the last column.
    pub(crate) right: usize,
    /// One past the last row.
    pub(crate) bottom: usize,
}

impl Region {
    pub(crate) fn width(&self) -> usize {
        self.right - self.left
    }

    pub(crate) fn height(&self) -> usize {
        self.bottom - self.top
    }
}

/// Regions of the latest image, in the order of their first rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Regions {
    /// Label of each pixel; 0 for background.
    labels: Plane<u32>,
    /// Parent label of each label within the same region; a root is its own parent.
    parents: Vec<u32>,
    bounds: Vec<Region>,
    regions: Vec<Region>,
}

impl Regions {
    /// Finds connected regions at least `size_min` pixels wide and high (two passes with label equivalence, Rosenfeld
    /// and Pfaltz 1966).
    pub(crate) fn find(&mut self, image: Rgb<'_>, is_of: impl Fn(&[u8]) -> bool, size_min: usize) {
        let (width, height) = (image.width(), image.height());
        self.labels.reset(width, height);
        self.parents.clear();
        self.parents.push(0);
        for y in 0..height {
            for (x, rgb) in image.row(y).chunks_exact(3).enumerate() {
                if is_of(rgb) {
                    let label = self.label_at(x, y);
                    self.labels.row_mut(y)[x] = label;
                }
            }
        }
        self.bound(size_min);
    }

    /// Label of a pixel: that of its preceding neighbours, which are merged, or a new one.
    fn label_at(&mut self, x: usize, y: usize) -> u32 {
        let mut label = if x > 0 { self.labels.row(y)[x - 1] } else { 0 };
        if y > 0 {
            for near in x.saturating_sub(1)..(x + 2).min(self.labels.width()) {
                let above = self.labels.row(y - 1)[near];
                label = match (label, above) {
                    (label, 0) => label,
                    (0, above) => above,
                    (label, above) => self.join(label, above),
                };
            }
        }
        if label == 0 {
            label = self.parents.len() as u32;
            self.parents.push(label);
        }
        label
    }

    fn root(&self, mut label: u32) -> u32 {
        while self.parents[label as usize] != label {
            label = self.parents[label as usize];
        }
        label
    }

    fn join(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.root(a), self.root(b));
        let (first, second) = (a.min(b), a.max(b));
        self.parents[second as usize] = first;
        first
    }

    fn bound(&mut self, size_min: usize) {
        for label in 1..self.parents.len() as u32 {
            // Parents have lower labels, so theirs is already resolved.
            self.parents[label as usize] = self.parents[self.parents[label as usize] as usize];
        }
        let empty = |label| Region { label, left: usize::MAX, top: usize::MAX, right: 0, bottom: 0 };
        self.bounds.clear();
        self.bounds.extend((0..self.parents.len() as u32).map(empty));
        for y in 0..self.labels.height() {
            for (x, label) in self.labels.row_mut(y).iter_mut().enumerate() {
                if *label == 0 {
                    continue;
                }
                *label = self.parents[*label as usize];
                let of = &mut self.bounds[*label as usize];
                (of.left, of.top) = (of.left.min(x), of.top.min(y));
                (of.right, of.bottom) = (of.right.max(x + 1), of.bottom.max(y + 1));
            }
        }
        self.regions.clear();
        let is_large = |of: &&Region| of.right > 0 && of.width() >= size_min && of.height() >= size_min;
        self.regions.extend(self.bounds.iter().filter(is_large));
    }

    /// Regions of sufficient size.
    pub(crate) fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// Labels of one row.
    pub(crate) fn row(&self, y: usize) -> &[u32] {
        self.labels.row(y)
    }

    /// Column range of a region in a row, from its first pixel to one past its last.
    pub(crate) fn span(&self, region: &Region, y: usize) -> Option<(usize, usize)> {
        let row = &self.labels.row(y)[region.left..region.right];
        let from = row.iter().position(|label| *label == region.label)?;
        let to = row.iter().rposition(|label| *label == region.label)?;
        Some((region.left + from, region.left + to + 1))
    }
}
