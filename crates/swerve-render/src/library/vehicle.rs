//! Cars by lofting cross-sections along a profile; truck and bus from boxes.

use super::Kind;
use crate::SemanticClass;
use crate::hash::Draws;
use crate::material::{Material, Texture};
use crate::mesh::{Builder, Mesh, Placed};
use crate::scene::lamps;

/// One cross-section of a car's profile, as shares: along the length from the front, height of the upper
/// edge, height of the belt line, half width.
type Section = [f32; 4];

/// Side view of a car and where its glass is.
struct Profile {
    sections: &'static [Section],
    /// Along the length: foot and head of the windscreen, head and foot of the rear window.
    screen: [f32; 4],
    /// Along the length: pillars and door gaps.
    pillars: &'static [f32],
    /// Along the length: front and rear axle.
    axles: [f32; 2],
    /// Share of the half width that the roof is narrower.
    tumble_home: f32,
    /// Side windows end here, along the length.
    glass_end: f32,
    wheel_radius_m: f32,
}

const SEDAN: Profile = Profile {
    sections: &[
        [0.0, 0.40, 0.40, 0.80],
        [0.012, 0.50, 0.50, 0.88],
        [0.05, 0.575, 0.57, 0.945],
        [0.13, 0.615, 0.60, 0.985],
        [0.27, 0.66, 0.635, 1.0],
        [0.40, 0.945, 0.645, 1.0],
        [0.45, 0.985, 0.645, 1.0],
        [0.53, 1.0, 0.65, 1.0],
        [0.63, 0.985, 0.655, 1.0],
        [0.70, 0.945, 0.66, 1.0],
        [0.83, 0.715, 0.665, 0.99],
        [0.93, 0.69, 0.66, 0.965],
        [0.985, 0.655, 0.64, 0.91],
        [1.0, 0.54, 0.54, 0.86],
    ],
    screen: [0.27, 0.40, 0.70, 0.83],
    pillars: &[0.40, 0.555, 0.70],
    axles: [0.185, 0.79],
    tumble_home: 0.24,
    glass_end: 0.80,
    wheel_radius_m: 0.325,
};

const HATCHBACK: Profile = Profile {
    sections: &[
        [0.0, 0.42, 0.42, 0.80],
        [0.012, 0.52, 0.52, 0.88],
        [0.05, 0.585, 0.58, 0.945],
        [0.12, 0.62, 0.61, 0.985],
        [0.24, 0.67, 0.64, 1.0],
        [0.37, 0.94, 0.65, 1.0],
        [0.43, 0.985, 0.65, 1.0],
        [0.55, 1.0, 0.655, 1.0],
        [0.75, 0.985, 0.665, 1.0],
        [0.88, 0.94, 0.675, 0.985],
        [0.965, 0.70, 0.68, 0.95],
        [0.99, 0.60, 0.60, 0.90],
        [1.0, 0.50, 0.50, 0.87],
    ],
    screen: [0.24, 0.37, 0.88, 0.965],
    pillars: &[0.37, 0.56, 0.78],
    axles: [0.19, 0.82],
    tumble_home: 0.22,
    glass_end: 0.90,
    wheel_radius_m: 0.315,
};

const SUV: Profile = Profile {
    sections: &[
        [0.0, 0.44, 0.44, 0.84],
        [0.012, 0.54, 0.54, 0.90],
        [0.045, 0.605, 0.60, 0.955],
        [0.12, 0.63, 0.62, 0.99],
        [0.25, 0.67, 0.64, 1.0],
        [0.36, 0.945, 0.65, 1.0],
        [0.42, 0.985, 0.65, 1.0],
        [0.55, 1.0, 0.655, 1.0],
        [0.78, 0.99, 0.665, 1.0],
        [0.93, 0.955, 0.67, 0.985],
        [0.98, 0.70, 0.67, 0.95],
        [0.992, 0.60, 0.60, 0.92],
        [1.0, 0.48, 0.48, 0.90],
    ],
    screen: [0.25, 0.36, 0.93, 0.98],
    pillars: &[0.36, 0.55, 0.76],
    axles: [0.18, 0.80],
    tumble_home: 0.18,
    glass_end: 0.93,
    wheel_radius_m: 0.37,
};

