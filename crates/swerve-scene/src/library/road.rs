//! Roads generated from lines and widths: surface, markings, kerbs, pavements, verges.

use swerve_geom::{Map, Point, Point2, Transform};

use crate::SemanticClass;
use crate::hash::Draws;
use crate::material::{Material, Texture};
use crate::mesh::{Body, Mesh, MeshBuilder};
use crate::paving::{KERB_M, PAINT_M, WHITE, YELLOW, asphalt, flags, kerb, paint, soil, verge};

/// Pattern of a line on the road.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum LinePattern {
    /// Solid line.
    Solid,
    /// Dashed line.
    Dashed {
        /// Length of a stroke, metres.
        stroke_m: f32,
        /// Length of a gap, metres.
        gap_m: f32,
    },
}

/// A line along the road.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LaneLine {
    /// Distance to the left of the centre line, metres.
    pub offset_m: f32,
    /// Width of the paint, metres.
    pub width_m: f32,
    /// Solid or dashed.
    pub pattern: LinePattern,
    /// True for yellow, false for white.
    pub is_yellow: bool,
}

/// Ground beside the carriageway.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SideOfRoad {
    /// Grass.
    Verge,
    /// A kerb and a pavement of this width, metres.
    Pavement {
        /// Width, metres.
        width_m: f32,
    },
}

/// Geometry of a road.
#[derive(Clone, PartialEq, Debug)]
pub struct RoadLayout {
    /// Centre line, map frame; consecutive points must differ. Fewer than two points give no road.
    pub centre: Vec<Point2<Map>>,
    /// Distance from the centre line to the left edge of the carriageway, metres.
    pub left_m: f32,
    /// Distance from the centre line to the right edge, metres.
    pub right_m: f32,
    /// Painted lines.
    pub lines: Vec<LaneLine>,
    /// Ground beyond the left edge.
    pub left_side: SideOfRoad,
    /// Ground beyond the right edge.
    pub right_side: SideOfRoad,
    /// Zebra crossings, metres along the centre line.
    pub crossings_m: Vec<f32>,
    /// Stop lines across the right half, metres along the centre line.
    pub stop_lines_m: Vec<f32>,
}

impl RoadLayout {
    /// Two lanes with a dashed centre line, solid edge lines and pavements.
    pub fn street(centre: Vec<Point2<Map>>, left_m: f32, right_m: f32) -> Self {
        let dashed = LinePattern::Dashed { stroke_m: 3.0, gap_m: 6.0 };
        let line = |offset_m: f32, pattern| LaneLine { offset_m, width_m: 0.14, pattern, is_yellow: false };
        let lines = vec![
            line(left_m - 0.25, LinePattern::Solid),
            line(-right_m + 0.25, LinePattern::Solid),
            line(0.5 * (left_m - right_m), dashed),
        ];
        let side = SideOfRoad::Pavement { width_m: 2.5 };
        let (crossings_m, stop_lines_m) = (Vec::new(), Vec::new());
        Self { centre, left_m, right_m, lines, left_side: side, right_side: side, crossings_m, stop_lines_m }
    }
}

/// A mesh of a road with its class and pose.
#[derive(Clone, Debug)]
pub struct RoadPiece {
    /// Mesh in its own frame.
    pub mesh: Mesh,
    /// Class of its triangles, except those whose material has its own class.
    pub class: SemanticClass,
    /// Pose.
    pub map_from_body: Transform<Map, Body>,
}

/// Length of a road piece, metres; pieces are drawn or culled as a whole.
const PIECE_M: f32 = 40.0;
/// Maximum distance between two cross-sections, metres.
const STEP_M: f32 = 2.0;

/// A cross-section of the road.
#[derive(Clone, Copy, Debug)]
struct Station {
    s: f32,
    at: [f64; 2],
    left: [f64; 2],
}

