//! A synthetic town: two crossing streets, houses, traffic. For examples, tests and benchmarks.

use swerve_geom::{Point, Point2, Transform};

use crate::SemanticClass;
use crate::hash::Draws;
use crate::library::{
    Kind, LaneLine, LinePattern, RoadLayout, RoadPiece, SideOfRoad, Size, ground_pieces, road_pieces,
};
use crate::look::lamps;
use crate::material::{Material, Texture};
use crate::mesh::MeshBuilder;
use crate::scene::{Instance, Light, Scene};
use crate::weather::WeatherPreset;

/// Half of the width of the main street, metres.
const HALF_M: f64 = 6.0;
/// Position of the crossing of side street and main street along x, metres.
const CROSSING_X_M: f64 = 38.0;

/// Creates a town in a weather: the main street runs along +x through the origin, with one lane in each direction and
/// parked cars.
///
/// The seed varies houses, trees, cars and people. Except for ground, nothing is farther from the origin than
/// `reach_m`; with 200 m there are about 170,000 triangles, with 42 m about 63,000.
pub fn town(preset: WeatherPreset, seed: u64, reach_m: f64) -> Scene {
    let mut scene = Scene::new(preset);
    ground(&mut scene);
    streets(&mut scene, seed);
    houses(&mut scene, seed);
    furniture(&mut scene, seed);
    parked(&mut scene, seed);
    traffic(&mut scene, seed);
    let near = |instance: &Instance| {
        let at = instance.map_from_body.origin().coords;
        let is_ground = matches!(instance.class, SemanticClass::Road | SemanticClass::Terrain);
        is_ground || at.x * at.x + at.y * at.y < reach_m * reach_m
    };
    let kept: Vec<Instance> = scene.statics().instances().iter().copied().filter(|i| near(i)).collect();
    scene.clear_statics();
    kept.into_iter().for_each(|instance| scene.add_static(instance));
    scene.dynamics.retain(near);
    scene
}

/// Pose in the ground plane: metres, and the angle from the x axis in radians.
#[derive(Clone, Copy)]
struct Spot {
    x: f64,
    y: f64,
    yaw: f64,
}

fn at(x: f64, y: f64, yaw: f64) -> Spot {
    Spot { x, y, yaw }
}

fn add(scene: &mut Scene, kind: Kind, seed: u64, spot: Spot) {
    let model = scene.meshes.model(kind, seed);
    scene.add_static(Instance::new(&model, spot.x, spot.y, spot.yaw));
}

/// Grass up to the horizon.
fn ground(scene: &mut Scene) {
    for piece in ground_pieces(Point2::new(-360.0, -360.0), Point2::new(520.0, 360.0), -0.06) {
        scene.add_piece(piece);
    }
}

fn streets(scene: &mut Scene, seed: u64) {
    let line =
        |offset_m: f32, width_m: f32, pattern| LaneLine { offset_m, width_m, pattern, is_yellow: false };
    let main = RoadLayout {
        lines: vec![
            line(0.0, 0.14, LinePattern::Dashed { stroke_m: 3.0, gap_m: 4.5 }),
            line(3.7, 0.12, LinePattern::Solid),
            line(-3.7, 0.12, LinePattern::Solid),
        ],
        crossings_m: vec![(CROSSING_X_M - 8.0) as f32 + 90.0, (CROSSING_X_M + 8.0) as f32 + 90.0],
        stop_lines_m: vec![(CROSSING_X_M - 11.5) as f32 + 90.0],
        left_side: SideOfRoad::Pavement { width_m: 3.0 },
        right_side: SideOfRoad::Pavement { width_m: 3.0 },
        ..RoadLayout::street(
            vec![Point2::new(-90.0, 0.0), Point2::new(150.0, 0.0), Point2::new(260.0, 18.0)],
            HALF_M as f32,
            HALF_M as f32,
        )
    };
    let mut pieces = road_pieces(&main, seed);
    // The side street ends at the kerbs of the main street, whose pavement is lowered there.
    for out in [1.0, -1.0] {
        let centre =
            vec![Point2::new(CROSSING_X_M, out * (HALF_M - 0.2)), Point2::new(CROSSING_X_M, out * 120.0)];
        let mut side = RoadLayout::street(centre, 3.5, 3.5);
        side.stop_lines_m = vec![1.2];
        pieces.extend(road_pieces(&side, seed ^ 7));
    }
    pieces.into_iter().for_each(|piece| scene.add_piece(piece));
    apron(scene);
}

