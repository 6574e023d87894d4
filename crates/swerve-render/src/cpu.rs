//! The rasteriser: triangles to planes, bands of rows to nearest triangles, pixels to light, light to bytes.
//!
//! Each pass goes through the same steps: which instances may be seen ([`resolve`]), their triangles as
//! planes over the image ([`geometry`]), what the sun and the sky see of the moving ones ([`shadow`]), and
//! then for each band of sixteen rows the nearest triangle of every pixel ([`raster`]), its light
//! ([`shade`]) and the camera's answer to that ([`sensor`]). Bands and chunks of triangles are the units of
//! work; neither depends on the number of threads, and all arithmetic is `f32` in a fixed order, without
//! fused operations.

pub(crate) mod geometry;
pub(crate) mod lens;
mod raster;
pub(crate) mod resolve;
mod rows;
pub(crate) mod sensor;
pub(crate) mod shade;
pub(crate) mod shadow;

use rayon::prelude::*;
use swerve_geom::{Map, Transform};
use wide::f32x8;

use geometry::{Chunk, Frustum, Pinhole};
use lens::LensCache;
use raster::{ID_BITS, NONE, Visible};
use resolve::{Item, rows_of};
use rows::Rows;
use sensor::Sensor;
use shade::{Kept, Lamp, Shading};
use shadow::{ShadowCache, ShadowMaps};

use crate::frame::{FrameMut, Outputs};
use crate::light::Environment;
use crate::renderer::{RenderError, View};
use crate::scene::Scene;
use crate::surface::{self, Surface};
use crate::texture::Tiles;
use crate::{Camera, SemanticClass};

/// Triangles that one piece of geometry work has at least.
const CHUNK_TRIANGLES: usize = 2048;

/// The back end for CPUs.
pub(crate) struct CpuRenderer {
    pool: Option<rayon::ThreadPool>,
    shadows: ShadowCache,
    lenses: LensCache,
    work: Work,
    sums: Vec<f32>,
}

/// Memory that passes share.
#[derive(Default)]
struct Work {
    items: Vec<Item>,
    /// Items from and up to, of each chunk.
    groups: Vec<(usize, usize)>,
    surfaces: Vec<Surface>,
    chunks: Vec<Chunk>,
    lamps: Vec<Lamp>,
    w: Vec<f32>,
    id: Vec<u32>,
}

/// One look through the shutter: an instant, a part of the rows, a share of the light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    pub(crate) at_s: f64,
    pub(crate) rows: (usize, usize),
    /// Which of how many sub-frames.
    pub(crate) sample: u32,
    pub(crate) samples: u32,
}

impl Look {
    /// All looks of a camera, in order: slab by slab, of each its sub-frames.
    pub(crate) fn all(camera: &Camera, outputs: Outputs) -> impl Iterator<Item = Self> {
        let (height, shutter) = (camera.height_px(), camera.spec().shutter);
        let samples = if outputs.rgb { shutter.blur_samples } else { 1 };
        let slabs = if shutter.readout_s > 0.0 { shutter.readout_slabs as usize } else { 1 };
        let step = height.div_ceil(slabs).next_multiple_of(geometry::BAND);
        (0..height).step_by(step).flat_map(move |from| {
            let to = (from + step).min(height);
            let middle = (0.5 * (from + to) as f64) / height as f64 - 0.5;
            (0..samples).map(move |sample| {
                let look = Self { at_s: 0.0, rows: (from, to), sample, samples };
                let spread = (f64::from(sample) + 0.5) / f64::from(samples) - 0.5;
                let part = if look.gives_ids() { 0.0 } else { spread };
                Self { at_s: shutter.readout_s * middle + shutter.exposure_s * part, ..look }
            })
        })
    }

    /// Where in the pixel it looks, from the centre: evenly spread, the sub-frame of the ids in the middle.
    pub(crate) fn offset(&self) -> [f64; 2] {
        if self.gives_ids() {
            return [0.0; 2];
        }
        // The additive recurrence of the plastic number covers the square evenly for any count.
        let k = f64::from(self.sample + 1);
        [0.754_877_666_246_693 * k, 0.569_840_290_998_053 * k].map(|x| x - x.floor() - 0.5)
    }

