//! Acceleration structure of a scene: one tree for the static part, and a tree of trees for the rest.
//!
//! Static instances are merged into one set of triangles in the map frame, rebuilt only when the scene's static part
//! changes. Each mesh of a moving instance has a tree in its own frame, kept while the mesh is unchanged; the tree over
//! the moving instances is rebuilt for every step, and rays are transformed to their frames.

pub(crate) mod flat;
mod instances;
mod shape;

use std::sync::Arc;

use swerve_core::ParamError;
use swerve_scene::vector::{dot, scale};
use swerve_scene::{Instance, MeshId, MeshLibrary, Scene, SemanticClass, Weather};
use wide::f32x8;

use crate::bvh::{Builder, LANES, Packet, Ray, Stack};
use crate::soup::{Soup, Triangle, TriangleHit};
use instances::{InstanceTree, PlacedInstance, Query};
use shape::{CachedShape, Pose, Shape, Surface, keep_shape};

/// Number of triangles above which static instances keep separate mesh trees, which bounds memory for repeated meshes.
const STATIC_TRIANGLES_MAX: usize = 2_000_000;
/// Largest distance of an instance from the map's origin, metres.
const REACH_MAX_M: f64 = 1e7;

/// Error of building a tree from a scene.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum TreeError {
    /// Pose that is not finite or too far from the origin.
    #[error("instance {index} of the {part} part has a pose that is not finite or beyond 10000 km")]
    Pose {
        /// `static` or `dynamic`.
        part: &'static str,
        /// Index in that part.
        index: usize,
    },
    /// Mesh that is not in the scene's library.
    #[error("instance {index} of the {part} part has mesh {mesh}, the library has {meshes}")]
    Mesh {
        /// `static` or `dynamic`.
        part: &'static str,
        /// Index in that part.
        index: usize,
        /// Index of its mesh.
        mesh: usize,
        /// Number of meshes in the library.
        meshes: usize,
    },
    /// Weather out of range.
    #[error("weather: {0}")]
    Weather(#[from] ParamError),
}

/// Surface hit by a ray.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hit {
    /// Distance along the ray, metres.
    pub distance_m: f32,
    /// Instance id; 0 for objects without an id.
    pub instance_id: u32,
    /// Class of the surface: the material's, else the instance's.
    pub class: SemanticClass,
    /// Mesh id in the scene's library.
    pub mesh: MeshId,
    /// Index into the materials of that mesh.
    pub material: u16,
    /// Diffuse reflectance of the material at 905 nm.
    pub reflectance: f32,
    /// True for retro-reflective materials.
    pub is_retro_reflective: bool,
    /// Unit normal of the triangle, map frame, on the side of the ray's origin.
    pub normal: [f32; 3],
}

/// Reusable memory of one thread that casts rays.
#[derive(Default)]
pub struct RayMemory {
    stacks: [Stack; 2],
}

/// Trees over a scene, for ray casting by lidars, radars and others.
///
/// [`SceneTree::update`] takes over a step of the scene; unchanged parts are kept. Results depend only on the scene,
/// not on earlier updates or threads, and are bit-identical on every x86-64 machine. A clone shares the static part and
/// the mesh trees with its original.
#[derive(Clone, Debug)]
pub struct SceneTree {
    /// Origin of the tree frame, map frame, metres.
    centre_m: [f64; 3],
    static_version: Option<u64>,
    ground: Arc<Shape>,
    far_statics: Arc<InstanceTree>,
    moving: InstanceTree,
    shapes: Vec<CachedShape>,
    weather: Weather,
    builder: Builder,
    static_triangles_max: usize,
}

impl Default for SceneTree {
    fn default() -> Self {
        Self::with_static_triangles(STATIC_TRIANGLES_MAX)
    }
}

/// Triangle hit, and the tree that contains it.
enum Found {
    Ground(TriangleHit),
    Far(u32, TriangleHit),
    Moving(u32, TriangleHit),
}

impl SceneTree {
    /// Tree of a scene.
    ///
    /// # Errors
    /// If a pose is not finite or beyond 10,000 km, or a mesh is not in the library.
    pub fn new(scene: &Scene) -> Result<Self, TreeError> {
        let mut tree = Self::default();
        tree.update(scene)?;
        Ok(tree)
    }

    /// Empty tree that merges at most this many static triangles.
    pub(crate) fn with_static_triangles(most: usize) -> Self {
        Self {
            centre_m: [0.0; 3],
            static_version: None,
            ground: Arc::default(),
            far_statics: Arc::default(),
            moving: InstanceTree::default(),
            shapes: Vec::new(),
            weather: Weather::default(),
            builder: Builder::default(),
            static_triangles_max: most,
        }
    }

