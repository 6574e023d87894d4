//! Positions of objects in the image.

use super::*;

/// Smallest and largest column and row of an instance's pixels.
fn pixel_box(frame: &Frame, id: u32) -> Option<[f64; 4]> {
    let hits = frame.instance.iter().enumerate().filter(|(_, i)| **i == id);
    let mut found: Option<[f64; 4]> = None;
    for (k, _) in hits {
        let (x, y) = ((k % frame.width_px) as f64, (k / frame.width_px) as f64);
        let b = found.get_or_insert([x, y, x + 1.0, y + 1.0]);
        *b = [b[0].min(x), b[1].min(y), b[2].max(x + 1.0), b[3].max(y + 1.0)];
    }
    found
}

#[test]
fn depth_of_a_plane_matches_its_closed_form() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let mesh = scene.meshes.add(flat(500.0));
    scene.add_static(instance(mesh, [0.0; 3], 0.3, SemanticClass::Road));
    let camera = small(|_| {});
    let (height, pitch) = (1.6, 0.2);
    let frame = shot(&scene, &View::new(&camera, looking([3.0, -2.0, height], pitch, 0.5)));
    let mut seen = 0;
    for row in 0..120 {
        for column in 0..160 {
            let [_, y] = camera.ray([f64::from(column) + 0.5, f64::from(row) + 0.5]);
            // The ray descends by sin(pitch) + y cos(pitch) per unit of depth.
            let fall = swerve_geom::math::sin(pitch) + y * swerve_geom::math::cos(pitch);
            let depth = f64::from(frame.depth_m[(row * 160 + column) as usize]);
            if fall > 0.01 {
                let expected = height / fall;
                assert!((depth - expected).abs() < 1e-4 * expected, "({column}, {row}): {depth} {expected}");
                seen += 1;
            } else if fall < 0.0 {
                assert!(depth.is_infinite(), "({column}, {row})");
            }
        }
    }
    assert!(seen > 9000);
}

#[test]
fn ids_and_classes_are_those_of_the_nearest_surface() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let block = scene.meshes.model(Kind::Block, 0);
    scene.add_static(Instance::new(&block, 10.0, 0.0, 0.0).with_id(7));
    let sedan = scene.meshes.model(Kind::Sedan, 1);
    scene.dynamics.push(Instance::new(&sedan, 14.0, 0.0, 0.5).with_id(70_000));
    let camera = small(|_| {});
    let frame = shot(&scene, &View::new(&camera, looking([0.0, 0.0, 0.7], 0.0, 0.0)));
    let at = |column: usize, row: usize| {
        let k = row * 160 + column;
        (frame.instance[k], frame.semantic[k], frame.depth_m[k])
    };
    assert_eq!(at(80, 60), (7, SemanticClass::Static as u8, 9.5));
    // Beside the block (1 m wide, 8 pixels) the car behind it is visible, with its own id and depth.
    let beside = (0..160).map(|c| at(c, 60)).filter(|(id, ..)| *id == 70_000);
    let (count, right) = beside.fold((0, 0), |(count, right), (_, class, depth)| {
        (count + 1, right + u32::from(class == SemanticClass::Car as u8 && depth > 11.0 && depth < 17.0))
    });
    assert!(count > 4 && count == right, "{right} of {count}");
    assert_eq!((at(80, 5).0, at(80, 5).1), (0, SemanticClass::Sky as u8));
    assert!(at(80, 5).2.is_infinite());
}

/// Bounds of points in a camera's image.
fn seen_box(
    camera: &Camera,
    pose: &Pose,
    placed: &Instance,
    points: impl Iterator<Item = [f32; 3]>,
) -> [f64; 4] {
    let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for p in points {
        let [x, y, z] = p.map(f64::from);
        let in_camera = pose.inverse() * (placed.map_from_body * Point::new(x, y, z));
        let [u, v] = camera.project(in_camera).expect("in front of the camera");
        bounds = [bounds[0].min(u), bounds[1].min(v), bounds[2].max(u), bounds[3].max(v)];
    }
    bounds
}

