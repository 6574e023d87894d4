//! Surroundings for a road of which only its course is known: houses, trees, street lamps, grass.

use swerve_geom::{Map, Point, Point2, Transform, math};

use crate::SemanticClass;
use crate::hash::Draws;
use crate::library::{Kind, RoadLayout, RoadPiece, SideOfRoad, Size, road_line};
use crate::material::{Material, Texture};
use crate::mesh::{Body, Builder};
use crate::scene::{Instance, Light, Scene};

/// What is put beside a road.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Furnishing {
    /// Houses in rows.
    pub houses: bool,
    /// Trees.
    pub trees: bool,
    /// Street lamps, with their light.
    pub lamps: bool,
    /// Which ones.
    pub seed: u64,
}

impl Default for Furnishing {
    fn default() -> Self {
        Self { houses: true, trees: true, lamps: true, seed: 0 }
    }
}

/// A cross-section of the road to put things beside: place, direction, arc length.
#[derive(Clone, Copy, Debug)]
struct Stop {
    at: [f64; 2],
    along: [f64; 2],
}

/// Puts things beside a road, none of them on it; they never move and have no instance id.
///
/// `is_free` says whether a disc (centre, radius in metres) may be built on; where it may not, nothing is
/// put.
pub fn furnish(
    scene: &mut Scene,
    layout: &RoadLayout,
    furnishing: &Furnishing,
    is_free: &dyn Fn(Point2<Map>, f64) -> bool,
) {
    let stops: Vec<Stop> = road_line(&layout.centre).map(|(at, along)| Stop { at, along }).collect();
    let mut row = Row { scene, stops: &stops, layout, is_free, houses: Vec::new() };
    for (k, out) in [1.0, -1.0].into_iter().enumerate() {
        let mut draws = Draws::new(furnishing.seed, 0x0f07 + k as u32);
        let (edge, side) =
            if out > 0.0 { (layout.left_m, layout.left_side) } else { (layout.right_m, layout.right_side) };
        let (edge, band) = match side {
            SideOfRoad::Verge => (f64::from(edge), 3.0),
            SideOfRoad::Pavement { width_m } => (f64::from(edge), f64::from(width_m) + 0.2),
        };
        if furnishing.houses {
            row.houses(out, edge + band, &mut draws);
        }
        if furnishing.trees {
            row.trees(out, edge + 0.5 * band, &mut draws);
        }
        if furnishing.lamps {
            row.lamps(out, edge + 0.45);
        }
    }
}

/// What is being put beside one road.
struct Row<'a> {
    scene: &'a mut Scene,
    stops: &'a [Stop],
    layout: &'a RoadLayout,
    is_free: &'a dyn Fn(Point2<Map>, f64) -> bool,
    /// Centre and radius of the houses so far.
    houses: Vec<([f64; 2], f64)>,
}

