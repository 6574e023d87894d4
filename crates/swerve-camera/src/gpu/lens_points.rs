//! Lenses on the device: position of each pixel of a distorted image in the pinhole image.

use swerve_gpu::{Gpu, GrowingBuffer, wgpu};

use crate::Camera;
use crate::frontend::lens::{LensCache, same_lens};
use crate::frontend::pinhole::Pinhole;

/// Pinhole image behind a lens.
#[derive(Clone, Copy)]
pub(super) struct LensImage {
    pub(super) pinhole: Pinhole,
    /// Index of its first point on the device.
    pub(super) first_point: u32,
}

/// Points of lenses on the device.
pub(super) struct LensPoints {
    cache: LensCache,
    known: Vec<(Camera, LensImage)>,
    points: Vec<[f32; 2]>,
    uploaded: usize,
    on_device: GrowingBuffer,
}

/// Number of points above which those of earlier cameras are dropped.
const LENS_POINTS: usize = 1 << 24;

impl LensPoints {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let read = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            cache: LensCache::default(),
            known: Vec::new(),
            points: Vec::new(),
            uploaded: 0,
            on_device: GrowingBuffer::new(gpu, "lenses", read),
        }
    }

    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        self.on_device.get()
    }

    /// Image behind the lens of a camera; `None` for an undistorted one.
    pub(super) fn get(&mut self, camera: &Camera) -> Option<LensImage> {
        if let Some((_, known)) = self.known.iter().find(|(known, _)| same_lens(known, camera)) {
            return Some(*known);
        }
        let map = self.cache.get(camera)?;
        let image = LensImage { pinhole: map.pinhole, first_point: self.points.len() as u32 };
        self.points.extend_from_slice(&map.points);
        self.known.push((*camera, image));
        Some(image)
    }

    pub(super) fn forget_if_large(&mut self) {
        if self.points.len() > LENS_POINTS {
            self.known.clear();
            self.points.clear();
            self.uploaded = 0;
        }
    }

    /// Uploads new points; returns true if the buffer was replaced.
    pub(super) fn upload(&mut self, gpu: &Gpu) -> Result<bool, String> {
        let replaced = self.on_device.reserve(gpu, size_of_val(self.points.as_slice()) as u64)?.is_some();
        if replaced {
            self.uploaded = 0;
        }
        if self.points.len() > self.uploaded {
            let new = bytemuck::cast_slice(&self.points[self.uploaded..]);
            gpu.queue().write_buffer(self.on_device.get(), 8 * self.uploaded as u64, new);
            self.uploaded = self.points.len();
        }
        Ok(replaced)
    }
}
