//! Rows of all images of a pass, divided among threads.

use core::ops::Range;

use crate::frame::FrameMut;
use crate::frontend::BAND;

/// Range of rows of the images, starting at `first`.
pub(super) struct Rows<'a> {
    pub(super) width: usize,
    pub(super) first: usize,
    pub(super) count: usize,
    /// Inverse depth and ids of the pinhole image; empty if it is already drawn.
    pub(super) w: &'a mut [f32],
    pub(super) id: &'a mut [u32],
    /// Sums of sub-frames; empty if there is only one sub-frame.
    pub(super) sums: &'a mut [f32],
    pub(super) rgb: Option<&'a mut [u8]>,
    pub(super) depth_m: Option<&'a mut [f32]>,
    pub(super) semantic: Option<&'a mut [u8]>,
    pub(super) instance: Option<&'a mut [u32]>,
}

/// First `at` elements and the rest; two empty slices for an empty slice.
fn split<T>(slice: &mut [T], at: usize) -> (&mut [T], &mut [T]) {
    if slice.is_empty() { (&mut [], slice) } else { slice.split_at_mut(at) }
}

fn split_some<T>(slice: Option<&mut [T]>, at: usize) -> (Option<&mut [T]>, Option<&mut [T]>) {
    match slice {
        Some(slice) => {
            let (a, b) = slice.split_at_mut(at);
            (Some(a), Some(b))
        }
        None => (None, None),
    }
}

impl<'a> Rows<'a> {
    /// All rows of the caller's images.
    pub(super) fn all(width: usize, height: usize, out: FrameMut<'a>, sums: &'a mut [f32]) -> Self {
        Self {
            width,
            first: 0,
            count: height,
            w: &mut [],
            id: &mut [],
            sums,
            rgb: out.rgb,
            depth_m: out.depth_m,
            semantic: out.semantic,
            instance: out.instance,
        }
    }

    /// Reborrows some rows for one pass.
    pub(super) fn part(&mut self, rows: &Range<usize>) -> Rows<'_> {
        let (a, b) = (rows.start * self.width, rows.end * self.width);
        fn cut<T>(slice: &mut [T], a: usize, b: usize) -> &mut [T] {
            if slice.is_empty() { slice } else { &mut slice[a..b] }
        }
        Rows {
            width: self.width,
            first: rows.start,
            count: rows.len(),
            w: cut(self.w, a, b),
            id: cut(self.id, a, b),
            sums: cut(self.sums, 3 * a, 3 * b),
            rgb: self.rgb.as_deref_mut().map(|s| cut(s, 3 * a, 3 * b)),
            depth_m: self.depth_m.as_deref_mut().map(|s| cut(s, a, b)),
            semantic: self.semantic.as_deref_mut().map(|s| cut(s, a, b)),
            instance: self.instance.as_deref_mut().map(|s| cut(s, a, b)),
        }
    }

    fn split_at(self, rows: usize) -> (Self, Self) {
        let at = rows * self.width;
        let (w, w2) = split(self.w, at);
        let (id, id2) = split(self.id, at);
        let (sums, sums2) = split(self.sums, 3 * at);
        let (rgb, rgb2) = split_some(self.rgb, 3 * at);
        let (depth_m, depth2) = split_some(self.depth_m, at);
        let (semantic, semantic2) = split_some(self.semantic, at);
        let (instance, instance2) = split_some(self.instance, at);
        let width = self.width;
        let upper =
            Self { width, first: self.first, count: rows, w, id, sums, rgb, depth_m, semantic, instance };
        let (first, count) = (self.first + rows, self.count - rows);
        let lower = Rows {
            width,
            first,
            count,
            w: w2,
            id: id2,
            sums: sums2,
            rgb: rgb2,
            depth_m: depth2,
            semantic: semantic2,
            instance: instance2,
        };
        (upper, lower)
    }

    /// Calls `work` for each band of rows, in parallel if this is called within a thread pool.
    pub(super) fn each_band(self, parallel: bool, work: &(impl Fn(Rows<'_>) + Sync)) {
        let bands = self.count.div_ceil(BAND);
        if bands <= 1 {
            if bands == 1 {
                work(self);
            }
            return;
        }
        let (upper, lower) = self.split_at(bands / 2 * BAND);
        if parallel {
            rayon::join(|| upper.each_band(true, work), || lower.each_band(true, work));
        } else {
            upper.each_band(false, work);
            lower.each_band(false, work);
        }
    }
}
