//! Light, shadows, blur and noise.

use super::*;

#[test]
fn weathers_give_different_images() {
    let camera = small(|_| {});
    let mut scene = town(WeatherPreset::ClearNoon, 1, 60.0);
    let mut renderer = renderer(1);
    let images = WeatherPreset::ALL.map(|preset| {
        scene.set_weather(preset);
        let mut frame = Frame::new(&camera, Outputs::ALL);
        let view = View::new(&camera, looking([0.0, -1.9, 1.4], 0.03, 0.0));
        renderer.render(&scene, &view, frame.as_mut()).unwrap();
        frame
    });
    for (k, image) in images.iter().enumerate() {
        for (j, other) in images.iter().enumerate().take(k) {
            let difference: u64 =
                image.rgb.iter().zip(&other.rgb).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
            let mean = difference as f64 / image.rgb.len() as f64;
            assert!(mean > 1.0, "{:?} and {:?}: {mean}", WeatherPreset::ALL[k], WeatherPreset::ALL[j]);
            assert!(image.depth_m == other.depth_m && image.semantic == other.semantic);
        }
    }
}

#[test]
fn blur_and_rolling_shutters_show_motion_and_leave_ids_sharp() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let model = scene.meshes.model_sized(Kind::Block, Size::from_m(1.0, 1.0, 8.0), 0);
    let mut thing = Instance::new(&model, 8.0, 0.0, 0.0).with_id(1);
    thing.motion.linear_mps = [0.0, -20.0, 0.0];
    scene.dynamics.push(thing);
    let pose = looking([0.0, 0.0, 4.0], 0.0, 0.0);
    let image = |shutter: Shutter| shot(&scene, &View::new(&small(|s| s.shutter = shutter), pose));
    let sharp = image(Shutter::default());
    let blurred = image(Shutter { exposure_s: 0.03, blur_samples: 5, ..Shutter::default() });
    assert!(
        sharp.rgb != blurred.rgb && sharp.instance == blurred.instance && sharp.depth_m == blurred.depth_m
    );
    let rolling = image(Shutter { readout_s: 0.05, readout_slabs: 8, ..Shutter::default() });
    let middle = |frame: &Frame, row: usize| {
        let hits: Vec<usize> = (0..160).filter(|c| frame.instance[row * 160 + c] == 1).collect();
        hits.iter().sum::<usize>() as f64 / hits.len() as f64
    };
    // 20 m/s at 7.5 m are 10.7 pixels over all rows; between the centres of the slabs at 24 and 88, 64 rows apart, 5.7.
    let lean = middle(&rolling, 90) - middle(&rolling, 30);
    let upright = middle(&sharp, 90) - middle(&sharp, 30);
    assert!(upright.abs() < 0.01 && (lean - 5.7).abs() < 1.1, "{lean}");
}

#[test]
fn hidden_instance_keeps_its_shadow() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let ground = scene.meshes.add(flat(100.0));
    scene.add_static(instance(ground, [0.0; 3], 0.0, SemanticClass::Road));
    let camera = small(|_| {});
    let mut view = View::new(&camera, looking([-8.0, 0.0, 4.0], 0.4, 0.0));
    let empty = shot(&scene, &view);
    let model = scene.meshes.model(Kind::Van, 0);
    scene.dynamics.push(Instance::new(&model, 2.0, 0.0, 0.0).with_id(9));
    view.hidden_instance = Some(9);
    let hidden = shot(&scene, &view);
    assert!(hidden.instance == empty.instance && hidden.depth_m == empty.depth_m);
    let darker = hidden.rgb.iter().zip(&empty.rgb).filter(|(a, b)| **a + 20 < **b).count();
    let brighter = hidden.rgb.iter().zip(&empty.rgb).filter(|(a, b)| **a > **b + 2).count();
    assert!(darker > 500 && brighter == 0, "{darker} {brighter}");
    view.hidden_instance = None;
    assert!(shot(&scene, &view).instance.contains(&9));
}

#[test]
fn lamps_shine_when_they_are_on() {
    let camera = small(|_| {});
    let view = View::new(&camera, looking([-2.2, 0.0, 0.9], 0.0, 0.0));
    let red = |on: bool| {
        let mut scene = Scene::new(WeatherPreset::ClearNight);
        let model = scene.meshes.model(Kind::Sedan, 1);
        let mut car = Instance::new(&model, 2.0, 0.0, 0.0).with_id(1);
        car.look = car.look.with_lamp(lamps::BRAKE, on);
        scene.dynamics.push(car);
        let frame = shot(&scene, &view);
        frame.rgb.chunks_exact(3).filter(|p| p[0] > 200 && p[1] < 150 && p[2] < 150).count()
    };
    assert_eq!(red(false), 0);
    assert!(red(true) > 10);
}

