//! The back end for graphics adapters.
//!
//! Each view goes through the same steps as on the CPU: what the sun and the sky see ([`super::maps`]), which
//! triangle is seen at each pixel, its light and the sensor's answer. All views of a submission are drawn side
//! by side in one image, shaded by one dispatch, and read back by one copy.

use core::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::buffers::{Grown, ReadBacks};
use super::device::Gpu;
use super::maps::{self, Corners, MapCache};
use super::meshes::{CLUSTER, MeshStore};
use super::pipelines::{DEPTH, Pipelines, VISIBLE};
use super::plan::{self, Clusters, Placed, Planes, Round, Sides, Thing};
use super::records::{Clip, LOOK_ROWS, LookRecord, NONE, Place, Records, Row, switch};
use crate::Camera;
use crate::cpu::geometry::{Frustum, Pinhole};
use crate::cpu::lens::{self, LensCache, same_lens};
use crate::cpu::resolve::{moved, rows_of};
use crate::cpu::sensor::Sensor;
use crate::cpu::shadow::{self, Base};
use crate::cpu::{self};
use crate::frame::{FrameMut, Outputs};
use crate::light::Environment;
use crate::renderer::View;
use crate::scene::{Instance, Motion, Scene};
use crate::texture::Tiles;
use swerve_geom::{Map, Transform};

/// The back end for one device.
pub(crate) struct GpuRenderer {
    gpu: Arc<Gpu>,
    pool: Option<rayon::ThreadPool>,
    pipelines: Pipelines,
    meshes: MeshStore,
    statics: Statics,
    maps: MapCache,
    no_maps: wgpu::BindGroup,
    lenses: Lenses,
    frame: Grown,
    clusters: Grown,
    rounds: Grown,
    images: Grown,
    kept: Grown,
    /// Of the sizes that are in use, the one of the latest submission last.
    targets: Vec<Target>,
    bound: Option<[wgpu::BindGroup; 2]>,
    read_backs: ReadBacks,
    records: Records,
    listed: Clusters,
}

/// What is drawn to, a layer for each look: which triangle is seen, and its depth.
struct Target {
    /// Columns, rows, layers.
    size: [u32; 3],
    visible: wgpu::TextureView,
    /// Triangles and depths of each layer.
    layers: Vec<[wgpu::TextureView; 2]>,
}

impl Target {
    fn new(gpu: &Gpu, size: [u32; 3]) -> Self {
        // In OpenGL an array of one layer is no array, and cannot be read as one.
        let least = if gpu.report().api == "gl" { 2 } else { 1 };
        let size = [size[0], size[1], size[2].max(least)];
        let [visible, depth] = [VISIBLE, DEPTH].map(|format| maps::texture(gpu, size, format));
        let layer = |texture: &wgpu::Texture, layer: u32| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        let layers = (0..size[2]).map(|k| [layer(&visible, k), layer(&depth, k)]).collect();
        let visible = visible.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        Self { size, visible, layers }
    }
}

/// What never moves, by content.
#[derive(Default)]
struct Statics {
    key: Option<(u64, bool, u64)>,
    things: Vec<Thing>,
    surfaces: Records,
    /// Surfaces are yet to be uploaded.
    is_new: bool,
    /// Records of items around the centres of cells.
    items: Vec<([f64; 3], Vec<Row>)>,
}

/// Cells of which the items are kept.
const CELLS_KEPT: usize = 8;

impl Statics {
    fn follow(&mut self, scene: &Scene, meshes: &mut MeshStore) {
        let key = (scene.statics().version(), scene.weather.lamps_on, meshes.generation);
        if self.key == Some(key) {
            return;
        }
        let Self { things, surfaces, .. } = self;
        surfaces.restart(0);
        things.clear();
        things.extend(scene.statics().instances().iter().map(|i| Thing::new(scene, i, meshes, surfaces)));
        self.items.clear();
        (self.key, self.is_new) = (Some(key), true);
    }

    /// Records of all items around a centre.
    fn around(&mut self, scene: &Scene, centre: [f64; 3]) -> &[Row] {
        let Self { items, things, .. } = self;
        let found = items.iter().position(|(of, _)| *of == centre);
        let index = found.unwrap_or_else(|| {
            if items.len() == CELLS_KEPT {
                items.remove(0);
            }
            let mut records = Records::default();
            for (instance, thing) in scene.statics().instances().iter().zip(things) {
                plan::write_item(&mut records, &instance.map_from_body, centre, thing.surfaces);
            }
            items.push((centre, records.rows));
            items.len() - 1
        });
        &items[index].1
    }
}