    /// Updates to a scene: moving instances always, the static part only if it changed.
    ///
    /// Mesh ids must refer to one library; use another tree for a scene with another library.
    ///
    /// # Errors
    /// As for [`Self::new`]; the tree is then unchanged.
    pub fn update(&mut self, scene: &Scene) -> Result<(), TreeError> {
        let (statics, meshes) = (scene.statics(), &scene.meshes);
        scene.weather.check()?;
        check("dynamic", &scene.dynamics, meshes)?;
        if self.static_version != Some(statics.version()) {
            check("static", statics.instances(), meshes)?;
            self.centre_m = middle(statics.instances());
            self.build_statics(statics.instances(), meshes);
            self.static_version = Some(statics.version());
        }
        if statics.instances().is_empty() {
            self.centre_m = middle(&scene.dynamics);
        }
        for instance in &scene.dynamics {
            keep_shape(&mut self.shapes, instance.mesh, meshes, &mut self.builder);
        }
        self.weather = scene.weather;
        self.moving.build(scene.dynamics.iter(), meshes, self.centre_m, &mut self.builder);
        Ok(())
    }

    fn build_statics(&mut self, instances: &[Instance], meshes: &MeshLibrary) {
        let (mut surfaces, mut triangles): (Vec<Surface>, Vec<Triangle>) = (Vec::new(), Vec::new());
        let mut far = Vec::new();
        for instance in instances {
            let mesh = meshes.get(instance.mesh);
            if triangles.len() + mesh.triangles().len() > self.static_triangles_max {
                far.push(instance);
                keep_shape(&mut self.shapes, instance.mesh, meshes, &mut self.builder);
                continue;
            }
            let pose = Pose::new(&instance.map_from_body, self.centre_m);
            let first = surfaces.len() as u32;
            surfaces.extend(
                (0..mesh.materials().len())
                    .map(|k| Surface::new(instance.mesh, mesh, k as u16, Some(instance))),
            );
            triangles.extend(mesh.triangles().iter().zip(mesh.triangle_materials()).map(
                |(corners, &material)| Triangle {
                    corners: corners.map(|corner| pose.apply(mesh.positions()[corner as usize])),
                    surface: first + u32::from(material),
                },
            ));
        }
        self.ground = Arc::new(Shape { soup: Soup::new(&triangles, &mut self.builder), surfaces });
        let mut far_statics = InstanceTree::default();
        far_statics.build(far.into_iter(), meshes, self.centre_m, &mut self.builder);
        self.far_statics = Arc::new(far_statics);
        // The builder's buffers grew with the static part, and are copied with the tree.
        self.builder = Builder::default();
    }

    /// Weather of the scene.
    pub fn weather(&self) -> &Weather {
        &self.weather
    }

    /// First surface within a range along a ray.
    ///
    /// The origin is in the map frame, metres; the direction need not be a unit vector. `None` without a hit, and for
    /// rays that are not finite, have a zero direction or start beyond 10,000 km. Surfaces are hit from both sides. To
    /// cast many rays, reuse the memory: [`Self::cast_with`].
    pub fn cast(&self, origin_m: [f64; 3], direction: [f64; 3], range_m: f64) -> Option<Hit> {
        self.cast_with(&mut RayMemory::default(), origin_m, direction, range_m, None)
    }

    /// As [`Self::cast`], with reusable memory; rays pass through all instances with the id `hidden`.
    pub fn cast_with(
        &self,
        memory: &mut RayMemory,
        origin_m: [f64; 3],
        direction: [f64; 3],
        range_m: f64,
        hidden: Option<u32>,
    ) -> Option<Hit> {
        let [x, y, z] = direction;
        let length = (x * x + y * y + z * z).sqrt();
        let fine = origin_m.iter().all(|o| o.abs() <= REACH_MAX_M) && length > 1e-150 && length < 1e150;
        if !fine || range_m.is_nan() {
            return None;
        }
        let direction = [(x / length) as f32, (y / length) as f32, (z / length) as f32];
        self.first(memory, self.local(origin_m), direction, range_m as f32, hidden)
    }

    /// Converts a point of the map to the tree frame.
    pub(crate) fn local(&self, point_m: [f64; 3]) -> [f32; 3] {
        let ([x, y, z], [cx, cy, cz]) = (point_m, self.centre_m);
        [(x - cx) as f32, (y - cy) as f32, (z - cz) as f32]
    }

    /// First surface along a ray in the tree frame, with a unit direction.
    pub(crate) fn first(
        &self,
        memory: &mut RayMemory,
        origin: [f32; 3],
        direction: [f32; 3],
        range_m: f32,
        hidden: Option<u32>,
    ) -> Option<Hit> {
        let ray = Ray::new(origin, direction);
        let surfaces = &self.ground.surfaces;
        let [stack, _] = &mut memory.stacks;
        let ground = match hidden {
            None => self.ground.soup.nearest(&ray, range_m, stack, |_| true),
            Some(id) => {
                let seen = |surface: u32| surfaces[surface as usize].instance_id != id;
                self.ground.soup.nearest(&ray, range_m, stack, seen)
            }
        };
        let mut found = ground.map(Found::Ground);
        let mut reach = ground.map_or(range_m, |met| met.distance);
        if let Some((at, met)) =
            self.far_statics.nearest(&ray, &self.shapes, reach, hidden, &mut memory.stacks)
        {
            reach = met.distance;
            found = Some(Found::Far(at, met));
        }
        if let Some((at, met)) = self.moving.nearest(&ray, &self.shapes, reach, hidden, &mut memory.stacks) {
            found = Some(Found::Moving(at, met));
        }
        Some(self.hit(&found?, direction))
    }

