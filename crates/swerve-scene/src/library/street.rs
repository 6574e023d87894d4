//! Street furniture: lamps, lights, signs, rails, bins.

use crate::SemanticClass;
use crate::look::lamps;
use crate::material::{Material, Texture};
use crate::mesh::{Mesh, MeshBuilder, Placed};

fn steel(builder: &mut MeshBuilder) -> u16 {
    builder
        .material(Material::matt([0.28, 0.29, 0.29], 0.35).glossy(0.5, 0.15).with_class(SemanticClass::Pole))
}

/// Street lamp: pole at the rear end of the bounding box, arm along +x.
pub(super) fn street_lamp([length, _, height]: [f32; 3]) -> Mesh {
    let mut builder = MeshBuilder::new(40.0);
    let pole = builder.material(Material::matt([0.09, 0.11, 0.10], 0.25).glossy(0.5, 0.06));
    let glow = Material::matt([0.6, 0.6, 0.58], 0.4).lit([9.0, 7.2, 4.6], Some(lamps::NIGHT));
    let glow = builder.material(glow);
    let foot = -0.5 * length + 0.1;
    builder.place = Placed::at([foot, 0.0, 0.0]);
    builder.cone(pole, (0.0, 0.11), (0.9, 0.10), 10, false);
    builder.cone(pole, (0.9, 0.075), (height - 0.4, 0.05), 10, false);
    builder.place = Placed::HERE;
    builder.limb(pole, ([foot, 0.0, height - 0.4], 0.05), ([foot + 0.6, 0.0, height - 0.05], 0.04), 8);
    let tip = 0.5 * length;
    builder.limb(pole, ([foot + 0.6, 0.0, height - 0.05], 0.04), ([tip - 0.6, 0.0, height - 0.04], 0.035), 8);
    builder.cuboid(pole, [tip - 0.7, -0.14, height - 0.12], [tip, 0.14, height]);
    builder.cuboid(glow, [tip - 0.66, -0.11, height - 0.15], [tip - 0.04, 0.11, height - 0.12]);
    builder.finish()
}

/// Bare pole.
pub(super) fn pole([length, _, height]: [f32; 3]) -> Mesh {
    let mut builder = MeshBuilder::new(40.0);
    let steel = steel(&mut builder);
    builder.cone(steel, (0.0, 0.5 * length), (height, 0.4 * length), 10, true);
    builder.finish()
}

/// Traffic light: three lamps that face +x, with a hood over each.
pub(super) fn traffic_light([_, width, height]: [f32; 3]) -> Mesh {
    let mut builder = MeshBuilder::new(40.0);
    let steel = steel(&mut builder);
    let black = builder.material(Material::matt([0.02, 0.022, 0.022], 0.1).glossy(0.6, 0.04));
    let white = Material::matt([0.55; 3], 0.7).retro_reflective();
    let white = builder.material(white);
    let top = height;
    let head = 1.0_f32.min(0.35 * height);
    let half = (0.5 * width - 0.03).clamp(0.1, 0.17);
    builder.cone(steel, (0.0, 0.07), (top - 0.5 * head, 0.055), 10, false);
    builder.cuboid(white, [0.02, -half - 0.03, top - head - 0.03], [0.05, half + 0.03, top]);
    builder.cuboid(black, [0.0, -half, top - head], [0.16, half, top - 0.03]);
    let colours = [
        (lamps::RED, [0.30, 0.02, 0.015], [2.2, 0.05, 0.03]),
        (lamps::YELLOW, [0.30, 0.19, 0.01], [2.2, 1.1, 0.03]),
        (lamps::GREEN, [0.02, 0.19, 0.10], [0.04, 1.9, 0.45]),
    ];
    let radius = (0.14 * head).min(0.8 * half);
    for (k, (lamp, dark, bright)) in colours.into_iter().enumerate() {
        let lens = builder
            .material(Material::matt(dark.map(|c| 0.35 * c), 0.3).glossy(0.2, 0.06).lit(bright, Some(lamp)));
        let z = top - 0.03 - head * (k as f32 + 0.5) * 0.323;
        builder.place =
            Placed { axes: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], origin: [0.0, 0.0, z] };
        builder.disc(lens, 0.165, radius, 16, true);
        builder.place = Placed::HERE;
        builder.cuboid(black, [0.16, -radius, z + radius], [0.16 + 0.16, radius, z + radius + 0.015]);
        builder.cuboid(black, [0.16, -radius - 0.015, z], [0.28, -radius, z + radius]);
        builder.cuboid(black, [0.16, radius, z], [0.28, radius + 0.015, z + radius]);
    }
    builder.finish()
}