const VAN: Profile = Profile {
    sections: &[
        [0.0, 0.30, 0.30, 0.84],
        [0.01, 0.38, 0.38, 0.91],
        [0.04, 0.435, 0.43, 0.96],
        [0.13, 0.49, 0.48, 0.99],
        [0.25, 0.86, 0.50, 1.0],
        [0.31, 0.97, 0.50, 1.0],
        [0.37, 0.995, 0.50, 1.0],
        [0.60, 1.0, 0.50, 1.0],
        [0.97, 0.995, 0.50, 1.0],
        [0.99, 0.96, 0.50, 0.99],
        [1.0, 0.92, 0.50, 0.98],
    ],
    screen: [0.13, 0.25, 1.1, 1.1],
    pillars: &[0.25, 0.38],
    axles: [0.16, 0.80],
    tumble_home: 0.10,
    glass_end: 0.37,
    wheel_radius_m: 0.34,
};

/// Heights of the cross-section's fixed points, share of the height.
const SILL: f32 = 0.15;
const TRIM: f32 = 0.27;
const WAIST: f32 = 0.46;

/// The materials of vehicles.
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
    fn new(builder: &mut Builder) -> Self {
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

/// A lofted body within an outline.
struct Body<'a> {
    profile: &'a Profile,
    outline: [f32; 3],
    /// Play between body and outline, metres: wheels, lamps and plates stand out by this.
    inset: f32,
    stretch: f32,
}

/// Points of half a cross-section, from the sill to the middle of the roof.
const RING: usize = 7;

impl Body<'_> {
    fn x(&self, t: f32) -> f32 {
        (0.5 - t) * (self.outline[0] - 2.0 * self.inset)
    }

    /// Interpolated section.
    fn section(&self, t: f32) -> Section {
        let sections = self.profile.sections;
        let next = sections.partition_point(|s| s[0] <= t).clamp(1, sections.len() - 1);
        let (a, b) = (sections[next - 1], sections[next]);
        let u = ((t - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0);
        [t, a[1] + u * (b[1] - a[1]), a[2] + u * (b[2] - a[2]), a[3] + u * (b[3] - a[3])]
    }

    /// Half a cross-section: `[y, z]`, left side.
    fn ring(&self, t: f32) -> [[f32; 2]; RING] {
        let [_, top, belt, wide] = self.section(t);
        let half = wide * (0.5 * self.outline[1] - self.inset);
        let belt = belt.min(top);
        let rise = top - belt;
        let roof = half * (0.955 - self.profile.tumble_home * rise / 0.35);
        let z = |share: f32| share.min(top) * self.outline[2];
        let edge = top - 0.03 * (rise / 0.3).min(1.0) - 0.008;
        [
            [half * 0.93, z(SILL)],
            [half * 0.985, z(TRIM)],
            [half, z(WAIST.min(belt))],
            [half * 0.965, z(belt)],
            [roof, z(edge.max(belt))],
            [roof * 0.7, z(top - 0.006 * self.stretch)],
            [0.0, z(top)],
        ]
    }

    /// Half width at a height below the belt.
    fn side(&self, t: f32, z: f32) -> f32 {
        let ring = self.ring(t);
        for pair in ring[..4].windows(2) {
            if z <= pair[1][1] {
                let u = (z - pair[0][1]) / (pair[1][1] - pair[0][1]).max(1e-4);
                return pair[0][0] + u.clamp(0.0, 1.0) * (pair[1][0] - pair[0][0]);
            }
        }
        ring[3][0]
    }
}