#[test]
fn projected_boxes_enclose_the_pixels_of_their_instance() {
    let kinds = [
        Kind::Sedan,
        Kind::BoxTruck,
        Kind::Pedestrian { phase: 3 },
        Kind::Cyclist { phase: 1 },
        Kind::StopSign,
    ];
    let lens = Distortion { k1: -0.2, k2: 0.04, p1: 0.001, p2: -0.001, k3: 0.0 };
    for distortion in [Distortion::default(), lens] {
        let camera = small(|s| {
            (s.width_px, s.height_px, s.distortion) = (640, 480, distortion);
        });
        let mut draws = Draws::new(3, 3);
        for (k, kind) in kinds.into_iter().cycle().take(15).enumerate() {
            let mut scene = Scene::new(WeatherPreset::ClearNoon);
            let model = scene.meshes.model(kind, k as u64);
            let mut d = |low: f32, high: f32| f64::from(draws.between(low, high));
            let placed = Instance::new(&model, d(9.0, 25.0), d(-3.0, 3.0), d(0.0, 6.0)).with_id(5);
            scene.dynamics.push(placed);
            let pose = looking([0.0, 0.0, d(0.8, 2.0)], d(-0.02, 0.05), d(-0.2, 0.2));
            let frame = shot(&scene, &View::new(&camera, pose));
            let pixels = pixel_box(&frame, 5).expect("it is seen");
            let mesh = scene.meshes.get(model.mesh);
            let (min, max) = mesh.bounds();
            let corners =
                (0..8).map(|c| [0, 1, 2].map(|axis| if c >> axis & 1 == 0 { min[axis] } else { max[axis] }));
            let outer = seen_box(&camera, &pose, &placed, corners);
            let inner = seen_box(&camera, &pose, &placed, mesh.positions().iter().copied());
            for side in 0..4 {
                let sign = if side < 2 { 1.0 } else { -1.0 };
                assert!(sign * (pixels[side] - outer[side]) > -1.0, "{kind:?}: {pixels:?} not in {outer:?}");
                let limit = [0.0, 0.0, 640.0, 480.0][side];
                let expected = if side < 2 { inner[side].max(limit) } else { inner[side].min(limit) };
                assert!((pixels[side] - expected).abs() < 2.0, "{kind:?}: {pixels:?} is not {inner:?}");
            }
        }
    }
}

#[test]
fn images_of_any_size_match_crops_of_larger_ones() {
    let scene = town(WeatherPreset::ClearNoon, 3, 40.0);
    let matrix = Intrinsics::Matrix([[90.0, 0.0, 60.0], [0.0, 95.0, 40.0], [0.0, 0.0, 1.0]]);
    let sized = |width: u32, height: u32| {
        let camera = small(|s| (s.width_px, s.height_px, s.intrinsics) = (width, height, matrix));
        shot(&scene, &View::new(&camera, looking([0.0, -1.9, 1.4], 0.05, 0.0)))
    };
    let full = sized(160, 120);
    for (width, height) in [(1, 1), (7, 3), (9, 17), (64, 33), (81, 120)] {
        let part = sized(width, height);
        let (width, height) = (width as usize, height as usize);
        for k in 0..width * height {
            let whole = k / width * 160 + k % width;
            let of =
                |frame: &Frame, k: usize| (frame.depth_m[k].to_bits(), frame.semantic[k], frame.instance[k]);
            assert_eq!(of(&part, k), of(&full, whole), "{width} x {height}: {k}");
            // Neighbours in a group of eight share a mip level, so only whole groups have equal colours.
            if k % width < width / 8 * 8 {
                assert_eq!(part.rgb[3 * k..3 * k + 3], full.rgb[3 * whole..3 * whole + 3]);
            }
        }
    }
}

#[test]
fn surfaces_through_the_camera_have_no_holes() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    // Ground of ten thousand triangles with irregular corners, below, beside and behind the camera.
    let mut draws = Draws::new(5, 5);
    let mut parts = MeshParts { materials: vec![Material::default()], ..MeshParts::default() };
    let side = 71_u32;
    for k in 0..side * side {
        let (i, j) = ((k % side) as f32 - 35.0, (k / side) as f32 - 35.0);
        parts.positions.push([2.0 * i + draws.between(-0.8, 0.8), 2.0 * j + draws.between(-0.8, 0.8), 0.0]);
        parts.normals.push([0.0, 0.0, 1.0]);
        parts.uvs.push([0.0; 2]);
    }
    for k in 0..(side - 1) * (side - 1) {
        let a = k / (side - 1) * side + k % (side - 1);
        parts.triangles.extend([[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]);
        parts.triangle_materials.extend([0, 0]);
    }
    let mesh = scene.meshes.add(Mesh::new(parts).unwrap());
    scene.add_static(instance(mesh, [0.0; 3], 0.0, SemanticClass::Road));
    let camera = small(|_| {});
    for (k, yaw) in
        [0.0, 0.3, core::f64::consts::FRAC_PI_4, core::f64::consts::FRAC_PI_2, 2.0].into_iter().enumerate()
    {
        let frame = shot(&scene, &View::new(&camera, looking([0.1 * k as f64, 0.0, 0.5], 0.9, yaw)));
        let holes = frame.semantic.iter().filter(|c| **c != SemanticClass::Road as u8).count();
        assert_eq!(holes, 0, "yaw {yaw}");
    }
    let close = small(|s| s.near_m = 1.0);
    let frame = shot(&scene, &View::new(&close, looking([0.0, 0.0, 0.5], 0.9, 0.0)));
    assert!(frame.depth_m.iter().all(|d| *d >= 0.999));
    assert!(frame.semantic.contains(&(SemanticClass::Sky as u8)));
}

