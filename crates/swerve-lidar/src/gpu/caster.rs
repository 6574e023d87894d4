//! Ray casting on a GPU: buffers, the pipelines of `rays.wgsl`, and the read-back of points.

use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Duration;

use swerve_gpu::{Gpu, GrowingBuffer, wgpu};

use crate::scene_tree::flat::{Batch, GpuScene, UploadBuffer};

/// Shader source; the stack size is substituted.
const SHADER: &str = include_str!("rays.wgsl");
/// Placeholder of the stack size.
const STACK_MARK: &str = "STACK_SIZE";
/// Columns and beams of a workgroup: a bundle of rays with similar directions.
const GROUP: u32 = 8;
/// Bytes of a ray's result.
const RETURN_BYTES: u64 = 16;
/// Words of a point.
const POINT_WORDS: usize = 6;
/// Number of polls of the adapter before this thread blocks; waking up takes longer than most turns.
const POLLS_MAX: usize = 2000;
/// Time after which an adapter is considered lost.
const TIMEOUT: Duration = Duration::from_secs(20);

/// Words of the shader's `Params` after the counts and roots.
pub(crate) const SETTINGS: usize = 16;

/// Points of a batch, by column and then by beam, array after array.
pub(crate) struct Points<'a> {
    /// Number of points of each column.
    pub(crate) counts: &'a [u32],
    arrays: &'a [u32],
    len: usize,
}

impl<'a> Points<'a> {
    fn new(columns: usize, words: &'a [u32]) -> Option<Self> {
        let (counts, arrays) = words.split_at(columns);
        let len = counts.iter().map(|&count| count as usize).sum();
        (len * POINT_WORDS <= arrays.len()).then_some(Self { counts, arrays, len })
    }

    /// x, y, z in the sensor frame and intensity, as bits; instance id; ring with the class in the upper bits.
    pub(crate) fn arrays(&self) -> [&'a [u32]; POINT_WORDS] {
        let room = self.arrays.len() / POINT_WORDS;
        core::array::from_fn(|k| &self.arrays[k * room..][..self.len])
    }
}

/// Casts the rays of lidars on one device; reuses its buffers.
pub(crate) struct Caster {
    gpu: Arc<Gpu>,
    pipelines: Option<Pipelines>,
    kept: [GrowingBuffer; 3],
    sent: [GrowingBuffer; 3],
    beams: GrowingBuffer,
    beam_count: u32,
    /// Version of the bindings shared by all batches.
    version: u64,
    spare: Vec<BatchBuffers>,
}

/// Pipelines of the three steps: rays against trees, points per column, points.
struct Pipelines {
    /// Number of stack entries.
    stack: u32,
    steps: [wgpu::ComputePipeline; 3],
}

/// Buffers of one batch.
struct BatchBuffers {
    settings: wgpu::Buffer,
    found: GrowingBuffer,
    points: GrowingBuffer,
    back: GrowingBuffer,
    /// Bind groups and their version.
    bindings: Option<(u64, [wgpu::BindGroup; 3])>,
}

/// Batch in progress on the device.
pub(crate) struct InFlight {
    buffers: BatchBuffers,
    columns: usize,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
    mapped: Mutex<Mapped>,
}

/// Receiver of the result of mapping a buffer.
type Mapped = mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>;

impl BatchBuffers {
    fn new(gpu: &Gpu) -> Self {
        let settings = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("settings of a lidar"),
            size: 4 * (SETTINGS as u64 + 4),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let points = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let back = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Self {
            settings,
            found: GrowingBuffer::new(gpu, "returns of a lidar", wgpu::BufferUsages::STORAGE),
            points: GrowingBuffer::new(gpu, "points of a lidar", points),
            back: GrowingBuffer::new(gpu, "points of a lidar, on their way back", back),
            bindings: None,
        }
    }
}

