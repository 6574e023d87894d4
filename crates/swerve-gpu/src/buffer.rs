//! Buffers that grow.

use crate::device::Gpu;

/// A buffer that is replaced by a larger one on demand.
pub struct GrowingBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: wgpu::Buffer,
}

/// Minimum size and size increment of a buffer, bytes.
const UNIT_BYTES: u64 = 4096;

impl GrowingBuffer {
    /// Creates a buffer of minimum size. `label` appears in messages.
    pub fn new(gpu: &Gpu, label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage, buffer: create(gpu, label, usage, UNIT_BYTES) }
    }

    /// Ensures a capacity of `bytes` bytes. If the buffer was replaced, returns the previous one, which holds the
    /// content.
    ///
    /// # Errors
    /// If the device does not support buffers of this size.
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

    /// The current buffer.
    pub fn get(&self) -> &wgpu::Buffer {
        &self.buffer
    }
}

fn create(gpu: &Gpu, label: &str, usage: wgpu::BufferUsages, size: u64) -> wgpu::Buffer {
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
    gpu.device().create_buffer(&descriptor)
}

/// Largest buffer that can be bound to a shader, bytes.
fn most_bytes(gpu: &Gpu) -> u64 {
    let limits = gpu.limits();
    limits.max_buffer_size.min(limits.max_storage_buffer_binding_size) / UNIT_BYTES * UNIT_BYTES
}
