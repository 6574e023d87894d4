//! Materials: colour, gloss and reflectance of surfaces for cameras and lidars.

use crate::SemanticClass;
use crate::hash::Key;

/// Patterns that mix the two colours of a material; baked once into square greyscale tiles, see [`Material::tile_m`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
#[repr(u8)]
pub enum Texture {
    /// One colour.
    #[default]
    Plain,
    /// Fine grain with cracks and patches.
    Asphalt,
    /// Square slabs with joints.
    Slabs,
    /// Bricks in running bond; the second colour is the mortar.
    Brick,
    /// Rough render with stains.
    Plaster,
    /// Blades and tufts.
    Grass,
    /// Leaves in light and shade.
    Foliage,
    /// Vertical furrows.
    Bark,
    /// Rows of tiles.
    RoofTiles,
    /// Weave and folds of cloth.
    Cloth,
    /// Worn road paint; the second colour shows through.
    WornPaint,
    /// Corrugated sheet, ribs along the tile's second axis.
    Corrugated,
    /// Smudges of glass: faint large patches.
    Glass,
    /// The word STOP in the second colour; one tile is one sign.
    Stop,
    /// Speed limit of 30, its number in the second colour; one tile is one sign.
    Limit30,
    /// Same as [`Self::Limit30`], for 50.
    Limit50,
    /// Same as [`Self::Limit30`], for 80.
    Limit80,
    /// A number plate with characters in the second colour; one tile is one plate.
    Plate,
}

impl Texture {
    /// All textures, in order of their numbers.
    pub const ALL: [Self; 18] = [
        Self::Plain,
        Self::Asphalt,
        Self::Slabs,
        Self::Brick,
        Self::Plaster,
        Self::Grass,
        Self::Foliage,
        Self::Bark,
        Self::RoofTiles,
        Self::Cloth,
        Self::WornPaint,
        Self::Corrugated,
        Self::Glass,
        Self::Stop,
        Self::Limit30,
        Self::Limit50,
        Self::Limit80,
        Self::Plate,
    ];
}

/// A surface.
///
/// Colours are linear (not sRGB) reflectances or radiances; white paper in full sun has radiance 1.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Material {
    /// Diffuse reflectance where the texture is 0.
    pub albedo: [f32; 3],
    /// Diffuse reflectance where the texture is 1.
    pub albedo_b: [f32; 3],
    /// Pattern that mixes the two colours.
    pub texture: Texture,
    /// Length of one texture tile in units of the mesh's uv (metres, or 1 for a sign's face).
    pub tile_m: f32,
    /// 0 (mirror) to 1 (matt).
    pub roughness: f32,
    /// Specular reflectance at normal incidence: 0.04 for paint and plastics, 0.6 for bare metal.
    pub specular: f32,
    /// Emitted radiance.
    pub emissive: [f32; 3],
    /// Bit of [`crate::Look::lamps`] that switches the emission; always on if `None`.
    pub lamp: Option<u8>,
    /// Index into [`crate::Look::tints`] of a factor for both colours.
    pub tint: Option<u8>,
    /// Class of these triangles, if other than the instance's.
    pub class: Option<SemanticClass>,
    /// True for ground, which gets wet and has puddles.
    pub is_ground: bool,
    /// True if visible from both sides.
    pub is_two_sided: bool,
    /// Diffuse reflectance at 905 nm.
    pub reflectance: f32,
    /// True for retroreflective surfaces: plates, signs, road paint.
    pub is_retro_reflective: bool,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            albedo: [0.5; 3],
            albedo_b: [0.5; 3],
            texture: Texture::Plain,
            tile_m: 1.0,
            roughness: 0.9,
            specular: 0.04,
            emissive: [0.0; 3],
            lamp: None,
            tint: None,
            class: None,
            is_ground: false,
            is_two_sided: false,
            reflectance: 0.4,
            is_retro_reflective: false,
        }
    }
}

impl Material {
    /// A single-coloured matt material.
    pub fn matt(albedo: [f32; 3], reflectance: f32) -> Self {
        Self { albedo, albedo_b: albedo, reflectance, ..Self::default() }
    }

    /// This material with two colours mixed by a texture with tiles of this length.
    #[must_use]
    pub fn textured(self, texture: Texture, albedo_b: [f32; 3], tile_m: f32) -> Self {
        Self { texture, albedo_b, tile_m, ..self }
    }

    /// This material with a glossy surface.
    #[must_use]
    pub fn glossy(self, roughness: f32, specular: f32) -> Self {
        Self { roughness, specular, ..self }
    }

    /// This material coloured by an entry of the instance's tints.
    #[must_use]
    pub fn tinted(self, tint: u8) -> Self {
        Self { tint: Some(tint), ..self }
    }

    /// This material with emission, switched by a lamp of the instance.
    #[must_use]
    pub fn lit(self, emissive: [f32; 3], lamp: Option<u8>) -> Self {
        Self { emissive, lamp, ..self }
    }

    /// This material with another class than the instance's.
    #[must_use]
    pub fn with_class(self, class: SemanticClass) -> Self {
        Self { class: Some(class), ..self }
    }

    /// This material as a retroreflector.
    #[must_use]
    pub fn retro_reflective(self) -> Self {
        Self { is_retro_reflective: true, ..self }
    }

    pub(crate) fn add_to(&self, key: &mut Key) {
        let numbers = [self.tile_m, self.roughness, self.specular, self.reflectance];
        for number in self.albedo.into_iter().chain(self.albedo_b).chain(self.emissive).chain(numbers) {
            key.number(number);
        }
        let code = |option: Option<u8>| option.map_or(255, u32::from);
        key.word(self.texture as u32 | code(self.lamp) << 8 | code(self.tint) << 16);
        let flags = u32::from(self.is_ground)
            | u32::from(self.is_two_sided) << 1
            | u32::from(self.is_retro_reflective) << 2;
        key.word(flags | code(self.class.map(|c| c as u8)) << 8);
    }
}
