//! Trees as words for compute shaders: data kept on a device between turns, and data sent for each turn.
//!
//! Both contain the nodes and blocks of the trees, linked by indices; they are read by the shader `gpu/rays.wgsl`.

use super::SceneTree;
use super::instances::{InstanceTree, PlacedInstance};
use super::shape::{Shape, Surface};
use crate::bvh::{NODE_WORDS, link};
use crate::soup::BLOCK_WORDS;

/// Words of a surface: instance id, class with flags, bits of the reflectance, unused.
const SURFACE_WORDS: usize = 4;
/// Words of an instance: its axes and origin, each with one word of attributes.
const PLACED_WORDS: usize = 16;
/// Words of a column: rows of its rotation with the origin, the tree of moving instances, its number, sine and cosine
/// of its azimuth.
const COLUMN_WORDS: usize = 16;
/// Flag above the class of a surface: retro-reflective.
const RETRO: u32 = 1 << 8;
/// Flag above the class of a surface: the class is the material's own, not the instance's.
const KEEPS_CLASS: u32 = 1 << 9;

/// Pose of a column in the tree frame: origin, and the rotation of the beam directions, row by row.
pub(crate) struct ColumnPose {
    pub(crate) origin: [f32; 3],
    pub(crate) matrix: [[f32; 3]; 3],
}

/// Words of one kind on a device or to be uploaded.
#[derive(Debug, Default)]
pub(crate) struct UploadBuffer {
    /// Number of words on the device.
    pub(crate) uploaded: usize,
    /// Words to be appended.
    pub(crate) pending: Vec<u32>,
}

impl UploadBuffer {
    /// Number of elements of this many words each, including pending ones.
    fn count(&self, words: usize) -> u32 {
        ((self.uploaded + self.pending.len()) / words) as u32
    }

    fn clear(&mut self) {
        self.uploaded = 0;
        self.pending.clear();
    }

    /// Number of words after all are uploaded.
    pub(crate) fn len(&self) -> usize {
        self.uploaded + self.pending.len()
    }

    /// Marks all words as uploaded.
    pub(crate) fn mark_uploaded(&mut self) {
        self.uploaded += self.pending.len();
        self.pending.clear();
    }
}

/// Trees kept on a device: the static part, and the meshes of moving instances.
#[derive(Debug, Default)]
pub(crate) struct GpuScene {
    statics: Option<(u64, usize)>,
    ground: u32,
    /// Content and root of the tree of each mesh.
    meshes: Vec<Option<(u64, u32)>>,
    levels: u32,
    level_of: Vec<u32>,
    /// Nodes of four boxes.
    pub(crate) nodes: UploadBuffer,
    /// Blocks of four triangles.
    pub(crate) blocks: UploadBuffer,
    /// Surfaces.
    pub(crate) surfaces: UploadBuffer,
}

impl GpuScene {
    /// Returns true if trees on the device do not match the scene, so that all must be replaced.
    pub(crate) fn is_outdated(&self, tree: &SceneTree) -> bool {
        let other = |(id, kept): (usize, &Option<(u64, u32)>)| {
            let new = tree.shapes.get(id).and_then(|kept| kept.key);
            matches!((kept, new), (Some((old, _)), Some(new)) if *old != new)
        };
        self.statics.is_some()
            && (self.statics != statics_key(tree) || self.meshes.iter().enumerate().any(other))
    }

    /// Removes all trees.
    pub(crate) fn clear(&mut self) {
        self.statics = None;
        self.meshes.clear();
        self.levels = 0;
        for arena in [&mut self.nodes, &mut self.blocks, &mut self.surfaces] {
            arena.clear();
        }
    }

    /// Adds the trees missing on the device; existing ones must be valid.
    pub(crate) fn add_missing(&mut self, tree: &SceneTree) {
        if self.statics.is_none() {
            self.ground = self.add(&tree.ground);
            self.statics = statics_key(tree);
        }
        if self.meshes.len() < tree.shapes.len() {
            self.meshes.resize(tree.shapes.len(), None);
        }
        for (id, kept) in tree.shapes.iter().enumerate() {
            if let (Some(key), None) = (kept.key, self.meshes[id]) {
                self.meshes[id] = Some((key, self.add(&kept.shape)));
            }
        }
    }

    fn add(&mut self, shape: &Shape) -> u32 {
        let first_node = self.nodes.count(NODE_WORDS);
        let first_block = self.blocks.count(BLOCK_WORDS);
        let first_surface = self.surfaces.count(SURFACE_WORDS);
        self.levels = self.levels.max(shape.soup.bvh().levels(&mut self.level_of));
        shape.soup.flatten(&mut self.blocks.pending, first_surface);
        self.surfaces.pending.extend(shape.surfaces.iter().flat_map(surface_words));
        shape.soup.bvh().flatten(&mut self.nodes.pending, first_node, first_block, 0)
    }

