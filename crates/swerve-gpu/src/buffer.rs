//! Buffers that grow.

use crate::device::Gpu;

/// A buffer that is replaced by a larger one when it has to be.
pub struct GrowingBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: wgpu::Buffer,
}

/// Least size of a buffer, and what all sizes are multiples of, bytes.
const UNIT_BYTES: u64 = 4096;

impl GrowingBuffer {
    /// The smallest buffer there is. `label` is for messages.
    pub fn new(gpu: &Gpu, label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage, buffer: create(gpu, label, usage, UNIT_BYTES) }
    }

    /// Makes room for so many bytes; gives the buffer of before, which has the content, if it was replaced.
    ///
    /// # Errors
    /// If the device takes no buffers of that size.
    pub fn reserve(&mut self, gpu: &Gpu, bytes: u64) -> Result<Option<wgpu::Buffer>, String> {
        if bytes <= self.buffer.size() {
            return Ok(None);
        }
        let most = most_bytes(gpu);
        if bytes > most {
            return Err(format!("{bytes} bytes of {} are needed, the adapter takes {most}", self.label));
        }
        let size = (bytes + bytes / 2).next_multiple_of(UNIT_BYTES).min(most);
        let larger = create(gpu, self.label, self.usage, size);
        Ok(Some(core::mem::replace(&mut self.buffer, larger)))
    }

    /// The buffer of now.
    pub fn get(&self) -> &wgpu::Buffer {
        &self.buffer
    }
}

fn create(gpu: &Gpu, label: &str, usage: wgpu::BufferUsages, size: u64) -> wgpu::Buffer {
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
    gpu.device().create_buffer(&descriptor)
}

/// Largest buffer that shaders can be given, bytes.
fn most_bytes(gpu: &Gpu) -> u64 {
    let limits = gpu.limits();
    limits.max_buffer_size.min(limits.max_storage_buffer_binding_size) / UNIT_BYTES * UNIT_BYTES
}
