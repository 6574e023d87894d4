//! Meshes on the device: uploaded once, keyed by content.

use std::collections::BTreeMap;

use swerve_gpu::{Gpu, GrowingBuffer, wgpu};
use swerve_scene::{Mesh, MeshId, MeshLibrary};

/// Number of triangles drawn as one instance.
pub(super) const CLUSTER: usize = 64;

/// Location of a mesh's triangles.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Shape {
    /// Index of its first cluster.
    pub(super) first: u32,
    /// Number of clusters of single-sided triangles, followed by those of double-sided ones.
    pub(super) one_sided: u32,
    pub(super) two_sided: u32,
}

/// All meshes drawn so far.
pub(super) struct MeshStore {
    vertices: Vec<[f32; 4]>,
    triangles: Vec<[u32; 4]>,
    known: BTreeMap<(u64, usize, usize), Shape>,
    /// Shapes by id, and the version of their library.
    library: Option<u64>,
    by_id: Vec<Option<Shape>>,
    /// Incremented when shapes are dropped.
    pub(super) generation: u64,
    /// Number of vertices and triangles already on the device.
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

    /// Selects the library whose ids are looked up.
    pub(super) fn follow(&mut self, library: &MeshLibrary) {
        if self.library != Some(library.version()) {
            self.library = Some(library.version());
            self.by_id.clear();
        }
        self.by_id.resize(library.meshes().len(), None);
    }

    /// Location of a mesh of the library; added if it is new.
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
            // The last cluster is padded with empty triangles.
            self.triangles.resize(self.triangles.len().next_multiple_of(CLUSTER), [base, base, base, 0]);
            ((self.triangles.len() - before) / CLUSTER) as u32
        });
        Shape { first, one_sided: counts[0], two_sided: counts[1] }
    }

    /// Uploads new meshes; returns true if buffers were replaced.
    ///
    /// # Errors
    /// If the meshes are too large for the device.
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

    /// Drops all meshes when their total size exceeds [`LARGE`].
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

/// Size of all meshes above which those of earlier scenes are dropped, bytes.
const LARGE: usize = 384 << 20;

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_gpu::AdapterKind;
    use swerve_scene::Kind;

    #[test]
    fn meshes_are_stored_once_and_contiguously() {
        let Some(gpu) = swerve_tests::or_skip(Gpu::shared(AdapterKind::Software)) else { return };
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
