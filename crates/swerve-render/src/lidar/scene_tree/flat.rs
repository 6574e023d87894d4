//! The trees as words for compute shaders: what stays on a device between turns, and what a turn sends.
//!
//! Both have the nodes and blocks of the trees here, links between which are indices; the shader in
//! `gpu/lidar.wgsl` reads them.

use super::{Crowd, Placed, SceneTree, Shape, Surface};
use crate::lidar::bvh::{NODE_WORDS, link};
use crate::lidar::soup::BLOCK_WORDS;

/// Words of a surface: instance id, class with flags, bits of the reflectance, nothing.
const SURFACE_WORDS: usize = 4;
/// Words of an instance: its axes and the place of its origin, each with one word of what it is.
const PLACED_WORDS: usize = 16;
/// Words of a column: rows of its rotation with the origin, the tree of what moves, its number, sine and cosine of
/// its azimuth.
const COLUMN_WORDS: usize = 16;
/// Above the class of a surface: sends light back to its source.
const RETRO: u32 = 1 << 8;
/// Above the class of a surface: it is the material's own, not that of the instance.
const KEEPS_CLASS: u32 = 1 << 9;

/// Words of one kind that a device has or is sent.
#[derive(Debug, Default)]
pub(crate) struct Arena {
    /// How many it has.
    pub(crate) held: usize,
    /// Those that come behind them.
    pub(crate) fresh: Vec<u32>,
}

impl Arena {
    /// Elements of so many words each, those to be sent too.
    fn count(&self, words: usize) -> u32 {
        ((self.held + self.fresh.len()) / words) as u32
    }

    fn clear(&mut self) {
        self.held = 0;
        self.fresh.clear();
    }

    /// Words when all are sent.
    pub(crate) fn len(&self) -> usize {
        self.held + self.fresh.len()
    }

    /// All words are there now.
    pub(crate) fn sent(&mut self) {
        self.held += self.fresh.len();
        self.fresh.clear();
    }
}

/// Trees that stay on a device: of all that never moves, and of the meshes of what moves.
#[derive(Debug, Default)]
pub(crate) struct Resident {
    statics: Option<(u64, usize)>,
    ground: u32,
    /// By mesh: of which content, and the root of its tree.
    meshes: Vec<Option<(u64, u32)>>,
    levels: u32,
    level_of: Vec<u32>,
    /// Nodes of four boxes.
    pub(crate) nodes: Arena,
    /// Blocks of four triangles.
    pub(crate) blocks: Arena,
    /// Surfaces.
    pub(crate) surfaces: Arena,
}

impl Resident {
    /// Whether trees that are there are not those of the scene any more, so that all have to go.
    pub(in crate::lidar) fn is_outdated(&self, tree: &SceneTree) -> bool {
        let other = |(id, kept): (usize, &Option<(u64, u32)>)| {
            let new = tree.shapes.get(id).and_then(|kept| kept.key);
            matches!((kept, new), (Some((old, _)), Some(new)) if *old != new)
        };
        self.statics.is_some()
            && (self.statics != statics_of(tree) || self.meshes.iter().enumerate().any(other))
    }

    /// Forgets everything.
    pub(in crate::lidar) fn clear(&mut self) {
        self.statics = None;
        self.meshes.clear();
        self.levels = 0;
        for arena in [&mut self.nodes, &mut self.blocks, &mut self.surfaces] {
            arena.clear();
        }
    }

