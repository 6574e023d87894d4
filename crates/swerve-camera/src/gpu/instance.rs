//! Instances as drawn: their records, and the rectangles of the maps that they may cover.

use swerve_geom::{Map, Point, Transform};
use swerve_scene::{Body, Instance, Mesh, Scene};

use super::maps::Corners;
use super::meshes::{MeshStore, Shape};
use super::records::Records;
use crate::frontend::pose::rotation_rows;
use crate::frontend::shadow;
use crate::frontend::surface::Surface;

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
