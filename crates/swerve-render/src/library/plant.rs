//! Trees and bushes: lumpy balls of leaves.

use crate::hash::{self, Draws};
use crate::material::{Material, Texture};
use crate::mesh::{Builder, Mesh, Placed};

fn leaf_material(builder: &mut Builder) -> u16 {
    let leaf = Material::matt([0.25, 0.28, 0.25], 0.5).textured(Texture::Foliage, [1.25, 1.25, 1.0], 1.7);
    builder.material(leaf.tinted(0))
}

/// A lumpy ball that stays within its radii.
fn clump(
    builder: &mut Builder,
    material: u16,
    centre: [f32; 3],
    radii: [f32; 3],
    detail: (u32, u32),
    salt: u32,
) {
    builder.place = Placed::at(centre);
    builder.ball(material, radii, detail, |row, k| {
        0.78 + 0.22 * hash::unit(hash::mix(salt ^ (row as u32 * 977) ^ (k as u32 * 131_071)))
    });
    builder.place = Placed::HERE;
}

/// Tree within an outline: the crown fills the upper part.
pub(super) fn tree(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, width, height] = outline;
    let mut builder = Builder::new(75.0);
    let leaf = leaf_material(&mut builder);
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
        (11, 8),
        draws.bits(),
    );
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
        clump(&mut builder, leaf, at, [size * a, size * b, 0.26 * crown], (8, 6), draws.bits());
    }
    builder.fit(outline);
    builder.finish()
}

/// Bush within an outline.
pub(super) fn bush(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, width, height] = outline;
    let mut builder = Builder::new(75.0);
    let leaf = leaf_material(&mut builder);
    let (a, b, c) = (0.5 * length, 0.5 * width, 0.5 * height);
    clump(&mut builder, leaf, [0.0, 0.0, c], [0.8 * a, 0.8 * b, c], (10, 7), draws.bits());
    for (x, y) in [(0.45, 0.3), (-0.4, 0.35), (-0.1, -0.45)] {
        clump(
            &mut builder,
            leaf,
            [x * a, y * b, 0.75 * c],
            [0.5 * a, 0.5 * b, 0.7 * c],
            (8, 6),
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
