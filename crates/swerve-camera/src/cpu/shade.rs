//! Shading of surfaces, eight pixels at a time, once per pixel.

mod inputs;
mod lanes;
pub(super) mod light;
mod lookup;

pub(super) use inputs::{ParallelRays, PixelRays, Shading};
pub(super) use lanes::TriangleCache;

use super::geometry::TriShade;
use super::id::{ID_BITS, NONE};
use crate::frontend::surface::{Surface, flag, slot};
use crate::frontend::texture;
use lanes::{F, Lanes, V, clamp01, columns, dot8, mix8, splat, splat3, splats};
use light::{Gloss, Lit, daylight, ground_tone, through_fog};

impl Shading<'_> {
    /// Shades the pixels with centres `(x, y)` in the pinhole image that show the triangles `ids`.
    pub(super) fn pixels(&self, ids: &[u32; 8], x: F, y: F, cache: &mut TriangleCache) -> V {
        let rays = self.rays(x, y);
        let first = ids[0];
        let same = ids.iter().fold(0, |all, id| all | (id ^ first)) == 0;
        if same {
            if first == NONE {
                return self.sky(rays.direction);
            }
            if cache.id != first {
                *cache = TriangleCache { id: first, lanes: self.uniform(first) };
            }
            return self.surface(&cache.lanes, &rays);
        }
        let colour = self.surface(&self.gather(ids), &rays);
        if !ids.contains(&NONE) {
            return colour;
        }
        let open = F::from(ids.map(|id| if id == NONE { 1.0 } else { 0.0 }));
        let sky = self.sky(rays.direction);
        let is_open = open.simd_gt(splat(0.5));
        [0, 1, 2].map(|k| is_open.select(sky[k], colour[k]))
    }

    /// Rays through positions in the pinhole image.
    pub(super) fn rays(&self, x: F, y: F) -> PixelRays {
        let ray = [0, 1, 2]
            .map(|k| splat(self.ray[0][k]) * x + (splat(self.ray[1][k]) * y + splat(self.ray[2][k])));
        let length = dot8(ray, ray).sqrt();
        let over = F::ONE / length;
        PixelRays { x, y, ray, direction: ray.map(|r| r * over), length }
    }

    fn triangle(&self, id: u32) -> (&TriShade, &Surface) {
        let chunk = &self.chunks[(id >> ID_BITS) as usize];
        let index = (id & ((1 << ID_BITS) - 1)) as usize;
        (&chunk.shade[index], &self.surfaces[chunk.surfaces[index] as usize])
    }

    /// Lanes for one triangle in all eight pixels.
    fn uniform(&self, id: u32) -> Lanes {
        let (triangle, surface) = self.triangle(id);
        Lanes {
            planes: splats(triangle),
            numbers: splats(&surface.numbers),
            texture: [surface.texture; 8],
            flags: surface.flags,
            same: true,
        }
    }

    /// Lanes for several triangles; sky pixels use one of the others.
    fn gather(&self, ids: &[u32; 8]) -> Lanes {
        let some = ids.iter().copied().find(|id| *id != NONE).unwrap_or(0);
        let (triangle, surface) = self.triangle(some);
        let (mut planes, mut numbers) = ([triangle; 8], [&surface.numbers; 8]);
        let (mut texture, mut flags) = ([surface.texture; 8], surface.flags);
        for k in 0..8 {
            if ids[k] != NONE {
                let (triangle, surface) = self.triangle(ids[k]);
                (planes[k], numbers[k], texture[k]) = (triangle, &surface.numbers, surface.texture);
                flags |= surface.flags;
            }
        }
        Lanes { planes: columns(planes), numbers: columns(numbers), texture, flags, same: false }
    }

    /// Colour of surfaces.
    fn surface(&self, lanes: &Lanes, rays: &PixelRays) -> V {
        let environment = self.environment;
        let PixelRays { x, y, ray, direction, length } = *rays;
        let at = |plane: usize| lanes.at(plane, x, y);
        let w = at(0).fast_max(splat(1e-6));
        let (z, scale, eye) = match &self.flat {
            None => (F::ONE / w, F::ONE / w, splat3(self.eye)),
            Some(ParallelRays { origin, far }) => {
                let eye =
                    |k: usize| splat(origin[0][k]) * x + (splat(origin[1][k]) * y + splat(origin[2][k]));
                (splat(*far) - w, F::ONE, [eye(0), eye(1), eye(2)])
            }
        };
        let point = [0, 1, 2].map(|k| eye[k] + ray[k] * z);
        let across = [at(3), at(4), at(5)];
        let over = F::ONE / dot8(across, across).sqrt().fast_max(splat(1e-20));
        let normal = across.map(|n| n * over);
        let facing = (F::ZERO - dot8(normal, direction)).fast_max(splat(0.02));
        // Squared length of a pixel on the surface, as a mean over both directions.
        let pixel = scale * splat(1.0 / self.focal);
        let footprint = pixel * pixel / facing;
        let mut albedo = if lanes.has(flag::TEXTURED) {
            self.textured(lanes, at(1) * scale, at(2) * scale, footprint)
        } else {
            lanes.colour(slot::ALBEDO)
        };
        let (mut polish, mut specular) = (lanes.numbers[slot::POLISH], lanes.numbers[slot::SPECULAR]);
        if lanes.has(flag::GROUND) {
            let ground = lanes.numbers[slot::GROUND];
            let side = splat(texture::SIDE as f32 / 16.0);
            let base = [(texture::PUDDLES * texture::STRIDE) as u32; 8];
            let stain = self.sample(
                &base,
                lanes.same,
                point[0] * splat(1.0 / 16.0),
                point[1] * splat(1.0 / 16.0),
                footprint * side * side,
            );
            let [tone, wet, puddle] = ground_tone(environment, stain, normal[2], ground);
            albedo = albedo.map(|a| a * tone);
            polish = polish.fast_max(wet * splat(0.25)).fast_max(puddle * splat(0.95));
            specular += puddle * splat(0.02);
        }

        let height = point[2] + splat(self.maps.centre[2] as f32);
        let open = self.open_sky(point, height);
        let cosine = dot8(normal, splat3(environment.sun)).fast_max(F::ZERO);
        let sun = if environment.has_shadows() && cosine.simd_gt(F::ZERO).any() {
            cosine * self.sunshine(point, normal)
        } else {
            F::ZERO
        };
        let mut light = daylight(environment, normal, sun, open);
        if environment.lamps_on {
            let lit = Lit { retro: lanes.numbers[slot::RETRO], ground: lanes.numbers[slot::GROUND] };
            self.add_lamps(rays, (point, normal), lit, &mut light);
        }
        let mut colour = [0, 1, 2].map(|k| albedo[k] * light[k]);
        if lanes.has(flag::SHINY) || (lanes.has(flag::GROUND) && environment.wetness > 0.0) {
            let sharp = sun / cosine.fast_max(splat(0.05));
            let (mirror, share) =
                self.mirror(normal, direction, facing, &Gloss { polish, specular, sharp, open });
            colour = [0, 1, 2].map(|k| colour[k] * (F::ONE - share) + mirror[k]);
        }
        if lanes.has(flag::SHINING) {
            let emissive = lanes.colour(slot::EMISSIVE);
            colour = [0, 1, 2].map(|k| colour[k] + emissive[k]);
        }
        let clear = through_fog(splat(environment.fog_1pm) * length * z);
        mix8(splat3(environment.fog), colour, clear)
    }

    /// Reflectance of textured surfaces at texture coordinates.
    fn textured(&self, lanes: &Lanes, u: F, v: F, footprint: F) -> V {
        let (tiles, contrast) = (lanes.numbers[slot::TILES], lanes.colour(slot::CONTRAST));
        let side = tiles * splat(texture::SIDE as f32);
        let t = self.sample(&lanes.texture, lanes.same, u * tiles, v * tiles, footprint * side * side);
        let albedo = lanes.colour(slot::ALBEDO);
        [0, 1, 2].map(|k| albedo[k] + contrast[k] * t)
    }

    /// Colour of the sky.
    pub(super) fn sky(&self, direction: V) -> V {
        let environment = self.environment;
        let up = direction[2].fast_max(F::ZERO);
        let mut colour = mix8(splat3(environment.horizon), splat3(environment.zenith), up.sqrt());
        let near = dot8(direction, splat3(environment.sun)).fast_max(F::ZERO);
        let n2 = near * near;
        let n4 = n2 * n2;
        let squared = |x: F| x * x;
        let n64 = squared(squared(squared(squared(n4))));
        let n1024 = squared(squared(squared(squared(n64))));
        let disc = near.simd_gt(splat(0.999_96)).select(splat(12.0), F::ZERO);
        let halo = n4 * splat(0.10) + n64 * splat(0.35) + n1024 * splat(1.2);
        let clear = 1.0 - environment.cloudiness;
        for (colour, glow) in colour.iter_mut().zip(environment.glow) {
            *colour += splat(glow) * (halo + disc * splat(clear));
        }
        let over = splat(0.55) / (direction[2].fast_max(F::ZERO) + splat(0.09));
        let base = [(texture::CLOUDS * texture::STRIDE) as u32; 8];
        let (u, v) = (direction[0] * over, direction[1] * over);
        let grain = over * over * splat(400.0 / self.focal);
        let large = self.sample(&base, true, u * splat(0.25), v * splat(0.25), grain * splat(0.3));
        let small = self.sample(&base, true, u, v, grain * splat(4.0));
        let density = large * splat(0.72) + small * splat(0.28);
        let level = splat(0.66 - 0.46 * environment.cloudiness);
        let cover = clamp01((density - level) * splat(5.0)) * clamp01(up * splat(9.0));
        let shade = splat(1.08) - clamp01((density - level) * splat(2.2)) * splat(0.42);
        let cloud = splat3(environment.cloud).map(|c| c * shade);
        colour = mix8(colour, cloud, cover * splat(0.92));
        // Haze towards the horizon, denser in fog.
        let haze = (1.0 / (1.0 + 60.0 * environment.fog_1pm)).max(0.05);
        let thin = clamp01(direction[2] * splat(9.0 * haze) + splat(0.25 * haze));
        mix8(splat3(environment.fog), colour, thin)
    }
}