/// The meshes of a road; `seed` varies wear.
pub fn road_pieces(layout: &RoadLayout, seed: u64) -> Vec<RoadPiece> {
    let stations = stations(&layout.centre);
    let Some(end) = stations.last().map(|station| station.s) else { return Vec::new() };
    let count = (end / PIECE_M).ceil().max(1.0) as usize;
    let mut pieces = Vec::new();
    for k in 0..count {
        let (from, to) = (k as f32 * PIECE_M, ((k + 1) as f32 * PIECE_M).min(end));
        if to - from > 1e-3 {
            pieces.push(piece(layout, &stations, (from, to), Draws::new(seed, k as u32)));
        }
    }
    pieces
}

/// Cross-sections at every point of the line, at the ends of pieces and at most one step apart.
fn stations(line: &[Point2<Map>]) -> Vec<Station> {
    let points: Vec<[f64; 2]> = line.iter().filter(|p| p.is_finite()).map(|p| [p.x_m, p.y_m]).collect();
    let directions: Vec<([f64; 2], f64)> = points
        .windows(2)
        .map(|pair| {
            let step = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let length = (step[0] * step[0] + step[1] * step[1]).sqrt();
            let one = if length > 0.0 { 1.0 / length } else { 0.0 };
            ([step[0] * one, step[1] * one], length)
        })
        .collect();
    // At the corner of two segments the road is cut along their mean normal.
    let normal = |k: usize| {
        let before = directions[k.saturating_sub(1).min(directions.len() - 1)].0;
        let after = directions[k.min(directions.len() - 1)].0;
        let sum = [before[0] + after[0], before[1] + after[1]];
        let length = (sum[0] * sum[0] + sum[1] * sum[1]).sqrt().max(1e-6);
        [-sum[1] / length, sum[0] / length]
    };
    let mut all = Vec::new();
    let mut s = 0.0;
    for (k, &(_, length)) in directions.iter().enumerate() {
        if length < 1e-6 {
            continue;
        }
        let steps = (length / f64::from(STEP_M)).ceil() as usize;
        let (here, there) = (normal(k), normal(k + 1));
        for j in 0..=steps {
            if j == 0 && !all.is_empty() {
                continue;
            }
            let t = j as f64 / steps as f64;
            let blend = |a: [f64; 2], b: [f64; 2]| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
            let left = blend(here, there);
            all.push(Station { s: (s + t * length) as f32, at: blend(points[k], points[k + 1]), left });
        }
        s += length;
    }
    all
}

/// Grass over a rectangle of the map at a height, in squares that are drawn or culled as a whole.
///
/// Place it a few centimetres below the roads: verges end at -0.03 m.
pub fn ground_pieces(low: Point2<Map>, high: Point2<Map>, height_m: f64) -> Vec<RoadPiece> {
    const SIDE_M: f64 = 80.0;
    if !(low.is_finite() && high.is_finite() && height_m.is_finite()) {
        return Vec::new();
    }
    let count = |from: f64, to: f64| ((to - from) / SIDE_M).ceil().clamp(0.0, 200.0) as u32;
    let mut builder = MeshBuilder::new(20.0);
    let grass = Material::matt([0.05, 0.075, 0.022], 0.45).textured(Texture::Grass, [0.12, 0.15, 0.05], 4.0);
    let grass = builder.material(grass);
    let half = 0.5 * SIDE_M as f32;
    builder.quad(grass, [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]]);
    let mesh = builder.finish();
    let mut pieces = Vec::new();
    for i in 0..count(low.x_m, high.x_m) {
        for j in 0..count(low.y_m, high.y_m) {
            let middle = |from: f64, k: u32| from + (f64::from(k) + 0.5) * SIDE_M;
            let at = Point::new(middle(low.x_m, i), middle(low.y_m, j), height_m);
            let map_from_body: Transform<Map, Body> = Transform::from_roll_pitch_yaw(at, 0.0, 0.0, 0.0);
            pieces.push(RoadPiece { mesh: mesh.clone(), class: SemanticClass::Terrain, map_from_body });
        }
    }
    pieces
}