/// Asphalt over the pavements at the mouth of the side street, slightly above them.
fn apron(scene: &mut Scene) {
    let mut builder = MeshBuilder::new(20.0);
    let asphalt = Material { is_ground: true, ..Material::matt([0.115, 0.115, 0.118], 0.17) };
    let asphalt = asphalt.textured(Texture::Asphalt, [0.2, 0.197, 0.19], 4.0).glossy(0.85, 0.04);
    let asphalt = builder.material(asphalt);
    for out in [1.0_f32, -1.0] {
        let (y0, y1) = (out * HALF_M as f32, out * (HALF_M as f32 + 3.3));
        let (low, high) = (y0.min(y1), y0.max(y1));
        let x = CROSSING_X_M as f32;
        let z = 0.125;
        builder.quad(asphalt, [[x - 3.5, low, z], [x + 3.5, low, z], [x + 3.5, high, z], [x - 3.5, high, z]]);
        // A ramp down to the main street.
        let (edge, foot) = (y0, y0 - out * 0.5);
        let ramp = [[x - 3.5, foot, 0.004], [x + 3.5, foot, 0.004], [x + 3.5, edge, z], [x - 3.5, edge, z]];
        let ramp = if out > 0.0 { ramp } else { [ramp[3], ramp[2], ramp[1], ramp[0]] };
        builder.quad(asphalt, ramp);
    }
    let map_from_body = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    scene.add_piece(RoadPiece { mesh: builder.finish(), class: SemanticClass::Road, map_from_body });
}

/// Rows of houses along both streets, and some behind.
fn houses(scene: &mut Scene, seed: u64) {
    let mut draws = Draws::new(seed, 0x4005e);
    let mut number = 0;
    let mut house = |scene: &mut Scene, spot: Spot, length: f64, draws: &mut Draws| {
        number += 1;
        let height = f64::from(draws.between(7.5, 17.0));
        let size = Size::from_m(length, f64::from(draws.between(10.0, 13.0)), height);
        let model = scene.meshes.model_sized(Kind::Building, size, seed.wrapping_add(number * 977));
        scene.add_static(Instance::new(&model, spot.x, spot.y, spot.yaw).with_id(0));
    };
    for side in [1.0, -1.0] {
        let mut x = -85.0;
        while x < 190.0 {
            let length = f64::from(draws.between(11.0, 20.0));
            let middle = x + 0.5 * length;
            let gap = f64::from(draws.between(0.0, 3.5));
            if (middle - CROSSING_X_M).abs() > 0.5 * length + 7.5 {
                let back = f64::from(draws.between(0.0, 2.0));
                let bend = if middle > 150.0 { (middle - 150.0) * 0.165 } else { 0.0 };
                let front = if side > 0.0 { core::f64::consts::PI } else { 0.0 };
                house(
                    scene,
                    at(middle, side * (HALF_M + 3.6 + 6.5 + back) + bend, front),
                    length,
                    &mut draws,
                );
            }
            x += length + gap;
        }
        for k in 0..4 {
            let y = side * (31.0 + 20.0 * f64::from(k));
            let quarter = core::f64::consts::FRAC_PI_2;
            house(scene, at(CROSSING_X_M - 13.5, y, quarter), 17.0, &mut draws);
            house(scene, at(CROSSING_X_M + 13.5, y, -quarter), 17.0, &mut draws);
        }
    }
}

/// Trees, lamps, signs, bins, a traffic light on each side of the crossing.
fn furniture(scene: &mut Scene, seed: u64) {
    let mut draws = Draws::new(seed, 0xf00d);
    let quarter = core::f64::consts::FRAC_PI_2;
    let kerb = HALF_M + 0.6;
    let clear = |x: f64| (x - CROSSING_X_M).abs() > 9.0;
    for (k, side) in [(0_u64, 1.0), (1, -1.0)] {
        let mut x = -80.0 + 6.0 * side;
        while x < 150.0 {
            let seed = seed.wrapping_mul(31).wrapping_add(k * 1000 + (x + 100.0) as u64);
            if clear(x) && draws.chance(0.75) {
                add(scene, Kind::Tree, seed, at(x, side * (kerb + 0.5), f64::from(draws.between(0.0, 6.0))));
            }
            x += f64::from(draws.between(10.0, 17.0));
        }
        for k in 0..8 {
            let x = -75.0 + 28.0 * f64::from(k) + 7.0 * side;
            if clear(x) {
                let model = scene.meshes.model(Kind::StreetLamp, 1);
                let yaw = -side * quarter;
                scene.add_static(Instance::new(&model, x, side * (kerb - 0.7), yaw));
                scene.lights.push(Light::street_lamp([x, side * (kerb - 1.5), 7.2]));
            }
        }
        for k in 0..5 {
            let x = -60.0 + 41.0 * f64::from(k) + 9.0 * side;
            if clear(x) {
                add(scene, Kind::Bin, seed, at(x, side * (kerb + 1.6), 0.0));
            }
        }
    }
    // Signs face the traffic that they apply to.
    let right = -(HALF_M + 0.5);
    add(scene, Kind::SpeedSign { kmh: 50 }, seed, at(16.0, right, core::f64::consts::PI));
    add(scene, Kind::SpeedSign { kmh: 30 }, seed, at(74.0, right, core::f64::consts::PI));
    add(scene, Kind::StopSign, seed, at(CROSSING_X_M + 4.2, HALF_M + 1.0, quarter));
    add(scene, Kind::StopSign, seed, at(CROSSING_X_M - 4.2, -(HALF_M + 1.0), -quarter));
    for (x, y, yaw, lamp) in [
        (CROSSING_X_M - 10.8, right, core::f64::consts::PI, lamps::RED),
        (CROSSING_X_M - 10.8, -right, core::f64::consts::PI, lamps::RED),
        (CROSSING_X_M + 10.8, -right, 0.0, lamps::GREEN),
    ] {
        let model = scene.meshes.model(Kind::TrafficLight, seed);
        let mut instance = Instance::new(&model, x, y, yaw);
        instance.look = instance.look.with_lamp(lamp, true);
        scene.dynamics.push(instance);
    }
    for k in 0..5 {
        let model = scene.meshes.model(Kind::GuardRail, seed);
        scene.add_static(Instance::new(&model, 152.0 + 8.0 * f64::from(k), -6.9 + 1.3 * f64::from(k), 0.16));
    }
}

