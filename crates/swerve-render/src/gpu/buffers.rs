//! Memory of the device that grows.

use super::device::Gpu;

/// A buffer that is replaced by a larger one when it must be.
pub(super) struct Grown {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: wgpu::Buffer,
}

/// Least size of a buffer, bytes.
const LEAST: u64 = 4096;

fn create(gpu: &Gpu, label: &str, usage: wgpu::BufferUsages, size: u64) -> wgpu::Buffer {
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
    gpu.device().create_buffer(&descriptor)
}

impl Grown {
    pub(super) fn new(gpu: &Gpu, label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage, buffer: create(gpu, label, usage, LEAST) }
    }

    /// Makes room, and says whether the buffer is another one now, with nothing in it.
    ///
    /// # Errors
    /// If the device takes no buffers of that size.
    pub(super) fn fit(&mut self, gpu: &Gpu, bytes: u64) -> Result<bool, String> {
        if bytes <= self.buffer.size() {
            return Ok(false);
        }
        let most = most_bytes(gpu);
        if bytes > most {
            return Err(format!("{bytes} bytes of {} are needed, the adapter takes {most}", self.label));
        }
        let size = (bytes + bytes / 2).next_multiple_of(LEAST).min(most);
        self.buffer = create(gpu, self.label, self.usage, size);
        Ok(true)
    }

    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }
}

/// Largest buffer that shaders can be given, bytes.
pub(super) fn most_bytes(gpu: &Gpu) -> u64 {
    let limits = gpu.limits();
    limits.max_buffer_size.min(u64::from(limits.max_storage_buffer_binding_size)) / LEAST * LEAST
}

/// Buffers that the processor reads results from; they are used again.
#[derive(Default)]
pub(super) struct ReadBacks {
    free: Vec<wgpu::Buffer>,
}

/// Buffers that are kept for later.
const FREE_MOST: usize = 4;

impl ReadBacks {
    /// A buffer of at least so many bytes.
    pub(super) fn take(&mut self, gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
        if let Some(index) = self.free.iter().position(|buffer| buffer.size() >= bytes) {
            return self.free.swap_remove(index);
        }
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        create(gpu, "read back", usage, bytes.next_multiple_of(LEAST))
    }

    /// Takes a buffer back that is no longer mapped.
    pub(super) fn give(&mut self, buffer: wgpu::Buffer) {
        if self.free.len() == FREE_MOST {
            self.free.remove(0);
        }
        self.free.push(buffer);
    }
}