/// Interpolated cross-section.
fn at(stations: &[Station], s: f32) -> Station {
    let next = stations.partition_point(|station| station.s <= s).clamp(1, stations.len() - 1);
    let (a, b) = (stations[next - 1], stations[next]);
    let t = f64::from((s - a.s) / (b.s - a.s).max(1e-6));
    let blend = |p: [f64; 2], q: [f64; 2]| [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])];
    Station { s, at: blend(a.at, b.at), left: blend(a.left, b.left) }
}

/// Builds strips along a stretch of road in a local frame.
struct Strips<'a> {
    builder: MeshBuilder,
    stations: &'a [Station],
    origin: [f64; 2],
}

impl Strips<'_> {
    fn point(&self, station: &Station, offset: f32, z: f32) -> [f32; 3] {
        let off = f64::from(offset);
        let x = station.at[0] + off * station.left[0] - self.origin[0];
        let y = station.at[1] + off * station.left[1] - self.origin[1];
        [x as f32, y as f32, z]
    }

    /// Adds a strip between two edges, each an offset and a height, from one station to another. Faces up if the second
    /// edge is to the left of the first.
    fn strip(&mut self, material: u16, (from, to): (f32, f32), right: (f32, f32), left: (f32, f32)) {
        let inner = self.stations.iter().filter(|station| station.s > from + 1e-3 && station.s < to - 1e-3);
        let mut cuts = vec![at(self.stations, from)];
        cuts.extend(inner.copied());
        cuts.push(at(self.stations, to));
        let width = (left.0 - right.0).abs() + (left.1 - right.1).abs();
        for pair in cuts.windows(2) {
            let p = [
                self.point(&pair[0], right.0, right.1),
                self.point(&pair[1], right.0, right.1),
                self.point(&pair[1], left.0, left.1),
                self.point(&pair[0], left.0, left.1),
            ];
            let v = right.0;
            let uv = [[pair[0].s, v], [pair[1].s, v], [pair[1].s, v + width], [pair[0].s, v + width]];
            self.builder.quad_uv(material, p, uv);
        }
    }
}

fn piece(layout: &RoadLayout, stations: &[Station], span: (f32, f32), mut draws: Draws) -> RoadPiece {
    let origin = at(stations, 0.5 * (span.0 + span.1)).at;
    let mut strips = Strips { builder: MeshBuilder::new(30.0), stations, origin };
    let road = strips.builder.material(asphalt());
    let (left, right) = (layout.left_m, -layout.right_m);
    // The surface is divided into lanes of about three metres so that textures follow the road.
    let lanes = ((left - right) / 3.5).ceil().clamp(1.0, 12.0) as usize;
    let across = |k: usize| right + (left - right) * k as f32 / lanes as f32;
    for k in 0..lanes {
        strips.strip(road, span, (across(k), 0.0), (across(k + 1), 0.0));
    }
    for line in &layout.lines {
        marking(&mut strips, line, span);
    }
    let white = strips.builder.material(paint(WHITE));
    for &s in layout.crossings_m.iter().filter(|s| (span.0..span.1).contains(*s)) {
        let bars = ((left - right) / 1.0).floor().max(1.0) as usize;
        for k in 0..bars {
            let y = right + (left - right) * (k as f32 + 0.25) / bars as f32;
            let stretch = (s - 1.5, (s + 1.5).min(span.1 + 1.5));
            strips.strip(white, stretch, (y, PAINT_M), (y + 0.5, PAINT_M));
        }
    }
    for &s in layout.stop_lines_m.iter().filter(|s| (span.0..span.1).contains(*s)) {
        strips.strip(white, (s, s + 0.4), (right + 0.3, PAINT_M), (0.5 * (left + right) - 0.1, PAINT_M));
    }
    patches(&mut strips, (left, right), span, &mut draws);
    side(&mut strips, layout.left_side, left, 1.0, span);
    side(&mut strips, layout.right_side, right, -1.0, span);
    let map_from_body = Transform::from_roll_pitch_yaw(Point::new(origin[0], origin[1], 0.0), 0.0, 0.0, 0.0);
    RoadPiece { mesh: strips.builder.finish(), class: SemanticClass::Road, map_from_body }
}

