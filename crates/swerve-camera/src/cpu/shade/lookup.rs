//! Look-ups in textures and shadow maps.

use wide::i32x8;

use super::inputs::Shading;
use super::lanes::{F, V, clamp01, dot8, splat, splat3};
use crate::frontend::{shadow, texture};

/// Floor of `x`, for moderate `x`.
fn floor(x: F) -> (i32x8, F) {
    let whole = x.fast_trunc_int();
    let back = whole.round_float();
    let over = back.simd_gt(x);
    let fixed = back - over.select(F::ONE, F::ZERO);
    (fixed.fast_trunc_int(), fixed)
}

impl Shading<'_> {
    /// Texture value between 0 and 1, at the mip level for a footprint in squared texels. If `all`, the level of the
    /// first pixel is used for all: same texture and similar footprints.
    pub(in crate::cpu) fn sample(&self, base: &[u32; 8], all: bool, u: F, v: F, footprint: F) -> F {
        // The level is half the exponent, rounded up.
        let level = |footprint: f32| ((footprint.clamp(1.0, 60_000.0).to_bits() >> 23) - 126) >> 1;
        let side = |level: u32| f32::from_bits((127 + 8 - level) << 23);
        let limit = splat(2.0e4);
        let bound = |t: F| t.fast_max(F::ZERO - limit).fast_min(limit);
        let (u, v) = (bound(u), bound(v));
        let footprint = footprint.to_array();
        let mut words = [0_i32; 8];
        let (tu, tv) = if all {
            let level = level(footprint[0]);
            let (u, v) = (u * splat(side(level)) - splat(0.5), v * splat(side(level)) - splat(0.5));
            let ((iu, fu), (iv, fv)) = (floor(u), floor(v));
            let shift = 8 - level;
            let mask = i32x8::splat((1 << shift) - 1);
            let index = ((iv & mask) << shift as i32 | (iu & mask)).to_array();
            let tile = &self.tiles[(base[0] + texture::OFFSETS[level as usize]) as usize..];
            let tile = &tile[..1 << (2 * shift)];
            for k in 0..8 {
                words[k] = tile[index[k] as usize] as i32;
            }
            (u - fu, v - fv)
        } else {
            let levels = footprint.map(level);
            let sides = F::from(levels.map(side));
            let (u, v) = (u * sides - splat(0.5), v * sides - splat(0.5));
            let ((iu, fu), (iv, fv)) = (floor(u), floor(v));
            let (iu, iv) = (iu.to_array(), iv.to_array());
            for k in 0..8 {
                let shift = 8 - levels[k];
                let mask = (1_u32 << shift) - 1;
                let start = base[k] + texture::OFFSETS[levels[k] as usize];
                words[k] = self.tiles
                    [(start + ((iv[k] as u32 & mask) << shift | iu[k] as u32 & mask)) as usize]
                    as i32;
            }
            (u - fu, v - fv)
        };
        unpack(i32x8::from(words), tu, tv)
    }

    /// Visible share of the sky for points near the ground.
    pub(super) fn open_sky(&self, point: V, height: F) -> F {
        let near = clamp01(F::ONE - height * splat(1.0 / 0.7));
        if !near.simd_gt(F::ZERO).any() {
            return F::ONE;
        }
        let half = 0.5 * shadow::SKY_SIDE as f32 - 0.5;
        let most = splat(shadow::SKY_SIDE as f32 - 2.0);
        let texel = |m: F| m * splat(shadow::SKY_PER_M) + splat(half);
        let bound = |t: F| t.fast_max(F::ZERO).fast_min(most);
        let (free_x, free_y) = (texel(point[0]), texel(point[1]));
        let (x, y) = (bound(free_x), bound(free_y));
        let inside = x.simd_eq(free_x) & y.simd_eq(free_y);
        let (ix, iy) = (x.fast_trunc_int(), y.fast_trunc_int());
        let (tx, ty) = (x - ix.round_float(), y - iy.round_float());
        let (ix, iy) = (ix.to_array(), iy.to_array());
        let mut words = [0_i32; 8];
        for k in 0..8 {
            words[k] = self.maps.hidden[iy[k] as usize * shadow::SKY_SIDE + ix[k] as usize] as i32;
        }
        inside.select(F::ONE - unpack(i32x8::from(words), tx, ty) * near, F::ONE)
    }

    /// Visible share of the sun, filtered over two by two texels.
    pub(super) fn sunshine(&self, point: V, normal: V) -> F {
        let maps = self.maps;
        // Offset from the surface by a texel, to avoid self-shadowing.
        let point = [0, 1, 2].map(|k| point[k] + normal[k] * splat(0.09));
        let along = |k: usize| dot8(splat3(maps.axes[k]), point);
        let half = 0.5 * shadow::SIDE as f32 - 0.5;
        let most = splat(shadow::SIDE as f32 - 2.0);
        let texel = |m: F| m * splat(shadow::PER_M) + splat(half);
        let bound = |t: F| t.fast_max(F::ZERO).fast_min(most);
        let (free_x, free_y) = (texel(along(0)), texel(along(1)));
        let (x, y) = (bound(free_x), bound(free_y));
        let inside = x.simd_eq(free_x) & y.simd_eq(free_y);
        let depth = along(2) * splat(shadow::DEPTHS_PER_M) + splat(shadow::DEPTH_0 + 4.0);
        let (ix, iy) = (x.fast_trunc_int(), y.fast_trunc_int());
        let (tx, ty) = (x - ix.round_float(), y - iy.round_float());
        let (ix, iy) = (ix.to_array(), iy.to_array());
        let mut taps = [[0_i32; 8]; 4];
        for k in 0..8 {
            let index = iy[k] as usize * shadow::SIDE + ix[k] as usize;
            let (row, next) =
                (&maps.depth[index..index + 2], &maps.depth[index + shadow::SIDE..index + shadow::SIDE + 2]);
            taps[0][k] = i32::from(row[0]);
            taps[1][k] = i32::from(row[1]);
            taps[2][k] = i32::from(next[0]);
            taps[3][k] = i32::from(next[1]);
        }
        let lit = taps.map(|tap| i32x8::from(tap).round_float().simd_le(depth).select(F::ONE, F::ZERO));
        let low = lit[0] + (lit[1] - lit[0]) * tx;
        let high = lit[2] + (lit[3] - lit[2]) * tx;
        inside.select(low + (high - low) * ty, F::ONE)
    }
}

/// Bilinear mean of the four bytes of each word, between 0 and 1.
fn unpack(words: i32x8, tu: F, tv: F) -> F {
    let mask = i32x8::splat(255);
    let byte = |shift: i32| ((words >> shift) & mask).round_float();
    let (a, b, c, d) = (byte(0), byte(8), byte(16), byte(24));
    let low = a + (b - a) * tu;
    let high = c + (d - c) * tu;
    (low + (high - low) * tv) * splat(1.0 / 255.0)
}