    /// The sub-frame that gives depth and ids.
    pub(crate) fn gives_ids(&self) -> bool {
        self.sample == self.samples / 2
    }
}

/// Threads of a renderer, if it is to have more than the caller's.
pub(crate) fn pool(threads: usize) -> Result<Option<rayon::ThreadPool>, RenderError> {
    if threads < 2 {
        return Ok(None);
    }
    let named = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("render-{k}"));
    named.build().map(Some).map_err(|error| RenderError::Threads { threads, why: error.to_string() })
}

impl CpuRenderer {
    pub(crate) fn new(threads: usize) -> Result<Self, RenderError> {
        let (shadows, lenses) = (ShadowCache::default(), LensCache::default());
        Ok(Self { pool: pool(threads)?, shadows, lenses, work: Work::default(), sums: Vec::new() })
    }

    /// One pass; sizes, weather and poses have been checked.
    pub(crate) fn render(&mut self, scene: &Scene, view: &View<'_>, out: FrameMut<'_>) {
        let Self { pool, shadows, lenses, work, sums } = self;
        let mut pass = Pass { scene, view, shadows, lenses, work, sums, parallel: pool.is_some() };
        match pool {
            Some(pool) => pool.install(move || pass.run(out)),
            None => pass.run(out),
        }
    }
}

/// One call of [`CpuRenderer::render`].
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
        for look in Look::all(camera, outputs) {
            self.look(&look, outputs, rows.part(look.rows.0, look.rows.1));
        }
        *self.sums = sums;
    }

    fn look(&mut self, look: &Look, outputs: Outputs, rows: Rows<'_>) {
        let (scene, view, parallel) = (self.scene, self.view, self.parallel);
        let lens = self.lenses.of(view.camera);
        let mut image = lens.map_or_else(|| lens::pinhole(view.camera), |lens| lens.pinhole);
        let [right, down] = look.offset();
        (image.cx, image.cy) = (image.cx - right, image.cy - down);
        let drawn = if lens.is_some() { (0, image.height) } else { look.rows };
        let map_from_camera = resolve::moved(&view.map_from_camera, &view.motion, look.at_s);
        let camera_from_map = map_from_camera.inverse();
        let frustum = Frustum::new(&image, drawn);
        let work = &mut *self.work;
        work.collect(scene, view, &camera_from_map, &frustum, look.at_s);
        let environment = Environment::new(scene, view.camera.spec().exposure);
        let with_sun = environment.has_shadows();
        let eye = map_from_camera.origin().coords;
        let sun = if with_sun { environment.sun } else { [0.0, 0.0, 1.0] };
        let nominal = view.map_from_camera.origin().coords;
        let shadows = &mut *self.shadows;
        let (seen, from_map) = (&frustum, &camera_from_map);
        let (items, groups, chunks) = (&work.items, &work.groups, &mut work.chunks);
        let ((), maps) = both(
            parallel,
            || draw_chunks(scene, &image, drawn, (items, groups), (chunks, outputs.rgb, parallel)),
            move || -> Option<&ShadowMaps> {
                if !outputs.rgb {
                    return None;
                }
                let maps = shadows.around(scene, nominal.into(), sun, with_sun);
                maps.draw_moving(scene, from_map, seen, with_sun);
                Some(maps)
            },
        );
        let centre = maps.map_or([0.0; 3], |maps| maps.centre);
        let eye = [eye.x - centre[0], eye.y - centre[1], eye.z - centre[2]].map(|x| x as f32);
        light_up(scene, &camera_from_map, &image, (centre, &mut work.lamps));
        let tiles = Tiles::get().words();
        let shading = maps.map(|maps| Shading {
            chunks: &work.chunks[..work.groups.len()],
            surfaces: &work.surfaces,
            environment: &environment,
            maps,
            lamps: &work.lamps,
            tiles,
            ray: rays(&map_from_camera, &image),
            eye,
            focal: image.fx as f32,
        });
        let sensor = Sensor::new(view.camera, &environment, view.frame, tiles);
        let target = Target {
            chunks: &work.chunks[..work.groups.len()],
            surfaces: &work.surfaces,
            shading,
            sensor,
            look: *look,
            image,
        };
        let pixels = image.width * (drawn.1 - drawn.0);
        work.w.resize(pixels.max(work.w.len()), 0.0);
        work.id.resize(pixels.max(work.id.len()), NONE);
        let (w, id) = (&mut work.w[..pixels], &mut work.id[..pixels]);
        match lens {
            None => {
                let rows = Rows { w, id, ..rows };
                rows.each_band(parallel, &|band| target.draw_and_shade(band));
            }
            Some(lens) => {
                let source =
                    Rows { w, id, ..Rows::all(image.width, image.height, FrameMut::default(), &mut []) };
                source.each_band(parallel, &|band| target.draw(band));
                let (w, id) = (&work.w[..pixels], &work.id[..pixels]);
                rows.each_band(parallel, &|band| target.shade_through(lens, (w, id), band));
            }
        }
    }
}

