use core::f64::consts::{FRAC_PI_2, PI};

use swerve_geom::{Ego, Lidar, Map, Point, Transform};

use super::*;
use crate::hash::Draws;
use crate::mesh::Builder;
use crate::town::town;
use crate::{
    Body, Camera, CameraSpec, Frame, Instance, Intrinsics, Kind, Look, Material, Mesh, Motion, Outputs,
    RenderOptions, Renderer, Scene, SemanticClass, Size, View, WeatherPreset, mount,
};

fn at(x: f64, y: f64, z: f64) -> Transform<Map, Lidar> {
    Transform::from_roll_pitch_yaw(Point::new(x, y, z), 0.0, 0.0, 0.0)
}

/// A mesh with one material as an instance at a pose.
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
    let mut builder = Builder::new(20.0);
    let material = builder.material(material);
    builder.quad(material, corners);
    builder.finish()
}

/// A white square on the ground, 400 m wide.
fn plain() -> Scene {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let half = 200.0;
    let corners = [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]];
    let ground = instance(&mut scene, quad(corners, Material::matt([0.5; 3], 1.0)), unmoved());
    scene.add_static(ground);
    scene
}

/// A wall across x.
fn wall(x: f32) -> Mesh {
    quad(
        [[x, 60.0, -5.0], [x, -60.0, -5.0], [x, -60.0, 20.0], [x, 60.0, 20.0]],
        Material::matt([0.5; 3], 0.8),
    )
}

/// A whole turn of a sensor at rest.
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

/// Loose triangles, houses, cars and people in all poses.
fn jumble(seed: u64) -> Scene {
    let mut draws = Draws::new(seed, 0x11da);
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let mut builder = Builder::new(20.0);
    let material = builder.material(Material::default());
    for _ in 0..300 {
        let mut near = |middle: [f32; 3], reach: f32| middle.map(|x| x + draws.between(-reach, reach));
        let middle = near([0.0; 3], 20.0);
        let corners = [near(middle, 4.0), near(middle, 4.0), near(middle, 4.0)];
        builder.triangle(material, corners, [[0.0; 2]; 3]);
    }
    let loose = instance(&mut scene, builder.finish(), unmoved());
    scene.add_static(loose);
    let kinds = [Kind::Sedan, Kind::Building, Kind::Pedestrian { phase: 3 }, Kind::Tree, Kind::StopSign];
    for k in 0..30_u32 {
        let model = scene.meshes.model(draws.one_of(&kinds), u64::from(k % 4));
        let mut number = |reach: f32| f64::from(draws.between(-reach, reach));
        let point = Point::new(number(40.0), number(40.0), number(5.0));
        let pose = Transform::from_roll_pitch_yaw(point, number(0.5), number(0.5), number(3.0));
        let instance = Instance::placed(&model, pose).with_id(100 + k);
        if k % 2 == 0 { scene.add_static(instance) } else { scene.dynamics.push(instance) }
    }
    scene
}

type V = [f64; 3];

