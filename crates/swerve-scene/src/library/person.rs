//! People built from limbs, with a walk cycle.

use super::PHASES;
use crate::SemanticClass;
use crate::hash::Draws;
use crate::material::{Material, Texture};
use crate::mesh::{Mesh, MeshBuilder, Placed};
use crate::vector::{add, dot, mix, normalized, scale, sub};

/// Materials of a person: tints 0 to 3 are top, trousers, skin and hair.
#[derive(Clone, Copy)]
struct Clothes {
    top: u16,
    trousers: u16,
    skin: u16,
    hair: u16,
    shoes: u16,
}

impl Clothes {
    fn new(builder: &mut MeshBuilder, class: Option<SemanticClass>) -> Self {
        let mut add = |material: Material| builder.material(Material { class, ..material });
        let cloth = Material::matt([1.0; 3], 0.4).textured(Texture::Cloth, [0.72; 3], 0.5);
        Self {
            top: add(cloth.tinted(0)),
            trousers: add(cloth.tinted(1)),
            skin: add(Material::matt([1.0; 3], 0.5).tinted(2).glossy(0.6, 0.03)),
            hair: add(Material::matt([1.0; 3], 0.2).tinted(3)),
            shoes: add(Material::matt([0.03, 0.028, 0.026], 0.1)),
        }
    }
}

/// Position of a joint that bends towards +x (`towards` = 1) or -x between two points with given limb lengths.
fn joint(from: [f32; 3], to: [f32; 3], upper: f32, lower: f32, towards: [f32; 3]) -> [f32; 3] {
    let span = sub(to, from);
    let distance = dot(span, span).sqrt().min(0.999 * (upper + lower));
    let along = normalized(span);
    let a = (upper * upper - lower * lower + distance * distance) / (2.0 * distance);
    let out = (upper * upper - a * a).max(0.0).sqrt();
    let across = sub(towards, scale(along, dot(towards, along)));
    add(add(from, scale(along, a)), scale(normalized(across), out))
}

/// A person who walks (at a phase) or stands, scaled to the height of the bounding box.
pub(super) fn pedestrian([_, _, height]: [f32; 3], phase: Option<u8>, draws: &mut Draws) -> Mesh {
    let mut builder = MeshBuilder::new(60.0);
    let clothes = Clothes::new(&mut builder, None);
    let scale_by = height / 1.72;
    let build = draws.between(0.92, 1.18);
    let skirt = draws.chance(0.25);
    let bag = draws.chance(0.4);
    let colour = draws.one_of(&[
        [0.03, 0.03, 0.035],
        [0.20, 0.03, 0.03],
        [0.03, 0.05, 0.13],
        [0.16, 0.15, 0.12],
        [0.05, 0.10, 0.05],
    ]);
    let angle = phase.map(|p| core::f32::consts::TAU * f32::from(p) / f32::from(PHASES));
    let m = |x: f32| x * scale_by;
    let hip_z = m(0.90) - angle.map_or(0.0, |a| m(0.02) * libm::cosf(2.0 * a).abs());
    for (side, shift) in [(1.0_f32, 0.0), (-1.0, core::f32::consts::PI)] {
        let swing = angle.map(|a| a + shift);
        let hip = [0.0, side * m(0.085 * build), hip_z];
        // The foot moves back on the ground for half the cycle and swings forward above it for the other half.
        let (x, lift) = swing
            .map_or((side * 0.02, 0.0), |a| (m(0.31) * libm::cosf(a), m(0.10) * libm::sinf(-a).max(0.0)));
        let ankle = [x, side * m(0.09 * build), m(0.085) + lift];
        let knee = joint(hip, ankle, m(0.43), m(0.42), [1.0, 0.0, 0.0]);
        let cloth = if skirt { clothes.skin } else { clothes.trousers };
        builder.limb(cloth, (hip, m(0.082 * build)), (knee, m(0.06)), 8);
        builder.limb(cloth, (knee, m(0.058)), (ankle, m(0.042)), 8);
        let pitch = if lift > 0.0 { m(0.05) } else { 0.0 };
        let toe = [ankle[0] + m(0.15), ankle[1], m(0.045) + 0.6 * lift - pitch.min(lift)];
        builder.limb(
            clothes.shoes,
            ([ankle[0] - m(0.03), ankle[1], toe[2].max(m(0.045) + lift * 0.8)], m(0.045)),
            (toe, m(0.04)),
            6,
        );
        let shoulder = [0.0, side * m(0.168 * build), m(1.35)];
        let reach = swing.map_or(0.04, |a| -0.26 * libm::cosf(a));
        let hand = [m(reach + 0.05), side * m(0.25 * build), m(0.84 + 0.25 * reach * reach)];
        let elbow = joint(shoulder, hand, m(0.29), m(0.28), [-1.0, 0.0, 0.0]);
        builder.limb(clothes.top, (shoulder, m(0.054 * build)), (elbow, m(0.045)), 8);
        builder.limb(clothes.top, (elbow, m(0.042)), (mix(elbow, hand, 0.85), m(0.034)), 8);
        builder.limb(clothes.skin, (mix(elbow, hand, 0.9), m(0.034)), (hand, m(0.038)), 6);
    }
    torso(&mut builder, clothes, [0.0, 0.0, hip_z], [m(0.015), 0.0, m(1.40)], build * scale_by);
    if skirt {
        builder.place = Placed::at([0.0, 0.0, hip_z]);
        builder.cone(clothes.trousers, (m(-0.42), m(0.21)), (m(0.04), m(0.15)), 10, false);
        builder.place = Placed::HERE;
    }
    if bag {
        let bag = Material::matt(colour, 0.3).textured(Texture::Cloth, colour.map(|c| 0.6 * c), 0.4);
        let bag = builder.material(bag);
        builder.cuboid(bag, [m(-0.23), m(-0.13), m(0.98)], [m(-0.10), m(0.13), m(1.33)]);
    }
    head(&mut builder, clothes, [m(0.03), 0.0, height - m(0.125)], scale_by);
    builder.fit([0.0, 0.0, height]);
    builder.finish()
}