/// Points of lenses on the device.
struct Lenses {
    cache: LensCache,
    known: Vec<(Camera, Pinhole, u32)>,
    points: Vec<[f32; 2]>,
    uploaded: usize,
    on_device: Grown,
}

/// Sizes of what is drawn to that are kept.
const TARGETS_KEPT: usize = 4;

/// Points above which those of earlier cameras are forgotten.
const LENS_POINTS: usize = 1 << 24;

impl Lenses {
    /// The pinhole image behind a lens, and the first of its points.
    fn of(&mut self, camera: &Camera) -> Option<(Pinhole, u32)> {
        if let Some((_, image, first)) = self.known.iter().find(|(known, ..)| same_lens(known, camera)) {
            return Some((*image, *first));
        }
        let map = self.cache.of(camera)?;
        let first = self.points.len() as u32;
        self.points.extend_from_slice(&map.points);
        self.known.push((*camera, map.pinhole, first));
        Some((map.pinhole, first))
    }

    fn forget_if_large(&mut self) {
        if self.points.len() > LENS_POINTS {
            self.known.clear();
            self.points.clear();
            self.uploaded = 0;
        }
    }

    fn upload(&mut self, gpu: &Gpu) -> Result<bool, String> {
        let replaced = self.on_device.fit(gpu, size_of_val(self.points.as_slice()) as u64)?;
        if replaced {
            self.uploaded = 0;
        }
        if self.points.len() > self.uploaded {
            let new = bytemuck::cast_slice(&self.points[self.uploaded..]);
            gpu.queue().write_buffer(self.on_device.buffer(), 8 * self.uploaded as u64, new);
            self.uploaded = self.points.len();
        }
        Ok(replaced)
    }
}

/// Views around one cell.
struct Group {
    centre: [f64; 3],
    /// First rows of the items that are fixed, of those that move.
    items: [u32; 2],
    /// Maps of sun and sky, if colour is asked for.
    maps: Option<usize>,
    moves: bool,
}

/// What is drawn to the maps of a cell.
struct MapJob {
    maps: usize,
    /// Fixed or moving.
    which: usize,
    /// All that was there before goes.
    is_new: bool,
    /// Rectangles that are made empty, in the map of the sun and in that of the sky. Clearing the whole of large
    /// maps takes some adapters longer than all else.
    erased: [Range<u32>; 2],
    sun: Sides,
    bases: Range<u32>,
}

/// Looks of one cell that one dispatch shades.
struct Dispatch {
    first_look: u32,
    looks: u32,
    blocks: u32,
    maps: Option<usize>,
}

/// A round, ready to be drawn.
struct Drawn {
    looks: Vec<(Placed, Sides)>,
    dispatches: Vec<Dispatch>,
}

/// Images that the device is working on.
pub(crate) struct Pending {
    submission: wgpu::SubmissionIndex,
    buffer: Option<wgpu::Buffer>,
    bytes: u64,
    planes: Vec<Planes>,
    mapped: Arc<Mutex<Option<Result<(), String>>>>,
}

/// What of a view the steps of a submission share.
struct Prepared<'a> {
    view: &'a View<'a>,
    outputs: Outputs,
    group: usize,
    image: Pinhole,
    /// First point of its lens.
    lens: Option<u32>,
    /// Row of its record.
    record: u32,
    planes: Planes,
}