fn minus(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn inner(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn outer(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Nearest distance over all triangles of all instances, in `f64` and the map frame (Möller-Trumbore), in lengths
/// of `to`, and the instance id.
fn brute_force(triangles: &[([V; 3], u32)], origin: V, to: V) -> Option<(f64, u32)> {
    let mut best: Option<(f64, u32)> = None;
    for ([a, b, c], id) in triangles {
        let (edge_1, edge_2) = (minus(*b, *a), minus(*c, *a));
        let p = outer(to, edge_2);
        let det = inner(edge_1, p);
        let s = minus(origin, *a);
        let u = inner(s, p) / det;
        let q = outer(s, edge_1);
        let v = inner(to, q) / det;
        let t = inner(edge_2, q) / det;
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && best.is_none_or(|(least, _)| t < least) {
            best = Some((t, *id));
        }
    }
    best
}

fn all_triangles(scene: &Scene) -> Vec<([V; 3], u32)> {
    let mut triangles = Vec::new();
    for instance in scene.statics().instances().iter().chain(&scene.dynamics) {
        let mesh = scene.meshes.get(instance.mesh);
        for corners in mesh.triangles() {
            let corner = |k: usize| {
                let [x, y, z] = mesh.positions()[corners[k] as usize].map(f64::from);
                (instance.map_from_body * Point::new(x, y, z)).coords.into()
            };
            triangles.push(([corner(0), corner(1), corner(2)], instance.instance_id));
        }
    }
    triangles
}

#[test]
fn the_tree_finds_what_a_search_through_all_triangles_finds() {
    let (mut hits, mut misses, mut others) = (0, 0, 0);
    for seed in 0..3 {
        let scene = jumble(seed);
        let tree = SceneTree::new(&scene).unwrap();
        let triangles = all_triangles(&scene);
        let mut draws = Draws::new(seed, 0x7a75);
        let mut memory = RayMemory::default();
        for _ in 0..700 {
            let mut number = |reach: f32| f64::from(draws.between(-reach, reach));
            let origin = [number(45.0), number(45.0), number(12.0)];
            let to = [number(1.0), number(1.0), number(0.4)];
            let length = inner(to, to).sqrt();
            let found = tree.cast_with(&mut memory, origin, to, 1e4, None);
            match (found, brute_force(&triangles, origin, to)) {
                (Some(hit), Some((t, id))) if (f64::from(hit.distance_m) - t * length).abs() < 2e-4 => {
                    assert_eq!(hit.instance_id, id);
                    hits += 1;
                }
                (None, None) => misses += 1,
                // A ray within rounding of an edge may go by on the other side.
                _ => others += 1,
            }
        }
    }
    assert!(hits > 500 && misses > 500 && others <= 1, "{hits} {misses} {others}");
}

#[test]
fn packets_find_to_the_bit_what_single_rays_find() {
    use wide::f32x8;
    let scene = jumble(9);
    let tree = SceneTree::new(&scene).unwrap();
    let mut draws = Draws::new(4, 0x9ac);
    let mut memory = RayMemory::default();
    let mut hits = 0;
    for k in 0..600 {
        // Some packets are narrow, some go anywhere; some lie in a plane of the axes.
        let spread = [0.01, 0.2, 2.0][k % 3];
        let middle = [0, 1, 2].map(|_| draws.between(-1.0, 1.0));
        let flat = k % 5 == 0;
        let start = [0, 1, 2].map(|_| draws.between(-30.0, 30.0));
        let (mut origins, mut directions) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
        for lane in 0..8 {
            let direction = crate::vector::normalized([0, 1, 2].map(|axis| {
                if flat && axis == 2 { 0.0 } else { middle[axis] + draws.between(-spread, spread) }
            }));
            for axis in 0..3 {
                origins[axis][lane] = start[axis] + draws.between(-0.1, 0.1);
                directions[axis][lane] = direction[axis];
            }
        }
        let hidden = (k % 2 == 0).then_some(101);
        let range = [40.0, 40.0, 40.0, 5.0, 40.0, 40.0, -1.0, 40.0];
        let packet = tree.first_of_packet(
            &mut memory,
            origins.map(f32x8::new),
            directions.map(f32x8::new),
            f32x8::new(range),
            hidden,
        );
        for lane in 0..8 {
            let ray = |parts: &[[f32; 8]; 3]| [parts[0][lane], parts[1][lane], parts[2][lane]];
            let single = tree.first(&mut memory, ray(&origins), ray(&directions), range[lane], hidden);
            assert_eq!(packet[lane], single, "packet {k}, lane {lane}");
            hits += u32::from(single.is_some());
        }
    }
    assert!(hits > 500, "{hits}");
}

#[test]
fn an_updated_tree_answers_as_a_fresh_one() {
    let mut scene = jumble(1);
    let mut kept = SceneTree::new(&scene).unwrap();
    for step in 0..4 {
        for instance in &mut scene.dynamics {
            let origin = instance.map_from_body.origin().coords;
            let point = Point::new(origin.x + 1.5, origin.y - 0.5, origin.z);
            instance.map_from_body = Transform::new(point, instance.map_from_body.rotation());
        }
        let walker = scene.meshes.model(Kind::Pedestrian { phase: step }, 3);
        scene.dynamics.push(Instance::new(&walker, 2.0, f64::from(step), 0.0).with_id(900));
        if step == 2 {
            let house = scene.meshes.model(Kind::Building, 77);
            scene.add_static(Instance::new(&house, 30.0, 0.0, 0.3).with_id(901));
        }
        kept.update(&scene).unwrap();
        let fresh = SceneTree::new(&scene).unwrap();
        let mut draws = Draws::new(u64::from(step), 0xf4e5);
        for _ in 0..400 {
            let mut number = |reach: f32| f64::from(draws.between(-reach, reach));
            let origin = [number(45.0), number(45.0), 1.0 + number(1.0)];
            let to = [number(1.0), number(1.0), number(0.2)];
            assert_eq!(kept.cast(origin, to, 100.0), fresh.cast(origin, to, 100.0));
        }
    }
}

#[test]
fn static_things_too_many_for_one_tree_are_met_all_the_same() {
    let scene = jumble(5);
    let whole = SceneTree::new(&scene).unwrap();
    let mut draws = Draws::new(5, 0xfa4);
    let rays: Vec<[V; 2]> = (0..800)
        .map(|_| {
            let mut number = |reach: f32| f64::from(draws.between(-reach, reach));
            [[number(45.0), number(45.0), number(9.0)], [number(1.0), number(1.0), number(0.3)]]
        })
        .collect();
    let mut hits = 0;
    for most in [0, 1000] {
        let mut parted = SceneTree::with_static_triangles(most);
        parted.update(&scene).unwrap();
        for [origin, to] in &rays {
            match (whole.cast(*origin, *to, 100.0), parted.cast(*origin, *to, 100.0)) {
                (Some(a), Some(b)) => {
                    hits += 1;
                    assert!((a.distance_m - b.distance_m).abs() < 1e-4, "{a:?} {b:?}");
                    assert_eq!((a.instance_id, a.class, a.mesh), (b.instance_id, b.class, b.mesh));
                }
                (None, None) => {}
                other => panic!("{other:?}"),
            }
        }
    }
    assert!(hits > 300, "{hits}");
    let pose = at(0.0, 0.0, 2.0);
    let spec = few_columns(LidarPreset::Os1, 200);
    let mut parted = SceneTree::with_static_triangles(0);
    parted.update(&scene).unwrap();
    let (one, other) = (turn(spec.clone(), &whole, pose, 1), turn(spec, &parted, pose, 1));
    assert!(one.len > 1000 && one.len.abs_diff(other.len) < 5, "{} {}", one.len, other.len);
}

#[test]
fn hits_tell_distance_surface_and_side() {
    let mut scene = plain();
    let model = scene.meshes.model_sized(Kind::Block, Size::from_m(2.0, 4.0, 3.0), 0);
    let quarter = Transform::from_roll_pitch_yaw(Point::new(10.0, 0.0, 0.0), 0.0, 0.0, FRAC_PI_2);
    scene.dynamics.push(Instance::placed(&model, quarter).with_id(7));
    let tree = SceneTree::new(&scene).unwrap();
    // The box is 4 m along x after its quarter turn: its face is at x = 8.
    let hit = tree.cast([0.0, 0.5, 1.0], [2.0, 0.0, 0.0], 100.0).unwrap();
    assert!((hit.distance_m - 8.0).abs() < 1e-5, "{hit:?}");
    assert_eq!((hit.instance_id, hit.class, hit.mesh), (7, SemanticClass::Static, model.mesh));
    assert!((hit.normal[0] + 1.0).abs() < 1e-6, "{hit:?}");
    let own = scene.meshes.get(hit.mesh).materials()[usize::from(hit.material)];
    assert_eq!((hit.reflectance, hit.is_retro_reflective), (own.reflectance, own.is_retro_reflective));
    // Hidden: the ray goes through to nothing; from inside, the far face is met from behind.
    let mut memory = RayMemory::default();
    assert_eq!(tree.cast_with(&mut memory, [0.0, 0.5, 1.0], [1.0, 0.0, 0.0], 100.0, Some(7)), None);
    let inside = tree.cast([10.0, 0.0, 1.0], [1.0, 0.0, 0.0], 100.0).unwrap();
    assert!((inside.distance_m - 2.0).abs() < 1e-5 && inside.normal[0] < -0.99, "{inside:?}");
    assert_eq!(tree.cast([0.0, 0.5, 1.0], [1.0, 0.0, 0.0], 7.9), None);
    for (origin, direction, range) in [
        ([f64::NAN, 0.0, 1.0], [1.0, 0.0, 0.0], 50.0),
        ([0.0, 0.0, 1.0], [0.0; 3], 50.0),
        ([0.0, 0.0, 1.0], [1.0, f64::INFINITY, 0.0], 50.0),
        ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], f64::NAN),
        ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], -1.0),
        ([1e300, 0.0, 1.0], [1.0, 0.0, 0.0], 50.0),
    ] {
        assert_eq!(tree.cast(origin, direction, range), None);
    }
}

