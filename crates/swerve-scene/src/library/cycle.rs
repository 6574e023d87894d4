//! Two-wheelers with their riders.

use super::vehicle::BICYCLE;
use super::{PHASES, person};
use crate::SemanticClass;
use crate::hash::Draws;
use crate::look::lamps;
use crate::material::Material;
use crate::mesh::{Mesh, MeshBuilder, Placed};

/// A wheel across y: hub, tyre, and spokes as a few thin blades.
fn wheel(builder: &mut MeshBuilder, tyre: u16, spoke: u16, centre: [f32; 3], radius: f32, half_width: f32) {
    let saved = builder.place;
    builder.place = Placed { axes: [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]], origin: centre };
    let inner = radius - 2.2 * half_width;
    builder.cone(tyre, (-half_width, radius), (half_width, radius), 16, false);
    builder.cone(tyre, (half_width, inner), (-half_width, inner), 16, false);
    for (z, up) in [(half_width, true), (-half_width, false)] {
        let ring = crate::mesh::circle(16);
        for k in 0..16 {
            let (a, b) = (ring[k], ring[(k + 1) % 16]);
            let p = |c: [f32; 2], r: f32| [c[0] * r, c[1] * r, z];
            let q = [p(a, inner), p(a, radius), p(b, radius), p(b, inner)];
            builder.quad(tyre, if up { q } else { [q[3], q[2], q[1], q[0]] });
        }
    }
    for k in 0..5 {
        let (s, c) = libm::sincosf(core::f32::consts::PI * k as f32 / 5.0);
        builder.limb(spoke, ([-c * inner, -s * inner, 0.0], 0.006), ([c * inner, s * inner, 0.0], 0.006), 3);
    }
    builder.place = saved;
}

/// Bicycle and rider.
pub(super) fn cyclist(outline: [f32; 3], phase: u8) -> Mesh {
    let [length, _, height] = outline;
    let mut builder = MeshBuilder::new(50.0);
    let tyre = builder.material(Material::matt([0.02; 3], 0.05).with_class(BICYCLE));
    let steel = builder.material(Material::matt([0.35; 3], 0.3).glossy(0.4, 0.2).with_class(BICYCLE));
    let frame =
        builder.material(Material::matt([0.5, 0.06, 0.05], 0.4).glossy(0.3, 0.05).with_class(BICYCLE));
    let radius = 0.335_f32.min(0.25 * length);
    let axle = 0.5 * length - radius;
    let scale = height / 1.78;
    for x in [axle, -axle] {
        wheel(&mut builder, tyre, steel, [x, 0.0, radius], radius, 0.018);
    }
    let (crank, saddle, bar) =
        ([-0.08, 0.0, 0.29], [-0.26, 0.0, 0.93 * scale], [axle - 0.20, 0.0, 1.02 * scale]);
    let tubes = [
        ([-axle, 0.0, radius], crank),
        (crank, saddle),
        ([-axle, 0.0, radius], [-0.21, 0.0, 0.74]),
        ([-0.22, 0.0, 0.78], [axle - 0.24, 0.0, 0.86 * scale]),
        (crank, [axle - 0.22, 0.0, 0.74 * scale]),
        ([axle, 0.0, radius], bar),
    ];
    for (from, to) in tubes {
        builder.limb(frame, (from, 0.02), (to, 0.018), 6);
    }
    builder.limb(steel, ([bar[0], -0.26, bar[2]], 0.014), ([bar[0], 0.26, bar[2]], 0.014), 6);
    builder.cuboid(tyre, [saddle[0] - 0.14, -0.07, saddle[2]], [saddle[0] + 0.12, 0.07, saddle[2] + 0.05]);
    let angle = core::f32::consts::TAU * f32::from(phase) / f32::from(PHASES);
    let (s, c) = libm::sincosf(angle);
    let pedals =
        [[crank[0] + 0.17 * c, 0.11, crank[2] + 0.17 * s], [crank[0] - 0.17 * c, -0.11, crank[2] - 0.17 * s]];
    let hip = [saddle[0] + 0.02, 0.0, saddle[2] + 0.10];
    person::rider(&mut builder, hip, bar, pedals, height);
    builder.fit(outline);
    builder.finish()
}

/// Motorcycle and rider.
pub(super) fn motorcycle(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, _, height] = outline;
    let mut builder = MeshBuilder::new(45.0);
    let own = SemanticClass::Motorcycle;
    let tyre = builder.material(Material::matt([0.02; 3], 0.05).with_class(own));
    let steel = builder.material(Material::matt([0.3; 3], 0.3).glossy(0.3, 0.4).with_class(own));
    let paint = builder.material(Material::matt([1.0; 3], 0.4).tinted(0).glossy(0.2, 0.06).with_class(own));
    let head = Material::matt([0.8; 3], 0.5).glossy(0.1, 0.1).with_class(own);
    let head = builder.material(head.lit([7.0, 6.6, 5.8], Some(lamps::HEAD)));
    let tail = Material::matt([0.35, 0.015, 0.012], 0.6).with_class(own).retro_reflective();
    let tail = builder.material(tail.lit([2.0, 0.06, 0.04], Some(lamps::TAIL)));
    let radius = 0.31_f32.min(0.25 * length);
    let axle = 0.5 * length - radius;
    for x in [axle, -axle] {
        wheel(&mut builder, tyre, steel, [x, 0.0, radius], radius, 0.06);
    }
    let long = draws.between(0.9, 1.1);
    builder.place = Placed::at([0.02, 0.0, 0.48]);
    builder.ball(steel, [0.30, 0.17, 0.20], 10, 6, |_, _| 1.0);
    builder.place = Placed::at([0.16, 0.0, 0.82]);
    builder.ball(paint, [0.32 * long, 0.17, 0.15], 12, 6, |_, _| 1.0);
    builder.place = Placed::at([axle - 0.26, 0.0, 0.92]);
    builder.ball(paint, [0.17, 0.16, 0.20], 10, 6, |_, _| 1.0);
    builder.place = Placed::at([axle - 0.10, 0.0, 0.93]);
    builder.ball(head, [0.06, 0.09, 0.09], 10, 6, |_, _| 1.0);
    builder.place = Placed::HERE;
    builder.cuboid(tyre, [-0.62, -0.13, 0.74], [-0.05, 0.13, 0.83]);
    builder.cuboid(paint, [-axle - 0.06, -0.09, 0.70], [-0.45, 0.09, 0.80]);
    builder.cuboid(tail, [-axle - 0.09, -0.08, 0.70], [-axle - 0.05, 0.08, 0.78]);
    for y in [-0.08, 0.08] {
        builder.limb(steel, ([axle, y, radius], 0.03), ([axle - 0.28, y, 0.95], 0.03), 6);
        builder.limb(steel, ([-axle, y, radius], 0.03), ([-0.1, y, 0.42], 0.03), 6);
        builder.limb(steel, ([-axle - 0.1, 1.6 * y, 0.36], 0.045), ([0.1, 1.6 * y, 0.30], 0.03), 6);
    }
    let bar = [axle - 0.33, 0.0, 1.02];
    builder.limb(steel, ([bar[0], -0.36, bar[2]], 0.017), ([bar[0], 0.36, bar[2]], 0.017), 6);
    let pegs = [[-0.10, 0.2, 0.36], [-0.10, -0.2, 0.36]];
    person::rider(&mut builder, [-0.30, 0.0, 0.92], bar, pegs, height * 1.08);
    builder.fit(outline);
    builder.finish()
}
