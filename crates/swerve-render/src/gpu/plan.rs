//! What a submission does, before anything is told to the device: places of images, looks and their rounds.

use core::ops::Range;

use swerve_geom::{Map, Point, Transform};

use super::meshes::{MeshStore, Shape};
use super::records::{NONE, Records, Row};
use crate::Camera;
use crate::cpu::Look;
use crate::cpu::geometry::Pinhole;
use crate::cpu::resolve::rows_of;
use crate::cpu::shadow;
use crate::frame::Outputs;
use crate::mesh::Mesh;
use crate::renderer::View;
use crate::scene::{Instance, Scene};
use crate::surface;

/// One instance, ready to be drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Thing {
    pub(super) shape: Shape,
    /// First row of its surfaces.
    pub(super) surfaces: u32,
    /// Ball that holds it: centre in its body's frame, and radius.
    sphere: ([f32; 3], f32),
    /// The centre in the map's frame.
    pub(super) middle: [f64; 3],
    pub(super) casts: bool,
}

impl Thing {
    /// Of an instance; its surfaces are written to the records.
    pub(super) fn new(
        scene: &Scene,
        instance: &Instance,
        meshes: &mut MeshStore,
        records: &mut Records,
    ) -> Self {
        let mesh: &Mesh = scene.meshes.get(instance.mesh);
        let surfaces = records.next();
        for material in mesh.materials() {
            records.surface(&surface::surface(material, instance, scene));
        }
        let sphere = mesh.sphere();
        Self {
            shape: meshes.shape(instance.mesh, &scene.meshes),
            surfaces,
            sphere,
            middle: middle(&instance.map_from_body, sphere.0),
            casts: shadow::casts(instance),
        }
    }

    pub(super) fn radius(&self) -> f32 {
        self.sphere.1
    }

    /// Where its middle is in another pose.
    pub(super) fn middle_at(&self, map_from_body: &Transform<Map, crate::mesh::Body>) -> [f64; 3] {
        middle(map_from_body, self.sphere.0)
    }
}

fn middle(map_from_body: &Transform<Map, crate::mesh::Body>, [x, y, z]: [f32; 3]) -> [f64; 3] {
    (*map_from_body * Point::new(f64::from(x), f64::from(y), f64::from(z))).coords.into()
}

/// Writes where an instance is, relative to a centre.
pub(super) fn write_item(
    records: &mut Records,
    map_from_body: &Transform<Map, crate::mesh::Body>,
    centre: [f64; 3],
    surfaces: u32,
) {
    let origin: [f64; 3] = map_from_body.origin().coords.into();
    let place = [0, 1, 2].map(|k| origin[k] - centre[k]);
    records.item(&rows_of(map_from_body), place, surfaces);
}

/// Clusters that are drawn one after the other: (row of the item, cluster, row of the look, 0).
#[derive(Default)]
pub(super) struct Clusters {
    pub(super) all: Vec<Row>,
    /// Those with two sides, until the others are complete.
    two_sided: Vec<Row>,
}

/// Clusters with one side, and those with two.
pub(super) type Sides = [Range<u32>; 2];

impl Clusters {
    /// Adds what `fill` gives as one group.
    pub(super) fn group(&mut self, fill: impl FnOnce(&mut dyn FnMut(Shape, u32, u32))) -> Sides {
        let Self { all, two_sided } = self;
        two_sided.clear();
        let from = all.len() as u32;
        fill(&mut |shape, item, look| {
            let Shape { first, one_sided, two_sided: both } = shape;
            all.extend((first..first + one_sided).map(|cluster| [item, cluster, look, 0]));
            let first = first + one_sided;
            two_sided.extend((first..first + both).map(|cluster| [item, cluster, look, 0]));
        });
        let middle = all.len() as u32;
        all.extend_from_slice(two_sided);
        [from..middle, middle..all.len() as u32]
    }
}

/// Where the images of one view are, in words of all that is read back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Planes {
    pub(super) pixels: usize,
    /// Colour, depth, classes, instances; [`NONE`] for what is not asked for.
    pub(super) first: [u32; 4],
    /// Sums of sub-frames.
    pub(super) sums: u32,
}

/// Words that a part of the memory is aligned to.
const ALIGNED: usize = 64;