const CARS: [Kind; 6] = [Kind::Sedan, Kind::Hatchback, Kind::Suv, Kind::Hatchback, Kind::Sedan, Kind::Van];

/// Cars along both kerbs.
fn parked(scene: &mut Scene, seed: u64) {
    let mut draws = Draws::new(seed, 0xca75);
    let mut id = 100;
    for side in [1.0, -1.0] {
        let mut x = -70.0;
        while x < 145.0 {
            let kind = draws.one_of(&CARS);
            let pick = u64::from(draws.bits());
            let clear = (x - CROSSING_X_M).abs() > 15.0;
            if clear && draws.chance(0.62) {
                id += 1;
                let model = scene.meshes.model(kind, pick);
                let yaw = if side > 0.0 { core::f64::consts::PI } else { 0.0 };
                let wobble = f64::from(draws.between(-0.02, 0.02));
                scene.add_static(Instance::new(&model, x, side * 4.9, yaw + wobble).with_id(id));
            }
            x += 6.3;
        }
    }
}

/// Moving things: vehicles on both lanes, people on the pavements and on the crossing, a cyclist.
fn traffic(scene: &mut Scene, seed: u64) {
    let pi = core::f64::consts::PI;
    let moving = [
        (Kind::Sedan, 15.5, -1.85, 0.0, 1),
        (Kind::BoxTruck, 27.0, 1.85, pi, 2),
        (Kind::Suv, 61.0, -1.9, 0.0, 3),
        (Kind::Bus, 72.0, 1.9, pi, 4),
        (Kind::Motorcycle, 23.0, -1.7, 0.0, 5),
        (Kind::Cyclist { phase: 5 }, 11.0, -3.3, 0.0, 6),
        (Kind::Hatchback, 44.5, 1.8, pi, 7),
        (Kind::Van, 96.0, -1.8, 0.0, 8),
    ];
    for (kind, x, y, yaw, id) in moving {
        let model = scene.meshes.model(kind, seed.wrapping_add(u64::from(id) * 7919));
        let mut instance = Instance::new(&model, x, y, yaw).with_id(id);
        let is_dark = scene.weather.lamps_on;
        let vehicle = !matches!(kind, Kind::Cyclist { .. });
        if vehicle {
            instance.look = instance.look.with_lamp(lamps::HEAD, is_dark).with_lamp(lamps::TAIL, is_dark);
            instance.look = instance.look.with_lamp(lamps::BRAKE, id == 1);
            let front = 0.5 * f64::from(model.size.metres()[0]);
            scene.lights.extend(Light::head_lamps(&instance.map_from_body, front, 0.7));
        }
        let speed = if vehicle { 8.0 } else { 4.0 };
        instance.motion.linear_mps = [if yaw == 0.0 { speed } else { -speed }, 0.0, 0.0];
        scene.dynamics.push(instance);
    }
    let mut draws = Draws::new(seed, 0x9e0);
    for k in 0..24_u32 {
        let x =
            if k < 6 { f64::from(draws.between(4.0, 26.0)) } else { f64::from(draws.between(-30.0, 100.0)) };
        let side = if draws.chance(0.5) { 1.0 } else { -1.0 };
        let y = side * (HALF_M + f64::from(draws.between(0.9, 2.7)));
        let yaw = if draws.chance(0.5) { 0.0 } else { pi };
        let phase = draws.below(16) as u8;
        person(scene, seed.wrapping_add(u64::from(k)), at(x, y, yaw), phase, 20 + k);
    }
    person(scene, seed ^ 3, at(CROSSING_X_M - 8.4, -1.2, 0.5 * pi), 2, 50);
    person(scene, seed ^ 4, at(CROSSING_X_M - 7.4, 2.4, -0.5 * pi), 9, 51);
}

fn person(scene: &mut Scene, seed: u64, spot: Spot, phase: u8, id: u32) {
    let Spot { x, y, yaw } = spot;
    let model = scene.meshes.model(Kind::Pedestrian { phase }, seed);
    let height = if y.abs() > HALF_M { 0.12 } else { 0.0 };
    let pose = Transform::from_roll_pitch_yaw(Point::new(x, y, height), 0.0, 0.0, yaw);
    let mut instance = Instance::placed(&model, pose).with_id(id);
    let (sin, cos) = swerve_geom::math::sin_cos(yaw);
    instance.motion.linear_mps = [1.4 * cos, 1.4 * sin, 0.0];
    scene.dynamics.push(instance);
}
