//! Trees and bushes: lumpy balls of leaves.

use crate::hash::{self, Draws};
use crate::material::{Material, Texture};
use crate::mesh::{Mesh, MeshBuilder, Placed};

fn leaf_material(builder: &mut MeshBuilder) -> u16 {
    builder.material(leaf_of())
}

fn leaf_of() -> Material {
    Material::matt([0.38, 0.42, 0.36], 0.5).textured(Texture::Foliage, [1.25, 1.25, 1.0], 1.7).tinted(0)
}

/// A lumpy ball within its radii.
fn clump(
    builder: &mut MeshBuilder,
    material: u16,
    centre: [f32; 3],
    radii: [f32; 3],
    [sides, rows]: [u32; 2],
    salt: u32,
) {
    builder.place = Placed::at(centre);
    builder.ball(material, radii, sides, rows, |row, k| {
        0.78 + 0.22 * hash::unit(hash::mix(salt ^ (row as u32 * 977) ^ (k as u32 * 131_071)))
    });
    builder.place = Placed::HERE;
}

/// Bunches of leaves that break the outline of a clump.
fn sprigs(
    builder: &mut MeshBuilder,
    material: u16,
    centre: [f32; 3],
    radii: [f32; 3],
    draws: &mut Draws,
    count: usize,
) {
    for _ in 0..count {
        let (s, c) = libm::sincosf(draws.between(0.0, core::f32::consts::TAU));
        let up = draws.between(-0.8, 1.0);
        let flat = (1.0 - up * up).max(0.0).sqrt();
        let out = [flat * c, flat * s, up];
        let grow = draws.between(0.86, 0.97);
        let root = [0, 1, 2].map(|k| centre[k] + out[k] * radii[k] * grow);
        let size = 0.13 * (radii[0] + radii[2]);
        let mut tip = || [0, 1, 2].map(|k| root[k] + size * (0.5 * out[k] + draws.between(-0.7, 0.7)));
        let (a, b) = (tip(), tip());
        let uv = [[root[0] + root[2], root[1]], [a[0] + a[2], a[1]], [b[0] + b[2], b[1]]];
        builder.triangle(material, [root, a, b], uv);
    }
}

/// Tree within a bounding box: the crown fills the upper part.
pub(super) fn tree(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, width, height] = outline;
    let mut builder = MeshBuilder::new(75.0);
    let leaf = leaf_material(&mut builder);
    let sprig = builder.material(Material { is_two_sided: true, ..leaf_of() });
    let bark = Material::matt([0.09, 0.065, 0.045], 0.3).textured(Texture::Bark, [0.17, 0.13, 0.10], 0.8);
    let bark = builder.material(bark);
    let trunk = draws.between(0.26, 0.34) * height;
    let radius = 0.028 * height;
    builder.cone(bark, (0.0, 1.25 * radius), (0.3, radius), 9, false);
    builder.cone(bark, (0.3, radius), (trunk + 0.15 * height, 0.7 * radius), 9, false);
    let (a, b) = (0.5 * length, 0.5 * width);
    let crown = height - trunk;
    let middle = trunk + 0.5 * crown;
    clump(
        &mut builder,
        leaf,
        [0.0, 0.0, middle + 0.08 * crown],
        [0.72 * a, 0.72 * b, 0.42 * crown],
        [11, 8],
        draws.bits(),
    );
    let top = [0.72 * a, 0.72 * b, 0.42 * crown];
    sprigs(&mut builder, sprig, [0.0, 0.0, middle + 0.08 * crown], top, draws, 36);
    let lumps = 6;
    for k in 0..lumps {
        let turn = core::f32::consts::TAU * (k as f32 + draws.between(-0.3, 0.3)) / lumps as f32;
        let (s, c) = libm::sincosf(turn);
        let out = draws.between(0.50, 0.58);
        let up = draws.between(-0.22, 0.24) * crown;
        let size = draws.between(0.34, 0.42);
        let at = [out * a * c, out * b * s, middle + up];
        builder.limb(
            bark,
            ([0.0, 0.0, trunk * 0.9], 0.5 * radius),
            ([0.6 * at[0], 0.6 * at[1], at[2]], 0.25 * radius),
            5,
        );
        let radii = [size * a, size * b, 0.26 * crown];
        clump(&mut builder, leaf, at, radii, [8, 6], draws.bits());
        sprigs(&mut builder, sprig, at, radii, draws, 30);
    }
    builder.fit(outline);
    builder.finish()
}

/// Bush within a bounding box.
pub(super) fn bush(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, width, height] = outline;
    let mut builder = MeshBuilder::new(75.0);
    let leaf = leaf_material(&mut builder);
    let (a, b, c) = (0.5 * length, 0.5 * width, 0.5 * height);
    clump(&mut builder, leaf, [0.0, 0.0, c], [0.8 * a, 0.8 * b, c], [10, 7], draws.bits());
    for (x, y) in [(0.45, 0.3), (-0.4, 0.35), (-0.1, -0.45)] {
        clump(
            &mut builder,
            leaf,
            [x * a, y * b, 0.75 * c],
            [0.5 * a, 0.5 * b, 0.7 * c],
            [8, 6],
            draws.bits(),
        );
    }
    builder.fit(outline);
    builder.finish()
}

/// Greens, some of them autumnal.
pub(super) fn leaves(draws: &mut Draws) -> [[f32; 3]; 4] {
    let green = draws.between(0.16, 0.26);
    let warm = if draws.chance(0.15) { draws.between(0.8, 1.3) } else { draws.between(0.45, 0.72) };
    [[green * warm, green, green * draws.between(0.16, 0.34)], [1.0; 3], [1.0; 3], [1.0; 3]]
}
