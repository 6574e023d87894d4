//! Buffers that the processor reads images from.

use swerve_gpu::{Gpu, wgpu};

/// Buffers that the processor reads results from; they are used again.
#[derive(Default)]
pub(crate) struct ReadBacks {
    free: Vec<wgpu::Buffer>,
}

/// Multiple that sizes are rounded up to, so that buffers are used again, bytes.
const UNIT_BYTES: u64 = 4096;
/// Buffers that are kept for later.
const FREE_MOST: usize = 4;

impl ReadBacks {
    /// A buffer of at least so many bytes.
    pub(crate) fn take(&mut self, gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
        if let Some(index) = self.free.iter().position(|buffer| buffer.size() >= bytes) {
            return self.free.swap_remove(index);
        }
        gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: bytes.next_multiple_of(UNIT_BYTES),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Takes a buffer back that is no longer mapped.
    pub(crate) fn give(&mut self, buffer: wgpu::Buffer) {
        if self.free.len() == FREE_MOST {
            self.free.remove(0);
        }
        self.free.push(buffer);
    }
}
