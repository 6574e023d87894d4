use core::f64::consts::PI;

use swerve_geom::{Lidar, Map, Point, Transform};
use swerve_scene::hash::{Draws, Key};
use swerve_scene::town::town;
use swerve_scene::{
    Body, Instance, Kind, Look, Material, Mesh, MeshBuilder, Motion, Scene, SemanticClass, WeatherPreset,
};

use crate::*;

mod allocations;
mod depth_image;
mod moving;
mod specs;
mod trees;

fn at(x: f64, y: f64, z: f64) -> Transform<Map, Lidar> {
    Transform::from_roll_pitch_yaw(Point::new(x, y, z), 0.0, 0.0, 0.0)
}

/// Instance of a mesh at a pose.
fn instance(scene: &mut Scene, mesh: Mesh, pose: Transform<Map, Body>) -> Instance {
    Instance {
        mesh: scene.meshes.add(mesh),
        map_from_body: pose,
        instance_id: 0,
        class: SemanticClass::Wall,
        look: Look::default(),
        motion: Motion::default(),
    }
}

fn unmoved() -> Transform<Map, Body> {
    Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0)
}

fn quad(corners: [[f32; 3]; 4], material: Material) -> Mesh {
    let mut builder = MeshBuilder::new(20.0);
    let material = builder.material(material);
    builder.quad(material, corners);
    builder.finish()
}

/// White square on the ground, 400 m wide.
fn plain() -> Scene {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let half = 200.0;
    let corners = [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]];
    let ground = instance(&mut scene, quad(corners, Material::matt([0.5; 3], 1.0)), unmoved());
    scene.add_static(ground);
    scene
}

/// Wall across x.
fn wall(x: f32) -> Mesh {
    quad(
        [[x, 60.0, -5.0], [x, -60.0, -5.0], [x, -60.0, 20.0], [x, 60.0, 20.0]],
        Material::matt([0.5; 3], 0.8),
    )
}

/// Whole turn of a sensor at rest.
fn turn(spec: LidarSpec, tree: &SceneTree, pose: Transform<Map, Lidar>, threads: usize) -> Cloud {
    let mut cloud = Cloud::new(&spec, true);
    let mut sweeper = Sweeper::new(spec, threads).unwrap();
    let firing = Firing::turn_at_rest(&sweeper, pose);
    sweeper.begin_turn(5, &mut cloud.as_mut());
    let fired = sweeper.fire(tree, &firing, &mut cloud.as_mut()).unwrap();
    assert!(fired.is_complete && fired.columns == (0..sweeper.spec().columns));
    cloud
}

fn few_columns(preset: LidarPreset, columns: u32) -> LidarSpec {
    LidarSpec { columns, ..preset.spec() }
}

#[test]
fn sphere_is_hit_at_its_closed_form_distance() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let mut builder = MeshBuilder::new(180.0);
    let material = builder.material(Material::default());
    builder.ball(material, [2.0; 3], 96, 48, |_, _| 1.0);
    let ball = instance(&mut scene, builder.finish(), unmoved());
    let pose = Transform::from_roll_pitch_yaw(Point::new(12.0, 3.0, 1.0), 0.4, 0.2, 1.0);
    scene.dynamics.push(Instance { map_from_body: pose, ..ball });
    let tree = SceneTree::new(&scene).unwrap();
    let spec = few_columns(LidarPreset::Os1, 720).without_noise();
    let cloud = turn(spec, &tree, at(0.0, 0.0, 1.5), 1);
    assert!(cloud.len > 200, "{}", cloud.len);
    for k in 0..cloud.len {
        let [x, y, z] = cloud.point_m(k).map(f64::from);
        let off = ((x - 12.0).powi(2) + (y - 3.0).powi(2) + (z + 0.5).powi(2)).sqrt();
        // Facets are inside the sphere by at most their sagitta.
        assert!(off < 2.0 + 1e-4 && off > 2.0 * 0.997, "{off}");
    }
}

