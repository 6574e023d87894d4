//! Scenery beside the road: houses, trees, lamps, signs, and grass to the horizon.

use swerve_core::Rng;
use swerve_geom::{FrenetPoint, Obb, Point, Point2, Polyline, Pose2, Transform, math};
use swerve_scenario::{Direction, KERB_M, Motion as Leg, PAVEMENT_M, Scenario, Strip};
use swerve_scene::{Instance, Kind, Light, Scene, Size, ground_pieces};

/// Least distance of houses behind the pavement, metres.
const SETBACK_M: f64 = 3.0;
/// Distance of scenery from the paths of actors, metres.
const CLEAR_M: f64 = 0.6;
/// Length of scenery beyond both ends of the road, metres.
const BUILT_M: f64 = 60.0;
/// Extent of the grass from the middle of the road, metres.
const HORIZON_M: f64 = 440.0;
/// Assumed path length of an actor that is not given one, metres.
const DRIVE_M: f64 = 120.0;
const QUARTER: f64 = core::f64::consts::FRAC_PI_2;

pub(super) fn add(scene: &mut Scene, scenario: &Scenario, strip: &Strip, seed: u64) {
    let line = &strip.line();
    grass(scene, line);
    let ways = ways(scenario, line);
    for (k, side) in [1.0, -1.0].into_iter().enumerate() {
        let edge_m = if side > 0.0 { strip.left_m } else { strip.right_m };
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

/// Scenery on one side of the road.
struct Row<'a> {
    scene: &'a mut Scene,
    line: &'a Polyline,
    /// 1 on the left, -1 on the right.
    side: f64,
    /// Distance from the line to the kerb, metres.
    kerb_m: f64,
    ways: &'a [Point2],
    rng: Rng,
}

impl Row<'_> {
    /// Position at `s_m` along the road and `out_m` beyond the kerb, for an item that covers a rectangle of ground;
    /// `None` on the path of an actor or where the road bends back to it.
    fn place(&self, s_m: f64, out_m: f64, (length_m, width_m): (f64, f64)) -> Option<(Point2, f64)> {
        let at = self.line.at(s_m).pose;
        let across = self.side * (self.kerb_m + out_m);
        let (sin, cos) = math::sin_cos(at.heading_rad);
        let point = Point2::new(at.x_m - across * sin, at.y_m + across * cos);
        let ground = Obb::new(Pose2::new(point.x_m, point.y_m, at.heading_rad), length_m, width_m);
        let clear = self.ways.iter().all(|way| ground.distance_to_point(*way) > CLEAR_M);
        let off_road = |corner: Point2| {
            let nearest = self.line.project(corner);
            self.line.at(nearest.s_m).pose.point().distance(corner) > self.kerb_m
        };
        (clear && ground.corners().into_iter().all(off_road)).then_some((point, at.heading_rad))
    }

    /// Yaw of an item that faces the road.
    fn facing(&self, road_rad: f64) -> f64 {
        road_rad - self.side * QUARTER
    }

    fn lamps(&mut self) {
        let mut s_m = -BUILT_M + if self.side > 0.0 { 0.0 } else { 14.0 };
        while s_m < self.line.length() + BUILT_M {
            if let Some((point, road_rad)) = self.place(s_m, 0.5, (0.3, 0.3)) {
                let model = self.scene.meshes.model(Kind::StreetLamp, 1);
                let instance = standing(&model, point, KERB_M, self.facing(road_rad));
                self.scene.add_static(instance);
                let (sin, cos) = math::sin_cos(self.facing(road_rad));
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
            if let Some((point, _)) = self.place(s_m, out_m, (0.8, 0.8)) {
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
            if let Some((point, road_rad)) = self.place(s_m + 0.5 * length_m, out_m, (length_m, depth_m)) {
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
            if let Some((point, road_rad)) = self.place(s_m, 0.4, (0.3, 0.3)) {
                let model = self.scene.meshes.model(Kind::SpeedSign { kmh: 50 }, 1);
                // Facing the traffic on its side.
                let facing = if self.side > 0.0 { road_rad } else { road_rad + core::f64::consts::PI };
                self.scene.add_static(standing(&model, point, KERB_M, facing));
            }
            s_m += 90.0;
        }
    }
}

fn standing(model: &swerve_scene::Model, at: Point2, z_m: f64, yaw_rad: f64) -> Instance {
    Instance::placed(
        model,
        Transform::from_roll_pitch_yaw(Point::new(at.x_m, at.y_m, z_m), 0.0, 0.0, yaw_rad),
    )
}

/// Points at most half a metre apart on the paths of actors, across their width.
fn ways(scenario: &Scenario, line: &Polyline) -> Vec<Point2> {
    let mut points = Vec::new();
    for actor in &scenario.actors {
        let mut at = actor.pose(line);
        let half_m = 0.5 * actor.extent.width_m.max(actor.extent.length_m);
        let mut go = |at: Pose2| {
            points.extend([-half_m, 0.0, half_m].map(|along| at.ahead(along).point()));
            points
                .extend([-half_m, half_m].map(|across| {
                    Pose2::new(at.x_m, at.y_m, at.heading_rad + QUARTER).ahead(across).point()
                }));
        };
        go(at);
        for leg in &actor.motion {
            let road_rad = line.at(line.project(at.point()).s_m).pose.heading_rad;
            let (heading_rad, distance_m) = match leg {
                Leg::Wait { .. } => continue,
                Leg::Track(track) => {
                    track.poses.iter().for_each(|pose| go(*pose));
                    continue;
                }
                Leg::Walk { distance_m, direction, turn_rad, .. } => {
                    (road_rad + turn(*direction) + turn_rad, *distance_m)
                }
                Leg::Drive { distance_m, .. } => (at.heading_rad, distance_m.unwrap_or(DRIVE_M)),
                Leg::Path { points: corners, .. } => {
                    for corner in corners {
                        let to = line.to_map(FrenetPoint { s_m: corner.s_m, d_m: corner.d_m });
                        let heading_rad = math::atan2(to.y_m - at.y_m, to.x_m - at.x_m);
                        let from = Pose2::new(at.x_m, at.y_m, heading_rad);
                        steps(at.point().distance(to)).for_each(|way_m| go(from.ahead(way_m)));
                        at = Pose2::new(to.x_m, to.y_m, heading_rad);
                    }
                    continue;
                }
            };
            let from = Pose2::new(at.x_m, at.y_m, heading_rad);
            steps(distance_m).for_each(|way_m| go(from.ahead(way_m)));
            at = from.ahead(distance_m);
        }
    }
    points
}

/// Distances from 0 to `length_m`, half a metre apart.
fn steps(length_m: f64) -> impl Iterator<Item = f64> {
    let n = (2.0 * length_m).ceil().clamp(1.0, 1000.0) as u32;
    (0..=n).map(move |k| length_m * f64::from(k) / f64::from(n))
}

fn turn(direction: Direction) -> f64 {
    match direction {
        Direction::Ahead => 0.0,
        Direction::Left => QUARTER,
        Direction::Right => -QUARTER,
        Direction::Back => core::f64::consts::PI,
    }
}

/// Grass to the horizon, slightly below the road.
fn grass(scene: &mut Scene, line: &Polyline) {
    let middle = line.at(0.5 * line.length()).pose;
    let corner = |sign: f64| Point2::new(middle.x_m + sign * HORIZON_M, middle.y_m + sign * HORIZON_M);
    for piece in ground_pieces(corner(-1.0), corner(1.0), -0.06) {
        scene.add_piece(piece);
    }
}