/// Car of one of the lofted kinds.
pub(super) fn car(kind: Kind, outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let profile = match kind {
        Kind::Hatchback => &HATCHBACK,
        Kind::Suv => &SUV,
        Kind::Van => &VAN,
        _ => &SEDAN,
    };
    let mut builder = Builder::new(32.0);
    let parts = Parts::new(&mut builder);
    let body = Body { profile, outline, inset: 0.012, stretch: draws.between(0.6, 1.6) };
    hull(&mut builder, &parts, &body);
    ends(&mut builder, &parts, &body);
    details(&mut builder, &parts, &body, kind);
    let wheel = profile.wheel_radius_m.min(0.26 * outline[2]);
    for t in profile.axles {
        for side in [1.0, -1.0] {
            arch(&mut builder, &parts, &body, t, side, wheel);
            wheel_at(&mut builder, &parts, [body.x(t), side * 0.5 * outline[1], wheel], (wheel, 0.22));
        }
    }
    builder.finish()
}

/// The lofted skin.
fn hull(builder: &mut Builder, parts: &Parts, body: &Body<'_>) {
    let profile = body.profile;
    let mut cuts: Vec<f32> = profile.sections.iter().map(|s| s[0]).collect();
    for &pillar in profile.pillars {
        cuts.extend([pillar - 0.011, pillar + 0.011]);
    }
    cuts.push(profile.glass_end.min(1.0));
    cuts.sort_by(f32::total_cmp);
    cuts.dedup_by(|a, b| (*a - *b).abs() < 0.004);
    let [foot, head, rear_head, rear_foot] = profile.screen;
    for pair in cuts.windows(2) {
        let (ring_a, ring_b) = (body.ring(pair[0]), body.ring(pair[1]));
        let (xa, xb) = (body.x(pair[0]), body.x(pair[1]));
        let middle = 0.5 * (pair[0] + pair[1]);
        let section = body.section(middle);
        let pillar = profile.pillars.iter().any(|p| (middle - p).abs() < 0.012);
        let glazed = section[1] - section[2] > 0.06 && middle < profile.glass_end && !pillar;
        let screen = (foot..head).contains(&middle) || (rear_head..rear_foot).contains(&middle);
        for j in 0..RING - 1 {
            let material = match j {
                0 => parts.trim,
                3 if glazed => parts.glass,
                4 | 5 if screen => parts.glass,
                _ => parts.paint,
            };
            let p = |x: f32, ring: &[[f32; 2]; RING], j: usize, side: f32| [x, side * ring[j][0], ring[j][1]];
            let quad = |side: f32| {
                [
                    p(xb, &ring_b, j, side),
                    p(xa, &ring_a, j, side),
                    p(xa, &ring_a, j + 1, side),
                    p(xb, &ring_b, j + 1, side),
                ]
            };
            let [a, b, c, d] = quad(1.0);
            builder.quad(material, [b, a, d, c]);
            builder.quad(material, quad(-1.0));
        }
        let z = body.outline[2] * SILL;
        let (ya, yb) = (ring_a[0][0], ring_b[0][0]);
        builder.quad(parts.arch, [[xb, yb, z], [xa, ya, z], [xa, -ya, z], [xb, -yb, z]]);
    }
}

/// Closes the loft at front and rear, with grille and bumper.
fn ends(builder: &mut Builder, parts: &Parts, body: &Body<'_>) {
    for (t, ahead) in [(0.0, true), (1.0, false)] {
        let (ring, x) = (body.ring(t), body.x(t));
        for j in 0..RING - 1 {
            let (low, high) = (ring[j], ring[j + 1]);
            let p =
                [[x, -low[0], low[1]], [x, low[0], low[1]], [x, high[0], high[1]], [x, -high[0], high[1]]];
            let p = if ahead { p } else { [p[1], p[0], p[3], p[2]] };
            builder.quad(if j == 0 { parts.trim } else { parts.paint }, p);
        }
    }
}

