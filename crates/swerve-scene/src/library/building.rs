//! Houses: walls, rows of windows, doors, shop fronts, roofs.

use crate::hash::Draws;
use crate::look::lamps;
use crate::material::{Material, Texture};
use crate::mesh::{Mesh, MeshBuilder, Placed};

/// Materials of a house: tint 0 is the wall, 1 the trim, 2 the roof, 3 doors and awnings.
struct Parts {
    wall: u16,
    plinth: u16,
    trim: u16,
    glass: u16,
    lit: u16,
    door: u16,
    roof: u16,
    flat: u16,
    awning: u16,
}

impl Parts {
    fn new(builder: &mut MeshBuilder, draws: &mut Draws) -> Self {
        let mut add = |material: Material| builder.material(material);
        let wall = Material::matt([1.0; 3], 0.45).tinted(0);
        let wall = match draws.below(5) {
            0 | 1 => wall.textured(Texture::Brick, [1.35, 1.4, 1.45], 1.3),
            2 | 3 => wall.textured(Texture::Plaster, [0.78, 0.76, 0.73], 4.0),
            _ => wall.textured(Texture::Slabs, [0.72; 3], 2.8),
        };
        let glass =
            Material::matt([0.022, 0.026, 0.03], 0.05).textured(Texture::Glass, [0.10, 0.105, 0.11], 2.6);
        let glass = glass.glossy(0.06, 0.16);
        Self {
            wall: add(wall),
            plinth: add(Material::matt([0.17, 0.165, 0.16], 0.3).textured(
                Texture::Plaster,
                [0.11, 0.11, 0.105],
                2.0,
            )),
            trim: add(Material::matt([1.0; 3], 0.5).tinted(1)),
            glass: add(glass),
            lit: add(glass.lit([0.30, 0.20, 0.09], Some(lamps::NIGHT))),
            door: add(Material::matt([1.0; 3], 0.35).tinted(3).glossy(0.5, 0.04)),
            roof: add(Material::matt([1.0; 3], 0.3)
                .textured(Texture::RoofTiles, [0.55, 0.5, 0.5], 1.6)
                .tinted(2)),
            flat: add(Material::matt([0.16, 0.16, 0.165], 0.2).textured(
                Texture::Asphalt,
                [0.23, 0.23, 0.23],
                6.0,
            )),
            awning: add(Material { is_two_sided: true, ..Material::matt([0.9; 3], 0.5).tinted(3) }),
        }
    }
}

/// One wall: a frame with x along the wall, y into the house and z up, and its size.
struct Wall {
    place: Placed,
    length: f32,
    bottom: f32,
    floors: usize,
    floor_m: f32,
    shops: bool,
}

/// House within a bounding box.
pub(super) fn building([length, width, height]: [f32; 3], draws: &mut Draws) -> Mesh {
    let mut builder = MeshBuilder::new(20.0);
    let parts = Parts::new(&mut builder, draws);
    let (x, y) = (0.5 * length, 0.5 * width);
    let gable = height < 11.0 && draws.chance(0.7);
    let eaves =
        if gable { (height - (0.32 * width).min(0.4 * height)).max(0.5 * height) } else { height - 0.5 };
    let floors = (eaves / 3.1).floor().max(1.0) as usize;
    let shops = !gable && floors >= 3 && draws.chance(0.6);
    let bottom = if shops { 0.9 } else { 0.0 };
    let floor_m = (eaves - bottom) / floors as f32;
    let quarter = core::f32::consts::FRAC_PI_2;
    let walls = [
        (Placed::turned([-x, -y, 0.0], 0.0), length),
        (Placed::turned([x, -y, 0.0], quarter), width),
        (Placed::turned([x, y, 0.0], 2.0 * quarter), length),
        (Placed::turned([-x, y, 0.0], 3.0 * quarter), width),
    ];
    let style = Style::draw(draws);
    for (place, length) in walls {
        wall(&mut builder, &parts, &Wall { place, length, bottom, floors, floor_m, shops }, &style, draws);
    }
    builder.place = Placed::HERE;
    if gable {
        gabled(&mut builder, &parts, [x, y], (eaves, height));
    } else {
        let top = parts.flat;
        builder.quad(top, [[-x, -y, eaves], [x, -y, eaves], [x, y, eaves], [-x, y, eaves]]);
        parapet(&mut builder, &parts, [x, y], (eaves - 0.25, height));
        for _ in 0..draws.below(3) {
            let at = [draws.between(-0.6, 0.4) * x, draws.between(-0.6, 0.4) * y];
            builder.cuboid(parts.plinth, [at[0], at[1], eaves], [at[0] + 0.25 * x, at[1] + 0.3 * y, height]);
        }
    }
    builder.finish()
}

