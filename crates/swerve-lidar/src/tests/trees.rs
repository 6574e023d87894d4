//! Comparison of trees with a brute-force search, and with each other.

use core::f64::consts::FRAC_PI_2;

use swerve_scene::Size;
use swerve_scene::vector::normalized;
use wide::f32x8;

use super::*;

/// Random triangles, houses, cars and people in arbitrary poses.
fn jumble(seed: u64) -> Scene {
    let mut draws = Draws::new(seed, 0x11da);
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let mut builder = MeshBuilder::new(20.0);
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

/// Brute-force search over all triangles of all instances, in `f64` and the map frame (Möller-Trumbore): nearest
/// distance in multiples of the length of `to`, and the instance id.
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
fn tree_matches_a_brute_force_search() {
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
                // A ray within rounding of an edge may pass on the other side.
                _ => others += 1,
            }
        }
    }
    assert!(hits > 500 && misses > 500 && others <= 1, "{hits} {misses} {others}");
}

#[test]
fn packets_match_single_rays_bit_for_bit() {
    let scene = jumble(9);
    let tree = SceneTree::new(&scene).unwrap();
    let mut draws = Draws::new(4, 0x9ac);
    let mut memory = RayMemory::default();
    let mut hits = 0;
    for k in 0..600 {
        // Some packets are narrow, some diverge, some are in an axis-aligned plane.
        let spread = [0.01, 0.2, 2.0][k % 3];
        let middle = [0, 1, 2].map(|_| draws.between(-1.0, 1.0));
        let flat = k % 5 == 0;
        let start = [0, 1, 2].map(|_| draws.between(-30.0, 30.0));
        let (mut origins, mut directions) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
        for lane in 0..8 {
            let direction = normalized([0, 1, 2].map(|axis| {
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
fn updated_tree_matches_a_fresh_one() {
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
fn static_instances_beyond_the_triangle_limit_are_hit_too() {
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
fn hits_report_distance_surface_and_side() {
    let mut scene = plain();
    let model = scene.meshes.model_sized(Kind::Block, Size::from_m(2.0, 4.0, 3.0), 0);
    let quarter = Transform::from_roll_pitch_yaw(Point::new(10.0, 0.0, 0.0), 0.0, 0.0, FRAC_PI_2);
    scene.dynamics.push(Instance::placed(&model, quarter).with_id(7));
    let tree = SceneTree::new(&scene).unwrap();
    // The box is 4 m long in x after its quarter turn: its face is at x = 8.
    let hit = tree.cast([0.0, 0.5, 1.0], [2.0, 0.0, 0.0], 100.0).unwrap();
    assert!((hit.distance_m - 8.0).abs() < 1e-5, "{hit:?}");
    assert_eq!((hit.instance_id, hit.class, hit.mesh), (7, SemanticClass::Static, model.mesh));
    assert!((hit.normal[0] + 1.0).abs() < 1e-6, "{hit:?}");
    let own = scene.meshes.get(hit.mesh).materials()[usize::from(hit.material)];
    assert_eq!((hit.reflectance, hit.is_retro_reflective), (own.reflectance, own.is_retro_reflective));
    // Hidden: the ray passes through without a hit; from inside, the far face is hit from behind.
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
fn distances_are_precise_far_from_the_map_origin() {
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
fn tree_rejects_invalid_poses_and_accepts_empty_scenes() {
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
