//! Command encoding: passes that draw and shade.

use core::ops::Range;

use swerve_gpu::wgpu;

use super::cells::MapJob;
use super::meshes::CLUSTER;
use super::plan::ClusterRanges;
use super::renderer::GpuRenderer;
use super::sub_frames::RoundCommands;

impl GpuRenderer {
    /// Draws shadow casters to one of the maps.
    pub(super) fn draw_maps(&self, encoder: &mut wgpu::CommandEncoder, job: &MapJob) {
        let maps = &self.maps.maps[job.maps];
        let [shapes, _] = self.bound();
        let mut depth = cleared_depth(&maps.sun[job.part]);
        let mut colour = cleared(&maps.sky[job.part]);
        if !job.is_new {
            depth.depth_ops =
                Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store });
            colour.ops.load = wgpu::LoadOp::Load;
        }
        let quads = |pass: &mut wgpu::RenderPass<'_>, pipeline, which: &Range<u32>| {
            if !which.is_empty() {
                pass.set_bind_group(0, shapes, &[]);
                pass.set_pipeline(pipeline);
                pass.draw(0..6, which.clone());
            }
        };
        let [no_sun, no_sky] = &self.pipelines.erase;
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sun"),
            depth_stencil_attachment: Some(depth),
            ..wgpu::RenderPassDescriptor::default()
        });
        quads(&mut pass, no_sun, &job.erased[0]);
        self.draw_clusters(&mut pass, &self.pipelines.sun, &job.sun);
        drop(pass);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sky"),
            color_attachments: &[Some(colour)],
            ..wgpu::RenderPassDescriptor::default()
        });
        quads(&mut pass, no_sky, &job.erased[1]);
        quads(&mut pass, &self.pipelines.hide, &job.footprints);
    }

    /// Draws the triangles of a round.
    pub(super) fn draw_round(&self, encoder: &mut wgpu::CommandEncoder, round: &RoundCommands) {
        for (placed, clusters) in &round.sub_frames {
            let [visible, depth] = &self.target().layers[placed.layer as usize];
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("triangles"),
                color_attachments: &[Some(cleared(visible))],
                depth_stencil_attachment: Some(cleared_depth(depth)),
                ..wgpu::RenderPassDescriptor::default()
            });
            let (width, height) = placed.size;
            pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(0, 0, width, height);
            self.draw_clusters(&mut pass, &self.pipelines.draw, clusters);
        }
    }

    /// Draws clusters, single-sided ones first.
    fn draw_clusters(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &[wgpu::RenderPipeline; 2],
        ranges: &ClusterRanges,
    ) {
        pass.set_bind_group(0, &self.bound()[0], &[]);
        for (pipeline, clusters) in pipelines.iter().zip(ranges) {
            if !clusters.is_empty() {
                pass.set_pipeline(pipeline);
                pass.draw(0..3 * CLUSTER as u32, clusters.clone());
            }
        }
    }

    /// Shades the pixels of a round; `dispatched` counts the dispatches of the submission.
    pub(super) fn shade_round(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        round: &RoundCommands,
        dispatched: &mut usize,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let [shapes, pixels] = self.bound();
        pass.set_bind_group(0, shapes, &[]);
        // A unit of work of the second step covers four pixels.
        for (pipeline, pixels_each) in self.pipelines.shade.iter().zip([1, 4]) {
            pass.set_pipeline(pipeline);
            for (k, dispatch) in round.dispatches.iter().enumerate() {
                pass.set_bind_group(1, pixels, &[((*dispatched + k) * self.round_step()) as u32]);
                let maps = dispatch.maps.map_or(&self.no_maps, |maps| &self.maps.maps[maps].bound);
                pass.set_bind_group(2, maps, &[]);
                let blocks = dispatch.blocks.div_ceil(pixels_each);
                let across = blocks.min(BLOCKS_ACROSS);
                pass.dispatch_workgroups(across, dispatch.sub_frames, blocks.div_ceil(BLOCKS_ACROSS));
            }
        }
        *dispatched += round.dispatches.len();
    }
}

/// Blocks of 64 pixels in the first dimension of a dispatch; must match `pass.wgsl`.
const BLOCKS_ACROSS: u32 = 32768;

fn cleared(view: &wgpu::TextureView) -> wgpu::RenderPassColorAttachment<'_> {
    let ops =
        wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store };
    wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops }
}

fn cleared_depth(view: &wgpu::TextureView) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store };
    wgpu::RenderPassDepthStencilAttachment { view, depth_ops: Some(ops), stencil_ops: None }
}
