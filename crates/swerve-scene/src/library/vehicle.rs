//! Cars, trucks and buses: common materials, parts and colours.

mod bus;
mod car;
mod profile;
mod truck;

pub(super) use bus::bus;
pub(super) use car::car;
pub(super) use truck::box_truck;

use crate::SemanticClass;
use crate::hash::Draws;
use crate::look::lamps;
use crate::material::{Material, Texture};
use crate::mesh::{MeshBuilder, Placed};

/// Materials of vehicles.
struct Parts {
    paint: u16,
    trim: u16,
    glass: u16,
    tyre: u16,
    rim: u16,
    arch: u16,
    head: u16,
    tail: u16,
    brake: u16,
    left: u16,
    right: u16,
    plate: u16,
    chrome: u16,
}

impl Parts {
    fn new(builder: &mut MeshBuilder) -> Self {
        let mut add = |material: Material| builder.material(material);
        let plate = Material::matt([0.7, 0.7, 0.68], 0.8).textured(Texture::Plate, [0.02, 0.02, 0.03], 1.0);
        let amber = Material::matt([0.6, 0.25, 0.03], 0.4).glossy(0.3, 0.06);
        let red = Material::matt([0.35, 0.015, 0.012], 0.6).glossy(0.25, 0.08);
        Self {
            paint: add(Material::matt([1.0; 3], 0.45).tinted(0).glossy(0.25, 0.05)),
            trim: add(Material::matt([0.025, 0.025, 0.027], 0.08).glossy(0.7, 0.03)),
            glass: add(Material::matt([0.012, 0.014, 0.016], 0.03).glossy(0.05, 0.09)),
            tyre: add(Material::matt([0.022, 0.022, 0.022], 0.05)),
            rim: add(Material::matt([0.38, 0.38, 0.4], 0.4).glossy(0.35, 0.3)),
            arch: add(Material::matt([0.008, 0.008, 0.008], 0.04)),
            head: add(Material::matt([0.75, 0.77, 0.8], 0.5)
                .glossy(0.1, 0.12)
                .lit([7.0, 6.6, 5.8], Some(lamps::HEAD))),
            tail: add(red.lit([0.5, 0.012, 0.008], Some(lamps::TAIL)).retro_reflective()),
            brake: add(red.lit([1.6, 0.03, 0.02], Some(lamps::BRAKE)).retro_reflective()),
            left: add(amber.lit([1.8, 0.7, 0.02], Some(lamps::LEFT))),
            right: add(amber.lit([1.8, 0.7, 0.02], Some(lamps::RIGHT))),
            plate: add(plate.retro_reflective()),
            chrome: add(Material::matt([0.5, 0.5, 0.52], 0.5).glossy(0.15, 0.55)),
        }
    }
}

