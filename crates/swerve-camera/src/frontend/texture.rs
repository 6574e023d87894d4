//! Patterns, baked once: grey tiles with mip levels, four neighbours packed in each word.
//!
//! A bilinear sample is one load: word `(x, y)` of a level holds the values at `(x, y)`, `(x + 1, y)`,
//! `(x, y + 1)`, `(x + 1, y + 1)` in its bytes from the lowest, with wrap-around.

use std::sync::OnceLock;

use swerve_scene::{Texture, hash};

/// Side of a tile at its finest level.
pub(crate) const SIDE: usize = 256;
/// Number of levels, down to a single value.
pub(crate) const LEVELS: usize = 9;
/// Words of all levels of one tile.
pub(crate) const STRIDE: usize = offset(LEVELS);

/// Offset of a level within a tile, words.
pub(crate) const fn offset(level: usize) -> usize {
    let mut at = 0;
    let mut k = 0;
    while k < level {
        at += (SIDE >> k) * (SIDE >> k);
        k += 1;
    }
    at
}

/// Offset of each level within a tile, words.
pub(crate) const OFFSETS: [u32; LEVELS] = {
    let mut offsets = [0; LEVELS];
    let mut level = 0;
    while level < LEVELS {
        offsets[level] = offset(level) as u32;
        level += 1;
    }
    offsets
};

/// Index of the tile of clouds, after those of the materials.
pub(crate) const CLOUDS: usize = Texture::ALL.len();
/// Index of the tile of puddles and stains.
pub(crate) const PUDDLES: usize = CLOUDS + 1;
/// Index of the tile of rain streaks.
pub(crate) const STREAKS: usize = CLOUDS + 2;
const COUNT: usize = CLOUDS + 3;

/// All tiles, one after the other.
pub(crate) struct Tiles {
    words: Vec<u32>,
}

impl Tiles {
    /// Shared tiles; baked on the first call in the process, constant from then on.
    pub(crate) fn get() -> &'static Self {
        static TILES: OnceLock<Tiles> = OnceLock::new();
        TILES.get_or_init(Self::bake)
    }

    /// Words of all tiles; an index is the sum of a tile's base, a level offset and wrapped coordinates.
    pub(crate) fn words(&self) -> &[u32] {
        &self.words
    }

    fn bake() -> Self {
        let mut words = Vec::with_capacity(COUNT * STRIDE);
        for tile in 0..COUNT {
            let mut level: Vec<f32> = (0..SIDE * SIDE).map(|k| texel(tile, k % SIDE, k / SIDE)).collect();
            let mut side = SIDE;
            loop {
                pack(&level, side, &mut words);
                if side == 1 {
                    break;
                }
                side /= 2;
                let fine = |x: usize, y: usize| level[y * 2 * side + x];
                level = (0..side * side)
                    .map(|k| (2 * (k % side), 2 * (k / side)))
                    .map(|(x, y)| 0.25 * (fine(x, y) + fine(x + 1, y) + fine(x, y + 1) + fine(x + 1, y + 1)))
                    .collect();
            }
        }
        Self { words }
    }
}

fn pack(level: &[f32], side: usize, words: &mut Vec<u32>) {
    let byte =
        |x: usize, y: usize| (level[(y % side) * side + x % side].clamp(0.0, 1.0) * 255.0 + 0.5) as u32;
    for y in 0..side {
        for x in 0..side {
            let four = [byte(x, y), byte(x + 1, y), byte(x, y + 1), byte(x + 1, y + 1)];
            words.push(four[0] | four[1] << 8 | four[2] << 16 | four[3] << 24);
        }
    }
}

