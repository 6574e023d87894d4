//! Sun and sky maps around a cell: static ones are kept, moving ones are redrawn.

use swerve_gpu::{Gpu, wgpu};
use swerve_scene::hash::Key;

use super::pipelines::{DEPTH, Pipelines, SKY};
use crate::frontend::shadow::{SIDE, SKY_SIDE};

/// Maps of one cell.
pub(super) struct CellMaps {
    key: Key,
    used: u64,
    /// Depths towards the sun: of static and of moving instances.
    pub(super) sun: [wgpu::TextureView; 2],
    /// Hidden shares of the sky: of static and of moving instances.
    pub(super) sky: [wgpu::TextureView; 2],
    pub(super) bound: wgpu::BindGroup,
    /// True until the first drawing: of static and of moving instances.
    pub(super) is_new: [bool; 2],
    /// Rectangles in the maps of sun and sky where moving instances were drawn last.
    pub(super) moved: [Vec<Corners>; 2],
}

/// Two corners of a rectangle in a map, from -1 to 1.
pub(super) type Corners = [f32; 4];

/// Texture that is drawn to and read from: columns, rows, layers.
pub(super) fn texture(gpu: &Gpu, size: [u32; 3], format: wgpu::TextureFormat) -> wgpu::Texture {
    let [width, height, depth_or_array_layers] = size;
    gpu.device().create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    })
}

/// View of a texture with one layer.
pub(super) fn image(gpu: &Gpu, side: usize, format: wgpu::TextureFormat) -> wgpu::TextureView {
    texture(gpu, [side as u32, side as u32, 1], format).create_view(&wgpu::TextureViewDescriptor::default())
}

/// Bind group of maps for shading.
pub(super) fn bind(gpu: &Gpu, pipelines: &Pipelines, views: [&wgpu::TextureView; 4]) -> wgpu::BindGroup {
    let entries = [0, 1, 2, 3].map(|binding| wgpu::BindGroupEntry {
        binding,
        resource: wgpu::BindingResource::TextureView(views[binding as usize]),
    });
    gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("maps"),
        layout: &pipelines.maps,
        entries: &entries,
    })
}

impl CellMaps {
    pub(super) fn new(gpu: &Gpu, pipelines: &Pipelines) -> Self {
        let sun = [0, 1].map(|_| image(gpu, SIDE, DEPTH));
        let sky = [0, 1].map(|_| image(gpu, SKY_SIDE, SKY));
        let bound = bind(gpu, pipelines, [&sun[0], &sun[1], &sky[0], &sky[1]]);
        Self { key: Key::default(), used: 0, sun, sky, bound, is_new: [true; 2], moved: Default::default() }
    }
}

/// Maps of recently used cells; the least recently used is evicted.
#[derive(Default)]
pub(super) struct MapCache {
    pub(super) maps: Vec<CellMaps>,
    clock: u64,
}

/// Number of cells kept, unless one submission needs more.
const KEPT: usize = 3;

impl MapCache {
    /// Starts a submission: maps used from now on are kept until the next one.
    pub(super) fn start(&mut self) {
        self.clock += 1;
    }

    /// Index of the maps with a key; new ones are marked as such.
    pub(super) fn index(&mut self, gpu: &Gpu, pipelines: &Pipelines, key: Key) -> usize {
        let found = self.maps.iter().position(|maps| maps.key == key);
        let index = found.unwrap_or_else(|| {
            let oldest = (0..self.maps.len()).min_by_key(|&k| self.maps[k].used);
            let index = match oldest {
                Some(k) if self.maps.len() >= KEPT && self.maps[k].used < self.clock => k,
                _ => {
                    self.maps.push(CellMaps::new(gpu, pipelines));
                    self.maps.len() - 1
                }
            };
            (self.maps[index].key, self.maps[index].is_new) = (key, [true; 2]);
            index
        });
        self.maps[index].used = self.clock;
        index
    }
}
