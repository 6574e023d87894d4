//! What stands beside the road: houses, trees, lamps, signs, and grass to the horizon.

use swerve_core::Rng;
use swerve_geom::{Point, Point2, Polyline, Pose2, Transform};
use swerve_render::{
    Instance, Kind, Light, Look, Material, Mesh, MeshParts, Motion, Scene, SemanticClass, Size, Texture,
};
use swerve_scenario::{Motion as Leg, Scenario};

/// Width of the pavements, metres.
pub(super) const PAVEMENT_M: f64 = 2.5;
/// Height of the pavements, metres.
const KERB_M: f64 = 0.12;
/// Houses stand this far behind the pavement at least, metres.
const SETBACK_M: f64 = 3.0;
/// Scenery keeps this far from where actors are, metres.
const CLEAR_M: f64 = 4.0;
/// How far the road is built up beyond both its ends, metres.
const BUILT_M: f64 = 60.0;
/// Side of a tile of grass, metres, and how many there are in each direction from the middle of the road.
const TILE_M: f64 = 80.0;
const TILES: i32 = 5;

pub(super) fn add(scene: &mut Scene, scenario: &Scenario, line: &Polyline, seed: u64) {
    grass(scene, line);
    let ways = ways(scenario, line);
    for (k, side) in [1.0, -1.0].into_iter().enumerate() {
        let edge_m = if side > 0.0 { scenario.road.left_m } else { scenario.road.right_m };
        let mut row = Row {
            scene,
            line,
            side,
            kerb_m: edge_m,
            ways: &ways,
            rng: Rng::keyed(seed, "scenery", &[k as i64]),
        };
        row.lamps();
        row.trees();
        row.houses();
        row.signs();
    }
}

/// What stands on one side of the road.
struct Row<'a> {
    scene: &'a mut Scene,
    line: &'a Polyline,
    /// 1 on the left, -1 on the right.
    side: f64,
    /// From the line to the kerb, metres.
    kerb_m: f64,
    ways: &'a [Point2],
    rng: Rng,
}

impl Row<'_> {
    /// The place at `s_m` along the road and `out_m` beyond the kerb; none where an actor comes within `radius_m`
    /// and a margin, or where the road bends back to it.
    fn place(&self, s_m: f64, out_m: f64, radius_m: f64) -> Option<(Point2, f64)> {
        let at = self.line.at(s_m).pose;
        let across = self.side * (self.kerb_m + out_m);
        let (sin, cos) = swerve_geom::math::sin_cos(at.heading_rad);
        let point = Point2::new(at.x_m - across * sin, at.y_m + across * cos);
        let clear = self.ways.iter().all(|way| way.distance(point) > radius_m + CLEAR_M);
        let nearest = self.line.project(point);
        let beside = self.line.at(nearest.s_m).pose.point().distance(point) + 0.1 > self.kerb_m + out_m;
        (clear && beside).then_some((point, at.heading_rad))
    }

    /// The yaw of something that faces the road.
    fn facing(&self, road_rad: f64) -> f64 {
        road_rad - self.side * core::f64::consts::FRAC_PI_2
    }

    fn lamps(&mut self) {
        let mut s_m = -BUILT_M + if self.side > 0.0 { 0.0 } else { 14.0 };
        while s_m < self.line.length() + BUILT_M {
            if let Some((point, road_rad)) = self.place(s_m, 0.5, 0.2) {
                let model = self.scene.meshes.model(Kind::StreetLamp, 1);
                let instance = standing(&model, point, KERB_M, self.facing(road_rad));
                self.scene.add_static(instance);
                let (sin, cos) = swerve_geom::math::sin_cos(self.facing(road_rad));
                let head = [point.x_m + 1.8 * cos, point.y_m + 1.8 * sin, 7.2];
                self.scene.lights.push(Light::street_lamp(head));
            }
            s_m += 28.0;
        }
    }

    fn trees(&mut self) {
        let mut s_m = -BUILT_M;
        while s_m < self.line.length() + BUILT_M {
            s_m += self.rng.uniform(9.0, 19.0);
            let (seed, turn) = (self.rng.bits(), self.rng.uniform(0.0, 6.0));
            let out_m = self.rng.uniform(PAVEMENT_M + 0.8, PAVEMENT_M + 1.6);
            // A lamp stands every 28 m.
            if let Some((point, _)) = self.place(s_m, out_m, 2.5) {
                let kind = if self.rng.unit() < 0.7 { Kind::Tree } else { Kind::Bush };
                let model = self.scene.meshes.model(kind, seed);
                self.scene.add_static(standing(&model, point, 0.0, turn));
            }
        }
    }

    fn houses(&mut self) {
        let mut s_m = -BUILT_M;
        while s_m < self.line.length() + BUILT_M {
            let length_m = self.rng.uniform(11.0, 20.0);
            let depth_m = self.rng.uniform(9.0, 12.0);
            let height_m = self.rng.uniform(6.5, 15.0);
            let (seed, gap_m) = (self.rng.bits(), self.rng.uniform(1.0, 7.0));
            let out_m = PAVEMENT_M + SETBACK_M + 0.5 * depth_m + self.rng.uniform(0.0, 2.0);
            let radius_m = 0.5 * swerve_geom::math::hypot(length_m, depth_m);
            if let Some((point, road_rad)) = self.place(s_m + 0.5 * length_m, out_m, radius_m) {
                let size = Size::from_m(length_m, depth_m, height_m);
                let model = self.scene.meshes.model_sized(Kind::Building, size, seed);
                let front = if self.side > 0.0 { road_rad + core::f64::consts::PI } else { road_rad };
                self.scene.add_static(standing(&model, point, 0.0, front));
            }
            s_m += length_m + gap_m;
        }
    }

    fn signs(&mut self) {
        let mut s_m = 35.0;
        while s_m < self.line.length() {
            if let Some((point, road_rad)) = self.place(s_m, 0.4, 0.3) {
                let model = self.scene.meshes.model(Kind::SpeedSign { kmh: 50 }, 1);
                // Against the traffic on its side.
                let facing = if self.side > 0.0 { road_rad } else { road_rad + core::f64::consts::PI };
                self.scene.add_static(standing(&model, point, KERB_M, facing));
            }
            s_m += 90.0;
        }
    }
}

