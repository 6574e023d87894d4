//! Which triangle is seen at each pixel: spans of rows against a buffer of inverse depth.

use super::geometry::{BAND, Chunk, TriRaster};

/// Nothing but sky at this pixel.
pub(super) const NONE: u32 = u32::MAX;

/// Bits of an id that number the triangle within its chunk; the rest is the chunk.
pub(super) const ID_BITS: u32 = 20;

/// The nearest surfaces of some rows.
pub(super) struct Visible<'a> {
    /// Inverse depth, 0 for none.
    pub(super) w: &'a mut [f32],
    /// Chunk and triangle.
    pub(super) id: &'a mut [u32],
}

/// Smallest whole number that is not below `x`, for numbers within a few thousand of the image.
fn ceil(x: f32) -> i32 {
    let whole = x.clamp(-2.0, 70_000.0) as i32;
    whole + i32::from((whole as f32) < x)
}

/// Draws all triangles that touch a band into its rows; `first_row` is the first of the slices.
pub(super) fn band(
    chunks: &[Chunk],
    band: usize,
    (width, first_row): (usize, usize),
    near: f32,
    out: &mut Visible<'_>,
) {
    out.w.fill(0.0);
    out.id.fill(NONE);
    let last_row = first_row + out.w.len() / width;
    for (number, chunk) in chunks.iter().enumerate() {
        let Some(list) = chunk.bands.get(band) else { continue };
        for &index in list {
            let id = (number as u32) << ID_BITS | index;
            let triangle = &chunk.raster[index as usize];
            let rows =
                usize::from(triangle.rows[0]).max(first_row)..usize::from(triangle.rows[1]).min(last_row);
            for row in rows {
                let from = (row - first_row) * width;
                let (w, ids) = (&mut out.w[from..from + width], &mut out.id[from..from + width]);
                if triangle.flags & 8 == 0 {
                    span::<false>(triangle, row as f32, id, near, w, ids);
                } else {
                    span::<true>(triangle, row as f32, id, near, w, ids);
                }
            }
        }
    }
    debug_assert!(out.w.len() <= BAND * width);
}

/// One row of one triangle.
fn span<const NEAR: bool>(triangle: &TriRaster, y: f32, id: u32, near: f32, w: &mut [f32], ids: &mut [u32]) {
    let (mut from, mut to) = (i32::from(triangle.columns[0]), i32::from(triangle.columns[1]));
    for (k, [start, step]) in triangle.edges.into_iter().enumerate() {
        let crossing = ceil(start + step * y);
        if triangle.flags >> k & 1 == 1 {
            from = from.max(crossing);
        } else {
            to = to.min(crossing);
        }
    }
    if from >= to {
        return;
    }
    let row = triangle.w[1] * y + triangle.w[2];
    let slope = triangle.w[0];
    let (w, ids) = (&mut w[from as usize..to as usize], &mut ids[from as usize..to as usize]);
    let limit = if NEAR { 1.0 / near } else { f32::INFINITY };
    for (k, (w, seen)) in w.iter_mut().zip(ids).enumerate() {
        let here = slope * (from + k as i32) as f32 + row;
        let nearer = if NEAR { here > *w && here <= limit } else { here > *w };
        *w = if nearer { here } else { *w };
        *seen = if nearer { id } else { *seen };
    }
}
