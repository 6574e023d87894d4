//! CPU back end: triangles to planes, bands of rows to nearest triangles, pixels to radiance, radiance to bytes.
//!
//! Each sub-frame goes through the same steps: visible instances ([`cull`]), their triangles as planes over the image
//! ([`geometry`]), shadow maps of sun and sky for moving instances ([`shadow_maps`]), and then for each band of sixteen
//! rows the nearest triangle of every pixel ([`raster`]), its shading ([`shade`]) and the camera's response
//! ([`develop`]). Bands and chunks of triangles are the units of work; neither depends on the number of threads, and
//! all arithmetic is `f32` in a fixed order, without fused operations.

mod band;
mod cull;
mod develop;
mod geometry;
mod id;
mod raster;
mod rows;
mod shade;
mod shadow_maps;

use core::ops::Range;

use rayon::prelude::*;
use swerve_scene::Scene;

use crate::View;
use crate::error::RenderError;
use crate::frame::{FrameMut, Outputs};
use crate::frontend::Threads;
use crate::frontend::lamp::{Lamp, collect_lamps};
use crate::frontend::lens::LensCache;
use crate::frontend::light::Environment;
use crate::frontend::sensor::Sensor;
use crate::frontend::sub_frame::SubFrame;
use crate::frontend::texture::Tiles;
use crate::frontend::viewpoint::Viewpoint;
use band::BandPainter;
use cull::Culled;
use geometry::{Chunk, Viewport};
use id::NONE;
use rows::Rows;
use shade::{ParallelRays, Shading};
use shadow_maps::{ShadowCache, ShadowMaps};

/// CPU back end.
pub(crate) struct CpuRenderer {
    threads: Threads,
    shadows: ShadowCache,
    lenses: LensCache,
    work: Work,
    sums: Vec<f32>,
}

/// Buffers shared by sub-frames.
#[derive(Default)]
struct Work {
    culled: Culled,
    chunks: Vec<Chunk>,
    lamps: Vec<Lamp>,
    w: Vec<f32>,
    id: Vec<u32>,
}

impl CpuRenderer {
    pub(crate) fn new(threads: usize) -> Result<Self, RenderError> {
        let (shadows, lenses) = (ShadowCache::default(), LensCache::default());
        let threads = Threads::new(threads)?;
        Ok(Self { threads, shadows, lenses, work: Work::default(), sums: Vec::new() })
    }

    /// Renders one pass; sizes, weather and poses must have been checked.
    pub(crate) fn render(&mut self, scene: &Scene, view: &View<'_>, out: FrameMut<'_>) {
        let Self { threads, shadows, lenses, work, sums } = self;
        threads.run(|parallel| Pass { scene, view, shadows, lenses, work, sums, parallel }.run(out));
    }
}

/// State of one call of [`CpuRenderer::render`].
struct Pass<'a> {
    scene: &'a Scene,
    view: &'a View<'a>,
    shadows: &'a mut ShadowCache,
    lenses: &'a mut LensCache,
    work: &'a mut Work,
    sums: &'a mut Vec<f32>,
    parallel: bool,
}