    /// As [`Self::first`] for eight rays; rays with a negative range are inactive.
    pub(crate) fn first_of_packet(
        &self,
        memory: &mut RayMemory,
        origins: [f32x8; 3],
        directions: [f32x8; 3],
        range_m: f32x8,
        hidden: Option<u32>,
    ) -> [Option<Hit>; LANES] {
        let packet = Packet::new(origins, directions);
        let mut reach = range_m;
        let surfaces = &self.ground.surfaces;
        let [stack, _] = &mut memory.stacks;
        let ground = match hidden {
            None => self.ground.soup.nearest_packet(&packet, &mut reach, stack, |_| true),
            Some(id) => {
                let seen = |surface: u32| surfaces[surface as usize].instance_id != id;
                self.ground.soup.nearest_packet(&packet, &mut reach, stack, seen)
            }
        };
        let (mut far, mut moving) = ([None; LANES], [None; LANES]);
        let mut query = Query { reach: &mut reach, hidden, stacks: &mut memory.stacks };
        self.far_statics.nearest_packet(&packet, &self.shapes, &mut query, &mut far);
        self.moving.nearest_packet(&packet, &self.shapes, &mut query, &mut moving);
        let [x, y, z] = directions.map(|d| d.to_array());
        let mut hits = [None; LANES];
        for ray in 0..LANES {
            let found = match (moving[ray], far[ray], ground[ray]) {
                (Some((at, met)), ..) => Found::Moving(at, met),
                (None, Some((at, met)), _) => Found::Far(at, met),
                (None, None, Some(met)) => Found::Ground(met),
                (None, None, None) => continue,
            };
            hits[ray] = Some(self.hit(&found, [x[ray], y[ray], z[ray]]));
        }
        hits
    }

    fn hit(&self, found: &Found, direction: [f32; 3]) -> Hit {
        let (distance_m, surface, normal) = match *found {
            Found::Ground(met) => {
                let (surface, normal) = self.ground.soup.describe(met);
                (met.distance, self.ground.surfaces[surface as usize], normal)
            }
            Found::Far(at, met) => self.described(&self.far_statics.placed[at as usize], met),
            Found::Moving(at, met) => self.described(&self.moving.placed[at as usize], met),
        };
        let normal = if dot(normal, direction) > 0.0 { scale(normal, -1.0) } else { normal };
        Hit {
            distance_m,
            instance_id: surface.instance_id,
            class: surface.class,
            mesh: surface.mesh,
            material: surface.material,
            reflectance: surface.reflectance,
            is_retro_reflective: surface.is_retro_reflective,
            normal,
        }
    }

    fn described(&self, placed: &PlacedInstance, met: TriangleHit) -> (f32, Surface, [f32; 3]) {
        let shape = &self.shapes[placed.mesh.index()].shape;
        let (surface, normal) = shape.soup.describe(met);
        let mut surface = shape.surfaces[surface as usize];
        surface.instance_id = placed.instance_id;
        if !surface.keeps_class {
            surface.class = placed.class;
        }
        (met.distance, surface, placed.pose.rotate(normal))
    }
}

/// Centre of the bounding box of all origins, rounded to metres.
fn middle(instances: &[Instance]) -> [f64; 3] {
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for instance in instances {
        let at = instance.map_from_body.origin().coords;
        for axis in 0..3 {
            min[axis] = min[axis].min(at[axis]);
            max[axis] = max[axis].max(at[axis]);
        }
    }
    if instances.is_empty() {
        return [0.0; 3];
    }
    [0, 1, 2].map(|axis| (0.5 * (min[axis] + max[axis])).round())
}

/// Checks that every instance has a valid pose and mesh.
fn check(part: &'static str, instances: &[Instance], meshes: &MeshLibrary) -> Result<(), TreeError> {
    for (index, instance) in instances.iter().enumerate() {
        let pose = &instance.map_from_body;
        let placed = pose.origin().coords.iter().all(|x| x.abs() <= REACH_MAX_M);
        if !placed || !pose.rotation().coords.iter().all(|x| x.is_finite()) {
            return Err(TreeError::Pose { part, index });
        }
        let (mesh, meshes) = (instance.mesh.index(), meshes.meshes().len());
        if mesh >= meshes {
            return Err(TreeError::Mesh { part, index, mesh, meshes });
        }
    }
    Ok(())
}
