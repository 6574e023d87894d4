//! Surfaces of instances, prepared for shading by all back ends.

use swerve_scene::{Instance, Look, Material, Scene, lamps};

use super::texture;

/// Surface of one instance, prepared for shading.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Surface {
    /// Parameters, indexed by [`slot`].
    pub(crate) numbers: [f32; 16],
    /// First word of its texture tile.
    pub(crate) texture: u32,
    /// Bits 0 to 3: textured, polished, gets wet, emissive.
    pub(crate) flags: u32,
    /// Id in the semantic image.
    pub(crate) class: u8,
    /// Id in the instance image.
    pub(crate) instance: u32,
}

/// Indices into [`Surface::numbers`].
pub(crate) mod slot {
    /// Reflectance where the texture is 0; three channels.
    pub(crate) const ALBEDO: usize = 0;
    /// Additional reflectance where the texture is 1; three channels.
    pub(crate) const CONTRAST: usize = 3;
    /// Emitted radiance; three channels.
    pub(crate) const EMISSIVE: usize = 6;
    /// Mirror reflectance at normal incidence.
    pub(crate) const SPECULAR: usize = 9;
    /// 1 for a mirror, 0 for matt.
    pub(crate) const POLISH: usize = 10;
    /// Texture tiles per unit of texture coordinates.
    pub(crate) const TILES: usize = 11;
    /// 1 for ground that gets wet.
    pub(crate) const GROUND: usize = 12;
    /// 1 for retro-reflective surfaces.
    pub(crate) const RETRO: usize = 13;
}

/// Bits of [`Surface::flags`].
pub(crate) mod flag {
    pub(crate) const TEXTURED: u32 = 1;
    pub(crate) const SHINY: u32 = 2;
    pub(crate) const GROUND: u32 = 4;
    pub(crate) const SHINING: u32 = 8;
}

/// Lamps of an instance that are on: those it switches, and those the weather switches.
fn lamps_of(look: &Look, scene: &Scene) -> u8 {
    if scene.weather.lamps_on { look.lamps | 1 << lamps::NIGHT } else { look.lamps & !(1 << lamps::NIGHT) }
}

impl Surface {
    /// Surface of a material on an instance.
    pub(crate) fn new(material: &Material, instance: &Instance, scene: &Scene) -> Self {
        let tint = material.tint.and_then(|k| instance.look.tints.get(usize::from(k)));
        let tint = tint.copied().unwrap_or([1.0; 3]);
        let is_on = material.lamp.is_none_or(|lamp| lamps_of(&instance.look, scene) >> (lamp & 7) & 1 == 1);
        let one = |axis: usize| material.albedo[axis] * tint[axis];
        let other = |axis: usize| material.albedo_b[axis] * tint[axis];
        let emissive = if is_on { material.emissive } else { [0.0; 3] };
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
        Self { numbers, texture, flags, class, instance: instance.instance_id }
    }
}