impl Caster {
    /// Caster for beams with these directions in a column at azimuth 0.
    pub(crate) fn new(gpu: &Arc<Gpu>, beams: &[[f32; 3]]) -> Self {
        let words: Vec<u32> = beams.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0].map(f32::to_bits)).collect();
        let input = |label: &'static str| {
            let copies = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
            GrowingBuffer::new(gpu, label, wgpu::BufferUsages::STORAGE | copies)
        };
        let mut store = input("beams of a lidar");
        // At most 512 beams, which fits any adapter.
        if store.reserve(gpu, 4 * words.len() as u64).is_ok() {
            gpu.queue().write_buffer(store.get(), 0, bytemuck::cast_slice(&words));
        }
        Self {
            gpu: Arc::clone(gpu),
            pipelines: None,
            kept: ["boxes of a scene", "triangles of a scene", "surfaces of a scene"].map(input),
            sent: ["boxes of instances", "instances", "columns of a lidar"].map(input),
            beams: store,
            beam_count: beams.len() as u32,
            version: 0,
            spare: Vec::new(),
        }
    }

    /// Submits a batch.
    ///
    /// # Errors
    /// Reason of the device failure; the device is unusable afterwards.
    pub(crate) fn submit(
        &mut self,
        scene: &mut GpuScene,
        batch: &Batch,
        settings: [u32; SETTINGS],
    ) -> Result<InFlight, String> {
        // A lost device is reported more clearly here than at its use.
        self.gpu.poll()?;
        self.upload(scene, batch)?;
        self.compile(batch.stack(scene));
        let buffers = self.spare.pop().unwrap_or_else(|| BatchBuffers::new(&self.gpu));
        let in_flight = self.encode(buffers, batch, settings)?;
        self.gpu.check()?;
        Ok(in_flight)
    }

    /// Uploads the data missing on the device.
    fn upload(&mut self, scene: &mut GpuScene, batch: &Batch) -> Result<(), String> {
        if !scene.is_in_bounds() {
            return Err("the scene has more triangles than links can sender apart".to_owned());
        }
        let mut is_new = false;
        let GpuScene { nodes, blocks, surfaces, .. } = scene;
        for (store, upload) in self.kept.iter_mut().zip([nodes, blocks, surfaces]) {
            is_new |= upload_pending(&self.gpu, store, upload)?;
        }
        let sent = [&batch.nodes, &batch.placed, &batch.columns];
        for (store, words) in self.sent.iter_mut().zip(sent) {
            is_new |= store.reserve(&self.gpu, 4 * words.len() as u64)?.is_some();
            self.gpu.queue().write_buffer(store.get(), 0, bytemuck::cast_slice(words));
        }
        if is_new {
            self.version += 1;
        }
        Ok(())
    }

    /// Encodes and submits the work.
    fn encode(
        &mut self,
        mut buffers: BatchBuffers,
        batch: &Batch,
        settings: [u32; SETTINGS],
    ) -> Result<InFlight, String> {
        let columns = batch.count();
        let bytes = self.make_room(&mut buffers, columns as u64)?;
        let (count, [ground, far]) = (columns as u32, batch.roots);
        let mut words = [0; SETTINGS + 4];
        words[..4].copy_from_slice(&[count, self.beam_count, ground, far]);
        words[4..].copy_from_slice(&settings);
        self.gpu.queue().write_buffer(&buffers.settings, 0, bytemuck::cast_slice(&words));
        let bindings = self.bindings(&mut buffers);
        let mut encoder =
            self.gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let groups = [(self.beam_count.div_ceil(GROUP), count.div_ceil(GROUP)), (count, 1), (count, 1)];
        let steps = &self.pipelines.as_ref().expect("compiled before").steps;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        for ((pipeline, binding), (x, y)) in steps.iter().zip(bindings).zip(groups) {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, binding, &[]);
            pass.dispatch_workgroups(x, y, 1);
        }
        drop(pass);
        encoder.copy_buffer_to_buffer(buffers.points.get(), 0, buffers.back.get(), 0, bytes);
        let submission = self.gpu.queue().submit([encoder.finish()]);
        let (sender, mapped) = mpsc::channel();
        buffers.back.get().slice(0..bytes).map_async(wgpu::MapMode::Read, move |result| {
            // The receiver is dropped once the wait is over.
            let _late = sender.send(result);
        });
        Ok(InFlight { buffers, columns, bytes, submission, mapped: Mutex::new(mapped) })
    }

    /// Reserves the result buffers for this many columns; returns the size of their points in bytes.
    fn make_room(&self, buffers: &mut BatchBuffers, columns: u64) -> Result<u64, String> {
        let rays = columns * u64::from(self.beam_count);
        let bytes = 4 * (columns + rays * POINT_WORDS as u64);
        let is_new = buffers.found.reserve(&self.gpu, RETURN_BYTES * rays)?.is_some()
            | buffers.points.reserve(&self.gpu, bytes)?.is_some();
        buffers.back.reserve(&self.gpu, bytes)?;
        if is_new {
            buffers.bindings = None;
        }
        Ok(bytes)
    }

    /// Compiles the pipelines for trees that need this many stack entries.
    fn compile(&mut self, stack: u32) {
        if self.pipelines.as_ref().is_some_and(|made| made.stack >= stack) {
            return;
        }
        let stack = stack.next_multiple_of(16);
        let device = self.gpu.device();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("rays of a lidar"),
            source: wgpu::ShaderSource::Wgsl(SHADER.replace(STACK_MARK, &stack.to_string()).into()),
        });
        let steps = ["fire", "count", "place"].map(|entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        });
        self.pipelines = Some(Pipelines { stack, steps });
        self.version += 1;
    }

    /// Bind groups of the pipelines.
    fn bindings<'a>(&self, buffers: &'a mut BatchBuffers) -> &'a [wgpu::BindGroup; 3] {
        let made = buffers.bindings.take().filter(|(version, _)| *version == self.version);
        let made = made.unwrap_or_else(|| (self.version, self.bind(buffers)));
        &buffers.bindings.insert(made).1
    }

    fn bind(&self, buffers: &BatchBuffers) -> [wgpu::BindGroup; 3] {
        let BatchBuffers { settings, found, points, .. } = buffers;
        let [nodes, blocks, surfaces] = &self.kept;
        let [top_nodes, placed, columns] = &self.sent;
        let stores = [nodes, blocks, surfaces, top_nodes, placed, columns, &self.beams, found, points];
        let all: Vec<&wgpu::Buffer> =
            core::iter::once(settings).chain(stores.map(GrowingBuffer::get)).collect();
        let used: [&[u32]; 3] = [&[0, 1, 2, 3, 4, 5, 6, 7, 8], &[0, 8, 9], &[0, 6, 7, 8, 9]];
        let steps = &self.pipelines.as_ref().expect("compiled before").steps;
        core::array::from_fn(|step| {
            let entries: Vec<wgpu::BindGroupEntry<'_>> = used[step]
                .iter()
                .map(|&binding| wgpu::BindGroupEntry {
                    binding,
                    resource: all[binding as usize].as_entire_binding(),
                })
                .collect();
            self.gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("rays of a lidar"),
                layout: &steps[step].get_bind_group_layout(0),
                entries: &entries,
            })
        })
    }

    /// Waits for a batch and passes its points to a closure.
    ///
    /// # Errors
    /// Reason of the device failure; the device is unusable afterwards.
    pub(crate) fn receive(
        &mut self,
        in_flight: InFlight,
        then: impl FnOnce(&Points<'_>),
    ) -> Result<(), String> {
        let InFlight { buffers, columns, bytes, submission, mapped } = in_flight;
        let mapped = mapped.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.wait_for(&mapped, submission)?.map_err(|error| error.to_string())?;
        let back = buffers.back.get();
        let view = back.slice(0..bytes).get_mapped_range().map_err(|error| error.to_string())?;
        let points = Points::new(columns, bytemuck::cast_slice(&view));
        then(&points.ok_or("the adapter counted more points than rays")?);
        drop(view);
        back.unmap();
        self.spare.push(buffers);
        Ok(())
    }

    /// Waits until a batch is complete.
    fn wait_for(
        &self,
        mapped: &Mapped,
        submission: wgpu::SubmissionIndex,
    ) -> Result<Result<(), wgpu::BufferAsyncError>, String> {
        for _ in 0..POLLS_MAX {
            self.gpu.poll()?;
            if let Ok(answer) = mapped.try_recv() {
                return Ok(answer);
            }
            std::thread::yield_now();
        }
        self.gpu.wait(Some(submission))?;
        // Another thread waiting for the same device may deliver the callback.
        mapped.recv_timeout(TIMEOUT).map_err(|error| error.to_string())
    }
}

/// Uploads the pending words after the existing ones; returns true if the buffer was replaced.
fn upload_pending(gpu: &Gpu, store: &mut GrowingBuffer, upload: &mut UploadBuffer) -> Result<bool, String> {
    let replaced = store.reserve(gpu, 4 * upload.len() as u64)?;
    let held = 4 * upload.uploaded as u64;
    if let Some(old) = &replaced
        && held > 0
    {
        let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(old, 0, store.get(), 0, held);
        gpu.queue().submit([encoder.finish()]);
    }
    if !upload.pending.is_empty() {
        gpu.queue().write_buffer(store.get(), held, bytemuck::cast_slice(&upload.pending));
        upload.mark_uploaded();
    }
    Ok(replaced.is_some())
}
