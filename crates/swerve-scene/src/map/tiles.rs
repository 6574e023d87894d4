//! Surfaces collected in square tiles of the map.

use std::collections::BTreeMap;

use swerve_geom::{Point, Point2, Transform};

use crate::SemanticClass;
use crate::library::RoadPiece;
use crate::material::Material;
use crate::mesh::MeshBuilder;

/// Side of a tile, metres: a multiple of twice the length of all patterns on the ground, so that patterns continue from
/// tile to tile.
const TILE_M: f64 = 48.0;

/// Largest distance of a corner from the middle of its tile, metres; of a wrong map, they may be anywhere.
const SURFACE_MAX_M: f32 = 1e4;

/// Faces with a smaller angle between them share normals, degrees.
const CREASE_DEG: f32 = 30.0;

/// Point of the map and height above its plane, metres.
pub(super) type Spot = (Point2, f64);

/// Surfaces by tile.
#[derive(Default)]
pub(super) struct Tiles {
    builders: BTreeMap<[i64; 2], MeshBuilder>,
}

impl Tiles {
    /// Adds a surface with four corners in order, seen from above whichever way they run. Its pattern is fixed to the map.
    pub(super) fn flat(&mut self, material: Material, [a, b, c, d]: [Spot; 4]) {
        self.triangle(material, [a, b, c]);
        self.triangle(material, [a, c, d]);
    }

    /// Adds a triangle that is seen from above whichever way its corners run. Its pattern is fixed to the map.
    pub(super) fn triangle(&mut self, material: Material, [a, b, c]: [Spot; 3]) {
        let is_up = (b.0 - a.0).cross(c.0 - a.0) > 0.0;
        let corners = if is_up { [a, b, c] } else { [a, c, b] };
        if let Some((builder, points)) = self.placed(corners) {
            let material = builder.material(material);
            builder.triangle(material, points, points.map(|[x, y, _]| [x, y]));
        }
    }

    /// Adds an upright face that is seen from the right of the line from one point to another.
    pub(super) fn wall(&mut self, material: Material, [from, to]: [Point2; 2], [bottom_m, top_m]: [f64; 2]) {
        let corners = [(from, bottom_m), (to, bottom_m), (to, top_m), (from, top_m)];
        if let Some((builder, points)) = self.placed(corners) {
            let material = builder.material(material);
            builder.quad(material, points);
        }
    }

    /// Tile that contains the middle of some corners, and the corners in its frame; `None` for a surface that is too
    /// large.
    fn placed<const N: usize>(&mut self, corners: [Spot; N]) -> Option<(&mut MeshBuilder, [[f32; 3]; N])> {
        let mean =
            |of: fn(&Point2) -> f64| corners.iter().map(|(point, _)| of(point)).sum::<f64>() / N as f64;
        let key = [mean(|p| p.x_m), mean(|p| p.y_m)].map(|m| (m / TILE_M).floor() as i64);
        let points = corners.map(|(point, height_m)| {
            let off = point - origin(key);
            [off.x, off.y, height_m].map(|m| m as f32)
        });
        let is_small = points.iter().flatten().all(|m| m.abs() < SURFACE_MAX_M);
        is_small.then(|| (self.builders.entry(key).or_insert_with(|| MeshBuilder::new(CREASE_DEG)), points))
    }

    /// One mesh for each tile.
    pub(super) fn pieces(self) -> Vec<RoadPiece> {
        let piece = |(key, builder): ([i64; 2], MeshBuilder)| {
            let Point2 { x_m, y_m, .. } = origin(key);
            let map_from_body = Transform::from_roll_pitch_yaw(Point::new(x_m, y_m, 0.0), 0.0, 0.0, 0.0);
            RoadPiece { mesh: builder.finish(), class: SemanticClass::Road, map_from_body }
        };
        self.builders.into_iter().map(piece).collect()
    }
}

/// Middle of a tile.
fn origin([column, row]: [i64; 2]) -> Point2 {
    let middle = |k: i64| (k as f64 + 0.5) * TILE_M;
    Point2::new(middle(column), middle(row))
}
