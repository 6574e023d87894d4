//! Meshes on the device: uploaded once, by content.

use std::collections::BTreeMap;

use swerve_gpu::{Gpu, GrowingBuffer, wgpu};
use swerve_scene::{Mesh, MeshId, MeshLibrary};

/// Triangles that are drawn as one instance.
pub(super) const CLUSTER: usize = 64;

/// Where the triangles of a mesh are.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Shape {
    /// First of its clusters.
    pub(super) first: u32,
    /// Clusters of triangles with one side, and behind them those with two.
    pub(super) one_sided: u32,
    pub(super) two_sided: u32,
}

/// All meshes that were drawn so far.
pub(super) struct MeshStore {
    vertices: Vec<[f32; 4]>,
    triangles: Vec<[u32; 4]>,
    known: BTreeMap<(u64, usize, usize), Shape>,
    /// Shapes by id, and of which library.
    library: Option<u64>,
    by_id: Vec<Option<Shape>>,
    /// Changes when shapes are forgotten.
    pub(super) generation: u64,
    /// How much of both is on the device.
    uploaded: (usize, usize),
    pub(super) on_device: [GrowingBuffer; 2],
}

impl MeshStore {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            vertices: Vec::new(),
            triangles: Vec::new(),
            known: BTreeMap::new(),
            library: None,
            by_id: Vec::new(),
            generation: 0,
            uploaded: (0, 0),
            on_device: [
                GrowingBuffer::new(gpu, "vertices", usage),
                GrowingBuffer::new(gpu, "triangles", usage),
            ],
        }
    }

    /// Looks up the ids of a library from now on.
    pub(super) fn follow(&mut self, library: &MeshLibrary) {
        if self.library != Some(library.version()) {
            self.library = Some(library.version());
            self.by_id.clear();
        }
        self.by_id.resize(library.meshes().len(), None);
    }

    /// Where a mesh of the library is; it is added if it is new.
    pub(super) fn shape(&mut self, id: MeshId, library: &MeshLibrary) -> Shape {
        if let Some(shape) = self.by_id[id.index()] {
            return shape;
        }
        let mesh = library.get(id);
        let key = (mesh.key().0, mesh.positions().len(), mesh.triangles().len());
        let shape = match self.known.get(&key) {
            Some(shape) => *shape,
            None => {
                let shape = self.add(mesh);
                self.known.insert(key, shape);
                shape
            }
        };
        self.by_id[id.index()] = Some(shape);
        shape
    }

    fn add(&mut self, mesh: &Mesh) -> Shape {
        let base = (self.vertices.len() / 2) as u32;
        for ((p, n), uv) in mesh.positions().iter().zip(mesh.normals()).zip(mesh.uvs()) {
            self.vertices.push([p[0], p[1], p[2], uv[0]]);
            self.vertices.push([n[0], n[1], n[2], uv[1]]);
        }
        let first = (self.triangles.len() / CLUSTER) as u32;
        let counts = [false, true].map(|two_sided| {
            let before = self.triangles.len();
            for (corners, material) in mesh.triangles().iter().zip(mesh.triangle_materials()) {
                if mesh.materials()[usize::from(*material)].is_two_sided == two_sided {
                    let [a, b, c] = corners.map(|corner| base + corner);
                    self.triangles.push([a, b, c, u32::from(*material)]);
                }
            }
            // The last cluster is filled up with nothing.
            self.triangles.resize(self.triangles.len().next_multiple_of(CLUSTER), [base, base, base, 0]);
            ((self.triangles.len() - before) / CLUSTER) as u32
        });
        Shape { first, one_sided: counts[0], two_sided: counts[1] }
    }

    /// Brings what is new to the device, and says whether buffers were replaced.
    ///
    /// # Errors
    /// If the meshes are too large for it.
    pub(super) fn upload(&mut self, gpu: &Gpu) -> Result<bool, String> {
        let Self { vertices, triangles, uploaded, on_device: [for_vertices, for_triangles], .. } = self;
        let mut replaced = false;
        if for_vertices.reserve(gpu, size_of_val(vertices.as_slice()) as u64)?.is_some() {
            (uploaded.0, replaced) = (0, true);
        }
        if for_triangles.reserve(gpu, size_of_val(triangles.as_slice()) as u64)?.is_some() {
            (uploaded.1, replaced) = (0, true);
        }
        if vertices.len() > uploaded.0 {
            let new = bytemuck::cast_slice(&vertices[uploaded.0..]);
            gpu.queue().write_buffer(for_vertices.get(), 16 * uploaded.0 as u64, new);
        }
        if triangles.len() > uploaded.1 {
            let new = bytemuck::cast_slice(&triangles[uploaded.1..]);
            gpu.queue().write_buffer(for_triangles.get(), 16 * uploaded.1 as u64, new);
        }
        *uploaded = (vertices.len(), triangles.len());
        Ok(replaced)
    }

    /// Forgets all meshes when they have become so many that the device may run short of memory.
    pub(super) fn forget_if_large(&mut self) {
        if size_of_val(self.vertices.as_slice()) + size_of_val(self.triangles.as_slice()) > LARGE {
            self.vertices.clear();
            self.triangles.clear();
            self.known.clear();
            self.generation += 1;
            (self.library, self.uploaded) = (None, (0, 0));
            self.by_id.clear();
        }
    }
}

/// Bytes of meshes above which those of earlier scenes are forgotten.
const LARGE: usize = 384 << 20;

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_gpu::AdapterKind;
    use swerve_gpu::testing::adapter_or_skip;
    use swerve_scene::Kind;

    #[test]
    fn meshes_are_stored_once_and_side_by_side() {
        let Some(gpu) = adapter_or_skip(Gpu::shared(AdapterKind::Software)) else { return };
        let mut store = MeshStore::new(&gpu);
        let mut library = MeshLibrary::default();
        let [car, tree] = [Kind::Sedan, Kind::Tree].map(|kind| library.model(kind, 1).mesh);
        store.follow(&library);
        let shapes = [car, tree].map(|id| store.shape(id, &library));
        assert_eq!(shapes[0].first, 0);
        assert_eq!(shapes[1].first, shapes[0].one_sided + shapes[0].two_sided);
        let before = store.triangles.len();
        let mut other = MeshLibrary::default();
        let again = other.model(Kind::Tree, 1).mesh;
        store.follow(&other);
        assert_eq!((store.shape(again, &other), store.triangles.len()), (shapes[1], before));
    }
}
