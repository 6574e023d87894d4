//! Materials of roads and of the ground beside them.

use crate::SemanticClass;
use crate::material::{Material, Texture};

/// Height of the kerb, metres.
pub(crate) const KERB_M: f32 = 0.12;
/// Height of grass around roads, metres.
pub(crate) const GRASS_M: f64 = -0.06;
/// Height of the paint above the road, metres.
pub(crate) const PAINT_M: f32 = 0.006;

/// Surface of a carriageway.
pub(crate) fn asphalt() -> Material {
    let ground = Material { is_ground: true, ..Material::matt([0.115, 0.115, 0.118], 0.17) };
    ground.textured(Texture::Asphalt, [0.2, 0.197, 0.19], 4.0).glossy(0.85, 0.04)
}

/// Road paint in a colour.
pub(crate) fn paint(colour: [f32; 3]) -> Material {
    let material = Material { is_ground: true, ..Material::matt(colour, 0.55) };
    material.textured(Texture::WornPaint, [0.17, 0.17, 0.17], 2.0).glossy(0.6, 0.04).retro_reflective()
}

/// White of road paint.
pub(crate) const WHITE: [f32; 3] = [0.62, 0.62, 0.6];
/// Yellow of road paint.
pub(crate) const YELLOW: [f32; 3] = [0.6, 0.42, 0.06];

fn stone() -> Material {
    Material { is_ground: true, ..Material::matt([0.3, 0.29, 0.27], 0.3) }
}

/// Kerb stones.
pub(crate) fn kerb() -> Material {
    stone().textured(Texture::Slabs, [0.2, 0.19, 0.18], 1.0).with_class(SemanticClass::Sidewalk)
}

/// Slabs of a pavement.
pub(crate) fn flags() -> Material {
    stone().textured(Texture::Slabs, [0.19, 0.18, 0.165], 1.2).with_class(SemanticClass::Sidewalk)
}

/// Soil at the edge of a carriageway.
pub(crate) fn soil() -> Material {
    let soil = Material::matt([0.13, 0.11, 0.08], 0.25).textured(Texture::Asphalt, [0.22, 0.19, 0.14], 2.0);
    soil.with_class(SemanticClass::Terrain)
}

/// Grass beside a road.
pub(crate) fn verge() -> Material {
    let grass = Material { is_ground: false, ..Material::matt([0.055, 0.085, 0.022], 0.45) };
    grass.textured(Texture::Grass, [0.14, 0.17, 0.05], 3.0).with_class(SemanticClass::Terrain)
}
