//! Render targets on the device.

use swerve_gpu::{Gpu, wgpu};

use super::maps;
use super::pipelines::{DEPTH, VISIBLE};

/// Render target with a layer for each sub-frame: visible triangle and depth.
pub(super) struct Target {
    /// Columns, rows, layers.
    pub(super) size: [u32; 3],
    pub(super) visible: wgpu::TextureView,
    /// Triangle and depth views of each layer.
    pub(super) layers: Vec<[wgpu::TextureView; 2]>,
}

impl Target {
    pub(super) fn new(gpu: &Gpu, size: [u32; 3]) -> Self {
        // An OpenGL array texture with one layer is not an array and cannot be read as one.
        let least = if gpu.report().api == "gl" { 2 } else { 1 };
        let size = [size[0], size[1], size[2].max(least)];
        let [visible, depth] = [VISIBLE, DEPTH].map(|format| maps::texture(gpu, size, format));
        let layer = |texture: &wgpu::Texture, layer: u32| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        let layers = (0..size[2]).map(|k| [layer(&visible, k), layer(&depth, k)]).collect();
        let visible = visible.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        Self { size, visible, layers }
    }
}
