//! Light on surfaces, eight pixels at a time, once per pixel.

use wide::{f32x4, f32x8, i32x8};

use super::geometry::{Chunk, TriShade};
use super::raster::{ID_BITS, NONE};
use super::shadow::{self, ShadowMaps};
use crate::light::Environment;
use crate::surface::{Surface, flag, slot};
use crate::texture;
use crate::vector::{dot, scale};

type F = f32x8;
type V = [F; 3];

/// A lamp as shading needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lamp {
    /// From the centre of the shadow maps' cell.
    pub(crate) position: [f32; 3],
    pub(crate) direction: [f32; 3],
    pub(crate) intensity: [f32; 3],
    pub(crate) range: f32,
    pub(crate) cos_outer: f32,
    pub(crate) over_fall: f32,
    /// Columns and rows, first and last, that it may light.
    pub(crate) columns: [f32; 2],
    pub(crate) rows: [f32; 2],
}

/// Everything that shading reads.
pub(super) struct Shading<'a> {
    pub(super) chunks: &'a [Chunk],
    pub(super) surfaces: &'a [Surface],
    pub(super) environment: &'a Environment,
    pub(super) maps: &'a ShadowMaps,
    pub(super) lamps: &'a [Lamp],
    pub(super) tiles: &'a [u32],
    /// Direction of the ray of a pixel, map frame, depth 1: `ray[0] x + ray[1] y + ray[2]`.
    pub(super) ray: [[f32; 3]; 3],
    /// Camera from the centre of the shadow maps' cell.
    pub(super) eye: [f32; 3],
    /// Pixels per unit of `x/z`.
    pub(super) focal: f32,
}

fn splat(x: f32) -> F {
    F::splat(x)
}

fn splat3(v: [f32; 3]) -> V {
    v.map(F::splat)
}

fn dot8(a: V, b: V) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn clamp01(x: F) -> F {
    x.fast_max(F::ZERO).fast_min(F::ONE)
}

fn mix8(a: V, b: V, t: F) -> V {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
}

/// Largest whole number that is not above `x`, for moderate `x`.
fn floor(x: F) -> (i32x8, F) {
    let whole = x.fast_trunc_int();
    let back = whole.round_float();
    let over = back.simd_gt(x);
    let fixed = back - over.select(F::ONE, F::ZERO);
    (fixed.fast_trunc_int(), fixed)
}

/// What is read of the triangles and surfaces of eight pixels.
struct Lanes {
    planes: [F; 20],
    numbers: [F; 16],
    texture: [u32; 8],
    /// Of any of them.
    flags: u32,
    /// One texture in all, and one mip level is near enough.
    same: bool,
}

impl Lanes {
    /// Value of a plane, by its number.
    fn at(&self, plane: usize, x: F, y: F) -> F {
        let p = &self.planes[3 * plane..3 * plane + 3];
        p[0] * x + (p[1] * y + p[2])
    }

    fn colour(&self, slot: usize) -> V {
        [self.numbers[slot], self.numbers[slot + 1], self.numbers[slot + 2]]
    }

    fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }
}

/// Turns eight rows into columns of eight.
fn columns<const N: usize>(rows: [&[f32; N]; 8]) -> [F; N] {
    let mut out = [F::ZERO; N];
    for block in 0..N / 4 {
        let quad = |row: usize| {
            let row = rows[row];
            f32x4::new([row[4 * block], row[4 * block + 1], row[4 * block + 2], row[4 * block + 3]])
        };
        let [a, b, c, d] = f32x4::transpose([quad(0), quad(1), quad(2), quad(3)]);
        let [e, f, g, h] = f32x4::transpose([quad(4), quad(5), quad(6), quad(7)]);
        out[4 * block] = joined(a, e);
        out[4 * block + 1] = joined(b, f);
        out[4 * block + 2] = joined(c, g);
        out[4 * block + 3] = joined(d, h);
    }
    out
}

fn joined(low: f32x4, high: f32x4) -> F {
    let (a, b) = (low.to_array(), high.to_array());
    F::new([a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]])
}

fn splats<const N: usize>(numbers: &[f32; N]) -> [F; N] {
    let mut out = [F::ZERO; N];
    for (out, number) in out.iter_mut().zip(numbers) {
        *out = F::splat(*number);
    }
    out
}

/// The triangle that filled the last eight pixels, ready for the next eight.
pub(super) struct Kept {
    id: u32,
    lanes: Lanes,
}

impl Kept {
    /// None yet.
    pub(super) fn new() -> Self {
        let lanes =
            Lanes { planes: [F::ZERO; 20], numbers: [F::ZERO; 16], texture: [0; 8], flags: 0, same: true };
        Self { id: NONE, lanes }
    }
}