/// Mean over a texel; patterns with sharp edges are sampled twice per axis.
fn texel(tile: usize, x: usize, y: usize) -> f32 {
    let sharp =
        [Texture::Brick, Texture::Stop, Texture::Limit30, Texture::Limit50, Texture::Limit80, Texture::Plate];
    if !Texture::ALL.get(tile).is_some_and(|texture| sharp.contains(texture)) {
        return value(tile, (x as f32 + 0.5) / SIDE as f32, (y as f32 + 0.5) / SIDE as f32);
    }
    let mut sum = 0.0;
    for sub in 0..4 {
        let at = |k: usize, s: usize| (k as f32 + 0.25 + 0.5 * s as f32) / SIDE as f32;
        sum += value(tile, at(x, sub % 2), at(y, sub / 2));
    }
    0.25 * sum
}

/// Pattern value at a point of the unit square.
fn value(tile: usize, x: f32, y: f32) -> f32 {
    match tile {
        CLOUDS => fbm(x, y, 4, 6, 11),
        PUDDLES => 0.75 * fbm(x, y, 3, 4, 23) + 0.25 * fbm(x, y, 24, 2, 29),
        STREAKS => streaks(x, y),
        _ => match Texture::ALL[tile] {
            Texture::Plain => 0.0,
            Texture::Asphalt => asphalt(x, y),
            Texture::Slabs => slabs(x, y),
            Texture::Brick => brick(x, y),
            Texture::Plaster => plaster(x, y),
            Texture::Grass => grass(x, y),
            Texture::Foliage => foliage(x, y),
            Texture::Bark => 0.6 * noise(x, y, 40, 5, 3) + 0.4 * fbm(x, y, 16, 3, 7),
            Texture::RoofTiles => roof_tiles(x, y),
            Texture::Cloth => 0.7 * fbm(x, y, 3, 3, 31) + 0.3 * noise(x, y, 64, 64, 5),
            Texture::WornPaint => worn(x, y),
            Texture::Corrugated => corrugated(x, y),
            Texture::Glass => fbm(x, y, 2, 3, 41),
            Texture::Stop => text(x, y, b"STOP", [0.13, 0.36, 0.74, 0.28]),
            Texture::Limit30 => text(x, y, b"30", [0.22, 0.28, 0.56, 0.44]),
            Texture::Limit50 => text(x, y, b"50", [0.22, 0.28, 0.56, 0.44]),
            Texture::Limit80 => text(x, y, b"80", [0.22, 0.28, 0.56, 0.44]),
            Texture::Plate => text(x, y, b"SW 4187", [0.06, 0.2, 0.88, 0.6]),
        },
    }
}

/// Value noise on a lattice of `nx` x `ny` cells that wraps around.
fn noise(x: f32, y: f32, nx: u32, ny: u32, salt: u32) -> f32 {
    let (fx, fy) = (x * nx as f32, y * ny as f32);
    let (ix, iy) = (fx.floor(), fy.floor());
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (tx, ty) = (smooth(fx - ix), smooth(fy - iy));
    let corner = |dx: u32, dy: u32| {
        let (cx, cy) = ((ix as u32 + dx) % nx, (iy as u32 + dy) % ny);
        hash::unit(hash::mix(cx.wrapping_add(cy << 10).wrapping_add(salt << 20)))
    };
    let (a, b) = (
        corner(0, 0) + tx * (corner(1, 0) - corner(0, 0)),
        corner(0, 1) + tx * (corner(1, 1) - corner(0, 1)),
    );
    a + ty * (b - a)
}

/// Octaves of noise, each twice as fine and half as strong.
fn fbm(x: f32, y: f32, cells: u32, octaves: u32, salt: u32) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    for octave in 0..octaves {
        let n = cells << octave;
        sum += weight * noise(x, y, n, n, salt + 101 * octave);
        total += weight;
        weight *= 0.5;
    }
    sum / total
}

fn ramp(x: f32, low: f32, high: f32) -> f32 {
    ((x - low) / (high - low)).clamp(0.0, 1.0)
}