/// A rectangle that looks forwards (`ahead`) or backwards.
fn panel(builder: &mut Builder, material: u16, x: f32, (y0, y1): (f32, f32), (z0, z1): (f32, f32)) {
    let ahead = x > 0.0;
    let p = [[x, y0, z0], [x, y1, z0], [x, y1, z1], [x, y0, z1]];
    let p = if ahead { p } else { [p[1], p[0], p[3], p[2]] };
    builder.quad_uv(material, p, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
}

/// Lamps, plates, grille, doors, mirrors, pillars.
fn details(builder: &mut Builder, parts: &Parts, body: &Body<'_>, kind: Kind) {
    let [length, width, height] = body.outline;
    let (front, half) = (0.5 * length, 0.5 * width - body.inset);
    let scale = if kind == Kind::Van { 0.76 } else { 1.0 };
    let z = |share: f32| share * scale * height;
    panel(builder, parts.arch, front - 0.006, (-0.5 * half, 0.5 * half), (z(0.30), z(0.395)));
    panel(builder, parts.chrome, front - 0.004, (-0.09, 0.09), (z(0.40), z(0.405) + 0.03));
    panel(builder, parts.plate, front - 0.002, (-0.26, 0.26), (z(0.22), z(0.22) + 0.115));
    panel(builder, parts.plate, -front + 0.002, (-0.26, 0.26), (z(0.40), z(0.40) + 0.115));
    for side in [1.0_f32, -1.0] {
        let across = |a: f32, b: f32| (side * a * half, side * b * half);
        let mut block = |material: u16, (x0, x1): (f32, f32), (a, b): (f32, f32), (z0, z1): (f32, f32)| {
            let (y0, y1) = across(a, b);
            builder.cuboid(material, [x0.min(x1), y0.min(y1), z0], [x0.max(x1), y0.max(y1), z1]);
        };
        let turn = if side > 0.0 { parts.left } else { parts.right };
        block(parts.head, (front - 0.30, front - 0.035), (0.56, 0.865), (z(0.435), z(0.515)));
        block(turn, (front - 0.30, front - 0.06), (0.865, 0.905), (z(0.435), z(0.505)));
        let (low, high) = if kind == Kind::Van { (0.42, 0.62) } else { (0.50, 0.585) };
        let lip = if kind == Kind::Van { 0.97 } else { 0.885 };
        block(parts.tail, (-front + 0.22, -front + 0.006), (lip - 0.30, lip - 0.14), (z(low), z(high)));
        block(parts.brake, (-front + 0.22, -front + 0.004), (lip - 0.14, lip - 0.02), (z(low), z(high)));
        block(turn, (-front + 0.22, -front + 0.008), (lip - 0.02, lip), (z(low), z(high)));
        let foot = body.profile.screen[0] + 0.035;
        let belt = body.section(foot)[2] * height;
        let x = body.x(foot);
        block(parts.paint, (x - 0.16, x), (0.88, 1.0), (belt + 0.01, belt + 0.14));
        doors(builder, parts, body, side);
    }
}

/// Gaps between doors and their handles: dark strips just outside the skin.
fn doors(builder: &mut Builder, parts: &Parts, body: &Body<'_>, side: f32) {
    let height = body.outline[2];
    let mut strip = |material: u16, (t0, t1): (f32, f32), (z0, z1): (f32, f32)| {
        let p = |t: f32, z: f32| [body.x(t), side * (body.side(t, z) + 0.005), z];
        let (outer, inner) = if side > 0.0 { (t1, t0) } else { (t0, t1) };
        let levels = [z0, (WAIST * height).clamp(z0, z1), z1];
        for pair in levels.windows(2) {
            builder
                .quad(material, [p(inner, pair[0]), p(outer, pair[0]), p(outer, pair[1]), p(inner, pair[1])]);
        }
    };
    let pillars = body.profile.pillars;
    for (k, &t) in pillars.iter().enumerate() {
        let belt = body.section(t)[2] * height;
        let gap = if k == 0 { body.profile.screen[0] + 0.045 } else { t };
        strip(parts.arch, (gap - 0.0014, gap + 0.0014), (TRIM * height + 0.01, belt - 0.005));
        if k > 0 {
            strip(parts.chrome, (t - 0.055, t - 0.018), (belt - 0.10, belt - 0.07));
        }
    }
    let (first, last) = (body.profile.screen[0] + 0.05, pillars[pillars.len() - 1]);
    let trim = (TRIM + 0.03) * height;
    strip(parts.trim, (first, last), (trim, trim + 0.045));
}

/// Dark opening around a wheel, above the axle and a little below.
fn arch(builder: &mut Builder, parts: &Parts, body: &Body<'_>, t: f32, side: f32, wheel: f32) {
    let y = body.side(t, wheel).max(body.side(t, body.outline[2] * WAIST)) + 0.003;
    opening(builder, parts, [body.x(t), side * y, wheel], wheel + 0.055);
}

/// A dark fan around a point of the left or right side, open below.
fn opening(builder: &mut Builder, parts: &Parts, centre: [f32; 3], radius: f32) {
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

/// A wheel whose outer face is at the given point.
fn wheel_at(builder: &mut Builder, parts: &Parts, outer: [f32; 3], (radius, width): (f32, f32)) {
    let saved = builder.place;
    let side = if outer[1] > 0.0 { 1.0 } else { -1.0 };
    // z of the wheel's own frame points outwards.
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

/// Truck: cab, box, chassis.
pub(super) fn box_truck(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, width, height] = outline;
    let mut builder = Builder::new(25.0);
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
            wheel_at(&mut builder, &parts, [x, side * (half - 0.03), wheel], (wheel, deep));
        }
    }
    builder.cuboid(parts.trim, [tail + 0.32 * length, -half + 0.15, 0.45], [back - 0.6, half - 0.15, 0.8]);
    builder.finish()
}

