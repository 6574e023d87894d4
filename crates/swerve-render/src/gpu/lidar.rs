//! Rays of lidars on a GPU: buffers, the pipelines of `lidar.wgsl`, and the way back of the points.

use std::sync::{Arc, Mutex, PoisonError, mpsc};
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
/// Words of a point.
const POINT_WORDS: usize = 6;
/// No buffer is smaller: every binding holds at least one element.
const BUFFER_MIN: u64 = 256;
/// How often the adapter is asked whether it is done before this thread sleeps: to be woken takes longer than
/// most turns.
const LOOKS: usize = 2000;
/// An adapter that takes longer is lost.
const PATIENCE: Duration = Duration::from_secs(20);

/// Words of the shader's `Params` behind the counts and roots.
pub(crate) const SETTINGS: usize = 16;

/// Points of a salvo, by column and then by beam, array after array.
pub(crate) struct Points<'a> {
    /// Points of each column.
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

    /// x, y, z in the sensor's frame and intensity, as bits; instance id; ring with the class above it.
    pub(crate) fn arrays(&self) -> [&'a [u32]; POINT_WORDS] {
        let room = self.arrays.len() / POINT_WORDS;
        core::array::from_fn(|k| &self.arrays[k * room..][..self.len])
    }
}

/// Casts the rays of lidars on one device; keeps its buffers.
pub(crate) struct Caster {
    gpu: Arc<Gpu>,
    pipelines: Option<Pipelines>,
    kept: [Store; 3],
    sent: [Store; 3],
    beams: Store,
    beam_count: u32,
    /// Counts the changes of what all lanes bind.
    version: u64,
    spare: Vec<Lane>,
}

/// Rays against trees, points per column, points.
struct Pipelines {
    /// Entries of the stack.
    stack: u32,
    steps: [wgpu::ComputePipeline; 3],
}

/// What a salvo needs for itself.
struct Lane {
    settings: wgpu::Buffer,
    found: Store,
    points: Store,
    back: Store,
    /// With the version that they are of.
    bindings: Option<(u64, [wgpu::BindGroup; 3])>,
}

/// A salvo on its way.
pub(crate) struct Flight {
    lane: Lane,
    columns: usize,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
    told: Mutex<Told>,
}

/// Says when a buffer is mapped.
type Told = mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>;

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

impl Lane {
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
            found: Store::new("returns of a lidar", wgpu::BufferUsages::STORAGE),
            points: Store::new("points of a lidar", points),
            back: Store::new("points of a lidar, on their way back", back),
            bindings: None,
        }
    }
}