impl GpuRenderer {
    /// Starts on a device; more than one thread helps to copy images.
    pub(crate) fn new(gpu: Arc<Gpu>, pool: Option<rayon::ThreadPool>) -> Result<Self, String> {
        use wgpu::BufferUsages as Usage;
        let pipelines = Pipelines::new(&gpu);
        let read = Usage::STORAGE | Usage::COPY_DST;
        let blank = [DEPTH, DEPTH, super::pipelines::SKY, super::pipelines::SKY]
            .map(|format| maps::image(&gpu, 1, format));
        let no_maps = maps::bind(&gpu, &pipelines, [&blank[0], &blank[1], &blank[2], &blank[3]]);
        let lenses = Lenses {
            cache: LensCache::default(),
            known: Vec::new(),
            points: Vec::new(),
            uploaded: 0,
            on_device: Grown::new(&gpu, "lenses", read),
        };
        let made = Self {
            pool,
            meshes: MeshStore::new(&gpu),
            statics: Statics::default(),
            maps: MapCache::default(),
            no_maps,
            lenses,
            frame: Grown::new(&gpu, "records", read),
            clusters: Grown::new(&gpu, "clusters", read),
            rounds: Grown::new(&gpu, "rounds", Usage::UNIFORM | Usage::COPY_DST),
            images: Grown::new(&gpu, "images", Usage::STORAGE | Usage::COPY_SRC),
            kept: Grown::new(&gpu, "kept", Usage::STORAGE),
            targets: vec![Target::new(&gpu, [1; 3])],
            bound: None,
            read_backs: ReadBacks::default(),
            records: Records::default(),
            listed: Clusters::default(),
            pipelines,
            gpu,
        };
        made.gpu.trouble().map_or(Ok(made), Err)
    }