/// A rectangle that faces forwards or backwards, by the sign of `x`.
fn panel(builder: &mut MeshBuilder, material: u16, x: f32, (y0, y1): (f32, f32), (z0, z1): (f32, f32)) {
    let ahead = x > 0.0;
    let p = [[x, y0, z0], [x, y1, z0], [x, y1, z1], [x, y0, z1]];
    let p = if ahead { p } else { [p[1], p[0], p[3], p[2]] };
    builder.quad_uv(material, p, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
}

/// A dark fan around a point of the left or right side, open below.
fn opening(builder: &mut MeshBuilder, parts: &Parts, centre: [f32; 3], radius: f32) {
    let steps = 12;
    let point = |k: usize| {
        let (s, c) = libm::sincosf(core::f32::consts::PI * (1.3 * k as f32 / steps as f32 - 0.15));
        [centre[0] + radius * c, centre[1], centre[2] + radius * s]
    };
    for k in 0..steps {
        let (a, b) = if centre[1] > 0.0 { (point(k + 1), point(k)) } else { (point(k), point(k + 1)) };
        builder.triangle(parts.arch, [centre, a, b], [[0.0; 2]; 3]);
    }
}

/// A wheel with its outer face at the given point.
fn wheel_at(builder: &mut MeshBuilder, parts: &Parts, outer: [f32; 3], radius: f32, width: f32) {
    let saved = builder.place;
    let side = if outer[1] > 0.0 { 1.0 } else { -1.0 };
    // z of the wheel's frame points outwards.
    builder.place = Placed { axes: [[1.0, 0.0, 0.0], [0.0, 0.0, -side], [0.0, side, 0.0]], origin: outer };
    builder.cone(parts.tyre, (-width, radius), (-0.004, radius), 20, false);
    builder.disc(parts.tyre, -0.004, radius, 20, true);
    builder.disc(parts.tyre, -width, radius, 20, false);
    builder.disc(parts.rim, -0.002, 0.68 * radius, 14, true);
    // Five gaps between the spokes.
    for k in 0..5 {
        let angle = core::f32::consts::TAU * k as f32 / 5.0;
        let p = |r: f32, a: f32| {
            let (s, c) = libm::sincosf(a);
            [r * radius * c, r * radius * s, 0.0]
        };
        let gap = [p(0.22, angle), p(0.58, angle - 0.36), p(0.62, angle), p(0.58, angle + 0.36)];
        builder.quad(parts.arch, gap);
    }
    builder.place = saved;
}

/// Tail, brake and indicator lamps of a tall vehicle.
fn rear_lamps(builder: &mut MeshBuilder, parts: &Parts, x: f32, half: f32, z: (f32, f32)) {
    for side in [1.0_f32, -1.0] {
        let turn = if side > 0.0 { parts.left } else { parts.right };
        for (k, material) in [parts.tail, parts.brake, turn].into_iter().enumerate() {
            let inner = half - 0.62 + 0.16 * k as f32;
            let (y0, y1) = (side * inner, side * (inner + 0.15));
            builder.cuboid(material, [x, y0.min(y1), z.0], [x + 0.06, y0.max(y1), z.1]);
        }
    }
}

/// Colours of private cars, with realistic frequencies.
pub(super) fn paint(draws: &mut Draws) -> [[f32; 3]; 4] {
    const COLOURS: [[f32; 3]; 12] = [
        [0.62, 0.62, 0.60],
        [0.58, 0.58, 0.58],
        [0.012, 0.012, 0.013],
        [0.02, 0.021, 0.024],
        [0.30, 0.31, 0.33],
        [0.10, 0.105, 0.115],
        [0.03, 0.06, 0.20],
        [0.02, 0.03, 0.09],
        [0.34, 0.018, 0.016],
        [0.16, 0.012, 0.014],
        [0.04, 0.12, 0.07],
        [0.42, 0.36, 0.25],
    ];
    let base = draws.one_of(&COLOURS);
    let shade = draws.between(0.85, 1.15);
    let second = draws.one_of(&COLOURS);
    [base.map(|c| c * shade), second, [draws.between(0.02, 0.5); 3], [0.05; 3]]
}

/// Colours of vans, trucks and buses: mostly white, some in company colours.
pub(super) fn fleet_paint(draws: &mut Draws) -> [[f32; 3]; 4] {
    const COLOURS: [[f32; 3]; 6] = [
        [0.66, 0.66, 0.64],
        [0.66, 0.66, 0.64],
        [0.60, 0.38, 0.03],
        [0.42, 0.03, 0.03],
        [0.05, 0.13, 0.33],
        [0.06, 0.22, 0.10],
    ];
    let cab = draws.one_of(&COLOURS);
    let load = if draws.chance(0.6) { [0.95; 3] } else { draws.one_of(&COLOURS) };
    [cab, load, [0.3; 3], [0.05; 3]]
}

/// Class of the wheels and frames of two-wheelers.
pub(super) const BICYCLE: SemanticClass = SemanticClass::Bicycle;
