//! Bands of rows: nearest triangles, and the requested outputs.

use swerve_scene::SemanticClass;
use wide::f32x8;

use super::geometry::Chunk;
use super::id::{ID_BITS, NONE};
use super::raster::{ZBuffer, draw_band};
use super::rows::Rows;
use super::shade::{Shading, TriangleCache};
use crate::frontend::lens::LensMap;
use crate::frontend::pinhole::Pinhole;
use crate::frontend::sensor::Sensor;
use crate::frontend::sub_frame::SubFrame;
use crate::frontend::surface::Surface;

/// Inputs for rendering bands of rows.
pub(super) struct BandPainter<'a> {
    pub(super) chunks: &'a [Chunk],
    pub(super) surfaces: &'a [Surface],
    /// `None` if colour is not requested.
    pub(super) shading: Option<Shading<'a>>,
    pub(super) sensor: Sensor<'a>,
    pub(super) sub_frame: &'a SubFrame,
    pub(super) image: Pinhole,
}

/// Lane indices.
const LANES: [f32; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Up to eight neighbouring pixels.
struct Run {
    /// Image column of the first pixel.
    column: usize,
    row: usize,
    /// Index of the first pixel in the band.
    at: usize,
    count: usize,
}

impl BandPainter<'_> {
    /// Rasterises a band of the pinhole image.
    pub(super) fn draw(&self, band: Rows<'_>) {
        let mut nearest = ZBuffer { w: band.w, id: band.id };
        draw_band(self.chunks, band.width, band.first, self.image.nearest(), &mut nearest);
    }

    /// Rasterises and shades a band without a lens.
    pub(super) fn draw_and_shade(&self, band: Rows<'_>) {
        let Rows { width, first, count, w, id, sums, mut rgb, mut depth_m, semantic, instance } = band;
        let mut nearest = ZBuffer { w: &mut *w, id: &mut *id };
        draw_band(self.chunks, width, first, self.image.nearest(), &mut nearest);
        if self.sub_frame.gives_ids() {
            if let Some(depth) = &mut depth_m {
                self.image.depths(depth, w);
            }
            self.write_ids(id, semantic, instance);
        }
        let Some(shading) = &self.shading else { return };
        let mut cache = TriangleCache::new();
        for row in 0..count {
            let ids = &id[row * width..(row + 1) * width];
            let y = f32x8::splat((first + row) as f32);
            for from in (0..width).step_by(8) {
                let eight = eight(ids, from);
                let x = f32x8::from(LANES) + f32x8::splat(from as f32);
                let colour = shading.pixels(&eight, x, y, &mut cache);
                let run = Run {
                    column: from,
                    row: first + row,
                    at: row * width + from,
                    count: (width - from).min(8),
                };
                self.expose(colour, &run, sums, rgb.as_deref_mut());
            }
        }
    }

    /// Shades a band behind a lens.
    pub(super) fn shade_through(&self, lens: &LensMap, w: &[f32], id: &[u32], band: Rows<'_>) {
        let Rows { width, first, count, sums, mut rgb, mut depth_m, mut semantic, mut instance, .. } = band;
        let mut cache = TriangleCache::new();
        for row in 0..count {
            for from in (0..width).step_by(8) {
                let some = (width - from).min(8);
                let at = row * width + from;
                let points = &lens.points[(first + row) * width + from..][..some];
                let mut ids = [NONE; 8];
                let (mut x, mut y, mut near) = ([0.0; 8], [0.0; 8], [0.0; 8]);
                for k in 0..8 {
                    let [px, py] = points[k.min(some - 1)];
                    let index = (py + 0.5) as usize * self.image.width + (px + 0.5) as usize;
                    (ids[k], x[k], y[k], near[k]) = (id[index], px, py, w[index]);
                }
                if self.sub_frame.gives_ids() {
                    if let Some(depth) = &mut depth_m {
                        for k in 0..some {
                            depth[at + k] = 1.0 / self.inverse_depth(ids[k], x[k], y[k], near[k]);
                        }
                    }
                    let cut = at..at + some;
                    let semantic = semantic.as_deref_mut().map(|s| &mut s[cut.clone()]);
                    self.write_ids(&ids[..some], semantic, instance.as_deref_mut().map(|s| &mut s[cut]));
                }
                if let Some(shading) = &self.shading {
                    let colour = shading.pixels(&ids, f32x8::from(x), f32x8::from(y), &mut cache);
                    let run = Run { column: from, row: first + row, at, count: some };
                    self.expose(colour, &run, sums, rgb.as_deref_mut());
                }
            }
        }
    }

    /// Inverse depth on the exact ray, limited to 0.67 to 1.5 times that of the nearest pixel.
    fn inverse_depth(&self, id: u32, x: f32, y: f32, near: f32) -> f32 {
        if id == NONE {
            return 0.0;
        }
        let plane = self.chunks[(id >> ID_BITS) as usize].raster[(id & ((1 << ID_BITS) - 1)) as usize].w;
        (plane[0] * x + (plane[1] * y + plane[2])).clamp(0.67 * near, 1.5 * near)
    }

    /// Writes classes and instances of triangles.
    fn write_ids(&self, ids: &[u32], mut semantic: Option<&mut [u8]>, mut instance: Option<&mut [u32]>) {
        if semantic.is_none() && instance.is_none() {
            return;
        }
        // Neighbouring pixels mostly show the same triangle.
        for (block, ids) in ids.chunks(16).enumerate() {
            let (from, first) = (16 * block, ids[0]);
            let mut label = self.label(first);
            if ids.len() == 16 && ids.iter().fold(0, |different, id| different | (id ^ first)) == 0 {
                let semantic =
                    semantic.as_deref_mut().and_then(|image| image[from..].first_chunk_mut::<16>());
                let instance =
                    instance.as_deref_mut().and_then(|image| image[from..].first_chunk_mut::<16>());
                if let Some(semantic) = semantic {
                    *semantic = [label.0; 16];
                }
                if let Some(instance) = instance {
                    *instance = [label.1; 16];
                }
                continue;
            }
            let mut last = first;
            for (k, id) in ids.iter().enumerate() {
                if *id != last {
                    (last, label) = (*id, self.label(*id));
                }
                if let Some(semantic) = &mut semantic {
                    semantic[from + k] = label.0;
                }
                if let Some(instance) = &mut instance {
                    instance[from + k] = label.1;
                }
            }
        }
    }

    /// Class and instance of a triangle.
    fn label(&self, id: u32) -> (u8, u32) {
        if id == NONE {
            return (SemanticClass::Sky as u8, 0);
        }
        let surfaces = &self.chunks[(id >> ID_BITS) as usize].surfaces;
        let surface = &self.surfaces[surfaces[(id & ((1 << ID_BITS) - 1)) as usize] as usize];
        (surface.class, surface.instance)
    }

    /// Adds eight pixels to the sums of sub-frames, and writes them after the last sub-frame.
    fn expose(&self, colour: [f32x8; 3], run: &Run, sums: &mut [f32], rgb: Option<&mut [u8]>) {
        let Run { column, row, at, count } = *run;
        let mut colour = colour;
        if self.sub_frame.samples > 1 {
            let sums = &mut sums[3 * at..3 * (at + count)];
            for (channel, value) in colour.iter_mut().enumerate() {
                let mut lanes = value.to_array();
                for k in 0..count {
                    let sum = &mut sums[3 * k + channel];
                    *sum = if self.sub_frame.sample == 0 { lanes[k] } else { *sum + lanes[k] };
                    lanes[k] = *sum;
                }
                *value = f32x8::from(lanes) * f32x8::splat(1.0 / self.sub_frame.samples as f32);
            }
        }
        if self.sub_frame.sample + 1 == self.sub_frame.samples
            && let Some(rgb) = rgb
        {
            self.sensor.write(colour, column, row, &mut rgb[3 * at..3 * (at + count)]);
        }
    }
}

/// Eight ids from a position; the last id is repeated beyond the end.
fn eight(ids: &[u32], from: usize) -> [u32; 8] {
    match ids[from..].first_chunk::<8>() {
        Some(eight) => *eight,
        None => {
            let mut eight = [ids[ids.len() - 1]; 8];
            eight[..ids.len() - from].copy_from_slice(&ids[from..]);
            eight
        }
    }
}