/// Common features of the windows of one house.
struct Style {
    bay_m: f32,
    window: [f32; 2],
    sills: bool,
    bars: bool,
    balconies: bool,
    lit: f32,
}

impl Style {
    fn draw(draws: &mut Draws) -> Self {
        Self {
            bay_m: draws.between(2.3, 3.4),
            window: [draws.between(1.0, 1.6), draws.between(1.3, 1.7)],
            sills: draws.chance(0.7),
            bars: draws.chance(0.6),
            balconies: draws.chance(0.3),
            lit: draws.between(0.2, 0.5),
        }
    }
}

fn wall(builder: &mut MeshBuilder, parts: &Parts, wall: &Wall, style: &Style, draws: &mut Draws) {
    builder.place = wall.place;
    let top = wall.bottom + wall.floors as f32 * wall.floor_m;
    builder.quad(
        parts.wall,
        [[0.0, 0.0, 0.0], [wall.length, 0.0, 0.0], [wall.length, 0.0, top], [0.0, 0.0, top]],
    );
    front(builder, parts.plinth, (0.0, wall.length), (0.0, 0.45), 0.03);
    front(builder, parts.trim, (0.0, wall.length), (top - 0.22, top), 0.05);
    let bays = (wall.length / style.bay_m).floor().max(1.0) as usize;
    let bay = wall.length / bays as f32;
    let door = draws.below(bays);
    for floor in 0..wall.floors {
        let base = wall.bottom + floor as f32 * wall.floor_m;
        for k in 0..bays {
            let middle = (k as f32 + 0.5) * bay;
            if floor == 0 && k == door {
                front(builder, parts.trim, (middle - 0.65, middle + 0.65), (0.0, 2.35), 0.04);
                front(builder, parts.door, (middle - 0.5, middle + 0.5), (0.1, 2.2), 0.06);
            } else if floor == 0 && wall.shops {
                shop(builder, parts, (middle - 0.45 * bay, middle + 0.45 * bay), base + wall.floor_m);
            } else {
                let glass = if draws.chance(style.lit) { parts.lit } else { parts.glass };
                window(builder, parts, glass, style, (middle, base + 0.85), bay);
                if style.balconies && floor > 0 && k % 2 == 0 {
                    balcony(builder, parts, (middle - 0.42 * bay, middle + 0.42 * bay), base + 0.02);
                }
            }
        }
    }
}

/// A rectangle just in front of the wall.
fn front(builder: &mut MeshBuilder, material: u16, (x0, x1): (f32, f32), (z0, z1): (f32, f32), out: f32) {
    builder.quad(material, [[x0, -out, z0], [x1, -out, z0], [x1, -out, z1], [x0, -out, z1]]);
}

fn window(
    builder: &mut MeshBuilder,
    parts: &Parts,
    glass: u16,
    style: &Style,
    (middle, low): (f32, f32),
    bay: f32,
) {
    let half = (0.5 * style.window[0]).min(0.42 * bay);
    let high = low + style.window[1];
    front(builder, parts.trim, (middle - half - 0.09, middle + half + 0.09), (low - 0.09, high + 0.09), 0.02);
    front(builder, glass, (middle - half, middle + half), (low, high), 0.035);
    if style.bars {
        front(builder, parts.trim, (middle - 0.03, middle + 0.03), (low, high), 0.05);
        front(
            builder,
            parts.trim,
            (middle - half, middle + half),
            (low + 0.66 * (high - low), low + 0.66 * (high - low) + 0.05),
            0.05,
        );
    }
    if style.sills {
        builder.cuboid(
            parts.trim,
            [middle - half - 0.14, -0.14, low - 0.12],
            [middle + half + 0.14, 0.0, low - 0.04],
        );
    }
}