/// The cab of a truck from its front to `back`.
fn cab_of(builder: &mut Builder, parts: &Parts, [front, half, top]: [f32; 3], back: f32) {
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

/// Tail, brake and turn lamps of a tall vehicle.
fn rear_lamps(builder: &mut Builder, parts: &Parts, x: f32, half: f32, z: (f32, f32)) {
    for side in [1.0_f32, -1.0] {
        let turn = if side > 0.0 { parts.left } else { parts.right };
        for (k, material) in [parts.tail, parts.brake, turn].into_iter().enumerate() {
            let inner = half - 0.62 + 0.16 * k as f32;
            let (y0, y1) = (side * inner, side * (inner + 0.15));
            builder.cuboid(material, [x, y0.min(y1), z.0], [x + 0.06, y0.max(y1), z.1]);
        }
    }
}

/// City bus.
pub(super) fn bus(outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let [length, width, height] = outline;
    let mut builder = Builder::new(25.0);
    let parts = Parts::new(&mut builder);
    let (front, half, floor) = (0.5 * length, 0.5 * width - 0.012, 0.32);
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
    panel(
        &mut builder,
        parts.glass,
        front - 0.005,
        (-half + 0.1, half - 0.1),
        (0.36 * height, 0.83 * height),
    );
    let sign = Material::matt([0.02; 3], 0.1).lit([0.5, 0.25, 0.02], None);
    let sign = builder.material(sign);
    panel(&mut builder, parts.arch, front - 0.004, (-half + 0.1, half - 0.1), (0.84 * height, 0.93 * height));
    panel(&mut builder, sign, front - 0.002, (-0.45 * half, 0.45 * half), (0.865 * height, 0.905 * height));
    panel(
        &mut builder,
        parts.glass,
        -front - 0.006,
        (-half + 0.25, half - 0.25),
        (0.5 * height, 0.8 * height),
    );
    panel(&mut builder, parts.arch, -front - 0.006, (-half + 0.3, half - 0.3), (0.16 * height, 0.3 * height));
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
            opening(&mut builder, &parts, [x, side * (half + 0.004), wheel], wheel + 0.07);
            wheel_at(&mut builder, &parts, [x, side * 0.5 * width, wheel], (wheel, 0.3));
        }
    }
    rear_lamps(&mut builder, &parts, -front - 0.01, half, (0.62, 0.85));
    panel(&mut builder, parts.plate, -front - 0.008, (-0.26, 0.26), (0.45, 0.565));
    builder.finish()
}

/// Colours of private cars, roughly as often as they are seen.
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

/// Colours of vans, trucks and buses: mostly white, some in a firm's colours.
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
