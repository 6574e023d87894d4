//! Shaders, their bindings, and pipelines.

use swerve_gpu::wgpu::{BufferBindingType, ShaderStages, TextureFormat, TextureSampleType};
use swerve_gpu::{Gpu, wgpu};

use crate::frontend::sensor::Sensor;
use crate::frontend::texture::Tiles;

/// Formats of the images that triangles are drawn to.
pub(super) const VISIBLE: TextureFormat = TextureFormat::R32Uint;
pub(super) const DEPTH: TextureFormat = TextureFormat::Depth32Float;
pub(super) const SKY: TextureFormat = TextureFormat::R8Unorm;

/// Device resources that do not depend on the scene.
pub(super) struct Pipelines {
    /// Buffers with triangle data: vertices, triangles, records, clusters.
    pub(super) triangles: wgpu::BindGroupLayout,
    /// Buffers with pixel data, read and written.
    pub(super) pixels: wgpu::BindGroupLayout,
    /// Maps of sun and sky.
    pub(super) maps: wgpu::BindGroupLayout,
    /// Triangles to pixels: single-sided, double-sided.
    pub(super) draw: [wgpu::RenderPipeline; 2],
    /// Triangles to the sun's map: single-sided, double-sided.
    pub(super) sun: [wgpu::RenderPipeline; 2],
    /// Footprints that hide the sky.
    pub(super) hide: wgpu::RenderPipeline,
    /// Erasing of rectangles: in the map of the sun, in that of the sky.
    pub(super) erase: [wgpu::RenderPipeline; 2],
    /// Pixels to light, and light to the bytes of images.
    pub(super) shade: [wgpu::ComputePipeline; 2],
    /// Texture tiles, followed by the quantiles of noise.
    pub(super) tiles: wgpu::Buffer,
    /// Index of the first word of the quantiles.
    pub(super) quantiles: u32,
}

fn storage(binding: u32, visibility: ShaderStages, read_only: bool) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Buffer {
        ty: BufferBindingType::Storage { read_only },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

fn texture(
    binding: u32,
    sample_type: TextureSampleType,
    view_dimension: wgpu::TextureViewDimension,
) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false };
    wgpu::BindGroupLayoutEntry { binding, visibility: ShaderStages::COMPUTE, ty, count: None }
}

fn layout(
    device: &wgpu::Device,
    label: &str,
    entries: &[wgpu::BindGroupLayoutEntry],
) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
}

fn pipeline_layout(device: &wgpu::Device, groups: &[Option<&wgpu::BindGroupLayout>]) -> wgpu::PipelineLayout {
    device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: groups,
        immediate_size: 0,
    })
}

/// Pipeline state of a kind of triangle.
struct Drawing<'a> {
    entry: &'a str,
    fragment: Option<&'a str>,
    target: Option<wgpu::ColorTargetState>,
    /// Culled side, and winding order of the front.
    cull: Option<wgpu::Face>,
    front: wgpu::FrontFace,
    /// Depth comparison.
    depth: Option<wgpu::CompareFunction>,
}

fn drawing(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    layout: &wgpu::PipelineLayout,
    how: &Drawing<'_>,
) -> wgpu::RenderPipeline {
    let targets = [how.target.clone()];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(how.entry),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(how.entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            front_face: how.front,
            cull_mode: how.cull,
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: how.depth.map(|compare| wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(compare),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: how.fragment.map(|entry| wgpu::FragmentState {
            module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Bind group layouts: see [`Pipelines`].
fn layouts(device: &wgpu::Device) -> [wgpu::BindGroupLayout; 3] {
    let all = ShaderStages::VERTEX_FRAGMENT | ShaderStages::COMPUTE;
    let triangles = [0, 1, 2, 3].map(|binding| storage(binding, all, true));
    let at = ShaderStages::COMPUTE;
    let round = wgpu::BindGroupLayoutEntry {
        binding: 0,
        visibility: at,
        ty: wgpu::BindingType::Buffer {
            ty: BufferBindingType::Uniform,
            has_dynamic_offset: true,
            min_binding_size: None,
        },
        count: None,
    };
    let pixels = [
        round,
        storage(1, at, true),
        storage(2, at, true),
        storage(3, at, false),
        storage(4, at, false),
        texture(5, TextureSampleType::Uint, wgpu::TextureViewDimension::D2Array),
    ];
    let unfiltered = TextureSampleType::Float { filterable: false };
    let maps = [0, 1, 2, 3].map(|binding| texture(binding, unfiltered, wgpu::TextureViewDimension::D2));
    [
        layout(device, "triangles", &triangles),
        layout(device, "pixels", &pixels),
        layout(device, "maps", &maps),
    ]
}

/// Buffer of texture tiles and noise quantiles, and the offset of the latter.
fn constants(gpu: &Gpu) -> (wgpu::Buffer, u32) {
    let words = Tiles::get().words();
    let mut constant = words.to_vec();
    constant.extend(Sensor::quantiles().iter().map(|q| q.to_bits()));
    let buffer = gpu.device().create_buffer(&wgpu::BufferDescriptor {
        label: Some("tiles"),
        size: 4 * constant.len() as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue().write_buffer(&buffer, 0, bytemuck::cast_slice(&constant));
    (buffer, words.len() as u32)
}

impl Pipelines {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let device = gpu.device();
        let source =
            concat!(include_str!("shade.wgsl"), include_str!("draw.wgsl"), include_str!("pass.wgsl"));
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("swerve"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let [triangles, pixels, maps] = layouts(device);
        let drawn = pipeline_layout(device, &[Some(&triangles)]);
        let shaded = pipeline_layout(device, &[Some(&triangles), Some(&pixels), Some(&maps)]);
        let sides = [Some(wgpu::Face::Back), None];
        // Near is 1 and far is 0; the first one wins ties.
        let nearest = Some(wgpu::CompareFunction::Greater);
        let camera = |cull| Drawing {
            entry: "draw",
            fragment: Some("mark"),
            target: Some(VISIBLE.into()),
            cull,
            front: wgpu::FrontFace::Ccw,
            depth: nearest,
        };
        // Rows of the sun's map grow upwards, which reverses the winding order.
        let front = wgpu::FrontFace::Cw;
        let sun = |cull| Drawing { entry: "draw", fragment: None, target: None, cull, front, depth: nearest };
        let most = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Max,
        };
        let hide = Drawing {
            entry: "base",
            fragment: Some("hide"),
            target: Some(wgpu::ColorTargetState {
                format: SKY,
                blend: Some(wgpu::BlendState { color: most, alpha: most }),
                write_mask: wgpu::ColorWrites::ALL,
            }),
            cull: None,
            front,
            depth: None,
        };
        let any = Some(wgpu::CompareFunction::Always);
        let no_sun = Drawing { entry: "erase", fragment: None, target: None, cull: None, front, depth: any };
        let no_sky = Drawing { fragment: Some("nothing"), target: Some(SKY.into()), depth: None, ..no_sun };
        let shade = ["shade", "pack"].map(|entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&shaded),
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        });
        let (tiles, quantiles) = constants(gpu);
        Self {
            draw: sides.map(|cull| drawing(device, &module, &drawn, &camera(cull))),
            sun: sides.map(|cull| drawing(device, &module, &drawn, &sun(cull))),
            hide: drawing(device, &module, &drawn, &hide),
            erase: [drawing(device, &module, &drawn, &no_sun), drawing(device, &module, &drawn, &no_sky)],
            triangles,
            pixels,
            maps,
            shade,
            tiles,
            quantiles,
        }
    }
}
