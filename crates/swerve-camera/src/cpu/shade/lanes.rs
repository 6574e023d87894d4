//! Eight pixels at a time: numbers, vectors, and the triangles they show.

use wide::{f32x4, f32x8};

use crate::cpu::id::NONE;

pub(super) type F = f32x8;
pub(super) type V = [F; 3];

pub(super) fn splat(x: f32) -> F {
    F::splat(x)
}

pub(super) fn splat3(v: [f32; 3]) -> V {
    v.map(F::splat)
}

pub(super) fn dot8(a: V, b: V) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn clamp01(x: F) -> F {
    x.fast_max(F::ZERO).fast_min(F::ONE)
}

pub(super) fn mix8(a: V, b: V, t: F) -> V {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
}

/// Planes and parameters of the triangles and surfaces of eight pixels.
pub(super) struct Lanes {
    pub(super) planes: [F; 20],
    pub(super) numbers: [F; 16],
    pub(super) texture: [u32; 8],
    /// Union of the flags.
    pub(super) flags: u32,
    /// True if all have the same texture and similar mip levels.
    pub(super) same: bool,
}

impl Lanes {
    /// Value of a plane, by its index.
    pub(super) fn at(&self, plane: usize, x: F, y: F) -> F {
        let p = &self.planes[3 * plane..3 * plane + 3];
        p[0] * x + (p[1] * y + p[2])
    }

    pub(super) fn colour(&self, slot: usize) -> V {
        [self.numbers[slot], self.numbers[slot + 1], self.numbers[slot + 2]]
    }

    pub(super) fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }
}

/// Transposes eight rows into columns of eight.
pub(super) fn columns<const N: usize>(rows: [&[f32; N]; 8]) -> [F; N] {
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

pub(super) fn splats<const N: usize>(numbers: &[f32; N]) -> [F; N] {
    let mut out = [F::ZERO; N];
    for (out, number) in out.iter_mut().zip(numbers) {
        *out = F::splat(*number);
    }
    out
}

/// Lanes of the triangle that filled the last eight pixels, for reuse in the next eight.
pub(in crate::cpu) struct TriangleCache {
    pub(super) id: u32,
    pub(super) lanes: Lanes,
}

impl TriangleCache {
    /// Empty cache.
    pub(in crate::cpu) fn new() -> Self {
        let lanes =
            Lanes { planes: [F::ZERO; 20], numbers: [F::ZERO; 16], texture: [0; 8], flags: 0, same: true };
        Self { id: NONE, lanes }
    }
}