/// A post with a plate of `sides` corners that faces +x; `face` and `rim` are its materials.
fn sign([length, width, height]: [f32; 3], sides: u32, face: Material, rim: Material) -> Mesh {
    let mut builder = MeshBuilder::new(40.0);
    let steel = steel(&mut builder);
    let back = builder.material(Material::matt([0.3; 3], 0.4).glossy(0.5, 0.1));
    let (face, rim) = (builder.material(face), builder.material(rim));
    let x = (0.5 * length).max(0.03);
    builder.cone(steel, (0.0, 0.03), (height - 0.2 * width, 0.03), 8, true);
    let plate = Plate::new(sides, width);
    let (s, c) = libm::sincosf(plate.turn_rad);
    let turned =
        if plate.turn_rad == 0.0 { [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] } else { [[0.0, c, s], [0.0, -s, c]] };
    let (z, reach) = (height - plate.above, plate.reach);
    builder.place = Placed { axes: [turned[0], turned[1], [1.0, 0.0, 0.0]], origin: [0.0, 0.0, z] };
    builder.cone(back, (x - 0.012, reach), (x - 0.002, reach), sides, false);
    builder.disc(back, x - 0.012, reach, sides, false);
    builder.disc(rim, x - 0.002, reach, sides, true);
    builder.place = Placed::at([0.0, 0.0, z]);
    face_of(&mut builder, face, x, plate.face * reach, plate.turn_rad, sides);
    builder.finish()
}

/// Outline of a sign's plate.
struct Plate {
    /// Angle of its first corner from the horizontal, radians.
    turn_rad: f32,
    /// Distance of its corners from the middle, and of its upper end above the middle, metres.
    reach: f32,
    above: f32,
    /// Share of the face without the rim.
    face: f32,
}

impl Plate {
    fn new(sides: u32, width: f32) -> Self {
        let radius = 0.5 * width;
        match sides {
            // On a corner.
            3 => {
                let reach = width / 3.0_f32.sqrt();
                Self { turn_rad: -core::f32::consts::FRAC_PI_2, reach, above: 0.5 * reach, face: 0.66 }
            }
            // With corners turned by half a step an octagon has a horizontal lower edge; its flat sides touch the
            // bounding box.
            8 => {
                let turn_rad = core::f32::consts::PI / 8.0;
                Self { turn_rad, reach: radius / libm::sincosf(turn_rad).1, above: radius, face: 0.90 }
            }
            _ => Self { turn_rad: 0.0, reach: radius, above: radius, face: 0.90 },
        }
    }
}

/// Printed face, with texture coordinates 0 to 1 upright over its square.
fn face_of(builder: &mut MeshBuilder, material: u16, x: f32, reach: f32, turn_rad: f32, sides: u32) {
    let corner = |k: u32| {
        let (s, c) = libm::sincosf(turn_rad + core::f32::consts::TAU * k as f32 / sides as f32);
        ([x, reach * c, reach * s], [0.5 + 0.5 * c, 0.5 + 0.5 * s])
    };
    for k in 0..sides {
        let ((a, uv_a), (b, uv_b)) = (corner(k), corner(k + 1));
        builder.triangle(material, [[x, 0.0, 0.0], a, b], [[0.5, 0.5], uv_a, uv_b]);
    }
}

