//! Renderer on one device.
//!
//! Each view goes through the same steps as on the CPU: maps of sun and sky ([`super::maps`]), the visible triangle of
//! each pixel, its shading and the sensor's response. All views of a submission are drawn side by side in one image,
//! shaded by one dispatch, and read back by one copy.

use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use swerve_gpu::{Gpu, GrowingBuffer, wgpu};
use swerve_scene::Scene;

use super::instance::DrawInstance;
use super::layout::ImageLayout;
use super::lens_points::LensPoints;
use super::maps::{self, MapCache};
use super::meshes::MeshStore;
use super::pipelines::{DEPTH, Pipelines, SKY};
use super::plan::{self, Clusters, Ordered};
use super::prepared::Shown;
use super::read_back::ReadBacks;
use super::records::{NONE, Records};
use super::statics::Statics;
use super::target::Target;
use crate::View;
use crate::frame::{FrameMut, Outputs};
use crate::frontend::Threads;

/// Back end for one device.
pub(crate) struct GpuRenderer {
    pub(super) gpu: Arc<Gpu>,
    pub(super) threads: Threads,
    pub(super) pipelines: Pipelines,
    pub(super) meshes: MeshStore,
    pub(super) statics: Statics,
    pub(super) maps: MapCache,
    pub(super) no_maps: wgpu::BindGroup,
    pub(super) lenses: LensPoints,
    pub(super) frame: GrowingBuffer,
    pub(super) clusters: GrowingBuffer,
    pub(super) rounds: GrowingBuffer,
    pub(super) images: GrowingBuffer,
    pub(super) kept: GrowingBuffer,
    /// Targets of recently used sizes, the latest one last.
    pub(super) targets: Vec<Target>,
    pub(super) bound: Option<[wgpu::BindGroup; 2]>,
    pub(super) read_backs: ReadBacks,
    pub(super) records: Records,
    pub(super) listed: Clusters,
}

/// Bytes copied by one thread at a time.
const PIECE: usize = 1 << 19;

/// Images in progress on the device.
pub(crate) struct InFlight {
    submission: wgpu::SubmissionIndex,
    buffer: Option<wgpu::Buffer>,
    bytes: u64,
    layouts: Vec<ImageLayout>,
    mapped: Arc<Mutex<Option<Result<(), String>>>>,
}

impl GpuRenderer {
    /// Starts the back end on a device; additional threads help to copy images.
    pub(crate) fn new(gpu: Arc<Gpu>, threads: Threads) -> Result<Self, String> {
        use wgpu::BufferUsages as Usage;
        let pipelines = Pipelines::new(&gpu);
        let read = Usage::STORAGE | Usage::COPY_DST;
        let blank = [DEPTH, DEPTH, SKY, SKY].map(|format| maps::image(&gpu, 1, format));
        let no_maps = maps::bind(&gpu, &pipelines, [&blank[0], &blank[1], &blank[2], &blank[3]]);
        let made = Self {
            threads,
            meshes: MeshStore::new(&gpu),
            statics: Statics::default(),
            maps: MapCache::default(),
            no_maps,
            lenses: LensPoints::new(&gpu),
            frame: GrowingBuffer::new(&gpu, "records", read),
            clusters: GrowingBuffer::new(&gpu, "clusters", read),
            rounds: GrowingBuffer::new(&gpu, "rounds", Usage::UNIFORM | Usage::COPY_DST),
            images: GrowingBuffer::new(&gpu, "images", Usage::STORAGE | Usage::COPY_SRC),
            kept: GrowingBuffer::new(&gpu, "kept", Usage::STORAGE),
            targets: vec![Target::new(&gpu, [1; 3])],
            bound: None,
            read_backs: ReadBacks::default(),
            records: Records::default(),
            listed: Clusters::default(),
            pipelines,
            gpu,
        };
        made.gpu.check()?;
        Ok(made)
    }

    /// Device of the renderer.
    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Starts to draw views of a scene; the error is the reason of a failure.
    pub(crate) fn submit(
        &mut self,
        scene: &Scene,
        views: &[(View<'_>, Outputs)],
    ) -> Result<InFlight, String> {
        self.meshes.forget_if_large();
        self.lenses.forget_if_large();
        self.meshes.follow(&scene.meshes);
        self.statics.follow(scene, &mut self.meshes);
        self.listed.all.clear();
        self.records.restart(self.statics.surfaces.rows.len() as u32);
        let moving: Vec<DrawInstance> = scene
            .dynamics
            .iter()
            .map(|instance| DrawInstance::new(scene, instance, &mut self.meshes, &mut self.records))
            .collect();
        let (layouts, words) = ImageLayout::all(views)?;
        let (cells, jobs) = self.cells(scene, views, &moving);
        let views = self.prepare(scene, views, &cells, &layouts);
        let mut order: Vec<Ordered<'_>> = (0..views.len()).map(|k| Ordered::new(k, &views[k])).collect();
        order.sort_by_key(|ordered| views[ordered.view].cell);
        let (rounds, size) = plan::rounds(&order, self.gpu.limits())?;
        let shown = Shown { scene, moving: &moving, views: &views, cells: &cells };
        let rounds: Vec<_> = rounds.iter().map(|round| self.list(&shown, round)).collect();
        self.upload(size, words, &rounds)?;
        let bytes = 4 * words.images;
        let buffer = (bytes > 0).then(|| self.read_backs.take(&self.gpu, bytes));
        let mut encoder =
            self.gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for job in &jobs {
            self.draw_maps(&mut encoder, job);
        }
        let mut dispatched = 0;
        for round in &rounds {
            self.draw_round(&mut encoder, round);
            self.shade_round(&mut encoder, round, &mut dispatched);
        }
        if let Some(buffer) = &buffer {
            encoder.copy_buffer_to_buffer(self.images.get(), 0, buffer, 0, bytes);
        }
        let submission = self.gpu.queue().submit([encoder.finish()]);
        let mapped = Arc::new(Mutex::new(None));
        if let Some(buffer) = &buffer {
            let kept = Arc::clone(&mapped);
            buffer.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
                let result = result.map_err(|error| error.to_string());
                *kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
            });
        }
        self.gpu.check()?;
        Ok(InFlight { submission, buffer, bytes, layouts, mapped })
    }

    /// Waits for images and writes them to memory of the caller; the error is the reason of a failure.
    pub(crate) fn collect(&mut self, in_flight: InFlight, out: &mut [FrameMut<'_>]) -> Result<(), String> {
        let InFlight { submission, buffer, bytes, layouts, mapped } = in_flight;
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
            for (out, layout) in out.iter_mut().zip(&layouts) {
                let images = [
                    out.rgb.as_deref_mut(),
                    out.depth_m.as_deref_mut().map(bytemuck::cast_slice_mut),
                    out.semantic.as_deref_mut(),
                    out.instance.as_deref_mut().map(bytemuck::cast_slice_mut),
                ];
                for (k, image) in images.into_iter().enumerate() {
                    if let Some(image) = image.filter(|_| layout.first[k] != NONE) {
                        copies.extend(image.chunks_mut(PIECE).zip(bytes[layout.bytes(k)].chunks(PIECE)));
                    }
                }
            }
            let copy = |(to, from): (&mut [u8], &[u8])| to.copy_from_slice(from);
            self.threads.run(|parallel| match parallel {
                true => copies.into_par_iter().for_each(copy),
                false => copies.into_iter().for_each(copy),
            });
        }
        buffer.unmap();
        self.read_backs.give(buffer);
        self.gpu.check()
    }
}