    /// Returns true if links can address all nodes and blocks.
    pub(crate) fn is_in_bounds(&self) -> bool {
        let most = self.nodes.len() / NODE_WORDS + self.blocks.len() / BLOCK_WORDS;
        most <= link::INDEX_MAX
    }

    fn root(&self, placed: &PlacedInstance) -> u32 {
        self.meshes.get(placed.mesh.index()).copied().flatten().map_or(link::NONE, |(_, root)| root)
    }
}

/// Content key of the static tree.
fn statics_key(tree: &SceneTree) -> Option<(u64, usize)> {
    Some((tree.static_version.unwrap_or_default(), tree.static_triangles_max))
}

fn surface_words(surface: &Surface) -> [u32; SURFACE_WORDS] {
    let flag = |is: bool, bit: u32| if is { bit } else { 0 };
    let flags = flag(surface.is_retro_reflective, RETRO) | flag(surface.keeps_class, KEEPS_CLASS);
    [surface.instance_id, surface.class as u32 | flags, surface.reflectance.to_bits(), 0]
}

/// Columns of a turn with the instances of their steps, in the form sent to a device.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    /// Trees of instances.
    pub(crate) nodes: Vec<u32>,
    /// Instances.
    pub(crate) placed: Vec<u32>,
    /// Columns.
    pub(crate) columns: Vec<u32>,
    /// Roots of the static tree, and of the tree of static instances outside it.
    pub(crate) roots: [u32; 2],
    levels: u32,
    level_of: Vec<u32>,
}

impl Batch {
    /// Clears the batch, for a scene on the device.
    pub(crate) fn begin(&mut self, tree: &SceneTree, gpu_scene: &GpuScene) {
        self.nodes.clear();
        self.placed.clear();
        self.columns.clear();
        self.levels = 0;
        self.roots = [gpu_scene.ground, link::NONE];
        self.roots[1] = self.add(&tree.far_statics, gpu_scene);
    }

    /// Adds the instances of a step and returns the link to their tree.
    pub(crate) fn add(&mut self, instances: &InstanceTree, gpu_scene: &GpuScene) -> u32 {
        let first_node = (self.nodes.len() / NODE_WORDS) as u32;
        let first_placed = (self.placed.len() / PLACED_WORDS) as u32;
        self.levels = self.levels.max(instances.bvh.levels(&mut self.level_of));
        for placed in &instances.placed {
            let [x, y, z] = placed.pose.axes;
            let class = placed.class as u32;
            let rows = [x, y, z, placed.pose.origin];
            let last = [gpu_scene.root(placed), placed.instance_id, class, 0];
            for (row, last) in rows.into_iter().zip(last) {
                self.placed.extend(row.map(f32::to_bits));
                self.placed.push(last);
            }
        }
        instances.bvh.flatten(&mut self.nodes, first_node, first_placed, link::TOP)
    }

    /// Adds a column: its pose, the tree of its step, its number in the turn, sine and cosine of its azimuth.
    pub(crate) fn add_column(&mut self, pose: &ColumnPose, moving: u32, number: u32, azimuth: [f32; 2]) {
        let mut words = [0; COLUMN_WORDS];
        for (axis, (row, origin)) in pose.matrix.iter().zip(pose.origin).enumerate() {
            let [x, y, z] = row.map(f32::to_bits);
            words[4 * axis..4 * axis + 4].copy_from_slice(&[x, y, z, origin.to_bits()]);
        }
        let [sin, cos] = azimuth.map(f32::to_bits);
        words[12..].copy_from_slice(&[moving, number, sin, cos]);
        self.columns.extend_from_slice(&words);
    }

    /// Number of columns.
    pub(crate) fn count(&self) -> usize {
        self.columns.len() / COLUMN_WORDS
    }

    /// Largest number of stack entries for traversing these trees and the kept ones: three siblings per level, and the
    /// trees themselves.
    pub(crate) fn stack(&self, gpu_scene: &GpuScene) -> u32 {
        3 * (self.levels + gpu_scene.levels) + 2
    }
}

/// Moving instances at the time a piece of a turn was fired, and the origin of the tree frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct DynamicState {
    instances: InstanceTree,
    centre_m: [f64; 3],
}

impl SceneTree {
    /// Saves the current moving instances.
    pub(crate) fn save_dynamics(&self, into: &mut DynamicState) {
        into.instances.bvh.clone_from(&self.moving.bvh);
        into.instances.placed.clone_from(&self.moving.placed);
        into.centre_m = self.centre_m;
    }

    /// Restores an earlier state of the same scene.
    pub(crate) fn restore_dynamics(&mut self, state: &DynamicState) {
        self.moving.clone_from(&state.instances);
        self.centre_m = state.centre_m;
    }

    /// Moving instances.
    pub(crate) fn moving(&self) -> &InstanceTree {
        &self.moving
    }
}
