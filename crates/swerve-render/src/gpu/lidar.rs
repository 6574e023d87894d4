//! Rays of lidars on a GPU: buffers, the pipeline of `lidar.wgsl`, and the way back of what it finds.

use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::Gpu;
use crate::lidar::flat::{Arena, Resident, Salvo};

/// The shader; the size of its stack is put in.
const SHADER: &str = include_str!("lidar.wgsl");
/// Where it goes.
const STACK_MARK: &str = "STACK_SIZE";
/// Columns and beams of a workgroup: a bundle of rays that go much the same way.
const GROUP: u32 = 8;
/// Bytes of what a ray gives.
const RETURN_BYTES: u64 = 16;
/// No buffer is smaller: every binding holds at least one element.
const BUFFER_MIN: u64 = 256;
/// An adapter that takes longer is lost.
const PATIENCE: Duration = Duration::from_secs(20);

/// What a shot gives: range and intensity as bits, instance id, class with [`SEEN`].
pub(crate) type Words = [u32; 4];
/// Above the class of a [`Words`]: there is a return.
pub(crate) const SEEN: u32 = 1 << 8;
/// Words of the shader's `Params` behind the counts and roots.
pub(crate) const SETTINGS: usize = 16;

/// Casts the rays of lidars on one device; keeps its buffers.
pub(crate) struct Caster {
    gpu: Arc<Gpu>,
    pipeline: Option<(u32, wgpu::ComputePipeline)>,
    binding: Option<wgpu::BindGroup>,
    settings: wgpu::Buffer,
    kept: [Store; 3],
    sent: [Store; 3],
    beams: Store,
    found: Store,
    back: Store,
    beam_count: u32,
}

/// A buffer that grows.
struct Store {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl Store {
    fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage, buffer: None }
    }

    fn input(label: &'static str) -> Self {
        let copies = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Self::new(label, wgpu::BufferUsages::STORAGE | copies)
    }

    fn bytes(&self) -> u64 {
        self.buffer.as_ref().map_or(0, wgpu::Buffer::size)
    }

    /// Makes room; gives the buffer of before if there is a new one.
    fn grow(&mut self, gpu: &Gpu, bytes: u64) -> Result<Option<Option<wgpu::Buffer>>, String> {
        if bytes <= self.bytes() && self.buffer.is_some() {
            return Ok(None);
        }
        let limits = gpu.limits();
        let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        if bytes > most {
            let (label, mega) = (self.label, 1 << 20);
            return Err(format!("{label} need {} MiB, the adapter takes {}", bytes / mega + 1, most / mega));
        }
        let size = (bytes + bytes / 2).max(BUFFER_MIN).next_multiple_of(16).min(most & !15);
        let buffer = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some(self.label),
            size,
            usage: self.usage,
            mapped_at_creation: false,
        });
        Ok(Some(self.buffer.replace(buffer)))
    }

    fn get(&self) -> &wgpu::Buffer {
        self.buffer.as_ref().expect("made before it is used")
    }
}