fn balcony(builder: &mut MeshBuilder, parts: &Parts, (x0, x1): (f32, f32), z: f32) {
    builder.cuboid(parts.plinth, [x0, -1.0, z - 0.12], [x1, 0.0, z]);
    builder.cuboid(parts.trim, [x0, -1.0, z + 0.92], [x1, -0.94, z + 1.0]);
    let posts = ((x1 - x0) / 0.5).ceil() as usize;
    for k in 0..=posts {
        let x = x0 + (x1 - x0 - 0.05) * k as f32 / posts as f32;
        builder.cuboid(parts.trim, [x, -1.0, z], [x + 0.05, -0.95, z + 0.92]);
    }
}

fn shop(builder: &mut MeshBuilder, parts: &Parts, (x0, x1): (f32, f32), top: f32) {
    front(builder, parts.trim, (x0 - 0.08, x1 + 0.08), (0.4, top - 0.75), 0.03);
    front(builder, parts.lit, (x0, x1), (0.5, top - 0.85), 0.05);
    front(builder, parts.door, (x0 - 0.08, x1 + 0.08), (top - 0.75, top - 0.25), 0.08);
    let (z0, z1) = (top - 1.15, top - 0.75);
    builder.quad(parts.awning, [[x0, -0.9, z0], [x1, -0.9, z0], [x1, -0.05, z1], [x0, -0.05, z1]]);
}

/// Wall around a flat roof.
fn parapet(builder: &mut MeshBuilder, parts: &Parts, [x, y]: [f32; 2], (z0, z1): (f32, f32)) {
    let thick = 0.25;
    builder.cuboid(parts.trim, [-x, -y, z0], [x, -y + thick, z1]);
    builder.cuboid(parts.trim, [-x, y - thick, z0], [x, y, z1]);
    builder.cuboid(parts.trim, [-x, -y + thick, z0], [-x + thick, y - thick, z1]);
    builder.cuboid(parts.trim, [x - thick, -y + thick, z0], [x, y - thick, z1]);
}

/// Saddle roof with its ridge along x.
fn gabled(builder: &mut MeshBuilder, parts: &Parts, [x, y]: [f32; 2], (eaves, ridge): (f32, f32)) {
    for side in [-1.0_f32, 1.0] {
        let p = [
            [-side * x, -side * -y, eaves],
            [side * x, -side * -y, eaves],
            [side * x, 0.0, ridge],
            [-side * x, 0.0, ridge],
        ];
        // Counter-clockwise from outside on both slopes.
        builder.quad(parts.roof, [p[1], p[0], p[3], p[2]]);
    }
    builder.triangle(
        parts.wall,
        [[x, -y, eaves], [x, y, eaves], [x, 0.0, ridge]],
        [[-y, 0.0], [y, 0.0], [0.0, ridge - eaves]],
    );
    builder.triangle(
        parts.wall,
        [[-x, y, eaves], [-x, -y, eaves], [-x, 0.0, ridge]],
        [[-y, 0.0], [y, 0.0], [0.0, ridge - eaves]],
    );
    builder.cuboid(parts.plinth, [0.4 * x, -0.3, eaves], [0.4 * x + 0.6, 0.3, ridge]);
}

/// Colours of wall, trim, roof and door.
pub(super) fn colours(draws: &mut Draws) -> [[f32; 3]; 4] {
    const WALL: [[f32; 3]; 9] = [
        [0.32, 0.12, 0.07],
        [0.26, 0.10, 0.065],
        [0.40, 0.22, 0.13],
        [0.50, 0.44, 0.33],
        [0.55, 0.52, 0.46],
        [0.42, 0.33, 0.20],
        [0.36, 0.38, 0.38],
        [0.46, 0.30, 0.22],
        [0.30, 0.32, 0.36],
    ];
    const TRIM: [[f32; 3]; 4] =
        [[0.58, 0.57, 0.54], [0.45, 0.42, 0.36], [0.10, 0.10, 0.10], [0.30, 0.29, 0.28]];
    const ROOF: [[f32; 3]; 4] =
        [[0.26, 0.08, 0.05], [0.10, 0.10, 0.105], [0.16, 0.10, 0.07], [0.20, 0.065, 0.05]];
    const DOOR: [[f32; 3]; 6] = [
        [0.16, 0.03, 0.03],
        [0.03, 0.07, 0.13],
        [0.04, 0.10, 0.06],
        [0.09, 0.055, 0.03],
        [0.4, 0.3, 0.08],
        [0.06; 3],
    ];
    [draws.one_of(&WALL), draws.one_of(&TRIM), draws.one_of(&ROOF), draws.one_of(&DOOR)]
}