#[test]
fn orthographic_camera_renders_a_map_to_scale() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let ground = scene.meshes.add(flat(400.0));
    scene.add_static(instance(ground, [0.0; 3], 0.0, SemanticClass::Road));
    // 4.8 m along x and 2 m along y, 1.5 m high: 24 x 10 pixels at any position.
    let model = scene.meshes.model_sized(Kind::Block, Size::from_m(4.8, 2.0, 1.5), 0);
    scene.dynamics.push(Instance::new(&model, 112.0, 46.0, 0.0).with_id(7));
    scene.dynamics.push(Instance::new(&model, 93.0, 56.0, 0.0).with_id(8));
    let camera = small(|s| s.intrinsics = Intrinsics::OrthographicMPerPx(0.2));
    assert!(camera.is_orthographic());
    // From 40 m above; the top of the image is the car's heading.
    let pose = looking([100.0, 50.0, 40.0], core::f64::consts::FRAC_PI_2, 0.0);
    let frame = shot(&scene, &View::new(&camera, pose));
    assert_eq!(pixel_box(&frame, 7), Some([95.0, 0.0, 105.0, 12.0]));
    assert_eq!(pixel_box(&frame, 8), Some([45.0, 83.0, 55.0, 107.0]));
    for (k, id) in frame.instance.iter().enumerate() {
        let expected = if *id == 0 { 40.0 } else { 38.5 };
        assert!((frame.depth_m[k] - expected).abs() < 1e-3, "{k}: {}", frame.depth_m[k]);
        let class = if *id == 0 { SemanticClass::Road } else { SemanticClass::Static };
        assert_eq!(frame.semantic[k], class as u8);
    }
    let p = pose.inverse() * Point::new(93.0 + 2.4, 56.0 - 1.0, 1.5);
    let [column, row] = camera.project(p).unwrap();
    assert!((column - 55.0).abs() < 1e-9 && (row - 83.0).abs() < 1e-9, "{column} {row}");
    // Objects nearer than the near plane or beyond the far plane are not visible.
    let cut =
        small(|s| (s.intrinsics, s.near_m, s.far_m) = (Intrinsics::OrthographicMPerPx(0.2), 10.0, 39.0));
    let frame = shot(&scene, &View::new(&cut, pose));
    let seen = frame.depth_m.iter().filter(|d| d.is_finite()).count();
    assert_eq!(seen, frame.instance.iter().filter(|id| **id != 0).count());
    let low = looking([100.0, 50.0, 11.0], core::f64::consts::FRAC_PI_2, 0.0);
    let frame = shot(&scene, &View::new(&cut, low));
    assert!(
        frame.instance.iter().all(|id| *id == 0) && frame.depth_m.iter().all(|d| (*d - 11.0).abs() < 1e-3)
    );
}

#[test]
fn walking_pedestrian_changes_the_image() {
    let camera = small(|_| {});
    let at_phase = |phase: u8| {
        let mut scene = Scene::new(WeatherPreset::ClearNoon);
        let model = scene.meshes.model_sized(Kind::Pedestrian { phase }, Size::from_m(1.0, 0.6, 1.75), 1);
        scene.dynamics.push(Instance::new(&model, 4.0, 0.0, core::f64::consts::FRAC_PI_2).with_id(1));
        shot(&scene, &View::new(&camera, looking([0.0, 0.0, 1.2], 0.0, 0.0)))
    };
    let (a, b) = (at_phase(0), at_phase(4));
    let changed = a.instance.iter().zip(&b.instance).filter(|(a, b)| a != b).count();
    let person = a.instance.iter().filter(|id| **id == 1).count();
    assert!(person > 150 && changed > person / 10 && changed < person, "{changed} of {person}");
}
