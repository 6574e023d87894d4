//! Inputs of shading: the sub-frame, and the rays of eight pixels.

use super::lanes::{F, V};
use crate::cpu::geometry::Chunk;
use crate::cpu::shadow_maps::ShadowMaps;
use crate::frontend::lamp::Lamp;
use crate::frontend::light::Environment;
use crate::frontend::surface::Surface;

/// Inputs of shading.
#[derive(Clone, Copy)]
pub(in crate::cpu) struct Shading<'a> {
    pub(in crate::cpu) chunks: &'a [Chunk],
    pub(in crate::cpu) surfaces: &'a [Surface],
    pub(in crate::cpu) environment: &'a Environment,
    pub(in crate::cpu) maps: &'a ShadowMaps,
    pub(in crate::cpu) lamps: &'a [Lamp],
    pub(in crate::cpu) tiles: &'a [u32],
    /// Direction of the ray of a pixel, map frame, depth 1: `ray[0] x + ray[1] y + ray[2]`.
    pub(in crate::cpu) ray: [[f32; 3]; 3],
    /// Camera position relative to the centre of the shadow maps' cell.
    pub(in crate::cpu) eye: [f32; 3],
    /// Start and end of the rays, for an orthographic image.
    pub(in crate::cpu) flat: Option<ParallelRays>,
    /// Pixels per unit of `x/z`.
    pub(in crate::cpu) focal: f32,
}

/// Parallel rays.
#[derive(Clone, Copy)]
pub(in crate::cpu) struct ParallelRays {
    /// Origin of a pixel's ray, with factors as in [`Shading::ray`].
    pub(in crate::cpu) origin: [[f32; 3]; 3],
    /// Far depth.
    pub(in crate::cpu) far: f32,
}

/// Eight pixels and their rays.
pub(in crate::cpu) struct PixelRays {
    /// Positions in the pinhole image.
    pub(super) x: F,
    pub(super) y: F,
    /// Direction with depth 1, map frame.
    pub(super) ray: V,
    /// Unit direction, map frame.
    pub(super) direction: V,
    pub(super) length: F,
}
