//! Buses built from boxes.

use super::{Parts, opening, panel, rear_lamps, wheel_at};
use crate::hash::Draws;
use crate::material::Material;
use crate::mesh::{Mesh, MeshBuilder};

/// Clearance between walls and bounding box on each side, metres, filled by the wheels.
const INSET_M: f32 = 0.012;

/// City bus.
pub(in crate::library) fn bus(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, width, height] = outline;
    let mut builder = MeshBuilder::new(25.0);
    let parts = Parts::new(&mut builder);
    let (front, half, floor) = (0.5 * length, 0.5 * width - INSET_M, 0.32);
    let (belt, head) = (0.40 * height, 0.86 * height);
    let second = builder.material(Material::matt([0.9; 3], 0.5).tinted(1).glossy(0.25, 0.05));
    // Body in bands: lower, windows, upper.
    builder.cuboid(parts.paint, [-front, -half, floor], [front - 0.012, half, belt]);
    builder.cuboid(second, [-front, -half, head], [front - 0.05, half, height - 0.14]);
    builder.cuboid(second, [-front + 1.0, -0.7 * half, height - 0.14], [0.3 * front, 0.7 * half, height]);
    builder.cuboid(parts.glass, [-front + 0.01, -half + 0.015, belt], [front - 0.04, half - 0.015, head]);
    let bays = (length / 1.45).round().max(3.0) as usize;
    for k in 0..=bays {
        let x = -front + (length - 0.1) * k as f32 / bays as f32;
        for y in [-half, half - 0.02] {
            let wide: f32 = if k == 0 || k == bays { 0.1 } else { 0.045 };
            builder.cuboid(
                parts.paint,
                [x - wide.min(x + front), y, belt],
                [(x + wide).min(front - 0.045), y + 0.02, head],
            );
        }
    }
    // Doors on the right side: glass down to the step.
    for t in [0.06, 0.46 + draws.between(-0.03, 0.03)] {
        let x = front - t * length;
        builder.cuboid(parts.glass, [x - 1.15, -half - 0.006, floor + 0.08], [x, -half + 0.05, head - 0.05]);
        builder.cuboid(
            parts.trim,
            [x - 0.6, -half - 0.01, floor + 0.08],
            [x - 0.55, -half + 0.05, head - 0.05],
        );
    }
    ends(&mut builder, &parts, outline);
    lamps_and_wheels(&mut builder, &parts, outline);
    rear_lamps(&mut builder, &parts, -front - 0.01, half, (0.62, 0.85));
    panel(&mut builder, parts.plate, -front - 0.008, (-0.26, 0.26), (0.45, 0.565));
    builder.finish()
}

/// Windows, engine grille and destination sign at front and rear.
fn ends(builder: &mut MeshBuilder, parts: &Parts, outline: [f32; 3]) {
    let [length, width, height] = outline;
    let (front, half) = (0.5 * length, 0.5 * width - INSET_M);
    panel(builder, parts.glass, front - 0.005, (-half + 0.1, half - 0.1), (0.36 * height, 0.83 * height));
    let sign = Material::matt([0.02; 3], 0.1).lit([0.5, 0.25, 0.02], None);
    let sign = builder.material(sign);
    panel(builder, parts.arch, front - 0.004, (-half + 0.1, half - 0.1), (0.84 * height, 0.93 * height));
    panel(builder, sign, front - 0.002, (-0.45 * half, 0.45 * half), (0.865 * height, 0.905 * height));
    panel(builder, parts.glass, -front - 0.006, (-half + 0.25, half - 0.25), (0.5 * height, 0.8 * height));
    panel(builder, parts.arch, -front - 0.006, (-half + 0.3, half - 0.3), (0.16 * height, 0.3 * height));
}

/// Head lamps and front indicators, and the wheels in their openings.
fn lamps_and_wheels(builder: &mut MeshBuilder, parts: &Parts, outline: [f32; 3]) {
    let [length, width, height] = outline;
    let (front, half) = (0.5 * length, 0.5 * width - INSET_M);
    for side in [1.0_f32, -1.0] {
        let turn = if side > 0.0 { parts.left } else { parts.right };
        let across =
            |a: f32, b: f32| (side * a * half).min(side * b * half)..(side * a * half).max(side * b * half);
        let y = across(0.60, 0.86);
        builder.cuboid(parts.head, [front - 0.1, y.start, 0.62], [front, y.end, 0.80]);
        let y = across(0.87, 0.97);
        builder.cuboid(turn, [front - 0.1, y.start, 0.62], [front - 0.004, y.end, 0.80]);
        let wheel = 0.48_f32.min(0.2 * height);
        for t in [0.22, 0.72] {
            let x = front - t * length;
            opening(builder, parts, [x, side * (half + 0.004), wheel], wheel + 0.07);
            wheel_at(builder, parts, [x, side * 0.5 * width, wheel], wheel, 0.3);
        }
    }
}