/// Stop sign.
pub(super) fn stop_sign(outline: [f32; 3]) -> Mesh {
    let red = Material::matt([0.42, 0.012, 0.016], 0.8).textured(Texture::Stop, [0.72, 0.72, 0.70], 1.0);
    let white = Material::matt([0.72, 0.72, 0.70], 0.9);
    sign(outline, 8, red.retro_reflective(), white.retro_reflective())
}

/// Sign to give way: a triangle on its tip.
pub(super) fn yield_sign(outline: [f32; 3]) -> Mesh {
    let white = Material::matt([0.72, 0.72, 0.70], 0.9);
    let red = Material::matt([0.5, 0.016, 0.02], 0.8);
    sign(outline, 3, white.retro_reflective(), red.retro_reflective())
}

/// Speed limit: the nearest of 30, 50 and 80.
pub(super) fn speed_sign(outline: [f32; 3], kmh: u8) -> Mesh {
    let texture = match kmh {
        0..=40 => Texture::Limit30,
        41..=65 => Texture::Limit50,
        _ => Texture::Limit80,
    };
    let white = Material::matt([0.72, 0.72, 0.70], 0.9).textured(texture, [0.02, 0.02, 0.02], 1.0);
    let red = Material::matt([0.5, 0.016, 0.02], 0.8);
    sign(outline, 24, white.retro_reflective(), red.retro_reflective())
}

/// Guard rail along x: a W-shaped band on posts; its face is towards -y.
pub(super) fn guard_rail([length, width, height]: [f32; 3]) -> Mesh {
    let mut builder = MeshBuilder::new(25.0);
    let zinc = Material { is_two_sided: true, ..Material::matt([0.36, 0.37, 0.38], 0.45) };
    let zinc = builder.material(zinc.textured(Texture::Plaster, [0.28, 0.28, 0.29], 3.0).glossy(0.4, 0.35));
    let half = 0.5 * length;
    let (face, depth) = (-0.5 * width, 0.08);
    let band = 0.31;
    let profile =
        [(depth, 0.0), (0.0, 0.22), (0.0, 0.32), (depth, 0.5), (0.0, 0.68), (0.0, 0.78), (depth, 1.0)];
    for pair in profile.windows(2) {
        let p = |x: f32, (y, z): (f32, f32)| [x, face + y, height - band + band * z];
        builder.quad(zinc, [p(-half, pair[0]), p(half, pair[0]), p(half, pair[1]), p(-half, pair[1])]);
    }
    let posts = (length / 2.0).ceil().max(1.0) as usize;
    for k in 0..posts {
        let x = -half + length * (k as f32 + 0.5) / posts as f32;
        builder.cuboid(zinc, [x - 0.03, face + depth, 0.0], [x + 0.03, 0.5 * width, height - 0.05]);
    }
    builder.finish()
}

/// Litter bin.
pub(super) fn bin([length, _, height]: [f32; 3]) -> Mesh {
    let mut builder = MeshBuilder::new(40.0);
    let green =
        Material::matt([0.03, 0.075, 0.05], 0.25).textured(Texture::Corrugated, [0.02, 0.05, 0.035], 0.3);
    let green = builder.material(green.glossy(0.5, 0.04));
    let lid = builder.material(Material::matt([0.05; 3], 0.2));
    let radius = 0.5 * length;
    builder.cone(green, (0.0, 0.82 * radius), (0.85 * height, radius), 14, false);
    builder.cone(lid, (0.85 * height, radius), (height, 0.45 * radius), 14, true);
    builder.finish()
}

/// Box for an object of which only the size is known.
pub(super) fn block([length, width, height]: [f32; 3]) -> Mesh {
    let mut builder = MeshBuilder::new(20.0);
    let grey = Material::matt([0.35, 0.33, 0.30], 0.4).textured(Texture::Slabs, [0.22, 0.21, 0.19], 1.0);
    let grey = builder.material(grey);
    let (x, y) = (0.5 * length, 0.5 * width);
    builder.cuboid(grey, [-x, -y, 0.0], [x, y, height]);
    builder.finish()
}
