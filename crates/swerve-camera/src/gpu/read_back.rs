//! Buffers for reading images back to the CPU.

use swerve_gpu::{Gpu, wgpu};

/// Pool of read-back buffers.
#[derive(Default)]
pub(crate) struct ReadBacks {
    free: Vec<wgpu::Buffer>,
}

/// Granularity of buffer sizes, bytes, to make reuse likely.
const UNIT_BYTES: u64 = 4096;
/// Largest number of free buffers kept.
const FREE_MOST: usize = 4;

impl ReadBacks {
    /// Returns a buffer of at least this size.
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

    /// Returns an unmapped buffer to the pool.
    pub(crate) fn give(&mut self, buffer: wgpu::Buffer) {
        if self.free.len() == FREE_MOST {
            self.free.remove(0);
        }
        self.free.push(buffer);
    }
}
