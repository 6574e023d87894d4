//! Device memory of a submission, and bind groups.

use swerve_gpu::wgpu;

use super::layout::ImageWords;
use super::meshes::CLUSTER;
use super::records::SUB_FRAME_ROWS;
use super::renderer::GpuRenderer;
use super::sub_frames::RoundCommands;
use super::target::Target;

/// Number of target sizes kept.
const TARGETS_KEPT: usize = 4;

impl GpuRenderer {
    /// Reserves memory for a submission and uploads it.
    pub(super) fn upload(
        &mut self,
        size: [u32; 3],
        words: ImageWords,
        rounds: &[RoundCommands],
    ) -> Result<(), String> {
        let gpu = &self.gpu;
        let queue = gpu.queue();
        if self.listed.all.len() > (u32::MAX as usize) / CLUSTER {
            return Err(format!("{} clusters of triangles are too many", self.listed.all.len()));
        }
        let fixed = 16 * self.statics.surfaces.rows.len() as u64;
        let mut replaced = self.meshes.upload(gpu)? | self.lenses.upload(gpu)?;
        let needed = fixed + size_of_val(self.records.rows.as_slice()) as u64;
        if self.frame.reserve(gpu, needed)?.is_some() {
            (self.statics.is_new, replaced) = (true, true);
        }
        if core::mem::take(&mut self.statics.is_new) {
            let rows = bytemuck::cast_slice(&self.statics.surfaces.rows);
            queue.write_buffer(self.frame.get(), 0, rows);
        }
        queue.write_buffer(self.frame.get(), fixed, bytemuck::cast_slice(&self.records.rows));
        replaced |= self.clusters.reserve(gpu, size_of_val(self.listed.all.as_slice()) as u64)?.is_some();
        queue.write_buffer(self.clusters.get(), 0, bytemuck::cast_slice(&self.listed.all));
        let step = self.round_step() / 4;
        let mut numbers = Vec::new();
        for dispatch in rounds.iter().flat_map(|round| &round.dispatches) {
            numbers.extend([dispatch.first_record, SUB_FRAME_ROWS, 0, 0]);
            numbers.resize(numbers.len().next_multiple_of(step), 0_u32);
        }
        replaced |= self.rounds.reserve(gpu, size_of_val(numbers.as_slice()) as u64)?.is_some();
        queue.write_buffer(self.rounds.get(), 0, bytemuck::cast_slice(&numbers));
        replaced |= self.images.reserve(gpu, 4 * words.images)?.is_some();
        replaced |= self.kept.reserve(gpu, 4 * words.kept)?.is_some();
        replaced |= self.take_target(size);
        if replaced || self.bound.is_none() {
            self.bound = Some(self.bind());
        }
        Ok(())
    }

    /// Moves the target of a size to the end; returns true if the current target changed. Targets have exactly this
    /// size, as clearing a larger one can take longer than drawing.
    fn take_target(&mut self, size: [u32; 3]) -> bool {
        let fits = |target: &Target| target.size[..2] == size[..2] && target.size[2] >= size[2];
        if fits(self.target()) {
            return false;
        }
        let target = match self.targets.iter().position(fits) {
            Some(index) => self.targets.remove(index),
            None => {
                self.targets.retain(|target| target.size[..2] != size[..2]);
                Target::new(&self.gpu, size)
            }
        };
        if self.targets.len() == TARGETS_KEPT {
            self.targets.remove(0);
        }
        self.targets.push(target);
        true
    }

    pub(super) fn target(&self) -> &Target {
        self.targets.last().expect("there is one from the start")
    }

    /// Byte offset between the parameters of consecutive rounds.
    pub(super) fn round_step(&self) -> usize {
        16_usize.next_multiple_of(self.gpu.limits().min_uniform_buffer_offset_alignment.max(16) as usize)
    }

    fn bind(&self) -> [wgpu::BindGroup; 2] {
        let device = self.gpu.device();
        fn whole(binding: u32, buffer: &wgpu::Buffer) -> (u32, wgpu::BindingResource<'_>) {
            (binding, wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size: None }))
        }
        let group = |layout, entries: Vec<(u32, wgpu::BindingResource<'_>)>| {
            let entries: Vec<_> = entries
                .into_iter()
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
        };
        let [vertices, triangles] = &self.meshes.on_device;
        let shapes = vec![
            whole(0, vertices.get()),
            whole(1, triangles.get()),
            whole(2, self.frame.get()),
            whole(3, self.clusters.get()),
        ];
        let one = wgpu::BufferBinding {
            buffer: self.rounds.get(),
            offset: 0,
            size: core::num::NonZeroU64::new(16),
        };
        let pixels = vec![
            (0, wgpu::BindingResource::Buffer(one)),
            whole(1, &self.pipelines.tiles),
            whole(2, self.lenses.buffer()),
            whole(3, self.images.get()),
            whole(4, self.kept.get()),
            (5, wgpu::BindingResource::TextureView(&self.target().visible)),
        ];
        [group(&self.pipelines.triangles, shapes), group(&self.pipelines.pixels, pixels)]
    }

    pub(super) fn bound(&self) -> &[wgpu::BindGroup; 2] {
        self.bound.as_ref().expect("everything is bound before something is drawn")
    }
}