    /// The device.
    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Starts to draw views of a scene; the text says why it cannot be done.
    pub(crate) fn submit(&mut self, scene: &Scene, views: &[(View<'_>, Outputs)]) -> Result<Pending, String> {
        self.meshes.forget_if_large();
        self.lenses.forget_if_large();
        self.meshes.follow(&scene.meshes);
        self.statics.follow(scene, &mut self.meshes);
        self.listed.all.clear();
        self.records.restart(self.statics.surfaces.rows.len() as u32);
        let things: Vec<Thing> = scene
            .dynamics
            .iter()
            .map(|i| Thing::new(scene, i, &mut self.meshes, &mut self.records))
            .collect();
        let (planes, [words, kept]) = Planes::all(views)?;
        let (groups, jobs) = self.group(scene, views, &things);
        let views = self.prepare(scene, views, &groups, &planes);
        let order: Vec<_> = {
            let mut order: Vec<usize> = (0..views.len()).collect();
            order.sort_by_key(|&k| views[k].group);
            order
                .into_iter()
                .map(|k| {
                    let of = &views[k];
                    (k, of.view.camera, of.outputs, of.image, of.lens.is_some())
                })
                .collect()
        };
        let (rounds, size) = plan::rounds(&order, self.gpu.limits())?;
        let drawn: Vec<Drawn> =
            rounds.iter().map(|round| self.list(scene, &things, (&views, &groups), round)).collect();
        self.fit(size, words, kept, &drawn)?;
        let buffer = (words > 0).then(|| self.read_backs.take(&self.gpu, 4 * words));
        let mut encoder =
            self.gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for job in &jobs {
            self.draw_maps(&mut encoder, job);
        }
        let mut dispatched = 0;
        for round in &drawn {
            self.draw_round(&mut encoder, round);
            self.shade_round(&mut encoder, round, &mut dispatched);
        }
        if let Some(buffer) = &buffer {
            encoder.copy_buffer_to_buffer(self.images.buffer(), 0, buffer, 0, 4 * words);
        }
        let submission = self.gpu.queue().submit([encoder.finish()]);
        let mapped = Arc::new(Mutex::new(None));
        if let Some(buffer) = &buffer {
            let kept = Arc::clone(&mapped);
            buffer.map_async(wgpu::MapMode::Read, 0..4 * words, move |result| {
                let result = result.map_err(|error| error.to_string());
                *kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
            });
        }
        self.gpu.trouble().map_or(Ok(()), Err)?;
        Ok(Pending { submission, buffer, bytes: 4 * words, planes, mapped })
    }

    /// Waits for images and writes them to memory of the caller; the text says why there are none.
    pub(crate) fn collect(&mut self, pending: Pending, out: &mut [FrameMut<'_>]) -> Result<(), String> {
        let Pending { submission, buffer, bytes, planes, mapped } = pending;
        self.gpu.wait(Some(submission))?;
        let Some(buffer) = buffer else { return Ok(()) };
        match mapped.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(error),
            None => return Err("images are not ready after the device was waited for".to_owned()),
        }
        {
            let bytes = buffer.get_mapped_range(..bytes).map_err(|error| error.to_string())?;
            let mut copies: Vec<(&mut [u8], &[u8])> = Vec::new();
            for (out, planes) in out.iter_mut().zip(&planes) {
                let images = [
                    out.rgb.as_deref_mut(),
                    out.depth_m.as_deref_mut().map(bytemuck::cast_slice_mut),
                    out.semantic.as_deref_mut(),
                    out.instance.as_deref_mut().map(bytemuck::cast_slice_mut),
                ];
                for (k, image) in images.into_iter().enumerate() {
                    if let Some(image) = image.filter(|_| planes.first[k] != NONE) {
                        copies.extend(image.chunks_mut(PIECE).zip(bytes[planes.bytes(k)].chunks(PIECE)));
                    }
                }
            }
            let copy = |(to, from): (&mut [u8], &[u8])| to.copy_from_slice(from);
            match &self.pool {
                Some(pool) => pool.install(|| copies.into_par_iter().for_each(copy)),
                None => copies.into_iter().for_each(copy),
            }
        }
        buffer.unmap();
        self.read_backs.give(buffer);
        self.gpu.trouble().map_or(Ok(()), Err)
    }
}

/// From where a camera looks, and what it may see.
type Sight = (Transform<swerve_geom::Camera, Map>, Frustum);

/// Those of the views of a cell that show colour; `None` if what they see is not known before their looks are.
fn sights(views: &[(View<'_>, Outputs)], centre: [f64; 3]) -> Option<Vec<Sight>> {
    let in_cell = |view: &View<'_>| shadow::cell(view.map_from_camera.origin().coords.into()) == centre;
    let coloured = views.iter().filter(|(view, outputs)| outputs.rgb && in_cell(view));
    coloured
        .map(|(view, _)| {
            let camera = view.camera;
            let shutter = camera.spec().shutter;
            let still = view.motion == Motion::default();
            let simple = camera.spec().distortion.is_none() && shutter.blur_samples <= 1;
            let frustum = Frustum::new(&lens::pinhole(camera), (0, camera.height_px()));
            (simple && (still || shutter.readout_s <= 0.0)).then(|| (view.map_from_camera.inverse(), frustum))
        })
        .collect()
}

/// Bytes that one thread copies at a time.
const PIECE: usize = 1 << 19;

impl GpuRenderer {
    /// Which cells there are, where things are around them, and what their maps show.
    fn group(
        &mut self,
        scene: &Scene,
        views: &[(View<'_>, Outputs)],
        things: &[Thing],
    ) -> (Vec<Group>, Vec<MapJob>) {
        let environment = Environment::new(scene, crate::Exposure::Factor(1.0));
        let with_sun = environment.has_shadows();
        let sun = if with_sun { environment.sun } else { [0.0, 0.0, 1.0] };
        self.maps.start();
        let (mut groups, mut jobs) = (Vec::<Group>::new(), Vec::new());
        for (view, outputs) in views {
            let centre = shadow::cell(view.map_from_camera.origin().coords.into());
            let index = groups.iter().position(|group| group.centre == centre).unwrap_or_else(|| {
                let fixed = self.records.next();
                self.records.rows.extend_from_slice(self.statics.around(scene, centre));
                let moving = self.records.next();
                for (instance, thing) in scene.dynamics.iter().zip(things) {
                    plan::write_item(&mut self.records, &instance.map_from_body, centre, thing.surfaces);
                }
                groups.push(Group { centre, items: [fixed, moving], maps: None, moves: false });
                groups.len() - 1
            });
            let group = &mut groups[index];
            if !outputs.rgb || group.maps.is_some() {
                continue;
            }
            let maps = self.maps.of((&self.gpu, &self.pipelines), scene, centre, (sun, with_sun));
            group.maps = Some(maps);
            let sun_look = self.records.sun(sun);
            let instances = [scene.statics().instances(), &scene.dynamics];
            let sights = sights(views, centre);
            let shadow = with_sun.then_some(sun);
            let is_shown = |thing: &Thing| {
                let [x, y, z] = thing.middle;
                let middle = swerve_geom::Point::new(x, y, z);
                let by = |(camera, seen): &Sight| {
                    shadow::is_shadow_seen((camera, seen), middle, thing.radius(), shadow)
                };
                sights.as_ref().is_none_or(|sights| sights.iter().any(by))
            };
            for which in [0, 1] {
                let things = [self.statics.things.as_slice(), things][which];
                // What is fixed is drawn for all views that will come, what moves for those of this submission.
                let casts = |thing: &&Thing| thing.casts && (which == 0 || is_shown(thing));
                let is_new = self.maps.maps[maps].is_new[which];
                let wanted = if which == 0 { is_new } else { things.iter().any(|thing| casts(&thing)) };
                if !wanted {
                    continue;
                }
                self.maps.maps[maps].is_new[which] = false;
                group.moves |= which == 1;
                let before = core::mem::take(&mut self.maps.maps[maps].moved);
                let erased = before.map(|corners| {
                    let from = self.listed.all.len() as u32;
                    let fresh = corners.iter().filter(|_| which == 1 && !is_new);
                    self.listed.all.extend(fresh.map(|corners| [self.records.corners(corners), 0, 0, 0]));
                    from..self.listed.all.len() as u32
                });
                let mut moved: [Vec<Corners>; 2] = Default::default();
                let first = group.items[which];
                let sun = self.listed.group(|add| {
                    for (k, thing) in things.iter().enumerate().filter(|(_, t)| with_sun && casts(t)) {
                        add(thing.shape, first + 4 * k as u32, sun_look);
                        moved[0].push(plan::corners_in_sun(thing, centre, sun));
                    }
                });
                let from = self.listed.all.len() as u32;
                for (instance, _) in instances[which].iter().zip(things).filter(|(_, t)| casts(t)) {
                    let mesh = scene.meshes.get(instance.mesh);
                    if let Some(base) = Base::of(mesh, instance, centre) {
                        self.listed.all.push([self.records.base(&base), 0, 0, 0]);
                        moved[1].push(plan::corners_in_sky(&base));
                    }
                }
                let bases = from..self.listed.all.len() as u32;
                if which == 1 {
                    self.maps.maps[maps].moved = moved;
                }
                jobs.push(MapJob { maps, which, is_new, erased, sun, bases });
            }
        }
        (groups, jobs)
    }

    /// Writes the records of the views.
    fn prepare<'a>(
        &mut self,
        scene: &Scene,
        views: &'a [(View<'a>, Outputs)],
        groups: &[Group],
        planes: &[Planes],
    ) -> Vec<Prepared<'a>> {
        let tiles = Tiles::get().words();
        let mut prepared = Vec::with_capacity(views.len());
        for ((view, outputs), planes) in views.iter().zip(planes) {
            let centre = shadow::cell(view.map_from_camera.origin().coords.into());
            let group = groups.iter().position(|g| g.centre == centre).expect("each view's cell has a group");
            let lens = self.lenses.of(view.camera);
            let light = Environment::new(scene, view.camera.spec().exposure);
            let sensor = Sensor::new(view.camera, &light, view.frame, tiles);
            let mut switches = if light.has_shadows() { switch::SUN } else { 0 };
            if groups[group].moves {
                switches |= switch::MOVING;
            }
            if view.camera.is_orthographic() {
                switches |= switch::FLAT;
            }
            let place = Place { centre, switches, quantiles: self.pipelines.quantiles };
            prepared.push(Prepared {
                view,
                outputs: *outputs,
                group,
                image: lens.map_or_else(|| lens::pinhole(view.camera), |(image, _)| image),
                lens: lens.map(|(_, first)| first),
                record: self.records.view(&light, &sensor, &place),
                planes: *planes,
            });
        }
        prepared
    }

    /// Writes the looks of a round and lists what each of them draws.
    fn list(
        &mut self,
        scene: &Scene,
        things: &[Thing],
        (views, groups): (&[Prepared<'_>], &[Group]),
        round: &Round,
    ) -> Drawn {
        let first = self.records.reserve_looks(round.looks.len());
        let mut drawn = Drawn { looks: Vec::with_capacity(round.looks.len()), dispatches: Vec::new() };
        let mut last_group = None;
        for (k, placed) in round.looks.iter().enumerate() {
            let at = first + k as u32 * LOOK_ROWS;
            let view = &views[placed.view];
            let sides = self.list_look(scene, things, (view, &groups[view.group]), (placed, at));
            drawn.looks.push((*placed, sides));
            let rows = placed.look.rows.1 - placed.look.rows.0;
            let blocks = (rows * view.view.camera.width_px()).div_ceil(64) as u32;
            if last_group != Some(view.group) {
                last_group = Some(view.group);
                let maps = groups[view.group].maps;
                drawn.dispatches.push(Dispatch { first_look: at, looks: 0, blocks: 0, maps });
            }
            let dispatch = drawn.dispatches.last_mut().expect("one was pushed for the first look");
            dispatch.looks += 1;
            dispatch.blocks = dispatch.blocks.max(blocks);
        }
        drawn
    }

    fn list_look(
        &mut self,
        scene: &Scene,
        things: &[Thing],
        (prepared, group): (&Prepared<'_>, &Group),
        (placed, at): (&Placed, u32),
    ) -> Sides {
        let (view, look) = (prepared.view, &placed.look);
        let mut image = prepared.image;
        let [right, down] = look.offset();
        (image.cx, image.cy) = (image.cx - right, image.cy - down);
        let rows = if prepared.lens.is_some() { (0, image.height) } else { look.rows };
        let map_from_camera = moved(&view.map_from_camera, &view.motion, look.at_s);
        let camera_from_map = map_from_camera.inverse();
        let frustum = Frustum::new(&image, rows);
        let origin: [f64; 3] = map_from_camera.origin().coords.into();
        let eye = [0, 1, 2].map(|k| origin[k] - group.centre[k]);
        let first_lamp = self.records.next();
        let mut lamps = Vec::new();
        if prepared.outputs.rgb {
            cpu::light_up(scene, &camera_from_map, &image, (group.centre, &mut lamps));
            lamps.iter().for_each(|lamp| self.records.lamp(lamp));
        }
        let planes = &prepared.planes;
        let origin = if image.flat {
            cpu::origins(&map_from_camera, &image, group.centre)
        } else {
            [[0.0; 3], [0.0; 3], eye.map(|x| x as f32)]
        };
        let record = LookRecord {
            clip: Clip::of(&image, rows, &rows_of(&camera_from_map), eye),
            ray: cpu::rays(&map_from_camera, &image),
            origin,
            focal: image.fx as f32,
            place: [placed.layer, 0, view.camera.width_px() as u32, view.camera.height_px() as u32],
            rows: [look.rows.0 as u32, look.rows.1 as u32, look.sample, look.samples],
            planes: planes.first,
            lens: [prepared.lens.unwrap_or(NONE), planes.kept, 0, planes.sums],
            light: [first_lamp, lamps.len() as u32, prepared.record, 0],
        };
        self.records.look(at, &record);
        let hidden = view.hidden_instance.filter(|id| *id != 0);
        let seen = |middle: [f64; 3], radius: f32| {
            let [x, y, z] = middle;
            let at = (camera_from_map * swerve_geom::Point::new(x, y, z)).coords;
            frustum.touches([at.x as f32, at.y as f32, at.z as f32], radius)
        };
        let Self { listed, records, statics, .. } = self;
        let fixed = scene.statics().instances().iter().zip(&statics.things);
        let moving = scene.dynamics.iter().zip(things);
        listed.group(|add| {
            let mut each = |instance: &Instance, thing: &Thing, item: u32| {
                if hidden == Some(instance.instance_id) {
                    return;
                }
                if look.at_s == 0.0 || instance.motion == Motion::default() {
                    if seen(thing.middle, thing.radius()) {
                        add(thing.shape, item, at);
                    }
                    return;
                }
                let pose = moved(&instance.map_from_body, &instance.motion, look.at_s);
                if seen(thing.middle_at(&pose), thing.radius()) {
                    let item = records.next();
                    plan::write_item(records, &pose, group.centre, thing.surfaces);
                    add(thing.shape, item, at);
                }
            };
            for (k, (instance, thing)) in fixed.enumerate() {
                each(instance, thing, group.items[0] + 4 * k as u32);
            }
            for (k, (instance, thing)) in moving.enumerate() {
                each(instance, thing, group.items[1] + 4 * k as u32);
            }
        })
    }

    /// Makes room for everything and brings it to the device.
    fn fit(&mut self, size: [u32; 3], words: u64, kept: u64, drawn: &[Drawn]) -> Result<(), String> {
        let gpu = &self.gpu;
        let queue = gpu.queue();
        if self.listed.all.len() > (u32::MAX as usize) / CLUSTER {
            return Err(format!("{} clusters of triangles are too many", self.listed.all.len()));
        }
        let fixed = 16 * self.statics.surfaces.rows.len() as u64;
        let mut replaced = self.meshes.upload(gpu)? | self.lenses.upload(gpu)?;
        if self.frame.fit(gpu, fixed + size_of_val(self.records.rows.as_slice()) as u64)? {
            (self.statics.is_new, replaced) = (true, true);
        }
        if core::mem::take(&mut self.statics.is_new) {
            let rows = bytemuck::cast_slice(&self.statics.surfaces.rows);
            queue.write_buffer(self.frame.buffer(), 0, rows);
        }
        queue.write_buffer(self.frame.buffer(), fixed, bytemuck::cast_slice(&self.records.rows));
        replaced |= self.clusters.fit(gpu, size_of_val(self.listed.all.as_slice()) as u64)?;
        queue.write_buffer(self.clusters.buffer(), 0, bytemuck::cast_slice(&self.listed.all));
        let step = self.round_step() / 4;
        let mut rounds = Vec::new();
        for dispatch in drawn.iter().flat_map(|round| &round.dispatches) {
            rounds.extend([dispatch.first_look, LOOK_ROWS, 0, 0]);
            rounds.resize(rounds.len().next_multiple_of(step), 0_u32);
        }
        replaced |= self.rounds.fit(gpu, size_of_val(rounds.as_slice()) as u64)?;
        queue.write_buffer(self.rounds.buffer(), 0, bytemuck::cast_slice(&rounds));
        replaced |= self.images.fit(gpu, 4 * words)?;
        replaced |= self.kept.fit(gpu, 4 * kept)?;
        replaced |= self.take_target(size);
        if replaced || self.bound.is_none() {
            self.bound = Some(self.bind());
        }
        Ok(())
    }

    /// Puts what is drawn to last; whether it is another one now. Of just this size: some adapters take longer to
    /// clear what is too large than to draw.
    fn take_target(&mut self, size: [u32; 3]) -> bool {
        let fits = |target: &Target| target.size[..2] == size[..2] && target.size[2] >= size[2];
        if fits(self.target()) {
            return false;
        }
        let target = match self.targets.iter().position(fits) {
            Some(index) => self.targets.remove(index),
            None => {
                self.targets.retain(|target| target.size[..2] != size[..2]);
                Target::new(&self.gpu, size)
            }
        };
        if self.targets.len() == TARGETS_KEPT {
            self.targets.remove(0);
        }
        self.targets.push(target);
        true
    }

    fn target(&self) -> &Target {
        self.targets.last().expect("there is one from the start")
    }

    /// Bytes from one round's numbers to those of the next.
    fn round_step(&self) -> usize {
        16_usize.next_multiple_of(self.gpu.limits().min_uniform_buffer_offset_alignment.max(16) as usize)
    }

    fn bind(&self) -> [wgpu::BindGroup; 2] {
        let device = self.gpu.device();
        fn whole(binding: u32, buffer: &wgpu::Buffer) -> (u32, wgpu::BindingResource<'_>) {
            (binding, wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size: None }))
        }
        let group = |layout, entries: Vec<(u32, wgpu::BindingResource<'_>)>| {
            let entries: Vec<_> = entries
                .into_iter()
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
        };
        let [vertices, triangles] = &self.meshes.on_device;
        let shapes = vec![
            whole(0, vertices.buffer()),
            whole(1, triangles.buffer()),
            whole(2, self.frame.buffer()),
            whole(3, self.clusters.buffer()),
        ];
        let one = wgpu::BufferBinding {
            buffer: self.rounds.buffer(),
            offset: 0,
            size: core::num::NonZeroU64::new(16),
        };
        let pixels = vec![
            (0, wgpu::BindingResource::Buffer(one)),
            whole(1, &self.pipelines.tiles),
            whole(2, self.lenses.on_device.buffer()),
            whole(3, self.images.buffer()),
            whole(4, self.kept.buffer()),
            (5, wgpu::BindingResource::TextureView(&self.target().visible)),
        ];
        [group(&self.pipelines.triangles, shapes), group(&self.pipelines.pixels, pixels)]
    }

    fn bound(&self) -> &[wgpu::BindGroup; 2] {
        self.bound.as_ref().expect("everything is bound before something is drawn")
    }

    /// Draws what casts shadows to one of the maps.
    fn draw_maps(&self, encoder: &mut wgpu::CommandEncoder, job: &MapJob) {
        let maps = &self.maps.maps[job.maps];
        let [shapes, _] = self.bound();
        let mut depth = cleared_depth(&maps.sun[job.which]);
        let mut colour = cleared(&maps.sky[job.which]);
        if !job.is_new {
            depth.depth_ops =
                Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store });
            colour.ops.load = wgpu::LoadOp::Load;
        }
        let quads = |pass: &mut wgpu::RenderPass<'_>, pipeline, which: &Range<u32>| {
            if !which.is_empty() {
                pass.set_bind_group(0, shapes, &[]);
                pass.set_pipeline(pipeline);
                pass.draw(0..6, which.clone());
            }
        };
        let [no_sun, no_sky] = &self.pipelines.erase;
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sun"),
            depth_stencil_attachment: Some(depth),
            ..wgpu::RenderPassDescriptor::default()
        });
        quads(&mut pass, no_sun, &job.erased[0]);
        self.draw_sides(&mut pass, &self.pipelines.sun, &job.sun);
        drop(pass);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sky"),
            color_attachments: &[Some(colour)],
            ..wgpu::RenderPassDescriptor::default()
        });
        quads(&mut pass, no_sky, &job.erased[1]);
        quads(&mut pass, &self.pipelines.hide, &job.bases);
    }

    fn draw_round(&self, encoder: &mut wgpu::CommandEncoder, round: &Drawn) {
        for (placed, sides) in &round.looks {
            let [visible, depth] = &self.target().layers[placed.layer as usize];
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("triangles"),
                color_attachments: &[Some(cleared(visible))],
                depth_stencil_attachment: Some(cleared_depth(depth)),
                ..wgpu::RenderPassDescriptor::default()
            });
            let (width, height) = placed.size;
            pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(0, 0, width, height);
            self.draw_sides(&mut pass, &self.pipelines.draw, sides);
        }
    }

    /// Draws clusters, those with one side first.
    fn draw_sides(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &[wgpu::RenderPipeline; 2],
        sides: &Sides,
    ) {
        pass.set_bind_group(0, &self.bound()[0], &[]);
        for (pipeline, clusters) in pipelines.iter().zip(sides) {
            if !clusters.is_empty() {
                pass.set_pipeline(pipeline);
                pass.draw(0..3 * CLUSTER as u32, clusters.clone());
            }
        }
    }

    fn shade_round(&self, encoder: &mut wgpu::CommandEncoder, round: &Drawn, dispatched: &mut usize) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let [shapes, pixels] = self.bound();
        pass.set_bind_group(0, shapes, &[]);
        // Of the second step each unit of work has four pixels.
        for (pipeline, pixels_each) in self.pipelines.shade.iter().zip([1, 4]) {
            pass.set_pipeline(pipeline);
            for (k, dispatch) in round.dispatches.iter().enumerate() {
                pass.set_bind_group(1, pixels, &[((*dispatched + k) * self.round_step()) as u32]);
                let maps = dispatch.maps.map_or(&self.no_maps, |maps| &self.maps.maps[maps].bound);
                pass.set_bind_group(2, maps, &[]);
                let blocks = dispatch.blocks.div_ceil(pixels_each);
                let across = blocks.min(BLOCKS_ACROSS);
                pass.dispatch_workgroups(across, dispatch.looks, blocks.div_ceil(BLOCKS_ACROSS));
            }
        }
        *dispatched += round.dispatches.len();
    }
}

/// Blocks of 64 pixels in the first dimension of a dispatch, of which `pass.wgsl` knows.
const BLOCKS_ACROSS: u32 = 32768;

fn cleared(view: &wgpu::TextureView) -> wgpu::RenderPassColorAttachment<'_> {
    let ops =
        wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store };
    wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops }
}

fn cleared_depth(view: &wgpu::TextureView) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store };
    wgpu::RenderPassDepthStencilAttachment { view, depth_ops: Some(ops), stencil_ops: None }
}