#[test]
fn noise_has_its_size_and_follows_seed_and_frame() {
    let mut scene = Scene::new(WeatherPreset::CloudyNoon);
    let mesh = scene.meshes.add(flat(500.0));
    scene.add_static(instance(mesh, [0.0; 3], 0.0, SemanticClass::Ground));
    let clean = small(|s| s.exposure = Exposure::Factor(0.4));
    let noisy = small(|s| {
        s.exposure = Exposure::Factor(0.4);
        s.noise = SensorNoise { read: 0.01, shot: 0.0, seed: 4 };
    });
    let pose = looking([0.0, 0.0, 2.0], 1.3, 0.0);
    let (a, b) = (shot(&scene, &View::new(&clean, pose)), shot(&scene, &View::new(&noisy, pose)));
    let differences: Vec<f64> =
        a.rgb.iter().zip(&b.rgb).map(|(a, b)| f64::from(*b) - f64::from(*a)).collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    let deviation = (differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64).sqrt();
    // The tone curve maps 0.01 of full scale to about 6 of 255 at this grey; its curvature shifts the mean slightly.
    assert!(mean.abs() < 1.0 && (4.0..9.0).contains(&deviation), "{mean} {deviation}");
    let later = shot(&scene, &View { frame: 1, ..View::new(&noisy, pose) });
    assert!(later.rgb != b.rgb && later.depth_m == b.depth_m);
    assert!(shot(&scene, &View::new(&noisy, pose)) == b);
}

/// Mean pixel value of an instance, 0 to 255.
fn mean_of(frame: &Frame, id: u32) -> f64 {
    let pixels = frame.rgb.chunks_exact(3).zip(&frame.instance).filter(|(_, of)| **of == id);
    let (sum, n) = pixels.fold((0.0, 0.0), |(sum, n), (p, _)| {
        (sum + p.iter().map(|c| f64::from(*c)).sum::<f64>() / 3.0, n + 1.0)
    });
    assert!(n > 20.0, "{n} pixels of {id}");
    sum / n
}

/// Night without street lamps: 4 m ahead of the lamps and beside the lane, where a wide beam is needed; 25 m ahead,
/// where UN Regulation 112 requires as much light as street lamps give; and 60 m, the range of low beams.
#[test]
fn head_lamps_light_people_in_front_of_them() {
    let camera = small(|s| (s.width_px, s.height_px) = (800, 600));
    let view = View::new(&camera, looking([-0.5, 0.0, 1.3], 0.0, 0.0));
    let image = |lit: bool, [x, y]: [f64; 2]| {
        let mut scene = Scene::new(WeatherPreset::ClearNight);
        let ground = scene.meshes.add(flat(200.0));
        scene.add_static(instance(ground, [0.0; 3], 0.0, SemanticClass::Road));
        let model = scene.meshes.model(Kind::Pedestrian { phase: 3 }, 5);
        scene.dynamics.push(Instance::new(&model, x, y, 0.0).with_id(7));
        if lit {
            let body = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
            scene.lights.extend(swerve_scene::Light::head_lamps(&body, 0.0, 0.7));
        }
        mean_of(&shot(&scene, &view), 7)
    };
    for (place, least) in [([4.0, 2.8], 60.0), ([25.0, 0.5], 60.0), ([60.0, 0.0], 0.0)] {
        let (dark, light) = (image(false, place), image(true, place));
        assert!(light > least && light > dark + 4.0, "{place:?}: {light:.0} with lamps, {dark:.0} without");
    }
}

/// Road between the camera and an oncoming car.
#[test]
fn oncoming_head_lamps_light_the_road() {
    let camera = small(|_| {});
    let view = View::new(&camera, looking([0.0, -2.0, 4.0], 0.15, 0.0));
    let road = |lit: bool| {
        let mut scene = Scene::new(WeatherPreset::ClearNight);
        // Grey and rough, like asphalt.
        let asphalt = Material { is_ground: true, ..Material::matt([0.1; 3], 0.2) };
        let parts = MeshParts { materials: vec![asphalt], ..flat_parts(200.0) };
        let ground = scene.meshes.add(Mesh::new(parts).unwrap());
        scene.add_static(Instance { instance_id: 3, ..instance(ground, [0.0; 3], 0.0, SemanticClass::Road) });
        if lit {
            let body =
                Transform::from_roll_pitch_yaw(Point::new(40.0, 1.8, 0.0), 0.0, 0.0, core::f64::consts::PI);
            scene.lights.extend(swerve_scene::Light::head_lamps(&body, 0.0, 0.7));
        }
        let frame = shot(&scene, &view);
        // From 20 to 36 m: 4 to 20 m in front of the lamps.
        let near = |d: &f32| (20.0..36.0).contains(d);
        let pixels = frame.rgb.chunks_exact(3).zip(&frame.depth_m).filter(|(_, d)| near(d));
        let brightest = pixels.map(|(p, _)| p[1]).max();
        f64::from(brightest.unwrap())
    };
    let (dark, light) = (road(false), road(true));
    assert!(light > 60.0 && light > 2.0 * dark, "{light} with lamps, {dark} without");
}