impl Pass<'_> {
    fn run(&mut self, out: FrameMut<'_>) {
        let camera = self.view.camera;
        let outputs = out.outputs();
        let (width, height) = (camera.width_px(), camera.height_px());
        let samples = if outputs.rgb { camera.spec().shutter.blur_samples } else { 1 };
        let needed = if samples > 1 { 3 * width * height } else { 0 };
        self.sums.resize(needed, 0.0);
        let mut sums = std::mem::take(self.sums);
        let mut rows = Rows::all(width, height, out, &mut sums);
        for sub_frame in SubFrame::all(camera, outputs) {
            self.sub_frame(&sub_frame, outputs, rows.part(&sub_frame.rows));
        }
        *self.sums = sums;
    }

    fn sub_frame(&mut self, sub_frame: &SubFrame, outputs: Outputs, rows: Rows<'_>) {
        let Self { scene, view, shadows, lenses, work, parallel, .. } = self;
        let (scene, view, parallel): (&Scene, &View<'_>, bool) = (scene, view, *parallel);
        let lens = lenses.get(view.camera);
        let from = Viewpoint::new(view, sub_frame, lens.map(|lens| lens.pinhole));
        let Work { culled, chunks, lamps, w, id } = &mut **work;
        culled.collect(scene, view, &from.camera_from_map, &from.frustum, sub_frame.at_s);
        let environment = Environment::new(scene, view.camera.spec().exposure);
        let nominal = view.map_from_camera.origin().coords;
        let viewport = Viewport::new(&from.image, from.rows.clone());
        let ((), maps) = both(
            parallel,
            || set_up_chunks(scene, &viewport, culled, chunks, outputs.rgb, parallel),
            || -> Option<&ShadowMaps> {
                if !outputs.rgb {
                    return None;
                }
                let maps = shadows.around(scene, nominal.into(), environment.shadow_sun());
                maps.draw_moving(scene, &from.camera_from_map, &from.frustum);
                Some(maps)
            },
        );
        collect_lamps(scene, &from.camera_from_map, &from.image, maps.map_or([0.0; 3], |m| m.centre), lamps);
        let (chunks, tiles) = (&chunks[..culled.chunks.len()], Tiles::get().words());
        let painter = BandPainter {
            chunks,
            surfaces: &culled.surfaces,
            shading: maps.map(|maps| shading(&from, maps, culled, chunks, &environment, lamps)),
            sensor: Sensor::new(view.camera, &environment, view.frame, tiles),
            sub_frame,
            image: from.image,
        };
        let pixels = from.image.width * from.rows.len();
        w.resize(pixels.max(w.len()), 0.0);
        id.resize(pixels.max(id.len()), NONE);
        let (w, id) = (&mut w[..pixels], &mut id[..pixels]);
        match lens {
            None => {
                let rows = Rows { w, id, ..rows };
                rows.each_band(parallel, &|band| painter.draw_and_shade(band));
            }
            Some(lens) => {
                let (width, height) = (from.image.width, from.image.height);
                let source = Rows {
                    w: &mut *w,
                    id: &mut *id,
                    ..Rows::all(width, height, FrameMut::default(), &mut [])
                };
                source.each_band(parallel, &|band| painter.draw(band));
                let (w, id) = (&*w, &*id);
                rows.each_band(parallel, &|band| painter.shade_through(lens, w, id, band));
            }
        }
    }
}

/// Inputs of shading in a sub-frame.
fn shading<'a>(
    from: &Viewpoint,
    maps: &'a ShadowMaps,
    culled: &'a Culled,
    chunks: &'a [Chunk],
    environment: &'a Environment,
    lamps: &'a [Lamp],
) -> Shading<'a> {
    let (at, centre) = (from.map_from_camera.origin().coords, maps.centre);
    let flat = from.image.flat.then(|| ParallelRays {
        origin: from.image.ray_origins(&from.map_from_camera, centre),
        far: from.image.far,
    });
    Shading {
        chunks,
        surfaces: &culled.surfaces,
        environment,
        maps,
        lamps,
        tiles: Tiles::get().words(),
        ray: from.image.ray_directions(&from.map_from_camera),
        eye: [at.x - centre[0], at.y - centre[1], at.z - centre[2]].map(|x| x as f32),
        flat,
        focal: from.image.fx as f32,
    }
}

/// Runs two tasks, on two threads if available.
fn both<A: Send, B: Send>(
    parallel: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if parallel { rayon::join(a, b) } else { (a(), b()) }
}

/// Sets up the triangles of all chunks.
fn set_up_chunks(
    scene: &Scene,
    viewport: &Viewport<'_>,
    culled: &Culled,
    chunks: &mut Vec<Chunk>,
    shaded: bool,
    parallel: bool,
) {
    chunks.resize_with(culled.chunks.len().max(chunks.len()), Chunk::default);
    let fill = |(chunk, items): (&mut Chunk, &Range<usize>)| {
        chunk.clear(viewport.height());
        for item in &culled.items[items.clone()] {
            chunk.add(viewport, scene.meshes.get(item.mesh), item, shaded);
        }
    };
    if parallel {
        chunks.par_iter_mut().zip(&culled.chunks).with_max_len(1).for_each(fill);
    } else {
        chunks.iter_mut().zip(&culled.chunks).for_each(fill);
    }
}

#[cfg(test)]
mod shader_tests;
#[cfg(test)]
mod tests;