#[test]
fn far_from_the_origin_of_the_map_distances_stay_sharp() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let (x, y) = (412_345.25, 5_412_345.5);
    let model = scene.meshes.model_sized(Kind::Block, Size::from_m(2.0, 2.0, 2.0), 0);
    scene.add_static(Instance::new(&model, x + 20.0, y, 0.0));
    scene.dynamics.push(Instance::new(&model, x - 20.0, y, 0.0));
    let tree = SceneTree::new(&scene).unwrap();
    for (direction, distance) in [(1.0, 19.0), (-1.0, 19.0)] {
        let hit = tree.cast([x, y, 1.0], [direction, 0.0, 0.0], 100.0).unwrap();
        assert!((f64::from(hit.distance_m) - distance).abs() < 1e-4, "{hit:?}");
    }
}

#[test]
fn a_ball_is_met_where_the_closed_form_says() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let mut builder = Builder::new(180.0);
    let material = builder.material(Material::default());
    builder.ball(material, [2.0; 3], (96, 48), |_, _| 1.0);
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
        // Facets lie inside the ball by at most their sagitta.
        assert!(off < 2.0 + 1e-4 && off > 2.0 * 0.997, "{off}");
    }
}

#[test]
fn points_of_a_plane_fit_it_within_the_noise() {
    let tree = SceneTree::new(&plain()).unwrap();
    let spec = LidarSpec { dropout: 0.0, reach_m: 1e4, range_step_m: 0.0, ..LidarPreset::Vlp32.spec() };
    let (sigma, height) = (spec.range_sigma_m, 1.9);
    let beams = spec.beams.clone();
    let cloud = turn(spec, &tree, at(3.0, -2.0, height), 1);
    let mut errors = Vec::new();
    for k in 0..cloud.len {
        let sine = swerve_geom::math::sin(beams[usize::from(cloud.ring[k])].elevation_rad);
        assert!(sine < 0.0);
        // The range that the plane gives is height / -sine.
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
fn threads_and_pieces_do_not_change_a_byte() {
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
fn the_same_turn_has_the_same_bits_on_every_machine() {
    // Own triangles only: a change of the shapes in the library is not a change here.
    let mut scene = plain();
    scene.set_weather(WeatherPreset::MidRainyNoon);
    let mut draws = Draws::new(8, 0xb175);
    let mut builder = Builder::new(20.0);
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
    let mut key = crate::hash::Key::default();
    for k in 0..cloud.len {
        cloud.point_m(k).iter().for_each(|x| key.number(*x));
        key.number(cloud.intensity[k]);
        key.number(cloud.offset_s[k]);
        key.word(u32::from(cloud.ring[k]));
    }
    assert_eq!((cloud.len, key.0), (18_611, 3_848_913_233_546_258_641));
}

#[test]
fn every_column_is_fired_once() {
    for (columns, rate_hz) in [(1800, 10.0), (2083, 10.0), (7, 333.0), (1, 20.0), (2048, 9.7)] {
        let spec = LidarSpec { columns, rate_hz, ..LidarSpec::default() };
        let sweeper = Sweeper::new(spec, 1).unwrap();
        let (mut next, mut from) = (0, -3_000_000);
        while from < sweeper.period_ns() {
            let fired = sweeper.columns_between(from, from + 5_000_000);
            assert_eq!(fired.start, next);
            for column in fired.clone() {
                assert!((from..from + 5_000_000).contains(&sweeper.column_ns(column)));
            }
            (next, from) = (fired.end, from + 5_000_000);
        }
        assert_eq!(next, columns);
        assert_eq!(sweeper.columns_between(9, 9).len(), 0);
        assert_eq!(sweeper.columns_between(i64::MIN, i64::MAX), 0..columns);
    }
    let sweeper = Sweeper::new(LidarSpec::default(), 1).unwrap();
    assert_eq!(sweeper.columns_between(5_000_000, 10_000_000), 90..180);
}

#[test]
fn a_moving_sensor_sees_each_column_from_its_own_place() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let wall = instance(&mut scene, wall(40.0), unmoved());
    scene.add_static(wall);
    let tree = SceneTree::new(&scene).unwrap();
    let spec = LidarPreset::Vlp32.spec().without_noise();
    let mut cloud = Cloud::new(&spec, false);
    let mut sweeper = Sweeper::new(spec, 1).unwrap();
    let speed = 15.0;
    // The sensor is at 0 when the turn begins, and drives towards the wall.
    sweeper.begin_turn(0, &mut cloud.as_mut());
    for step in 0..20_i64 {
        let pose = |ns: i64| at(speed * ns as f64 * 1e-9, 0.0, 1.5);
        let (begin_ns, end_ns) = (step * 5_000_000, (step + 1) * 5_000_000);
        let firing =
            Firing { begin_ns, begin: pose(begin_ns), end_ns, end: pose(end_ns), hidden_instance: None };
        sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap();
    }
    assert!(cloud.len > 8000, "{}", cloud.len);
    let (mut least, mut most) = (f32::INFINITY, 0.0_f32);
    for k in 0..cloud.len {
        let expected = 40.0 - speed as f32 * cloud.offset_s[k];
        assert!((cloud.x_m[k] - expected).abs() < 1e-3, "{} {expected}", cloud.x_m[k]);
        (least, most) = (least.min(cloud.x_m[k]), most.max(cloud.x_m[k]));
    }
    // A third of the turn sees the wall: 15 m/s in 0.03 to 0.07 s smear it by half a metre.
    assert!(most - least > 0.4, "{least} {most}");
    assert!(cloud.instance.is_empty() && cloud.class.is_empty());
}

#[test]
fn a_moving_car_is_seen_where_it_is_in_each_step() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let speed = 15.0;
    let model = scene.meshes.model_sized(Kind::Block, Size::from_m(4.0, 30.0, 3.0), 0);
    let mut tree = SceneTree::default();
    let spec = LidarSpec { first_azimuth_rad: FRAC_PI_2, ..LidarPreset::Vlp32.spec().without_noise() };
    let mut cloud = Cloud::new(&spec, true);
    let mut sweeper = Sweeper::new(spec, 1).unwrap();
    sweeper.begin_turn(0, &mut cloud.as_mut());
    for step in 0..20_i64 {
        let begin_ns = step * 5_000_000;
        scene.dynamics.clear();
        let x = 12.0 + speed * begin_ns as f64 * 1e-9;
        scene.dynamics.push(Instance::new(&model, x, 0.0, 0.0).with_id(4));
        tree.update(&scene).unwrap();
        let rest = Firing::turn_at_rest(&sweeper, at(0.0, 0.0, 1.5));
        let firing = Firing { begin_ns, end_ns: begin_ns + 5_000_000, ..rest };
        sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap();
    }
    let mut steps_seen = std::collections::BTreeSet::new();
    for k in 0..cloud.len {
        // Its rear face is 2 m behind its middle, which stands still within a step.
        let step = (f64::from(cloud.offset_s[k]) / 0.005 + 1e-4).floor();
        let face = 10.0 + speed * 0.005 * step;
        assert!((f64::from(cloud.x_m[k]) - face).abs() < 1e-3 || cloud.x_m[k] > face as f32, "{k}");
        assert_eq!((cloud.instance[k], cloud.class[k]), (4, SemanticClass::Static as u8));
        if (f64::from(cloud.x_m[k]) - face).abs() < 1e-3 {
            steps_seen.insert(step as u32);
        }
    }
    assert!(steps_seen.len() >= 5, "{steps_seen:?}");
}

#[test]
fn a_turning_sensor_sees_straight_what_its_poses_undo() {
    // Yaw rate of 1 rad/s: points put back with the pose at their instant lie on the wall.
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let wall = instance(&mut scene, wall(30.0), unmoved());
    scene.add_static(wall);
    let tree = SceneTree::new(&scene).unwrap();
    let spec = LidarPreset::Os1.spec().without_noise();
    let mut cloud = Cloud::new(&spec, false);
    let mut sweeper = Sweeper::new(spec, 1).unwrap();
    let pose = |s: f64| -> Transform<Map, Lidar> {
        Transform::from_roll_pitch_yaw(Point::new(5.0 * s, 1.0 - 2.0 * s, 1.5), 0.02, -0.01, -s)
    };
    sweeper.begin_turn(0, &mut cloud.as_mut());
    for step in 0..20_i64 {
        let (begin_ns, end_ns) = (step * 5_000_000, (step + 1) * 5_000_000);
        let (begin, end) = (pose(begin_ns as f64 * 1e-9), pose(end_ns as f64 * 1e-9));
        let firing = Firing { begin_ns, begin, end_ns, end, hidden_instance: None };
        sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap();
    }
    assert!(cloud.len > 10_000, "{}", cloud.len);
    for k in 0..cloud.len {
        let [x, y, z] = cloud.point_m(k).map(f64::from);
        let point = pose(f64::from(cloud.offset_s[k])) * Point::new(x, y, z);
        assert!((point.coords.x - 30.0).abs() < 2e-3, "{:?}", point);
    }
}

#[test]
fn the_share_of_dropouts_is_the_one_asked_for() {
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
fn rain_shortens_the_range_and_dims() {
    let farthest = |preset: WeatherPreset| {
        let mut scene = plain();
        scene.set_weather(preset);
        let tree = SceneTree::new(&scene).unwrap();
        let cloud = turn(few_columns(LidarPreset::Vlp32, 600), &tree, at(0.0, 0.0, 1.9), 1);
        let mut ranges: Vec<f32> =
            (0..cloud.len).map(|k| cloud.x_m[k].abs().max(cloud.y_m[k].abs())).collect();
        ranges.sort_by(f32::total_cmp);
        // Mean intensity of a ring that meets the ground at 15 m, which is seen in any weather.
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
fn signs_shine_and_intensity_stays_in_its_scale() {
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
    // The pole that carries it is dull.
    let dull = |k: &usize| cloud.instance[*k] == 3 && cloud.class[*k] != face;
    let dull: Vec<f32> = (0..cloud.len).filter(dull).map(|k| cloud.intensity[k]).collect();
    assert!(dull.len() > 3 && dull.iter().all(|i| *i < 0.5), "{dull:?}");
}

#[test]
fn the_vehicle_that_carries_it_can_be_hidden() {
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

#[test]
fn presets_have_the_tables_of_their_data_sheets() {
    for (preset, beams, columns, lowest, highest) in [
        (LidarPreset::Vlp32, 32, 1800, -25.0, 15.0),
        (LidarPreset::Hdl64, 64, 2083, -24.333, 2.0),
        (LidarPreset::Os1, 64, 2048, -16.611, 16.611),
    ] {
        let spec = preset.spec();
        assert_eq!(spec.check(), Ok(()));
        assert_eq!((spec.beams.len(), spec.columns, spec.rate_hz), (beams, columns, 10.0));
        let degrees: Vec<f64> = spec.beams.iter().map(|b| b.elevation_rad.to_degrees()).collect();
        assert!(degrees.windows(2).all(|pair| pair[0] < pair[1]), "{degrees:?}");
        assert!((degrees[0] - lowest).abs() < 1e-3 && (degrees[beams - 1] - highest).abs() < 1e-3);
        assert_eq!(preset.name().parse(), Ok(preset));
    }
    assert_eq!("os1".parse(), Ok(LidarPreset::Os1));
    let error = "vlp_33".parse::<LidarPreset>().unwrap_err().to_string();
    assert!(error.contains("`vlp_33`") && error.contains("hdl_64"), "{error}");
    let os1 = LidarPreset::Os1.beams();
    let steps: Vec<f64> =
        os1.windows(2).map(|pair| (pair[1].elevation_rad - pair[0].elevation_rad).to_degrees()).collect();
    assert!(steps.iter().all(|step| (step - 0.5273).abs() < 1e-3), "{steps:?}");
}

#[test]
fn lidars_that_cannot_be_are_refused_by_field() {
    let twins = |count: usize| vec![Beam { elevation_rad: 0.1, azimuth_rad: 0.0 }; count];
    type Change = Box<dyn Fn(&mut LidarSpec)>;
    let cases: Vec<(&str, Change)> = vec![
        ("`beams` is empty", Box::new(|s| s.beams.clear())),
        ("`beams` is a table of 513", Box::new(|s| s.beams.resize(513, Beam::default()))),
        ("`beams[1]` is at the angles of beams[0] (1 of 2", Box::new(move |s| s.beams = twins(2))),
        ("`beams[1]` is at the angles of beams[0] (199 of 200", Box::new(move |s| s.beams = twins(200))),
        ("`beams[3].elevation_rad` is NaN", Box::new(|s| s.beams[3].elevation_rad = f64::NAN)),
        ("`beams[0].elevation_rad` is 2", Box::new(|s| s.beams[0].elevation_rad = 2.0)),
        ("`beams[0].azimuth_rad` is inf", Box::new(|s| s.beams[0].azimuth_rad = f64::INFINITY)),
        ("`columns` is 0", Box::new(|s| s.columns = 0)),
        ("`columns` is 4000000000", Box::new(|s| s.columns = 4_000_000_000)),
        (
            "`beams x columns`",
            Box::new(|s| {
                s.columns = 16_384;
                s.beams =
                    (0..512).map(|k| Beam { elevation_rad: f64::from(k) * 1e-3, azimuth_rad: 0.0 }).collect();
            }),
        ),
        ("`rate_hz` is 0", Box::new(|s| s.rate_hz = 0.0)),
        ("`rate_hz` is -10", Box::new(|s| s.rate_hz = -10.0)),
        ("`rate_hz` is NaN", Box::new(|s| s.rate_hz = f64::NAN)),
        ("`first_azimuth_rad` is NaN", Box::new(|s| s.first_azimuth_rad = f64::NAN)),
        (
            "`range_min_m` is 120, expected less than",
            Box::new(|s| (s.range_min_m, s.range_max_m) = (120.0, 120.0)),
        ),
        (
            "`range_min_m` is 130, expected less than",
            Box::new(|s| (s.range_min_m, s.range_max_m) = (130.0, 120.0)),
        ),
        ("`range_min_m` is -1", Box::new(|s| s.range_min_m = -1.0)),
        ("`range_max_m` is inf", Box::new(|s| s.range_max_m = f64::INFINITY)),
        ("`reach_m` is 0", Box::new(|s| s.reach_m = 0.0)),
        ("`range_sigma_m` is -0.1", Box::new(|s| s.range_sigma_m = -0.1)),
        ("`range_step_m` is NaN", Box::new(|s| s.range_step_m = f64::NAN)),
        ("`dropout` is 1.5", Box::new(|s| s.dropout = 1.5)),
        ("`intensity_full_m` is NaN", Box::new(|s| s.intensity_full_m = f64::NAN)),
    ];
    for (message, change) in cases {
        let mut spec = LidarSpec::default();
        change(&mut spec);
        let error = Sweeper::new(spec, 1).map(|_| ()).unwrap_err().to_string();
        assert!(error.starts_with(message), "{error} for {message}");
        assert!(error.contains("expected"), "{error}");
    }
    let error = Sweeper::new(LidarSpec::default(), usize::MAX).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("`threads` is 18446744073709551615, expected at most 256"), "{error}");
    // Same elevation with other azimuth offsets is a stack of beams that some sensors have.
    let fan = (0..8).map(|k| Beam { elevation_rad: 0.0, azimuth_rad: 0.01 * f64::from(k) }).collect();
    assert!(Sweeper::new(LidarSpec { beams: fan, ..LidarSpec::default() }, 1).is_ok());
}

#[test]
fn firing_into_too_little_room_or_from_nowhere_is_refused() {
    let scene = plain();
    let tree = SceneTree::new(&scene).unwrap();
    let spec = few_columns(LidarPreset::Vlp32, 100);
    let mut sweeper = Sweeper::new(spec.clone(), 1).unwrap();
    let whole = Firing::turn_at_rest(&sweeper, at(0.0, 0.0, 1.9));
    let mut cloud = Cloud::new(&spec, true);
    cloud.ring.pop();
    let error = sweeper.fire(&tree, &whole, &mut cloud.as_mut()).unwrap_err();
    assert!(error.to_string().contains("`ring` of the cloud has 3199 elements, 3200"), "{error}");
    let mut cloud = Cloud::new(&spec, true);
    cloud.class.pop();
    assert!(
        sweeper.fire(&tree, &whole, &mut cloud.as_mut()).unwrap_err().to_string().contains("truth.class")
    );
    let mut cloud = Cloud::new(&spec, true);
    cloud.len = usize::MAX;
    assert!(sweeper.fire(&tree, &whole, &mut cloud.as_mut()).is_err());
    cloud.len = 0;
    for bad in [f64::NAN, f64::INFINITY, 1e9] {
        let firing = Firing { end: at(0.0, bad, 0.0), ..whole };
        let error = sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap_err();
        assert_eq!(error, FireError::Pose { when: "end" });
    }
    let backwards = Firing { begin_ns: 10, end_ns: 4, ..whole };
    let error = sweeper.fire(&tree, &backwards, &mut cloud.as_mut()).unwrap_err();
    assert_eq!(error, FireError::Backwards { by_ns: 6 });
    assert_eq!(cloud.len, 0);
    let for_ever = Firing { begin_ns: i64::MIN, end_ns: i64::MAX, ..whole };
    assert_eq!(sweeper.fire(&tree, &for_ever, &mut cloud.as_mut()).unwrap().columns, 0..100);
}

#[test]
fn scenes_that_cannot_be_placed_are_refused_and_empty_ones_are_not() {
    let mut tree = SceneTree::default();
    assert_eq!(tree.cast([0.0; 3], [1.0, 0.0, 0.0], 100.0), None);
    assert_eq!(tree.update(&Scene::default()), Ok(()));
    let mut scene = plain();
    let model = scene.meshes.model(Kind::Sedan, 1);
    scene.dynamics.push(Instance::new(&model, 0.0, 0.0, 0.0));
    scene.dynamics.push(Instance::new(&model, f64::NAN, 0.0, 0.0));
    assert_eq!(tree.update(&scene), Err(TreeError::Pose { part: "dynamic", index: 1 }));
    scene.dynamics[1] = Instance::new(&model, 1e12, 0.0, 0.0);
    assert_eq!(tree.update(&scene), Err(TreeError::Pose { part: "dynamic", index: 1 }));
    let mut other = Scene::default();
    other.dynamics.push(Instance::new(&model, 0.0, 0.0, 0.0));
    let error = tree.update(&other).unwrap_err().to_string();
    assert!(error.contains("instance 0 of the dynamic part has mesh 1, the library has 0"), "{error}");
    scene.dynamics.pop();
    scene.weather.rain = f64::NAN;
    assert!(tree.update(&scene).unwrap_err().to_string().contains("`rain`"));
}

#[test]
fn lidar_and_depth_image_agree() {
    let scene = town(WeatherPreset::ClearNoon, 2, 120.0);
    let tree = SceneTree::new(&scene).unwrap();
    let spec = CameraSpec {
        width_px: 160,
        height_px: 120,
        intrinsics: Intrinsics::HorizontalFovRad(1.2),
        ..CameraSpec::default()
    };
    let camera = Camera::new(spec).unwrap();
    let map_from_ego: Transform<Map, Ego> =
        Transform::from_roll_pitch_yaw(Point::new(0.0, -1.9, 0.0), 0.0, 0.0, 0.1);
    let map_from_camera = map_from_ego * mount([0.0, 0.0, 1.5], 0.0, 0.03, 0.0);
    let mut frame = Frame::new(&camera, Outputs::GEOMETRY);
    let mut renderer = Renderer::new(RenderOptions::default()).unwrap();
    renderer.render(&scene, &View::new(&camera, map_from_camera), frame.as_mut()).unwrap();
    let (mut agree, mut pixels) = (0, 0);
    for row in 0..120_usize {
        for column in 0..160_usize {
            let [x, y] = camera.ray([column as f64 + 0.5, row as f64 + 0.5]);
            let to = map_from_camera * swerve_geom::Vector::new(x, y, 1.0);
            let from = map_from_camera.origin().coords;
            let hit = tree.cast(from.into(), to.coords.into(), 300.0);
            let index = row * 160 + column;
            let depth = frame.depth_m[index];
            let by_ray = hit.map_or(f64::INFINITY, |h| f64::from(h.distance_m) / to.norm());
            pixels += 1;
            let close = (by_ray - f64::from(depth)).abs() <= 0.01 * by_ray;
            let same = hit.is_none_or(|h| {
                frame.semantic[index] == h.class as u8 && frame.instance[index] == h.instance_id
            });
            agree += u32::from((close || (hit.is_none() && depth > 250.0)) && same);
        }
    }
    // The others are at edges, and surfaces that the image shows from one side only.
    assert!(agree * 1000 > pixels * 985, "{agree} of {pixels}");
}

/// Inverse depth at a point of the image from the pixel there and the slopes around it; `None` at edges: where a
/// neighbour is of another thing, or the inverse depth, which is linear over a plane, bends by more than 1 %.
fn smooth_inverse_depth(frame: &Frame, width: usize, [column, row]: [f64; 2]) -> Option<f64> {
    let (x, y) = (column as usize, row as usize);
    let height = frame.depth_m.len() / width;
    if x == 0 || y == 0 || x + 1 >= width || y + 1 >= height {
        return None;
    }
    let at = y * width + x;
    let inverse = |k: usize| 1.0 / f64::from(frame.depth_m[k]);
    let same = |k: usize| (frame.instance[k], frame.semantic[k]) == (frame.instance[at], frame.semantic[at]);
    let around = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| y * width + x));
    let middle = inverse(at);
    let bends = |a: usize, b: usize| (inverse(a) + inverse(b) - 2.0 * middle).abs() > 0.01 * middle;
    let corners = bends(at - width - 1, at + width + 1) || bends(at - width + 1, at + width - 1);
    if !around.clone().all(same) || bends(at - 1, at + 1) || bends(at - width, at + width) || corners {
        return None;
    }
    let slope = |a: usize, b: usize| 0.5 * (inverse(b) - inverse(a));
    let (dx, dy) = (column - x as f64 - 0.5, row - y as f64 - 0.5);
    Some(middle + dx * slope(at - 1, at + 1) + dy * slope(at - width, at + width))
}

#[test]
fn the_depth_image_has_the_depth_of_each_point_at_its_pixel() {
    let scene = town(WeatherPreset::ClearNoon, 4, 100.0);
    let tree = SceneTree::new(&scene).unwrap();
    let width = 480;
    let spec = CameraSpec {
        width_px: width,
        height_px: 240,
        intrinsics: Intrinsics::HorizontalFovRad(1.2),
        ..CameraSpec::default()
    };
    let camera = Camera::new(spec).unwrap();
    // Both see from one place: what hides something from one hides it from the other.
    let map_from_ego: Transform<Map, Ego> =
        Transform::from_roll_pitch_yaw(Point::new(0.0, -1.9, 0.0), 0.0, 0.0, 0.1);
    let place = Point::new(0.0, 0.0, 1.8);
    let map_from_lidar = map_from_ego * Transform::<Ego, Lidar>::from_roll_pitch_yaw(place, 0.02, -0.01, 0.2);
    let map_from_camera = map_from_ego * mount([0.0, 0.0, 1.8], 0.0, 0.03, 0.0);
    let mut frame = Frame::new(&camera, Outputs::GEOMETRY);
    let mut renderer = Renderer::new(RenderOptions::default()).unwrap();
    renderer.render(&scene, &View::new(&camera, map_from_camera), frame.as_mut()).unwrap();
    let cloud = turn(few_columns(LidarPreset::Os1, 1024).without_noise(), &tree, map_from_lidar, 1);
    let camera_from_lidar = map_from_camera.inverse() * map_from_lidar;
    let (mut seen, mut smooth, mut agree) = (0, 0, 0);
    for k in 0..cloud.len {
        let [x, y, z] = cloud.point_m(k).map(f64::from);
        let point = camera_from_lidar * Point::new(x, y, z);
        let Some(pixel) = camera.project(point) else { continue };
        if pixel[0] < 0.0 || pixel[1] < 0.0 || pixel[0] >= f64::from(width) || pixel[1] >= 240.0 {
            continue;
        }
        seen += 1;
        let Some(inverse) = smooth_inverse_depth(&frame, width as usize, pixel) else { continue };
        smooth += 1;
        agree += usize::from((inverse * point.coords.z - 1.0).abs() < 0.005);
    }
    println!("{agree} of {smooth} smooth of {seen} points in the image");
    // The rest are things thinner than a pixel, which lie between the centres of pixels.
    assert!(smooth > 4000 && smooth * 2 > seen, "{smooth} of {seen}");
    assert!(agree * 1000 >= smooth * 998, "{agree} of {smooth}");
}