/// Trunk from hips to neck.
fn torso(builder: &mut MeshBuilder, clothes: Clothes, hips: [f32; 3], neck: [f32; 3], size: f32) {
    let along = sub(neck, hips);
    let length = dot(along, along).sqrt();
    let saved = builder.place;
    // x of the local frame is across the shoulders.
    let up = normalized(along);
    let side = [0.0, 1.0, 0.0];
    builder.place = Placed { axes: [side, crate::vector::cross(up, side), up], origin: hips };
    let levels = [
        (-0.08, 0.155, 0.10),
        (0.0, 0.17, 0.115),
        (0.42, 0.155, 0.11),
        (0.82, 0.20, 0.125),
        (0.97, 0.185, 0.105),
        (1.04, 0.07, 0.065),
    ];
    let ring = crate::mesh::circle(12);
    for pair in levels.windows(2) {
        let material = if pair[1].0 <= 0.01 { clothes.trousers } else { clothes.top };
        for k in 0..12 {
            let p = |(t, a, b): (f32, f32, f32), k: usize| {
                let c = ring[k % 12];
                [c[0] * a * size, c[1] * b * size, t * length]
            };
            builder.quad(material, [p(pair[0], k), p(pair[0], k + 1), p(pair[1], k + 1), p(pair[1], k)]);
        }
    }
    builder.place = saved;
    builder.limb(
        clothes.skin,
        (mix(hips, neck, 0.98), 0.055 * size),
        (add(neck, [0.01, 0.0, 0.12 * size]), 0.05 * size),
        8,
    );
}

/// Head and hair; `centre` is the centre of the skull.
fn head(builder: &mut MeshBuilder, clothes: Clothes, centre: [f32; 3], size: f32) {
    let saved = builder.place;
    builder.place = Placed::at(centre);
    builder.ball(clothes.skin, [0.095 * size, 0.077 * size, 0.12 * size], 10, 7, |_, _| 1.0);
    builder.place = Placed::at(add(centre, [-0.014 * size, 0.0, 0.022 * size]));
    builder.ball(clothes.hair, [0.098 * size, 0.085 * size, 0.103 * size], 10, 6, |_, _| 1.0);
    builder.place = saved;
}