#[test]
fn points_of_a_plane_have_the_specified_noise() {
    let tree = SceneTree::new(&plain()).unwrap();
    let spec = LidarSpec { dropout: 0.0, reach_m: 1e4, range_step_m: 0.0, ..LidarPreset::Vlp32.spec() };
    let (sigma, height) = (spec.range_sigma_m, 1.9);
    let beams = spec.beams.clone();
    let cloud = turn(spec, &tree, at(3.0, -2.0, height), 1);
    let mut errors = Vec::new();
    for k in 0..cloud.len {
        let sine = swerve_geom::math::sin(beams[usize::from(cloud.ring[k])].elevation_rad);
        assert!(sine < 0.0);
        // The expected range on the plane is height / -sine.
        let [x, y, z] = cloud.point_m(k).map(f64::from);
        errors.push((x * x + y * y + z * z).sqrt() - height / -sine);
    }
    let count = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / count;
    let deviation = (errors.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / count).sqrt();
    assert!(count > 25_000.0, "{count}");
    assert!(mean.abs() < 0.001 && (deviation / sigma - 1.0).abs() < 0.03, "{mean} {deviation}");
}

#[test]
fn turn_is_independent_of_threads_and_pieces() {
    let scene = town(WeatherPreset::SoftRainNoon, 3, 60.0);
    let tree = SceneTree::new(&scene).unwrap();
    let pose = Transform::from_roll_pitch_yaw(Point::new(1.0, -1.8, 1.9), 0.01, -0.02, 0.3);
    let spec = few_columns(LidarPreset::Hdl64, 301);
    let one = turn(spec.clone(), &tree, pose, 1);
    assert!(one.len > 8000, "{}", one.len);
    for threads in [2, 8] {
        assert!(turn(spec.clone(), &tree, pose, threads) == one, "{threads} threads");
    }
    let mut cloud = Cloud::new(&spec, true);
    let mut sweeper = Sweeper::new(spec.clone(), 2).unwrap();
    sweeper.begin_turn(5, &mut cloud.as_mut());
    let mut is_complete = false;
    for step in -1..20_i64 {
        let (begin_ns, end_ns) = (step * 5_000_000 + 1234, (step + 1) * 5_000_000 + 1234);
        let firing = Firing { begin_ns, end_ns, ..Firing::turn_at_rest(&sweeper, pose) };
        assert!(!is_complete);
        is_complete = sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap().is_complete;
    }
    assert!(is_complete && cloud == one);
    sweeper.begin_turn(6, &mut cloud.as_mut());
    sweeper.fire(&tree, &Firing::turn_at_rest(&sweeper, pose), &mut cloud.as_mut()).unwrap();
    assert!(cloud != one, "another turn has other noise");
}

#[test]
fn turn_has_the_same_digest_on_every_machine() {
    // Only custom triangles, so that changes of the library's shapes do not change the digest.
    let mut scene = plain();
    scene.set_weather(WeatherPreset::MidRainyNoon);
    let mut draws = Draws::new(8, 0xb175);
    let mut builder = MeshBuilder::new(20.0);
    let material = builder.material(Material::matt([0.5; 3], 0.6));
    for _ in 0..400 {
        let middle = [0, 1, 2].map(|axis| draws.between(-30.0, 30.0) * [1.0, 1.0, 0.1][axis]);
        let corners = [0, 1, 2].map(|_| middle.map(|x| x + draws.between(-2.0, 2.0)));
        builder.triangle(material, corners, [[0.0; 2]; 3]);
    }
    let loose = instance(&mut scene, builder.finish(), unmoved());
    let pose = Transform::from_roll_pitch_yaw(Point::new(3.0, -4.0, 0.5), 0.1, -0.2, 0.7);
    scene.dynamics.push(Instance { map_from_body: pose, ..loose });
    let tree = SceneTree::new(&scene).unwrap();
    let pose = Transform::from_roll_pitch_yaw(Point::new(1.0, 2.0, 1.9), 0.01, 0.02, 0.3);
    let cloud = turn(few_columns(LidarPreset::Os1, 500), &tree, pose, 1);
    let mut key = Key::default();
    for k in 0..cloud.len {
        cloud.point_m(k).iter().for_each(|x| key.number(*x));
        key.number(cloud.intensity[k]);
        key.number(cloud.offset_s[k]);
        key.word(u32::from(cloud.ring[k]));
    }
    assert_eq!((cloud.len, key.0), (18_611, 3_848_913_233_546_258_641));
}

