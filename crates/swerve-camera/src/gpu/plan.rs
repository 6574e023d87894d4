//! Plan of a submission before any device work: image layouts, sub-frames and their rounds.

use core::ops::Range;

use swerve_geom::{Map, Point, Transform};
use swerve_gpu::wgpu;
use swerve_scene::{Body, Instance, Mesh, Scene};

use super::maps::Corners;
use super::meshes::{MeshStore, Shape};
use super::records::{NONE, Records, Row};
use super::sub_frames::PreparedView;
use crate::frame::Outputs;
use crate::frontend::pinhole::Pinhole;
use crate::frontend::pose::rotation_rows;
use crate::frontend::shadow;
use crate::frontend::sub_frame::SubFrame;
use crate::frontend::surface::Surface;
use crate::{Camera, View};

/// Instance prepared for drawing.
#[derive(Clone, Copy, Debug)]
pub(super) struct DrawInstance {
    pub(super) shape: Shape,
    /// First row of its surfaces.
    pub(super) surfaces: u32,
    /// Bounding sphere: centre in the body's frame, and radius.
    sphere: ([f32; 3], f32),
    /// Centre in the map frame.
    pub(super) middle: [f64; 3],
    pub(super) casts: bool,
}

impl DrawInstance {
    /// Prepares an instance and writes its surfaces to the records.
    pub(super) fn new(
        scene: &Scene,
        instance: &Instance,
        meshes: &mut MeshStore,
        records: &mut Records,
    ) -> Self {
        let mesh: &Mesh = scene.meshes.get(instance.mesh);
        let surfaces = records.next();
        for material in mesh.materials() {
            records.surface(&Surface::new(material, instance, scene));
        }
        let sphere = mesh.sphere();
        Self {
            shape: meshes.shape(instance.mesh, &scene.meshes),
            surfaces,
            sphere,
            middle: middle(&instance.map_from_body, sphere.0),
            casts: shadow::casts_shadow(instance),
        }
    }

    pub(super) fn radius(&self) -> f32 {
        self.sphere.1
    }

    /// Centre in another pose.
    pub(super) fn middle_at(&self, map_from_body: &Transform<Map, Body>) -> [f64; 3] {
        middle(map_from_body, self.sphere.0)
    }
}

fn middle(map_from_body: &Transform<Map, Body>, [x, y, z]: [f32; 3]) -> [f64; 3] {
    (*map_from_body * Point::new(f64::from(x), f64::from(y), f64::from(z))).coords.into()
}

/// Writes the pose of an instance relative to a centre.
pub(super) fn write_item(
    records: &mut Records,
    map_from_body: &Transform<Map, Body>,
    centre: [f64; 3],
    surfaces: u32,
) {
    let origin: [f64; 3] = map_from_body.origin().coords.into();
    let place = [0, 1, 2].map(|k| origin[k] - centre[k]);
    records.item(&rotation_rows(map_from_body), place, surfaces);
}

/// Rectangle of the sun's map that an instance may cover, with a margin of a texel or two.
pub(super) fn corners_in_sun(instance: &DrawInstance, centre: [f64; 3], sun: [f32; 3]) -> Corners {
    let [across, up, _] = shadow::axes(sun);
    let at = [0, 1, 2].map(|k| (instance.middle[k] - centre[k]) as f32);
    let dot = |a: [f32; 3]| a[0] * at[0] + a[1] * at[1] + a[2] * at[2];
    around([dot(across), -dot(up)], instance.radius(), shadow::REACH_M)
}

/// Rectangle of the sky's map covered by a footprint.
pub(super) fn corners_in_sky(footprint: &shadow::Footprint) -> Corners {
    let [x, y] = footprint.place;
    around([x, -y], footprint.reach, 0.5 * shadow::SKY_SIDE as f32 / shadow::SKY_PER_M)
}

fn around([x, y]: [f32; 2], radius: f32, reach: f32) -> Corners {
    let wide = radius + 0.5;
    [x - wide, y - wide, x + wide, y + wide].map(|v| v / reach)
}

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

/// Location of one view's images, in words of the read-back buffer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct ImageLayout {
    pub(super) pixels: usize,
    /// Colour, depth, classes, instances; [`NONE`] for images not requested.
    pub(super) first: [u32; 4],
    /// Unpacked colours and classes, a word each, and sums of sub-frames, three words each.
    pub(super) kept: u32,
    pub(super) sums: u32,
}

/// Numbers of words of a submission: for images, and for intermediate data.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct ImageWords {
    pub(super) images: u64,
    pub(super) kept: u64,
}

/// Alignment of a memory part, words.
const ALIGNED: usize = 64;

impl ImageLayout {
    /// Layouts of the images of views, one after the other.
    pub(super) fn all(views: &[(View<'_>, Outputs)]) -> Result<(Vec<Self>, ImageWords), String> {
        let (mut words, mut kept) = (0_usize, 0_usize);
        let layouts: Vec<Self> = views
            .iter()
            .map(|(view, outputs)| {
                let pixels = view.camera.width_px() * view.camera.height_px();
                let padded = pixels.next_multiple_of(ALIGNED);
                let wanted = [outputs.rgb, outputs.depth, outputs.semantic, outputs.instance];
                let sizes = [3 * padded / 4, padded, padded / 4, padded];
                let mut first = [NONE; 4];
                for k in 0..4 {
                    if wanted[k] {
                        first[k] = words as u32;
                        words += sizes[k].next_multiple_of(ALIGNED);
                    }
                }
                let own = kept;
                kept += padded;
                let sums = kept;
                if outputs.rgb && view.camera.spec().shutter.blur_samples > 1 {
                    kept += 3 * padded;
                }
                Self { pixels, first, kept: own as u32, sums: sums as u32 }
            })
            .collect();
        if words.max(kept) > (u32::MAX / 4) as usize {
            return Err(format!("images of {words} words are too large"));
        }
        Ok((layouts, ImageWords { images: words as u64, kept: kept as u64 }))
    }

    /// Byte range of an image.
    pub(super) fn bytes(&self, image: usize) -> Range<usize> {
        let size = self.pixels * [3, 4, 1, 4][image];
        let from = 4 * self.first[image] as usize;
        from..from + size
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

    #[test]
    fn layouts_place_only_requested_images_one_after_the_other() {
        let camera = camera(7, 3, Shutter::default());
        let at = swerve_geom::Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
        let view = View::new(&camera, at);
        let (layouts, words) = ImageLayout::all(&[(view, Outputs::GEOMETRY), (view, Outputs::RGB)]).unwrap();
        assert_eq!(layouts[0].first, [NONE, 0, 64, 128]);
        assert_eq!(layouts[1].first, [192, NONE, NONE, NONE]);
        assert_eq!((words.images, words.kept), (256, 128));
        assert_eq!((layouts[1].bytes(0), layouts[0].bytes(2)), (768..768 + 63, 256..256 + 21));
    }
}