impl Shading<'_> {
    /// Shades the pixels whose centres are at `(x, y)` of the pinhole image and that show triangles `ids`.
    pub(super) fn pixels(&self, ids: &[u32; 8], x: F, y: F, kept: &mut Kept) -> V {
        let ray = [0, 1, 2]
            .map(|k| splat(self.ray[0][k]) * x + (splat(self.ray[1][k]) * y + splat(self.ray[2][k])));
        let length = dot8(ray, ray).sqrt();
        let over = F::ONE / length;
        let direction = ray.map(|r| r * over);
        let first = ids[0];
        let same = ids.iter().fold(0, |all, id| all | (id ^ first)) == 0;
        if same {
            if first == NONE {
                return self.sky(direction);
            }
            if kept.id != first {
                *kept = Kept { id: first, lanes: self.uniform(first) };
            }
            return self.surface(&kept.lanes, (x, y), ray, direction, length);
        }
        let colour = self.surface(&self.gather(ids), (x, y), ray, direction, length);
        if !ids.contains(&NONE) {
            return colour;
        }
        let open = F::from(ids.map(|id| if id == NONE { 1.0 } else { 0.0 }));
        let sky = self.sky(direction);
        let is_open = open.simd_gt(splat(0.5));
        [0, 1, 2].map(|k| is_open.select(sky[k], colour[k]))
    }

    fn triangle(&self, id: u32) -> (&TriShade, &Surface) {
        let chunk = &self.chunks[(id >> ID_BITS) as usize];
        let index = (id & ((1 << ID_BITS) - 1)) as usize;
        (&chunk.shade[index], &self.surfaces[chunk.surfaces[index] as usize])
    }

    /// One triangle in all eight pixels.
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

    /// Several triangles; pixels of the sky take one of the others.
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
    fn surface(&self, lanes: &Lanes, (x, y): (F, F), ray: V, direction: V, length: F) -> V {
        let environment = self.environment;
        let at = |plane: usize| lanes.at(plane, x, y);
        let w = at(0).fast_max(splat(1e-6));
        let z = F::ONE / w;
        let point = [0, 1, 2].map(|k| splat(self.eye[k]) + ray[k] * z);
        let across = [at(3), at(4), at(5)];
        let over = F::ONE / dot8(across, across).sqrt().fast_max(splat(1e-20));
        let normal = across.map(|n| n * over);
        let facing = (F::ZERO - dot8(normal, direction)).fast_max(splat(0.02));
        // Length of a pixel on the surface, squared, as a mean over both directions.
        let pixel = z * splat(1.0 / self.focal);
        let footprint = pixel * pixel / facing;

        let mut albedo = lanes.colour(slot::ALBEDO);
        if lanes.has(flag::TEXTURED) {
            let (tiles, contrast) = (lanes.numbers[slot::TILES], lanes.colour(slot::CONTRAST));
            let side = tiles * splat(texture::SIDE as f32);
            let (u, v) = (at(1) * z * tiles, at(2) * z * tiles);
            let t = self.sample(&lanes.texture, lanes.same, (u, v), footprint * side * side);
            albedo = [0, 1, 2].map(|k| albedo[k] + contrast[k] * t);
        }
        let (mut polish, mut specular) = (lanes.numbers[slot::POLISH], lanes.numbers[slot::SPECULAR]);
        if lanes.has(flag::GROUND) {
            let ground = lanes.numbers[slot::GROUND];
            let side = splat(texture::SIDE as f32 / 16.0);
            let base = [(texture::PUDDLES * texture::STRIDE) as u32; 8];
            let stain = self.sample(
                &base,
                lanes.same,
                (point[0] * splat(1.0 / 16.0), point[1] * splat(1.0 / 16.0)),
                footprint * side * side,
            );
            let wet = ground * splat(environment.wetness);
            let level = splat(0.72 - 0.42 * environment.puddles);
            let flat = clamp01((normal[2] - splat(0.9)) * splat(20.0));
            let puddle = clamp01((stain - level) * splat(9.0)) * wet * flat;
            let tone = F::ONE + ground * (stain - splat(0.5)) * splat(0.7);
            let tone = tone * (F::ONE - wet * splat(0.45)) * (F::ONE - puddle * splat(0.5));
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
        let up = (normal[2] * splat(0.5) + splat(0.5)) * open;
        let down = (splat(0.5) - normal[2] * splat(0.5)) * (open * splat(0.7) + splat(0.3));
        let mut light = [0, 1, 2].map(|k| {
            splat(environment.sunlight[k]) * sun
                + splat(environment.ambient[k]) * up
                + splat(environment.bounce[k]) * down
        });
        if environment.lamps_on {
            self.add_lamps((x, y), point, normal, lanes.numbers[slot::RETRO], &mut light);
        }
        let mut colour = [0, 1, 2].map(|k| albedo[k] * light[k]);
        if lanes.has(flag::SHINY) || (lanes.has(flag::GROUND) && environment.wetness > 0.0) {
            let sharp = sun / cosine.fast_max(splat(0.05));
            let (mirror, share) = self.mirror(normal, direction, facing, (polish, specular, sharp, open));
            colour = [0, 1, 2].map(|k| colour[k] * (F::ONE - share) + mirror[k]);
        }
        if lanes.has(flag::SHINING) {
            let emissive = lanes.colour(slot::EMISSIVE);
            colour = [0, 1, 2].map(|k| colour[k] + emissive[k]);
        }
        // Beer's law; exp(-x) by its series in the denominator.
        let x = splat(environment.fog_1pm) * length * z;
        let clear = F::ONE
            / (F::ONE + x * (F::ONE + x * (splat(0.5) + x * (splat(1.0 / 6.0) + x * splat(1.0 / 24.0)))));
        mix8(splat3(environment.fog), colour, clear)
    }

    /// Value of a texture between 0 and 1, with the mip level for a footprint in texels squared; with the
    /// level of the first for `all` if they have one texture and much the same footprint.
    fn sample(&self, base: &[u32; 8], all: bool, (u, v): (F, F), footprint: F) -> F {
        // Half the exponent, rounded up, is the level.
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

    /// Share of the sky that is open over points near the ground.
    fn open_sky(&self, point: V, height: F) -> F {
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

    /// Share of the sun that is seen, filtered over two by two texels.
    fn sunshine(&self, point: V, normal: V) -> F {
        let maps = self.maps;
        // Off the surface by a texel, so that it does not shadow itself.
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

    /// What a polished surface mirrors, and its share of the light.
    fn mirror(
        &self,
        normal: V,
        direction: V,
        facing: F,
        (polish, specular, sharp, open): (F, F, F, F),
    ) -> (V, F) {
        let environment = self.environment;
        let twice = facing + facing;
        let out = [0, 1, 2].map(|k| direction[k] + normal[k] * twice);
        let base = F::ONE - facing.fast_min(F::ONE);
        let square = base * base;
        let fresnel = specular + (F::ONE - specular) * (square * square * base);
        let share = fresnel * polish * open;
        // Sky above, a dark band of houses and trees at the horizon, the ground below.
        let up = out[2].fast_max(F::ZERO);
        let sky = mix8(splat3(environment.horizon), splat3(environment.zenith), up.sqrt());
        let rim = clamp01((out[2] - splat(0.08)) * splat(7.0));
        let seen = mix8(splat3(scale(environment.bounce, 1.6)), sky, rim);
        let near = dot8(out, splat3(environment.sun)).fast_max(F::ZERO);
        let (n2, n4) = (near * near, near * near * near * near);
        let n8 = n4 * n4;
        let n32 = n8 * n8 * n8 * n8;
        let wide = n8 * n2;
        let glint = (n32 * n32 * splat(9.0) * polish + n32 * splat(2.0) + wide * splat(0.2))
            * polish
            * polish
            * sharp;
        let sun = splat3(environment.sunlight);
        ([0, 1, 2].map(|k| seen[k] * share + sun[k] * glint * fresnel), share)
    }

    /// Adds the light of lamps.
    fn add_lamps(&self, (x, y): (F, F), point: V, normal: V, retro: F, light: &mut V) {
        let (row, first, last) = (y.to_array()[0], x.to_array()[0], x.to_array()[7]);
        for lamp in self.lamps {
            if row < lamp.rows[0] || row > lamp.rows[1] || last < lamp.columns[0] || first > lamp.columns[1] {
                continue;
            }
            let to = [0, 1, 2].map(|k| splat(lamp.position[k]) - point[k]);
            let square = dot8(to, to).fast_max(splat(0.04));
            let over = F::ONE / square.sqrt();
            let cone = F::ZERO - dot8(to, splat3(lamp.direction)) * over;
            let beam = clamp01((cone - splat(lamp.cos_outer)) * splat(lamp.over_fall));
            let cosine = (dot8(to, normal) * over).fast_max(F::ZERO);
            let fade = clamp01(F::ONE - square * splat(1.0 / (lamp.range * lamp.range)));
            // A lamp has a size: near it the light no longer grows with the inverse square.
            let spread = F::ONE / (square + splat(9.0));
            let strength = beam * beam * fade * spread * (cosine + retro * splat(2.5));
            for (light, intensity) in light.iter_mut().zip(lamp.intensity) {
                *light += splat(intensity) * strength;
            }
        }
    }

    /// Colour of the sky.
    fn sky(&self, direction: V) -> V {
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
        let large = self.sample(&base, true, (u * splat(0.25), v * splat(0.25)), grain * splat(0.3));
        let small = self.sample(&base, true, (u, v), grain * splat(4.0));
        let density = large * splat(0.72) + small * splat(0.28);
        let level = splat(0.66 - 0.46 * environment.cloudiness);
        let cover = clamp01((density - level) * splat(5.0)) * clamp01(up * splat(9.0));
        let shade = splat(1.08) - clamp01((density - level) * splat(2.2)) * splat(0.42);
        let cloud = splat3(environment.cloud).map(|c| c * shade);
        colour = mix8(colour, cloud, cover * splat(0.92));
        // Haze towards the horizon, more of it in fog.
        let haze = (1.0 / (1.0 + 60.0 * environment.fog_1pm)).max(0.05);
        let thin = clamp01(direction[2] * splat(9.0 * haze) + splat(0.25 * haze));
        mix8(splat3(environment.fog), colour, thin)
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

impl Lamp {
    /// Whether it is worth anything before the camera.
    pub(crate) fn shines(&self) -> bool {
        self.range > 0.0 && dot(self.intensity, self.intensity) > 0.0 && self.columns[0] <= self.columns[1]
    }
}
