//! Plan of a submission before any device work: clusters, sub-frames and their rounds.

use core::ops::Range;

use swerve_gpu::wgpu;

use super::meshes::Shape;
use super::prepared::PreparedView;
use super::records::Row;
use crate::Camera;
use crate::frame::Outputs;
use crate::frontend::pinhole::Pinhole;
use crate::frontend::sub_frame::SubFrame;

/// Clusters drawn one after the other: (row of the item, cluster, row of the sub-frame, 0).
#[derive(Default)]
pub(super) struct Clusters {
    pub(super) all: Vec<Row>,
    /// Double-sided clusters, held back until the single-sided ones are complete.
    two_sided: Vec<Row>,
}

/// Ranges of single-sided and of double-sided clusters.
pub(super) type ClusterRanges = [Range<u32>; 2];

impl Clusters {
    /// Adds the clusters emitted by `fill` as one group.
    pub(super) fn group(&mut self, fill: impl FnOnce(&mut dyn FnMut(Shape, u32, u32))) -> ClusterRanges {
        let Self { all, two_sided } = self;
        two_sided.clear();
        let from = all.len() as u32;
        fill(&mut |shape, item, sub_frame| {
            let Shape { first, one_sided, two_sided: both } = shape;
            all.extend((first..first + one_sided).map(|cluster| [item, cluster, sub_frame, 0]));
            let first = first + one_sided;
            two_sided.extend((first..first + both).map(|cluster| [item, cluster, sub_frame, 0]));
        });
        let middle = all.len() as u32;
        all.extend_from_slice(two_sided);
        [from..middle, middle..all.len() as u32]
    }
}

/// Sub-frame of a view, and its place in the target.
#[derive(Clone, Debug)]
pub(super) struct PlacedSubFrame {
    /// Index of the view.
    pub(super) view: usize,
    pub(super) sub_frame: SubFrame,
    /// Columns and rows to draw, and the layer.
    pub(super) size: (u32, u32),
    pub(super) layer: u32,
}

/// Sub-frames that are drawn together, each to a separate layer, so that other content does not change the last bits of
/// its triangles' edges.
#[derive(Debug, Default)]
pub(super) struct Round {
    pub(super) sub_frames: Vec<PlacedSubFrame>,
}

/// Largest number of pixels of all layers of a round, unless one sub-frame has more.
const ROUND_PIXELS: u64 = 1 << 25;

/// View in drawing order.
pub(super) struct Ordered<'a> {
    /// Index of the view.
    pub(super) view: usize,
    camera: &'a Camera,
    outputs: Outputs,
    /// Pinhole image behind its lens, if it has one.
    lens: Option<Pinhole>,
}

impl<'a> Ordered<'a> {
    pub(super) fn new(view: usize, prepared: &PreparedView<'a>) -> Self {
        let lens = prepared.lens.map(|lens| lens.pinhole);
        Self { view, camera: prepared.view.camera, outputs: prepared.outputs, lens }
    }
}

/// Groups the sub-frames of views into rounds: samples of the same rows go to separate, consecutive rounds. Also
/// returns the size and number of layers.
///
/// # Errors
/// If the adapter does not support images that large.
pub(super) fn rounds(views: &[Ordered<'_>], limits: &wgpu::Limits) -> Result<(Vec<Round>, [u32; 3]), String> {
    let mut sub_frames = Vec::new();
    let (mut width, mut height) = (1, 1);
    for Ordered { view, camera, outputs, lens } in views {
        for sub_frame in SubFrame::all(camera, *outputs) {
            let size = match lens {
                Some(image) => (image.width as u32, image.height as u32),
                None => (camera.width_px() as u32, sub_frame.rows.len() as u32),
            };
            (width, height) = (width.max(size.0), height.max(size.1));
            sub_frames.push(PlacedSubFrame { view: *view, sub_frame, size, layer: 0 });
        }
    }
    let most = limits.max_texture_dimension_2d;
    if width > most || height > most {
        return Err(format!("an image of {width} x {height} pixels is drawn, the adapter takes {most}"));
    }
    let area = u64::from(width) * u64::from(height);
    let most = (ROUND_PIXELS / area).clamp(1, u64::from(limits.max_texture_array_layers)) as u32;
    sub_frames.sort_by_key(|placed| placed.sub_frame.sample);
    let mut rounds: Vec<Round> = Vec::new();
    let (mut sample, mut layers) = (None, 0);
    for placed in sub_frames {
        let is_full = rounds.last().is_none_or(|round| round.sub_frames.len() as u32 == most);
        if is_full || sample != Some(placed.sub_frame.sample) {
            rounds.push(Round::default());
            sample = Some(placed.sub_frame.sample);
        }
        let round = rounds.last_mut().expect("the first sub-frame starts a round");
        round.sub_frames.push(PlacedSubFrame { layer: round.sub_frames.len() as u32, ..placed });
        layers = layers.max(round.sub_frames.len() as u32);
    }
    Ok((rounds, [width, height, layers.max(1)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraSpec, Shutter};

    fn camera(width_px: u32, height_px: u32, shutter: Shutter) -> Camera {
        Camera::new(CameraSpec { width_px, height_px, shutter, ..CameraSpec::default() }).unwrap()
    }

    fn ordered(cameras: &[Camera]) -> Vec<Ordered<'_>> {
        let ordered = |(view, camera)| Ordered { view, camera, outputs: Outputs::ALL, lens: None };
        cameras.iter().enumerate().map(ordered).collect()
    }

    #[test]
    fn rounds_order_samples_and_group_slabs() {
        let shutter = Shutter { exposure_s: 0.01, blur_samples: 3, readout_s: 0.01, readout_slabs: 2 };
        let cameras = [camera(64, 64, shutter), camera(100, 20, Shutter::default())];
        let (rounds, size) = rounds(&ordered(&cameras), &wgpu::Limits::default()).unwrap();
        let counts: Vec<usize> = rounds.iter().map(|round| round.sub_frames.len()).collect();
        assert_eq!((counts, size), (vec![3, 2, 2], [100, 32, 3]));
        for (sample, round) in rounds.iter().enumerate() {
            for (k, placed) in round.sub_frames.iter().enumerate() {
                assert_eq!((placed.sub_frame.sample as usize, placed.layer as usize), (sample, k));
            }
        }
    }

    #[test]
    fn rounds_limit_the_layers_of_large_images_and_reject_too_large_ones() {
        let cameras = vec![camera(4096, 4096, Shutter::default()); 5];
        let limits = wgpu::Limits::default();
        let (some, size) = rounds(&ordered(&cameras), &limits).unwrap();
        assert_eq!((some.len(), size), (3, [4096, 4096, 2]));
        let few = wgpu::Limits { max_texture_dimension_2d: 2048, ..limits };
        let error = rounds(&ordered(&cameras), &few).unwrap_err();
        assert_eq!(error, "an image of 4096 x 4096 pixels is drawn, the adapter takes 2048");
    }
}