impl Planes {
    /// Places the images of views one after the other, and says how many words images and sums have.
    pub(super) fn all(views: &[(View<'_>, Outputs)]) -> Result<(Vec<Self>, [u64; 2]), String> {
        let (mut words, mut sums) = (0_usize, 0_usize);
        let planes: Vec<Self> = views
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
                let own = sums as u32;
                if outputs.rgb && view.camera.spec().shutter.blur_samples > 1 {
                    sums += 3 * padded;
                }
                Self { pixels, first, sums: own }
            })
            .collect();
        if words.max(sums) > (u32::MAX / 4) as usize {
            return Err(format!("images of {words} words are too large"));
        }
        Ok((planes, [words as u64, sums as u64]))
    }

    /// Bytes of an image from its first one on.
    pub(super) fn bytes(&self, image: usize) -> Range<usize> {
        let size = self.pixels * [3, 4, 1, 4][image];
        let from = 4 * self.first[image] as usize;
        from..from + size
    }
}

/// One look of a view, and where it is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// Which view.
    pub(super) view: usize,
    pub(super) look: Look,
    /// Columns and rows that are drawn, and where to.
    pub(super) size: (u32, u32),
    pub(super) at: (u32, u32),
}

/// Looks that are drawn side by side.
#[derive(Debug, Default)]
pub(super) struct Round {
    pub(super) looks: Vec<Placed>,
}

/// Packs looks on shelves.
struct Packer {
    most: u32,
    rounds: Vec<Round>,
    /// Size of the image that all rounds are drawn to.
    size: (u32, u32),
    /// Where the next look of the round goes, and how high its shelf is.
    next: (u32, u32),
    shelf: u32,
}

/// Pixels that a round may have, unless one look has more.
const ROUND_PIXELS: u64 = 1 << 25;

impl Packer {
    fn start_round(&mut self) {
        self.rounds.push(Round::default());
        (self.next, self.shelf) = ((0, 0), 0);
    }

    fn add(&mut self, view: usize, look: Look, (width, height): (u32, u32)) -> Result<(), String> {
        let most = self.most;
        if width > most || height > most {
            return Err(format!("an image of {width} x {height} pixels is drawn, the adapter takes {most}"));
        }
        if self.next.0 + width > most.min(SHELF).max(width) {
            self.next = (0, self.next.1 + self.shelf);
            self.shelf = 0;
        }
        let bottom = self.next.1 + height;
        let area = u64::from(self.size.0.max(width)) * u64::from(bottom);
        if self.next != (0, 0) && (bottom > most || area > ROUND_PIXELS) {
            self.start_round();
        }
        let at = self.next;
        self.next.0 += width;
        self.shelf = self.shelf.max(height);
        self.size = (self.size.0.max(self.next.0), self.size.1.max(at.1 + height));
        let round = self.rounds.last_mut().expect("a round was started");
        round.looks.push(Placed { view, look, size: (width, height), at });
        Ok(())
    }
}

/// Columns of looks side by side, unless one look has more.
const SHELF: u32 = 8192;

/// Orders the looks of all views to rounds: sub-frames of a view go to rounds of their own, one after the
/// other. `views` gives the order of the views, and of each the pinhole image that it is drawn as; `most` is
/// the largest side.
pub(super) fn rounds(
    views: &[(usize, &Camera, Outputs, Pinhole, bool)],
    most: u32,
) -> Result<(Vec<Round>, (u32, u32)), String> {
    let mut packer = Packer { most, rounds: Vec::new(), size: (1, 1), next: (0, 0), shelf: 0 };
    let looks: Vec<Vec<Look>> =
        views.iter().map(|(_, camera, outputs, ..)| Look::all(camera, *outputs).collect()).collect();
    let samples = looks.iter().flatten().map(|look| look.samples).max().unwrap_or(0);
    for sample in 0..samples {
        packer.start_round();
        for ((view, _, _, image, has_lens), looks) in views.iter().zip(&looks) {
            for look in looks.iter().filter(|look| look.sample == sample) {
                let rows = if *has_lens { image.height } else { look.rows.1 - look.rows.0 };
                packer.add(*view, *look, (image.width as u32, rows as u32))?;
            }
        }
    }
    Ok((packer.rounds, packer.size))
}