/// Paint of one line on a stretch; strokes of dashed lines are counted from the start of the road.
fn marking(strips: &mut Strips<'_>, line: &LaneLine, (from, to): (f32, f32)) {
    let colour = if line.is_yellow { YELLOW } else { WHITE };
    let material = strips.builder.material(paint(colour));
    let (low, high) = (line.offset_m - 0.5 * line.width_m, line.offset_m + 0.5 * line.width_m);
    match line.pattern {
        LinePattern::Solid => strips.strip(material, (from, to), (low, PAINT_M), (high, PAINT_M)),
        LinePattern::Dashed { stroke_m, gap_m } => {
            let period = (stroke_m + gap_m).max(0.5);
            let mut k = (from / period).floor();
            while k * period < to {
                let (start, end) = ((k * period).max(from), (k * period + stroke_m).min(to));
                if end > start {
                    strips.strip(material, (start, end), (low, PAINT_M), (high, PAINT_M));
                }
                k += 1.0;
            }
        }
    }
}

/// Repairs and a manhole.
fn patches(strips: &mut Strips<'_>, (left, right): (f32, f32), (from, to): (f32, f32), draws: &mut Draws) {
    let ground = Material { is_ground: true, ..Material::matt([0.07, 0.07, 0.075], 0.12) };
    let dark = strips.builder.material(ground.textured(Texture::Asphalt, [0.12, 0.12, 0.12], 3.0));
    let lid = Material { is_ground: true, ..Material::matt([0.09, 0.085, 0.08], 0.2) };
    let iron =
        strips.builder.material(lid.textured(Texture::Slabs, [0.03, 0.03, 0.03], 0.5).glossy(0.5, 0.2));
    for _ in 0..draws.below(3) {
        let (length, width) = (draws.between(0.8, 4.0), draws.between(0.5, 1.4));
        let s = draws.between(from, (to - length).max(from + 0.01));
        let y = draws.between(right + 0.4, (left - width - 0.4).max(right + 0.41));
        strips.strip(dark, (s, (s + length).min(to)), (y, 0.5 * PAINT_M), (y + width, 0.5 * PAINT_M));
    }
    if draws.chance(0.6) {
        let station = at(strips.stations, draws.between(from, to));
        let centre = strips.point(&station, draws.between(right + 0.8, left - 0.8), 0.0);
        strips.builder.place = crate::mesh::Placed::at(centre);
        strips.builder.disc(iron, 0.6 * PAINT_M, 0.33, 14, true);
        strips.builder.place = crate::mesh::Placed::HERE;
    }
}

/// Kerb and pavement, or grass, beyond an edge; `out` is 1 to the left and -1 to the right.
fn side(strips: &mut Strips<'_>, side: SideOfRoad, edge: f32, out: f32, span: (f32, f32)) {
    let mut strip = |material: Material, inner: (f32, f32), outer: (f32, f32)| {
        let material = strips.builder.material(material);
        if out > 0.0 {
            strips.strip(material, span, inner, outer);
        } else {
            strips.strip(material, span, outer, inner);
        }
    };
    match side {
        SideOfRoad::Verge => {
            strip(soil(), (edge, 0.0), (edge + 0.35 * out, -0.01));
            strip(verge(), (edge + 0.35 * out, -0.01), (edge + 3.0 * out, -0.03));
        }
        SideOfRoad::Pavement { width_m } => {
            strip(kerb(), (edge, 0.0), (edge + 0.02 * out, KERB_M));
            strip(kerb(), (edge + 0.02 * out, KERB_M), (edge + 0.16 * out, KERB_M));
            let far = edge + (0.16 + width_m) * out;
            strip(flags(), (edge + 0.16 * out, KERB_M), (far, KERB_M));
            strip(kerb(), (far, KERB_M), (far + 0.05 * out, -0.05));
        }
    }
}