/// A rider posed by hips, handlebar and feet.
pub(super) fn rider(
    builder: &mut MeshBuilder,
    hip: [f32; 3],
    bar: [f32; 3],
    feet: [[f32; 3]; 2],
    height: f32,
) {
    let clothes = Clothes::new(builder, Some(SemanticClass::Rider));
    let size = height / 1.9;
    let neck = [hip[0] + 0.30 * size, 0.0, hip[2] + 0.48 * size];
    torso(builder, clothes, hip, neck, size);
    for (k, side) in [1.0_f32, -1.0].into_iter().enumerate() {
        let root = [hip[0], side * 0.09, hip[2] - 0.03];
        let ankle = [feet[k][0] - 0.05, feet[k][1], feet[k][2] + 0.09];
        let knee = joint(root, ankle, 0.44 * size, 0.44 * size, [1.0, 0.0, 0.4]);
        builder.limb(clothes.trousers, (root, 0.085 * size), (knee, 0.06 * size), 8);
        builder.limb(clothes.trousers, (knee, 0.056 * size), (ankle, 0.042 * size), 8);
        builder.limb(
            clothes.shoes,
            (ankle, 0.045),
            ([feet[k][0] + 0.09, feet[k][1], feet[k][2] + 0.03], 0.04),
            6,
        );
        let shoulder = [neck[0] - 0.03, side * 0.18 * size, neck[2] - 0.05];
        let hand = [bar[0], side * 0.24, bar[2] + 0.03];
        let elbow = joint(shoulder, hand, 0.29 * size, 0.29 * size, [-0.3, 0.6 * side, -1.0]);
        builder.limb(clothes.top, (shoulder, 0.058 * size), (elbow, 0.045 * size), 8);
        builder.limb(clothes.top, (elbow, 0.043 * size), (hand, 0.036 * size), 8);
    }
    let top = [neck[0] + 0.07 * size, 0.0, neck[2] + 0.19 * size];
    head(builder, clothes, top, size);
    let helmet = Material { class: Some(SemanticClass::Rider), ..Material::matt([0.75, 0.75, 0.72], 0.5) };
    let helmet = builder.material(helmet.glossy(0.3, 0.05));
    builder.place = Placed::at(add(top, [-0.005, 0.0, 0.035 * size]));
    builder.ball(helmet, [0.118 * size, 0.098 * size, 0.105 * size], 12, 6, |_, _| 1.0);
    builder.place = Placed::HERE;
}

/// Colours of clothes, skin and hair.
pub(super) fn clothes(draws: &mut Draws) -> [[f32; 3]; 4] {
    const CLOTH: [[f32; 3]; 12] = [
        [0.03, 0.03, 0.035],
        [0.06, 0.065, 0.075],
        [0.18, 0.18, 0.19],
        [0.55, 0.55, 0.52],
        [0.02, 0.04, 0.12],
        [0.07, 0.14, 0.30],
        [0.36, 0.03, 0.03],
        [0.08, 0.16, 0.07],
        [0.45, 0.33, 0.10],
        [0.20, 0.12, 0.07],
        [0.40, 0.16, 0.24],
        [0.10, 0.30, 0.30],
    ];
    const TROUSERS: [[f32; 3]; 6] = [
        [0.03, 0.03, 0.033],
        [0.035, 0.055, 0.11],
        [0.06, 0.085, 0.14],
        [0.14, 0.13, 0.12],
        [0.24, 0.19, 0.13],
        [0.08, 0.08, 0.08],
    ];
    const SKIN: [[f32; 3]; 5] = [
        [0.60, 0.40, 0.30],
        [0.50, 0.31, 0.22],
        [0.36, 0.20, 0.13],
        [0.20, 0.11, 0.07],
        [0.10, 0.055, 0.036],
    ];
    const HAIR: [[f32; 3]; 5] = [
        [0.012, 0.011, 0.011],
        [0.04, 0.022, 0.012],
        [0.10, 0.055, 0.025],
        [0.32, 0.22, 0.10],
        [0.34, 0.33, 0.32],
    ];
    [draws.one_of(&CLOTH), draws.one_of(&TROUSERS), draws.one_of(&SKIN), draws.one_of(&HAIR)]
}