/// Two pieces of work, on two threads if there are.
fn both<A: Send, B: Send>(
    parallel: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if parallel { rayon::join(a, b) } else { (a(), b()) }
}

/// Direction of the ray of a pixel with depth 1, map frame: factors of x, of y, and the rest.
pub(crate) fn rays(map_from_camera: &Transform<Map, swerve_geom::Camera>, image: &Pinhole) -> [[f32; 3]; 3] {
    let rows = rows_of(map_from_camera);
    let of = |f: &dyn Fn([f64; 3]) -> f64| [f(rows[0]) as f32, f(rows[1]) as f32, f(rows[2]) as f32];
    [
        of(&|row| row[0] / image.fx),
        of(&|row| row[1] / image.fy),
        of(&|row| row[2] - row[0] * image.cx / image.fx - row[1] * image.cy / image.fy),
    ]
}

/// Sets up the triangles of all chunks.
fn draw_chunks(
    scene: &Scene,
    image: &Pinhole,
    rows: (usize, usize),
    (items, groups): (&[Item], &[(usize, usize)]),
    (chunks, shaded, parallel): (&mut Vec<Chunk>, bool, bool),
) {
    chunks.resize_with(groups.len().max(chunks.len()), Chunk::default);
    let fill = |(chunk, group): (&mut Chunk, &(usize, usize))| {
        chunk.clear(image.height);
        for item in &items[group.0..group.1] {
            chunk.add(image, rows, (scene.meshes.get(item.mesh), item), shaded);
        }
    };
    if parallel {
        chunks.par_iter_mut().zip(groups).with_max_len(1).for_each(fill);
    } else {
        chunks.iter_mut().zip(groups).for_each(fill);
    }
}

impl Work {
    /// Which instances may be seen at an instant, in chunks of enough triangles.
    fn collect(
        &mut self,
        scene: &Scene,
        view: &View<'_>,
        camera_from_map: &Transform<swerve_geom::Camera, Map>,
        frustum: &Frustum,
        at_s: f64,
    ) {
        self.items.clear();
        self.surfaces.clear();
        let hidden = view.hidden_instance.filter(|id| *id != 0);
        for instance in scene.statics().instances().iter().chain(&scene.dynamics) {
            if hidden == Some(instance.instance_id) {
                continue;
            }
            let mesh = scene.meshes.get(instance.mesh);
            let pose = resolve::moved(&instance.map_from_body, &instance.motion, at_s);
            let placement = resolve::place(camera_from_map, &pose);
            if mesh.triangles().is_empty() || !resolve::is_seen(frustum, mesh, &placement) {
                continue;
            }
            let surfaces = self.surfaces.len() as u32;
            self.surfaces.extend(mesh.materials().iter().map(|m| surface::surface(m, instance, scene)));
            let count = mesh.triangles().len();
            for from in (0..count).step_by(1 << (ID_BITS - 1)) {
                let range = (from, (from + (1 << (ID_BITS - 1))).min(count));
                self.items.push(Item { mesh: instance.mesh, placement, surfaces, range });
            }
        }
        let total: usize = self.items.iter().map(|item| item.range.1 - item.range.0).sum();
        // Ids have room for 4096 chunks.
        let least = CHUNK_TRIANGLES.max(total / 2000);
        self.groups.clear();
        let (mut from, mut count) = (0, 0);
        for (k, item) in self.items.iter().enumerate() {
            count += item.range.1 - item.range.0;
            if count >= least {
                self.groups.push((from, k + 1));
                (from, count) = (k + 1, 0);
            }
        }
        if from < self.items.len() {
            self.groups.push((from, self.items.len()));
        }
    }
}

