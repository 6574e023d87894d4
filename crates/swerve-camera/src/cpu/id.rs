//! Ids of pixels: the chunk and the triangle that they show.

/// Id of a pixel that shows only sky.
pub(super) const NONE: u32 = u32::MAX;

/// Bits of an id for the triangle within its chunk; the other bits are the chunk.
pub(super) const ID_BITS: u32 = 20;