    /// Adds what the scene has and the device lacks; nothing that is there is outdated.
    pub(in crate::lidar) fn take_over(&mut self, tree: &SceneTree) {
        if self.statics.is_none() {
            self.ground = self.add(&tree.ground);
            self.statics = statics_of(tree);
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
        shape.soup.flatten(&mut self.blocks.fresh, first_surface);
        self.surfaces.fresh.extend(shape.surfaces.iter().flat_map(surface_words));
        shape.soup.bvh().flatten(&mut self.nodes.fresh, first_node, first_block, 0)
    }

    /// Whether links can tell all nodes and blocks apart.
    pub(crate) fn is_in_bounds(&self) -> bool {
        let most = self.nodes.len() / NODE_WORDS + self.blocks.len() / BLOCK_WORDS;
        most <= link::INDEX_MAX
    }

    fn root(&self, placed: &Placed) -> u32 {
        self.meshes.get(placed.mesh.index()).copied().flatten().map_or(link::NONE, |(_, root)| root)
    }
}

/// Which content the tree of all that never moves is made from.
fn statics_of(tree: &SceneTree) -> Option<(u64, usize)> {
    Some((tree.static_version.unwrap_or_default(), tree.static_triangles_max))
}

fn surface_words(surface: &Surface) -> [u32; SURFACE_WORDS] {
    let flag = |is: bool, bit: u32| if is { bit } else { 0 };
    let flags = flag(surface.is_retro_reflective, RETRO) | flag(surface.keeps_class, KEEPS_CLASS);
    [surface.instance_id, surface.class as u32 | flags, surface.reflectance.to_bits(), 0]
}

/// Columns of a turn with the instances of their steps, on their way to a device.
#[derive(Debug, Default)]
pub(crate) struct Salvo {
    /// Trees of instances.
    pub(crate) nodes: Vec<u32>,
    /// Instances.
    pub(crate) placed: Vec<u32>,
    /// Columns.
    pub(crate) columns: Vec<u32>,
    /// The tree of all that never moves, and that of the instances which are not in it.
    pub(crate) roots: [u32; 2],
    levels: u32,
    level_of: Vec<u32>,
}

impl Salvo {
    /// Empty, for the scene that stays.
    pub(in crate::lidar) fn begin(&mut self, tree: &SceneTree, resident: &Resident) {
        self.nodes.clear();
        self.placed.clear();
        self.columns.clear();
        self.levels = 0;
        self.roots = [resident.ground, link::NONE];
        self.roots[1] = self.add(&tree.far_statics, resident);
    }

    /// Adds the instances of a step and gives the link to their tree.
    pub(in crate::lidar) fn add(&mut self, crowd: &Crowd, resident: &Resident) -> u32 {
        let first_node = (self.nodes.len() / NODE_WORDS) as u32;
        let first_placed = (self.placed.len() / PLACED_WORDS) as u32;
        self.levels = self.levels.max(crowd.bvh.levels(&mut self.level_of));
        for placed in &crowd.placed {
            let [x, y, z] = placed.pose.axes;
            let class = placed.class as u32;
            let rows = [x, y, z, placed.pose.origin];
            let last = [resident.root(placed), placed.instance_id, class, 0];
            for (row, last) in rows.into_iter().zip(last) {
                self.placed.extend(row.map(f32::to_bits));
                self.placed.push(last);
            }
        }
        crowd.bvh.flatten(&mut self.nodes, first_node, first_placed, link::TOP)
    }

    /// Adds a column: where it is and looks, the tree of its step, its number in the turn, sine and cosine of its
    /// azimuth.
    pub(in crate::lidar) fn add_column(
        &mut self,
        aim: &crate::lidar::sweep::Aim,
        moving: u32,
        (number, azimuth): (u32, [f32; 2]),
    ) {
        let mut words = [0; COLUMN_WORDS];
        for (axis, (row, origin)) in aim.matrix.iter().zip(aim.origin).enumerate() {
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

    /// Entries that a walk through these trees and those that stay has to remember at most: three siblings per
    /// level, and the trees themselves.
    pub(crate) fn stack(&self, resident: &Resident) -> u32 {
        3 * (self.levels + resident.levels) + 2
    }
}

/// What moved how when a piece of a turn was fired, and where the origin of all coordinates was.
#[derive(Clone, Debug, Default)]
pub(in crate::lidar) struct Moment {
    crowd: Crowd,
    centre_m: [f64; 3],
}

impl SceneTree {
    /// Keeps what moves, as it is now.
    pub(in crate::lidar) fn moment(&self, into: &mut Moment) {
        into.crowd.bvh.clone_from(&self.moving.bvh);
        into.crowd.placed.clone_from(&self.moving.placed);
        into.centre_m = self.centre_m;
    }

    /// Back to an earlier moment of the same scene.
    pub(in crate::lidar) fn recall(&mut self, moment: &Moment) {
        self.moving.clone_from(&moment.crowd);
        self.centre_m = moment.centre_m;
    }

    /// What moves.
    pub(in crate::lidar) fn moving(&self) -> &Crowd {
        &self.moving
    }
}