/// Asphalt: grains of stone in dark binder, stains, fine cracks.
fn asphalt(x: f32, y: f32) -> f32 {
    let grain = 0.55 * noise(x, y, 128, 128, 3) + 0.45 * noise(x, y, 220, 220, 4);
    let stain = fbm(x, y, 3, 4, 17);
    let crack = (fbm(x, y, 4, 4, 51) - 0.5).abs();
    let dark = if stain > 0.52 { ramp(crack, 0.0, 0.012) } else { 1.0 };
    (0.75 * grain * grain + 0.55 * stain - 0.1) * (0.25 + 0.75 * dark)
}

/// Two by two slabs with joints, each with its own tone.
fn slabs(x: f32, y: f32) -> f32 {
    let (sx, sy) = (2.0 * x, 2.0 * y);
    let edge = |t: f32| (t - t.floor()).min(1.0 - (t - t.floor()));
    let joint = 1.0 - ramp(edge(sx).min(edge(sy)), 0.012, 0.028);
    let tone = hash::unit(hash::mix(sx as u32 * 7 + sy as u32 * 31 + 3));
    joint.max(0.35 * tone + 0.35 * fbm(x, y, 8, 5, 61) - 0.1)
}

/// Running bond of 5 x 16 bricks; the mortar is 1.
fn brick(x: f32, y: f32) -> f32 {
    let row = (16.0 * y).floor();
    let across = 5.0 * x + if (row as u32).is_multiple_of(2) { 0.0 } else { 0.5 };
    let (u, v) = (across - across.floor(), 16.0 * y - row);
    let mortar = u < 0.045 || v < 0.15;
    let tone = hash::unit(hash::mix((across.floor() as u32 % 5) * 131 + row as u32 * 977));
    if mortar {
        0.85 + 0.15 * noise(x, y, 128, 128, 6)
    } else {
        0.26 * tone + 0.14 * noise(x, y, 128, 128, 8)
    }
}

fn plaster(x: f32, y: f32) -> f32 {
    let run = noise(x, y, 40, 3, 71);
    0.45 * fbm(x, y, 4, 5, 67)
        + 0.25 * noise(x, y, 160, 160, 9)
        + 0.35 * run * ramp(fbm(x, y, 2, 2, 73), 0.4, 0.8)
}

fn grass(x: f32, y: f32) -> f32 {
    let blade = noise(x, y, 128, 50, 12) * noise(x, y, 50, 128, 13);
    0.75 * blade + 0.55 * fbm(x, y, 4, 4, 79) - 0.05
}

/// Leaves: bright spots of several sizes over dark gaps.
fn foliage(x: f32, y: f32) -> f32 {
    let leaf = noise(x, y, 40, 40, 14).max(noise(x, y, 28, 28, 15));
    ramp(leaf, 0.25, 0.95) * (0.45 + 0.55 * fbm(x, y, 5, 3, 83)) + 0.15 * noise(x, y, 110, 110, 16)
}

/// Eight rows of overlapping roof tiles.
fn roof_tiles(x: f32, y: f32) -> f32 {
    let (u, v) = (8.0 * x, 8.0 * y);
    let (fu, fv) = (u - u.floor(), v - v.floor());
    let curve = 4.0 * fu * (1.0 - fu);
    let tone = hash::unit(hash::mix(u as u32 * 57 + v as u32 * 113));
    let lip: f32 = if fv < 0.12 { 1.0 } else { 0.0 };
    (0.9 * lip).max(0.75 * (1.0 - curve)) * 0.8 + 0.25 * tone
}

fn worn(x: f32, y: f32) -> f32 {
    let patch = fbm(x, y, 5, 5, 89);
    let grain = noise(x, y, 150, 150, 18);
    ramp(patch + 0.35 * grain, 0.72, 0.86) * 0.85 + 0.12 * grain
}

/// Ribs along y, sixteen per tile, slightly dirty.
fn corrugated(x: f32, y: f32) -> f32 {
    let rib = 16.0 * x - (16.0 * x).floor();
    ramp((rib - 0.5).abs(), 0.25, 0.45) * 0.8 + 0.3 * fbm(x, y, 3, 4, 97)
}