#[test]
fn dropout_share_matches_the_spec() {
    let tree = SceneTree::new(&plain()).unwrap();
    let all = turn(few_columns(LidarPreset::Vlp32, 900).without_noise(), &tree, at(0.0, 0.0, 1.9), 1);
    let lossy = LidarSpec { dropout: 0.2, ..few_columns(LidarPreset::Vlp32, 900).without_noise() };
    let some = turn(lossy, &tree, at(0.0, 0.0, 1.9), 1);
    let share = 1.0 - some.len as f64 / all.len as f64;
    assert!((share - 0.2).abs() < 0.01, "{share}");
    let none = LidarSpec { dropout: 1.0, ..few_columns(LidarPreset::Vlp32, 900) };
    assert_eq!(turn(none, &tree, at(0.0, 0.0, 1.9), 1).len, 0);
}

#[test]
fn rain_reduces_range_and_intensity() {
    let farthest = |preset: WeatherPreset| {
        let mut scene = plain();
        scene.set_weather(preset);
        let tree = SceneTree::new(&scene).unwrap();
        let cloud = turn(few_columns(LidarPreset::Vlp32, 600), &tree, at(0.0, 0.0, 1.9), 1);
        let mut ranges: Vec<f32> =
            (0..cloud.len).map(|k| cloud.x_m[k].abs().max(cloud.y_m[k].abs())).collect();
        ranges.sort_by(f32::total_cmp);
        // Mean intensity of a ring that hits the ground at 15 m, which is detected in any weather.
        let near: Vec<f32> =
            (0..cloud.len).filter(|&k| cloud.ring[k] == 4).map(|k| cloud.intensity[k]).collect();
        assert!(near.len() > 500);
        (cloud.len, ranges[ranges.len() * 98 / 100], near.iter().sum::<f32>() / near.len() as f32)
    };
    let [clear, soft, hard] =
        [WeatherPreset::ClearNoon, WeatherPreset::SoftRainNoon, WeatherPreset::HardRainNoon].map(farthest);
    assert!(clear.0 > soft.0 && soft.0 > hard.0, "{clear:?} {soft:?} {hard:?}");
    assert!(clear.1 > soft.1 && soft.1 > 1.05 * hard.1, "{clear:?} {soft:?} {hard:?}");
    assert!(clear.2 > soft.2 && soft.2 > hard.2, "{clear:?} {soft:?} {hard:?}");
}

#[test]
fn signs_saturate_intensity_within_its_scale() {
    let mut scene = plain();
    let sign = scene.meshes.model(Kind::StopSign, 1);
    scene.dynamics.push(Instance::new(&sign, 15.0, 0.0, PI).with_id(3));
    let tree = SceneTree::new(&scene).unwrap();
    let cloud = turn(LidarPreset::Hdl64.spec(), &tree, at(0.0, 0.0, 2.0), 1);
    let face = SemanticClass::TrafficSign as u8;
    let bright: Vec<usize> = (0..cloud.len).filter(|&k| cloud.class[k] == face).collect();
    assert!(bright.len() > 10 && bright.iter().all(|&k| cloud.instance[k] == 3));
    assert!(bright.iter().filter(|&&k| cloud.intensity[k] == 1.0).count() * 2 > bright.len());
    assert!(cloud.intensity[..cloud.len].iter().all(|i| (0.0..=1.0).contains(i)));
    // The pole of the sign is dull.
    let dull = |k: &usize| cloud.instance[*k] == 3 && cloud.class[*k] != face;
    let dull: Vec<f32> = (0..cloud.len).filter(dull).map(|k| cloud.intensity[k]).collect();
    assert!(dull.len() > 3 && dull.iter().all(|i| *i < 0.5), "{dull:?}");
}

#[test]
fn carrying_vehicle_can_be_hidden() {
    let mut scene = plain();
    let own = scene.meshes.model(Kind::Sedan, 1);
    scene.dynamics.push(Instance::new(&own, 0.0, 0.0, 0.0).with_id(77));
    let tree = SceneTree::new(&scene).unwrap();
    let spec = LidarSpec { range_min_m: 0.1, ..few_columns(LidarPreset::Vlp32, 300).without_noise() };
    let seen = turn(spec.clone(), &tree, at(0.0, 0.0, 1.7), 1);
    assert!(seen.instance[..seen.len].contains(&77));
    let mut cloud = Cloud::new(&spec, true);
    let mut sweeper = Sweeper::new(spec, 1).unwrap();
    sweeper.begin_turn(0, &mut cloud.as_mut());
    let firing = Firing { hidden_instance: Some(77), ..Firing::turn_at_rest(&sweeper, at(0.0, 0.0, 1.7)) };
    sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap();
    assert!(cloud.len > 1000 && !cloud.instance[..cloud.len].contains(&77));
}