fn standing(model: &swerve_render::Model, at: Point2, z_m: f64, yaw_rad: f64) -> Instance {
    Instance::placed(
        model,
        Transform::from_roll_pitch_yaw(Point::new(at.x_m, at.y_m, z_m), 0.0, 0.0, yaw_rad),
    )
}

/// Points at most two metres apart on the ways that actors may go.
fn ways(scenario: &Scenario, line: &Polyline) -> Vec<Point2> {
    let mut points: Vec<Point2> = Vec::new();
    for actor in &scenario.actors {
        let start = actor.pose(line);
        points.push(start.point());
        let mut from = start.point();
        for leg in &actor.motion {
            match leg {
                Leg::Walk { distance_m, .. } | Leg::Drive { distance_m: Some(distance_m), .. } => {
                    // Whichever way it goes, it stays within this.
                    let n = (distance_m / 2.0).ceil().clamp(1.0, 100.0) as i32;
                    let reach = |k: i32| f64::from(k) / f64::from(n) * distance_m;
                    for (k, quarter) in (1..=n).flat_map(|k| (0..4).map(move |quarter| (k, quarter))) {
                        let turn = core::f64::consts::FRAC_PI_2 * f64::from(quarter);
                        let way = Pose2::new(start.x_m, start.y_m, start.heading_rad + turn);
                        points.push(way.ahead(reach(k)).point());
                    }
                }
                Leg::Drive { .. } => points.extend((1..=60).map(|k| start.ahead(2.0 * f64::from(k)).point())),
                Leg::Path { points: corners, .. } => {
                    for corner in corners {
                        let to = line.to_map(swerve_geom::FrenetPoint { s_m: corner.s_m, d_m: corner.d_m });
                        let n = (from.distance(to) / 2.0).ceil().clamp(1.0, 200.0) as i32;
                        for k in 1..=n {
                            let u = f64::from(k) / f64::from(n);
                            points.push(Point2::new(
                                from.x_m + u * (to.x_m - from.x_m),
                                from.y_m + u * (to.y_m - from.y_m),
                            ));
                        }
                        from = to;
                    }
                }
                Leg::Wait { .. } => {}
            }
        }
    }
    points
}

/// Grass, in tiles that are drawn or left out as a whole, a touch below the road.
fn grass(scene: &mut Scene, line: &Polyline) {
    let half = 0.5 * TILE_M as f32;
    let corners = [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]];
    let material =
        Material::matt([0.05, 0.075, 0.022], 0.45).textured(Texture::Grass, [0.12, 0.15, 0.05], 4.0);
    let parts = MeshParts {
        positions: corners.to_vec(),
        normals: vec![[0.0, 0.0, 1.0]; 4],
        uvs: corners.iter().map(|corner| [corner[0], corner[1]]).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        triangle_materials: vec![0, 0],
        materials: vec![material],
    };
    let mesh = scene.meshes.add(Mesh::new(parts).expect("a square"));
    let middle = line.at(0.5 * line.length()).pose;
    for i in -TILES..=TILES {
        for j in -TILES..=TILES {
            let at =
                Point::new(middle.x_m + TILE_M * f64::from(i), middle.y_m + TILE_M * f64::from(j), -0.06);
            scene.add_static(Instance {
                mesh,
                map_from_body: Transform::from_roll_pitch_yaw(at, 0.0, 0.0, 0.0),
                instance_id: 0,
                class: SemanticClass::Terrain,
                look: Look::default(),
                motion: Motion::default(),
            });
        }
    }
}
