//! Rasterisation: row spans of triangles against a buffer of inverse depth.

use wide::f32x4;

use super::geometry::{Chunk, TriRaster};
use super::id::{ID_BITS, NONE};
use crate::frontend::BAND;

/// Nearest surfaces of some rows.
pub(super) struct ZBuffer<'a> {
    /// Nearness, 0 for sky.
    pub(super) w: &'a mut [f32],
    /// Chunk and triangle.
    pub(super) id: &'a mut [u32],
}

/// Ceiling of each value, clamped to the range of valid image coordinates with a margin.
fn ceil(x: f32x4) -> [i32; 4] {
    let x = x.fast_max(f32x4::splat(-2.0)).fast_min(f32x4::splat(70_000.0));
    let whole = x.fast_trunc_int().round_float();
    (whole + whole.simd_lt(x).select(f32x4::ONE, f32x4::ZERO)).fast_trunc_int().to_array()
}

/// Draws all triangles that touch the band of a row into its rows; `first_row` is the first row of the slices, and
/// `nearest` is an upper bound of nearness.
pub(super) fn draw_band(
    chunks: &[Chunk],
    width: usize,
    first_row: usize,
    nearest: f32,
    out: &mut ZBuffer<'_>,
) {
    out.w.fill(0.0);
    out.id.fill(NONE);
    let band = first_row / BAND;
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
                    span::<false>(triangle, row as f32, id, nearest, w, ids);
                } else {
                    span::<true>(triangle, row as f32, id, nearest, w, ids);
                }
            }
        }
    }
    debug_assert!(out.w.len() <= BAND * width);
}

/// Draws one row of one triangle.
fn span<const NEAR: bool>(
    triangle: &TriRaster,
    y: f32,
    id: u32,
    nearest: f32,
    w: &mut [f32],
    ids: &mut [u32],
) {
    let (mut from, mut to) = (i32::from(triangle.columns[0]), i32::from(triangle.columns[1]));
    let crossings = ceil(f32x4::new(triangle.start) + f32x4::new(triangle.step) * f32x4::splat(y));
    for (k, crossing) in crossings.into_iter().enumerate().take(3) {
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
    let limit = if NEAR { nearest } else { f32::INFINITY };
    let (from, to) = (from as usize, to as usize);
    let (first, last) = (f32x4::splat(from as f32), f32x4::splat(to as f32));
    // Groups of four, starting at the last multiple of four before the span; the image may end within a group.
    let mut x = from & !3;
    while x < to {
        let (Some(w), Some(ids)) = (w[x..].first_chunk_mut::<4>(), ids[x..].first_chunk_mut::<4>()) else {
            break;
        };
        let columns = f32x4::splat(x as f32) + f32x4::new([0.0, 1.0, 2.0, 3.0]);
        let here = f32x4::splat(slope) * columns + f32x4::splat(row);
        let before = f32x4::new(*w);
        let mut nearer = here.simd_gt(before) & columns.simd_ge(first) & columns.simd_lt(last);
        if NEAR {
            nearer &= here.simd_le(f32x4::splat(limit));
        }
        *w = nearer.select(here, before).to_array();
        // Ids are selected as bit patterns.
        let seen = f32x4::new(ids.map(f32::from_bits));
        *ids = nearer.select(f32x4::splat(f32::from_bits(id)), seen).to_array().map(f32::to_bits);
        x += 4;
    }
    for x in x.max(from)..to {
        let here = slope * x as f32 + row;
        if here > w[x] && (!NEAR || here <= limit) {
            (w[x], ids[x]) = (here, id);
        }
    }
}