/// Thin slanted strokes of random brightness.
fn streaks(x: f32, y: f32) -> f32 {
    let column = (96.0 * x).floor();
    let phase = hash::unit(hash::mix(column as u32 * 7919 + 5));
    let along = 2.0 * (y + phase) - (2.0 * (y + phase)).floor();
    let cell = (2.0 * (y + phase)) as u32;
    let bright = hash::unit(hash::mix(column as u32 * 104_729 + cell));
    let across = 1.0 - (2.0 * (96.0 * x - column) - 1.0).abs();
    if bright > 0.55 { across * ramp(along, 0.0, 0.3) * (1.0 - ramp(along, 0.3, 0.45)) * bright } else { 0.0 }
}

/// Rows of a 5 x 7 letter; the leftmost dot is the highest of five bits.
fn glyph(letter: u8) -> [u8; 7] {
    match letter {
        b'0' => [14, 17, 17, 17, 17, 17, 14],
        b'1' => [4, 12, 4, 4, 4, 4, 14],
        b'3' => [30, 1, 1, 14, 1, 1, 30],
        b'4' => [2, 6, 10, 18, 31, 2, 2],
        b'5' => [31, 16, 30, 1, 1, 17, 14],
        b'7' => [31, 1, 2, 4, 8, 8, 8],
        b'8' => [14, 17, 17, 14, 17, 17, 14],
        b'S' => [15, 16, 16, 14, 1, 1, 30],
        b'T' => [31, 4, 4, 4, 4, 4, 4],
        b'O' => [14, 17, 17, 17, 17, 17, 14],
        b'P' => [30, 17, 17, 30, 16, 16, 16],
        b'W' => [17, 17, 17, 21, 21, 27, 17],
        _ => [0; 7],
    }
}

/// Letters in a box `[x, y, width, height]` of the unit square, y up.
fn text(x: f32, y: f32, letters: &[u8], [x0, y0, width, height]: [f32; 4]) -> f32 {
    let (u, v) = ((x - x0) / width, 1.0 - (y - y0) / height);
    if !(0.0..1.0).contains(&u) || !(0.0..1.0).contains(&v) {
        return 0.0;
    }
    let cell = u * letters.len() as f32;
    let (column, row) = ((cell - cell.floor()) * 6.0, v * 7.0);
    let bits = glyph(letters[(cell as usize).min(letters.len() - 1)])[(row as usize).min(6)];
    let lit = (column as u32) < 5 && bits >> (4 - column as u32) & 1 == 1;
    if lit { 1.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_wrap_and_keep_their_mean_over_the_levels() {
        let words = Tiles::get().words();
        assert_eq!(words.len(), COUNT * STRIDE);
        for tile in 0..COUNT {
            let base = tile * STRIDE;
            let mean = |level: usize| {
                let side = SIDE >> level;
                let from = base + offset(level);
                words[from..from + side * side].iter().map(|w| f64::from(w & 255)).sum::<f64>()
                    / (side * side) as f64
            };
            assert!((mean(0) - mean(LEVELS - 1)).abs() < 3.0, "tile {tile}");
            let (right, first) = (words[base + SIDE - 1], words[base]);
            assert_eq!(right >> 8 & 255, first & 255, "the right neighbour of the last texel is the first");
        }
    }

    #[test]
    fn patterns_have_contrast() {
        let words = Tiles::get().words();
        for tile in 1..COUNT {
            let values = words[tile * STRIDE..][..SIDE * SIDE].iter().map(|w| f64::from(w & 255));
            let (low, high) = values.fold((255.0, 0.0), |(l, h): (f64, f64), v| (l.min(v), h.max(v)));
            assert!(high - low > 60.0, "tile {tile}: {low} to {high}");
        }
    }
}