impl Row<'_> {
    /// The stop after so many metres; they are a metre apart.
    fn stop(&self, s: f64) -> Option<&Stop> {
        self.stops.get(s.round().max(0.0) as usize)
    }

    fn length_m(&self) -> f64 {
        self.stops.len() as f64
    }

    /// A point beside a stop; `out` is 1 to the left and -1 to the right.
    fn beside(stop: &Stop, out: f64, offset: f64) -> [f64; 2] {
        [stop.at[0] - out * offset * stop.along[1], stop.at[1] + out * offset * stop.along[0]]
    }

    /// Whether a rectangle keeps clear of the road by a margin.
    fn is_off_road(&self, centre: [f64; 2], along: [f64; 2], half: [f64; 2]) -> bool {
        let (left, right) = (f64::from(self.layout.left_m), f64::from(self.layout.right_m));
        self.stops.iter().all(|stop| {
            let away = [stop.at[0] - centre[0], stop.at[1] - centre[1]];
            let u = (away[0] * along[0] + away[1] * along[1]).abs() - half[0];
            let v = (away[1] * along[0] - away[0] * along[1]).abs() - half[1];
            // On which side of the road the rectangle is, seen from this stop.
            let side = stop.along[0] * -away[1] + stop.along[1] * away[0];
            u.max(v) > if side > 0.0 { left } else { right } + 0.2
        })
    }

    fn add(&mut self, kind: Kind, size: Size, seed: u64, ([x, y], yaw_rad): ([f64; 2], f64)) {
        let model = self.scene.meshes.model_sized(kind, size, seed);
        self.scene.add_static(Instance::new(&model, x, y, yaw_rad));
    }

    fn houses(&mut self, out: f64, offset: f64, draws: &mut Draws) {
        let mut s = 0.0;
        while s < self.length_m() {
            let (length, depth) =
                (f64::from(draws.between(11.0, 20.0)), f64::from(draws.between(10.0, 13.0)));
            let (height, setback) = (f64::from(draws.between(7.0, 16.0)), f64::from(draws.between(0.3, 2.5)));
            let (gap, seed) = (f64::from(draws.between(0.0, 5.0)), u64::from(draws.bits()));
            let middle = s + 0.5 * length;
            s += length + gap;
            let Some(&stop) = self.stop(middle) else { break };
            let centre = Self::beside(&stop, out, offset + setback + 0.5 * depth);
            let radius = 0.5 * math::hypot(length, depth);
            let near = |(other, reach): &([f64; 2], f64)| {
                math::hypot(other[0] - centre[0], other[1] - centre[1]) < 0.75 * (radius + reach)
            };
            let off_road = self.is_off_road(centre, stop.along, [0.5 * length, 0.5 * depth]);
            if !off_road
                || self.houses.iter().any(near)
                || !(self.is_free)(Point2::new(centre[0], centre[1]), radius)
            {
                continue;
            }
            self.houses.push((centre, radius));
            let turn = if out > 0.0 { core::f64::consts::PI } else { 0.0 };
            let yaw = math::atan2(stop.along[1], stop.along[0]) + turn;
            self.add(Kind::Building, Size::from_m(length, depth, height), seed, (centre, yaw));
        }
    }

    fn trees(&mut self, out: f64, offset: f64, draws: &mut Draws) {
        let mut s = f64::from(draws.between(0.0, 8.0));
        while s < self.length_m() {
            let (seed, step) = (u64::from(draws.bits()), f64::from(draws.between(9.0, 18.0)));
            if let Some(&stop) = self.stop(s) {
                let at = Self::beside(&stop, out, offset);
                if draws.chance(0.8) && self.is_post_free(at, stop.along) {
                    self.add(Kind::Tree, Kind::Tree.usual_size(seed), seed, (at, 0.7 * s));
                }
            }
            s += step;
        }
    }

    fn lamps(&mut self, out: f64, offset: f64) {
        // Lamps of the two sides alternate.
        let mut s = 14.0 + 7.0 * out;
        while s < self.length_m() {
            if let Some(&stop) = self.stop(s) {
                // The pole stands at the rear end of the lamp's outline, a metre from its middle.
                let foot = Self::beside(&stop, out, offset);
                let at = Self::beside(&stop, out, offset - 1.0);
                if self.is_post_free(foot, stop.along) {
                    let yaw = math::atan2(-out * stop.along[0], out * stop.along[1]);
                    self.add(Kind::StreetLamp, Kind::StreetLamp.usual_size(0), 0, (at, yaw));
                    let lamp = Self::beside(&stop, out, offset - 1.7);
                    self.scene.lights.push(Light::street_lamp([lamp[0], lamp[1], 7.2]));
                }
            }
            s += 28.0;
        }
    }

    fn is_post_free(&self, at: [f64; 2], along: [f64; 2]) -> bool {
        let indoors = |(centre, radius): &([f64; 2], f64)| {
            math::hypot(centre[0] - at[0], centre[1] - at[1]) < 0.6 * radius
        };
        self.is_off_road(at, along, [0.1, 0.1])
            && !self.houses.iter().any(indoors)
            && (self.is_free)(Point2::new(at[0], at[1]), 0.5)
    }
}

/// Grass over a rectangle of the map at a height, in squares that are drawn or left out as a whole.
///
/// Lay it a few centimetres below the roads: verges end at -0.03 m.
pub fn ground_pieces(low: Point2<Map>, high: Point2<Map>, height_m: f64) -> Vec<RoadPiece> {
    const SIDE_M: f64 = 80.0;
    if !(low.is_finite() && high.is_finite() && height_m.is_finite()) {
        return Vec::new();
    }
    let count = |from: f64, to: f64| ((to - from) / SIDE_M).ceil().clamp(0.0, 200.0) as u32;
    let mut builder = Builder::new(20.0);
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

#[cfg(test)]
mod tests;