/// Lamps that may light something in the image.
pub(crate) fn light_up(
    scene: &Scene,
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
    image: &Pinhole,
    (centre, lamps): ([f64; 3], &mut Vec<Lamp>),
) {
    lamps.clear();
    if !scene.weather.lamps_on {
        return;
    }
    for light in &scene.lights {
        let [x, y, z] = light.position_m;
        let at = (*camera_from_map * swerve_geom::Point::new(x, y, z)).coords;
        let range = f64::from(light.range_m);
        if at.z + range < 0.0 {
            continue;
        }
        let everywhere = [-1.0, 1e6];
        let (mut columns, mut rows) = (everywhere, everywhere);
        if at.z > range {
            // The sphere's outline lies within this of its centre's image.
            let (near, far) = (at.z - range, at.z + range);
            let extent = |p: f64, f: f64, c: f64| {
                let ends = [(p - range) / near, (p - range) / far, (p + range) / near, (p + range) / far];
                let low = ends.iter().copied().fold(f64::INFINITY, f64::min);
                let high = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                [f * low + c, f * high + c]
            };
            columns = extent(at.x, image.fx, image.cx);
            rows = extent(at.y, image.fy, image.cy);
        }
        let lamp = Lamp {
            position: [x - centre[0], y - centre[1], z - centre[2]].map(|v| v as f32),
            direction: light.direction.map(|v| v as f32),
            intensity: light.intensity,
            range: light.range_m,
            cos_outer: light.cos_outer,
            over_fall: 1.0 / (light.cos_inner - light.cos_outer).max(1e-3),
            columns: columns.map(|v| v as f32),
            rows: rows.map(|v| v as f32),
        };
        if lamp.shines() {
            lamps.push(lamp);
        }
    }
}

/// What a band of rows is drawn from and how.
struct Target<'a> {
    chunks: &'a [Chunk],
    surfaces: &'a [Surface],
    /// `None` if no colour is asked for.
    shading: Option<Shading<'a>>,
    sensor: Sensor<'a>,
    look: Look,
    image: Pinhole,
}