impl Caster {
    /// For beams with these directions in a column at azimuth 0.
    pub(crate) fn new(gpu: &Arc<Gpu>, beams: &[[f32; 3]]) -> Self {
        let words: Vec<u32> = beams.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0].map(f32::to_bits)).collect();
        let mut store = Store::input("beams of a lidar");
        // Few enough for any adapter: at most 512.
        if store.grow(gpu, 4 * words.len() as u64).is_ok() {
            gpu.queue().write_buffer(store.get(), 0, bytemuck::cast_slice(&words));
        }
        Self {
            gpu: Arc::clone(gpu),
            pipelines: None,
            kept: ["boxes of a scene", "triangles of a scene", "surfaces of a scene"].map(Store::input),
            sent: ["boxes of instances", "instances", "columns of a lidar"].map(Store::input),
            beams: store,
            beam_count: beams.len() as u32,
            version: 0,
            spare: Vec::new(),
        }
    }

    /// Sends a salvo on its way.
    ///
    /// # Errors
    /// Why the device cannot; it is of no use from then on.
    pub(crate) fn send(
        &mut self,
        resident: &mut Resident,
        salvo: &Salvo,
        settings: [u32; SETTINGS],
    ) -> Result<Flight, String> {
        // A device that is gone says so here better than where it is used.
        self.gpu.look()?;
        self.upload(resident, salvo)?;
        self.compile(salvo.stack(resident));
        let lane = self.spare.pop().unwrap_or_else(|| Lane::new(&self.gpu));
        let flight = self.submit(lane, salvo, settings)?;
        self.gpu.trouble().map_or(Ok(flight), Err)
    }

    /// Sends what the device lacks.
    fn upload(&mut self, resident: &mut Resident, salvo: &Salvo) -> Result<(), String> {
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
        if is_new {
            self.version += 1;
        }
        Ok(())
    }

    /// Sends the work.
    fn submit(&mut self, mut lane: Lane, salvo: &Salvo, settings: [u32; SETTINGS]) -> Result<Flight, String> {
        let columns = salvo.count();
        let bytes = self.make_room(&mut lane, columns as u64)?;
        let (count, [ground, far]) = (columns as u32, salvo.roots);
        let mut words = [0; SETTINGS + 4];
        words[..4].copy_from_slice(&[count, self.beam_count, ground, far]);
        words[4..].copy_from_slice(&settings);
        self.gpu.queue().write_buffer(&lane.settings, 0, bytemuck::cast_slice(&words));
        let bindings = self.bindings(&mut lane);
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
        encoder.copy_buffer_to_buffer(lane.points.get(), 0, lane.back.get(), 0, bytes);
        let submission = self.gpu.queue().submit([encoder.finish()]);
        let (tell, told) = mpsc::channel();
        lane.back.get().slice(0..bytes).map_async(wgpu::MapMode::Read, move |result| {
            // Nobody listens any more once the wait is over.
            let _late = tell.send(result);
        });
        Ok(Flight { lane, columns, bytes, submission, told: Mutex::new(told) })
    }

    /// Room for what so many columns give; the bytes of their points.
    fn make_room(&self, lane: &mut Lane, columns: u64) -> Result<u64, String> {
        let rays = columns * u64::from(self.beam_count);
        let bytes = 4 * (columns + rays * POINT_WORDS as u64);
        let is_new = lane.found.grow(&self.gpu, RETURN_BYTES * rays)?.is_some()
            | lane.points.grow(&self.gpu, bytes)?.is_some();
        lane.back.grow(&self.gpu, bytes)?;
        if is_new {
            lane.bindings = None;
        }
        Ok(bytes)
    }

    /// The pipelines for trees that need so many entries on the stack.
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

    /// What the pipelines read and write.
    fn bindings<'a>(&self, lane: &'a mut Lane) -> &'a [wgpu::BindGroup; 3] {
        let made = lane.bindings.take().filter(|(version, _)| *version == self.version);
        let made = made.unwrap_or_else(|| (self.version, self.bind(lane)));
        &lane.bindings.insert(made).1
    }

    fn bind(&self, lane: &Lane) -> [wgpu::BindGroup; 3] {
        let Lane { settings, found, points, .. } = lane;
        let [nodes, blocks, surfaces] = &self.kept;
        let [top_nodes, placed, columns] = &self.sent;
        let stores = [nodes, blocks, surfaces, top_nodes, placed, columns, &self.beams, found, points];
        let all: Vec<&wgpu::Buffer> = core::iter::once(settings).chain(stores.map(Store::get)).collect();
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

    /// Waits for a salvo and lends its points.
    ///
    /// # Errors
    /// Why the device cannot; it is of no use from then on.
    pub(crate) fn fetch(&mut self, flight: Flight, then: impl FnOnce(&Points<'_>)) -> Result<(), String> {
        let Flight { lane, columns, bytes, submission, told } = flight;
        let told = told.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.landed(&told, submission)?.map_err(|error| error.to_string())?;
        let back = lane.back.get();
        let view = back.slice(0..bytes).get_mapped_range().map_err(|error| error.to_string())?;
        let points = Points::new(columns, bytemuck::cast_slice(&view));
        then(&points.ok_or("the adapter counted more points than rays")?);
        drop(view);
        back.unmap();
        self.spare.push(lane);
        Ok(())
    }

    /// Waits until a salvo is back.
    fn landed(
        &self,
        told: &Told,
        submission: wgpu::SubmissionIndex,
    ) -> Result<Result<(), wgpu::BufferAsyncError>, String> {
        for _ in 0..LOOKS {
            self.gpu.look()?;
            if let Ok(answer) = told.try_recv() {
                return Ok(answer);
            }
            std::thread::yield_now();
        }
        self.gpu.wait(Some(submission))?;
        // Another thread that waits for the same device may have been given the answer to pass on.
        told.recv_timeout(PATIENCE).map_err(|error| error.to_string())
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
