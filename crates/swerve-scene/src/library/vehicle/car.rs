//! Cars built by lofting cross-sections along a profile.

use super::profile::{HATCHBACK, Profile, SEDAN, SUV, Section, VAN};
use super::{Parts, opening, panel, wheel_at};
use crate::hash::Draws;
use crate::library::Kind;
use crate::mesh::{Mesh, MeshBuilder};

/// Heights of the cross-section's fixed points, as fractions of the height.
const SILL: f32 = 0.15;
const TRIM: f32 = 0.27;
const WAIST: f32 = 0.46;

/// A lofted body within a bounding box.
struct Body<'a> {
    profile: &'a Profile,
    outline: [f32; 3],
    /// Clearance between body and bounding box, metres, filled by wheels, lamps and plates.
    inset: f32,
    stretch: f32,
}

/// Number of points of half a cross-section, from the sill to the middle of the roof.
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
pub(in crate::library) fn car(kind: Kind, outline: [f32; 3], draws: &mut Draws) -> Mesh {
    let profile = match kind {
        Kind::Hatchback => &HATCHBACK,
        Kind::Suv => &SUV,
        Kind::Van => &VAN,
        _ => &SEDAN,
    };
    let mut builder = MeshBuilder::new(32.0);
    let parts = Parts::new(&mut builder);
    let body = Body { profile, outline, inset: 0.012, stretch: draws.between(0.6, 1.6) };
    hull(&mut builder, &parts, &body);
    ends(&mut builder, &parts, &body);
    details(&mut builder, &parts, &body, kind);
    let wheel = profile.wheel_radius_m.min(0.26 * outline[2]);
    for t in profile.axles {
        for side in [1.0, -1.0] {
            arch(&mut builder, &parts, &body, t, side, wheel);
            wheel_at(&mut builder, &parts, [body.x(t), side * 0.5 * outline[1], wheel], wheel, 0.22);
        }
    }
    builder.finish()
}

/// The lofted skin.
fn hull(builder: &mut MeshBuilder, parts: &Parts, body: &Body<'_>) {
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
fn ends(builder: &mut MeshBuilder, parts: &Parts, body: &Body<'_>) {
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

/// Lamps, plates, grille, doors, mirrors, pillars.
fn details(builder: &mut MeshBuilder, parts: &Parts, body: &Body<'_>, kind: Kind) {
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
fn doors(builder: &mut MeshBuilder, parts: &Parts, body: &Body<'_>, side: f32) {
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
fn arch(builder: &mut MeshBuilder, parts: &Parts, body: &Body<'_>, t: f32, side: f32, wheel: f32) {
    let y = body.side(t, wheel).max(body.side(t, body.outline[2] * WAIST)) + 0.003;
    opening(builder, parts, [body.x(t), side * y, wheel], wheel + 0.055);
}