/// Whole numbers from 0 on.
const LANES: [f32; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

impl Target<'_> {
    /// Nearest triangles of a band of the pinhole image.
    fn draw(&self, band: Rows<'_>) {
        let mut visible = Visible { w: band.w, id: band.id };
        let index = band.first / geometry::BAND;
        raster::band(self.chunks, index, (band.width, band.first), self.image.near, &mut visible);
    }

    /// A band without a lens: nearest triangles, and at once what is asked of them.
    fn draw_and_shade(&self, band: Rows<'_>) {
        let Rows { width, first, count, w, id, mut sums, mut rgb, mut depth_m, semantic, instance } = band;
        let mut visible = Visible { w: &mut *w, id: &mut *id };
        raster::band(self.chunks, first / geometry::BAND, (width, first), self.image.near, &mut visible);
        if self.look.gives_ids() {
            if let Some(depth) = &mut depth_m {
                for (depth, w) in depth.iter_mut().zip(w.iter()) {
                    *depth = 1.0 / *w;
                }
            }
            self.write_ids(id, semantic, instance);
        }
        let Some(shading) = &self.shading else { return };
        let mut kept = Kept::new();
        for row in 0..count {
            let ids = &id[row * width..(row + 1) * width];
            let y = f32x8::splat((first + row) as f32);
            for from in (0..width).step_by(8) {
                let eight = eight(ids, from);
                let x = f32x8::from(LANES) + f32x8::splat(from as f32);
                let colour = shading.pixels(&eight, x, y, &mut kept);
                self.expose(
                    colour,
                    (from, first + row),
                    (row * width + from, width - from),
                    (&mut sums, &mut rgb),
                );
            }
        }
    }

    /// A band behind a lens.
    fn shade_through(&self, lens: &lens::LensMap, (w, id): (&[f32], &[u32]), band: Rows<'_>) {
        let Rows { width, first, count, mut sums, mut rgb, mut depth_m, mut semantic, mut instance, .. } =
            band;
        let mut kept = Kept::new();
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
                if self.look.gives_ids() {
                    if let Some(depth) = &mut depth_m {
                        for k in 0..some {
                            depth[at + k] = 1.0 / self.inverse_depth(ids[k], (x[k], y[k]), near[k]);
                        }
                    }
                    let cut = at..at + some;
                    let semantic = semantic.as_deref_mut().map(|s| &mut s[cut.clone()]);
                    self.write_ids(&ids[..some], semantic, instance.as_deref_mut().map(|s| &mut s[cut]));
                }
                if let Some(shading) = &self.shading {
                    let colour = shading.pixels(&ids, f32x8::from(x), f32x8::from(y), &mut kept);
                    self.expose(colour, (from, first + row), (at, some), (&mut sums, &mut rgb));
                }
            }
        }
    }

    /// Inverse depth on the exact ray, but no farther from that of the nearest pixel than its plane may bend.
    fn inverse_depth(&self, id: u32, (x, y): (f32, f32), near: f32) -> f32 {
        if id == NONE {
            return 0.0;
        }
        let plane = self.chunks[(id >> ID_BITS) as usize].raster[(id & ((1 << ID_BITS) - 1)) as usize].w;
        (plane[0] * x + (plane[1] * y + plane[2])).clamp(0.67 * near, 1.5 * near)
    }

    /// Classes and instances of triangles.
    fn write_ids(&self, ids: &[u32], mut semantic: Option<&mut [u8]>, mut instance: Option<&mut [u32]>) {
        if semantic.is_none() && instance.is_none() {
            return;
        }
        // Neighbours mostly show the same triangle.
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
        let of_triangle = &self.chunks[(id >> ID_BITS) as usize].surfaces;
        let surface = &self.surfaces[of_triangle[(id & ((1 << ID_BITS) - 1)) as usize] as usize];
        (surface.class, surface.instance)
    }

    /// Adds eight pixels to the sums of sub-frames, and writes them when they are complete.
    fn expose(
        &self,
        colour: [f32x8; 3],
        place: (usize, usize),
        (at, left): (usize, usize),
        (sums, rgb): (&mut &mut [f32], &mut Option<&mut [u8]>),
    ) {
        let some = left.min(8);
        let mut colour = colour;
        if self.look.samples > 1 {
            let sums = &mut sums[3 * at..3 * (at + some)];
            for (channel, value) in colour.iter_mut().enumerate() {
                let mut lanes = value.to_array();
                for k in 0..some {
                    let sum = &mut sums[3 * k + channel];
                    *sum = if self.look.sample == 0 { lanes[k] } else { *sum + lanes[k] };
                    lanes[k] = *sum;
                }
                *value = f32x8::from(lanes) * f32x8::splat(1.0 / self.look.samples as f32);
            }
        }
        if self.look.sample + 1 == self.look.samples
            && let Some(rgb) = rgb
        {
            self.sensor.write(colour, place, &mut rgb[3 * at..3 * (at + some)]);
        }
    }
}

/// Eight ids from a position on; beyond the end the last one again.
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

#[cfg(test)]
mod tests;