impl Caster {
    /// For beams with these directions in a column at azimuth 0.
    pub(crate) fn new(gpu: &Arc<Gpu>, beams: &[[f32; 3]]) -> Self {
        let words: Vec<u32> = beams.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0].map(f32::to_bits)).collect();
        let settings = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("settings of a lidar"),
            size: 4 * (SETTINGS as u64 + 4),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut store = Store::input("beams of a lidar");
        // Few enough for any adapter: at most 512.
        if store.grow(gpu, 4 * words.len() as u64).is_ok() {
            gpu.queue().write_buffer(store.get(), 0, bytemuck::cast_slice(&words));
        }
        let found = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let back = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Self {
            gpu: Arc::clone(gpu),
            pipeline: None,
            binding: None,
            settings,
            kept: ["boxes of a scene", "triangles of a scene", "surfaces of a scene"].map(Store::input),
            sent: ["boxes of instances", "instances", "columns of a lidar"].map(Store::input),
            beams: store,
            found: Store::new("returns of a lidar", found),
            back: Store::new("returns of a lidar, on their way back", back),
            beam_count: beams.len() as u32,
        }
    }

    /// Casts the rays of a salvo, and lends what they gave, by column and then by beam.
    ///
    /// # Errors
    /// Why the device cannot; it is of no use from then on.
    pub(crate) fn cast<T>(
        &mut self,
        resident: &mut Resident,
        salvo: &Salvo,
        settings: [u32; SETTINGS],
        then: impl FnOnce(&[Words]) -> T,
    ) -> Result<T, String> {
        let device = self.gpu.device().clone();
        let scopes =
            [wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation]
                .map(|filter| device.push_error_scope(filter));
        let sent = self.send(resident, salvo, settings);
        let errors = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop()));
        let errors: Vec<String> = errors.map(|error| error.to_string()).collect();
        let error = errors.into_iter().next();
        match (self.gpu.trouble(), error) {
            (Some(why), _) | (None, Some(why)) => Err(why),
            (None, None) => self.fetch(sent?, then),
        }
    }

    /// Sends what the device lacks, and the work; gives the bytes that come back.
    fn send(
        &mut self,
        resident: &mut Resident,
        salvo: &Salvo,
        settings: [u32; SETTINGS],
    ) -> Result<(u64, wgpu::SubmissionIndex), String> {
        self.gpu.trouble().map_or(Ok(()), Err)?;
        let columns = salvo.count() as u32;
        let bytes = RETURN_BYTES * u64::from(columns) * u64::from(self.beam_count);
        self.upload(resident, salvo, bytes)?;
        let [ground, far] = salvo.roots;
        let mut words = vec![columns, self.beam_count, ground, far];
        words.extend(settings);
        self.gpu.queue().write_buffer(&self.settings, 0, bytemuck::cast_slice(&words));
        self.compile(salvo.stack(resident));
        let (_, pipeline) = self.pipeline.as_ref().expect("compiled just now");
        let device = self.gpu.device();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let binding = match &self.binding {
                Some(binding) => binding.clone(),
                None => self.bind(pipeline),
            };
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &binding, &[]);
            pass.dispatch_workgroups(self.beam_count.div_ceil(GROUP), columns.div_ceil(GROUP), 1);
            drop(pass);
            self.binding = Some(binding);
        }
        encoder.copy_buffer_to_buffer(self.found.get(), 0, self.back.get(), 0, bytes);
        Ok((bytes, self.gpu.queue().submit([encoder.finish()])))
    }

    fn upload(&mut self, resident: &mut Resident, salvo: &Salvo, bytes: u64) -> Result<(), String> {
        if !resident.is_in_bounds() {
            return Err("the scene has more triangles than links can tell apart".to_owned());
        }
        let mut is_new = false;
        let Resident { nodes, blocks, surfaces, .. } = resident;
        for (store, arena) in self.kept.iter_mut().zip([nodes, blocks, surfaces]) {
            is_new |= keep(&self.gpu, store, arena)?;
        }
        let sent = [&salvo.nodes, &salvo.placed, &salvo.columns];
        for (store, words) in self.sent.iter_mut().zip(sent) {
            is_new |= store.grow(&self.gpu, 4 * words.len() as u64)?.is_some();
            self.gpu.queue().write_buffer(store.get(), 0, bytemuck::cast_slice(words));
        }
        is_new |= self.found.grow(&self.gpu, bytes)?.is_some();
        self.back.grow(&self.gpu, bytes)?;
        if is_new {
            self.binding = None;
        }
        Ok(())
    }

    /// The pipeline for trees that need so many entries on the stack.
    fn compile(&mut self, stack: u32) {
        if self.pipeline.as_ref().is_some_and(|(size, _)| *size >= stack) {
            return;
        }
        let size = stack.next_multiple_of(16);
        let device = self.gpu.device();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("rays of a lidar"),
            source: wgpu::ShaderSource::Wgsl(SHADER.replace(STACK_MARK, &size.to_string()).into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("rays of a lidar"),
            layout: None,
            module: &module,
            entry_point: Some("fire"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        self.pipeline = Some((size, pipeline));
        self.binding = None;
    }

    fn bind(&self, pipeline: &wgpu::ComputePipeline) -> wgpu::BindGroup {
        let [nodes, blocks, surfaces] = &self.kept;
        let [top_nodes, placed, columns] = &self.sent;
        let stores = [nodes, blocks, surfaces, top_nodes, placed, columns, &self.beams, &self.found];
        let buffers = core::iter::once(&self.settings).chain(stores.map(Store::get));
        let entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
            .enumerate()
            .map(|(k, buffer)| wgpu::BindGroupEntry {
                binding: k as u32,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        self.gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("rays of a lidar"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        })
    }

    fn fetch<T>(
        &self,
        (bytes, submission): (u64, wgpu::SubmissionIndex),
        then: impl FnOnce(&[Words]) -> T,
    ) -> Result<T, String> {
        let slice = self.back.get().slice(0..bytes);
        let (tell, told) = mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| {
            // Nobody listens any more once the wait is over.
            let _late = tell.send(result);
        });
        self.gpu.wait(Some(submission))?;
        // Another thread that waits for the same device may have been given the answer to pass on.
        let answer = told.recv_timeout(PATIENCE).map_err(|error| error.to_string())?;
        answer.map_err(|error| error.to_string())?;
        let view = slice.get_mapped_range().map_err(|error| error.to_string())?;
        let result = then(bytemuck::cast_slice(&view));
        drop(view);
        self.back.get().unmap();
        Ok(result)
    }
}

/// Sends the new words of an arena behind those that are there.
fn keep(gpu: &Gpu, store: &mut Store, arena: &mut Arena) -> Result<bool, String> {
    let grown = store.grow(gpu, 4 * arena.len() as u64)?;
    let held = 4 * arena.held as u64;
    if let Some(Some(old)) = &grown
        && held > 0
    {
        let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(old, 0, store.get(), 0, held);
        gpu.queue().submit([encoder.finish()]);
    }
    if !arena.fresh.is_empty() {
        gpu.queue().write_buffer(store.get(), held, bytemuck::cast_slice(&arena.fresh));
        arena.sent();
    }
    Ok(grown.is_some())
}
