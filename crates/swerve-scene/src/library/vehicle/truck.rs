//! Trucks built from boxes.

use super::{Parts, panel, rear_lamps, wheel_at};
use crate::hash::Draws;
use crate::material::{Material, Texture};
use crate::mesh::{Mesh, MeshBuilder};

/// Truck: cab, box, chassis.
pub(in crate::library) fn box_truck(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, width, height] = outline;
    let mut builder = MeshBuilder::new(25.0);
    let parts = Parts::new(&mut builder);
    let (front, half) = (0.5 * length, 0.5 * width);
    let cab = (1.95 + draws.between(-0.1, 0.2)).min(0.4 * length);
    let cab_top = 0.80 * height;
    let back = front - cab;
    cab_of(&mut builder, &parts, [front, half - 0.04, cab_top], back);
    let grey = Material::matt([0.75; 3], 0.5).textured(Texture::Corrugated, [0.62; 3], 1.6).tinted(1);
    let side = builder.material(grey.glossy(0.5, 0.04));
    let edge = builder.material(Material::matt([0.45, 0.45, 0.46], 0.4).glossy(0.4, 0.2));
    let (floor, tail) = (0.30 * height, -front);
    builder.cuboid(side, [tail + 0.02, -half + 0.02, floor], [back - 0.12, half - 0.02, height - 0.02]);
    for (y, z) in [(-half, floor), (half - 0.06, floor), (-half, height - 0.06), (half - 0.06, height - 0.06)]
    {
        builder.cuboid(edge, [tail, y, z], [back - 0.10, y + 0.06, z + 0.06]);
    }
    for x in [tail, back - 0.16] {
        for y in [-half, half - 0.06] {
            builder.cuboid(edge, [x, y, floor], [x + 0.06, y + 0.06, height]);
        }
    }
    panel(&mut builder, parts.arch, tail + 0.012, (-0.012, 0.012), (floor, height - 0.05));
    builder.cuboid(parts.trim, [tail + 0.1, -0.45, 0.55], [back, 0.45, floor]);
    builder.cuboid(parts.trim, [tail + 0.04, -half + 0.1, 0.42], [tail + 0.12, half - 0.1, 0.58]);
    panel(&mut builder, parts.plate, tail + 0.035, (-0.26, 0.26), (0.44, 0.56));
    rear_lamps(&mut builder, &parts, tail + 0.03, half, (0.62, 0.76));
    let wheel = 0.46_f32.min(0.28 * height);
    for (x, deep) in [(front - 0.62 * cab, 0.3), (tail + 0.22 * length, 0.55)] {
        for side in [1.0, -1.0] {
            wheel_at(&mut builder, &parts, [x, side * (half - 0.03), wheel], wheel, deep);
        }
    }
    builder.cuboid(parts.trim, [tail + 0.32 * length, -half + 0.15, 0.45], [back - 0.6, half - 0.15, 0.8]);
    builder.finish()
}

/// The cab of a truck from its front to `back`.
fn cab_of(builder: &mut MeshBuilder, parts: &Parts, [front, half, top]: [f32; 3], back: f32) {
    let belt = 0.56 * top;
    let lean = 0.16;
    // Lower part, then glass and roof.
    builder.cuboid(parts.paint, [back, -half, 0.5], [front - 0.01, half, belt]);
    builder.cuboid(parts.trim, [back, -half + 0.05, 0.32], [front, half - 0.05, 0.55]);
    let (nose, roof) = (front - 0.01, top - 0.12);
    let lower = [[nose, -half, belt], [nose, half, belt]];
    let upper = [[nose - lean, -half + 0.06, roof], [nose - lean, half - 0.06, roof]];
    builder.quad(parts.glass, [lower[0], lower[1], upper[1], upper[0]]);
    builder.cuboid(parts.paint, [back, -half + 0.06, roof], [nose - lean, half - 0.06, top]);
    for side in [1.0_f32, -1.0] {
        let (y, z) = (side * half, side * (half - 0.06));
        let split = back + 0.45 * (front - back);
        let mut wall = |material: u16, x0: f32, x1: f32, lean: f32| {
            let p = [[x0, y, belt], [x1, y, belt], [x1 - lean, z, roof], [x0, z, roof]];
            let p = if side > 0.0 { [p[1], p[0], p[3], p[2]] } else { p };
            builder.quad(material, p);
        };
        wall(parts.paint, back, split, 0.0);
        wall(parts.glass, split, nose, lean);
        builder.limb(
            parts.paint,
            ([nose - 0.045, y - 0.02 * side, belt], 0.045),
            ([nose - lean - 0.045, z - 0.02 * side, roof], 0.045),
            6,
        );
        builder.cuboid(
            parts.trim,
            [nose - 0.30, y.min(y + side * 0.04), belt],
            [nose - 0.18, y.max(y + side * 0.04), belt + 0.42],
        );
        let y0 = side * (half - 0.42);
        let y1 = side * (half - 0.1);
        builder.cuboid(parts.head, [front - 0.1, y0.min(y1), 0.62], [front, y0.max(y1), 0.80]);
        let turn = if side > 0.0 { parts.left } else { parts.right };
        let (y0, y1) = (side * (half - 0.1), side * half);
        builder.cuboid(turn, [front - 0.1, y0.min(y1), 0.64], [front - 0.004, y0.max(y1), 0.78]);
    }
    builder.quad(
        parts.paint,
        [[back, half, belt], [back, -half, belt], [back, -half + 0.06, roof], [back, half - 0.06, roof]],
    );
    panel(builder, parts.arch, front - 0.005, (-0.55 * half, 0.55 * half), (0.66, 0.92));
    panel(builder, parts.plate, front + 0.0, (-0.26, 0.26), (0.38, 0.50));
}
