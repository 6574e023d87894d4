//! What is drawn in one pass: instances that may be seen, their places before the camera, their surfaces.

use swerve_geom::{Map, Point, Transform};

use super::geometry::{Frustum, Placement, turn};
use super::texture;
use crate::library::MeshId;
use crate::material::Material;
use crate::mesh::{Body, Mesh};
use crate::scene::{Instance, Look, Motion, Scene, lamps};

/// A surface of one instance, ready for shading.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Surface {
    /// See [`slot`].
    pub(super) numbers: [f32; 16],
    /// First word of its texture tile.
    pub(super) texture: u32,
    /// It has a texture, is polished, gets wet, shines: bits 0 to 3.
    pub(super) flags: u32,
    /// Id for the semantic image.
    pub(super) class: u8,
    /// Id for the instance image.
    pub(super) instance: u32,
}

/// Where numbers are in [`Surface::numbers`].
pub(super) mod slot {
    /// Reflectance where the texture is 0; three channels.
    pub(in crate::cpu) const ALBEDO: usize = 0;
    /// How much more it is where the texture is 1; three channels.
    pub(in crate::cpu) const CONTRAST: usize = 3;
    /// Radiance of its own; three channels.
    pub(in crate::cpu) const EMISSIVE: usize = 6;
    /// Mirror reflectance at normal incidence.
    pub(in crate::cpu) const SPECULAR: usize = 9;
    /// 1 for a mirror, 0 for matt.
    pub(in crate::cpu) const POLISH: usize = 10;
    /// Texture tiles per unit of texture coordinates.
    pub(in crate::cpu) const TILES: usize = 11;
    /// 1 for ground that gets wet.
    pub(in crate::cpu) const GROUND: usize = 12;
    /// 1 for what shines back into head lamps.
    pub(in crate::cpu) const RETRO: usize = 13;
}

/// Bits of [`Surface::flags`].
pub(super) mod flag {
    pub(in crate::cpu) const TEXTURED: u32 = 1;
    pub(in crate::cpu) const SHINY: u32 = 2;
    pub(in crate::cpu) const GROUND: u32 = 4;
    pub(in crate::cpu) const SHINING: u32 = 8;
}

/// Some triangles of a mesh, placed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub(super) mesh: MeshId,
    pub(super) placement: Placement,
    /// First of its surfaces in the table.
    pub(super) surfaces: u32,
    /// Triangles from and up to.
    pub(super) range: (usize, usize),
}

/// Rotation matrix by rows.
pub(super) fn rows_of<A, B>(transform: &Transform<A, B>) -> [[f64; 3]; 3] {
    let m = transform.rotation().to_rotation_matrix();
    let m = m.matrix();
    [0, 1, 2].map(|row| [m[(row, 0)], m[(row, 1)], m[(row, 2)]])
}

fn narrow(rows: [[f64; 3]; 3]) -> [[f32; 3]; 3] {
    rows.map(|row| row.map(|x| x as f32))
}

/// A pose a little earlier or later: moved, and turned about its own origin. The turn is taken as small.
pub(super) fn moved<F>(pose: &Transform<Map, F>, motion: &Motion, by_s: f64) -> Transform<Map, F> {
    if *motion == Motion::default() || by_s == 0.0 {
        return *pose;
    }
    let p = pose.origin().coords;
    let [vx, vy, vz] = motion.linear_mps.map(|v| v * by_s);
    let [wx, wy, wz] = motion.angular_radps.map(|w| w * by_s);
    let turn: Transform<Map, Map> = Transform::from_roll_pitch_yaw(Point::default(), wx, wy, wz);
    Transform::new(Point::new(p.x + vx, p.y + vy, p.z + vz), (turn * *pose).rotation())
}

/// The placement of an instance before a camera.
pub(super) fn place(
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
    map_from_body: &Transform<Map, Body>,
) -> Placement {
    let camera_from_body = *camera_from_map * *map_from_body;
    let offset = camera_from_body.origin().coords;
    Placement {
        camera: narrow(rows_of(&camera_from_body)),
        offset: [offset.x as f32, offset.y as f32, offset.z as f32],
        map: narrow(rows_of(map_from_body)),
    }
}

/// Whether an instance may be seen.
pub(super) fn is_seen(frustum: &Frustum, mesh: &Mesh, placement: &Placement) -> bool {
    let (centre, radius) = mesh.sphere();
    let [x, y, z] = turn(&placement.camera, centre);
    let centre = [x + placement.offset[0], y + placement.offset[1], z + placement.offset[2]];
    frustum.touches(centre, radius)
}

/// Lamps of an instance: its own, and those that the weather switches.
fn lamps_of(look: &Look, scene: &Scene) -> u8 {
    if scene.weather.lamps_on { look.lamps | 1 << lamps::NIGHT } else { look.lamps & !(1 << lamps::NIGHT) }
}

/// The surface of a material on an instance.
pub(super) fn surface(material: &Material, instance: &Instance, scene: &Scene) -> Surface {
    let tint = material.tint.and_then(|k| instance.look.tints.get(usize::from(k)));
    let tint = tint.copied().unwrap_or([1.0; 3]);
    let on = material.lamp.is_none_or(|lamp| lamps_of(&instance.look, scene) >> (lamp & 7) & 1 == 1);
    let one = |axis: usize| material.albedo[axis] * tint[axis];
    let other = |axis: usize| material.albedo_b[axis] * tint[axis];
    let emissive = if on { material.emissive } else { [0.0; 3] };
    let polish = (1.0 - material.roughness).clamp(0.0, 1.0);
    let mut numbers = [0.0; 16];
    for axis in 0..3 {
        numbers[slot::ALBEDO + axis] = one(axis);
        numbers[slot::CONTRAST + axis] = other(axis) - one(axis);
        numbers[slot::EMISSIVE + axis] = emissive[axis];
    }
    numbers[slot::SPECULAR] = material.specular;
    numbers[slot::POLISH] = polish;
    numbers[slot::TILES] = 1.0 / material.tile_m.max(1e-3);
    numbers[slot::GROUND] = if material.is_ground { 1.0 } else { 0.0 };
    numbers[slot::RETRO] = if material.is_retro_reflective { 1.0 } else { 0.0 };
    let texture = (material.texture as usize * texture::STRIDE) as u32;
    let bit = |condition: bool, flag: u32| if condition { flag } else { 0 };
    let flags = bit(texture != 0, flag::TEXTURED)
        | bit(polish > 0.2, flag::SHINY)
        | bit(material.is_ground, flag::GROUND)
        | bit(emissive != [0.0; 3], flag::SHINING);
    let class = material.class.unwrap_or(instance.class) as u8;
    Surface { numbers, texture, flags, class, instance: instance.instance_id }
}
